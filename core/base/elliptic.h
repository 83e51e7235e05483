/* The arithmetic-geometric mean of 1 and sqrt (1 - m), of which elliptic functions and their derivatives are made:
 *
 *     a' = (a + b) / 2,   b' = sqrt (a b),   c' = (a - b) / 2 = c^2 / (4 a')   with c^2 = m at first
 *
 * (Abramowitz & Stegun 1964, section 17.6.) */
#ifndef PW_ELLIPTIC_H
#define PW_ELLIPTIC_H

#include <float.h>
#include <math.h>

enum { PW_ELLIPTIC_STEPS = 12 }; /* sufficient for any m < 1 */

/* Stores the mean in *a, and of each step c / a in `ratio` and c / m in `part`.  Returns the number of steps, at least 1. */
static inline int pw_elliptic_mean (double m, double *a, double ratio[PW_ELLIPTIC_STEPS],
                                    double part[PW_ELLIPTIC_STEPS]) {
  double b = sqrt (1 - m), c = 0;
  int n = 0;
  *a = 1;
  while (n == 0 || (n < PW_ELLIPTIC_STEPS && fabs (*a - b) > 4 * DBL_EPSILON * *a)) {
    double mean = (*a + b) / 2;
    part[n] = n == 0 ? 1 / (2 * (1 + b)) : c * part[n - 1] / (4 * mean);
    c = (*a - b) / 2;
    ratio[n++] = c / mean;
    b = sqrt (*a * b);
    *a = mean;
  }
  return n;
}

#endif
