/* The arithmetic-geometric mean, from which elliptic functions and their derivatives are computed:
 *
 *     a' = (a + b) / 2,   b' = sqrt (a b),   c' = (a - b) / 2 = c^2 / (4 a')
 *
 * from a = 1, b = sqrt (1 - m), c = sqrt (m); a prime marks the next step (Abramowitz & Stegun 1964, 17.6). */
#ifndef PW_ELLIPTIC_H
#define PW_ELLIPTIC_H

#include <float.h>
#include <math.h>

enum { PW_ELLIPTIC_STEPS = 12 }; /* a and b agree to round-off after them for any m < 1, even -1e300 */

/* m < 1.  Stores the mean in *a, and c' / a' and c' / m of each step.  Returns the number of steps, at least 1. */
static inline int pw_elliptic_mean (double m, double *a, double c_by_a[PW_ELLIPTIC_STEPS],
                                    double c_by_m[PW_ELLIPTIC_STEPS]) {
  double b = sqrt (1 - m), c = 0;
  int n = 0;
  *a = 1;
  while (n == 0 || (n < PW_ELLIPTIC_STEPS && fabs (*a - b) > 4 * DBL_EPSILON * *a)) {
    double mean = (*a + b) / 2;
    c_by_m[n] = n == 0 ? 1 / (2 * (1 + b)) : c * c_by_m[n - 1] / (4 * mean); /* at first m = (1 - b) (1 + b) */
    c = (*a - b) / 2;
    c_by_a[n++] = c / mean;
    b = sqrt (*a * b);
    *a = mean;
  }
  return n;
}

#endif
