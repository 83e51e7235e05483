/* Jacobi's elliptic functions (the exact motion of a pendulum) by the arithmetic-geometric mean of 1 and sqrt (1 - m):
 *
 *     a' = (a + b) / 2,   b' = sqrt (a b),   c' = (a - b) / 2,       K (m) = pi / (2 a)  in the limit,
 *
 * and am (u) from phi = 2^N a u by N steps of  2 phi = phi' + asin (c' sin phi' / a').
 * (Abramowitz & Stegun 1964, sections 16.4 and 17.6.) */
#include <float.h>
#include <math.h>
#include "pinwheel.h"

enum { ELLIPTIC_STEPS = 12 }; /* sufficient for any m < 1 */

/* Stores the mean in *a and c / a of each step in `ratio`.  Returns the number of steps. */
static int elliptic_mean (double m, double *a, double ratio[ELLIPTIC_STEPS]) {
  double b = sqrt (1 - m);
  int n = 0;
  *a = 1;
  while (n < ELLIPTIC_STEPS && fabs (*a - b) > 4 * DBL_EPSILON * *a) {
    double mean = (*a + b) / 2;
    ratio[n++] = (*a - b) / 2 / mean;
    b = sqrt (*a * b);
    *a = mean;
  }
  return n;
}

double pw_elliptic_K (double m) {
  double a, ratio[ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? INFINITY : NAN;
  elliptic_mean (m, &a, ratio);
  return PW_PI / (2 * a);
}

double pw_jacobi_am (double u, double m) {
  double a, ratio[ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? 2 * atan (tanh (u / 2)) : NAN;
  int n = elliptic_mean (m, &a, ratio);
  double phi = ldexp (a * u, n);
  while (n-- > 0) phi = (phi + asin (ratio[n] * pw_sin (phi))) / 2;
  return phi;
}
