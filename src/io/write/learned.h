#include <math.h>

#define COILWRIGHT_COLUMNS @columns@
#define COILWRIGHT_LAGS @lag_count@
#define COILWRIGHT_SLOPES @slope_count@
#define COILWRIGHT_WARM_UPS @warm_count@

typedef struct {
  double behind[COILWRIGHT_LAGS];
  double first;
  /* Since the first reading, and since the last. */
  double since_first;
  double since_last;
  double last;
  int begun;
} coilwright_state;

static const double coilwright_offset = @offset@;
static const double coilwright_coefficient[COILWRIGHT_COLUMNS] = {@coefficients@};
static const double coilwright_lag_s[COILWRIGHT_LAGS] = {@lags@};
static const int coilwright_short[COILWRIGHT_SLOPES] = {@short@};
static const int coilwright_long[COILWRIGHT_SLOPES] = {@long@};
static const int coilwright_warm_up[COILWRIGHT_WARM_UPS] = {@warm@};

static void coilwright_start(coilwright_state *s) {
  int i;
  for (i = 0; i < COILWRIGHT_LAGS; ++i) s->behind[i] = 0.0;
  s->first = 0.0;
  s->since_first = 0.0;
  s->since_last = 0.0;
  s->last = coilwright_offset;
  s->begun = 0;
}

static double coilwright_step(coilwright_state *s, double temperature_c, int valid) {
  double x[COILWRIGHT_COLUMNS], u, sum = coilwright_offset;
  int i, k = 0;
  s->since_first += @interval@;
  s->since_last += @interval@;
  if (!valid) return s->last;
  if (!s->begun || s->since_last > @forgotten@) {
    s->begun = 1;
    s->first = temperature_c;
    s->since_first = 0.0;
    s->since_last = 0.0;
    for (i = 0; i < COILWRIGHT_LAGS; ++i) s->behind[i] = temperature_c;
  }
  for (i = 0; i < COILWRIGHT_LAGS; ++i)
    s->behind[i] = temperature_c + exp(-s->since_last / coilwright_lag_s[i]) * (s->behind[i] - temperature_c);
  s->since_last = 0.0;
  u = (temperature_c - s->first) / @usual@;
  x[k++] = temperature_c - s->first;
  x[k++] = temperature_c - s->behind[0];
  for (i = 1; i < COILWRIGHT_LAGS; ++i) x[k++] = s->behind[i - 1] - s->behind[i];
  x[k++] = u * u;
  x[k++] = u * u * u;
  x[k++] = u * u * u * u;
  for (i = 0; i < COILWRIGHT_SLOPES; ++i) {
    double v = s->behind[coilwright_short[i]] - s->behind[coilwright_long[i]];
    x[k++] = fabs(v);
    x[k++] = v * fabs(v);
    x[k++] = u * v;
  }
  for (i = 0; i < COILWRIGHT_WARM_UPS; ++i) x[k++] = exp(-s->since_first / coilwright_lag_s[coilwright_warm_up[i]]);
  for (i = 0; i < COILWRIGHT_COLUMNS; ++i) sum += coilwright_coefficient[i] * x[i];
  s->last = sum;
  return sum;
}
