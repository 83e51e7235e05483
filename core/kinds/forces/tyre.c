/* tyre: a wheel with lateral slip; a lateral force at the contact point P opposes the slip.
 *
 *   sigma = v_n / R,  R = sqrt (v_e^2 + v0^2)      v_e, v_n: speed of P along the heading and to its left
 *   F     = -C sigma                                              (linear: no limit)
 *   F     = -mu N tanh (C sigma / (mu N))                         (saturating)
 *   f     = F S,  S = [ -sin(theta)  cos(theta)  l ]              theta = phi + psi, psi: the heading in the body;
 *   v_n   = S v,  v_e = [ cos(theta)  sin(theta)  -m ] v          l, m: coordinates of P along it, and to its left
 *   loss  = -F v_n >= 0
 *
 * (Pacejka 2012, Tire and Vehicle Dynamics, chapter 1, for slip and cornering stiffness; the regularising v0 keeps the
 * slip smooth at rest.)  As C grows, v_n = -F R / C vanishes like 1/C: the tyre approaches a knife edge. */
#include <math.h>
#include <string.h>
#include "contact.h"

typedef struct {
  contact along, across; /* the two components of the velocity of P */
  double stiffness;      /* C [N] */
  double speed;          /* v0 [m/s] */
  double limit;          /* mu N [N]; 0: no limit */
} tyre;

/* A tyre in the current state. */
typedef struct {
  const tyre *k;
  contact_state e, n;  /* along and across the heading */
  double ve, vn, R, F; /* speeds of P; R; force along n */
  double F_ve, F_vn;   /* derivatives of F */
} tyre_state;

static inline tyre_state tyre_at (const pw_batch *b, int e) {
  const tyre *k = (const tyre *)b->element + e;
  tyre_state x = { .k = k, .e = contact_of (k->along, b, e), .n = contact_of (k->across, b, e) };
  x.ve = contact_speed (&x.e), x.vn = contact_speed (&x.n), x.R = sqrt (x.ve * x.ve + k->speed * k->speed);
  double sigma = x.vn / x.R, slope = -k->stiffness;
  x.F = slope * sigma;
  double y = WHERE (k->limit > 0, tanh (x.F / k->limit));
  x.F = k->limit > 0 ? k->limit * y : x.F;
  slope *= k->limit > 0 ? 1 - y * y : 1;
  x.F_vn = slope / x.R;
  x.F_ve = -slope * sigma * x.ve / (x.R * x.R);
  return x;
}

PREPARE (tyre_prepare, pw_tyre, tyre) {
  *k = (tyre){ contact_along (d->at, d->heading), contact_across (d->at, d->heading), d->stiffness, d->speed,
               d->friction * d->load };
  if (d->load > 0 && !(d->friction > 0))
    return pw_fail (error, PW_INPUT, "friction = %g: expected > 0, since a load limits the force to friction x load",
                    d->friction);
  return PW_OK;
}

PER_ELEMENT (tyre_force, tyre, 3) {
  out[0] = x.F * x.n.dx, out[1] = x.F * x.n.dy, out[2] = x.F * x.k->across.arm;
}

/* d(F S)/dphi with dS/dphi = -(c, s, 0), dv_n/dphi = -(c, s) . v, dv_e/dphi = (-s, c) . v, v: velocity of the body. */
PER_ELEMENT (tyre_force_q, tyre, 9) {
  const pw_configuration *A = x.n.A;
  double c = x.e.dx, s = x.e.dy, slope = -x.F_vn * (c * A->vx + s * A->vy) + x.F_ve * (c * A->vy - s * A->vx);
  memset (out, 0, 9 * sizeof *out);
  out[2] = -x.F * c - slope * s;
  out[5] = -x.F * s + slope * c;
  out[8] = slope * x.k->across.arm;
}

PER_ELEMENT (tyre_force_v, tyre, 9) {
  double S[3], E[3];
  contact_J_one (x.n, S);
  contact_J_one (x.e, E);
  for (int i = 0; i < 9; i++) out[i] = S[i / 3] * (x.F_vn * S[i % 3] + x.F_ve * E[i % 3]);
}

/* Velocity scales: R along the heading, over which the slip varies near rest; laterally, if there is a limit, the
 * change that reverses a saturated force. */
PER_ELEMENT (tyre_saturation, tyre, 6) {
  double across = x.k->limit / x.k->stiffness * x.R + fabs (x.vn), E[6] = { 0 }, S[6] = { 0 };
  E[2] = x.n.dx * x.n.A->vx + x.n.dy * x.n.A->vy, S[2] = -x.e.dx * x.e.A->vx - x.e.dy * x.e.A->vy;
  contact_J_one (x.e, E + 3);
  contact_J_one (x.n, S + 3);
  for (int i = 0; i < 6; i++) {
    if (E[i] != 0) out[i] = x.R / fabs (E[i]);
    if (S[i] != 0 && x.k->limit > 0) out[i] = fmin (out[i], across / fabs (S[i]));
  }
}

PER_ELEMENT (tyre_loss, tyre, 1) {
  *out = -x.F * x.vn;
}

PER_ELEMENT (tyre_contact, tyre, 3) {
  contact_place_one (x.e, out);
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
  FORCE (tyre),
  .saturation = tyre_saturation,
  .loss = tyre_loss,
  .contact = tyre_contact,
};
