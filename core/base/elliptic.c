/* Jacobi's elliptic functions (the exact motion of a pendulum) from the arithmetic-geometric mean a after N steps:
 *
 *     K (m) = pi / (2 a),   am (u) from phi = 2^N a u by N steps of  2 phi = phi' + asin (c' sin phi' / a')
 *
 * (Abramowitz & Stegun 1964, sections 16.4 and 17.6.) */
#include "elliptic.h"
#include "pinwheel.h"

double pw_elliptic_K (double m) {
  double a, ratio[PW_ELLIPTIC_STEPS], part[PW_ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? INFINITY : NAN;
  pw_elliptic_mean (m, &a, ratio, part);
  return PW_PI / (2 * a);
}

double pw_jacobi_am (double u, double m) {
  double a, ratio[PW_ELLIPTIC_STEPS], part[PW_ELLIPTIC_STEPS];
  if (!(m < 1)) return m == 1 ? 2 * atan (tanh (u / 2)) : NAN;
  int n = pw_elliptic_mean (m, &a, ratio, part);
  double phi = ldexp (a * u, n);
  while (n-- > 0) phi = (phi + asin (ratio[n] * pw_sin (phi))) / 2;
  return phi;
}
