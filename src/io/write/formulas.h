/* Formulas beside the coil's own error. Call coilwright_gyro_step instead of coilwright_step: it returns the whole rate error
   [deg/h] of the call COILWRIGHT_DELAY calls ago. columns: the further columns of this call, in the order of the model's
   formulas; a rate sees their mean over @mean@ s, by a straight line from the call before. What a formula remembers begins
   at rest. */
#define COILWRIGHT_LAYERS @layers@
#define COILWRIGHT_MEMORIES @memories@
#define COILWRIGHT_COLUMNS @columns@

typedef struct {
  double time_s, input, value;
  int known;
} coilwright_slot;

typedef struct {
  coilwright_slot slot[COILWRIGHT_MEMORIES];
  double now_s;
} coilwright_memory;

/* The pack as one call found it. */
typedef struct {
  double time_s, mean, mean_rate, air, air_rate;
  double temperature[COILWRIGHT_LAYERS], rate[COILWRIGHT_LAYERS];
  double column[COILWRIGHT_COLUMNS];
  int known;
} coilwright_pack;

typedef struct {
  coilwright_state coil;
  coilwright_memory memory;
  coilwright_pack pack[COILWRIGHT_DELAY + 1];
  double column[COILWRIGHT_COLUMNS], column_s;
  int called;
} coilwright_gyro;

static const double coilwright_layer[COILWRIGHT_LAYERS][COILWRIGHT_STATES] = {
@temperatures@
};
static const double coilwright_layer_rate[COILWRIGHT_LAYERS][COILWRIGHT_STATES] = {
@rates@
};
static const double coilwright_share[COILWRIGHT_LAYERS] = {@shares@};

static double sign_coilwright(double x) { return (x > 0.0) - (x < 0.0); }

static double softplus_coilwright(double x) { return (x > 0.0 ? x : 0.0) + log1p(exp(-fabs(x))); }

static double lag_coilwright(coilwright_memory *m, int place, double x, double tau_s) {
  coilwright_slot *s = &m->slot[place];
  double value = x;
  if (!isfinite(x)) return x;
  if (s->known && tau_s > 0.0) {
    double steps = (m->now_s - s->time_s) / tau_s, gone;
    if (steps < 0.0) steps = 0.0;
    gone = -expm1(-steps);
    value = steps == 0.0 ? s->value : s->value + (s->input - s->value) * gone + (x - s->input) * (1.0 - gone / steps);
  }
  s->known = 1;
  s->time_s = m->now_s;
  s->input = x;
  s->value = value;
  return value;
}

static double play_coilwright(coilwright_memory *m, int place, double x, double half_width) {
  coilwright_slot *s = &m->slot[place];
  double value = x;
  if (!isfinite(x)) return x;
  if (s->known) {
    value = s->value;
    if (value < x - half_width) value = x - half_width;
    if (value > x + half_width) value = x + half_width;
  }
  s->known = 1;
  s->time_s = m->now_s;
  s->input = x;
  s->value = value;
  return value;
}

static void coilwright_gyro_start(coilwright_gyro *g) {
  int i;
  coilwright_start(&g->coil);
  for (i = 0; i < COILWRIGHT_MEMORIES; ++i) g->memory.slot[i].known = 0;
  for (i = 0; i <= COILWRIGHT_DELAY; ++i) g->pack[i].known = 0;
  g->called = 0;
}

static double coilwright_formulas(coilwright_memory *m, const coilwright_pack *p, double thermal_rate) {
  double sum = 0.0;
  (void)thermal_rate;
  if (!p->known) return 0.0;
  m->now_s = p->time_s;
@sum@
  return isfinite(sum) ? sum : 0.0;
}

static double coilwright_gyro_step(coilwright_gyro *g, double time_s, double temperature_c, int valid, const double *columns) {
  double rate = coilwright_step(&g->coil, temperature_c, valid), state[COILWRIGHT_STATES], weights = 0.0;
  coilwright_pack *p = &g->pack[0];
  int i, j;
  for (i = COILWRIGHT_DELAY; i > 0; --i) g->pack[i] = g->pack[i - 1];
  p->known = g->coil.count > 0;
  p->time_s = time_s;
  for (j = 0; j < COILWRIGHT_STATES; ++j) state[j] = 0.0;
  for (i = 0; i < g->coil.count; ++i) {
    double weight = exp(g->coil.h[i].log_weight);
    weights += weight;
    for (j = 0; j < COILWRIGHT_STATES; ++j) state[j] += weight * g->coil.h[i].v[j];
  }
  p->mean = p->mean_rate = 0.0;
  for (i = 0; p->known && i < COILWRIGHT_LAYERS; ++i) {
    p->temperature[i] = g->coil.origin;
    p->rate[i] = 0.0;
    for (j = 0; j < COILWRIGHT_STATES; ++j) {
      p->temperature[i] += coilwright_layer[i][j] * state[j] / weights;
      p->rate[i] += coilwright_layer_rate[i][j] * state[j] / weights;
    }
    p->mean += coilwright_share[i] * p->temperature[i];
    p->mean_rate += coilwright_share[i] * p->rate[i];
  }
  p->air = g->coil.origin + state[@air@] / (weights > 0.0 ? weights : 1.0);
  p->air_rate = state[@slope@] / (weights > 0.0 ? weights : 1.0);
  for (i = 0; columns && i < COILWRIGHT_COLUMNS; ++i) {
    double since_s = time_s - g->column_s, change = columns[i] - g->column[i];
    p->column[i] = columns[i];
    if (g->called && since_s > 0.0 && isfinite(g->column[i]))
      p->column[i] = columns[i] - change * 0.5 * (since_s < @mean@ ? since_s : @mean@) / since_s;
    g->column[i] = columns[i];
  }
  g->column_s = time_s;
  g->called = 1;
  return rate + coilwright_formulas(&g->memory, &g->pack[COILWRIGHT_DELAY], rate - coilwright_offset);
}
