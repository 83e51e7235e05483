/* Serial vectors for SUNDIALS with faster operations, for adams, bdf and ida.  A step of high order adds dozens of
 * vectors of a dozen entries, in libraries that distributions may build without optimisation.  These operations are
 * plain loops, including the fused operations on several vectors.
 *
 * Linear sums round like those of SUNDIALS, except that SUNDIALS computes a x + a y as a (x + y) and a x - a y as
 * a (x - y); norms add even and odd entries separately. */
#include <math.h>
#include "sundials.h"
#include "unroll.h"

/* z = a x + b y; four entries are read before they are written, so z may be x or y. */
PW_INLINE void vectors_sum (sunindextype n, double a, const double *x, double b, const double *y, double *z) {
  sunindextype i = 0;
  for (; i + 3 < n; i += 4) {
    double z0 = a * x[i] + b * y[i], z1 = a * x[i + 1] + b * y[i + 1];
    double z2 = a * x[i + 2] + b * y[i + 2], z3 = a * x[i + 3] + b * y[i + 3];
    z[i] = z0, z[i + 1] = z1, z[i + 2] = z2, z[i + 3] = z3;
  }
  for (; i < n; i++) z[i] = a * x[i] + b * y[i];
}

/* vz = a vx + b vy; the inlined copies have no multiplications by 1. */
static void vectors_linear_sum (realtype a, N_Vector vx, realtype b, N_Vector vy, N_Vector vz) {
  const double *x = NV_DATA_S (vx), *y = NV_DATA_S (vy);
  double *z = NV_DATA_S (vz);
  if (a == 1 && b == 1)
    vectors_sum (NV_LENGTH_S (vz), 1, x, 1, y, z);
  else if (b == 1)
    vectors_sum (NV_LENGTH_S (vz), a, x, 1, y, z);
  else if (a == 1)
    vectors_sum (NV_LENGTH_S (vz), 1, x, b, y, z);
  else
    vectors_sum (NV_LENGTH_S (vz), a, x, b, y, z);
}

static void vectors_scale (realtype c, N_Vector vx, N_Vector vz) {
  sunindextype i = 0, n = NV_LENGTH_S (vz);
  const double *x = NV_DATA_S (vx);
  double *z = NV_DATA_S (vz);
  for (; i + 1 < n; i += 2) {
    double z0 = c * x[i], z1 = c * x[i + 1];
    z[i] = z0, z[i + 1] = z1;
  }
  for (; i < n; i++) z[i] = c * x[i];
}

static void vectors_const (realtype c, N_Vector vz) {
  double *z = NV_DATA_S (vz);
  for (sunindextype i = 0, n = NV_LENGTH_S (vz); i < n; i++) z[i] = c;
}

/* z = sum_k c_k x_k */
static int vectors_combine (int count, realtype *c, N_Vector *x, N_Vector z) {
  if (count == 1)
    vectors_scale (c[0], x[0], z);
  else
    vectors_linear_sum (c[0], x[0], c[1], x[1], z);
  for (int k = 2; k < count; k++) vectors_linear_sum (c[k], x[k], 1, z, z);
  return 0;
}

/* z_k = a_k x + y_k */
static int vectors_add_to (int count, realtype *a, N_Vector x, N_Vector *y, N_Vector *z) {
  for (int k = 0; k < count; k++) vectors_linear_sum (a[k], x, 1, y[k], z[k]);
  return 0;
}

static int vectors_scale_each (int count, realtype *c, N_Vector *x, N_Vector *z) {
  for (int k = 0; k < count; k++) vectors_scale (c[k], x[k], z[k]);
  return 0;
}

/* ---- Norms ---- */

/* sqrt (sum (x_i w_i)^2 / n), with the n of all entries; unless id is NULL, the sum is over id_i > 0 only. */
PW_INLINE double vectors_root_mean_square (N_Vector vx, N_Vector vw, const double *id) {
  sunindextype i = 0, n = NV_LENGTH_S (vx);
  const double *x = NV_DATA_S (vx), *w = NV_DATA_S (vw);
  double even = 0, odd = 0;
  for (; i + 1 < n; i += 2) {
    double p = x[i] * w[i], q = x[i + 1] * w[i + 1];
    if (id == NULL || id[i] > 0) even += p * p;
    if (id == NULL || id[i + 1] > 0) odd += q * q;
  }
  if (i < n && (id == NULL || id[i] > 0)) even += x[i] * w[i] * (x[i] * w[i]);
  return sqrt ((even + odd) / (double)n);
}

static realtype vectors_norm (N_Vector x, N_Vector w) {
  return vectors_root_mean_square (x, w, NULL);
}

static realtype vectors_norm_masked (N_Vector x, N_Vector w, N_Vector id) {
  return vectors_root_mean_square (x, w, NV_DATA_S (id));
}

N_Vector pw_sun_vector (sunindextype length, SUNContext context) {
  N_Vector v = N_VNew_Serial (length, context);
  if (v == NULL) return NULL;
  v->ops->nvlinearsum = vectors_linear_sum;
  v->ops->nvscale = vectors_scale;
  v->ops->nvconst = vectors_const;
  v->ops->nvlinearcombination = vectors_combine;
  v->ops->nvscaleaddmulti = vectors_add_to;
  v->ops->nvscalevectorarray = vectors_scale_each;
  v->ops->nvwrmsnorm = vectors_norm;
  v->ops->nvwrmsnormmask = vectors_norm_masked;
  return v;
}
