/* Eigenvalues of a real matrix: it is balanced, brought to Hessenberg form by reflections, and iterated by the QR
 * algorithm with Francis' implicit double shift until it falls apart into blocks of one and two rows.  Singular values by
 * one-sided Jacobi rotations, which find small ones as well as large ones.
 *
 * (Golub & Van Loan 2013, Matrix Computations, sections 7.4, 7.5 and 8.6.3; balancing: Parlett & Reinsch 1969.) */
#include <float.h>
#include <math.h>
#include "eigen.h"
#include "pinwheel.h"

enum { EIGEN_PATIENCE = 6 /* steps; most blocks take 2 to 4 */ };

#define A(i, j) A[(size_t)(i) * (size_t)n + (size_t)(j)]

/* ---- Preparation ---- */

void pw_eigen_balance (int n, double *A) {
  for (int changed = 1, pass = 0; changed && pass < 100; pass++) {
    changed = 0;
    for (int i = 0; i < n; i++) {
      double row = 0, column = 0;
      for (int j = 0; j < n; j++)
        if (j != i) row += fabs (A (i, j)), column += fabs (A (j, i));
      if (!(row > 0 && column > 0) || !isfinite (row + column)) continue;
      int power = (int)lround (log2 (row / column) / 2);
      double f = ldexp (1, power);
      if (power == 0 || !(row / f + column * f < 0.95 * (row + column))) continue;
      changed = 1;
      for (int j = 0; j < n; j++) A (i, j) /= f;
      for (int j = 0; j < n; j++) A (j, i) *= f;
    }
  }
}

/* The reflection I - beta w w^T, w of length m, that takes x to a multiple of its first entry; x becomes w. */
static double eigen_reflector (int m, double *x) {
  double most = 0, square = 0;
  for (int i = 0; i < m; i++) most = fmax (most, fabs (x[i]));
  if (most == 0) return 0;
  for (int i = 0; i < m; i++) x[i] /= most, square += x[i] * x[i];
  double norm = sqrt (square), first = x[0];
  x[0] += first < 0 ? -norm : norm;
  return 1 / (square + fabs (first) * norm);
}

/* Applies a reflection of rows and columns first .. first + m - 1 from both sides: to the columns left .. right - 1, and to
 * the rows top .. bottom - 1. */
typedef struct {
  int left, right, top, bottom;
} eigen_window;

static void eigen_reflect (int n, double *A, int first, int m, const double *w, double beta, const eigen_window *e) {
  for (int j = e->left; j < e->right; j++) {
    double dot = 0;
    for (int i = 0; i < m; i++) dot += w[i] * A (first + i, j);
    for (int i = 0; i < m; i++) A (first + i, j) -= beta * dot * w[i];
  }
  for (int i = e->top; i < e->bottom; i++) {
    double dot = 0;
    for (int j = 0; j < m; j++) dot += w[j] * A (i, first + j);
    for (int j = 0; j < m; j++) A (i, first + j) -= beta * dot * w[j];
  }
}

static void eigen_hessenberg (int n, double *A, double *w) {
  for (int k = 0; k + 2 < n; k++) {
    for (int i = k + 1; i < n; i++) w[i - k - 1] = A (i, k);
    double beta = eigen_reflector (n - k - 1, w);
    eigen_reflect (n, A, k + 1, n - k - 1, w, beta, &(eigen_window){ k, n, 0, n });
    for (int i = k + 2; i < n; i++) A (i, k) = 0;
  }
}

/* ---- Iteration ---- */

/* One step on rows low .. high with the shifts' sum s and product p: the first column of (A - a)(A - b) begins a bulge that
 * three-row reflections chase down. */
static void eigen_step (int n, double *A, int low, int high, double s, double p) {
  double x[3] = { A (low, low) * (A (low, low) - s) + A (low, low + 1) * A (low + 1, low) + p,
                  A (low + 1, low) * (A (low, low) + A (low + 1, low + 1) - s),
                  low + 2 <= high ? A (low + 1, low) * A (low + 2, low + 1) : 0 };
  for (int k = low; k < high; k++) {
    int m = k + 2 <= high ? 3 : 2;
    if (k > low)
      for (int i = 0; i < m; i++) x[i] = A (k + i, k - 1);
    double beta = eigen_reflector (m, x);
    const eigen_window active = { k > low ? k - 1 : low, high + 1, low, k + 4 <= high + 1 ? k + 4 : high + 1 };
    eigen_reflect (n, A, k, m, x, beta, &active);
    for (int i = 1; k > low && i < m; i++) A (k + i, k - 1) = 0;
  }
}

/* The first row of the last block that does not fall apart: the entry left of it is negligible beside its neighbours, or below
 * `least`. */
static int eigen_block (int n, double *A, int high, double least) {
  int low = high;
  for (; low > 0; low--) {
    double size = fabs (A (low, low)) + fabs (A (low - 1, low - 1));
    if (fabs (A (low, low - 1)) <= DBL_EPSILON * size || fabs (A (low, low - 1)) < least) break;
  }
  if (low > 0) A (low, low - 1) = 0;
  return low;
}

/* Both eigenvalues of the block of rows i and i + 1. */
static void eigen_pair (int n, const double *A, int i, double *re, double *im) {
  double half = (A (i, i) - A (i + 1, i + 1)) / 2, mean = A (i + 1, i + 1) + half;
  double square = half * half + A (i, i + 1) * A (i + 1, i);
  if (square < 0) {
    re[i] = re[i + 1] = mean;
    im[i] = sqrt (-square);
    im[i + 1] = -im[i];
    return;
  }
  double far = mean + (mean < 0 ? -sqrt (square) : sqrt (square)); /* the other one from the product: no cancellation */
  double product = A (i, i) * A (i + 1, i + 1) - A (i, i + 1) * A (i + 1, i);
  re[i] = far;
  re[i + 1] = far != 0 ? product / far : 0;
  im[i] = im[i + 1] = 0;
}

/* Shifts are the eigenvalues of the last two rows; after 10 and 20 steps others, as in EISPACK, should those go round in
 * circles.  Round-off of the largest entry can keep one beside small neighbours from becoming negligible: after some steps it
 * decides. */
static int eigen_iterate (int n, double *A, double *re, double *im) {
  double most = 0;
  for (size_t i = 0; i < (size_t)n * (size_t)n; i++) most = fmax (most, fabs (A[i]));
  for (int high = n - 1, tries = 0; high >= 0;) {
    int low = eigen_block (n, A, high, tries > EIGEN_PATIENCE ? 8 * DBL_EPSILON * most : DBL_MIN);
    if (low == high) re[high] = A (high, high), im[high] = 0;
    if (low == high - 1) eigen_pair (n, A, low, re, im);
    if (low >= high - 1) {
      high = low - 1;
      tries = 0;
      continue;
    }
    double s = A (high, high) + A (high - 1, high - 1);
    double p = A (high, high) * A (high - 1, high - 1) - A (high, high - 1) * A (high - 1, high);
    if (++tries == 10 || tries == 20) {
      double size = fabs (A (high, high - 1)) + fabs (A (high - 1, high - 2));
      s = 1.5 * size, p = size * size;
    }
    if (tries > 60) return PW_RETRY;
    eigen_step (n, A, low, high, s, p);
  }
  return PW_OK;
}

/* ---- The end ---- */

int pw_eigenvalues (int n, double *A, double *re, double *im) {
  for (size_t i = 0; i < (size_t)n * (size_t)n; i++)
    if (!isfinite (A[i])) return PW_RETRY;
  pw_eigen_balance (n, A);
  eigen_hessenberg (n, A, re);
  return eigen_iterate (n, A, re, im);
}

void pw_singular_values (int n, int m, double *vector, double *sigma) {
  int rotated = 1;
  for (int sweep = 0; rotated && sweep < 60; sweep++) {
    rotated = 0;
    for (int i = 0; i < n; i++)
      for (int j = i + 1; j < n; j++) {
        double *x = vector + (size_t)i * (size_t)m, *y = vector + (size_t)j * (size_t)m, xx = 0, yy = 0, xy = 0;
        for (int k = 0; k < m; k++) xx += x[k] * x[k], yy += y[k] * y[k], xy += x[k] * y[k];
        if (!(fabs (xy) > 4 * DBL_EPSILON * sqrt (xx) * sqrt (yy))) continue;
        rotated = 1;
        double zeta = (yy - xx) / (2 * xy), t = (zeta < 0 ? -1 : 1) / (fabs (zeta) + hypot (1, zeta));
        double c = 1 / hypot (1, t), s = c * t;
        for (int k = 0; k < m; k++) {
          double u = x[k];
          x[k] = c * u - s * y[k];
          y[k] = s * u + c * y[k];
        }
      }
  }
  for (int i = 0; i < n; i++) {
    sigma[i] = 0;
    for (int k = 0; k < m; k++) sigma[i] = hypot (sigma[i], vector[(size_t)i * (size_t)m + (size_t)k]);
  }
}
