/* pfaffian: a linear combination of the velocities of two bodies, in the axes of body 1, equals a signal u.
 *
 *   a . (R(phi1)^T r1', omega1) + b . (R(phi1)^T r2', omega2) = u  (1 nonholonomic equation)
 *   S     = [ A a3 | B b3 ],  A = R(phi1) (a1, a2), B = R(phi1) (b1, b2),  eta = u
 *   gamma = u' - omega1 (p(A).r1' + p(B).r2')           so that S v' = gamma; p(A) = A turned by +90 degrees
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.)
 * The reaction F = -lambda acts on body 1 as the force F A and the moment F a3, on body 2 as F B and F b3.  F is in
 * N if A and B have no unit, in N m if A = B = 0 and a3, b3 have no unit.  The two forces need not balance: their sum
 * is an external force.  The power is F u. */
#include <string.h>
#include "batch.h"

typedef struct {
  double a[3], b[3];
} pfaffian;

/* A relation in the current state. */
typedef struct {
  const pfaffian *element;
  const pw_configuration *body1, *body2;
  const double *w, *u; /* the vector w of jw_q, else NULL; the signal with two time derivatives */
  double A[2], B[2];
} pfaffian_state;

static inline pfaffian_state pfaffian_at (const pw_batch *batch, int e) {
  const pfaffian *element = (const pfaffian *)batch->element + e;
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  pfaffian_state now = { element, body1, body2, .w = batch_w (batch, e), .u = batch->u + 3 * e };
  to_world (body1, element->a, now.A);
  to_world (body1, element->b, now.B);
  return now;
}

PREPARE (pfaffian_prepare, pw_pfaffian, pfaffian) {
  memcpy (element->a, definition->a, sizeof element->a);
  memcpy (element->b, definition->b, sizeof element->b);
  for (int i = 0; i < 3; i++)
    if (definition->a[i] != 0 || definition->b[i] != 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "all numbers of a and b are 0: expected at least one that is not");
}

PER_ELEMENT (pfaffian_J, pfaffian, 6) {
  out[0] = now.A[0], out[1] = now.A[1], out[2] = now.element->a[2];
  out[3] = now.B[0], out[4] = now.B[1], out[5] = now.element->b[2];
}

PER_ELEMENT (pfaffian_gamma, pfaffian, 1) {
  *out = now.u[1] - now.body1->omega * (now.A[0] * now.body1->vy - now.A[1] * now.body1->vx + now.B[0] * now.body2->vy -
                                        now.B[1] * now.body2->vx);
}

PER_ELEMENT (pfaffian_jw_q, pfaffian, 6) {
  memset (out, 0, 6 * sizeof *out);
  out[2] = now.A[0] * now.w[1] - now.A[1] * now.w[0] + now.B[0] * now.w[4] - now.B[1] * now.w[3];
}

PER_ELEMENT (pfaffian_gamma_q, pfaffian, 6) {
  memset (out, 0, 6 * sizeof *out);
  out[2] = now.body1->omega *
           (now.A[0] * now.body1->vx + now.A[1] * now.body1->vy + now.B[0] * now.body2->vx + now.B[1] * now.body2->vy);
}

PER_ELEMENT (pfaffian_gamma_v, pfaffian, 6) {
  double omega = now.body1->omega;
  out[0] = omega * now.A[1], out[1] = -omega * now.A[0],
  out[2] = now.A[1] * now.body1->vx - now.A[0] * now.body1->vy + now.B[1] * now.body2->vx - now.B[0] * now.body2->vy;
  out[3] = omega * now.B[1], out[4] = -omega * now.B[0], out[5] = 0;
}

static const pw_field pfaffian_fields[] = {
  BODIES_FIELD (pw_pfaffian),
  { PW_AT (pw_pfaffian, a), PW_NUMBER, .count = 3, .required = 1,
    .about = "coefficients of vx, vy and omega of the first body, in its frame" },
  { PW_AT (pw_pfaffian, b), PW_NUMBER, .count = 3,
    .about = "coefficients of vx, vy and omega of the second body, in the frame of the first" },
  { PW_AT (pw_pfaffian, value), PW_SIGNAL, .about = "value of the sum, a signal with its derivative" },
  { .name = NULL },
};

static const char *pfaffian_unit (const void *element, int row) {
  const pfaffian *e = element;
  (void)row;
  return e->a[0] == 0 && e->a[1] == 0 && e->b[0] == 0 && e->b[1] == 0 ? "N m" : "N";
}

const pw_kind pw_kind_pfaffian = {
  .name = "pfaffian",
  .about = "a linear relation, given by its coefficients, between the velocities of one or two bodies",
  TYPE (pfaffian, pw_pfaffian, pfaffian),
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("F", "N or N m", "F a and F b are force and moment on the two bodies, in the frame of the first"),
  .reaction_unit = pfaffian_unit,
  .eta = batch_signal,
  .eta_u = batch_signal_u,
  CONSTRAINT (pfaffian),
};
