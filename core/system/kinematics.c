/* Kinematics of a state: configurations of all bodies, signals of all elements. */
#include <math.h>
#include "sine.h"
#include "system.h"
#include "signal.h"

void pw_point_to_internal (pw_workspace *w, const double *q, const double *v) {
  for (pw_element_batch *k = w->batch; k < w->batch + w->s->batches; k++) {
    if (q) k->b.q = q + k->internal;
    k->b.v = v + k->internal;
  }
}

/* Two bodies at a time; singly the last of an odd number, and all from a pair with an angle beyond the limit on. */
void pw_update_configurations (pw_workspace *w, const double *q, const double *v) {
  if (w->s->coords > 3 * w->s->bodies) pw_point_to_internal (w, q, v);
  pw_configuration *p = w->configuration, *end = p + w->s->bodies;
  _Static_assert(PW_SINE_LANES == 2, "bodies are evaluated in pairs");
  for (; p + 1 < end; p += 2, q += 6, v += 6) {
    pw_lanes c, s;
    if (!(fabs (q[2]) < PW_SINE_LIMIT && fabs (q[5]) < PW_SINE_LIMIT)) break;
    pw_sin_cos_lanes ((pw_lanes){ q[2], q[5] }, &s, &c);
    p[0] = (pw_configuration){ q[0], q[1], q[2], c[0], s[0], v[0], v[1], v[2] };
    p[1] = (pw_configuration){ q[3], q[4], q[5], c[1], s[1], v[3], v[4], v[5] };
  }
  for (; p < end; p++, q += 3, v += 3) {
    double c, s;
    pw_sin_cos (q[2], &s, &c);
    *p = (pw_configuration){ q[0], q[1], q[2], c, s, v[0], v[1], v[2] };
  }
}

/* Copies the states that a function reads; q NULL: only velocities.  Returns the number of states copied. */
static int kinematics_copy_states (const pw_workspace *w, const pw_source *source, const double *q, const double *v) {
  int copied = 0;
  for (int r = 0; r < source->reads; r++) {
    int j = source->state[r], velocity = j >= w->s->coords;
    if (q == NULL && !velocity) continue;
    source->x[r] = velocity ? v[j - w->s->coords] : q[j];
    copied++;
  }
  return copied;
}

int pw_update_signals (pw_workspace *w, double t, const double *q, const double *v) {
  int new_time = t != w->t_signal && !isnan (t); /* NaN: pw_update_velocities, after a failure */
  if (!new_time && w->s->state_dependent == 0) return PW_OK;
  if (new_time) w->t_signal = NAN; /* if a signal fails, others have changed already */
  for (pw_source *source = w->source, *end = source + w->s->sources; source < end; source++) {
    if (w->hold && source->of_force) continue;
    if (kinematics_copy_states (w, source, q, v) == 0 && !(new_time && source->reads == 0)) continue;
    if (pw_signal_eval (source, t) == 0) continue;
    w->failed = source;
    return PW_METHOD;
  }
  if (new_time) w->t_signal = t;
  return PW_OK;
}

int pw_update_kinematics (pw_workspace *w, double t, const double *q, const double *v) {
  pw_update_configurations (w, q, v);
  return pw_update_signals (w, t, q, v);
}

int pw_update_velocities (pw_workspace *w, const double *v) {
  const double *from = v;
  for (pw_configuration *p = w->configuration, *end = p + w->s->bodies; p < end; p++, from += 3)
    p->vx = from[0], p->vy = from[1], p->omega = from[2];
  if (w->s->coords > 3 * w->s->bodies) pw_point_to_internal (w, NULL, v);
  return w->s->state_dependent > 0 ? pw_update_signals (w, w->t_signal, NULL, v) : PW_OK;
}

void pw_hold_signals (pw_workspace *w, int hold) {
  w->hold = hold;
  w->t_signal = NAN;
}

double pw_next_breakpoint (pw_workspace *w, int kinks, double t) {
  double next = INFINITY;
  for (const pw_source *source = w->source, *end = source + w->s->sources; source < end; source++) {
    double breakpoint = pw_signal_breakpoint (&source->signal, kinks && !source->of_force, t);
    if (breakpoint < next) next = breakpoint;
    if (breakpoint > t) continue;
    w->failed = source;
    return NAN;
  }
  return next;
}
