/* drag: resistance of air at rest to the translation and rotation of a body; the force acts at its centre of mass.
 *
 *   F = -(c1 + c2 |v|) v,  v = (vx, vy)
 *   M = -(d1 + d2 |w|) w
 *   f = (Fx, Fy, M),  loss = -F . v - M w >= 0
 *
 * (Batchelor 1967, An Introduction to Fluid Dynamics, sections 4.9 and 5.11: low and high Reynolds numbers.) */
#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double c1, c2; /* [N s/m], [N s^2/m^2] */
  double d1, d2; /* [N m s/rad], [N m s^2/rad^2] */
} drag;

/* An element in the current state: speed, force per speed, moment per angular velocity. */
typedef struct {
  const drag *k;
  const pw_configuration *A;
  double v, c, d;
} drag_state;

static inline drag_state drag_at (const pw_batch *b, int e) {
  const drag *k = (const drag *)b->element + e;
  const pw_configuration *A = batch_body (b, e, 1, 0);
  double v = hypot (A->vx, A->vy);
  return (drag_state){ k, A, v, k->c1 + k->c2 * v, k->d1 + k->d2 * fabs (A->omega) };
}

PREPARE (drag_prepare, pw_drag, drag) {
  *k = (drag){ d->linear, d->quadratic, d->turning, d->turning_quadratic };
  return PW_OK;
}

PER_ELEMENT (drag_force, drag, 3) {
  out[0] = -x.c * x.A->vx, out[1] = -x.c * x.A->vy, out[2] = -x.d * x.A->omega;
}

/* d(|v| v)/dv = |v| 1 + v v^T / |v|, zero at rest; v / |v| is divided, since 1 / |v| may overflow. */
PER_ELEMENT (drag_force_v, drag, 9) {
  double ex = x.v > 0 ? x.A->vx / x.v : 0, ey = x.v > 0 ? x.A->vy / x.v : 0;
  memset (out, 0, 9 * sizeof *out);
  out[0] = -x.c - x.k->c2 * x.A->vx * ex;
  out[1] = out[3] = -x.k->c2 * x.A->vx * ey;
  out[4] = -x.c - x.k->c2 * x.A->vy * ey;
  out[8] = -x.d - x.k->d2 * fabs (x.A->omega);
}

PER_ELEMENT (drag_loss, drag, 1) {
  *out = x.c * x.v * x.v + x.d * x.A->omega * x.A->omega;
}

static const pw_field drag_fields[] = {
  { PW_AT (pw_drag, body), PW_BODY, .required = 1, .about = "the body on which it acts" },
  { PW_AT (pw_drag, linear), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE, .about = "force per speed" },
  { PW_AT (pw_drag, quadratic), PW_NUMBER, .unit = "N s^2/m^2", .domain = PW_NONNEGATIVE,
    .about = "force per square of the speed: half density times area times coefficient" },
  { PW_AT (pw_drag, turning), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "moment per angular velocity" },
  { PW_AT (pw_drag, turning_quadratic), PW_NUMBER, .unit = "N m s^2/rad^2", .domain = PW_NONNEGATIVE,
    .about = "moment per square of the angular velocity" },
  { .name = NULL },
};

const pw_kind pw_kind_drag = {
  .name = "drag",
  .about = "linear and quadratic resistance of still air to the translation and rotation of a body",
  DEFINITION (pw_drag, drag_fields),
  ELEMENT (drag, drag_prepare),
  .bodies = 1,
  .force = drag_force,
  .force_v = drag_force_v,
  .loss = drag_loss,
};
