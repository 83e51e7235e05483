/* rk4: the classical Runge-Kutta method of order 4 (Kutta 1901), fixed step. */
#include "rk.h"

static const double rk4_c[] = { 0, 0.5, 0.5, 1 };
static const double rk4_A[] = { 0.5, 0, 0.5, 0, 0, 1 }; /* by rows, below the diagonal */
static const double rk4_b[] = { 1. / 6, 1. / 3, 1. / 3, 1. / 6 };
static const pw_tableau rk4_tableau = { .stages = 4, .c = rk4_c, .A = rk4_A, .b = rk4_b };

PW_RK_METHOD (rk4, rk4_tableau, .about = "classical Runge-Kutta of order 4, fixed step (Kutta 1901)", .order = 4,
              .options = pw_rk_fixed_options);
