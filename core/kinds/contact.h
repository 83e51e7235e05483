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
#include "batch.h"

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

/* A contact in the current state: its direction (dx, dy) in the world. */
typedef struct {
  const contact *k;
  const pw_configuration *A;
  const double *w;
  double dx, dy;
} contact_state;

static inline contact contact_make (const double at[2], double heading, double a, double b) {
  return (contact){ a, b, at[0] * b - at[1] * a, { at[0], at[1] }, heading };
}

static inline contact_state contact_rotate (const contact *k, const pw_configuration *A) {
  return (contact_state){ k, A, NULL, A->cos * k->a - A->sin * k->b, A->sin * k->a + A->cos * k->b };
}

static inline contact_state contact_at (const pw_batch *b, int e) {
  contact_state x = contact_rotate ((const contact *)b->element + e, &b->configuration[b->body[e]]);
  x.w = batch_w (b, e);
  return x;
}

PER_ELEMENT (contact_J, contact, 3) {
  out[0] = x.dx, out[1] = x.dy, out[2] = x.k->arm;
}

PER_ELEMENT (contact_gamma, contact, 1) {
  *out = x.A->omega * (x.dy * x.A->vx - x.dx * x.A->vy);
}

PER_ELEMENT (contact_jw_q, contact, 3) {
  out[0] = out[1] = 0, out[2] = x.dx * x.w[1] - x.dy * x.w[0];
}

PER_ELEMENT (contact_gamma_q, contact, 3) {
  out[0] = out[1] = 0, out[2] = x.A->omega * (x.dx * x.A->vx + x.dy * x.A->vy);
}

PER_ELEMENT (contact_gamma_v, contact, 3) {
  out[0] = x.A->omega * x.dy, out[1] = -x.A->omega * x.dx, out[2] = x.dy * x.A->vx - x.dx * x.A->vy;
}

#endif
