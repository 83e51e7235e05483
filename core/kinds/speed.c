/* speed: the speed of a point P along a direction fixed in its body follows a signal u.
 *
 *   e . v_P = u,  e = (cos, sin)(phi + psi)                       (1 nonholonomic row)
 *   S     = [ cos(theta)  sin(theta)  -m ]      theta = phi + psi; m: the arm of P to the left of e
 *   eta   = u
 *   gamma = u' + w (sin(theta) vx - cos(theta) vy)                so that S a = gamma
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.)
 * The force on the body at P, along e, is F = -lambda; its power is F u. */
#include <math.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double cos, sin; /* of the direction in the body */
  double aside;    /* m [m] */
} speed;

#define SPEED_PARTS                               \
  const speed *k = (const speed *)b->element + e; \
  const pw_pose *A = &b->pose[b->body[e]];        \
  const double c = A->cos * k->cos - A->sin * k->sin, s = A->sin * k->cos + A->cos * k->sin

static int speed_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                          pw_error *error) {
  const pw_speed *d = definition;
  double c = cos (d->heading), s = sin (d->heading);
  *(speed *)element = (speed){ c, s, d->at[1] * c - d->at[0] * s };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void speed_eta (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) out[e] = b->u[3 * e];
}

static void speed_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    SPEED_PARTS;
    out[0] = c, out[1] = s, out[2] = -k->aside;
  }
}

static void speed_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    SPEED_PARTS;
    out[e] = b->u[3 * e + 1] + A->omega * (s * A->vx - c * A->vy);
  }
}

static void speed_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    SPEED_PARTS;
    out[0] = out[1] = 0, out[2] = c * b->w[3 * e + 1] - s * b->w[3 * e];
  }
}

static void speed_jtl_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    SPEED_PARTS;
    memset (out, 0, 9 * sizeof *out);
    out[2] = -s * b->lambda[e], out[5] = c * b->lambda[e];
  }
}

static void speed_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    SPEED_PARTS;
    out[0] = out[1] = 0, out[2] = A->omega * (c * A->vx + s * A->vy);
  }
}

static void speed_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    SPEED_PARTS;
    out[0] = A->omega * s, out[1] = -A->omega * c, out[2] = s * A->vx - c * A->vy;
  }
}

static const pw_field speed_fields[] = {
  { PW_AT (pw_speed, body), PW_BODY, .required = 1, .about = "the body that is moved" },
  { PW_AT (pw_speed, at), PW_POINT, .unit = "m", .about = "the point in the body's frame" },
  { PW_AT (pw_speed, heading), PW_NUMBER, .unit = "rad", .about = "the direction in the body's frame; 0: along its x" },
  { PW_AT (pw_speed, value), PW_SIGNAL, .unit = "m/s", .required = 1,
    .about = "speed of the point along the direction over time, with its derivative" },
  { .name = NULL },
};

static const pw_quantity speed_reaction[] = { { "F", "N", NULL, "force on the body along the direction" } };

const pw_kind pw_kind_speed = {
  .name = "speed",
  .about = "the speed of a point along a direction fixed in its body follows a signal of time",
  .definition = sizeof (pw_speed),
  .element = sizeof (speed),
  .fields = speed_fields,
  .bodies = 1,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = speed_reaction,
  .prepare = speed_prepare,
  .eta = speed_eta,
  .J = speed_J,
  .gamma = speed_gamma,
  .jw_q = speed_jw_q,
  .jtl_q = speed_jtl_q,
  .gamma_q = speed_gamma_q,
  .gamma_v = speed_gamma_v,
};
