#define COILWRIGHT_LINES @lines@

typedef struct {
  double last;
} coilwright_state;

static const double coilwright_until[COILWRIGHT_LINES] = {@until@};
static const double coilwright_at_20_c[COILWRIGHT_LINES] = {@at@};
static const double coilwright_slope[COILWRIGHT_LINES] = {@slope@};

static void coilwright_start(coilwright_state *s) {
  s->last = 0.0;
}

static double coilwright_step(coilwright_state *s, double temperature_c, int valid) {
  int i = 0;
  if (!valid) return s->last;
  while (i < COILWRIGHT_LINES - 1 && !(temperature_c < coilwright_until[i])) ++i;
  s->last = coilwright_at_20_c[i] + coilwright_slope[i] * (temperature_c - 20.0);
  return s->last;
}
