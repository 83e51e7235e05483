/* The first time in a step at which one of several functions becomes positive: conditions of --until, events.
 *
 * The step is halved as long as a function may become positive within a part: if the parabola through its values at
 * the ends and the middle, raised by its own bend, does.  In the smallest parts the largest value is searched for.  The
 * time is then located between two that differ by round-off, by false position (Illinois), safeguarded by bisection,
 * so that functions that jump are located, too. */
#include <float.h>
#include <math.h>
#include "crossing.h"
#include "method.h"
#include "util.h"

enum { CROSSING_SEARCH = 30 /* evaluations for the largest value in a part, at most */ };
#define CROSSING_GOLDEN 0.38196601125010515 /* (3 - sqrt (5)) / 2 */

/* A time and a value there. */
typedef struct {
  double t, value;
} crossing_point;

static void crossing_evaluate (pw_crossing_search *x, double t, double *value) {
  if (x->status == PW_OK) x->status = x->at (x->context, t, value, x->error);
  for (int i = 0; i < x->count; i++)
    if (x->status != PW_OK || isnan (value[i])) value[i] = -DBL_MAX;
}

static double crossing_most (const pw_crossing_search *x, const double *value) {
  double most = value[0];
  for (int i = 1; i < x->count; i++) most = fmax (most, value[i]);
  return most;
}

/* The largest value at a time in the step if it is positive, else that of function i (-1: the largest).  Not positive
 * after an error, or where it is unknown. */
static crossing_point crossing_at (pw_crossing_search *x, int i, double t) {
  double *value = x->memory + (PW_CROSSING_DEPTH + 1) * x->count;
  crossing_evaluate (x, t, value);
  const double most = crossing_most (x, value);
  return (crossing_point){ t, most > 0 || i < 0 ? most : value[i] };
}

/* Locates the sign change between a (not positive) and b (positive): the first positive time that is found. */
static double crossing_locate (pw_crossing_search *x, crossing_point a, crossing_point b) {
  int side = 0; /* which end was kept by the last step of false position */
  double a_weight = a.value, b_weight = b.value;
  for (int i = 0; i < 200 && x->status == PW_OK; i++) {
    const double width = b.t - a.t, middle = a.t + width / 2;
    if (!(a.t < middle && middle < b.t) || width <= x->width) break;
    double t = a.t + width * (a_weight / (a_weight - b_weight));
    if (i % 3 == 2 || !(t > a.t && t < b.t)) t = middle; /* the width is halved at least every third time */
    const crossing_point p = crossing_at (x, -1, t);
    if (p.value > 0) {
      b = p, b_weight = p.value;
      if (side == 1) a_weight /= 2;
      side = 1;
    } else {
      a = p, a_weight = p.value;
      if (side == -1) b_weight /= 2;
      side = -1;
    }
  }
  return b.t;
}

/* Searches a maximum of function i between a and b, first at the vertex of the parabola through a, m and b, then by
 * golden sections around the largest value, until a value is positive; NaN: there is none. */
static double crossing_peak (pw_crossing_search *x, int i, crossing_point a, crossing_point m, crossing_point b) {
  const double bend = a.value - 2 * m.value + b.value, vertex = -(b.value - a.value) / (2 * bend);
  if (!(bend < 0 && fabs (vertex) < 1) || m.value > 0) return NAN;
  const double t = fmin (fmax (m.t + vertex * (b.t - m.t), a.t), b.t); /* a vertex near an end is rounded */
  const crossing_point before = a, p = vertex == 0 ? m : crossing_at (x, i, t);
  if (p.value > 0) return crossing_locate (x, p.t < m.t ? before : m, p);
  if (p.value > m.value) {
    *(p.t < m.t ? &b : &a) = m;
    m = p;
  }
  for (int n = 0; n < CROSSING_SEARCH && x->status == PW_OK && m.value > a.value && m.value > b.value; n++) {
    const int left = m.t - a.t > b.t - m.t;
    const double next_t = left ? m.t - CROSSING_GOLDEN * (m.t - a.t) : m.t + CROSSING_GOLDEN * (b.t - m.t);
    const crossing_point next = crossing_at (x, i, next_t);
    if (next.value > 0) return crossing_locate (x, next.t < m.t ? a : m, next);
    if (next.value > m.value) {
      *(left ? &b : &a) = m;
      m = next;
    } else
      *(left ? &a : &b) = next;
  }
  return NAN;
}

/* As pw_first_crossing, in a part of the step; depth: how often it may be halved. */
static double crossing_first (pw_crossing_search *x, double a, const double *at_a, double b, const double *at_b,
                              int depth) {
  const double m = a + (b - a) / 2, most = crossing_most (x, at_b);
  double *at_m = x->memory + depth * x->count;
  if (!(a < m && m < b)) return most > 0 ? b : NAN;
  crossing_evaluate (x, m, at_m);
  if (x->status != PW_OK) return NAN;
  int possible = 0, straight = 1; /* 1: all that may become positive are monotonic */
  for (int i = 0; i < x->count; i++) {
    const double bend = fabs (at_a[i] - 2 * at_m[i] + at_b[i]);
    if (!(fmax (at_a[i], fmax (at_m[i], at_b[i])) + bend > 0)) continue;
    possible = 1;
    straight &= bend < 0.1 * fabs (at_b[i] - at_a[i]);
  }
  if (!possible) return NAN;
  const double middle = crossing_most (x, at_m);
  if (!straight && depth > 0) {
    const double first = crossing_first (x, a, at_a, m, at_m, depth - 1);
    if (!isnan (first)) return first;
    return middle > 0 ? m : crossing_first (x, m, at_m, b, at_b, depth - 1);
  }
  for (int i = 0; i < x->count && !straight && !(middle > 0); i++) {
    const crossing_point at[] = { { a, at_a[i] }, { m, at_m[i] }, { b, at_b[i] } };
    const double peak = crossing_peak (x, i, at[0], at[1], at[2]);
    if (!isnan (peak)) return peak;
  }
  const crossing_point before = { a, crossing_most (x, at_a) }, between = { m, middle }, after = { b, most };
  return middle > 0 ? crossing_locate (x, before, between) : most > 0 ? crossing_locate (x, between, after) : NAN;
}

double pw_first_crossing (pw_crossing_search *x, double a, const double *at_a, double b, const double *at_b) {
  return crossing_first (x, a, at_a, b, at_b, PW_CROSSING_DEPTH);
}

/* ---- Conditions on samples ---- */

typedef struct {
  pw_run *run;
  const pw_crossing *of;
} crossing_condition;

static int crossing_sample (void *context, double t, double *value, pw_error *error) {
  const crossing_condition *x = context;
  pw_sample sample;
  x->run->located = t;
  const int status = pw_run_sample (x->run, t, &sample, error);
  if (status == PW_OK) *value = x->of->value (x->of->context, &sample);
  return status;
}

int pw_run_find_crossing (pw_run *r, pw_crossing *x, double *t, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK || pw_require (x, "a crossing", error) != PW_OK) return PW_INPUT;
  double memory[PW_CROSSING_DEPTH + 2], value;
  const double end = pw_run_time (r);
  pw_crossing_search search = { .count = 1, crossing_sample, &(crossing_condition){ r, x }, memory, .error = error };
  crossing_evaluate (&search, end, &value);
  *t = NAN;
  if (!x->begun && value > 0) *t = end;
  if (x->begun && x->t < end && search.status == PW_OK) *t = pw_first_crossing (&search, x->t, &x->last, end, &value);
  x->begun = 1, x->t = end, x->last = value;
  r->located = *t;
  return search.status;
}
