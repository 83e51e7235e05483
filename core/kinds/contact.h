/* Wheels: contact points, and the constraint equation shared by wheel and speed: it prescribes the velocity of a point
 * P of a body along a direction d fixed in the body.
 *
 *   d . v_P = u,  d = R(phi) (a, b)                               (1 nonholonomic equation)
 *   S     = [ dx  dy  l ]                                         l: the arm of P along (b, -a) in the body
 *   gamma = u' + w (dy vx - dx vy)                                so that S a = gamma
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.) */
#ifndef PW_CONTACT_H
#define PW_CONTACT_H

#include <string.h>
#include "pinwheel.h"

/* Transforms a contact point and its heading from the body's frame to (x, y, angle) in the world frame, for output and
 * figures. */
static inline void contact_to_world (const pw_configuration *A, const double at[2], double heading, double out[3]) {
  out[0] = A->x + A->cos * at[0] - A->sin * at[1];
  out[1] = A->y + A->sin * at[0] + A->cos * at[1];
  out[2] = A->phi + heading;
}

typedef struct {
  double a, b;    /* components of the direction in the body's frame */
  double arm;     /* lever arm of the point about the body's origin [m] */
  double at[2];   /* the point in the body's frame [m] */
  double heading; /* [rad] */
} contact;

static inline contact contact_make (const double at[2], double heading, double a, double b) {
  return (contact){ a, b, at[0] * b - at[1] * a, { at[0], at[1] }, heading };
}

#define CONTACT_PARTS                                        \
  const contact *k = (const contact *)b->element + e;        \
  const pw_configuration *A = &b->configuration[b->body[e]]; \
  const double x = A->cos * k->a - A->sin * k->b, y = A->sin * k->a + A->cos * k->b

static inline void contact_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    CONTACT_PARTS;
    out[0] = x, out[1] = y, out[2] = k->arm;
  }
}

static inline void contact_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    CONTACT_PARTS;
    out[e] = A->omega * (y * A->vx - x * A->vy);
  }
}

static inline void contact_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    CONTACT_PARTS;
    out[0] = out[1] = 0, out[2] = x * b->w[3 * e + 1] - y * b->w[3 * e];
  }
}

static inline void contact_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    CONTACT_PARTS;
    out[0] = out[1] = 0, out[2] = A->omega * (x * A->vx + y * A->vy);
  }
}

static inline void contact_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    CONTACT_PARTS;
    out[0] = A->omega * y, out[1] = -A->omega * x, out[2] = y * A->vx - x * A->vy;
  }
}

#endif
