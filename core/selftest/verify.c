/* The independent verifier: plain loops over elements, rows and columns; it shares only the element types with the
 * solvers.
 *
 * Each residual is divided by the sum of the absolute values of its terms, plus its unit formed from the run's
 * length L and time T, so that round-off is about 1e-16 in any units.  A position residual is divided by the size that its
 * element type states, at least L.  Forces are compared with the largest one in the scene, since those on a massless body may
 * all be round-off. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "system.h"
#include "pinwheel-selftest.h"

/* Residuals and the sizes of their terms. */
typedef struct {
  const pw_system *s;
  const pw_workspace *w;
  double *position, *velocity, *acceleration, *force;
  double *position_size, *velocity_size, *acceleration_size, *force_size;
  double *block; /* results of one function of an element type */
} verify;

/* Adds a term to a sum, and its absolute value to a size. */
static void verify_add (double *sum, double *size, double term) {
  *sum += term;
  *size += fabs (term);
}

/* Fills the block by a function of n numbers; NULL gives zeros. */
static const double *verify_evaluate (verify *x, const pw_element_batch *k, pw_batch_function *f, int n) {
  memset (x->block, 0, (size_t)n * sizeof *x->block);
  if (f) f (&k->b, x->block);
  return x->block;
}

/* Adds J v, J a and J^T lambda of a batch. */
static void verify_products (verify *x, const pw_element_batch *k, const double *v, const double *a,
                             const double *lambda) {
  int rows = k->kind->rows, cols = k->b.cols;
  const double *J = verify_evaluate (x, k, k->kind->J, k->b.count * rows * cols);
  for (int e = 0; e < k->b.count; e++)
    for (int r = 0; r < rows; r++)
      for (int c = 0; c < cols; c++, J++) {
        int i = k->row + e * rows + r, j = pw_global (k, e, c);
        if (j >= x->s->coords) continue;
        verify_add (&x->velocity[i], &x->velocity_size[i], *J * v[j]);
        verify_add (&x->acceleration[i], &x->acceleration_size[i], *J * a[j]);
        verify_add (&x->force[j], &x->force_size[j], *J * lambda[i]);
      }
}

static void verify_rows (verify *x, const pw_element_batch *k, const double *v, const double *a, const double *lambda) {
  const pw_kind *kind = k->kind;
  int n = k->b.count * kind->rows;
  verify_products (x, k, v, a, lambda);
  const double *y = verify_evaluate (x, k, kind->eta, n);
  for (int i = 0; i < n; i++) verify_add (&x->velocity[k->row + i], &x->velocity_size[k->row + i], -y[i]);
  y = verify_evaluate (x, k, kind->gamma, n);
  for (int i = 0; i < n; i++) verify_add (&x->acceleration[k->row + i], &x->acceleration_size[k->row + i], -y[i]);
  if (kind->level != PW_HOLONOMIC) return;
  y = verify_evaluate (x, k, kind->g, n);
  for (int i = 0; i < n; i++) x->position[k->row + i] = y[i];
  y = verify_evaluate (x, k, kind->g_size, n);
  for (int i = 0; i < n; i++) x->position_size[k->row + i] = fmax (y[i], x->w->scale.length);
}

static void verify_forces (verify *x, const pw_element_batch *k) {
  const double *y = verify_evaluate (x, k, k->kind->force, k->b.count * k->b.cols);
  for (int i = 0; i < k->b.count * k->b.cols; i++) {
    int j = pw_global (k, i / k->b.cols, i % k->b.cols);
    if (j < x->s->coords) verify_add (&x->force[j], &x->force_size[j], -y[i]);
  }
}

/* ---- Worst residuals ---- */

/* Sets the size of every coordinate to the largest force in the scene, but at least the largest mass times L / T^2;
 * moments are divided by L. */
static void verify_force_sizes (verify *x) {
  const pw_system *s = x->s;
  double L = x->w->scale.length, T = x->w->scale.time, largest = 0;
  for (int j = 0; j < s->coords; j++) {
    double unit = pw_is_angle (s, j) ? L : 1;
    largest = fmax (largest, fmax (x->force_size[j] / unit, s->mass[j] / (unit * unit) * L / (T * T)));
  }
  for (int j = 0; j < s->coords; j++) x->force_size[j] = pw_is_angle (s, j) ? largest * L : largest;
}

typedef char *verify_name (const pw_system *s, int i, char *buffer, size_t size);

/* The worst of n residuals; `unit` is added to each size. */
static void verify_worst (const pw_system *s, int n, const double *residual, const double *size, double unit,
                          verify_name *name, int first, pw_worst_residual *result) {
  int worst = -1;
  *result = (pw_worst_residual){ 0 };
  for (int i = 0; i < n; i++) {
    double error = fabs (residual[i]), scaled = error > 0 ? error / (size[i] + unit) : error;
    if (!isfinite (error)) error = scaled = INFINITY;
    result->absolute = fmax (result->absolute, error);
    if (worst >= 0 && scaled <= result->scaled) continue;
    result->scaled = scaled;
    worst = i;
  }
  if (worst >= 0) name (s, first + worst, result->name, sizeof result->name);
}

static void verify_all (verify *x, const double *v, const double *a, const double *lambda, pw_verification *result) {
  const pw_system *s = x->s;
  double L = x->w->scale.length, T = x->w->scale.time;
  for (int j = 0; j < s->coords; j++) verify_add (&x->force[j], &x->force_size[j], s->mass[j] * a[j]);
  for (int i = 0; i < s->batches; i++) {
    const pw_element_batch *k = &x->w->batch[i];
    if (k->kind->rows > 0) verify_rows (x, k, v, a, lambda);
    if (k->kind->force) verify_forces (x, k);
  }
  verify_force_sizes (x);
  verify_worst (s, s->holonomic, x->position, x->position_size, 0, pw_system_reaction_name, 0, &result->position);
  verify_worst (s, s->rows, x->velocity, x->velocity_size, L / T, pw_system_reaction_name, 0, &result->velocity);
  verify_worst (s, s->rows, x->acceleration, x->acceleration_size, L / (T * T), pw_system_reaction_name, 0,
                &result->acceleration);
  verify_worst (s, s->coords, x->force, x->force_size, 0, pw_system_state_name, s->coords, &result->force);
}

/* The largest array that a function of an element type in use fills. */
static size_t verify_block_size (const pw_system *s) {
  size_t largest = 1;
  for (int i = 0; i < s->batches; i++) {
    const pw_element_batch *k = &s->batch[i];
    size_t n = (size_t)k->b.count * (size_t)k->b.cols * (size_t)(k->kind->rows > 0 ? k->kind->rows : 1);
    if (n > largest) largest = n;
  }
  return largest;
}

int pw_verify (const pw_system *s, const pw_scale *scale, double t, const double *q, const double *v, const double *a,
               const double *lambda, pw_verification *result) {
  size_t rows = (size_t)s->rows, coords = (size_t)s->coords;
  verify x = { .s = s };
  const pw_array array[] = {
    { &x.position, rows },          { &x.velocity, rows },      { &x.acceleration, rows },
    { &x.force, coords },           { &x.position_size, rows }, { &x.velocity_size, rows },
    { &x.acceleration_size, rows }, { &x.force_size, coords },  { &x.block, verify_block_size (s) },
  };
  char *memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  pw_workspace *w = memory ? pw_workspace_new (s, NULL) : NULL;
  int status = PW_RESOURCE;
  if (w) {
    x.w = w;
    w->scale = *scale;
    status = pw_update_kinematics (w, t, q, v);
    if (status == PW_OK) verify_all (&x, v, a, lambda, result);
  }
  pw_workspace_free (w);
  free (memory);
  return status;
}
