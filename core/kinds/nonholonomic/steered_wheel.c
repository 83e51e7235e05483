/* steered-wheel: a knife edge whose heading in the body is a signal u.
 *
 *   n . v_P = 0,  n = (-sin, cos)(phi + u)                        (1 nonholonomic equation)
 *   S     = [ -sin(theta)  cos(theta)  l ]      theta = phi + u;  l, h: arm of P along the heading, to its left
 *   gamma = -(omega + u') s_phi - u' h omega    so that S v' = gamma, with l' = u' h
 *   s_phi = d(S v)/dphi = -(cos(theta) vx + sin(theta) vy)
 *
 * S, s_phi and jw_q are those of contact.h for the direction n at the present u; gamma and its derivatives are not,
 * since n turns in the body.  The lateral force on the body, along n, is N = -lambda.  It acts at P, about which the
 * wheel is steered, so steering needs no moment and does no work.  With a grip, it slides as a wheel does. */
#include "contact.h"

typedef struct {
  double at[2]; /* contact point in the body's frame [m] */
} steered;

/* A wheel in the current state. */
typedef struct {
  contact_state contact;
  double h;                           /* arm of P to the left of the heading [m] */
  double steering_rate, heading_rate; /* u', omega + u' */
} steered_state;

static inline steered_state steered_at (const pw_batch *batch, int e) {
  const double *at = ((const steered *)batch->element)[e].at, *u = batch->u + 3 * e;
  double c, s;
  pw_sin_cos (u[0], &s, &c);
  contact_state now = contact_of (contact_make (at, u[0], -s, c), batch, e);
  return (steered_state){ now, at[1] * c - at[0] * s, u[1], now.body->omega + u[1] };
}

PREPARE (steered_prepare, pw_steered_wheel, steered) {
  *element = (steered){ { definition->at[0], definition->at[1] } };
  return limit_check ("grip", &definition->grip, &definition->grip_sliding, error);
}

GRIP (steered, pw_steered_wheel, steered_at (batch, e).contact)

PER_ELEMENT (steered_J, steered, 3) {
  contact_J_one (now.contact, out);
}

PER_ELEMENT (steered_gamma, steered, 1) {
  *out = -now.heading_rate * contact_speed_phi (&now.contact) - now.steering_rate * now.h * now.contact.body->omega;
}

J_GAMMA (steered, 3, 1)

PER_ELEMENT (steered_jw_q, steered, 3) {
  contact_jw_q_one (now.contact, out);
}

PER_ELEMENT (steered_gamma_q, steered, 3) {
  out[0] = out[1] = 0;
  out[2] = now.heading_rate * (now.contact.dx * now.contact.body->vx + now.contact.dy * now.contact.body->vy);
}

PER_ELEMENT (steered_gamma_v, steered, 3) {
  out[0] = now.heading_rate * now.contact.dy, out[1] = -now.heading_rate * now.contact.dx;
  out[2] = -contact_speed_phi (&now.contact) - now.steering_rate * now.h;
}

/* dS/du = [ -c  -s  h ], with c, s = cos, sin (theta) */
PER_ELEMENT (steered_J_u, steered, 3) {
  out[0] = -now.contact.dy, out[1] = now.contact.dx, out[2] = now.h;
}

/* dh/du = -l, d(s_phi)/du = sin(theta) vx - cos(theta) vy */
PER_ELEMENT (steered_gamma_u, steered, 1) {
  const pw_configuration *body = now.contact.body;
  *out = now.heading_rate * (now.contact.dx * body->vx + now.contact.dy * body->vy) +
         now.steering_rate * now.contact.constants.arm * body->omega;
}

PER_ELEMENT (steered_contact, steered, 3) {
  contact_place_one (now.contact, out);
}

static const pw_field steered_fields[] = {
  { PW_AT (pw_steered_wheel, body), PW_BODY, .required = 1, .about = "the body with the wheel" },
  { PW_AT (pw_steered_wheel, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point in the body's frame" },
  { PW_AT (pw_steered_wheel, heading), PW_SIGNAL, .unit = "rad", .required = 1,
    .about = "rolling direction in the body's frame, a signal with its derivative; 0: along the frame's x axis" },
  GRIP_FIELDS (pw_steered_wheel),
  { .name = NULL },
};

const pw_kind pw_kind_steered_wheel = {
  .name = "steered-wheel",
  .about = "a knife edge whose heading in the body follows a signal",
  .symbol = "0 -1.6 -.2 0 1.6 -.2 0 1.6 .2 0 -1.6 .2 0 -1.6 -.2",
  TYPE (steered, pw_steered_wheel, steered),
  .bodies = 1,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("N", "N", "lateral force on the body, to the left of the heading"),
  CONSTRAINT (steered),
  .J_gamma = steered_J_gamma,
  .limits = steered_limits,
  .loss = steered_loss,
  .J_u = steered_J_u,
  .gamma_u = steered_gamma_u,
  .contact = steered_contact,
};
