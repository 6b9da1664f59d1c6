#define COILWRIGHT_ROWS (2 * COILWRIGHT_DELAY + 1)

/* The newest reading is the last. */
typedef struct {
  double outer[COILWRIGHT_ROWS];
  double difference[COILWRIGHT_ROWS];
  int count;
} coilwright_state;

static void coilwright_start(coilwright_state *s) {
  s->count = 0;
}

/* Slope of the straight line through rows one interval apart. */
static double coilwright_slope(const double *rows, int count) {
  double mean = 0.0, xx = 0.0, xy = 0.0, middle = 0.5 * (count - 1);
  int i;
  if (count < 2) return 0.0;
  for (i = 0; i < count; ++i) mean += rows[i] / count;
  for (i = 0; i < count; ++i) {
    xx += (i - middle) * (i - middle);
    xy += (i - middle) * (rows[i] - mean);
  }
  return xy / xx / @interval@;
}

static double coilwright_step(coilwright_state *s, double temperature_c, @inner@int valid) {
  int i, row;
  if (valid || s->count > 0) {
    double outer = valid ? temperature_c : s->outer[s->count - 1];
    double difference = valid ? @difference@ : s->difference[s->count - 1];
    if (s->count == COILWRIGHT_ROWS) {
      for (i = 1; i < COILWRIGHT_ROWS; ++i) {
        s->outer[i - 1] = s->outer[i];
        s->difference[i - 1] = s->difference[i];
      }
      s->count--;
    }
    s->outer[s->count] = outer;
    s->difference[s->count] = difference;
    s->count++;
  }
  /* Before there is a row so long ago, the first one stands for it. */
  row = s->count > COILWRIGHT_DELAY ? s->count - 1 - COILWRIGHT_DELAY : 0;
  if (s->count == 0) return @offset@;
  return @offset@ + @per_temperature@ * (s->outer[row] - 20.0)
    + @per_rate@ * coilwright_slope(s->outer, s->count)
    + @per_difference@ * coilwright_slope(s->difference, s->count);
}
