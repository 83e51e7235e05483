/* What is held in a steady motion: A (q, v) = value B (q, v).  For a state A is the state and B = 1; for a body
 *
 *     speed      A = vx cos phi + vy sin phi,  B = 1        radius      A = speed,  B = omega
 *                                                           curvature   A = omega,  B = speed */
#include <stdio.h>
#include <string.h>
#include "steady_parts.h"
#include "util.h"

static const struct {
  const char *name, *unit;
} hold_of_body[PW_HOLD_OF_BODY] = { { "speed", "m/s" }, { "radius", "m" }, { "curvature", "1/m" } };

static int hold_unknown (const pw_system *s, const char *name, pw_error *error) {
  pw_nearest near = { .sought = name };
  for (int i = 0; i < 2 * s->coords + PW_HOLD_OF_BODY * s->bodies; i++)
    pw_nearest_try (&near, PW_NAME (pw_system_held_name, s, i));
  return pw_fail (error, PW_INPUT, "model %s has no state \"%s\"%s", s->model, name, pw_nearest_text (&near));
}

int pw_system_find_held (const pw_system *s, const char *name, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (name, "a name", error) != PW_OK) return PW_INPUT;
  const char *dot = strrchr (name, '.');
  pw_error none = { 0 };
  for (int k = 0; dot && k < PW_HOLD_OF_BODY; k++) {
    if (strcmp (dot + 1, hold_of_body[k].name) != 0) continue;
    int b = pw_system_find_body (s, PW_PRINTED (300, "%.*s", (int)(dot - name), name));
    if (b >= 0) return 2 * s->coords + b * PW_HOLD_OF_BODY + k;
  }
  int state = pw_system_find_state (s, name, &none);
  return state >= 0 ? state : hold_unknown (s, name, error);
}

char *pw_system_held_name (const pw_system *s, int held, char *buffer, size_t size) {
  int index = held - 2 * s->coords;
  if (index < 0) return pw_system_state_name (s, held, buffer, size);
  snprintf (buffer, size, "%s.%s", s->body_name[index / PW_HOLD_OF_BODY], hold_of_body[index % PW_HOLD_OF_BODY].name);
  return buffer;
}

const char *pw_system_held_unit (const pw_system *s, int held) {
  int index = held - 2 * s->coords;
  return index < 0 ? pw_system_state_unit (s, held) : hold_of_body[index % PW_HOLD_OF_BODY].unit;
}

typedef struct {
  double A, B;
} hold_pair;

/* A and B, or if dq is not NULL, their changes by the variation (dq, dv). */
static hold_pair hold_terms (const pw_system *s, int held, const double *q, const double *v, const double *dq,
                             const double *dv) {
  int index = held - 2 * s->coords, b = 3 * (index / PW_HOLD_OF_BODY);
  double B_constant = dq ? 0 : 1; /* B = 1, or its change */
  if (held < s->coords) return (hold_pair){ dq ? dq[held] : q[held], B_constant };
  if (index < 0) return (hold_pair){ dq ? dv[held - s->coords] : v[held - s->coords], B_constant };
  double c = pw_cos (q[b + 2]), sine = pw_sin (q[b + 2]), speed = c * v[b] + sine * v[b + 1], omega = v[b + 2];
  if (dq) speed = c * dv[b] + sine * dv[b + 1] + (c * v[b + 1] - sine * v[b]) * dq[b + 2], omega = dv[b + 2];
  return index % PW_HOLD_OF_BODY == PW_HOLD_SPEED    ? (hold_pair){ speed, B_constant }
         : index % PW_HOLD_OF_BODY == PW_HOLD_RADIUS ? (hold_pair){ speed, omega }
                                                     : (hold_pair){ omega, speed };
}

double pw_system_held_value (const pw_system *s, int held, const double *q, const double *v) {
  const hold_pair pair = hold_terms (s, held, q, v, NULL, NULL);
  return pair.A / pair.B;
}

/* The unit of A, a product of units of the scene. */
static double hold_unit (const pw_steady *x, int held) {
  int n = x->n, index = held - 2 * n;
  if (index < 0) return held < n ? pw_unit (x->s, held) : pw_unit (x->s, held - n) / x->T;
  return (index % PW_HOLD_OF_BODY == PW_HOLD_CURVATURE ? 1 : x->L) / x->T;
}

double pw_hold_residual (const pw_steady *x, const pw_initial_value *hold, const double *dq, const double *dv) {
  const hold_pair pair = hold_terms (x->s, hold->state, x->q, x->v, dq, dv);
  return (pair.A - hold->value * pair.B) / hold_unit (x, hold->state);
}
