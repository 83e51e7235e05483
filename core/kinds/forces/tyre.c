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
  double c, s, ve, vn, F; /* heading in the world; speeds of P; force along n */
  double F_ve, F_vn;      /* derivatives of F */
} tyre_slip;

static tyre_slip tyre_at (const tyre *k, const pw_configuration *A) {
  tyre_slip x = { .c = A->cos * k->cos - A->sin * k->sin, .s = A->sin * k->cos + A->cos * k->sin };
  x.ve = x.c * A->vx + x.s * A->vy - k->aside * A->omega;
  x.vn = x.c * A->vy - x.s * A->vx + k->along * A->omega;
  double R = sqrt (x.ve * x.ve + k->speed * k->speed), sigma = x.vn / R, slope = -k->stiffness;
  x.F = slope * sigma;
  if (k->limit > 0) {
    double y = tanh (x.F / k->limit);
    x.F = k->limit * y;
    slope *= 1 - y * y;
  }
  x.F_vn = slope / R;
  x.F_ve = -slope * sigma * x.ve / (R * R);
  return x;
}

#define TYRE_PARTS                                           \
  const tyre *k = (const tyre *)b->element + e;              \
  const pw_configuration *A = &b->configuration[b->body[e]]; \
  const tyre_slip x = tyre_at (k, A)

static int tyre_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                         pw_error *error) {
  const pw_tyre *d = definition;
  double c = pw_cos (d->heading), s = pw_sin (d->heading), along = d->at[0] * c + d->at[1] * s,
         aside = d->at[1] * c - d->at[0] * s;
  *(tyre *)element = (tyre){
    { d->at[0], d->at[1] }, c, s, along, aside, d->heading, d->stiffness, d->speed, d->friction * d->load,
  };
  (void)bodies, (void)own;
  if (d->load > 0 && !(d->friction > 0))
    return pw_fail (error, PW_INPUT, "friction = %g: expected > 0, since a load limits the force to friction x load",
                    d->friction);
  return PW_OK;
}

static void tyre_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    TYRE_PARTS;
    out[0] = -x.F * x.s, out[1] = x.F * x.c, out[2] = x.F * k->along;
  }
}

/* d(F S)/dphi with dS/dphi = -(c, s, 0), dv_n/dphi = -(c, s) . v, dv_e/dphi = (-s, c) . v, v: velocity of the body. */
static void tyre_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    TYRE_PARTS;
    double slope = -x.F_vn * (x.c * A->vx + x.s * A->vy) + x.F_ve * (x.c * A->vy - x.s * A->vx);
    memset (out, 0, 9 * sizeof *out);
    out[2] = -x.F * x.c - slope * x.s;
    out[5] = -x.F * x.s + slope * x.c;
    out[8] = slope * k->along;
  }
}

static void tyre_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    TYRE_PARTS;
    const double S[3] = { -x.s, x.c, k->along }, E[3] = { x.c, x.s, -k->aside };
    for (int i = 0; i < 9; i++) out[i] = S[i / 3] * (x.F_vn * S[i % 3] + x.F_ve * E[i % 3]);
  }
}

/* Velocity scales: R along the heading, over which the slip varies near rest; laterally, if there is a limit, the
 * change that reverses a saturated force. */
static void tyre_saturation (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    TYRE_PARTS;
    double R = sqrt (x.ve * x.ve + k->speed * k->speed), across = k->limit / k->stiffness * R + fabs (x.vn);
    double vc = x.c * A->vx + x.s * A->vy, vs = x.c * A->vy - x.s * A->vx;
    const double E[6] = { 0, 0, vs, x.c, x.s, -k->aside }, S[6] = { 0, 0, -vc, -x.s, x.c, k->along };
    for (int i = 0; i < 6; i++) {
      if (E[i] != 0) out[i] = R / fabs (E[i]);
      if (S[i] != 0 && k->limit > 0) out[i] = fmin (out[i], across / fabs (S[i]));
    }
  }
}

static void tyre_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    TYRE_PARTS;
    out[e] = -x.F * x.vn;
  }
}

static void tyre_contact (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const tyre *k = (const tyre *)b->element + e;
    contact_to_world (&b->configuration[b->body[e]], k->at, k->heading, out);
  }
}

static const pw_field tyre_fields[] = {
  { PW_AT (pw_tyre, body), PW_BODY, .required = 1, .about = "the body that carries the tyre" },
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
    .about = "the limit is friction times load; needed with a load" },
  { .name = NULL },
};

const pw_kind pw_kind_tyre = {
  .name = "tyre",
  .about = "a wheel that gives way sideways, with a lateral force that grows with its slip",
  .definition = sizeof (pw_tyre),
  .element = sizeof (tyre),
  .fields = tyre_fields,
  .bodies = 1,
  .level = PW_FORCE,
  .prepare = tyre_prepare,
  .force = tyre_force,
  .force_q = tyre_force_q,
  .force_v = tyre_force_v,
  .saturation = tyre_saturation,
  .loss = tyre_loss,
  .contact = tyre_contact,
};
