/* The independent verifier: plain loops over elements, rows and columns; it shares only the element types and the
 * kinematics (configurations, signals) with the solvers.
 *
 * Residuals of velocities and accelerations are divided by the sum of the absolute values of their terms plus L / T or
 * L / T^2, with the length L and time T of the run, so that round-off is about 1e-16 in any units.  A position residual
 * is divided by the size that its element type states, at least L.  Residuals of forces are divided by the largest
 * force in the scene, since those on a massless body may all be round-off. */
#include <stdlib.h>
#include <string.h>
#include "system.h"
#include "pinwheel-selftest.h"

/* For each equation of a set: the residual, a sum of terms; its size, the sum of their absolute values or g_size. */
typedef struct {
  double *sum, *size;
} verify_terms;

typedef struct {
  const pw_system *s;
  const pw_workspace *workspace;
  verify_terms position, velocity, acceleration, force;
} verified_scene;

static void verify_add (const verify_terms *terms, int i, double term) {
  terms->sum[i] += term;
  terms->size[i] += fabs (term);
}

/* Fills n numbers by a function of an element type; NULL gives zeros. */
static const double *verify_evaluate (const pw_element_batch *k, pw_batch_function *f, double *out, int n) {
  memset (out, 0, (size_t)n * sizeof *out);
  if (f) f (&k->b, out);
  return out;
}

static void verify_products (verified_scene *scene, const pw_element_batch *k, const double *v, const double *a,
                             const double *lambda) {
  int rows = k->kind->rows, cols = k->b.cols;
  const double *J = verify_evaluate (k, k->kind->J, k->J, k->b.count * rows * cols);
  for (int e = 0; e < k->b.count; e++)
    for (int r = 0; r < rows; r++)
      for (int c = 0; c < cols; c++, J++) {
        int i = k->row + e * rows + r, j = pw_global (k, e, c);
        if (j >= scene->s->coords) continue;
        verify_add (&scene->velocity, i, *J * v[j]);
        verify_add (&scene->acceleration, i, *J * a[j]);
        verify_add (&scene->force, j, *J * lambda[i]);
      }
}

static void verify_rows (verified_scene *scene, const pw_element_batch *k, const double *v, const double *a,
                         const double *lambda) {
  const pw_kind *kind = k->kind;
  int n = k->b.count * kind->rows;
  verify_products (scene, k, v, a, lambda);
  double *scratch = scene->workspace->scratch;
  const double *y = verify_evaluate (k, kind->eta, scratch, n);
  for (int i = 0; i < n; i++) verify_add (&scene->velocity, k->row + i, -y[i]);
  y = verify_evaluate (k, kind->gamma, scratch, n);
  for (int i = 0; i < n; i++) verify_add (&scene->acceleration, k->row + i, -y[i]);
  if (kind->level != PW_HOLONOMIC) return;
  y = verify_evaluate (k, kind->g, scratch, n);
  for (int i = 0; i < n; i++) scene->position.sum[k->row + i] = y[i];
  y = verify_evaluate (k, kind->g_size, scratch, n);
  for (int i = 0; i < n; i++) scene->position.size[k->row + i] = fmax (y[i], scene->workspace->scale.length);
}

typedef char *verify_name (const pw_system *s, int i, char *buffer, size_t size);

/* The worst of n residuals; `unit` is added to each size.  name: names equation `first` + i. */
static void verify_worst (const pw_system *s, int n, const verify_terms *terms, double unit, verify_name *name,
                          int first, pw_worst_residual *result) {
  int worst = -1;
  *result = (pw_worst_residual){ 0 };
  for (int i = 0; i < n; i++) {
    double error = fabs (terms->sum[i]), scaled = error > 0 ? error / (terms->size[i] + unit) : error;
    if (!isfinite (error)) error = scaled = INFINITY;
    result->absolute = fmax (result->absolute, error);
    if (worst >= 0 && scaled <= result->scaled) continue;
    result->scaled = scaled;
    worst = i;
  }
  if (worst >= 0) name (s, first + worst, result->name, sizeof result->name);
}

static void verify_all (verified_scene *scene, const double *v, const double *a, const double *lambda,
                        pw_verification *result) {
  const pw_system *s = scene->s;
  double L = scene->workspace->scale.length, T = scene->workspace->scale.time, largest = 0;
  for (int j = 0; j < s->coords; j++) verify_add (&scene->force, j, (pw_is_hidden (s, j) ? 1 : s->M[j]) * a[j]);
  for (int i = 0; i < s->batches; i++) {
    const pw_element_batch *k = &scene->workspace->batch[i];
    if (k->kind->rows > 0) verify_rows (scene, k, v, a, lambda);
    const int n = k->kind->force ? k->b.count * k->b.cols : 0;
    const double *y = n > 0 ? verify_evaluate (k, k->kind->force, k->block, n) : NULL;
    for (int x = 0; x < n; x++) {
      int j = pw_global (k, x / k->b.cols, x % k->b.cols);
      if (j < s->coords) verify_add (&scene->force, j, -y[x]);
    }
  }
  /* The size of every force equation is the largest of their sums, but at least the largest mass times L / T^2; of
   * moments: L times as much. */
  for (int j = 0; j < s->coords; j++) {
    double unit = pw_is_angle (s, j) ? L : 1;
    largest = fmax (largest, fmax (scene->force.size[j] / unit, s->M[j] / (unit * unit) * L / (T * T)));
  }
  for (int j = 0; j < s->coords; j++) scene->force.size[j] = pw_is_angle (s, j) ? largest * L : largest;
  verify_worst (s, s->holonomic, &scene->position, 0, pw_system_reaction_name, 0, &result->position);
  verify_worst (s, s->rows, &scene->velocity, L / T, pw_system_reaction_name, 0, &result->velocity);
  verify_worst (s, s->rows, &scene->acceleration, L / (T * T), pw_system_reaction_name, 0, &result->acceleration);
  verify_worst (s, s->coords, &scene->force, 0, pw_system_state_name, s->coords, &result->force);
}

int pw_verify (const pw_system *s, const pw_scale *scale, double t, const double *q, const double *v, const double *a,
               const double *lambda, pw_verification *result) {
  if (s == NULL) return PW_INPUT;
  size_t rows = (size_t)s->rows, coords = (size_t)s->coords;
  verified_scene scene = { .s = s };
  char *memory = PW_ALLOC_ARRAYS (PW_ARRAY (scene.position.sum, rows), PW_ARRAY (scene.position.size, rows),
                                  PW_ARRAY (scene.velocity.sum, rows), PW_ARRAY (scene.velocity.size, rows),
                                  PW_ARRAY (scene.acceleration.sum, rows), PW_ARRAY (scene.acceleration.size, rows),
                                  PW_ARRAY (scene.force.sum, coords), PW_ARRAY (scene.force.size, coords));
  pw_workspace *w = memory ? pw_workspace_new (s, NULL) : NULL;
  int status = PW_RESOURCE;
  if (w) {
    scene.workspace = w;
    w->scale = *scale;
    status = pw_update_kinematics (w, t, q, v);
    if (status == PW_OK) verify_all (&scene, v, a, lambda, result);
  }
  pw_workspace_free (w);
  free (memory);
  return status;
}
