/* rk4: the classical Runge-Kutta method of order 4 (Kutta 1901), fixed step. */
#include "rk.h"

static const double rk4_c[] = { 0, 0.5, 0.5, 1 };
static const double rk4_A[] = { 0.5, 0, 0.5, 0, 0, 1 };
static const double rk4_b[] = { 1. / 6, 1. / 3, 1. / 3, 1. / 6 };
static const pw_tableau rk4_tableau = { .stages = 4, .order = 4, .c = rk4_c, .A = rk4_A, .b = rk4_b };

static int rk4_open (pw_run *r, pw_error *error) {
  return pw_rk_open (r, &rk4_tableau, error);
}

const pw_method pw_method_rk4 = {
  .name = "rk4",
  .about = "classical Runge-Kutta of order 4, fixed step (Kutta 1901)",
  .order = 4,
  .stabilisations = pw_rk_stabilisations,
  .options = pw_rk_options + 1,
  .open = rk4_open,
  PW_RK_FUNCTIONS,
};
