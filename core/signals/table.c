/* Tables: signals that interpolate points (t_i, y_i).
 *
 *   u = y_i + b_i x + M_i x^2 / 2 + (M_j - M_i) x^3 / (6 h_i),   x = t - t_i,  j = i + 1,  h_i = t_j - t_i
 *
 * between two points; outside, the signal is constant.  b_i and M_i are the first and second derivative just after t_i.
 * In a cubic table the M_i make the first derivative continuous (de Boor 2001, A Practical Guide to Splines, chapter
 * IV):
 *
 *   h_k M_k + 2 (h_k + h_i) M_i + h_i M_j = 6 ((y_j - y_i) / h_i - (y_i - y_k) / h_k),   k = i - 1
 *
 * With free ends the first two intervals share one cubic, and so do the last two ("not a knot"); with ends at rest the
 * first derivative is 0 at both.  A linear table has M = 0. */
#include <math.h>
#include <string.h>
#include "signal.h"

/* Row i of the equations for M: coefficients of M_k, M_i and M_j, and the right-hand side.  At free ends the formula of
 * table_extrapolate has eliminated M_0 and M_(n-1). */
static void table_row (const double *t, const double *y, int n, int ends, int i, double row[4]) {
  double before = i > 0 ? t[i] - t[i - 1] : 0, after = i < n - 1 ? t[i + 1] - t[i] : 0;
  double slope_before = i > 0 ? (y[i] - y[i - 1]) / before : 0, slope_after = i < n - 1 ? (y[i + 1] - y[i]) / after : 0;
  row[0] = before;
  row[1] = 2 * (before + after);
  row[2] = after;
  row[3] = 6 * (slope_after - slope_before);
  if (ends == PW_ENDS_REST) return;
  if (i == 1) row[1] += before + before * (before / after), row[2] -= before * (before / after);
  if (i == n - 2) row[1] += after + after * (after / before), row[0] -= after * (after / before);
}

/* M at a free end, extrapolated linearly from the next two points. */
static double table_extrapolate (double t0, double t1, double t2, double M1, double M2) {
  return M1 + (M1 - M2) * ((t1 - t0) / (t2 - t1));
}

/* Solves the tridiagonal equations for M without pivoting; they are diagonally dominant.  `upper`: memory for n
 * numbers, the upper diagonal after elimination. */
static void table_second_derivatives (const double *t, const double *y, int n, int ends, double *M, double *upper) {
  int first = ends == PW_ENDS_REST ? 0 : 1, last = n - 1 - first;
  double row[4];
  for (int i = first; i <= last; i++) {
    table_row (t, y, n, ends, i, row);
    double pivot = row[1] - (i > first ? row[0] * upper[i - 1] : 0);
    upper[i] = row[2] / pivot;
    M[i] = (row[3] - (i > first ? row[0] * M[i - 1] : 0)) / pivot;
  }
  for (int i = last - 1; i >= first; i--) M[i] -= upper[i] * M[i + 1];
  if (ends == PW_ENDS_REST) return;
  M[0] = table_extrapolate (t[0], t[1], t[2], M[1], M[2]);
  M[n - 1] = table_extrapolate (t[n - 1], t[n - 2], t[n - 3], M[n - 2], M[n - 3]);
}

void pw_table_spline (const pw_signal *s, double *spline) {
  const double *t = s->table.t, *y = s->table.value;
  int n = s->table.count;
  double *b = spline, *M = spline + n;
  memset (spline, 0, 2 * (size_t)n * sizeof *spline);
  if (s->table.interpolation == PW_CUBIC) table_second_derivatives (t, y, n, s->table.ends, M, b);
  for (int i = 0; i < n - 1; i++) {
    double h = t[i + 1] - t[i];
    b[i] = (y[i + 1] - y[i]) / h - h * (2 * M[i] + M[i + 1]) / 6;
  }
}

/* Number of points at or before t. */
static int table_passed (const pw_signal *s, double t) {
  int low = 0, high = s->table.count;
  while (low < high) {
    int middle = low + (high - low) / 2;
    if (s->table.t[middle] <= t)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

void pw_table_eval (const pw_signal *s, const double *spline, double t, double u[3]) {
  int n = s->table.count, passed = table_passed (s, t), i = passed - 1;
  u[0] = s->table.value[i < 0 ? 0 : i];
  u[1] = u[2] = 0;
  if (passed == 0 || passed == n) return;
  double x = t - s->table.t[i], b = spline[i], M = spline[n + i];
  double third_derivative = (spline[n + i + 1] - M) / (s->table.t[i + 1] - s->table.t[i]);
  u[0] += x * (b + x * (M / 2 + x * (third_derivative / 6)));
  u[1] = b + x * (M + x * (third_derivative / 2));
  u[2] = M + x * third_derivative;
}

/* At each point of a linear table, and at the ends of a cubic one, the first or the second derivative jumps; at the
 * other points of a cubic table the second derivative has a kink. */
double pw_table_breakpoint (const pw_signal *s, int kinks, double t) {
  int n = s->table.count, next = table_passed (s, t);
  if (next == n) return INFINITY;
  int in_spline = s->table.interpolation == PW_CUBIC && next > 0;
  return s->table.t[in_spline && !kinks ? n - 1 : next];
}
