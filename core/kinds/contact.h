/* The velocity of a point P of a body (for a wheel: its contact point) along a direction d fixed in the body; velocity
 * constraints prescribe it, forces oppose it.
 *
 *   d . v_P = S v,  d = R(phi) (a, b),  v = (vx, vy, omega)
 *   S     = [ dx  dy  l ]                                         l: the arm of P along (b, -a) in the body
 *   gamma = omega (dy vx - dx vy)                                 so that d(S v)/dt = S v' - gamma
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.) */
#ifndef PW_CONTACT_H
#define PW_CONTACT_H

#include "batch.h"

typedef struct {
  double a, b;    /* the direction in the body's frame */
  double arm;     /* l [m] */
  double at[2];   /* P in the body's frame [m] */
  double heading; /* of the wheel in the body's frame [rad] */
} contact;

/* A contact in the current state. */
typedef struct {
  contact constants;
  const pw_configuration *body;
  const double *w; /* the vector w of jw_q, else NULL */
  double dx, dy;   /* the direction in world axes */
} contact_state;

static inline contact contact_make (const double at[2], double heading, double a, double b) {
  return (contact){ .a = a, .b = b, .arm = at[0] * b - at[1] * a, .at = { at[0], at[1] }, .heading = heading };
}

/* Contacts whose direction d is along the heading, and to its left. */
static inline contact contact_along (const double at[2], double heading) {
  return contact_make (at, heading, pw_cos (heading), pw_sin (heading));
}

static inline contact contact_across (const double at[2], double heading) {
  return contact_make (at, heading, -pw_sin (heading), pw_cos (heading));
}

/* A contact of element e of a batch of elements with one body. */
static inline contact_state contact_of (contact constants, const pw_batch *batch, int e) {
  const pw_configuration *body = batch_body (batch, e);
  return (contact_state){ constants, body, batch_w (batch, e), body->cos * constants.a - body->sin * constants.b,
                          body->sin * constants.a + body->cos * constants.b };
}

static inline contact_state contact_at (const pw_batch *batch, int e) {
  return contact_of (((const contact *)batch->element)[e], batch, e);
}

/* S v */
static inline double contact_speed (const contact_state *now) {
  return now->dx * now->body->vx + now->dy * now->body->vy + now->constants.arm * now->body->omega;
}

/* d(S v)/dphi */
static inline double contact_speed_phi (const contact_state *now) {
  return now->dx * now->body->vy - now->dy * now->body->vx;
}

PER_ELEMENT (contact_J, contact, 3) {
  out[0] = now.dx, out[1] = now.dy, out[2] = now.constants.arm;
}

PER_ELEMENT (contact_gamma, contact, 1) {
  *out = now.body->omega * (now.dy * now.body->vx - now.dx * now.body->vy);
}

J_GAMMA (contact, 3, 1)

PER_ELEMENT (contact_jw_q, contact, 3) {
  out[0] = out[1] = 0, out[2] = now.dx * now.w[1] - now.dy * now.w[0];
}

PER_ELEMENT (contact_gamma_q, contact, 3) {
  out[0] = out[1] = 0, out[2] = now.body->omega * (now.dx * now.body->vx + now.dy * now.body->vy);
}

PER_ELEMENT (contact_gamma_v, contact, 3) {
  out[0] = now.body->omega * now.dy, out[1] = -now.body->omega * now.dx,
  out[2] = now.dy * now.body->vx - now.dx * now.body->vy;
}

/* Contact point and heading (x, y, angle) in the world, for output and figures. */
PER_ELEMENT (contact_place, contact, 3) {
  out[0] = now.body->x + now.body->cos * now.constants.at[0] - now.body->sin * now.constants.at[1];
  out[1] = now.body->y + now.body->sin * now.constants.at[0] + now.body->cos * now.constants.at[1];
  out[2] = now.body->phi + now.constants.heading;
}

/* GRIP (wheel, pw_wheel, contact_at (batch, e)) defines the functions of a wheel that may slide: wheel_limits,
 * wheel_loss, lambda S v; the last argument is the contact_state of element e. */
#define GRIP(type, definition_type, contact_of_e)                        \
  static void type##_limits (const void *definition, pw_bounds *limit) { \
    const definition_type *wheel = definition;                           \
    limit_both_sides (&wheel->grip, &wheel->grip_sliding, limit);        \
  }                                                                      \
  static void type##_loss (const pw_batch *batch, double *out) {         \
    for (int e = 0; e < batch->count; e++) {                             \
      const contact_state now = contact_of_e;                            \
      out[e] = batch->lambda[e] * contact_speed (&now);                  \
    }                                                                    \
  }

/* Fields of the definition of a wheel that may slide, after its other signals. */
#define GRIP_FIELDS(type)                                                                               \
  { PW_AT (type, grip), PW_SIGNAL, .limit = 1, .unit = "N",                                             \
    .about = "largest lateral force, beyond which the wheel slides; left out: no limit" },              \
  {                                                                                                     \
    PW_AT (type, grip_sliding), PW_SIGNAL, .limit = 1, .unit = "N",                                     \
                                           .about = "lateral force while it slides; left out: the grip" \
  }

/* Fields of the definition of a wheel: its contact point and its heading. */
#define CONTACT_FIELDS(type)                                                                                          \
  { PW_AT (type, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point in the body's frame" }, {         \
    PW_AT (type, heading), PW_NUMBER, .unit = "rad", .about = "rolling direction in the body's frame; 0: along its x" \
  }

#endif
