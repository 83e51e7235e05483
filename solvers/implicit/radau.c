/* radau: the Radau IIA method of order 5 with three stages, with step-size control (Hairer & Wanner 1996, Solving
 * Ordinary Differential Equations II, section IV.8; in index 2 and 3: chapter VII, and Hairer, Lubich & Roche 1989).
 * With y = (q, v, lambda, mu) the equations B y' = F (t, y) are
 *
 *   q' = v - D G^T mu,   M v' = f - J^T lambda
 *   ggl       0 = eta - J v,   0 = -g
 *   index2    0 = eta - J v,             mu = 0
 *   index3    0 = -g,   0 = b - S v,     mu = 0
 *
 * with G the holonomic rows of J, S and b the nonholonomic rows of J and eta, D as in dae.h, B = diag (1, M, 0).  The
 * stages y + Z_i at t + c_i h satisfy  B sum_j (A^-1)_ij Z_j = h F (t + c_i h, y + Z_i);  the last one is the new
 * state.  T^-1 A^-1 T = diag (gamma, [ alpha -beta ; beta alpha ]) decouples Newton's equations for W, Z = T W:
 *
 *   (gamma/h B - F_y) dW_1 = r_1,    ((alpha + i beta)/h B - F_y) (dW_2 + i dW_3) = r_2 + i r_3
 *
 * with F_y at y: a real and a complex sparse matrix.  F_y is reused while corrections are on average less than a
 * hundredth of the previous ones, its factors while in addition the step size stays the same.  The error estimate is
 *
 *   err = (gamma/h B - F_y)^-1 (F (t, y) + B sum_i e_i Z_i / h)            of order h^4
 *
 * in units of tolerances of 0.05 rtol^(2/3), which makes the error of the method, of order 5, about proportional to
 * rtol.  Multipliers are not tested.  The step size follows from the errors of this and the previous step (Gustafsson
 * 1994).
 *
 * Accelerations and multipliers at the ends of steps and in samples are computed from positions and velocities, which
 * are more accurate than the multipliers of the stages.  Work and losses are integrated with the stages. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"
#include "radau_state.h"
#include "util.h"

enum { STAGES = PW_RADAU_STAGES };

#define RADAU_REUSE_CONTRACTION 1e-2 /* `contraction` up to which F_y is reused */
#define RADAU_REUSE_GROWTH 1.2 /* growth up to which the step size is not changed, so that the factors are reused */
#define RADAU_SIGNAL_STEP 1e-4 /* step in units of the time scale below which a signal that fails ends the run */

/* The last row of A^-1: derivatives at the end of a step. */
static const double radau_derivative_at_end[STAGES] = { 5.53197264742180826186, -7.53197264742180826186, 5 };

/* ---- Opening ---- */

/* Round-off of the largest coordinate may affect others; at the sine s, solutions magnify it by 1/s^2.  r->saddle must
 * be factorised at the state reached. */
static void radau_measure_noise (pw_run *r) {
  double sine = pw_saddle_sine (r->saddle, NULL), largest = 1;
  for (int j = 0; j < r->s->coords; j++) largest = fmax (largest, fabs (r->q[j]) / pw_unit (r->s, j));
  r->data->noise = fmin (64 / (sine * sine), 1e7) * largest;
}

static int radau_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  double time_scale = r->w->scale.time;
  (void)error;
  d->counter = (pw_step_counter){ .base = r->t };
  d->last.t = r->t;
  d->previous_h = d->last.h = 0;
  d->remaining = 1;
  d->renew_F_y = 1;
  d->F_y_at_state = 0;
  d->near_singular = r->near_singular;
  radau_measure_noise (r);
  d->h = pw_first_step (r);
  if (d->h >= 0.5 * time_scale * sqrt (r->settings.rtol)) /* saturating forces do not limit it */
    d->h = fmax (d->h, 0.1 * time_scale * sqrt (sqrt (pw_radau_rtol (r))));
  memcpy (d->now.y, r->q, (size_t)d->dae.n * sizeof (double));
  memcpy (d->now.y + d->dae.n, r->v, (size_t)d->dae.n * sizeof (double));
  memset (d->now.y + 2 * d->dae.n, 0, (size_t)(d->dae.rows + d->dae.mu_count) * sizeof (double));
  pw_tangent_compress (&d->dae.tangent, r->lambda, d->dae.rows, d->now.y + 2 * d->dae.n);
  return PW_OK;
}

static int radau_allocate (pw_run *r) {
  pw_method_data *d = r->data;
  enum { SINGLE = 16, OF_STAGE = 6, ALL = SINGLE + OF_STAGE * STAGES + 1 };
  const size_t n = (size_t)d->dae.size + 6; /* of all arrays of unknowns, with room for three more coordinates */
  const size_t entries = (size_t)r->entries;
  pw_array array[ALL] = {
    { &d->B, n },         { &d->unit, n },       { &d->tolerance, n },        { &d->newton_tolerance, n },
    { &d->round_off, n }, { &d->row_factor, n }, { &d->column_factor, n },    { &d->Y, n },
    { &d->a_end, n },     { &d->now.y, n },      { &d->last.y, n },           { &d->now.a, n },
    { &d->last.a, n },    { &d->rate, entries }, { &d->now.ledger, entries }, { &d->last.ledger, entries }
  };
  for (int k = 0; k < STAGES; k++) {
    const pw_array stage[OF_STAGE] = { { &d->now.Z[k], n },  { &d->now.ledger_change[k], entries },  { &d->W[k], n },
                                       { &d->last.Z[k], n }, { &d->last.ledger_change[k], entries }, { &d->F[k], n } };
    memcpy (array + SINGLE + OF_STAGE * k, stage, sizeof stage);
  }
  array[ALL - 1] = (pw_array){ &d->complex_x, 2 * n };
  d->memory = pw_alloc_arrays (array, ALL);
  return d->memory ? PW_OK : PW_RESOURCE;
}

static int radau_open (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  int status = d ? pw_dae_open (&d->dae, r) : PW_RESOURCE;
  if (status == PW_OK) status = radau_allocate (r);
  if (status == PW_OK) status = pw_radau_open_matrices (r);
  if (status != PW_OK) return pw_fail_memory (r->s, error);
  for (int j = 0, n = d->dae.n; j < n; j++) {
    d->B[j] = 1, d->B[n + j] = r->s->mass[j];
    d->unit[j] = pw_unit (r->s, j), d->unit[n + j] = d->unit[j] / r->w->scale.time;
  }
  status = pw_projector_open (&d->projector, r, NULL, NULL, error);
  return status == PW_OK ? radau_restart (r, error) : status;
}

static void radau_close (pw_run *r) {
  pw_method_data *d = r->data;
  pw_projector_close (&d->projector);
  pw_sparse_close (&d->real);
  pw_sparse_close (&d->complex);
  pw_dae_close (&d->dae);
  free (d->value);
  free (d->diagonal);
  free (d->memory);
  free (d);
}

/* ---- Advancing ---- */

/* Accelerations and multipliers at the state reached, where J is evaluated: computed from the state, or in singular
 * configurations those of the last stage. */
static void radau_evaluate_reached (pw_run *r, double h) {
  pw_method_data *d = r->data;
  double *lambda = d->now.y + 2 * d->dae.n;
  int status = pw_saddle_factor (r->saddle);
  d->near_singular = r->near_singular = status != PW_OK || pw_watchdog_near (r);
  radau_measure_noise (r);
  if (status == PW_OK) {
    pw_run_accelerate_updated (r, r->v, r->a, r->lambda);
  } else {
    for (int j = 0, n = d->dae.n; j < n; j++) r->a[j] = pw_radau_sum (0, radau_derivative_at_end, d->last.Z, n + j) / h;
    pw_tangent_expand (&d->dae.tangent, lambda, d->dae.rows, r->lambda);
  }
  pw_tangent_compress (&d->dae.tangent, r->lambda, d->dae.rows, lambda);
  memcpy (d->a_end, r->a, (size_t)d->dae.n * sizeof *d->a_end);
  pw_bound_tolerances (r);
  pw_ledger_rates (r, r->lambda, r->rate);
}

/* The last stage becomes the state reached.  PW_OK, or PW_METHOD if a signal failed. */
static int radau_accept (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  size_t n = (size_t)d->dae.n * sizeof (double), entries = (size_t)r->entries;
  radau_step done = d->now;
  pw_radau_stage (d, STAGES - 1);
  int status = pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t1), d->Y, d->Y + d->dae.n);
  if (status != PW_OK) return status;
  done.t = r->t, done.h = h;
  memcpy (done.a, r->a, n);
  memcpy (done.ledger, r->ledger, entries * sizeof (double));
  d->now = d->last;
  d->last = done;
  memcpy (d->now.y, d->Y, (size_t)d->dae.size * sizeof (double));
  memset (d->now.y + 2 * d->dae.n + d->dae.rows, 0, (size_t)d->dae.mu_count * sizeof (double));
  memcpy (r->q, d->Y, n);
  memcpy (r->v, d->Y + d->dae.n, n);
  r->t = t1;
  for (size_t e = 0; e < entries; e++) r->ledger[e] += done.ledger_change[STAGES - 1][e];
  radau_evaluate_reached (r, h);
  r->statistics.steps++;
  d->F_y_at_state = 0;
  d->renew_F_y = r->matrix_outdated || d->contraction > RADAU_REUSE_CONTRACTION;
  return PW_OK;
}

/* The size of the next step, from the errors of this and the previous one; constants as in RADAU5.  rejected: not 0 if
 * this one was rejected at least once. */
static double radau_next_h (const pw_method_data *d, double h, double error, int rejected) {
  double safety = 0.9 * fmin (1, (1. + 2 * PW_RADAU_MOST) / (d->iterations + 2 * PW_RADAU_MOST));
  double quotient = fmin (5, fmax (1. / 8, pow (error, 0.25) / safety));
  if (error < 1 && d->previous_h > 0) {
    double trend = h / d->previous_h * pow (d->previous_error / (error * error), 0.25) * 0.9;
    quotient = fmax (quotient, fmin (5, fmax (1. / 8, 1 / trend)));
  }
  double next = h / quotient;
  if (rejected) next = fmin (next, h);
  return d->contraction <= RADAU_REUSE_CONTRACTION && next >= h && next <= RADAU_REUSE_GROWTH * h ? h : next;
}

/* Computes a step of size h, and its error in units of the tolerances: INFINITY if its equations could not be solved,
 * or steps are fixed.  filter_twice: as in pw_radau_estimate. */
static int radau_try (pw_run *r, double h, double t1, int filter_twice, double *error) {
  *error = INFINITY;
  r->near_singular = 0;
  int status = pw_radau_solve (r, h, t1);
  if (status == PW_OK && !r->fixed_steps) status = pw_radau_estimate (r, h, filter_twice, error);
  if (status == PW_OK && r->entries > 0 && (*error < 1 || r->fixed_steps)) status = pw_radau_work (r, h, t1, error);
  return status;
}

static int radau_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  int whole;
  double err, t1 = pw_step_end (r, &d->counter, t_end, &whole), h = whole ? r->settings.step : t1 - r->t;
  int status = radau_try (r, h, t1, 0, &err);
  if (status == PW_OK) status = radau_accept (r, h, t1);
  if (status != PW_OK) return pw_implicit_fail (r, status, h, error);
  pw_count_step (&d->counter, whole, t1);
  return PW_OK;
}

/* A step that was shortened to end at t_end or a breakpoint does not reduce the next one. */
static int radau_accept_adaptive (pw_run *r, double h, double t1, double error, int rejected, int shortened) {
  pw_method_data *d = r->data;
  double next = radau_next_h (d, h, error, rejected);
  int status = radau_accept (r, h, t1);
  if (status != PW_OK) return status;
  d->previous_h = h;
  d->previous_error = fmax (1e-2, error);
  d->h = shortened ? fmax (next, d->h) : next;
  return PW_OK;
}

/* In index3 the state reached violates g = 0 and J v = eta within the tolerances.  A step of size h corrects positions
 * by velocities of that size over h: no step, however small, has a smaller error, unless the state is projected. */
static void radau_project_start (pw_run *r) {
  pw_method_data *d = r->data;
  double *q = d->Y, *v = q + d->dae.n;
  if (d->dae.enforces_velocities) return;
  memcpy (q, d->now.y, (size_t)(2 * d->dae.n) * sizeof *q);
  int status = pw_project_positions (&d->projector, r, r->t, q, v);
  if (status == PW_OK) status = pw_project_velocities (&d->projector, r, v);
  if (status == PW_OK) memcpy (d->now.y, q, (size_t)(2 * d->dae.n) * sizeof *q);
  pw_forget_residuals (r);
}

static int radau_advance (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  if (r->fixed_steps) return radau_advance_fixed (r, t_end, error);
  double stop = fmin (t_end, r->breakpoint), err;
  for (int rejected = 0, status = PW_OK;; rejected++) {
    int shortened = r->t + d->h > stop - 0.01 * d->h; /* no tiny step remains */
    double h = shortened ? stop - r->t : d->h, t1 = shortened ? stop : r->t + h;
    if (!shortened && !(h > pw_least_step (r))) return pw_implicit_fail (r, status, h, error);
    if (rejected > 0 && (status = pw_run_check_limits (r, error)) != PW_OK) return status;
    status = radau_try (r, h, t1, rejected > 0 || d->previous_h == 0, &err);
    if (status == PW_OK && err < 1) status = radau_accept_adaptive (r, h, t1, err, rejected, shortened);
    if (status == PW_OK && err < 1) return PW_OK;
    int signal_fails = status == PW_METHOD && h < RADAU_SIGNAL_STEP * r->w->scale.time;
    if (status == PW_RESOURCE || status == PW_SINGULAR || signal_fails) return pw_implicit_fail (r, status, h, error);
    r->statistics.rejected++;
    d->renew_F_y = !d->F_y_at_state;
    if (status == PW_OK && rejected > 0) radau_project_start (r);
    double reduction = status == PW_RETRY ? d->reduction : 0.25;
    d->h = status == PW_OK ? fmin (0.9 * h, radau_next_h (d, h, err, 1)) : h * reduction;
  }
}

/* ---- Samples ---- */

/* The quintic through positions, velocities and accelerations at both ends of the last step, at x in [0, 1]. */
static void radau_quintic (const pw_run *r, double x, double *q, double *v) {
  const pw_method_data *d = r->data;
  double h = d->last.h;
  for (int j = 0; j < d->dae.n; j++) {
    double q0 = d->last.y[j], v0 = h * d->last.y[d->dae.n + j], a0 = 0.5 * h * h * d->last.a[j];
    double dq = r->q[j] - q0 - v0 - a0, dv = h * r->v[j] - v0 - 2 * a0, da = 0.5 * h * h * (d->a_end[j] - d->last.a[j]);
    double c3 = 10 * dq - 4 * dv + da, c4 = -15 * dq + 7 * dv - 2 * da, c5 = 6 * dq - 3 * dv + da;
    q[j] = q0 + x * (v0 + x * (a0 + x * (c3 + x * (c4 + x * c5))));
    v[j] = (v0 + x * (2 * a0 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))) / h;
  }
}

/* The quintic is more accurate than the polynomial through the stages, unless the step does not resolve the motion:
 * then they differ by more than the tolerances, or in fixed steps by more than a tenth of the changes in the step. */
static int radau_quintic_agrees (const pw_run *r, const double *q, const double *v) {
  const pw_method_data *d = r->data;
  double sum = 0;
  for (int i = 0; i < 2 * d->dae.n; i++) {
    double difference = i < d->dae.n ? q[i] - r->q_at[i] : v[i - d->dae.n] - r->v_at[i - d->dae.n];
    double allowed = d->tolerance[i];
    if (r->fixed_steps) {
      allowed = d->round_off[i];
      for (int k = 0; k < STAGES; k++) allowed = fmax (allowed, 0.1 * fabs (d->last.Z[k][i]));
    }
    sum += difference * difference / (allowed * allowed);
  }
  return sum <= 2 * d->dae.n;
}

/* The sample inside the last step at x in [0, 1]. */
static void radau_fill_sample (pw_run *r, double x) {
  pw_method_data *d = r->data;
  const radau_step *p = &d->last;
  int n = d->dae.n;
  double weight[STAGES], *y = d->Y, *q = d->F[0], *v = d->F[1];
  pw_radau_basis (x, weight);
  for (int i = 0; i < d->dae.size; i++) y[i] = pw_radau_sum (p->y[i], weight, p->Z, i);
  memcpy (r->q_at, y, (size_t)n * sizeof *y);
  memcpy (r->v_at, y + n, (size_t)n * sizeof *y);
  pw_tangent_expand (&d->dae.tangent, y + 2 * n, d->dae.rows, r->lambda_at);
  for (int j = 0; j < n; j++) r->a_at[j] = (1 - x) * p->a[j] + x * d->a_end[j];
  for (int e = 0; e < r->entries; e++) r->ledger_at[e] = pw_radau_sum (p->ledger[e], weight, p->ledger_change, e);
  radau_quintic (r, x, q, v);
  if (!radau_quintic_agrees (r, q, v)) return;
  memcpy (r->q_at, q, (size_t)n * sizeof *q);
  memcpy (r->v_at, v, (size_t)n * sizeof *v);
}

/* Projects the sample onto the constraints that the steps satisfy, in index3 onto g = 0 only, and computes
 * accelerations and multipliers from it. */
static int radau_interpolate (void *method, pw_run *r, double t) {
  pw_method_data *d = method;
  int status;
  radau_fill_sample (r, (t - d->last.t) / d->last.h);
  if (d->dae.mu_count > 0 || !d->dae.enforces_velocities)
    status = pw_project_positions (&d->projector, r, t, r->q_at, r->v_at);
  else
    status = pw_evaluate_J_at (r->w, t, r->q_at, r->v_at);
  if (status == PW_OK && d->dae.enforces_velocities) status = pw_project_velocities (&d->projector, r, r->v_at);
  if (status == PW_OK && pw_saddle_factor (r->saddle) == PW_OK)
    pw_run_accelerate_updated (r, r->v_at, r->a_at, r->lambda_at);
  return status;
}

static int radau_at (pw_run *r, double t, pw_error *error) {
  pw_method_data *d = r->data;
  return pw_sample_last_step (r, d->last.t, t, radau_interpolate, d, error);
}

static const pw_stabilisation radau_stabilisations[] = {
  { "ggl", "stabilised index 2: positions and velocities both enforced (Gear, Gupta & Leimkuhler 1985)", PW_GGL },
  { "index2", "velocities enforced, positions drift", PW_INDEX2 },
  { "index3", "positions enforced, and the velocities of nonholonomic constraints (Hairer, Lubich & Roche 1989)",
    PW_INDEX3 },
  { .name = NULL },
};

static const char *const radau_steps[] = { "adaptive", "fixed", NULL };

static const pw_option radau_options[] = {
  { .name = "steps", .choices = radau_steps, .about = "steps that follow the tolerances, or of the given size" },
  { .name = NULL },
};

const pw_method pw_method_radau = {
  .name = "radau",
  .about = "Radau IIA of order 5, implicit, adaptive, for stiff scenes (Hairer & Wanner 1996)",
  .adaptive = 1,
  .order = 5,
  .stabilisations = radau_stabilisations,
  .options = radau_options,
  .open = radau_open,
  .advance = radau_advance,
  .at = radau_at,
  .restart = radau_restart,
  .close = radau_close,
};
