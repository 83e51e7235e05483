/* drag: resistance of air at rest to the translation and rotation of a body; the force acts at its centre of mass.
 *
 *   F = -(c1 + c2 |v|) v,  v = (vx, vy)
 *   M = -(d1 + d2 |w|) w
 *   f = (Fx, Fy, M),  loss = -F . v - M w >= 0
 *
 * (Batchelor 1967, An Introduction to Fluid Dynamics, sections 4.9 and 5.11: low and high Reynolds numbers.) */
#include <math.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double c1, c2; /* [N s/m], [N s^2/m^2] */
  double d1, d2; /* [N m s/rad], [N m s^2/rad^2] */
} drag;

/* Element e: speed, force per speed, moment per angular velocity. */
#define DRAG_PARTS                                           \
  const drag *k = (const drag *)b->element + e;              \
  const pw_configuration *A = &b->configuration[b->body[e]]; \
  const double v = hypot (A->vx, A->vy), c = k->c1 + k->c2 * v, d = k->d1 + k->d2 * fabs (A->omega)

static int drag_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                         pw_error *error) {
  const pw_drag *d = definition;
  *(drag *)element = (drag){ d->linear, d->quadratic, d->turning, d->turning_quadratic };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void drag_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    DRAG_PARTS;
    out[0] = -c * A->vx, out[1] = -c * A->vy, out[2] = -d * A->omega;
    (void)v;
  }
}

/* d(|v| v)/dv = |v| 1 + v v^T / |v|, zero at rest. */
static void drag_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    DRAG_PARTS;
    double x = v > 0 ? A->vx / v : 0, y = v > 0 ? A->vy / v : 0; /* direction; not v_x * (1 / v), which may overflow */
    memset (out, 0, 9 * sizeof *out);
    out[0] = -c - k->c2 * A->vx * x;
    out[1] = out[3] = -k->c2 * A->vx * y;
    out[4] = -c - k->c2 * A->vy * y;
    out[8] = -d - k->d2 * fabs (A->omega);
  }
}

static void drag_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    DRAG_PARTS;
    out[e] = c * v * v + d * A->omega * A->omega;
  }
}

static const pw_field drag_fields[] = {
  { PW_AT (pw_drag, body), PW_BODY, .required = 1, .about = "the body it slows down" },
  { PW_AT (pw_drag, linear), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE, .about = "force per speed" },
  { PW_AT (pw_drag, quadratic), PW_NUMBER, .unit = "N s^2/m^2", .domain = PW_NONNEGATIVE,
    .about = "force per square of the speed: half density times area times coefficient" },
  { PW_AT (pw_drag, turning), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE, .about = "moment per rate" },
  { PW_AT (pw_drag, turning_quadratic), PW_NUMBER, .unit = "N m s^2/rad^2", .domain = PW_NONNEGATIVE,
    .about = "moment per square of the rate" },
  { .name = NULL },
};

const pw_kind pw_kind_drag = {
  .name = "drag",
  .about = "the resistance of air at rest, linear and quadratic, to a body's motion and turning",
  .definition = sizeof (pw_drag),
  .element = sizeof (drag),
  .fields = drag_fields,
  .bodies = 1,
  .level = PW_FORCE,
  .prepare = drag_prepare,
  .force = drag_force,
  .force_v = drag_force_v,
  .loss = drag_loss,
};
