/* The first time in a step at which one of several functions becomes positive: conditions of --until, events.
 *
 * The step is halved as long as a function may become positive within a part: if the parabola through its values at
 * the ends and the middle, raised by its own bend, does.  In the smallest parts the largest value is searched for.  The
 * time is then located to round-off by inverse quadratic interpolation, safeguarded by bisection, so that jumps are
 * located, too. */
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

/* The share of the way from x1 to x2, on either side of the root, at which the inverse parabola through these and x3
 * has a value, where it is monotonic; else 1/2 (Chandrupatla 1997, Advances in Engineering Software 28, 145-149). */
static double crossing_guess (crossing_point x1, crossing_point x2, crossing_point x3, double value) {
  const double f1 = x1.value - value, f2 = x2.value - value, f3 = x3.value - value;
  const double xi = (x1.t - x2.t) / (x3.t - x2.t), phi = (f1 - f2) / (f3 - f2);
  if (!(phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi)) return 0.5;
  return f1 / (f2 - f1) * f3 / (f2 - f3) + (x3.t - x1.t) / (x2.t - x1.t) * f1 / (f3 - f1) * f2 / (f3 - f2);
}

/* Locates the sign change between a (not positive) and b (positive), with a third point beside them: the first positive
 * time that is found. */
static double crossing_locate (pw_crossing_search *x, crossing_point a, crossing_point b, crossing_point third) {
  crossing_point last = third.t < a.t ? a : b, other = third.t < a.t ? b : a;
  while (x->status == PW_OK && !(last.value > 0 && last.value <= x->small)) {
    const double length = other.t - last.t, nearest = 0.5 * x->width / fabs (length);
    const double share = fmin (fmax (crossing_guess (last, other, third, x->small / 2), nearest), 1 - nearest);
    const double low = fmin (last.t, other.t), high = fmax (last.t, other.t), middle = low + (high - low) / 2;
    if (!(low < middle && middle < high) || high - low <= x->width) break;
    double t = last.t + share * length;
    if (!(t > low && t < high)) t = middle;
    const crossing_point p = crossing_at (x, -1, t);
    third = last;
    if ((p.value > 0) != (last.value > 0)) third = other, other = last;
    last = p;
  }
  return last.value > 0 ? last.t : other.t;
}

/* Searches a maximum of function i between a and b, first at the vertex of the parabola through a, m and b, then by
 * golden sections around the largest value, until a value is positive; NaN: there is none. */
static double crossing_peak (pw_crossing_search *x, int i, crossing_point a, crossing_point m, crossing_point b) {
  const double bend = a.value - 2 * m.value + b.value, vertex = -(b.value - a.value) / (2 * bend);
  if (!(bend < 0 && fabs (vertex) < 1) || m.value > 0) return NAN;
  const double t = fmin (fmax (m.t + vertex * (b.t - m.t), a.t), b.t); /* a vertex near an end is rounded */
  const crossing_point before = a, p = vertex == 0 ? m : crossing_at (x, i, t);
  if (p.value > 0) return crossing_locate (x, p.t < m.t ? before : m, p, p.t < m.t ? m : b);
  if (p.value > m.value) {
    *(p.t < m.t ? &b : &a) = m;
    m = p;
  }
  for (int n = 0; n < CROSSING_SEARCH && x->status == PW_OK && m.value > a.value && m.value > b.value; n++) {
    const int left = m.t - a.t > b.t - m.t;
    const double next_t = left ? m.t - CROSSING_GOLDEN * (m.t - a.t) : m.t + CROSSING_GOLDEN * (b.t - m.t);
    const crossing_point next = crossing_at (x, i, next_t);
    if (next.value > 0) return crossing_locate (x, next.t < m.t ? a : m, next, next.t < m.t ? m : b);
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
    const double bend = isnan (at_a[i]) ? 0 : fabs (at_a[i] - 2 * at_m[i] + at_b[i]);
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
  if (middle > 0) return crossing_locate (x, before, between, after);
  return most > 0 ? crossing_locate (x, between, after, before) : NAN;
}

double pw_first_crossing (pw_crossing_search *x, double a, const double *at_a, double b, const double *at_b) {
  if (x->at_before == NULL) return crossing_first (x, a, at_a, b, at_b, PW_CROSSING_DEPTH);
  const crossing_point first = { a, crossing_most (x, at_a) }, last = { b, crossing_most (x, at_b) };
  const crossing_point third = { x->before, crossing_most (x, x->at_before) };
  return last.value > 0 ? crossing_locate (x, first, last, third) : NAN;
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
