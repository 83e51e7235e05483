/* Sine and cosine of an angle [rad], the same on every machine; for |x| >= PW_SINE_LIMIT, infinity and NaN those of the
 * C library.  Elliptic functions, Gauss's rule.  The placeholder of derivatives by differences, to which element types
 * refer. */
#include <float.h>
#include <math.h>
#include "pinwheel.h"
#include "sine.h"
#include "util.h"

const double pw_gauss_node[] = { 0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363 };
const double pw_gauss_weight[] = { 0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763 };

void pw_sin_cos (double x, double *sine, double *cosine) {
  if (fabs (x) < PW_SINE_LIMIT) {
    pw_lanes s, c;
    pw_sin_cos_lanes ((pw_lanes){ x }, &s, &c);
    *sine = s[0];
    *cosine = c[0];
  } else {
    *sine = sin (x);
    *cosine = cos (x);
  }
}

double pw_sin (double x) {
  return fabs (x) < PW_SINE_LIMIT ? pw_sine_shifted (x, 0) : sin (x);
}

double pw_cos (double x) {
  return fabs (x) < PW_SINE_LIMIT ? pw_sine_shifted (x, 1) : cos (x);
}

/* The complete elliptic integral K and Jacobi's amplitude am, which give the exact motion of a pendulum, from the
 * arithmetic-geometric mean a_N of N steps:
 *
 *     K (m) = pi / (2 a_N),   am (u | m) = phi_0,
 *     phi_N = 2^N a_N u,      2 phi_(n-1) = phi_n + asin (c_n sin phi_n / a_n)
 *
 * with a_0 = 1, b_0 = sqrt (1 - m) and a_n = (a + b) / 2, b_n = sqrt (a b), c_n = (a - b) / 2 from those before.
 * (Abramowitz & Stegun 1964, sections 16.4 and 17.6.) */

enum { ELLIPTIC_STEPS = 12 }; /* a and b agree to round-off after them for any m < 1, even -1e300 */

/* m < 1.  Stores the mean in *a, and c_n / a_n in c_by_a[n - 1].  Returns the number of steps, at least 1. */
static int elliptic_mean (double m, double *a, double c_by_a[ELLIPTIC_STEPS]) {
  double b = sqrt (1 - m);
  int n = 0;
  *a = 1;
  while (n == 0 || (n < ELLIPTIC_STEPS && fabs (*a - b) > 4 * DBL_EPSILON * *a)) {
    double mean = (*a + b) / 2;
    c_by_a[n++] = (*a - b) / 2 / mean;
    b = sqrt (*a * b);
    *a = mean;
  }
  return n;
}

double pw_elliptic_K (double m) {
  double a, c_by_a[ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? INFINITY : NAN;
  elliptic_mean (m, &a, c_by_a);
  return PW_PI / (2 * a);
}

double pw_jacobi_am (double u, double m) {
  double a, c_by_a[ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? 2 * atan (tanh (u / 2)) : NAN;
  int n = elliptic_mean (m, &a, c_by_a);
  double phi = ldexp (a * u, n);
  while (n-- > 0) phi = (phi + asin (c_by_a[n] * pw_sin (phi))) / 2;
  return phi;
}

void pw_by_differences (const pw_batch *b, double *out) {
  (void)b; /* only its address is used */
  (void)out;
}
