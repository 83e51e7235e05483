/* weld: body 2 is fixed to body 1 at a point and at the relative angle beta.
 *
 *   g     = ( r1 + R(phi1) s1 - r2 - R(phi2) s2,  phi1 - phi2 + beta ) = 0     (3 holonomic equations)
 *   G     = [ 1 0 -Y1 | -1 0  Y2 ]       with (X, Y) = R(phi) s, the arm in world axes
 *           [ 0 1  X1 |  0 -1 -X2 ]
 *           [ 0 0  1  |  0  0 -1 ]
 *   gamma = ( (X1, Y1) w1^2 - (X2, Y2) w2^2,  0 )                              so that G a = gamma
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.)
 * The force -lambda(1, 2) in world axes, at the common point, and the moment -lambda(3) act on body 1; the opposites
 * act on body 2. */
#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* arms in the bodies' frames [m] */
  double beta;         /* phi2 - phi1 [rad] */
} weld;

/* A weld in the current state: both arms in world axes. */
typedef struct {
  const weld *k;
  const pw_configuration *A, *B;
  const double *w;
  double X1, Y1, X2, Y2;
} weld_state;

static inline weld_state weld_at (const pw_batch *b, int e) {
  const weld *k = (const weld *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]];
  weld_state x = { .k = k, .A = A, .B = B, .w = batch_w (b, e) };
  x.X1 = A->cos * k->s1[0] - A->sin * k->s1[1], x.Y1 = A->sin * k->s1[0] + A->cos * k->s1[1];
  x.X2 = B->cos * k->s2[0] - B->sin * k->s2[1], x.Y2 = B->sin * k->s2[0] + B->cos * k->s2[1];
  return x;
}

PREPARE (weld_prepare, pw_weld, weld) {
  *k = (weld){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] }, d->angle };
}

PER_ELEMENT (weld_g, weld, 3) {
  out[0] = x.A->x + x.X1 - x.B->x - x.X2;
  out[1] = x.A->y + x.Y1 - x.B->y - x.Y2;
  out[2] = x.A->phi - x.B->phi + x.k->beta;
}

PER_ELEMENT (weld_g_size, weld, 3) {
  out[0] = fabs (x.A->x) + fabs (x.X1) + fabs (x.B->x) + fabs (x.X2);
  out[1] = fabs (x.A->y) + fabs (x.Y1) + fabs (x.B->y) + fabs (x.Y2);
  out[2] = fabs (x.A->phi) + fabs (x.B->phi) + fabs (x.k->beta);
}

PER_ELEMENT (weld_J, weld, 18) {
  const double J[18] = { 1, 0, -x.Y1, -1, 0, x.Y2, 0, 1, x.X1, 0, -1, -x.X2, 0, 0, 1, 0, 0, -1 };
  memcpy (out, J, sizeof J);
}

PER_ELEMENT (weld_gamma, weld, 3) {
  double w1 = x.A->omega * x.A->omega, w2 = x.B->omega * x.B->omega;
  out[0] = x.X1 * w1 - x.X2 * w2;
  out[1] = x.Y1 * w1 - x.Y2 * w2;
  out[2] = 0;
}

/* Sets the angle columns of the first two equations in a 3 x 6 block, all other entries to zero. */
static inline void weld_angles (double *out, double x1, double y1, double x2, double y2) {
  memset (out, 0, 18 * sizeof *out);
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

PER_ELEMENT (weld_jw_q, weld, 18) {
  double w1 = x.w[2], w2 = x.w[5];
  weld_angles (out, -x.X1 * w1, -x.Y1 * w1, x.X2 * w2, x.Y2 * w2);
}

PER_ELEMENT (weld_gamma_q, weld, 18) {
  double w1 = x.A->omega * x.A->omega, w2 = x.B->omega * x.B->omega;
  weld_angles (out, -x.Y1 * w1, x.X1 * w1, x.Y2 * w2, -x.X2 * w2);
}

PER_ELEMENT (weld_gamma_v, weld, 18) {
  double w1 = 2 * x.A->omega, w2 = 2 * x.B->omega;
  weld_angles (out, x.X1 * w1, x.Y1 * w1, -x.X2 * w2, -x.Y2 * w2);
}

static const pw_field weld_fields[] = {
  { PW_AT (pw_weld, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_weld, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the common point in each body's frame" },
  { PW_AT (pw_weld, angle), PW_NUMBER, .unit = "rad", .about = "of the second body relative to the first" },
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
  DEFINITION (pw_weld, weld_fields),
  ELEMENT (weld, weld_prepare),
  .bodies = 2,
  .rows = 3,
  .level = PW_HOLONOMIC,
  .reaction = weld_reaction,
  .g = weld_g,
  .g_size = weld_g_size,
  .J = weld_J,
  .gamma = weld_gamma,
  .jw_q = weld_jw_q,
  .gamma_q = weld_gamma_q,
  .gamma_v = weld_gamma_v,
};
