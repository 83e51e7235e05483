/* Placing a state: the poses of all bodies, the signals of all elements. */
#include <math.h>
#include "model.h"
#include "signal.h"

static void place_positions (pw_system *s, const double *q) {
  for (int b = 0; b < s->bodies; b++) {
    pw_pose *p = &s->pose[b];
    double phi = q[3 * b + 2];
    p->x = q[3 * b];
    p->y = q[3 * b + 1];
    p->phi = phi;
    p->cos = cos (phi);
    p->sin = sin (phi);
  }
  for (int k = 0; k < s->slabs; k++) s->slab[k].b.q = q + s->slab[k].own;
}

void pw_place_rates (pw_system *s, const double *v) {
  for (int b = 0; b < s->bodies; b++) {
    pw_pose *p = &s->pose[b];
    p->vx = v[3 * b];
    p->vy = v[3 * b + 1];
    p->omega = v[3 * b + 2];
  }
  for (int k = 0; k < s->slabs; k++) s->slab[k].b.v = v + s->slab[k].own;
}

/* Evaluates the signals of a slab; `readers` picks those that read states, else those of time alone. */
static int place_slab_signals (const pw_system *s, pw_slab *k, double t, const double *q, const double *v,
                               int readers) {
  int derivatives = !pw_kind_forced (k->kind);
  for (int i = 0; i < k->b.count * k->kind->signals; i++) {
    pw_source *source = &k->source[i];
    if ((source->reads > 0) != readers) continue;
    for (int r = 0; r < source->reads; r++) {
      int j = source->state[r];
      source->x[r] = j < s->coords ? q[j] : v[j - s->coords];
    }
    if (pw_signal_eval (source, t, derivatives, k->u + 3 * i) != 0) return PW_METHOD;
  }
  return PW_OK;
}

/* Signals of time alone are evaluated once per time: stages at the same time share them. */
static int place_signals (pw_system *s, double t, const double *q, const double *v) {
  if (t != s->t_signal) {
    for (int k = 0; k < s->slabs; k++) {
      if (s->slab[k].kind->signals == 0 || (s->hold && pw_kind_forced (s->slab[k].kind))) continue;
      if (place_slab_signals (s, &s->slab[k], t, q, v, 0) != PW_OK) return PW_METHOD;
    }
    s->t_signal = t;
  }
  if (s->readers == 0 || s->hold) return PW_OK;
  for (int k = 0; k < s->slabs; k++)
    if (place_slab_signals (s, &s->slab[k], t, q, v, 1) != PW_OK) return PW_METHOD;
  return PW_OK;
}

int pw_place (pw_system *s, double t, const double *q, const double *v) {
  place_positions (s, q);
  pw_place_rates (s, v);
  return place_signals (s, t, q, v);
}

void pw_hold (pw_system *s, int hold) {
  s->hold = hold;
  s->t_signal = NAN;
}

double pw_next_breakpoint (const pw_system *s, double t) {
  double next = INFINITY;
  for (int k = 0; k < s->slabs; k++)
    for (int i = 0; i < s->slab[k].b.count * s->slab[k].kind->signals; i++)
      next = fmin (next, pw_signal_breakpoint (&s->slab[k].source[i].signal, t));
  return next;
}
