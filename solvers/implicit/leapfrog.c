/* leapfrog: the reversible leapfrog method for constrained systems, explicit in position-dependent forces, fixed step.
 * From t to t' = t + h, with u the velocities at half the step and (q*, t*) the mean of both ends,
 *
 *   M (u - v)  = h/2 (f (t, q, v) - J (q)^T lambda+)         g (t', q') = 0,    S (t*, q*) u = b (t*, q*)
 *   q' - q     = h u
 *   M (v' - u) = h/2 (f (t', q', v') - J (q')^T lambda-)     J (t', q') v' = eta (t', q')
 *
 * with S and b the nonholonomic rows of J and eta.  For holonomic constraints this is RATTLE (Andersen 1983, Rattle: a
 * "velocity" version of the Shake algorithm for molecular dynamics calculations); for nonholonomic constraints the
 * discrete Lagrange-d'Alembert principle (Cortés & Martínez 2001, Non-holonomic integrators) with a discrete constraint
 * that is symmetric in both ends, which makes the method reversible (McLachlan & Perlmutter 2006, Integrators for
 * nonholonomic mechanical systems).  Exchanging both ends and h with -h gives the same equations: the method is
 * symmetric, hence of order 2, and with forces even in the velocities it retraces the motion when they are reversed.
 * lambda+ and lambda- are internal to the step; the reported accelerations and multipliers solve the equations of
 * motion at its end.
 *
 * All equations are solved to round-off: for u and q' by Newton's iteration, for v' and velocity-dependent forces by
 * fixed-point iteration.  M^-1 is not needed: massless coordinates follow from their constraint equations. */
#include <stdlib.h>
#include "implicit.h"

enum { DRIFT_MOST = 30, KICK_MOST = 100 }; /* Newton iterations for u; fixed-point iterations for v' */

struct pw_method_data {
  pw_implicit common;          /* first */
  double *u;                   /* coords + 3: velocities at half the step */
  double *middle;              /* coords + 3: q*; in the second half: changes of impulses */
  double *dv, *f;              /* coords + 3: corrections of v', forces */
  double *residual, *mu, *eta; /* all equations: residuals; multipliers of a correction of v'; eta or g */
  double *z;                   /* coords and independent equations: a correction of u and its multipliers */
};

/* Convergence of an iteration, from the sizes of its corrections. */
typedef struct {
  double size;    /* of the last correction: the largest relative change of a coordinate (kick: velocity) */
  double largest; /* the largest of these in units of the scene: its round-off may affect others */
  double before;  /* size of the previous correction */
  double rate;    /* ratio of the last size to the previous one */
  int done;       /* corrections before the last one */
} leapfrog_progress;

/* Updates size and largest, initially 0 and 1, for the correction of one coordinate.  Its size is relative to `value`,
 * which is the same in all iterations: relative to a growing value, corrections that diverge would stay small. */
static inline void leapfrog_measure (leapfrog_progress *p, double correction, double value, double unit) {
  p->size = pw_larger_or_nan (p->size, fabs (correction) / (fabs (value) + unit));
  p->largest = fmax (p->largest, fabs (value) / unit);
}

/* Converged: to round-off; or all further corrections together would be below a quarter of it; or corrections stall at
 * what small masses or lengths make of the round-off of the largest coordinate, `magnified`. */
static pw_convergence leapfrog_test (leapfrog_progress *p) {
  const double rounding = 2 * DBL_EPSILON, magnified = 1e4 * DBL_EPSILON;
  p->rate = p->done > 0 ? p->size / p->before : 1;
  if (!isfinite (p->size)) return PW_DIVERGED;
  if (p->size <= rounding || (p->rate < 1 && p->size * p->rate / (1 - p->rate) <= 0.25 * rounding)) return PW_CONVERGED;
  if (p->rate > 0.5 && p->size <= magnified * p->largest) return PW_CONVERGED;
  if (p->done > 3 && p->rate > 2) return PW_DIVERGED;
  p->before = p->size;
  p->done++;
  return PW_ITERATE;
}

/* First half (drift): u and q', by Newton's iteration.  The unknowns are u and L = h/2 (lambda+ - lambda):
 *
 *   M (u - v - h/2 a) + J (q)^T L = 0        a, lambda: accelerations and multipliers at (t, q, v)
 *   g (t', q + h u) / h = 0                  S (t*, q*) u - b (t*, q*) = 0,   q* = q + h/2 u
 *
 * The first line is linear: it holds for the initial u = v + h/2 a, L = 0, and after every correction. */

/* q' and q* from u. */
static void drift_positions (pw_run *r, double h) {
  pw_method_data *d = r->data;
  for (int j = 0; j < r->s->coords; j++) {
    d->common.q1[j] = r->q[j] + h * d->u[j];
    d->middle[j] = r->q[j] + 0.5 * h * d->u[j];
  }
}

/* Adds M and J^T; kinematics and J must be those of the beginning of the step. */
static void drift_put_momentum (pw_run *r) {
  pw_tangent *x = &r->data->common.dae.tangent;
  const pw_system *s = r->s;
  for (int j = 0; j < s->coords; j++) pw_scatter_add (&x->scatter, j, j, s->mass[j]);
  pw_tangent_add_JT (
      x, &(pw_placement){
             .col = s->coords, .rows = s->rows, .factor = 1, .factor_nonholonomic = 1, .row_index = x->row_index });
}

/* Adds S + h/2 ((S u)_q - b_q); kinematics and J must be those at (t*, q*). */
static void drift_put_middle (pw_run *r, double h) {
  pw_tangent *x = &r->data->common.dae.tangent;
  const int first = r->s->coords;
  pw_tangent_add_equations (x, PW_JW_Q, first, 0, r->data->u, 0, 0.5 * h);
  pw_tangent_add_equations (x, PW_ETA_Q, first, 0, NULL, 0, -0.5 * h);
  pw_tangent_add_J (x, r->s->rows, first, 0, 0, 1);
  pw_tangent_add_feedback (x, &(pw_feedback){ first, 0, 0, 1, 0.5 * h, x->row_index, .w = r->data->u });
}

/* Adds the holonomic rows of J; kinematics and J must be those of the end of the step. */
static void drift_put_end (pw_run *r) {
  pw_tangent_add_J (&r->data->common.dae.tangent, r->s->holonomic, r->s->coords, 0, 1, 0);
}

static int drift_factor (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  pw_scatter_map *matrix = &d->common.dae.tangent.scatter;
  pw_scatter_begin_fill (matrix, matrix->value);
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  drift_put_momentum (r);
  status = pw_evaluate_J_at (r->w, r->t + 0.5 * h, d->middle, d->u);
  if (status != PW_OK) return status;
  drift_put_middle (r, h);
  status = pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t1), d->common.q1, d->u);
  if (status != PW_OK) return status;
  drift_put_end (r);
  r->statistics.jacobians++;
  r->statistics.factorisations++;
  return pw_sparse_factor (&d->common.sparse, matrix->value);
}

/* Residuals of the constraints on u and q'. */
static int drift_residual (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  const pw_system *s = r->s;
  int status = PW_OK;
  if (s->rows > s->holonomic) {
    status = pw_evaluate_J_at (r->w, r->t + 0.5 * h, d->middle, d->u);
    if (status != PW_OK) return status;
    pw_mul_J (r->w, d->u, d->residual);
    pw_evaluate_eta (r->w, d->eta);
    for (int i = s->holonomic; i < s->rows; i++) d->residual[i] -= d->eta[i];
  }
  if (s->holonomic > 0) {
    status = pw_update_kinematics (r->w, pw_before_breakpoint (r, t1), d->common.q1, d->u);
    if (status != PW_OK) return status;
    pw_evaluate_g (r->w, d->eta);
    for (int i = 0; i < s->holonomic; i++) d->residual[i] = d->eta[i] / h;
  }
  r->statistics.rhs++;
  return PW_OK;
}

/* One correction of u; its size is that of the correction of q'.  PW_OK or PW_RESOURCE. */
static int drift_correct (pw_run *r, double h, leapfrog_progress *p) {
  pw_method_data *d = r->data;
  int n = r->s->coords;
  memset (d->z, 0, (size_t)n * sizeof *d->z);
  for (int i = 0; i < r->s->rows; i++) d->residual[i] = -d->residual[i];
  pw_tangent_compress (&d->common.dae.tangent, d->residual, d->common.dae.tangent.rows, d->z + n);
  if (pw_sparse_solve (&d->common.sparse, d->z) != PW_OK) return PW_RESOURCE;
  p->size = 0, p->largest = 1;
  for (int j = 0; j < n; j++) {
    d->u[j] += d->z[j];
    if (j < r->s->mechanical) leapfrog_measure (p, h * d->z[j], r->q[j], pw_unit (r->s, j));
  }
  drift_positions (r, h);
  return PW_OK;
}

/* The matrix is evaluated at the prediction, and again while convergence is slow. */
static int drift_solve (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  leapfrog_progress p = { .rate = 1 };
  for (int j = 0; j < r->s->coords; j++) d->u[j] = r->v[j] + 0.5 * h * r->a[j];
  drift_positions (r, h);
  pw_convergence convergence = r->s->rows == 0 ? PW_CONVERGED : PW_ITERATE;
  for (int i = 0; i < DRIFT_MOST && convergence == PW_ITERATE; i++) {
    int refactor = i == 0 || (i > 1 && p.rate > 0.02), status = refactor ? drift_factor (r, h, t1) : PW_OK;
    if (status == PW_OK) status = drift_residual (r, h, t1);
    if (status == PW_OK) status = drift_correct (r, h, &p);
    if (status != PW_OK) return status;
    convergence = leapfrog_test (&p);
  }
  return convergence == PW_CONVERGED ? PW_OK : PW_RETRY;
}

/* One correction of v', for the change of the forces since the last correction; d->f: those forces, at first 0.
 * PW_METHOD if a signal failed. */
static int kick_correct (pw_run *r, double h, leapfrog_progress *p) {
  pw_method_data *d = r->data;
  const pw_system *s = r->s;
  int status = pw_update_velocities (r->w, d->common.v1);
  if (status != PW_OK) return status;
  pw_evaluate_force (r->w, d->middle);
  if (r->forces == PW_FORCES_AT_LIMITS) pw_add_given_forces (r, d->middle);
  for (int j = 0; j < s->coords; j++) {
    double f = d->middle[j];
    d->middle[j] = 0.5 * h * (f - d->f[j]);
    d->f[j] = f;
  }
  pw_mul_J (r->w, d->common.v1, d->residual);
  pw_evaluate_eta (r->w, d->eta);
  for (int i = 0; i < s->rows; i++) d->residual[i] = d->eta[i] - d->residual[i];
  pw_saddle_solve (r->saddle, d->middle, d->residual, d->dv, d->mu);
  p->size = 0, p->largest = 1;
  for (int j = 0; j < s->coords; j++) {
    d->common.v1[j] += d->dv[j];
    leapfrog_measure (p, d->dv[j], d->u[j], pw_velocity_unit (r, j, d->u[j]));
  }
  return PW_OK;
}

static int kick_solve (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  leapfrog_progress p = { 0 };
  int status = pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t1), d->common.q1, d->u);
  if (status != PW_OK) return status;
  r->statistics.factorisations++;
  status = pw_saddle_factor (r->saddle);
  if (status != PW_OK || pw_watchdog_near (r)) r->near_singular = 1;
  if (status != PW_OK) return status;
  memcpy (d->common.v1, d->u, (size_t)r->s->coords * sizeof *d->common.v1);
  memset (d->f, 0, (size_t)r->s->coords * sizeof *d->f);
  pw_convergence convergence = PW_ITERATE;
  for (int i = 0; i < KICK_MOST && convergence == PW_ITERATE; i++) {
    status = kick_correct (r, h, &p);
    if (status != PW_OK) return status;
    convergence = leapfrog_test (&p);
  }
  return convergence == PW_CONVERGED ? pw_update_velocities (r->w, d->common.v1) : PW_RETRY;
}

/* The kick has fixed constraints: their signals must not depend on the states that it changes.  Its impulses are those
 * of the symmetric equations, without friction that depends on them. */
static int leapfrog_check_feedback (const pw_run *r, pw_error *error) {
  for (int i = 0; r->s->limit && i < r->s->rows; i++)
    if (r->s->limit[i].relative)
      return pw_fail (error, PW_INPUT, "leapfrog: the friction of %s depends on a reaction; use galpha or rk4",
                      PW_NAME (pw_system_row_name, r->s, i));
  for (const pw_source *source = r->s->source, *end = source + r->s->sources; source < end; source++)
    for (int i = 0; source->feedback && i < source->reads; i++)
      if (source->state[i] >= r->s->coords)
        return pw_fail (error, PW_INPUT,
                        "leapfrog: the signal of a constraint depends on the first-order state %s; use galpha or rk4",
                        PW_NAME (pw_system_state_name, r->s, source->state[i]));
  return PW_OK;
}

static int leapfrog_open (pw_run *r, pw_error *error) {
  if (leapfrog_check_feedback (r, error) != PW_OK) return PW_INPUT;
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  size_t n = (size_t)r->s->coords + 3, rows = (size_t)r->s->rows;
  if (d == NULL) return pw_fail_memory (r->s, error);
  d->common.last.arrays =
      PW_ALLOC_ARRAYS (PW_ARRAY (d->u, n), PW_ARRAY (d->common.q1, n), PW_ARRAY (d->common.v1, n),
                       PW_ARRAY (d->middle, n), PW_ARRAY (d->dv, n), PW_ARRAY (d->f, n), PW_ARRAY (d->residual, rows),
                       PW_ARRAY (d->mu, rows), PW_ARRAY (d->eta, rows), PW_ARRAY (d->z, n + rows));
  int status = d->common.last.arrays ? pw_dae_open (&d->common.dae, r) : PW_RESOURCE;
  pw_tangent *x = &d->common.dae.tangent;
  const int size = r->s->coords + x->rows;
  if (status == PW_OK) { /* the pattern of the matrix */
    pw_scatter_begin_record (&x->scatter);
    drift_put_momentum (r);
    drift_put_middle (r, 1); /* any step size but 0 */
    drift_put_end (r);
    status = pw_scatter_lay_out (&x->scatter, size);
  }
  return pw_implicit_complete (r, status, size, PW_DENSE_POSITIONS_AND_VELOCITIES, error);
}

static int leapfrog_step (pw_run *r, double h, double t1) {
  int status = drift_solve (r, h, t1);
  return status == PW_OK ? kick_solve (r, h, t1) : status;
}

static void leapfrog_accept (pw_run *r) {
  pw_run_accelerate_updated (r, r->v, r->a, r->lambda);
}

static int leapfrog_advance (pw_run *r, double t_end, pw_error *error) {
  return pw_implicit_advance (r, t_end, leapfrog_step, leapfrog_accept, error);
}

const pw_method pw_method_leapfrog = {
  .name = "leapfrog",
  .about = "reversible leapfrog of order 2, fixed step, for long runs (Andersen 1983, McLachlan & Perlmutter 2006)",
  .order = 2,
  .stabilisations =
      (const pw_stabilisation[]){
          { "rattle", "positions and velocities both enforced by the step's own multipliers (Andersen 1983)",
            PW_RATTLE },
          { .name = NULL },
      },
  .options = (const pw_option[]){ { .name = NULL } },
  .open = leapfrog_open,
  .advance = leapfrog_advance,
  .at = pw_step_at,
  .restart = pw_step_restart,
  .close = pw_implicit_close,
  .serialise = pw_step_serialise,
};
