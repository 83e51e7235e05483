/* The eigenvalues of a linearisation, with uncertain parts set to 0, and the largest step with which RK4 is stable. */
#include <float.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linear.h"
#include "rank.h"

/* EIGEN_ROUND_OFF: size of the perturbations that estimate the uncertainty of eigenvalues, relative to the largest
 * entry of each row; then, after balancing, of the matrix: a hundred times round-off, lost in derivatives and QR
 * algorithm.  EIGEN_CERTAIN: a real or imaginary part is kept if it exceeds this multiple of the eigenvalue's shift. */
static const double EIGEN_ROUND_OFF = 100 * DBL_EPSILON, EIGEN_CERTAIN = 10;

/* The n eigenvalues of A, stored by rows (destroyed), conjugate pairs adjacent, im > 0 first, and the left eigenvectors
 * of A^T unless `left` is NULL; `work` has 4 n entries. */
static int eigen_values (int n, double *A, double *re, double *im, double *left, double *work) {
  for (int i = 0; i < n * n; i++)
    if (!isfinite (A[i])) return PW_RETRY;
  int failed = n && LAPACKE_dgeev_work (LAPACK_COL_MAJOR, left ? 'V' : 'N', 'N', n, A, n, re, im, left, left ? n : 1,
                                        NULL, 1, work, 4 * n);
  return failed ? PW_RETRY : PW_OK;
}

/* Perturbs each row of B by up to EIGEN_ROUND_OFF times its largest entry, or times `least` if that is larger. */
static void eigen_perturb (int n, double least, double *B) {
  for (int i = 0; i < n; i++, B += n) {
    double most = least;
    for (int k = 0; k < n; k++) most = fmax (most, fabs (B[k]));
    for (int k = 0; k < n; k++) B[k] += EIGEN_ROUND_OFF * most * pw_irregular (1.7, i * n + k + 1);
  }
}

/* The shift of each eigenvalue by the perturbation: the distance to the nearest one of the perturbed matrix (re2, im2);
 * with moduli in ascending order, the difference to the modulus of the same rank if that is larger, since the nearest
 * one is not meaningful among many defective ones; at least `least`.  re2 becomes the sorted moduli. */
static void eigen_shift (int n, const double *re, const double *im, double *re2, const double *im2, double least,
                         double *shift) {
  for (int i = 0; i < n; i++) {
    shift[i] = INFINITY;
    for (int k = 0; k < n; k++) shift[i] = fmin (shift[i], hypot (re[i] - re2[k], im[i] - im2[k]));
    shift[i] = fmax (shift[i], least);
  }
  for (int k = 0; k < n; k++) re2[k] = hypot (re2[k], im2[k]);
  LAPACKE_dlasrt_work ('I', n, re2);
  for (int i = 0; i < n; i++) {
    double size = hypot (re[i], im[i]);
    int rank = 0;
    for (int k = 0; k < n; k++) rank += hypot (re[k], im[k]) < size || (hypot (re[k], im[k]) == size && k < i);
    shift[i] = fmax (shift[i], fabs (size - re2[rank]));
  }
}

/* Sets real and imaginary parts below their uncertainty to 0, the same for both eigenvalues of a pair. */
static void eigen_clean (int n, double *re, double *im, const double *shift) {
  for (int i = 0, pair; i < n; i += 1 + pair) {
    pair = im[i] > 0;
    double uncertain = EIGEN_CERTAIN * fmax (shift[i], shift[i + pair]);
    for (int k = i; k <= i + pair; k++) {
      if (!(fabs (re[k]) > uncertain)) re[k] = 0;
      if (!(fabs (im[k]) > uncertain)) im[k] = 0;
    }
  }
}

/* The eigenvalues of B; those of the perturbed matrix give their uncertainty.  B has room for 2 n^2 + 7 n entries. */
static int eigen_certain (const pw_linearisation *x, int n, double *B, double *re, double *im) {
  int cells = n * n, unused, also_unused;
  double *perturbed = B + cells, *re2 = perturbed + cells, *im2 = re2 + n, *shift = im2 + n, *work = shift + n;
  double most = 1 / x->r->w->scale.time; /* so that rows of zeros are perturbed, too */
  memcpy (perturbed, B, (size_t)cells * sizeof *B);
  if (eigen_values (n, B, re, im, x->modes ? x->left_vectors : NULL, work) != PW_OK) return PW_RETRY;
  if (x->modes) memcpy (x->left_vectors + cells, im, (size_t)n * sizeof *im);
  eigen_perturb (n, most, perturbed);
  if (n) LAPACKE_dgebal_work (LAPACK_COL_MAJOR, 'S', n, perturbed, n, &unused, &also_unused, work);
  for (int i = 0; i < cells; i++) most = fmax (most, fabs (perturbed[i]));
  eigen_perturb (n, most, perturbed);
  if (eigen_values (n, perturbed, re2, im2, NULL, work) != PW_OK) return PW_RETRY;
  eigen_shift (n, re, im, re2, im2, EIGEN_ROUND_OFF * most, shift);
  eigen_clean (n, re, im, shift);
  return PW_OK;
}

/* Whether i comes before k: larger real part first, then larger frequency, then im > 0. */
static int eigen_before (const pw_linear *l, int i, int k) {
  if (l->re[i] != l->re[k]) return l->re[i] > l->re[k];
  if (fabs (l->im[i]) != fabs (l->im[k])) return fabs (l->im[i]) > fabs (l->im[k]);
  return l->im[i] > l->im[k];
}

/* Exchanges `length` numbers with those before them. */
static void eigen_swap (double *x, int length) {
  for (int k = 0; k < length; k++) {
    double kept = x[k];
    x[k] = x[k - length], x[k - length] = kept;
  }
}

static void eigen_sort (pw_linear *l) {
  const int length = 4 * l->coordinates; /* of a shape */
  for (int i = 1; i < l->unknowns; i++)
    for (int j = i; j > 0 && eigen_before (l, j, j - 1); j--) {
      unsigned char rigid = l->rigid[j];
      l->rigid[j] = l->rigid[j - 1], l->rigid[j - 1] = rigid;
      eigen_swap (l->re + j, 1);
      eigen_swap (l->im + j, 1);
      if (l->shape) eigen_swap (l->shape + (size_t)j * (size_t)length, length);
    }
}

/* Transforms B, stored by rows, by reflections, left in x->symmetry, that map the span of its first k vectors to that
 * of the first k unit vectors.  Returns 1 if the span is invariant: the lower left block is then 0. */
static int eigen_split (pw_linearisation *x, int k, double *B) {
  int n = x->size;
  double off = 0, *tau = x->tau, *work = x->dx; /* at least n */
  if (k == 0 || k > n) return k == 0;
  double size = LAPACKE_dlange_work (LAPACK_COL_MAJOR, 'F', n, n, B, n, work);
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, n, k, x->symmetry, n, tau, work, n);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'L', 'T', n, n, k, x->symmetry, n, tau, B, n, work, n);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'R', 'N', n, n, k, x->symmetry, n, tau, B, n, work, n);
  for (int i = k; i < n; i++)
    for (int c = 0; c < k; c++) off = pw_larger_or_nan (off, fabs (B[i * n + c]));
  return off <= PW_LINEAR_SYMMETRIC * size;
}

int pw_linear_eigenvalues (pw_linearisation *x, pw_linear *l, pw_error *error) {
  int n = l->unknowns, k = l->symmetries;
  size_t cells = (size_t)n * (size_t)n;
  double *B = malloc ((2 * cells + 7 * (size_t)n + 1) * sizeof *B);
  if (B == NULL) return PW_RESOURCE;
  memcpy (B, x->A, cells * sizeof *B);
  if (!eigen_split (x, k, B)) {
    memcpy (B, x->A, cells * sizeof *B);
    k = l->symmetries = 0;
  }
  memcpy (x->upper_rows, B, (size_t)(k * n) * sizeof *B);
  for (int i = k; k > 0 && i < n; i++)
    memmove (B + (size_t)(i - k) * (size_t)(n - k), B + (size_t)i * (size_t)n + k, (size_t)(n - k) * sizeof *B);
  memset (l->rigid, 1, (size_t)k);
  if (k >= 2) l->im[0] = fabs (l->twist[2]), l->im[1] = 0 - l->im[0]; /* translations; 0 - 0 is not -0 */
  int status = eigen_certain (x, n - k, B, l->re + k, l->im + k);
  free (B);
  if (status == PW_OK && x->modes) status = pw_linear_shapes (x, k, l);
  if (status == PW_RESOURCE) return status;
  eigen_sort (l);
  if (status == PW_OK) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: the eigenvalues of the linearisation cannot be computed", x->r->t);
}

/* ---- RK4 ---- */

/* |1 + z + z^2/2 + z^3/6 + z^4/24| <= 1, z = h (re + i im): a region within |z| < 4 (Hairer & Wanner 1996, section
 * IV.2).  For a growing solution only its frequency counts. */
static int rk4_stable (double re, double im, double h) {
  double x = h * fmin (re, 0), y = h * im, u = 1, v = 0;
  for (int k = 4; k > 0; k--) { /* u + i v = 1 + z (u + i v) / k */
    double real = x * u - y * v;
    v = (x * v + y * u) / k;
    u = 1 + real / k;
  }
  return hypot (u, v) <= 1 + 1e-12;
}

double pw_rk4_limit (double re, double im) {
  double size = hypot (fmin (re, 0), im), low = 0, high = 0;
  if (!(size > DBL_MIN)) return INFINITY; /* or a number that overflows */
  while (rk4_stable (re, im, high) && high * size < 4) low = high, high += 0.01 / size;
  for (int i = 0; i < 50; i++) {
    double middle = (low + high) / 2;
    *(rk4_stable (re, im, middle) ? &low : &high) = middle;
  }
  return low;
}
