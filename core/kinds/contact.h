/* Where a wheel at a point of a body touches the ground, and its heading there: for paths and pictures. */
#ifndef PW_CONTACT_H
#define PW_CONTACT_H

#include "pinwheel.h"

/* `at` and `heading` are in the body's frame, out in the world's. */
static inline void contact_place (const pw_pose *A, const double at[2], double heading, double out[3]) {
  out[0] = A->x + A->cos * at[0] - A->sin * at[1];
  out[1] = A->y + A->sin * at[0] + A->cos * at[1];
  out[2] = A->phi + heading;
}

#endif
