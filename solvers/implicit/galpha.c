/* galpha: the generalised-alpha method (Chung & Hulbert 1993) for constrained systems, fixed step (Arnold & Brüls 2007,
 * Convergence of the generalized-alpha scheme for constrained mechanical systems).  From t_n to t_n+1 = t_n + h
 *
 *   (1 - alpha_m) w' + alpha_m w = (1 - alpha_f) a' + alpha_f a          ' : at t_n+1
 *   v' = v + h ((1 - gamma) w + gamma w')
 *   q' = q + h v + h^2 ((1/2 - beta) w + beta w') - (h beta / gamma) D G^T mu
 *   M a' + J^T lambda' = f
 *
 *   index3    g = 0,              S v' = b,      mu = 0
 *   ggl       g = 0,              J v' = eta     stabilised index 2 (Gear, Gupta & Leimkuhler 1985)
 *
 * with G the holonomic rows of J, S and b the nonholonomic rows of J and eta, D as in tangent.h.  The acceleration-like
 * variable w approximates the acceleration at t + shift h, shift = alpha_m - alpha_f, with an error of order h^2.  The
 * coefficients follow from the spectral radius rho at infinite frequency.
 *
 * For order 2 from the first step, the initial w is a + shift h a-dot.  In index3, where g = 0 requires a velocity
 * error dv with G dv = C h^2 G a-dot, C = 1/6 - beta - shift/2, the initial v includes that error; otherwise the first
 * multipliers have an error of order h (Arnold, Brüls & Cardona 2015, Error analysis of generalized-alpha Lie group
 * time integration methods for constrained mechanical systems).  A change of step size and a discontinuity require a
 * new initialisation, from velocities projected onto J v = eta.  If vibrations too fast for the step dominate a-dot,
 * this would amplify them a hundredfold; then a-dot is the change of a in a trial step from w = a.
 *
 * Newton's iteration has the unknowns q', v', lambda', mu; w' and a' follow from v'.  With c = gamma / (h beta) and
 * e = (1 - alpha_m) / ((1 - alpha_f) h gamma) the equations are those of tangent.h, in which
 *
 *   c (q' - q - h v - h^2 (1/2 - beta) w - h^2 beta w')
 *
 * replaces q-dot - v.  Corrections satisfy dw' = dv' / (h gamma), da' = e dv', so that c and e are the q_dot_factor and
 * the v_dot_factor of pw_dae_matrix.  Corrections of v', lambda', mu are in units of c, c e m, c, and the kinematics,
 * the momentum and the velocity constraints are divided by c, c e m, c, with m a mass: then all entries of the matrix
 * are of about the same size, and its condition number does not depend on the step (Bottasso, Bauchau & Cardona 2007,
 * Time-step-size-independent conditioning and sensitivity to perturbations in the numerical solution of index three
 * differential algebraic equations). */
#include <stdlib.h>
#include "implicit.h"

struct pw_method_data {
  pw_implicit common; /* first; its q1 and v1 are the first unknowns */
  double alpha_m, alpha_f, beta, gamma;
  double *v, *a, *w;                  /* coords: velocities, accelerations and w at the beginning of the next step */
  double *a1, *w1;                    /* coords: accelerations and w of the new state */
  double *y, *z;                      /* unknowns: q', v', lambda', mu; residual, then correction */
  double *row_factor, *column_factor; /* unknowns: by which rows and columns of the matrix are multiplied */
};

/* The factors c and e. */
static double galpha_c (const pw_method_data *d, double h) {
  return d->gamma / (h * d->beta);
}
static double galpha_e (const pw_method_data *d, double h) {
  return (1 - d->alpha_m) / ((1 - d->alpha_f) * h * d->gamma);
}

static int galpha_update (pw_run *r, double t1) {
  return pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t1), r->data->common.q1, r->data->common.v1);
}

/* The new velocity of coordinate j, from w'; its displacement in the step, without that by mu. */
static double galpha_velocity (const pw_method_data *d, double h, int j) {
  return d->v[j] + h * ((1 - d->gamma) * d->w[j] + d->gamma * d->w1[j]);
}
static double galpha_displacement (const pw_method_data *d, double h, int j) {
  return h * (d->v[j] + h * ((0.5 - d->beta) * d->w[j] + d->beta * d->w1[j]));
}

static int galpha_residual (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  pw_dae *x = &d->common.dae;
  int status = galpha_update (r, t1);
  if (status != PW_OK) return status;
  pw_dae_residual (x, d->common.v1, d->a1, d->y + 2 * x->n, d->z);
  for (int j = 0; j < x->n; j++)
    d->z[j] += galpha_c (d, h) * (d->common.q1[j] - r->q[j] - galpha_displacement (d, h, j));
  r->statistics.rhs++;
  return PW_OK;
}

static int galpha_factor (pw_run *r, double h) {
  pw_method_data *d = r->data;
  pw_dae *x = &d->common.dae;
  pw_scatter_map *matrix = &x->tangent.scatter;
  pw_scatter_begin_fill (matrix, matrix->value);
  pw_dae_matrix (x, d->common.v1, d->a1, d->y + 2 * x->n, galpha_c (d, h), galpha_e (d, h));
  for (int c = 0; c < x->size; c++)
    for (int64_t i = matrix->colptr[c]; i < matrix->colptr[c + 1]; i++)
      matrix->value[i] *= d->row_factor[matrix->rowind[i]] * d->column_factor[c];
  r->statistics.jacobians++;
  r->statistics.factorisations++;
  return pw_sparse_factor (&d->common.sparse, matrix->value);
}

/* The prediction: the accelerations stay constant. */
static void galpha_predict (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_dae *x = &d->common.dae;
  memset (d->y, 0, (size_t)x->size * sizeof *d->y);
  for (int j = 0; j < x->n; j++) {
    d->a1[j] = d->a[j];
    d->w1[j] = (d->a[j] - d->alpha_m * d->w[j]) / (1 - d->alpha_m);
    d->common.v1[j] = galpha_velocity (d, h, j);
    d->common.q1[j] = r->q[j] + galpha_displacement (d, h, j);
  }
  pw_tangent_compress (&x->tangent, r->lambda, x->rows, d->y + 2 * x->n);
}

/* Solves for the correction of the unknowns and applies it.  *correction: its size, the largest of those of q and v / c
 * in units of the scene; *round_off: the round-off of q and h v in these units.  PW_OK or PW_RESOURCE. */
static int galpha_correct (pw_run *r, double h, double *correction, double *round_off) {
  pw_method_data *d = r->data;
  int n = d->common.dae.n, size = d->common.dae.size;
  double largest = 1;
  for (int i = 0; i < size; i++) d->z[i] *= -d->row_factor[i];
  if (pw_sparse_solve (&d->common.sparse, d->z) != PW_OK) return PW_RESOURCE;
  *correction = 0;
  for (int j = 0; j < n; j++) {
    double larger = pw_larger_or_nan (fabs (d->z[j]), fabs (d->z[n + j]));
    if (j >= r->s->mechanical) larger = fabs (d->z[n + j]) / pw_velocity_unit (r, j, d->common.v1[j]);
    *correction = pw_larger_or_nan (*correction, larger / pw_unit (r->s, j));
  }
  for (int i = 0; i < size; i++) d->y[i] += d->column_factor[i] * d->z[i];
  for (int j = 0; j < n; j++) {
    double dv = d->column_factor[n + j] * d->z[n + j];
    d->w1[j] += dv / (h * d->gamma);
    d->a1[j] += galpha_e (d, h) * dv;
    d->common.v1[j] = galpha_velocity (d, h, j);
    if (j < r->s->mechanical)
      largest = fmax (largest, fmax (fabs (d->common.q1[j]), h * fabs (d->common.v1[j])) / pw_unit (r->s, j));
  }
  *round_off = 4 * DBL_EPSILON * largest;
  return PW_OK;
}

/* Computes the new state at t1 = t + h with its accelerations and multipliers; kinematics and J are left there.
 * PW_RETRY if the iteration does not converge; PW_SINGULAR if its matrix is; PW_METHOD if a signal failed;
 * PW_RESOURCE.
 *
 * The matrix is evaluated at the prediction, and again while convergence is slow.  The remaining error in multipliers,
 * 1/h^2 times that of positions, must be small against the method's own, which is of order h^2: hence the target of
 * order h^4.  Corrections that stall within 32 times their round-off are accepted. */
static int galpha_solve (pw_run *r, double h, double t1) {
  const int most = 20; /* iterations */
  pw_method_data *d = r->data;
  double before = INFINITY, size, round_off, target = fmin (1e-9, 1e-3 * pow (h / r->w->scale.time, 4)), rate = 1;
  if (h != d->common.last.h)
    pw_implicit_scale (&d->common.dae, galpha_c (d, h), galpha_e (d, h), d->row_factor, d->column_factor);
  galpha_predict (r, h);
  for (int i = 0, refactor = 1; i < most; i++) {
    int status = galpha_residual (r, h, t1);
    if (status == PW_OK && refactor) status = galpha_factor (r, h);
    if (status == PW_OK) status = galpha_correct (r, h, &size, &round_off);
    if (status != PW_OK) return status;
    double enough = fmax (target, round_off);
    if (!isfinite (size)) return PW_RETRY;
    if (i > 0) rate = size / before;
    int stalled = rate > 0.25 && size <= 32 * round_off;
    if (size <= enough || stalled || (rate < 1 && size * rate / (1 - rate) <= enough)) return galpha_update (r, t1);
    if (rate > 2 && i > 3) return PW_RETRY;
    refactor = i > 0 && rate > 0.02;
    if (refactor) pw_sparse_forget_pivots (&d->common.sparse);
    before = size;
  }
  return PW_RETRY;
}

static int galpha_open (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3, most = 2 * (n + (size_t)s->rows);
  if (d == NULL) return pw_fail_memory (s, error);
  d->common.last.arrays = PW_ALLOC_ARRAYS (PW_ARRAY (d->v, n), PW_ARRAY (d->a, n), PW_ARRAY (d->row_factor, most),
                                           PW_ARRAY (d->column_factor, most), PW_ARRAY (d->w, n), PW_ARRAY (d->a1, n),
                                           PW_ARRAY (d->w1, n), PW_ARRAY (d->y, most), PW_ARRAY (d->z, most));
  int status = d->common.last.arrays ? pw_dae_open (&d->common.dae, r) : PW_RESOURCE;
  pw_dae *x = &d->common.dae;
  if (status == PW_OK) {
    const double rho = pw_run_option (r, "rho"); /* order 2, least damping of low frequencies (Chung & Hulbert 1993) */
    d->alpha_m = (2 * rho - 1) / (rho + 1);
    d->alpha_f = rho / (rho + 1);
    d->gamma = 0.5 + d->alpha_f - d->alpha_m;
    d->beta = 0.25 * (d->gamma + 0.5) * (d->gamma + 0.5);
    d->common.q1 = d->y, d->common.v1 = d->y + x->n;
    status = pw_dae_lay_out (x, d->common.v1, d->a1, d->y + 2 * x->n);
  }
  pw_dense_projection projection = x->enforces_velocities ? PW_DENSE_POSITIONS_AND_VELOCITIES : PW_DENSE_POSITIONS;
  return pw_implicit_complete (r, status, x->size, projection, error);
}

/* a-dot at the state reached: a difference quotient over 1e-3 of the step, short enough for stiff forces, long enough
 * for round-off. */
static int galpha_jerk (pw_run *r, double h, double *jerk) {
  pw_method_data *d = r->data;
  double dt = 1e-3 * h;
  for (int j = 0; j < d->common.dae.n; j++) {
    d->common.q1[j] = r->q[j] + dt * (d->v[j] + 0.5 * dt * d->a[j]);
    d->common.v1[j] = d->v[j] + dt * d->a[j];
  }
  int status = pw_run_accelerate (r, pw_before_breakpoint (r, r->t + dt), d->common.q1, d->common.v1, jerk,
                                  d->common.dae.scratch);
  for (int j = 0; j < d->common.dae.n; j++) jerk[j] = (jerk[j] - d->a[j]) / dt;
  return status;
}

/* Adds to the velocities the error with which the method starts without loss of order in index3: the dv with
 * G dv = C h^2 G a-dot and S dv = 0 that is least in the metric of M. */
static int galpha_add_velocity_error (pw_run *r, double h, const double *jerk) {
  pw_method_data *d = r->data;
  const pw_system *s = r->s;
  double C = 1. / 6 - d->beta - 0.5 * (d->alpha_m - d->alpha_f), *dv = d->common.v1;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, d->v);
  if (status != PW_OK) return status;
  pw_mul_J (r->w, jerk, d->common.dae.residual);
  for (int i = 0; i < s->rows; i++) d->common.dae.residual[i] *= i < s->holonomic ? C * h * h : 0;
  status = pw_saddle_factor (r->saddle);
  if (status != PW_OK) return status;
  pw_saddle_solve (r->saddle, NULL, d->common.dae.residual, dv, d->common.dae.scratch);
  for (int j = 0; j < d->common.dae.n; j++) d->v[j] += dv[j];
  return PW_OK;
}

/* Initialises d->v, d->a and d->w for the first step of this size.  If a-dot would change the accelerations by several
 * times their size in a step, the scene has vibrations that are too fast for it.  Then a-dot is the change of a in a
 * trial step from w = a, which does not amplify them. */
static int galpha_begin (pw_run *r, double h) {
  pw_method_data *d = r->data;
  double *jerk = d->w1, change = 0, size = 0;
  int status = PW_OK;
  memcpy (d->v, r->v, (size_t)d->common.dae.n * sizeof *d->v);
  if (!d->common.dae.enforces_velocities) { /* r->v includes the error that earlier steps added */
    status = pw_evaluate_J_at (r->w, r->t, r->q, d->v);
    if (status == PW_OK) status = pw_project_velocities (&d->common.last.projector, r, d->v);
  }
  if (status == PW_OK) status = pw_run_accelerate (r, r->t, r->q, d->v, d->a, d->common.dae.scratch);
  if (status == PW_OK) status = galpha_jerk (r, h, jerk);
  if (status != PW_OK) return status;
  for (int j = 0; j < d->common.dae.n; j++) {
    change += r->s->metric[j] * jerk[j] * jerk[j];
    size += r->s->metric[j] * d->a[j] * d->a[j];
  }
  if (h * sqrt (change) > 4 * sqrt (size)) {
    memcpy (d->w, d->a, (size_t)d->common.dae.n * sizeof *d->w);
    status = galpha_solve (r, h, r->t + h);
    if (status < 0) return status;
    for (int j = 0; j < d->common.dae.n; j++) jerk[j] = status == PW_OK ? (d->a1[j] - d->a[j]) / h : 0;
  }
  for (int j = 0; j < d->common.dae.n; j++) d->w[j] = d->a[j] + (d->alpha_m - d->alpha_f) * h * jerk[j];
  return d->common.dae.enforces_velocities || r->s->holonomic == 0 ? PW_OK : galpha_add_velocity_error (r, h, jerk);
}

static int galpha_step (pw_run *r, double h, double t1) {
  int status = h != r->data->common.last.h ? galpha_begin (r, h) : PW_OK;
  return status == PW_OK ? galpha_solve (r, h, t1) : status;
}

static void galpha_accept (pw_run *r) {
  pw_method_data *d = r->data;
  size_t n = (size_t)d->common.dae.n * sizeof (double);
  memcpy (r->a, d->a1, n);
  memcpy (d->v, r->v, n);
  memcpy (d->a, d->a1, n);
  memcpy (d->w, d->w1, n);
  pw_tangent_expand (&d->common.dae.tangent, d->y + 2 * d->common.dae.n, d->common.dae.rows, r->lambda);
}

static int galpha_advance (pw_run *r, double t_end, pw_error *error) {
  int status = pw_implicit_advance (r, t_end, galpha_step, galpha_accept, error);
  if (status == PW_OK) r->near_singular = pw_saddle_factor (r->saddle) != PW_OK || pw_watchdog_near (r);
  return status;
}

static const pw_stabilisation galpha_stabilisations[] = {
  { "index3", "positions enforced, and the velocities of nonholonomic constraints (Arnold & Brüls 2007)", PW_INDEX3 },
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
  .at = pw_step_at,
  .restart = pw_step_restart,
  .close = pw_implicit_close,
};
