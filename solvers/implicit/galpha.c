/* galpha: the generalised-alpha method (Chung & Hulbert 1993) for constrained systems, fixed step (Arnold & Brüls 2007,
 * Convergence of the generalized-alpha scheme for constrained mechanical systems).  From t_n to t_n+1 = t_n + h
 *
 *   (1 - alpha_m) w' + alpha_m w = (1 - alpha_f) a' + alpha_f a          ' : at t_n+1
 *   v' = v + h ((1 - gamma) w + gamma w')
 *   q' = q + h v + h^2 ((1/2 - beta) w + beta w') - (h beta / gamma) D G^T mu
 *   M a' + J^T lambda' = f
 *
 *   index3    g = 0,              S v' = b   (nonholonomic rows),   mu = 0
 *   ggl       g = 0,              J v' = eta                        stabilised index 2 (Gear, Gupta & Leimkuhler 1985)
 *
 * The acceleration-like variable w approximates the acceleration at t + shift h, shift = alpha_m - alpha_f, with an
 * error of order h^2; D as in ida.  The coefficients follow from the spectral radius rho at infinite frequency.
 *
 * For order 2 from the first step, the initial w is a + shift h a-dot.  In index3, where g = 0 requires a velocity
 * error C h^2 G a-dot, C = 1/6 - beta - shift/2, the initial v includes that error; otherwise the first multipliers
 * have an error of order h (Arnold, Brüls & Cardona 2015, Error analysis of generalized-alpha Lie group time
 * integration methods for constrained mechanical systems).  A change of step size and a discontinuity require a new
 * initialisation, from velocities projected onto J v = eta.  If vibrations too fast for the step dominate a-dot, this
 * would amplify them a hundredfold; then a-dot is the change of a in a trial step from w = a.
 *
 * Newton's equations are scaled by powers of the step, so that their condition number does not depend on it (Bottasso,
 * Bauchau & Cardona 2007, Time-step-size-independent conditioning and sensitivity to perturbations in the numerical
 * solution of index three differential algebraic equations). */
#include <stdlib.h>
#include <string.h>
#include "galpha_state.h"
#include "util.h"

/* ---- Opening ---- */

/* Order 2 with the least damping of low frequencies for a given rho. */
static void galpha_coefficients (galpha *d, double rho) {
  d->alpha_m = (2 * rho - 1) / (rho + 1);
  d->alpha_f = rho / (rho + 1);
  d->gamma = 0.5 + d->alpha_f - d->alpha_m;
  d->beta = 0.25 * (d->gamma + 0.5) * (d->gamma + 0.5);
}

static int galpha_open (pw_run *r, pw_error *error) {
  galpha *d = r->data = calloc (1, sizeof *d);
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3, rows = (size_t)s->rows, size = 2 * (n + rows);
  if (d == NULL) return pw_fail_memory (s, error);
  const pw_array array[] = { { &d->v, n },      { &d->a, n },       { &d->w, n },      { &d->work.q1, n },
                             { &d->a1, n },     { &d->work.v1, n }, { &d->w1, n },     { &d->lambda1, rows },
                             { &d->mu1, rows }, { &d->z, size },    { &d->row, size }, { &d->column, size },
                             { &d->pull, n },   { &d->f, n },       { &d->jv, rows },  { &d->eta, rows } };
  int status = pw_implicit_open (&d->work, r, array, sizeof array / sizeof *array);
  d->ggl = pw_stabilised_by (r, PW_GGL);
  galpha_coefficients (d, pw_run_option (r, "rho"));
  d->n = s->coords;
  d->rows = d->work.tangent.rows;
  d->positions = d->ggl ? d->work.tangent.holonomic : 0;
  d->size = 2 * d->n + d->rows + d->positions;
  if (status == PW_OK) status = pw_galpha_open_matrix (r);
  return pw_implicit_complete (r, status, d->ggl, error);
}

/* ---- Initialisation ---- */

/* a-dot at the current state: a difference quotient over 1e-3 of the step, short enough for stiff forces, long enough
 * for round-off. */
static int galpha_jerk (pw_run *r, double h, double *jerk) {
  galpha *d = r->data;
  double s = 1e-3 * h;
  for (int j = 0; j < d->n; j++) {
    d->work.q1[j] = r->q[j] + s * (d->v[j] + 0.5 * s * d->a[j]);
    d->work.v1[j] = d->v[j] + s * d->a[j];
  }
  int status = pw_run_accelerate (r, pw_before_breakpoint (r, r->t + s), d->work.q1, d->work.v1, jerk, d->eta);
  for (int j = 0; j < d->n; j++) jerk[j] = (jerk[j] - d->a[j]) / s;
  return status;
}

/* 1 if a-dot would change the accelerations by several times their size in a step: the scene has faster vibrations. */
static int galpha_fast (const pw_run *r, double h, const double *jerk) {
  const galpha *d = r->data;
  double change = 0, size = 0;
  for (int j = 0; j < d->n; j++) {
    change += r->s->metric[j] * jerk[j] * jerk[j];
    size += r->s->metric[j] * d->a[j] * d->a[j];
  }
  return h * sqrt (change) > 4 * sqrt (size);
}

/* a-dot as the change of a in a trial step from w = a, which does not amplify vibrations that the step does not
 * resolve. */
static int galpha_try (pw_run *r, double h, double *jerk) {
  galpha *d = r->data;
  memcpy (d->w, d->a, (size_t)d->n * sizeof *d->w);
  int status = pw_galpha_solve (r, h, r->t + h);
  for (int j = 0; j < d->n; j++) jerk[j] = status == PW_OK ? (d->a1[j] - d->a[j]) / h : 0;
  return status > 0 ? PW_OK : status; /* the step itself may still succeed */
}

/* Adds to the velocities the part of C h^2 a-dot normal to the holonomic constraints, least in the metric of M. */
static int galpha_displace (pw_run *r, double h, const double *jerk) {
  galpha *d = r->data;
  const pw_system *s = r->s;
  double C = 1. / 6 - d->beta - 0.5 * (d->alpha_m - d->alpha_f), *dv = d->work.v1;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, d->v);
  if (status != PW_OK) return status;
  pw_mul_J (r->w, jerk, d->jv);
  for (int i = 0; i < s->rows; i++) d->jv[i] *= i < s->holonomic ? C * h * h : 0;
  status = pw_saddle_factor (r->saddle);
  if (status != PW_OK) return status;
  pw_saddle_solve (r->saddle, NULL, d->jv, dv, d->eta);
  for (int j = 0; j < d->n; j++) d->v[j] += dv[j];
  return PW_OK;
}

/* Initialises v, a and w for the first step of size h. */
static int galpha_begin (pw_run *r, double h) {
  galpha *d = r->data;
  double *jerk = d->w1;
  int status = PW_OK;
  memcpy (d->v, r->v, (size_t)d->n * sizeof *d->v);
  if (!d->ggl) { /* velocities include the error of the steps before */
    status = pw_evaluate_J_at (r->w, r->t, r->q, d->v);
    if (status == PW_OK) status = pw_project_velocities (&d->work.last.projector, r, d->v);
  }
  if (status == PW_OK) status = pw_run_accelerate (r, r->t, r->q, d->v, d->a, d->eta);
  if (status == PW_OK) status = galpha_jerk (r, h, jerk);
  if (status == PW_OK && galpha_fast (r, h, jerk)) status = galpha_try (r, h, jerk);
  if (status != PW_OK) return status;
  for (int j = 0; j < d->n; j++) d->w[j] = d->a[j] + (d->alpha_m - d->alpha_f) * h * jerk[j];
  return d->ggl || r->s->holonomic == 0 ? PW_OK : galpha_displace (r, h, jerk);
}

/* ---- Advancing ---- */

static int galpha_step (pw_run *r, double h, double t1) {
  int status = h != r->data->work.h ? galpha_begin (r, h) : PW_OK;
  return status == PW_OK ? pw_galpha_solve (r, h, t1) : status;
}

static void galpha_accept (pw_run *r) {
  galpha *d = r->data;
  size_t n = (size_t)d->n * sizeof (double);
  memcpy (r->a, d->a1, n);
  memcpy (d->v, r->v, n);
  memcpy (d->a, d->a1, n);
  memcpy (d->w, d->w1, n);
  pw_tangent_store (&d->work.tangent, d->lambda1, r->lambda);
}

static int galpha_advance (pw_run *r, double t_end, pw_error *error) {
  int status = pw_implicit_advance (r, t_end, galpha_step, galpha_accept, error);
  if (status == PW_OK) r->near_singular = pw_saddle_factor (r->saddle) != PW_OK || pw_watchdog_near (r);
  return status;
}

static const pw_stabilisation galpha_stabilisations[] = {
  { "index3", "positions enforced, and the velocities of nonholonomic constraints (Arnold & Brüls 2007)",
    PW_STABILISED_OTHERWISE },
  { "ggl", "stabilised index 2: positions and velocities both enforced (Gear, Gupta & Leimkuhler 1985)", PW_GGL },
  { .name = NULL },
};

static const pw_option galpha_options[] = {
  { .name = "rho",
    .value = 0.8,
    .domain = PW_FRACTION,
    .about = "spectral radius at infinite frequency: 1 damps nothing, 0 removes what the step cannot follow" },
  { .name = NULL },
};

const pw_method pw_method_galpha = {
  .name = "galpha",
  .about = "generalised-alpha method of order 2, implicit, fixed step (Chung & Hulbert 1993, Arnold & Brüls 2007)",
  .order = 2,
  .stabilisations = galpha_stabilisations,
  .options = galpha_options,
  .open = galpha_open,
  .advance = galpha_advance,
  .at = pw_implicit_at,
  .restart = pw_implicit_restart,
  .close = pw_implicit_close,
};
