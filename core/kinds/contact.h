/* Wheels: the contact point P, and the component of its velocity along a direction d fixed in its body, which velocity
 * constraints prescribe and forces oppose.
 *
 *   d . v_P = S v,  d = R(phi) (a, b),  v = (vx, vy, w)
 *   S     = [ dx  dy  l ]                                         l: the arm of P along (b, -a) in the body
 *   gamma = w (dy vx - dx vy)                                     so that d(S v)/dt = S v' - gamma
 *
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems, chapter I.) */
#ifndef PW_CONTACT_H
#define PW_CONTACT_H

#include "batch.h"

typedef struct {
  double a, b;    /* components of the direction in the body's frame */
  double arm;     /* l [m] */
  double at[2];   /* P in the body's frame [m] */
  double heading; /* of the wheel in the body's frame [rad] */
} contact;

/* A contact in the current state: its direction (dx, dy) in the world. */
typedef struct {
  contact k;
  const pw_configuration *A;
  const double *w;
  double dx, dy;
} contact_state;

static inline contact contact_make (const double at[2], double heading, double a, double b) {
  return (contact){ a, b, at[0] * b - at[1] * a, { at[0], at[1] }, heading };
}

/* The direction along the heading, and the one to its left. */
static inline contact contact_along (const double at[2], double heading) {
  return contact_make (at, heading, pw_cos (heading), pw_sin (heading));
}

static inline contact contact_across (const double at[2], double heading) {
  return contact_make (at, heading, -pw_sin (heading), pw_cos (heading));
}

/* The contact k of element e of a batch of elements with one body. */
static inline contact_state contact_of (contact k, const pw_batch *b, int e) {
  const pw_configuration *A = batch_body (b, e, 1, 0);
  return (contact_state){ k, A, batch_w (b, e), A->cos * k.a - A->sin * k.b, A->sin * k.a + A->cos * k.b };
}

static inline contact_state contact_at (const pw_batch *b, int e) {
  return contact_of (((const contact *)b->element)[e], b, e);
}

/* The velocity component S v. */
static inline double contact_speed (const contact_state *x) {
  return x->dx * x->A->vx + x->dy * x->A->vy + x->k.arm * x->A->omega;
}

PER_ELEMENT (contact_J, contact, 3) {
  out[0] = x.dx, out[1] = x.dy, out[2] = x.k.arm;
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

/* Contact point and heading (x, y, angle) in the world, for output and figures. */
PER_ELEMENT (contact_place, contact, 3) {
  out[0] = x.A->x + x.A->cos * x.k.at[0] - x.A->sin * x.k.at[1];
  out[1] = x.A->y + x.A->sin * x.k.at[0] + x.A->cos * x.k.at[1];
  out[2] = x.A->phi + x.k.heading;
}

#endif
