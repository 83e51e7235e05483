/* The order conditions of the Runge-Kutta tableaus (Hairer, Norsett & Wanner 1993, section II.2), to round-off:
 *
 *   sum_j A_ij = c_i,   sum_i b_i c_i^k = 1 / (k + 1),   sum_ij b_i c_i^l A_ij c_j^k = 1 / ((k + 1) (k + l + 2))
 *
 * for k < order, and for k + l + 2 <= order; and those of the error estimates, whose weights are differences. */
#include <math.h>
#include <stdio.h>
#include "check.h"

/* The sources of the methods, with other names than in the library. */
#define pw_method_rk4 tableaus_rk4
#define pw_method_erk5 tableaus_erk5
#define pw_method_erk8 tableaus_erk8
#include "../../solvers/rk/rk4.c"
#include "../../solvers/rk/erk5.c"
#include "../../solvers/rk/erk8.c"

static const struct {
  const pw_method *method;
  const pw_tableau *b;
  int order_e, order_e3; /* orders of the methods whose difference is the estimate */
} tableaus[] = {
  { &tableaus_rk4, &rk4_tableau, 0, 0 },
  { &tableaus_erk5, &erk5_tableau, 4, 0 },
  { &tableaus_erk8, &erk8_tableau, 5, 3 },
};
enum { TABLEAUS = sizeof tableaus / sizeof *tableaus };

static double tableaus_power (double c, int k) {
  return k == 0 ? 1 : pow (c, k);
}

/* sum_j A_ij c_j^k of a stage; `size`: the sum of absolute values. */
static double tableaus_row (const pw_tableau *b, int i, int k, double *size) {
  const double *A = b->A + i * (i - 1) / 2;
  double sum = 0;
  *size = 0;
  for (int j = 0; j < i; j++) {
    double term = A[j] * tableaus_power (b->c[j], k);
    sum += term;
    *size += fabs (term);
  }
  return sum;
}

static void tableaus_check (const char *name, const char *what, int l, int k, double value, double reference,
                            double size) {
  check_close (check_text ("%s: %s, l = %d, k = %d", name, what, l, k), value, reference,
               4 * CHECK_EPS * (size + fabs (reference)), "4 eps of each term");
}

TEST (rows) {
  for (int n = 0; n < TABLEAUS; n++) {
    assert_true (tableaus[n].b->stages < PW_RK_STAGES);
    for (int i = 0; i < tableaus[n].b->stages; i++) {
      double size, sum = tableaus_row (tableaus[n].b, i, 0, &size);
      tableaus_check (tableaus[n].method->name, "row of A", i, 0, sum, tableaus[n].b->c[i], size);
    }
  }
}

TEST (quadrature) {
  for (int n = 0; n < TABLEAUS; n++) {
    const pw_tableau *b = tableaus[n].b;
    for (int k = 0; k < tableaus[n].method->order; k++) {
      double sum = 0, size = 0;
      for (int i = 0; i < b->stages; i++) {
        double term = b->b[i] * tableaus_power (b->c[i], k);
        sum += term;
        size += fabs (term);
      }
      tableaus_check (tableaus[n].method->name, "sum b c^k", 0, k, sum, 1. / (k + 1), size);
    }
  }
}

TEST (two_levels) {
  for (int n = 0; n < TABLEAUS; n++) {
    const pw_tableau *b = tableaus[n].b;
    int order = tableaus[n].method->order;
    for (int k = 1; k + 2 <= order; k++)
      for (int l = 0; k + l + 2 <= order; l++) {
        double sum = 0, size = 0, part;
        for (int i = 0; i < b->stages; i++) {
          double weight = b->b[i] * tableaus_power (b->c[i], l);
          sum += weight * tableaus_row (b, i, k, &part);
          size += fabs (weight) * part;
        }
        tableaus_check (tableaus[n].method->name, "sum b c^l A c^k", l, k, sum, 1. / ((k + 1) * (k + l + 2)), size);
      }
  }
}

/* An estimate is zero where both methods are exact, and nonzero for the next power. */
static void tableaus_estimate (const char *name, const pw_tableau *b, const double *e, int order) {
  for (int k = 0; k <= order; k++) {
    double sum = 0, size = 0;
    for (int i = 0; i <= b->stages; i++) {
      double term = e[i] * tableaus_power (i < b->stages ? b->c[i] : 1, k);
      sum += term;
      size += fabs (term);
    }
    if (k < order)
      tableaus_check (name, "sum e c^k", 0, k, sum, 0, size);
    else
      check_below ("round-off", 1e6 * CHECK_EPS * size, fabs (sum), "the estimate sees the first error there is");
  }
}

TEST (estimates) {
  for (int n = 0; n < TABLEAUS; n++) {
    const pw_tableau *b = tableaus[n].b;
    assert_true ((b->e != NULL) == (tableaus[n].order_e > 0) && (b->e3 != NULL) == (tableaus[n].order_e3 > 0));
    if (b->e) tableaus_estimate (tableaus[n].method->name, b, b->e, tableaus[n].order_e);
    if (b->e3) tableaus_estimate (tableaus[n].method->name, b, b->e3, tableaus[n].order_e3);
  }
  assert_int_equal (tableaus_rk4.order, 4);
  assert_int_equal (tableaus_erk5.order, 5);
  assert_int_equal (tableaus_erk8.order, 8);
}
