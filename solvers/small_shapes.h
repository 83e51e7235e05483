/* The shapes of panels that are compiled apart; see small.h. */
#ifndef PW_SMALL_SHAPES_H
#define PW_SMALL_SHAPES_H

#include "unroll.h"

/* An octal digit for each row tells which of the body's columns it has: 7 all three; 5 x and the angle, 6 y and the angle:
 * the two rows of a unit matrix and an angle.  These are compiled apart: first what has most zeros. */
#define SMALL_SHAPES                      \
  SMALL_SHAPE (0756) /* a wheel, a pin */ \
  SMALL_SHAPE (0567)                      \
  SMALL_SHAPE (056)                       \
  SMALL_SHAPE (07)                        \
  SMALL_SHAPE (05656)                     \
  SMALL_SHAPE (056756)                    \
  SMALL_SHAPE (077)                       \
  SMALL_SHAPE (0777)                      \
  SMALL_SHAPE (07777)

PW_INLINE int small_rows (unsigned shape) {
  return shape < 010 ? 1 : shape < 0100 ? 2 : shape < 01000 ? 3 : shape < 010000 ? 4 : 5;
}

/* The columns of row r of a shape, as bits. */
PW_INLINE unsigned small_columns (unsigned shape, int r) {
  return shape >> 3 * (small_rows (shape) - 1 - r) & 7;
}

#endif
