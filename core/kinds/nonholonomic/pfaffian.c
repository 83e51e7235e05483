/* pfaffian: a linear combination of the velocities of two bodies, in the axes of body 1, equals a signal u.
 *
 *   a . (R(phi1)^T r1', w1) + b . (R(phi1)^T r2', w2) = u          (1 nonholonomic equation)
 *   S     = [ A a3 | B b3 ],  A = R(phi1) (a1, a2), B = R(phi1) (b1, b2),  eta = u
 *   gamma = u' - w1 (p(A).r1' + p(B).r2')                          so that S a = gamma; p rotates by +90 degrees
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.)
 * The reaction F = -lambda acts on body 1 as the force F A and the moment F a3, on body 2 as F B and F b3; the
 * two need not balance; the difference is an external force.  The power is F u. */
#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double a[3], b[3];
} pfaffian;

/* A relation in the current state: A and B in world axes. */
typedef struct {
  const pfaffian *k;
  const pw_configuration *P, *Q;
  const double *w, *u;
  double Ax, Ay, Bx, By;
} pfaffian_state;

static inline pfaffian_state pfaffian_at (const pw_batch *b, int e) {
  const pfaffian *k = (const pfaffian *)b->element + e;
  const pw_configuration *P = batch_body (b, e, 2, 0), *Q = batch_body (b, e, 2, 1);
  pfaffian_state x = { .k = k, .P = P, .Q = Q, .w = batch_w (b, e), .u = b->u + 3 * e };
  x.Ax = P->cos * k->a[0] - P->sin * k->a[1], x.Ay = P->sin * k->a[0] + P->cos * k->a[1];
  x.Bx = P->cos * k->b[0] - P->sin * k->b[1], x.By = P->sin * k->b[0] + P->cos * k->b[1];
  return x;
}

PREPARE (pfaffian_prepare, pw_pfaffian, pfaffian) {
  double size = 0;
  memcpy (k->a, d->a, sizeof k->a);
  memcpy (k->b, d->b, sizeof k->b);
  for (int i = 0; i < 3; i++) size = fmax (size, fmax (fabs (d->a[i]), fabs (d->b[i])));
  if (size == 0) return pw_fail (error, PW_INPUT, "a and b are all zero: expected at least one other number");
  return PW_OK;
}

PER_ELEMENT (pfaffian_J, pfaffian, 6) {
  out[0] = x.Ax, out[1] = x.Ay, out[2] = x.k->a[2], out[3] = x.Bx, out[4] = x.By, out[5] = x.k->b[2];
}

PER_ELEMENT (pfaffian_gamma, pfaffian, 1) {
  *out = x.u[1] - x.P->omega * (x.Ax * x.P->vy - x.Ay * x.P->vx + x.Bx * x.Q->vy - x.By * x.Q->vx);
}

PER_ELEMENT (pfaffian_jw_q, pfaffian, 6) {
  memset (out, 0, 6 * sizeof *out);
  out[2] = x.Ax * x.w[1] - x.Ay * x.w[0] + x.Bx * x.w[4] - x.By * x.w[3];
}

PER_ELEMENT (pfaffian_gamma_q, pfaffian, 6) {
  memset (out, 0, 6 * sizeof *out);
  out[2] = x.P->omega * (x.Ax * x.P->vx + x.Ay * x.P->vy + x.Bx * x.Q->vx + x.By * x.Q->vy);
}

PER_ELEMENT (pfaffian_gamma_v, pfaffian, 6) {
  double w = x.P->omega;
  out[0] = w * x.Ay, out[1] = -w * x.Ax, out[2] = x.Ay * x.P->vx - x.Ax * x.P->vy + x.By * x.Q->vx - x.Bx * x.Q->vy;
  out[3] = w * x.By, out[4] = -w * x.Bx, out[5] = 0;
}

static const pw_field pfaffian_fields[] = {
  { PW_AT (pw_pfaffian, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_pfaffian, a), PW_NUMBER, .count = 3, .required = 1,
    .about = "coefficients of vx, vy and omega of the first body, in its frame" },
  { PW_AT (pw_pfaffian, b), PW_NUMBER, .count = 3,
    .about = "coefficients of vx, vy and omega of the second body, in the frame of the first" },
  { PW_AT (pw_pfaffian, value), PW_SIGNAL, .about = "value of the sum as a function of time, with its derivative" },
  { .name = NULL },
};

static const pw_quantity pfaffian_reaction[] = {
  { "F", "N", NULL, "F a and F b are force and moment on the two bodies, in the frame of the first" },
};

const pw_kind pw_kind_pfaffian = {
  .name = "pfaffian",
  .about = "a linear relation, given by its coefficients, between the velocities of one or two bodies",
  DEFINITION (pw_pfaffian, pfaffian_fields),
  ELEMENT (pfaffian, pfaffian_prepare),
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = pfaffian_reaction,
  .eta = batch_signal,
  CONSTRAINT (pfaffian),
};
