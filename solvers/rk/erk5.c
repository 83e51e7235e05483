/* erk5: the method of order 5 of Dormand & Prince 1980 with an error estimate of order 4 (Hairer, Norsett & Wanner
 * 1993, table II.5.2).
 *
 * The seventh stage is the derivative at the new state, evaluated after the projection; it is also the first stage of
 * the next step. */
#include "rk.h"

static const double erk5_c[] = { 0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1 };
static const double erk5_A[] = {
  1. / 5,        3. / 40,     9. / 40,      44. / 45,   -56. / 15,     32. / 9,   19372. / 6561,  -25360. / 2187,
  64448. / 6561, -212. / 729, 9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656,
};
static const double erk5_b[] = { 35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84 };
static const double erk5_e[] = { 71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40 };
static const pw_tableau erk5_tableau = {
  .stages = 6, .c = erk5_c, .A = erk5_A, .b = erk5_b, .e = erk5_e, .exponent = 1. / 5, .memory = 0.04
};

PW_RK_METHOD (erk5, erk5_tableau, .about = "explicit Runge-Kutta of order 5(4), adaptive (Dormand & Prince 1980)",
              .adaptive = 1, .order = 5, .options = pw_rk_adaptive_options);
