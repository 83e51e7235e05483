/* weld: body 2 is fixed to body 1 at a common point and at the relative angle beta = phi2 - phi1.  (In other element
 * types relative angles are phi1 - phi2.)
 *
 *   g     = ( d,  phi1 - phi2 + beta ) = 0,  d = r1 + R(phi1) s1 - r2 - R(phi2) s2     (3 holonomic equations)
 *   gamma = ( as in points.h,  0 )
 *
 * points.h has the derivatives of the first two equations.  The force -lambda(1, 2) in world axes, at the common point,
 * and the moment -lambda(3) act on body 1; the opposites act on body 2. */
#include <string.h>
#include "points.h"

typedef struct {
  points points;
  double beta; /* [rad] */
} weld;

/* A weld in the current state. */
typedef struct {
  points_state points;
  double beta;
} weld_state;

static inline weld_state weld_at (const pw_batch *batch, int e) {
  const weld *element = (const weld *)batch->element + e;
  return (weld_state){ points_of (&element->points, batch, e), element->beta };
}

PREPARE (weld_prepare, pw_weld, weld) {
  *element = (weld){ points_make (definition->at), definition->angle };
  return PW_OK;
}

PER_ELEMENT (weld_g, weld, 3) {
  points_g_one (now.points, out);
  out[2] = now.points.body1->phi - now.points.body2->phi + now.beta;
}

PER_ELEMENT (weld_g_size, weld, 3) {
  points_g_size_one (now.points, out);
  out[2] = fabs (now.points.body1->phi) + fabs (now.points.body2->phi) + fabs (now.beta);
}

PER_ELEMENT (weld_J, weld, 18) {
  points_J_one (now.points, out);
  out[12] = out[13] = out[15] = out[16] = 0, out[14] = 1, out[17] = -1;
}

PER_ELEMENT (weld_gamma, weld, 3) {
  points_gamma_one (now.points, out);
  out[2] = 0;
}

J_GAMMA (weld, 18, 3)

/* Defines weld_jw_q, ...: the first two rows are those of points.h, the third is 0. */
#define WELD_DERIVATIVE(member)              \
  PER_ELEMENT (weld_##member, weld, 18) {    \
    points_##member##_one (now.points, out); \
    memset (out + 12, 0, 6 * sizeof *out);   \
  }
EACH_DERIVATIVE (WELD_DERIVATIVE)

static const pw_field weld_fields[] = {
  BODIES_FIELD (pw_weld),
  { PW_AT (pw_weld, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the common point in each body's frame" },
  { PW_AT (pw_weld, angle), PW_NUMBER, .unit = "rad",
    .about = "phi2 - phi1, of the second body relative to the first" },
  { .name = NULL },
};

static const pw_quantity weld_reaction[] = {
  { "Fx", "N", NULL, "force on the first body, world x" },
  { "Fy", "N", NULL, "force on the first body, world y" },
  { "M", "N m", NULL, "moment on the first body about the common point" },
};

const pw_kind pw_kind_weld = {
  .name = "weld",
  .about = "two bodies are fixed to each other",
  .symbol = "0 -.4 -.4 0 .4 -.4 0 .4 .4 0 -.4 .4 0 -.4 -.4",
  TYPE (weld, pw_weld, weld),
  .bodies = 2,
  .rows = 3,
  .level = PW_HOLONOMIC,
  .reaction = weld_reaction,
  POSITION (weld),
  CONSTRAINT (weld),
  .J_gamma = weld_J_gamma,
};
