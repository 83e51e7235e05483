/* steered-wheel: a knife edge whose heading in the body is a signal u of time.
 *
 *   n . v_P = 0,  n = (-sin, cos)(phi + u)                        (1 nonholonomic equation)
 *   S     = [ -sin(theta)  cos(theta)  l ]      theta = phi + u;  l, m: arm of P along the heading, to its left
 *   gamma = (w + u') (cos(theta) vx + sin(theta) vy) - u' m w     so that S a = gamma, with l' = u' m
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.) The lateral force on the body, along n, is N
 * = -lambda.  It acts at the steering pivot, so steering needs no moment and does no work. */
#include <math.h>
#include "contact.h"

typedef struct {
  double at[2]; /* contact point in the body's frame [m] */
} steered;

/* A wheel in the current state. */
typedef struct {
  const steered *k;
  const pw_configuration *A;
  const double *w, *u;
  double c, s;         /* heading in the world */
  double along, aside; /* l, m */
  double turn, rate;   /* u' and w + u' */
} steered_state;

static inline steered_state steered_at (const pw_batch *b, int e) {
  const steered *k = (const steered *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[e]];
  const double *u = b->u + 3 * e;
  double c, s;
  pw_sin_cos (u[0], &s, &c);
  return (steered_state){ k,
                          A,
                          batch_w (b, e),
                          u,
                          .c = A->cos * c - A->sin * s,
                          .s = A->sin * c + A->cos * s,
                          .along = k->at[0] * c + k->at[1] * s,
                          .aside = k->at[1] * c - k->at[0] * s,
                          .turn = u[1],
                          .rate = A->omega + u[1] };
}

PREPARE (steered_prepare, pw_steered_wheel, steered) {
  *k = (steered){ { d->at[0], d->at[1] } };
}

PER_ELEMENT (steered_J, steered, 3) {
  out[0] = -x.s, out[1] = x.c, out[2] = x.along;
}

PER_ELEMENT (steered_gamma, steered, 1) {
  *out = x.rate * (x.c * x.A->vx + x.s * x.A->vy) - x.turn * x.aside * x.A->omega;
}

PER_ELEMENT (steered_jw_q, steered, 3) {
  out[0] = out[1] = 0, out[2] = -x.c * x.w[0] - x.s * x.w[1];
}

PER_ELEMENT (steered_gamma_q, steered, 3) {
  out[0] = out[1] = 0, out[2] = x.rate * (x.c * x.A->vy - x.s * x.A->vx);
}

PER_ELEMENT (steered_gamma_v, steered, 3) {
  out[0] = x.rate * x.c, out[1] = x.rate * x.s, out[2] = x.c * x.A->vx + x.s * x.A->vy - x.turn * x.aside;
}

PER_ELEMENT (steered_contact, steered, 3) {
  contact_to_world (x.A, x.k->at, x.u[0], out);
}

static const pw_field steered_fields[] = {
  { PW_AT (pw_steered_wheel, body), PW_BODY, .required = 1, .about = "the body with the wheel" },
  { PW_AT (pw_steered_wheel, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point in the body's frame" },
  { PW_AT (pw_steered_wheel, heading), PW_SIGNAL, .unit = "rad", .required = 1,
    .about = "rolling direction in the body's frame as a function of time, with its derivative; 0: along its x" },
  { .name = NULL },
};

static const pw_quantity steered_reaction[] = {
  { "N", "N", NULL, "lateral force on the body, to the left of the heading" },
};

const pw_kind pw_kind_steered_wheel = {
  .name = "steered-wheel",
  .about = "a knife edge whose heading in the body follows a signal of time",
  .symbol = "0 -1.6 -.2 0 1.6 -.2 0 1.6 .2 0 -1.6 .2 0 -1.6 -.2",
  DEFINITION (pw_steered_wheel, steered_fields),
  ELEMENT (steered, steered_prepare),
  .bodies = 1,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = steered_reaction,
  .J = steered_J,
  .gamma = steered_gamma,
  .jw_q = steered_jw_q,
  .gamma_q = steered_gamma_q,
  .gamma_v = steered_gamma_v,
  .contact = steered_contact,
};
