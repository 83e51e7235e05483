/* Functions and constants of expressions, with first and second derivatives of the smooth functions
 * (Abramowitz & Stegun 1964, chapters 4 and 17). */
#include <string.h>
#include "elliptic.h"
#include "expression_parts.h"
#include "pinwheel.h"

/* ---- Functions f of one argument x: f', f'' ---- */

#define PARTIALS_OF_ONE(name, first, second)                          \
  static pw_partials partials_##name (double x, double y, double f) { \
    (void)x, (void)y, (void)f;                                        \
    return (pw_partials){ .x = first, .xx = second };                 \
  }

PARTIALS_OF_ONE (sin, pw_cos (x), -f)
PARTIALS_OF_ONE (cos, -pw_sin (x), -f)
PARTIALS_OF_ONE (tan, 1 + f * f, 2 * f * (1 + f * f))
PARTIALS_OF_ONE (asin, 1 / sqrt ((1 - x) * (1 + x)), x / ((1 - x) * (1 + x) * sqrt ((1 - x) * (1 + x))))
PARTIALS_OF_ONE (acos, -1 / sqrt ((1 - x) * (1 + x)), -x / ((1 - x) * (1 + x) * sqrt ((1 - x) * (1 + x))))
PARTIALS_OF_ONE (atan, 1 / (1 + x * x), -2 * x / ((1 + x * x) * (1 + x * x)))
PARTIALS_OF_ONE (sinh, cosh (x), f)
PARTIALS_OF_ONE (cosh, sinh (x), f)
PARTIALS_OF_ONE (tanh, 1 / (cosh (x) * cosh (x)), -2 * f / (cosh (x) * cosh (x)))
PARTIALS_OF_ONE (exp, f, f)
PARTIALS_OF_ONE (log, 1 / x, -1 / (x * x))
PARTIALS_OF_ONE (log10, 1 / (x * log (10)), -1 / (x * x * log (10)))
PARTIALS_OF_ONE (sqrt, 0.5 / f, -0.25 / (f * x))

/* ---- Functions of two arguments ---- */

/* Of atan2 (y, x): member x of the result belongs to the first argument, which is y here. */
static pw_partials partials_atan2 (double y, double x, double f) {
  double r = x * x + y * y;
  (void)f;
  return (pw_partials){ x / r, -y / r, -2 * x * y / (r * r), (y * y - x * x) / (r * r), 2 * x * y / (r * r) };
}

static pw_partials partials_hypot (double x, double y, double f) {
  double c = x / f, s = y / f;
  return (pw_partials){ c, s, s * s / f, -c * s / f, c * c / f };
}

double pw_expression_power (double x, double y) {
  return y == 2 ? x * x : y == 3 ? x * x * x : pow (x, y);
}

/* 0 if a is 0, even if b is infinite. */
static double partials_product (double a, double b) {
  return a == 0 ? 0 : a * b;
}

pw_partials pw_expression_power_partials (double x, double y, double f, int exponent_varies) {
  pw_partials s = { .x = partials_product (y, pw_expression_power (x, y - 1)),
                    .xx = partials_product (y * (y - 1), pw_expression_power (x, y - 2)) };
  if (!exponent_varies) return s;
  double log_x = log (x);
  s.y = partials_product (f, log_x);
  s.xy = partials_product (s.x, log_x) + pow (x, y - 1);
  s.yy = partials_product (f, log_x * log_x);
  return s;
}

double pw_expression_mod (double x, double y) {
  double r = fmod (x, y);
  return r != 0 && (r < 0) != (y < 0) ? r + y : r;
}

/* ---- Elliptic functions ----
 *
 * With the arithmetic-geometric mean a, b, c of core/base/elliptic.h, the angles phi_n of am (elliptic.c), the
 * incomplete elliptic integral E of the second kind, s and c the sine and cosine of am, dn = sqrt (1 - m s^2), and R =
 * sum of 2^(n-1) c_n^2 / m from n = 1,
 *
 *   dK/dm = K (1/2 - R) / (2 (1 - m)),   m (1 - m) d2K/dm2 = K / 4 - (1 - 2 m) dK/dm
 *   N = (E (am | m) - (1 - m) u) / m = u (1/2 - R) + sum of c_n / m sin phi_n
 *   d am/du = dn,   d am/dm = -dn F,   F = (N - s c / dn) / (2 (1 - m))
 *   dN/dm = (dn d am/dm + u/2 - N/2) / m        with constant u
 *
 * In the code, NAME_m is the derivative of NAME with respect to m, and m1 = 1 - m. */

static double partials_R (double m, int steps, const double c_by_m[PW_ELLIPTIC_STEPS]) {
  double R = 0;
  for (int n = 0; n < steps; n++) R += ldexp (m * c_by_m[n] * c_by_m[n], n);
  return R;
}

#define SERIES_LIMIT 0.2 /* |m| below which the formula of d2K/dm2 loses digits, and 40 terms of its series suffice */

/* d2K/dm2 from K = pi/2 sum of (1 3 ... (2 n - 1) / (2 4 ... 2 n))^2 m^n. */
static double partials_K_series (double m) {
  double coefficient = 1, sum = 0, power = 1;
  for (int n = 1; n < 40; n++) {
    double quotient = (2.0 * n - 1) / (2.0 * n);
    coefficient *= quotient * quotient;
    if (n >= 2) sum += n * (n - 1) * coefficient * power, power *= m;
  }
  return PW_PI / 2 * sum;
}

static pw_partials partials_elliptic_K (double m, double y, double K) {
  double a, c_by_a[PW_ELLIPTIC_STEPS], c_by_m[PW_ELLIPTIC_STEPS];
  (void)y;
  int n = pw_elliptic_mean (m, &a, c_by_a, c_by_m);
  double first = K * (0.5 - partials_R (m, n, c_by_m)) / (2 * (1 - m));
  double formula = (K / 4 - (1 - 2 * m) * first) / (m * (1 - m));
  return (pw_partials){ .x = first, .xx = fabs (m) < SERIES_LIMIT ? partials_K_series (m) : formula };
}

static pw_partials partials_jacobi_am (double u, double m, double phi) {
  double a, c_by_a[PW_ELLIPTIC_STEPS], c_by_m[PW_ELLIPTIC_STEPS];
  double s = pw_sin (phi), c = pw_cos (phi), dn = sqrt (1 - m * s * s);
  int n = pw_elliptic_mean (m, &a, c_by_a, c_by_m);
  double N = u * (0.5 - partials_R (m, n, c_by_m)), angle = ldexp (a * u, n), m1 = 1 - m;
  for (; n > 0; n--) {
    N += c_by_m[n - 1] * pw_sin (angle);
    angle = (angle + asin (c_by_a[n - 1] * pw_sin (angle))) / 2;
  }
  double F = N / (2 * m1) - s * c / (2 * m1 * dn), am_m = -dn * F;
  double dn_m = -(s * s + 2 * m * s * c * am_m) / (2 * dn), N_m = (dn * am_m + u / 2 - N / 2) / m;
  double sc_m = ((c * c - s * s) * am_m - s * c * dn_m / dn) / dn;
  double F_m = (N_m - sc_m) / (2 * m1) + F / m1;
  pw_partials r = { dn, am_m, -m * s * c, dn_m, -(dn_m * F + dn * F_m) };
  if (!(fabs (m) < 1e-5)) return r; /* also if m is NaN */
  const double h = 1e-4; /* the error of N_m, a difference, would be 1e-15 / m; that of this difference is 1e-9 */
  r.yy = (partials_jacobi_am (u, m + h, pw_jacobi_am (u, m + h)).y -
          partials_jacobi_am (u, m - h, pw_jacobi_am (u, m - h)).y) /
         (2 * h);
  return r;
}

/* ---- List of functions and constants ---- */

/* The entries are pw_expression_function. */
#define FUNCTION_OF_ONE(name, f, trend, from, to) \
  { #name, PW_OP_FUNCTION_OF_ONE, 1, 1, f, NULL, partials_##name, trend, from, to, 0 }
#define FUNCTION_OF_TWO(name, op, f) \
  { #name, op, 2, 2, NULL, f, partials_##name, PW_NOT_MONOTONIC, 0, 0, 0 }
#define FUNCTION_WITHOUT_PARTIALS(name, op, least, most) \
  { #name, op, least, most, NULL, NULL, NULL, PW_NOT_MONOTONIC, 0, 0, 0 }

const pw_expression_function pw_expression_functions[] = {
  { .name = "pi", .op = PW_OP_CONSTANT, .value = PW_PI },
  { .name = "e", .op = PW_OP_CONSTANT, .value = 2.71828182845904523536 },
  { .name = "deg", .op = PW_OP_CONSTANT, .value = PW_PI / 180 },
  FUNCTION_OF_ONE (sin, pw_sin, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX),
  FUNCTION_OF_ONE (cos, pw_cos, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX),
  { "tan", PW_OP_TAN, 1, 1, tan, NULL, partials_tan, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX, 0 },
  FUNCTION_OF_ONE (asin, asin, PW_INCREASING, -1, 1),
  FUNCTION_OF_ONE (acos, acos, PW_DECREASING, -1, 1),
  FUNCTION_OF_ONE (atan, atan, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (sinh, sinh, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (cosh, cosh, PW_NOT_MONOTONIC, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (tanh, tanh, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (exp, exp, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (log, log, PW_INCREASING, 0, INFINITY),
  FUNCTION_OF_ONE (log10, log10, PW_INCREASING, 0, INFINITY),
  FUNCTION_OF_ONE (sqrt, sqrt, PW_INCREASING, 0, INFINITY),
  FUNCTION_WITHOUT_PARTIALS (abs, PW_OP_ABS, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (floor, PW_OP_FLOOR, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (ceil, PW_OP_CEIL, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (round, PW_OP_ROUND, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (sign, PW_OP_SIGN, 1, 1),
  FUNCTION_OF_TWO (atan2, PW_OP_ATAN2, atan2),
  FUNCTION_OF_TWO (hypot, PW_OP_HYPOT, hypot),
  FUNCTION_OF_TWO (jacobi_am, PW_OP_FUNCTION_OF_TWO, pw_jacobi_am),
  FUNCTION_OF_ONE (elliptic_K, pw_elliptic_K, PW_INCREASING, -INFINITY, 1),
  FUNCTION_WITHOUT_PARTIALS (mod, PW_OP_MOD, 2, 2),
  FUNCTION_WITHOUT_PARTIALS (min, PW_OP_MIN, 1, 0),
  FUNCTION_WITHOUT_PARTIALS (max, PW_OP_MAX, 1, 0),
  { .name = NULL },
};

int pw_expression_find_function (const char *name) {
  int i = 0;
  while (pw_expression_functions[i].name && strcmp (pw_expression_functions[i].name, name) != 0) i++;
  return pw_expression_functions[i].name ? i : -1;
}
