/* Placing a state: the poses of all bodies, the signals of all elements. */
#include <math.h>
#include "system.h"
#include "signal.h"

/* Own coordinates are read where the caller has them. */
static void place_own (pw_system *s, const double *q, const double *v) {
  for (pw_slab *k = s->slab; k < s->slab + s->slabs; k++) {
    if (q) k->b.q = q + k->own;
    k->b.v = v + k->own;
  }
}

static inline void place_poses (pw_system *s, const double *q, const double *v) {
  if (s->coords > 3 * s->bodies) place_own (s, q, v);
  for (pw_pose *p = s->pose, *end = p + s->bodies; p < end; p++, q += 3, v += 3) {
    double phi = q[2];
    *p = (pw_pose){ q[0], q[1], phi, cos (phi), sin (phi), v[0], v[1], v[2] };
  }
}

/* The states a function reads; q NULL: positions stay as they were.  Returns how many were taken. */
static int place_reads (const pw_system *s, const pw_source *source, const double *q, const double *v) {
  int taken = 0;
  for (int r = 0; r < source->reads; r++) {
    int j = source->state[r], velocity = j >= s->coords;
    if (q == NULL && !velocity) continue;
    source->x[r] = velocity ? v[j - s->coords] : q[j];
    taken++;
  }
  return taken;
}

/* Evaluates the signals that read states, of these only those of velocities if q is NULL; or those of time alone. */
static int place_sources (pw_system *s, int readers, double t, const double *q, const double *v) {
  for (pw_source *i = s->source, *end = i + s->sources; i < end; i++) {
    if ((i->reads > 0) != readers || (s->hold && i->forced)) continue;
    if (readers && place_reads (s, i, q, v) == 0) continue;
    if (pw_signal_eval (i, t, !i->forced, i->u) == 0) continue;
    s->failed = i;
    return PW_METHOD;
  }
  return PW_OK;
}

/* Signals of time alone are evaluated once per time: stages at the same time share them. */
static int place_signals (pw_system *s, double t, const double *q, const double *v) {
  if (t != s->t_signal) {
    s->t_signal = NAN; /* if one fails, others have changed */
    if (place_sources (s, 0, t, q, v) != PW_OK) return PW_METHOD;
    s->t_signal = t;
  }
  return s->readers > 0 ? place_sources (s, 1, t, q, v) : PW_OK;
}

int pw_place (pw_system *s, double t, const double *q, const double *v) {
  place_poses (s, q, v);
  return t == s->t_signal && s->readers == 0 ? PW_OK : place_signals (s, t, q, v);
}

int pw_place_rates (pw_system *s, const double *v) {
  const double *from = v;
  for (pw_pose *p = s->pose, *end = p + s->bodies; p < end; p++, from += 3) {
    p->vx = from[0];
    p->vy = from[1];
    p->omega = from[2];
  }
  if (s->coords > 3 * s->bodies) place_own (s, NULL, v);
  return s->readers > 0 ? place_sources (s, 1, s->t_signal, NULL, v) : PW_OK;
}

void pw_hold (pw_system *s, int hold) {
  s->hold = hold;
  s->t_signal = NAN;
}

double pw_next_breakpoint (pw_system *s, int knots, double t) {
  double next = INFINITY;
  for (const pw_source *i = s->source, *end = i + s->sources; i < end; i++) {
    double own = pw_signal_breakpoint (&i->signal, knots && !i->forced, t);
    if (own < next) next = own;
    if (own > t) continue;
    s->failed = i;
    return NAN;
  }
  return next;
}
