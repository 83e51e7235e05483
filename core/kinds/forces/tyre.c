/* tyre: a wheel with lateral slip; a lateral force at the contact point P opposes the slip.
 *
 *   sigma = v_n / R,  R = sqrt (v_e^2 + v0^2)      v_e, v_n: speed of P along the heading and to its left
 *   F     = -C sigma                                              (linear: no limit)
 *   F     = -mu N tanh (C sigma / (mu N))                         (saturating)
 *   f     = F S,  S = [ -sin(theta)  cos(theta)  l ]              theta = phi + psi, l: the arm along the heading
 *   loss  = -F v_n >= 0
 *
 * (Pacejka 2012, Tire and Vehicle Dynamics, chapter 1, for slip and cornering stiffness; the regularising v0 keeps the
 * slip smooth at rest.)  As C grows, v_n = -F R / C vanishes like 1/C: the tyre approaches a knife edge. */
#include <math.h>
#include <string.h>
#include "contact.h"

typedef struct {
  double at[2];        /* contact point in the body's frame [m] */
  double cos, sin;     /* of the heading in the body's frame */
  double along, aside; /* components of the arm along the heading and to its left [m] */
  double heading;      /* [rad] */
  double stiffness;    /* C [N] */
  double speed;        /* v0 [m/s] */
  double limit;        /* mu N [N]; 0: no limit */
} tyre;

/* The slip of one tyre: directions, speeds, the force and its derivatives. */
typedef struct {
  const tyre *k;
  const pw_configuration *A;
  double c, s, ve, vn, F; /* heading in the world; speeds of P; force along n */
  double F_ve, F_vn;      /* derivatives of F */
} tyre_state;

static inline tyre_state tyre_at (const pw_batch *b, int e) {
  const tyre *k = (const tyre *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[e]];
  tyre_state x = { k, A, .c = A->cos * k->cos - A->sin * k->sin, .s = A->sin * k->cos + A->cos * k->sin };
  x.ve = x.c * A->vx + x.s * A->vy - k->aside * A->omega;
  x.vn = x.c * A->vy - x.s * A->vx + k->along * A->omega;
  double R = sqrt (x.ve * x.ve + k->speed * k->speed), sigma = x.vn / R, slope = -k->stiffness;
  x.F = slope * sigma;
  double y = WHERE (k->limit > 0, tanh (x.F / k->limit));
  x.F = k->limit > 0 ? k->limit * y : x.F;
  slope *= k->limit > 0 ? 1 - y * y : 1;
  x.F_vn = slope / R;
  x.F_ve = -slope * sigma * x.ve / (R * R);
  return x;
}

static int tyre_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  const pw_tyre *d = definition;
  double c = pw_cos (d->heading), s = pw_sin (d->heading), along = d->at[0] * c + d->at[1] * s,
         aside = d->at[1] * c - d->at[0] * s;
  *(tyre *)element = (tyre){
    { d->at[0], d->at[1] }, c, s, along, aside, d->heading, d->stiffness, d->speed, d->friction * d->load,
  };
  (void)bodies, (void)internal;
  if (d->load > 0 && !(d->friction > 0))
    return pw_fail (error, PW_INPUT, "friction = %g: expected > 0, since a load limits the force to friction x load",
                    d->friction);
  return PW_OK;
}

PER_ELEMENT (tyre_force, tyre, 3) {
  out[0] = -x.F * x.s, out[1] = x.F * x.c, out[2] = x.F * x.k->along;
}

/* d(F S)/dphi with dS/dphi = -(c, s, 0), dv_n/dphi = -(c, s) . v, dv_e/dphi = (-s, c) . v, v: velocity of the body. */
PER_ELEMENT (tyre_force_q, tyre, 9) {
  double slope = -x.F_vn * (x.c * x.A->vx + x.s * x.A->vy) + x.F_ve * (x.c * x.A->vy - x.s * x.A->vx);
  memset (out, 0, 9 * sizeof *out);
  out[2] = -x.F * x.c - slope * x.s;
  out[5] = -x.F * x.s + slope * x.c;
  out[8] = slope * x.k->along;
}

PER_ELEMENT (tyre_force_v, tyre, 9) {
  const double S[3] = { -x.s, x.c, x.k->along }, E[3] = { x.c, x.s, -x.k->aside };
  for (int i = 0; i < 9; i++) out[i] = S[i / 3] * (x.F_vn * S[i % 3] + x.F_ve * E[i % 3]);
}

/* Velocity scales: R along the heading, over which the slip varies near rest; laterally, if there is a limit, the
 * change that reverses a saturated force. */
PER_ELEMENT (tyre_saturation, tyre, 6) {
  double R = sqrt (x.ve * x.ve + x.k->speed * x.k->speed), across = x.k->limit / x.k->stiffness * R + fabs (x.vn);
  double vc = x.c * x.A->vx + x.s * x.A->vy, vs = x.c * x.A->vy - x.s * x.A->vx;
  const double E[6] = { 0, 0, vs, x.c, x.s, -x.k->aside }, S[6] = { 0, 0, -vc, -x.s, x.c, x.k->along };
  for (int i = 0; i < 6; i++) {
    if (E[i] != 0) out[i] = R / fabs (E[i]);
    if (S[i] != 0 && x.k->limit > 0) out[i] = fmin (out[i], across / fabs (S[i]));
  }
}

PER_ELEMENT (tyre_loss, tyre, 1) {
  *out = -x.F * x.vn;
}

PER_ELEMENT (tyre_contact, tyre, 3) {
  contact_to_world (x.A, x.k->at, x.k->heading, out);
}

static const pw_field tyre_fields[] = {
  { PW_AT (pw_tyre, body), PW_BODY, .required = 1, .about = "the body with the tyre" },
  { PW_AT (pw_tyre, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point in the body's frame" },
  { PW_AT (pw_tyre, heading), PW_NUMBER, .unit = "rad",
    .about = "rolling direction in the body's frame; 0: along its x" },
  { PW_AT (pw_tyre, stiffness), PW_NUMBER, .unit = "N", .required = 1, .domain = PW_POSITIVE,
    .about = "cornering stiffness: lateral force per slip" },
  { PW_AT (pw_tyre, speed), PW_NUMBER, .unit = "m/s", .required = 1, .domain = PW_POSITIVE,
    .about = "below about this rolling speed the slip is regularised" },
  { PW_AT (pw_tyre, load), PW_NUMBER, .unit = "N", .domain = PW_NONNEGATIVE,
    .about = "normal load that limits the force; 0: no limit" },
  { PW_AT (pw_tyre, friction), PW_NUMBER, .domain = PW_NONNEGATIVE,
    .about = "the limit is friction times load; required with a load" },
  { .name = NULL },
};

const pw_kind pw_kind_tyre = {
  .name = "tyre",
  .symbol = "0 -1.6 -.5 0 1.6 -.5 0 1.6 .5 0 -1.6 .5 0 -1.6 -.5",
  .about = "a wheel with lateral slip; the lateral force increases with the slip",
  DEFINITION (pw_tyre, tyre_fields),
  ELEMENT (tyre, tyre_prepare),
  .bodies = 1,
  .force = tyre_force,
  .force_q = tyre_force_q,
  .force_v = tyre_force_v,
  .saturation = tyre_saturation,
  .loss = tyre_loss,
  .contact = tyre_contact,
};
