/* Whether signals change with time, or repeat after a period, for the searches for steady and periodic motions. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "steady_parts.h"

enum { SIGNAL_TIMES = 16 };             /* times at which signals are compared, and as many between breakpoints */
static const double SIGNAL_SAME = 1e-8; /* largest difference of equal signals, relative to their largest value */

typedef struct {
  pw_run *r;
  double *state;                /* 2 n: q, v */
  double *values;               /* count: at the first of two times */
  double *largest, *difference; /* count: largest magnitude and difference so far */
  int count;                    /* value and two derivatives of each signal */
} signal_comparison;

/* Compares signals at two times, in the run's state (number 0) or one up to a unit of the scene away (number 1), since
 * a signal may be multiplied by a state that is 0.  A status; in the second state signals may fail. */
static int signals_compare (signal_comparison *x, int number, double t0, double t1) {
  pw_run *r = x->r;
  pw_workspace *w = r->w;
  double *q = x->state, *v = q + r->s->coords;
  pw_irregular_state (r, number, number, q, v);
  int status = pw_update_kinematics (w, t0, q, v);
  if (status == PW_OK && x->count) memcpy (x->values, w->u, (size_t)x->count * sizeof *w->u);
  if (status == PW_OK) status = pw_update_kinematics (w, t1, q, v);
  for (int i = 0; status == PW_OK && i < x->count; i++) {
    if (i % 3 > 0 && r->s->source[i / 3].of_force) continue; /* these derivatives are meaningless */
    x->difference[i] = pw_larger_or_nan (x->difference[i], fabs (w->u[i] - x->values[i]));
    x->largest[i] = fmax (x->largest[i], fmax (fabs (x->values[i]), fabs (w->u[i])));
  }
  return number > 0 ? PW_OK : status;
}

/* The middle between the first two breakpoints after *t, or the first one and t1; INFINITY without one before t1.
 * Moves *t to the first one. */
static double signals_next_interval (pw_workspace *w, double *t, double t1) {
  *t = pw_next_breakpoint (w, 1, *t);
  return *t < t1 ? *t + (fmin (pw_next_breakpoint (w, 1, *t), t1) - *t) / 2 : INFINITY;
}

int pw_signals_change (pw_run *r, double t, double period, double span, int *changed, pw_error *error) {
  signal_comparison x = { .r = r, .count = 3 * r->s->sources };
  size_t count = (size_t)x.count;
  double at = t, breakpoint = t;
  int status = PW_OK;
  x.values = calloc (3 * count + 2 * (size_t)r->s->coords + 1, sizeof *x.values);
  if (x.values == NULL) return pw_fail_memory (r->s, error);
  x.largest = x.values + count, x.difference = x.largest + count, x.state = x.difference + count;
  for (int k = 1; status == PW_OK && k <= 2 * SIGNAL_TIMES && isfinite (at); k++) {
    double part = k / (double)SIGNAL_TIMES;
    at = k > SIGNAL_TIMES ? signals_next_interval (r->w, &breakpoint, t + span)
         : period > 0     ? t + span * fmod (0.618034 * k, 1) /* golden ratio: equidistributed */
                          : t + span * part * part;               /* denser at first */
    for (int number = 0; number < 2 && status == PW_OK && isfinite (at); number++)
      status = signals_compare (&x, number, period > 0 ? at : t, period > 0 ? at + period : at);
  }
  *changed = -1;
  for (int i = x.count; i-- > 0;)
    if (!(x.difference[i] <= SIGNAL_SAME * x.largest[i])) *changed = i / 3;
  free (x.values);
  return status == PW_OK ? PW_OK : pw_run_annotate_error (r, pw_fail_signal (at, error), error);
}
