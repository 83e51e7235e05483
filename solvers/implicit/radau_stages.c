/* The stages of a step of radau: equations, matrices, Newton's iteration, error estimates; see radau.c.  T, with
 * T^-1 A^-1 T = diag (gamma, [ alpha -beta ; beta alpha ]), was computed with 60 digits from the nodes c. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "radau_state.h"

enum { STAGES = PW_RADAU_STAGES };

static const double radau_T[STAGES][STAGES] = {
  { 0.09443876248897524149, -0.14125529502095420843, -0.03002919410514742449 },
  { 0.25021312296533331138, 0.20412935229379993200, 0.38294211275726193780 },
  { 1, 1, 0 },
};
static const double radau_inverse_T[STAGES][STAGES] = {
  { 4.17871859155190472735, 0.32768282076106238708, 0.52337644549944954804 },
  { -4.17871859155190472735, -0.32768282076106238708, 0.47662355450055045196 },
  { -0.50287263494578687595, 2.57192694985560542919, -0.59603920482822492497 },
};
static const double radau_alpha = 2.68108287362775213390, radau_beta = 3.05043019924741056943;

/* F (t, y), the right-hand side of B y' = F (radau.c): minus the residual of dae.h without its terms B y'.  Leaves
 * kinematics and J at (t, y). */
static int radau_evaluate (pw_run *r, double t, const double *y, double *F) {
  pw_method_data *d = r->data;
  int n = d->dae.n, status = pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t), y, y + n);
  if (status != PW_OK) return status;
  r->statistics.rhs++;
  pw_dae_residual (&d->dae, y + n, NULL, y + 2 * n, F);
  for (int i = 0; i < d->dae.size; i++) F[i] = (i < n ? y[n + i] : 0) - F[i];
  return PW_OK;
}

/* ---- Matrices ---- */

int pw_radau_open_matrices (pw_run *r) {
  pw_method_data *d = r->data;
  const pw_scatter_map *x = &d->dae.tangent.scatter;
  const double *y = d->now.y;
  if (pw_dae_lay_out (&d->dae, y + d->dae.n, NULL, y + 2 * d->dae.n) != PW_OK) return PW_RESOURCE;
  d->value = malloc ((2 * x->nonzeros + 1) * sizeof *d->value); /* + 1: never 0, for which malloc may return NULL */
  d->diagonal = malloc (((size_t)(2 * d->dae.n) + 1) * sizeof *d->diagonal);
  if (!d->value || !d->diagonal) return PW_RESOURCE;
  for (int j = 0; j < 2 * d->dae.n; j++)
    for (d->diagonal[j] = x->colptr[j]; x->rowind[d->diagonal[j]] != j;) d->diagonal[j]++;
  int status = pw_sparse_open (&d->real, PW_SPARSE_REAL, d->dae.size, x->colptr, x->rowind);
  return status == PW_OK ? pw_sparse_open (&d->complex, PW_SPARSE_COMPLEX, d->dae.size, x->colptr, x->rowind) : status;
}

/* Evaluates F_y at the state reached. */
static int radau_linearise (pw_run *r) {
  pw_method_data *d = r->data;
  const double *y = d->now.y;
  int status = pw_evaluate_J_at (r->w, r->t, y, y + d->dae.n);
  if (status != PW_OK) return status;
  pw_scatter_begin_fill (&d->dae.tangent.scatter, d->dae.tangent.scatter.value);
  pw_dae_matrix (&d->dae, y + d->dae.n, NULL, y + 2 * d->dae.n, 0, 0);
  pw_matrix_evaluated (r, y, y + d->dae.n);
  r->statistics.jacobians++;
  d->F_y_at_state = 1;
  d->renew_F_y = 0;
  d->factored_h = 0;
  return PW_OK;
}

/* Fills `value` with the real (parts: 1) or complex (parts: 2) matrix (re + i im) B - F_y, scaled. */
static void radau_fill_matrix (pw_method_data *d, int parts, double re, double im) {
  const pw_scatter_map *minus_F_y = &d->dae.tangent.scatter;
  for (int c = 0; c < d->dae.size; c++)
    for (int64_t i = minus_F_y->colptr[c]; i < minus_F_y->colptr[c + 1]; i++) {
      double scale = d->row_factor[minus_F_y->rowind[i]] * d->column_factor[c];
      double b = c < 2 * d->dae.n && i == d->diagonal[c] ? d->B[c] : 0;
      d->value[parts * i] = scale * (minus_F_y->value[i] + re * b);
      if (parts == 2) d->value[2 * i + 1] = scale * im * b;
    }
}

static int radau_factor (pw_run *r, double h) {
  pw_method_data *d = r->data;
  if (d->factored_h == h) return PW_OK;
  d->factored_h = 0;
  if (d->choose_pivots) pw_sparse_forget_pivots (&d->real), pw_sparse_forget_pivots (&d->complex);
  d->choose_pivots = 0;
  pw_implicit_scale (&d->dae, radau_gamma / h, radau_gamma / h, d->row_factor, d->column_factor);
  radau_fill_matrix (d, 1, radau_gamma / h, 0);
  int status = pw_sparse_factor (&d->real, d->value);
  radau_fill_matrix (d, 2, radau_alpha / h, radau_beta / h);
  if (status == PW_OK) status = pw_sparse_factor (&d->complex, d->value);
  r->statistics.factorisations += 2;
  if (status == PW_OK) d->factored_h = h;
  return status;
}

/* x = (gamma/h B - F_y)^-1 x.  PW_OK or PW_RESOURCE. */
static int radau_solve_real (pw_method_data *d, double *x) {
  for (int i = 0; i < d->dae.size; i++) x[i] *= d->row_factor[i];
  int status = pw_sparse_solve (&d->real, x);
  for (int i = 0; i < d->dae.size; i++) x[i] *= d->column_factor[i];
  return status;
}

/* The same with the complex matrix and re + i im for x. */
static int radau_solve_complex (pw_method_data *d, double *re, double *im) {
  double *x = d->complex_x;
  for (int i = 0; i < d->dae.size; i++) x[2 * i] = d->row_factor[i] * re[i], x[2 * i + 1] = d->row_factor[i] * im[i];
  int status = pw_sparse_solve (&d->complex, x);
  for (int i = 0; i < d->dae.size; i++)
    re[i] = d->column_factor[i] * x[2 * i], im[i] = d->column_factor[i] * x[2 * i + 1];
  return status;
}

/* ---- Tolerances ---- */

double pw_radau_rtol (const pw_run *r) {
  return 0.05 * cbrt (r->settings.rtol * r->settings.rtol);
}

/* Sets, for a step of size h, the tolerances of the error test and of Newton's corrections, and the round-off of the
 * states; in index3, which does not enforce J v = eta of holonomic equations, that of velocities is that of positions
 * over h. */
static void radau_set_tolerances (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_settings *settings = &r->settings;
  int n = d->dae.n, index3 = !d->dae.enforces_velocities && d->dae.tangent.holonomic > 0;
  double rtol = pw_radau_rtol (r), newton = fmax (10 * DBL_EPSILON / rtol, fmin (0.03, sqrt (rtol))); /* RADAU5's */
  double largest = 1; /* the largest coordinate in units of the scene: its round-off may affect others */
  for (int j = 0; j < n; j++) largest = fmax (largest, fabs (d->now.y[j]) / d->unit[j]);
  for (int i = 0; i < 2 * n; i++) {
    double size = fabs (d->now.y[i]), offset = settings->atol > 0 ? settings->atol / settings->rtol : d->unit[i];
    double typical = index3 && i >= n ? fmax (d->unit[i], largest * d->unit[i - n] / h) : d->unit[i];
    d->tolerance[i] = fmin (rtol * (size + offset), r->tolerance_bound[i]);
    d->round_off[i] = fmin (8 * DBL_EPSILON * (size + typical), 0.1 * r->tolerance_bound[i]);
    d->newton_tolerance[i] = r->fixed_steps ? d->round_off[i] : fmax (newton * d->tolerance[i], d->round_off[i]);
  }
}

/* ---- Newton's iteration ---- */

void pw_radau_basis (double x, double *weight) {
  for (int i = 0; i < STAGES; i++) {
    weight[i] = x / radau_c[i];
    for (int k = 0; k < STAGES; k++)
      if (k != i) weight[i] *= (x - radau_c[k]) / (radau_c[i] - radau_c[k]);
  }
}

/* to[k] = sum_j matrix[k][j] from[j], for each unknown; `to` may be `from`. */
static void radau_combine (pw_method_data *d, const double matrix[STAGES][STAGES], double *const *from,
                           double *const *to) {
  for (int i = 0; i < d->dae.size; i++) {
    double a = from[0][i], b = from[1][i], c = from[2][i];
    for (int k = 0; k < STAGES; k++) to[k][i] = matrix[k][0] * a + matrix[k][1] * b + matrix[k][2] * c;
  }
}

/* Starting values: the polynomial of the last step, or else constant accelerations and multipliers. */
static void radau_predict (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const radau_step *last = &d->last;
  double weight[STAGES];
  for (int k = 0; k < STAGES; k++) {
    double *Z = d->now.Z[k], ch = radau_c[k] * h;
    if (last->h > 0) {
      pw_radau_basis (1 + ch / last->h, weight);
      for (int i = 0; i < d->dae.size; i++) Z[i] = pw_radau_sum (last->y[i] - d->now.y[i], weight, last->Z, i);
      continue;
    }
    memset (Z, 0, (size_t)d->dae.size * sizeof *Z);
    for (int j = 0, n = d->dae.n; j < n; j++)
      Z[j] = ch * (d->now.y[n + j] + 0.5 * ch * r->a[j]), Z[n + j] = ch * r->a[j];
  }
  radau_combine (d, radau_inverse_T, d->now.Z, d->W);
}

void pw_radau_stage (const pw_method_data *d, int k) {
  for (int i = 0; i < d->dae.size; i++) d->Y[i] = d->now.y[i] + d->now.Z[k][i];
}

static double radau_time (const pw_run *r, int k, double h, double t1) {
  return k == STAGES - 1 ? t1 : r->t + radau_c[k] * h;
}

/* One correction of W; *size, *round_offs: its largest entry in q, v, in units of newton_tolerance and of round_off. */
static int radau_correct (pw_run *r, double h, double t1, double *size, double *round_offs) {
  pw_method_data *d = r->data;
  double *const *W = d->W, *const *F = d->F;
  for (int k = 0; k < STAGES; k++) {
    pw_radau_stage (d, k);
    int status = radau_evaluate (r, radau_time (r, k, h, t1), d->Y, F[k]);
    if (status != PW_OK) return status;
  }
  radau_combine (d, radau_inverse_T, F, F);
  for (int i = 0; i < 2 * d->dae.n; i++) {
    double b = d->B[i] / h;
    F[0][i] -= b * radau_gamma * W[0][i];
    F[1][i] -= b * (radau_alpha * W[1][i] - radau_beta * W[2][i]);
    F[2][i] -= b * (radau_beta * W[1][i] + radau_alpha * W[2][i]);
  }
  if (radau_solve_real (d, F[0]) != PW_OK || radau_solve_complex (d, F[1], F[2]) != PW_OK) return PW_RESOURCE;
  *size = *round_offs = 0;
  for (int i = 0; i < 2 * d->dae.n; i++) {
    double most = pw_larger_or_nan (pw_larger_or_nan (fabs (F[0][i]), fabs (F[1][i])), fabs (F[2][i]));
    *size = pw_larger_or_nan (*size, most / d->newton_tolerance[i]);
    *round_offs = pw_larger_or_nan (*round_offs, most / d->round_off[i]);
  }
  for (int k = 0; k < STAGES; k++)
    for (int i = 0; i < d->dae.size; i++) W[k][i] += F[k][i];
  radau_combine (d, radau_T, W, d->now.Z);
  return PW_OK;
}

/* Tests convergence after a correction with `done` ones before it; size, before: of this correction and the previous
 * one in units of newton_tolerance; round_offs: of this one in units of round_off.  PW_DIVERGED also if convergence is
 * too slow.  Adaptive steps are tested as in Hairer & Wanner 1996, section IV.8, and RADAU5.  All are tested for
 * round-off: corrections that shrink slowly are accepted up to 64 times round_off, or 1e7 times near a singular
 * configuration, which magnifies it. */
static pw_convergence radau_test (pw_run *r, int done, double size, double before, double round_offs) {
  pw_method_data *d = r->data;
  const int fixed = r->fixed_steps;
  const int most = fixed ? 50 : PW_RADAU_MOST; /* corrections after the first; a fixed step cannot be made shorter */
  d->reduction = 0.5;
  if (!isfinite (size)) return PW_DIVERGED;
  if (size == 0) return PW_CONVERGED;
  if (done == 0) { /* where forces saturate, the first correction may be small far from the solution (tolerances.c) */
    if (fixed || r->s->saturates) return PW_ITERATE;
    d->remaining = pow (fmax (d->remaining, DBL_EPSILON), 0.8);
    return d->remaining * size <= 1 ? PW_CONVERGED : PW_ITERATE;
  }
  double rate = size / before;
  d->contraction = done == 1 ? rate : sqrt (rate * d->contraction);
  if (rate > 0.3 && round_offs <= (d->near_singular ? 1e7 : 64)) return PW_CONVERGED;
  d->remaining = d->contraction < 0.99 ? d->contraction / (1 - d->contraction) : 100;
  if (d->remaining * size <= 1) return PW_CONVERGED;
  if (fixed && done < most && (done < 4 || d->contraction < 1)) return PW_ITERATE;
  if (!(d->contraction < 0.99)) return PW_DIVERGED;
  double expected = d->remaining * size * pow (d->contraction, most - 1 - done); /* the error after all iterations */
  if (done < most && expected < 1) return PW_ITERATE;
  d->reduction = 0.8 * pow (fmax (1e-4, fmin (20, expected)), -1. / (most + 3 - done));
  return PW_DIVERGED;
}

/* With F_y at the state reached, corrections up to `noise` are accepted even if they grow.
 *
 * In index3 corrections of velocities stop shrinking at the round-off of positions over h, and steps follow the errors
 * of velocities, which have a lower order: one more correction makes positions 10 to 100 times more accurate. */
static int radau_iterate (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  double size = 0, before, round_offs;
  radau_predict (r, h);
  for (int done = 0;; done++) {
    before = size;
    int status = radau_correct (r, h, t1, &size, &round_offs);
    if (status != PW_OK) return status;
    pw_convergence convergence = radau_test (r, done, size, before, round_offs);
    d->iterations = done + 1;
    if (convergence == PW_ITERATE) continue;
    if (convergence == PW_DIVERGED && !(d->F_y_at_state && round_offs <= d->noise)) return PW_RETRY;
    if (d->dae.enforces_velocities || d->dae.tangent.holonomic == 0) return PW_OK;
    status = radau_correct (r, h, t1, &size, &round_offs);
    d->iterations++;
    return status == PW_OK && !isfinite (size) ? PW_RETRY : status;
  }
}

int pw_radau_solve (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  radau_set_tolerances (r, h);
  d->reduction = 0.5;
  for (;;) {
    int status = d->renew_F_y ? radau_linearise (r) : PW_OK;
    if (status == PW_OK) status = radau_factor (r, h);
    if (status == PW_OK) status = radau_iterate (r, h, t1);
    d->choose_pivots = status == PW_RETRY && d->near_singular;
    if (status != PW_RETRY || d->F_y_at_state) return status;
    d->renew_F_y = 1;
  }
}

/* ---- Errors ---- */

/* The root mean square of the errors of the states in units of their tolerances. */
static double radau_norm (const pw_method_data *d, const double *e) {
  double sum = 0;
  for (int i = 0; i < 2 * d->dae.n; i++) sum += e[i] * e[i] / (d->tolerance[i] * d->tolerance[i]);
  return sqrt (sum / (2 * d->dae.n));
}

int pw_radau_estimate (pw_run *r, double h, int filter_twice, double *error) {
  pw_method_data *d = r->data;
  int n = d->dae.n;
  double *e = d->F[0], *from_stages = d->F[1];
  double *const *Z = d->now.Z;
  for (int i = 0; i < d->dae.size; i++) { /* F at the state reached is (v, M a, 0) */
    from_stages[i] = i < 2 * n ? d->B[i] / h * pw_radau_sum (0, radau_e, Z, i) : 0;
    e[i] = from_stages[i] + (i < n ? d->now.y[n + i] : i < 2 * n ? d->B[i] * r->a[i - n] : 0);
  }
  if (radau_solve_real (d, e) != PW_OK) return PW_RESOURCE;
  *error = radau_norm (d, e);
  if (!filter_twice || *error < 1) return PW_OK;
  for (int i = 0; i < d->dae.size; i++) d->Y[i] = d->now.y[i] + e[i];
  if (radau_evaluate (r, r->t, d->Y, e) != PW_OK) return PW_OK; /* keeps the first estimate */
  for (int i = 0; i < d->dae.size; i++) e[i] += from_stages[i];
  if (radau_solve_real (d, e) != PW_OK) return PW_RESOURCE;
  *error = radau_norm (d, e);
  return PW_OK;
}

int pw_radau_work (pw_run *r, double h, double t1, double *error) {
  pw_method_data *d = r->data;
  /* the multipliers of the stages are not accurate enough in index3 */
  int entries = r->entries, recomputes = !d->dae.enforces_velocities && pw_ledger_uses_multipliers (r);
  for (int k = 0; k < STAGES; k++) memset (d->now.ledger_change[k], 0, (size_t)entries * sizeof (double));
  for (int k = 0; k < STAGES; k++) {
    pw_radau_stage (d, k);
    double t = pw_before_breakpoint (r, radau_time (r, k, h, t1));
    int status = pw_evaluate_J_at (r->w, t, d->Y, d->Y + d->dae.n);
    if (status != PW_OK) return status;
    pw_tangent_expand (&d->dae.tangent, d->Y + 2 * d->dae.n, d->dae.rows, r->lambda_at);
    if (recomputes && pw_saddle_factor (r->saddle) == PW_OK)
      pw_run_accelerate_updated (r, d->Y + d->dae.n, r->a_at, r->lambda_at);
    pw_ledger_rates (r, r->lambda_at, d->rate);
    for (int i = 0; i < STAGES; i++)
      for (int e = 0; e < entries; e++) d->now.ledger_change[i][e] += h * radau_A[i][k] * d->rate[e];
  }
  for (int e = 0; e < entries; e++)
    r->ledger_at[e] = pw_radau_sum (h * r->rate[e], radau_e, d->now.ledger_change, e) / radau_gamma;
  /* the estimate has order 3, like that of the states */
  *error = fmax (*error, pw_ledger_norm (r, h, r->ledger_at) / fmax (1, pw_radau_rtol (r) / r->settings.rtol));
  return PW_OK;
}
