/* Serial vectors for SUNDIALS with faster operations, for adams, bdf and ida.  A step of high order adds dozens of
 * vectors of a dozen entries, in libraries that distributions may build without optimisation.  These operations are
 * plain loops, including the fused operations on several vectors.  They round like those of SUNDIALS, except that
 * SUNDIALS computes a x + a y as a (x + y) and a x - a y as a (x - y). */
#include <math.h>
#include "sundials.h"

static void vectors_linear_sum (realtype a, N_Vector vx, realtype b, N_Vector vy, N_Vector vz) {
  const double *x = NV_DATA_S (vx), *y = NV_DATA_S (vy);
  double *z = NV_DATA_S (vz);
  for (sunindextype i = 0, n = NV_LENGTH_S (vz); i < n; i++) z[i] = a * x[i] + b * y[i];
}

static void vectors_scale (realtype c, N_Vector vx, N_Vector vz) {
  const double *x = NV_DATA_S (vx);
  double *z = NV_DATA_S (vz);
  for (sunindextype i = 0, n = NV_LENGTH_S (vz); i < n; i++) z[i] = c * x[i];
}

/* z = sum_k c_k x_k */
static int vectors_combine (int count, realtype *c, N_Vector *x, N_Vector z) {
  vectors_scale (c[0], x[0], z);
  for (int k = 1; k < count; k++) vectors_linear_sum (c[k], x[k], 1, z, z);
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

/* sqrt (sum (x_i w_i)^2 / n), with the n of all entries; unless id is NULL, the sum is over id_i > 0 only. */
static double vectors_root_mean_square (N_Vector vx, N_Vector vw, const double *id) {
  const sunindextype n = NV_LENGTH_S (vx);
  const double *x = NV_DATA_S (vx), *w = NV_DATA_S (vw);
  double sum = 0;
  for (sunindextype i = 0; i < n; i++)
    if (id == NULL || id[i] > 0) sum += x[i] * w[i] * (x[i] * w[i]);
  return sqrt (sum / (double)n);
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
  v->ops->nvlinearcombination = vectors_combine;
  v->ops->nvscaleaddmulti = vectors_add_to;
  v->ops->nvscalevectorarray = vectors_scale_each;
  v->ops->nvwrmsnorm = vectors_norm;
  v->ops->nvwrmsnormmask = vectors_norm_masked;
  return v;
}
