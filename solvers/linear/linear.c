/* Mobility and linearisation of a run at the state reached; equations in linear_variation.c. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linear.h"
#include "util.h"

/* Column c of A: z' and u' for a variation along minimal coordinate c (linear_variation.c). */
static void linear_column_of_A (pw_linearisation *x, int c) {
  double *dq = x->dx, *dv = x->dx + x->n, w = x->frame.twist[2];
  pw_linear_tangent (x, c);
  pw_linear_vary (x);
  pw_linear_turn (x, -w, dv, x->da); /* da becomes da - W dv, */
  pw_linear_turn (x, -w, dq, dv);    /* then dv becomes dv - W dq */
  pw_linear_coordinates (x, dv, x->da, x->size, x->A + c);
}

/* bases: 1, or 0 without room for R and Q. */
static int linear_arrays (pw_linearisation *x, size_t bases) {
  size_t n = (size_t)x->n, m = (size_t)x->m, size = (size_t)x->size;
  const pw_array array[] = { { &x->a, n + 3 },
                             { &x->lambda, m },
                             { &x->norm, m },
                             { &x->R, bases * m * n },
                             { &x->Q, bases * n * n },
                             { &x->dx, 2 * n },
                             { &x->product, n + 2 * m },
                             { &x->da, n + 3 },
                             { &x->scratch, n + 3 * m + 3 },
                             { &x->row_scratch, m },
                             { &x->symmetry, 3 * size },
                             { &x->later, 2 * n },
                             { &x->probe, 2 * n },
                             { &x->probe_a, n },
                             { &x->probe_da, n },
                             { &x->residual, 4 * (2 * m + n) + PW_LINEAR_SVD_WORK },
                             { &x->left_vectors, x->modes ? size * size + size : 0 },
                             { &x->upper_rows, 4 * size } };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return x->memory ? PW_OK : PW_RESOURCE;
}

void pw_linear_close (pw_linearisation *x) {
  pw_tangent_close (&x->tangent);
  free (x->memory);
}

static int linear_results (pw_linearisation *x, pw_linear *l) {
  size_t size = (size_t)x->size;
  l->A = malloc ((size * size + 1) * sizeof *l->A);
  l->re = calloc (2 * size + 1, sizeof *l->re);
  l->rigid = calloc (size + 1, 1);
  if (l->A == NULL || l->re == NULL || l->rigid == NULL) return PW_RESOURCE;
  l->im = l->re + size;
  x->A = l->A;
  return PW_OK;
}

int pw_linear_open (pw_linearisation *x, pw_run *r, pw_linear_extent extent) {
  *x = (pw_linearisation){ .r = r, .n = r->s->coords, .m = r->s->rows, .modes = extent == PW_LINEAR_MODES };
  int status = pw_tangent_open (&x->tangent, r);
  x->holonomic = x->tangent.holonomic, x->rank = x->tangent.rows, x->row = x->tangent.row;
  for (int j = 0; j < x->n; j++) x->unturned += pw_is_unturned (r->s, j);
  x->positions = x->n - x->unturned - x->holonomic;
  x->velocities = x->n - x->unturned - x->rank;
  x->size = x->positions + x->velocities;
  if (status != PW_OK || extent == PW_LINEAR_COUNTS) return status;
  status = linear_arrays (x, extent >= PW_LINEAR_BASES);
  return status == PW_OK ? pw_linear_derivatives (x) : status;
}

/* In units of the scene: two changes of a state, and the least change of the accelerations that counts as a jump. */
static const double LINEAR_FAR = 1e-6, LINEAR_NEAR = 1e-8, LINEAR_JUMP = 1e-6;

/* The change of the accelerations, in units of the scene, if state j changes by `part` of its unit; DBL_MAX if they
 * cannot be computed then.  Leaves the workspace at the changed state. */
static double linear_change (pw_linearisation *x, int j, double part) {
  pw_run *r = x->r;
  int n = x->n;
  double T = r->w->scale.time, most = 0, *q = x->dx, *v = q + n, *lambda = x->scratch;
  memcpy (q, r->q, (size_t)n * sizeof *q);
  memcpy (v, r->v, (size_t)n * sizeof *v);
  *(j < n ? q + j : v + j - n) += part * pw_unit (r->s, j % n) / (j < n ? 1 : T);
  if (pw_run_accelerate (r, r->t, q, v, x->da, lambda) != PW_OK) return DBL_MAX;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (x->da[i] - x->a[i]) * T * T / pw_unit (r->s, i));
  return most;
}

/* The first state with which accelerations jump: if it changes less, they change as much.  -1: none. */
static int linear_jump (pw_linearisation *x) {
  if (!pw_system_may_jump (x->r->s)) return -1;
  for (int j = 0; j < 2 * x->n; j++)
    for (int side = -1; side <= 1; side += 2) {
      double change = linear_change (x, j, side * LINEAR_FAR);
      if (change > LINEAR_JUMP && linear_change (x, j, side * LINEAR_NEAR) > change / 2) return j;
    }
  return -1;
}

/* Computes all but the counts.  Leaves the workspace at the current state. */
static int linear_compute (pw_linearisation *x, pw_linear *l, pw_error *error) {
  pw_run *r = x->r;
  int status = pw_linear_evaluate (x, r->t, r->q, r->v);
  if (status != PW_OK)
    return status > 0 ? pw_fail_singular (r, r->t, error)
                      : pw_run_annotate_error (r, pw_fail_signal (r->t, error), error);
  l->least = pw_linear_least (x);
  pw_linear_bases (x);
  int jump = linear_jump (x);
  if (pw_system_may_jump (r->s)) (void)pw_linear_evaluate (x, r->t, r->q, r->v);
  if (jump >= 0)
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: accelerations jump with %s at this state, or fail beside it: it has no linearisation",
                    r->t, PW_NAME (pw_system_state_name, r->s, jump));
  pw_linear_choose_frame (x);
  if (linear_results (x, l) != PW_OK) return PW_RESOURCE;
  for (int c = 0; c < x->size; c++) linear_column_of_A (x, c);
  if (x->modes && pw_linear_matrices (x, l) != PW_OK) return PW_RESOURCE;
  l->symmetries = pw_linear_symmetries (x);
  memcpy (l->twist, x->frame.twist, sizeof l->twist);
  l->acceleration = x->frame.acceleration;
  status = pw_linear_eigenvalues (x, l, error);
  if (status == PW_OK) l->steady = pw_linear_steady (x);
  return status;
}

/* With more than `most` coordinates only the counts. */
static int linear_run (pw_run *r, int most, pw_linear_extent extent, pw_linear *l, pw_error *error) {
  pw_linearisation x;
  *l = (pw_linear){ .least = NAN };
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->s->coords > most) extent = PW_LINEAR_COUNTS;
  pw_statistics before = r->statistics;
  int near_singular = r->near_singular, status = pw_linear_open (&x, r, extent);
  l->coordinates = x.n, l->rank = x.rank;
  l->positions = x.positions, l->velocities = x.velocities, l->unknowns = x.size;
  if (status == PW_OK && extent > PW_LINEAR_COUNTS)
    status = pw_run_check_derivatives (r, "the linearisation", "needs", error);
  if (status == PW_OK && extent > PW_LINEAR_COUNTS) status = linear_compute (&x, l, error);
  pw_linear_close (&x);
  if (status != PW_OK) pw_linear_free (l); /* eigenvalues that fail leave A */
  r->statistics = before;
  r->near_singular = near_singular;
  return status == PW_RESOURCE ? pw_fail_memory (r->s, error) : status;
}

int pw_run_linearise (pw_run *r, int most, pw_linear *l, pw_error *error) {
  return linear_run (r, most, PW_LINEAR_BASES, l, error);
}

int pw_run_linear_modes (pw_run *r, int most, pw_linear *l, pw_error *error) {
  return linear_run (r, most, PW_LINEAR_MODES, l, error);
}

void pw_linear_free (pw_linear *l) {
  free (l->B);
  free (l->basis);
  free (l->shape);
  free (l->A);
  free (l->re);
  free (l->rigid);
  l->A = l->re = l->im = l->B = l->basis = l->shape = NULL;
  l->rigid = NULL;
}
