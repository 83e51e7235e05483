/* tyre: a wheel with lateral slip; a lateral force at the contact point P opposes the slip.
 *
 *   sigma = v_n / R,  R = sqrt (v_t^2 + v0^2)      v_t, v_n: speed of P along the heading and to its left
 *   F     = -C sigma                                              (linear: no limit)
 *   F     = -mu N tanh (C sigma / (mu N))                         (saturating)
 *   f     = F S_n,  S_n = [ -sin(theta)  cos(theta)  l ]          theta = phi + psi, psi: heading in the body;
 *   v_n   = S_n v,  v_t = S_t v,  S_t = [ cos(theta)  sin(theta)  -m ]    l, m: arm of P along the heading, to its left
 *   loss  = -F v_n >= 0
 *
 * (Pacejka 2012, Tire and Vehicle Dynamics, chapter 1, for slip and cornering stiffness; the regularising v0 keeps the
 * slip smooth at rest.)  As C grows, v_n of the linear law, -F R / C, vanishes: the tyre approaches a knife edge. */
#include <float.h>
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
  const tyre *element;
  contact_state along, across;
  double v_along, v_across, R; /* v_t, v_n, R */
  double F, F_along, F_across; /* F and its derivatives with respect to v_t and v_n */
} tyre_state;

static inline tyre_state tyre_at (const pw_batch *batch, int e) {
  const tyre *element = (const tyre *)batch->element + e;
  tyre_state now = { .element = element,
                     .along = contact_of (element->along, batch, e),
                     .across = contact_of (element->across, batch, e) };
  now.v_along = contact_speed (&now.along), now.v_across = contact_speed (&now.across);
  now.R = sqrt (now.v_along * now.v_along + element->speed * element->speed);
  double sigma = now.v_across / now.R, slope;
  now.F = limited_force (-element->stiffness * sigma, element->limit, &slope);
  double F_sigma = -element->stiffness * slope;
  now.F_across = F_sigma / now.R;
  now.F_along = -F_sigma * sigma * now.v_along / (now.R * now.R);
  return now;
}

PREPARE (tyre_prepare, pw_tyre, tyre) {
  *element =
      (tyre){ contact_along (definition->at, definition->heading), contact_across (definition->at, definition->heading),
              definition->stiffness, definition->speed, definition->friction * definition->load };
  if (element->speed * element->speed < DBL_MIN)
    return pw_fail (error, PW_INPUT, "speed = %g: expected >= 1.5e-154, so that its square does not underflow",
                    element->speed);
  if ((definition->load > 0) == (definition->friction > 0)) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s = 0: expected > 0, since %s limits the force to friction x load",
                  definition->load > 0 ? "friction" : "load", definition->load > 0 ? "a load" : "friction");
}

PER_ELEMENT (tyre_force, tyre, 3) {
  out[0] = now.F * now.across.dx, out[1] = now.F * now.across.dy, out[2] = now.F * now.element->across.arm;
}

/* d(F S_n)/dphi with dS_n/dphi = -(cos(theta), sin(theta), 0). */
PER_ELEMENT (tyre_force_q, tyre, 9) {
  double F_phi = now.F_across * contact_speed_phi (&now.across) + now.F_along * contact_speed_phi (&now.along);
  memset (out, 0, 9 * sizeof *out);
  out[2] = -now.F * now.along.dx + F_phi * now.across.dx;
  out[5] = -now.F * now.along.dy + F_phi * now.across.dy;
  out[8] = F_phi * now.element->across.arm;
}

PER_ELEMENT (tyre_force_v, tyre, 9) {
  double across[3], along[3]; /* S_n, S_t */
  contact_J_one (now.across, across);
  contact_J_one (now.along, along);
  for (int i = 0; i < 9; i++) out[i] = across[i / 3] * (now.F_across * across[i % 3] + now.F_along * along[i % 3]);
}

/* A change of v_t by R changes the slip by about its own magnitude; one of v_n by `reversal` reverses a force at its
 * limit.  Divided by the derivatives of v_t and v_n, these are changes of coordinates and velocities. */
PER_ELEMENT (tyre_saturation, tyre, 6) {
  double reversal = now.element->limit / now.element->stiffness * now.R + fabs (now.v_across);
  double along[6] = { [2] = contact_speed_phi (&now.along) }, across[6] = { [2] = contact_speed_phi (&now.across) };
  contact_J_one (now.along, along + 3);
  contact_J_one (now.across, across + 3);
  for (int i = 0; i < 6; i++) {
    if (along[i] != 0) out[i] = now.R / fabs (along[i]);
    if (across[i] != 0 && now.element->limit > 0) out[i] = fmin (out[i], reversal / fabs (across[i]));
  }
}

PER_ELEMENT (tyre_loss, tyre, 1) {
  *out = -now.F * now.v_across;
}

PER_ELEMENT (tyre_contact, tyre, 3) {
  contact_place_one (now.along, out);
}

static const pw_field tyre_fields[] = {
  { PW_AT (pw_tyre, body), PW_BODY, .required = 1, .about = "the body with the tyre" },
  CONTACT_FIELDS (pw_tyre),
  { PW_AT (pw_tyre, stiffness), PW_NUMBER, .unit = "N", .required = 1, .domain = PW_POSITIVE,
    .about = "cornering stiffness: lateral force per slip" },
  { PW_AT (pw_tyre, speed), PW_NUMBER, .unit = "m/s", .required = 1, .domain = PW_POSITIVE,
    .about = "below about this rolling speed the slip is regularised" },
  { PW_AT (pw_tyre, load), PW_NUMBER, .unit = "N", .domain = PW_NONNEGATIVE,
    .about = "normal load; with friction it limits the force" },
  { PW_AT (pw_tyre, friction), PW_NUMBER, .domain = PW_NONNEGATIVE,
    .about = "friction coefficient: the force is at most this times the load; 0: no limit, and no load" },
  { .name = NULL },
};

const pw_kind pw_kind_tyre = {
  .name = "tyre",
  .symbol = "0 -1.6 -.5 0 1.6 -.5 0 1.6 .5 0 -1.6 .5 0 -1.6 -.5",
  .about = "a wheel with lateral slip; the lateral force increases with the slip",
  TYPE (tyre, pw_tyre, tyre),
  .bodies = 1,
  FORCE (tyre),
  .saturation = tyre_saturation,
  .loss = tyre_loss,
  .contact = tyre_contact,
};
