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
#include "pinwheel.h"

typedef struct {
  double a[3], b[3];
} pfaffian;

#define PFAFFIAN_PARTS                                                                                       \
  const pfaffian *k = (const pfaffian *)b->element + e;                                                      \
  const pw_configuration *P = &b->configuration[b->body[2 * e]], *Q = &b->configuration[b->body[2 * e + 1]]; \
  const double Ax = P->cos * k->a[0] - P->sin * k->a[1], Ay = P->sin * k->a[0] + P->cos * k->a[1];           \
  const double Bx = P->cos * k->b[0] - P->sin * k->b[1], By = P->sin * k->b[0] + P->cos * k->b[1];           \
  (void)Q

static int pfaffian_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                             pw_error *error) {
  const pw_pfaffian *d = definition;
  pfaffian *k = element;
  double size = 0;
  memcpy (k->a, d->a, sizeof k->a);
  memcpy (k->b, d->b, sizeof k->b);
  for (int i = 0; i < 3; i++) size = fmax (size, fmax (fabs (d->a[i]), fabs (d->b[i])));
  (void)bodies, (void)own;
  if (size == 0) return pw_fail (error, PW_INPUT, "a and b are all zero: that relates nothing");
  return PW_OK;
}

static void pfaffian_eta (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) out[e] = b->u[3 * e];
}

static void pfaffian_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    PFAFFIAN_PARTS;
    out[0] = Ax, out[1] = Ay, out[2] = k->a[2], out[3] = Bx, out[4] = By, out[5] = k->b[2];
  }
}

static void pfaffian_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    PFAFFIAN_PARTS;
    out[e] = b->u[3 * e + 1] - P->omega * (Ax * P->vy - Ay * P->vx + Bx * Q->vy - By * Q->vx);
  }
}

static void pfaffian_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    PFAFFIAN_PARTS;
    const double *w = b->w + 6 * e;
    memset (out, 0, 6 * sizeof *out);
    out[2] = Ax * w[1] - Ay * w[0] + Bx * w[4] - By * w[3];
  }
}

static void pfaffian_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    PFAFFIAN_PARTS;
    memset (out, 0, 6 * sizeof *out);
    out[2] = P->omega * (Ax * P->vx + Ay * P->vy + Bx * Q->vx + By * Q->vy);
  }
}

static void pfaffian_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    PFAFFIAN_PARTS;
    double w = P->omega;
    out[0] = w * Ay, out[1] = -w * Ax, out[2] = Ay * P->vx - Ax * P->vy + By * Q->vx - Bx * Q->vy;
    out[3] = w * By, out[4] = -w * Bx, out[5] = 0;
  }
}

static const pw_field pfaffian_fields[] = {
  { PW_AT (pw_pfaffian, body), PW_BODY, .count = 2, .required = 1,
    .about = "the two bodies, or ground for one of them" },
  { PW_AT (pw_pfaffian, a), PW_NUMBER, .count = 3, .required = 1,
    .about = "coefficients of the first body's velocity, x and y along its own axes, and of its rate" },
  { PW_AT (pw_pfaffian, b), PW_NUMBER, .count = 3,
    .about = "coefficients of the second body's velocity, x and y along the first's axes, and of its rate" },
  { PW_AT (pw_pfaffian, value), PW_SIGNAL, .about = "what the sum is over time, with its derivative" },
  { .name = NULL },
};

static const pw_quantity pfaffian_reaction[] = {
  { "F", "N", NULL, "times a and b: force and moment on the two bodies, along the first one's axes" },
};

const pw_kind pw_kind_pfaffian = {
  .name = "pfaffian",
  .about = "a linear relation between the velocities of one or two bodies, stated by its coefficients",
  .definition = sizeof (pw_pfaffian),
  .element = sizeof (pfaffian),
  .fields = pfaffian_fields,
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = pfaffian_reaction,
  .prepare = pfaffian_prepare,
  .eta = pfaffian_eta,
  .J = pfaffian_J,
  .gamma = pfaffian_gamma,
  .jw_q = pfaffian_jw_q,
  .gamma_q = pfaffian_gamma_q,
  .gamma_v = pfaffian_gamma_v,
};
