/* wheel: a knife edge; the contact point P does not move across the heading.
 *
 *   n . v_P = 0,  n = (-sin, cos)(phi + psi)                      (1 nonholonomic row)
 *   S     = [ -sin(theta)  cos(theta)  l ]      theta = phi + psi, l = s . (cos psi, sin psi): the arm along the heading
 *   gamma = w (cos(theta) vx + sin(theta) vy)                     so that S a = gamma
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.)
 * The lateral force on the body, along n, is N = -lambda. */
#include <math.h>
#include "contact.h"

typedef struct {
  double at[2];    /* contact point in the body's frame [m] */
  double cos, sin; /* of the heading in the body */
  double arm;      /* of the contact point along the heading [m] */
  double heading;  /* [rad] */
} wheel;

/* Names the parts of element e: its pose and the direction (c, s) it rolls in. */
#define WHEEL_PARTS                               \
  const wheel *k = (const wheel *)b->element + e; \
  const pw_pose *A = &b->pose[b->body[e]];        \
  double c = A->cos * k->cos - A->sin * k->sin, s = A->sin * k->cos + A->cos * k->sin

static int wheel_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                          pw_error *error) {
  const pw_wheel *d = definition;
  double c = cos (d->heading), s = sin (d->heading);
  *(wheel *)element = (wheel){ { d->at[0], d->at[1] }, c, s, d->at[0] * c + d->at[1] * s, d->heading };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void wheel_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WHEEL_PARTS;
    out[0] = -s, out[1] = c, out[2] = k->arm;
  }
}

static void wheel_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    WHEEL_PARTS;
    out[e] = A->omega * (c * A->vx + s * A->vy);
  }
}

static void wheel_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WHEEL_PARTS;
    out[0] = out[1] = 0, out[2] = -c * b->w[3 * e] - s * b->w[3 * e + 1];
  }
}

static void wheel_jtl_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    WHEEL_PARTS;
    for (int i = 0; i < 9; i++) out[i] = 0;
    out[2] = -c * b->lambda[e], out[5] = -s * b->lambda[e];
  }
}

static void wheel_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WHEEL_PARTS;
    out[0] = out[1] = 0, out[2] = A->omega * (c * A->vy - s * A->vx);
  }
}

static void wheel_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WHEEL_PARTS;
    out[0] = A->omega * c, out[1] = A->omega * s, out[2] = c * A->vx + s * A->vy;
  }
}

static void wheel_contact (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const wheel *k = (const wheel *)b->element + e;
    contact_place (&b->pose[b->body[e]], k->at, k->heading, out);
  }
}

static const pw_field wheel_fields[] = {
  { PW_AT (pw_wheel, body), PW_BODY, .required = 1, .about = "the body that carries the wheel" },
  { PW_AT (pw_wheel, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point in the body's frame" },
  { PW_AT (pw_wheel, heading), PW_NUMBER, .unit = "rad",
    .about = "rolling direction in the body's frame; 0: along its x" },
  { .name = NULL },
};

static const pw_quantity wheel_reaction[] = { { "N", "N", NULL,
                                                "lateral force on the body, to the left of the heading" } };

const pw_kind pw_kind_wheel = {
  .name = "wheel",
  .about = "a knife edge: a point of the body moves only along a heading fixed in the body",
  .definition = sizeof (pw_wheel),
  .element = sizeof (wheel),
  .fields = wheel_fields,
  .bodies = 1,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = wheel_reaction,
  .prepare = wheel_prepare,
  .J = wheel_J,
  .gamma = wheel_gamma,
  .jw_q = wheel_jw_q,
  .jtl_q = wheel_jtl_q,
  .gamma_q = wheel_gamma_q,
  .gamma_v = wheel_gamma_v,
  .contact = wheel_contact,
};
