/* Thermal rate error of a fibre-optic gyro's coil from one temperature: @name@.
   Call coilwright_step once every @interval@ s. It returns the rate error [deg/h] of the call @delay@ calls ago;
   subtract it from the rate of that call. valid = 0: no reading, the model goes on by itself.
   Needs the C library's exp (link with -lm). */
#ifndef COILWRIGHT_COMPENSATION_H
#define COILWRIGHT_COMPENSATION_H

#include <math.h>

#define COILWRIGHT_STATES @states@
#define COILWRIGHT_DELAY @delay@
#define COILWRIGHT_VALUES (COILWRIGHT_STATES + COILWRIGHT_DELAY + 1)
#define COILWRIGHT_AGES @ages@
#define COILWRIGHT_HYPOTHESES @hypotheses@
#define COILWRIGHT_FORGOTTEN @forgotten@

/* States, then the rate errors of this row and of the rows before. */
typedef struct {
  double v[COILWRIGHT_VALUES];
  double log_weight;
  int age;
} coilwright_hypothesis;

typedef struct {
  coilwright_hypothesis h[COILWRIGHT_HYPOTHESES];
  coilwright_hypothesis next[COILWRIGHT_HYPOTHESES];
  /* The first reading: the states count from it. */
  double origin;
  int count;
  int missing;
} coilwright_state;

static const double coilwright_transition[COILWRIGHT_STATES][COILWRIGHT_STATES] = {
@transition@
};
static const double coilwright_rate[COILWRIGHT_STATES] = {@rate@};
static const double coilwright_reading[COILWRIGHT_STATES] = {@reading@};
static const double coilwright_gain[COILWRIGHT_AGES][COILWRIGHT_VALUES] = {
@gains@
};
static const double coilwright_variance[COILWRIGHT_AGES] = {@variances@};
static const double coilwright_factor[COILWRIGHT_AGES] = {@factors@};
static const double coilwright_offset = @offset@;

static void coilwright_start(coilwright_state *s) {
  s->origin = 0.0;
  s->count = 0;
  s->missing = 0;
}

static void coilwright_advance(double *v) {
  double next[COILWRIGHT_STATES], newest = 0.0;
  int i, j;
  for (i = 0; i < COILWRIGHT_STATES; ++i) {
    newest += coilwright_rate[i] * v[i];
    next[i] = 0.0;
    for (j = 0; j < COILWRIGHT_STATES; ++j) next[i] += coilwright_transition[i][j] * v[j];
  }
  for (i = 0; i < COILWRIGHT_STATES; ++i) v[i] = next[i];
  for (i = COILWRIGHT_VALUES - 1; i > COILWRIGHT_STATES; --i) v[i] = v[i - 1];
  v[COILWRIGHT_STATES] = newest;
}

static void coilwright_branch(coilwright_state *s, double temperature_c) {
  double error[COILWRIGHT_HYPOTHESES], fit[2 * COILWRIGHT_HYPOTHESES], best = 0.0;
  int age[2 * COILWRIGHT_HYPOTHESES];
  int i, j, kept = 0;
  for (i = 0; i < s->count; ++i) {
    double e = temperature_c - s->origin;
    int older = s->h[i].age + 1 < COILWRIGHT_AGES ? s->h[i].age + 1 : COILWRIGHT_AGES - 1;
    for (j = 0; j < COILWRIGHT_STATES; ++j) e -= coilwright_reading[j] * s->h[i].v[j];
    error[i] = e;
    age[2 * i] = older;
    age[2 * i + 1] = 0;
    fit[2 * i] = s->h[i].log_weight + @no_break@ + coilwright_factor[older] - 0.5 * e * e / coilwright_variance[older];
    fit[2 * i + 1] = s->h[i].log_weight + @break@ + coilwright_factor[0] - 0.5 * e * e / coilwright_variance[0];
  }
  while (kept < COILWRIGHT_HYPOTHESES) {
    coilwright_hypothesis *to = &s->next[kept];
    int at = -1, taken = 0;
    for (i = 0; i < 2 * s->count; ++i) {
      if (COILWRIGHT_HYPOTHESES == 1 && i % 2 == 1) continue;
      if (age[i] >= 0 && (at < 0 || fit[i] > fit[at])) at = i;
    }
    if (at < 0) break;
    if (kept == 0) best = fit[at];
    if (fit[at] < best + (@least@)) break;
    for (j = 0; j < kept; ++j) taken |= s->next[j].age == age[at];
    if (!taken) {
      to->age = age[at];
      to->log_weight = fit[at] - best;
      for (j = 0; j < COILWRIGHT_VALUES; ++j) to->v[j] = s->h[at / 2].v[j] + coilwright_gain[age[at]][j] * error[at / 2];
      ++kept;
    }
    age[at] = -1;
  }
  for (i = 0; i < kept; ++i) s->h[i] = s->next[i];
  s->count = kept;
}

static double coilwright_step(coilwright_state *s, double temperature_c, int valid) {
  double sum = 0.0, weights = 0.0;
  int i;
  s->missing = valid ? 0 : s->missing + 1;
  if (s->missing > COILWRIGHT_FORGOTTEN) s->count = 0;
  if (s->count == 0) {
    if (!valid) return coilwright_offset;
    for (i = 0; i < COILWRIGHT_VALUES; ++i) s->h[0].v[i] = 0.0;
    s->origin = temperature_c;
    s->h[0].age = 0;
    s->h[0].log_weight = 0.0;
    s->count = 1;
    return coilwright_offset;
  }
  for (i = 0; i < s->count; ++i) coilwright_advance(s->h[i].v);
  if (valid) coilwright_branch(s, temperature_c);
  for (i = 0; i < s->count; ++i) {
    double weight = exp(s->h[i].log_weight);
    weights += weight;
    sum += weight * s->h[i].v[COILWRIGHT_STATES + COILWRIGHT_DELAY];
  }
  return sum / weights + coilwright_offset;
}

#endif
