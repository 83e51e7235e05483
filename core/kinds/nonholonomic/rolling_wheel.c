/* rolling-wheel: a wheel of radius R that rolls without slip; its spin angle chi is an internal coordinate.
 *
 *   n . v_P = 0,  e . v_P - R chi' = 0,  e = (cos, sin)(phi + psi), n = (-sin, cos)(phi + psi)    (2 nonholonomic)
 *   S     = [ -s  c   l   0 ]      psi: heading in the body; (c, s) = e; l, m: arm of the contact point P along e, n
 *           [  c  s  -m  -R ]
 *   gamma = ( omega (c vx + s vy),  omega (s vx - c vy) )         so that S v' = gamma; both rows as in contact.h
 *   f     = u on chi, power = u chi'                              u: torque about the axle
 *
 * With a grip L, |(lambda(1), lambda(2))| <= L, beyond which both have given values, with the direction of sliding.  A
 * brake is the equation chi' = 0, whose multiplier is limited as that of friction; it never holds without a brake.
 *
 * The forces -lambda(1) along n and -lambda(2) along e act on the body at P.  The reaction to u and the gyroscopic
 * moments of the wheel are moments about horizontal axes, which do not enter the equations of planar motion. */
#include "contact.h"

typedef struct {
  contact across, along; /* the two components of the contact point's velocity */
  double radius;         /* [m] */
} rolling;

/* A wheel in the current state. */
typedef struct {
  contact_state across, along;
  double radius;
} rolling_state;

static inline rolling_state rolling_at (const pw_batch *batch, int e) {
  const rolling *element = (const rolling *)batch->element + e;
  return (rolling_state){ contact_of (element->across, batch, e), contact_of (element->along, batch, e),
                          element->radius };
}

/* chi' of a wheel that rolls at the initial velocity of the body. */
static double rolling_spin_rate (const rolling *element, const pw_body *body) {
  double angle = body->start[2] + element->along.heading;
  return (pw_cos (angle) * body->rate[0] + pw_sin (angle) * body->rate[1] + element->along.arm * body->rate[2]) /
         element->radius;
}

static int rolling_slips (const void *definition) {
  const pw_rolling_wheel *x = definition;
  return limit_given (&x->grip) || limit_given (&x->grip_sliding) || limit_is_nonzero (&x->brake);
}

PREPARE (rolling_prepare, pw_rolling_wheel, rolling) {
  *element = (rolling){ contact_across (definition->at, definition->heading),
                        contact_along (definition->at, definition->heading), definition->radius };
  internal[0] =
      (pw_internal){ definition->inertia, definition->start, definition->rate, INITIAL_SPECIFIED (definition) };
  if (!internal->specified[1]) internal->rate = rolling_spin_rate (element, bodies[0]);
  if (rolling_slips (definition) && !(definition->inertia > 0))
    return pw_fail (error, PW_INPUT,
                    "inertia = 0: expected > 0 with a grip or brake, which let the wheel turn by itself");
  if (limit_check ("brake", &definition->brake, &definition->brake, error) != PW_OK) return error->status;
  return limit_check ("grip", &definition->grip, &definition->grip_sliding, error);
}

PER_ELEMENT (rolling_J, rolling, 8) {
  contact_J_one (now.across, out);
  contact_J_one (now.along, out + 4);
  out[3] = 0, out[7] = -now.radius;
}

PER_ELEMENT (rolling_gamma, rolling, 2) {
  contact_gamma_one (now.across, out);
  contact_gamma_one (now.along, out + 1);
}

J_GAMMA (rolling, 8, 2)

/* Defines rolling_jw_q, ...: the derivatives with respect to the spin angle or spin velocity are 0. */
#define ROLLING_DERIVATIVE(member)               \
  PER_ELEMENT (rolling_##member, rolling, 8) {   \
    contact_##member##_one (now.across, out);    \
    contact_##member##_one (now.along, out + 4); \
    out[3] = out[7] = 0;                         \
  }
EACH_DERIVATIVE (ROLLING_DERIVATIVE)

/* The same of a wheel with a grip or brake: a third row. */
#define SLIPPING(function, cols, ...)                     \
  PER_ELEMENT (slipping_##function, rolling, 3 * cols) {  \
    rolling_##function##_one (now, out);                  \
    for (int c = 2 * cols; c < 3 * cols; c++) out[c] = 0; \
    __VA_ARGS__                                           \
  }
SLIPPING (J, 4, out[11] = 1;)
SLIPPING (gamma, 1, )
SLIPPING (jw_q, 4, )
SLIPPING (gamma_q, 4, )
SLIPPING (gamma_v, 4, )

static void slipping_limits (const void *definition, pw_bounds *limit) {
  const pw_rolling_wheel *x = definition;
  for (int i = 0; i < 2; i++) {
    limit_both_sides (&x->grip, &x->grip_sliding, limit + i);
    limit[i].circle = limit_is_nonzero (&x->grip) ? i + 1 : 0;
  }
  limit[2].least = limit[2].most = 0;
  limit_both_sides (&x->brake, &x->brake, limit + 2);
  limit[2].initially_slides = 1;
}

static void slipping_loss (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    const rolling_state now = rolling_at (batch, e);
    const double *lambda = batch->lambda + 3 * e, spin = batch->v[e];
    out[e] = lambda[0] * contact_speed (&now.across) + lambda[1] * (contact_speed (&now.along) - now.radius * spin) +
             lambda[2] * spin;
  }
}

static void rolling_force (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 4) out[0] = out[1] = out[2] = 0, out[3] = batch->u[3 * e];
}

static void rolling_force_u (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 4) out[0] = out[1] = out[2] = 0, out[3] = 1;
}

static void rolling_power (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) out[e] = batch->u[3 * e] * batch->v[e];
}

PER_ELEMENT (rolling_contact, rolling, 3) {
  contact_place_one (now.along, out);
}

static const pw_field rolling_fields[] = {
  { PW_AT (pw_rolling_wheel, body), PW_BODY, .required = 1, .about = "the body with the wheel" },
  CONTACT_FIELDS (pw_rolling_wheel),
  { PW_AT (pw_rolling_wheel, radius), PW_NUMBER, .unit = "m", .required = 1, .domain = PW_POSITIVE,
    .about = "radius of the wheel" },
  { PW_AT (pw_rolling_wheel, inertia), PW_NUMBER, .unit = "kg m^2", .domain = PW_NONNEGATIVE,
    .about = "moment of inertia about the axle; the wheel's mass belongs to the body" },
  { PW_AT (pw_rolling_wheel, start), PW_NUMBER, .unit = "rad", .given = offsetof (pw_rolling_wheel, specified[0]),
    .about = "initial spin angle" },
  { PW_AT (pw_rolling_wheel, rate), PW_NUMBER, .unit = "rad/s", .given = offsetof (pw_rolling_wheel, specified[1]),
    .about = "initial spin velocity; left out: the wheel rolls at the body's initial velocity" },
  { PW_AT (pw_rolling_wheel, torque), PW_SIGNAL, .unit = "N m",
    .about = "torque on the wheel about its axle; positive: drives along the heading" },
  { PW_AT (pw_rolling_wheel, grip), PW_SIGNAL, .limit = 1, .unit = "N",
    .about = "largest force of the ground, lateral and longitudinal together, beyond which the wheel slides; left out: "
             "no limit" },
  { PW_AT (pw_rolling_wheel, grip_sliding), PW_SIGNAL, .limit = 1, .unit = "N",
    .about = "this force while it slides; left out: the grip" },
  { PW_AT (pw_rolling_wheel, brake), PW_SIGNAL, .limit = 1, .unit = "N m",
    .about = "largest torque of a brake, which opposes the spin and holds the wheel" },
  { .name = NULL },
};

static const pw_quantity rolling_reaction[] = {
  { "N", "N", NULL, "lateral force on the body, to the left of the heading" },
  { "T", "N", NULL, "traction: force on the body along the heading" },
  { "B", "N m", NULL, "torque of the brake on the wheel" },
};

static const pw_quantity rolling_coordinate[] = {
  { "spin", "rad", "spin_rate", "angle about the axle; increases when rolling along the heading" },
};

/* Members of the tables of a rolling wheel and of one that may slide. */
#define ROLLING                                                                                                       \
  .name = "rolling-wheel", .symbol = "0 -1.6 -.5 0 1.6 -.5 0 1.6 .5 0 -1.6 .5 0 -1.6 -.5",                            \
  TYPE (rolling, pw_rolling_wheel, rolling), .bodies = 1, .internal = 1, .signals = 1, .level = PW_NONHOLONOMIC,      \
  .reaction = rolling_reaction, .coordinate = rolling_coordinate, .force = rolling_force, .force_u = rolling_force_u, \
  .power = rolling_power, .contact = rolling_contact

const pw_kind pw_kind_rolling_wheel = {
  ROLLING,
  .about = "a wheel that rolls without slip, free or driven by a torque about its axle",
  .rows = 2,
  CONSTRAINT (rolling),
  .J_gamma = rolling_J_gamma,
  .exact = &pw_kind_slipping_wheel,
  .is_exact = rolling_slips,
};

const pw_kind pw_kind_slipping_wheel = {
  ROLLING,
  .about = "a wheel with a brake that rolls up to a largest force",
  .rows = 3,
  CONSTRAINT (slipping),
  .limits = slipping_limits,
  .loss = slipping_loss,
};
