/* drag: resistance of still air to the translation and rotation of a body; the force acts at its centre of mass.
 *
 *   F = -(c1 + c2 |v|) v,  v = (vx, vy)
 *   M = -(d1 + d2 |omega|) omega
 *   f = (Fx, Fy, M),  loss = -F . v - M omega >= 0
 *
 * (Batchelor 1967, An Introduction to Fluid Dynamics, sections 4.9 and 5.11: low and high Reynolds numbers.) */
#include <string.h>
#include "batch.h"

typedef struct {
  double linear, quadratic;          /* c1 [N s/m], c2 [N s^2/m^2] */
  double turning, turning_quadratic; /* d1 [N m s/rad], d2 [N m s^2/rad^2] */
} drag;

/* An element in the current state. */
typedef struct {
  const drag *element;
  const pw_configuration *body;
  double speed, force_per_speed, moment_per_omega; /* |v|, c1 + c2 |v|, d1 + d2 |omega| */
} drag_state;

static inline drag_state drag_at (const pw_batch *batch, int e) {
  const drag *element = (const drag *)batch->element + e;
  const pw_configuration *body = batch_body (batch, e);
  double speed = hypot (body->vx, body->vy);
  return (drag_state){ element, body, speed, element->linear + element->quadratic * speed,
                       element->turning + element->turning_quadratic * fabs (body->omega) };
}

PREPARE (drag_prepare, pw_drag, drag) {
  *element = (drag){ definition->linear, definition->quadratic, definition->turning, definition->turning_quadratic };
  return PW_OK;
}

PER_ELEMENT (drag_force, drag, 3) {
  out[0] = -now.force_per_speed * now.body->vx;
  out[1] = -now.force_per_speed * now.body->vy;
  out[2] = -now.moment_per_omega * now.body->omega;
}

/* d(|v| v)/dv = |v| I + v v^T / |v|, zero at rest.  e = v / |v|, not v times 1 / |v|, which may overflow. */
PER_ELEMENT (drag_force_v, drag, 9) {
  double ex = now.speed > 0 ? now.body->vx / now.speed : 0, ey = now.speed > 0 ? now.body->vy / now.speed : 0;
  double quadratic = now.element->quadratic;
  memset (out, 0, 9 * sizeof *out);
  out[0] = -now.force_per_speed - quadratic * now.body->vx * ex;
  out[1] = out[3] = -quadratic * now.body->vx * ey;
  out[4] = -now.force_per_speed - quadratic * now.body->vy * ey;
  out[8] = -now.moment_per_omega - now.element->turning_quadratic * fabs (now.body->omega);
}

PER_ELEMENT (drag_loss, drag, 1) {
  *out = now.force_per_speed * now.speed * now.speed + now.moment_per_omega * now.body->omega * now.body->omega;
}

static const pw_field drag_fields[] = {
  { PW_AT (pw_drag, body), PW_BODY, .required = 1, .about = "the body on which it acts" },
  { PW_AT (pw_drag, linear), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE, .about = "force per speed" },
  { PW_AT (pw_drag, quadratic), PW_NUMBER, .unit = "N s^2/m^2", .domain = PW_NONNEGATIVE,
    .about = "force per square of the speed: half the air density times area times drag coefficient" },
  { PW_AT (pw_drag, turning), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "moment per angular velocity" },
  { PW_AT (pw_drag, turning_quadratic), PW_NUMBER, .unit = "N m s^2/rad^2", .domain = PW_NONNEGATIVE,
    .about = "moment per square of the angular velocity" },
  { .name = NULL },
};

const pw_kind pw_kind_drag = {
  .name = "drag",
  .about = "linear and quadratic resistance of still air to the translation and rotation of a body",
  TYPE (drag, pw_drag, drag),
  .bodies = 1,
  .force = drag_force,
  .force_v = drag_force_v,
  .loss = drag_loss,
};
