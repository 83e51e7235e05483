/* The first time in the last step at which a function of the sample becomes positive.
 *
 * The step is halved as long as the function may become positive within a part: if the parabola through its values at
 * the ends and the middle, raised by its own bend, does.  In the smallest parts the largest value is searched for.  The
 * time is then located between two that differ by round-off, by false position (Illinois), safeguarded by bisection,
 * so that functions that jump are located, too. */
#include <float.h>
#include <math.h>
#include "pinwheel-solvers.h"
#include "util.h"

enum {
  CROSSING_DEPTH = 4,  /* halvings of a step; parts of 1/16 */
  CROSSING_SEARCH = 30 /* evaluations for the largest value in a part, at most */
};
#define CROSSING_GOLDEN 0.38196601125010515 /* (3 - sqrt (5)) / 2 */

/* A time and the value there. */
typedef struct {
  double t, value;
} crossing_point;

typedef struct {
  pw_run *run;
  const pw_crossing *of;
  int status;
  pw_error *error;
} crossing_search;

/* The value at a time in the step; not positive after an error, or where it is unknown. */
static crossing_point crossing_at (crossing_search *search, double t) {
  pw_sample sample;
  crossing_point p = { t, -DBL_MAX };
  if (search->status == PW_OK) search->status = pw_run_sample (search->run, t, &sample, search->error);
  if (search->status != PW_OK) return p;
  p.value = search->of->value (search->of->context, &sample);
  if (isnan (p.value)) p.value = -DBL_MAX;
  return p;
}

/* Locates the sign change between a (not positive) and b (positive): the first positive time that is found. */
static double crossing_locate (crossing_search *search, crossing_point a, crossing_point b) {
  int side = 0; /* which end was kept by the last step of false position */
  double a_weight = a.value, b_weight = b.value;
  for (int i = 0; i < 200 && search->status == PW_OK; i++) {
    const double width = b.t - a.t, middle = a.t + width / 2;
    if (!(a.t < middle && middle < b.t)) break;
    double t = a.t + width * (a_weight / (a_weight - b_weight));
    if (i % 3 == 2 || !(t > a.t && t < b.t)) t = middle; /* the width is halved at least every third time */
    const crossing_point p = crossing_at (search, t);
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

/* Searches a maximum between a and b, first at the vertex of the parabola through a, m and b, then by golden sections
 * around the largest value, until a value is positive; NaN: there is none. */
static double crossing_peak (crossing_search *search, crossing_point a, crossing_point m, crossing_point b) {
  const double bend = a.value - 2 * m.value + b.value, vertex = -(b.value - a.value) / (2 * bend);
  if (!(bend < 0 && fabs (vertex) < 1) || m.value > 0) return NAN;
  const crossing_point before = a, p = vertex == 0 ? m : crossing_at (search, m.t + vertex * (b.t - m.t));
  if (p.value > 0) return crossing_locate (search, p.t < m.t ? before : m, p);
  if (p.value > m.value) {
    *(p.t < m.t ? &b : &a) = m;
    m = p;
  }
  for (int i = 0; i < CROSSING_SEARCH && search->status == PW_OK && m.value > a.value && m.value > b.value; i++) {
    const int left = m.t - a.t > b.t - m.t;
    const double t = left ? m.t - CROSSING_GOLDEN * (m.t - a.t) : m.t + CROSSING_GOLDEN * (b.t - m.t);
    const crossing_point next = crossing_at (search, t);
    if (next.value > 0) return crossing_locate (search, next.t < m.t ? a : m, next);
    if (next.value > m.value) {
      *(left ? &b : &a) = m;
      m = next;
    } else
      *(left ? &a : &b) = next;
  }
  return NAN;
}

/* The first time in (a, b] at which the value is positive; a is not.  NaN: none is found. */
static double crossing_first (crossing_search *search, crossing_point a, crossing_point b, int depth) {
  const crossing_point m = crossing_at (search, a.t + (b.t - a.t) / 2);
  if (search->status != PW_OK || !(a.t < m.t && m.t < b.t)) return b.value > 0 ? b.t : NAN;
  const double bend = fabs (a.value - 2 * m.value + b.value), most = fmax (a.value, fmax (m.value, b.value));
  if (!(most + bend > 0)) return NAN;
  const int straight = bend < 0.1 * fabs (b.value - a.value); /* monotonic */
  if (straight || depth == 0) {
    const double before = straight ? NAN : crossing_peak (search, a, m, b);
    if (!isnan (before)) return before;
    return m.value > 0 ? crossing_locate (search, a, m) : b.value > 0 ? crossing_locate (search, m, b) : NAN;
  }
  const double first = crossing_first (search, a, m, depth - 1);
  if (!isnan (first)) return first;
  return m.value > 0 ? m.t : crossing_first (search, m, b, depth - 1);
}

int pw_run_find_crossing (pw_run *r, pw_crossing *x, double *t, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK || pw_require (x, "a crossing", error) != PW_OK) return PW_INPUT;
  crossing_search search = { r, x, PW_OK, error };
  const crossing_point end = crossing_at (&search, pw_run_time (r));
  *t = NAN;
  if (!x->begun && end.value > 0) *t = end.t;
  if (x->begun && x->t < end.t) *t = crossing_first (&search, (crossing_point){ x->t, x->last }, end, CROSSING_DEPTH);
  x->begun = 1, x->t = end.t, x->last = end.value;
  return search.status;
}
