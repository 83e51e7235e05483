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
#include "pinwheel.h"

typedef struct {
  double s1[2], s2[2]; /* arms in the bodies' frames [m] */
  double beta;         /* phi2 - phi1 [rad] */
} weld;

/* Element e: both configurations, and both arms in world axes. */
#define WELD_PARTS                                                                                           \
  const weld *k = (const weld *)b->element + e;                                                              \
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]]; \
  const double X1 = A->cos * k->s1[0] - A->sin * k->s1[1], Y1 = A->sin * k->s1[0] + A->cos * k->s1[1];       \
  const double X2 = B->cos * k->s2[0] - B->sin * k->s2[1], Y2 = B->sin * k->s2[0] + B->cos * k->s2[1];

static int weld_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                         pw_error *error) {
  const pw_weld *d = definition;
  *(weld *)element = (weld){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] }, d->angle };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void weld_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WELD_PARTS
    out[0] = A->x + X1 - B->x - X2;
    out[1] = A->y + Y1 - B->y - Y2;
    out[2] = A->phi - B->phi + k->beta;
  }
}

static void weld_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WELD_PARTS
    out[0] = fabs (A->x) + fabs (X1) + fabs (B->x) + fabs (X2);
    out[1] = fabs (A->y) + fabs (Y1) + fabs (B->y) + fabs (Y2);
    out[2] = fabs (A->phi) + fabs (B->phi) + fabs (k->beta);
  }
}

static void weld_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 18) {
    WELD_PARTS
    const double J[18] = { 1, 0, -Y1, -1, 0, Y2, 0, 1, X1, 0, -1, -X2, 0, 0, 1, 0, 0, -1 };
    memcpy (out, J, sizeof J);
  }
}

static void weld_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    WELD_PARTS
    double w1 = A->omega * A->omega, w2 = B->omega * B->omega;
    out[0] = X1 * w1 - X2 * w2;
    out[1] = Y1 * w1 - Y2 * w2;
    out[2] = 0;
  }
}

/* Sets the angle columns of the first two equations in a 3 x 6 block, all other entries to zero. */
static inline void weld_angles (double *out, double x1, double y1, double x2, double y2) {
  memset (out, 0, 18 * sizeof *out);
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

static void weld_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 18) {
    WELD_PARTS
    double w1 = b->w[6 * e + 2], w2 = b->w[6 * e + 5];
    weld_angles (out, -X1 * w1, -Y1 * w1, X2 * w2, Y2 * w2);
  }
}

static void weld_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 18) {
    WELD_PARTS
    double w1 = A->omega * A->omega, w2 = B->omega * B->omega;
    weld_angles (out, -Y1 * w1, X1 * w1, Y2 * w2, -X2 * w2);
  }
}

static void weld_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 18) {
    WELD_PARTS
    double w1 = 2 * A->omega, w2 = 2 * B->omega;
    weld_angles (out, X1 * w1, Y1 * w1, -X2 * w2, -Y2 * w2);
  }
}

static const pw_field weld_fields[] = {
  { PW_AT (pw_weld, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies, or ground for one of them" },
  { PW_AT (pw_weld, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the common point in each body's frame" },
  { PW_AT (pw_weld, angle), PW_NUMBER, .unit = "rad", .about = "of the second body relative to the first" },
  { .name = NULL },
};

static const pw_quantity weld_reaction[] = {
  { "Fx", "N", NULL, "force on the first body, world x" },
  { "Fy", "N", NULL, "force on the first body, world y" },
  { "M", "N m", NULL, "moment on the first body, the force acting at the common point" },
};

const pw_kind pw_kind_weld = {
  .name = "weld",
  .about = "two bodies are fixed to each other",
  .definition = sizeof (pw_weld),
  .element = sizeof (weld),
  .fields = weld_fields,
  .bodies = 2,
  .rows = 3,
  .level = PW_HOLONOMIC,
  .reaction = weld_reaction,
  .prepare = weld_prepare,
  .g = weld_g,
  .g_size = weld_g_size,
  .J = weld_J,
  .gamma = weld_gamma,
  .jw_q = weld_jw_q,
  .gamma_q = weld_gamma_q,
  .gamma_v = weld_gamma_v,
};
