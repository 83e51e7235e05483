/* radau: the Radau IIA method of order 5 with three stages, with step-size control (Hairer & Wanner 1996, Solving
 * Ordinary Differential Equations II, section IV.8; in index 2 and 3: chapter VII, and Hairer, Lubich & Roche 1989).
 * With y = (q, v, lambda, mu) the equations B y' = F (t, y) are
 *
 *   q' = v - D G^T mu,   M v' = f - J^T lambda
 *   ggl       0 = eta - J v,   0 = -g
 *   index2    0 = eta - J v,             no mu
 *   index3    0 = -g,   0 = b - S v,     no mu
 *
 * with G the holonomic rows of J, S and b the nonholonomic rows of J and eta, D as in tangent.h, B = diag (1, M, 0).
 * The stages y + Z_i at t + c_i h satisfy  B sum_j (A^-1)_ij Z_j = h F (t + c_i h, y + Z_i);  the last one is the new
 * state.  T^-1 A^-1 T = diag (gamma, [ alpha -beta ; beta alpha ]) decouples Newton's equations for W, Z = T W:
 *
 *   (gamma/h B - F_y) dW_1 = r_1,    ((alpha + i beta)/h B - F_y) (dW_2 + i dW_3) = r_2 + i r_3
 *
 * with F_y at y: a real and a complex sparse matrix.  F_y is reused while corrections are on average less than a
 * hundredth of the previous ones, its factors while in addition the step size stays the same.  The error estimate is
 *
 *   err = (gamma/h B - F_y)^-1 (F (t, y) + B sum_i e_i Z_i / h)            of order h^4
 *
 * in units of tolerances of 0.05 rtol^(2/3): h^4 ~ rtol^(2/3), so that the local error, h^6, is about proportional to
 * rtol.  Multipliers are not tested.  The step size follows from the errors of this and the previous step (Gustafsson
 * 1994).
 *
 * Accelerations and multipliers at the ends of steps and in samples are computed from positions and velocities, which
 * are more accurate than the multipliers of the stages.  Work and losses are integrated with the stages. */
#include <stdlib.h>
#include "implicit.h"

/* Coefficients, in the notation above, computed with 60 digits from the nodes c. */
enum { STAGES = 3 };

static const double radau_c[STAGES] = { 0.15505102572168219018, 0.64494897427831780982, 1 };
static const double radau_A[STAGES][STAGES] = {
  { 0.19681547722366042587, -0.06553542585019838811, 0.02377097434822015242 },
  { 0.39442431473908727700, 0.29207341166522846302, -0.04154875212599793020 },
  { 0.37640306270046727505, 0.51248582618842161384, 0.11111111111111111111 },
};
/* The real eigenvalue of A^-1, and the weights of the stages in the error estimate. */
static const double radau_gamma = 3.63783425274449573221;
static const double radau_e[STAGES] = { -10.04880939982741556, 1.38214273316074889, -1. / 3 };
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
/* The last row of A^-1: derivatives at the end of a step. */
static const double radau_derivative_at_end[STAGES] = { 5.53197264742180826186, -7.53197264742180826186, 5 };

enum { RADAU_MOST = 7 }; /* Newton corrections after the first in an adaptive step; RADAU5 makes 6 */

/* A step of size h from t; h = 0: there is none. */
typedef struct {
  double t, h;
  double *y, *Z[STAGES];                  /* unknowns: at t; their changes up to the stages */
  double *ledger, *ledger_change[STAGES]; /* entries: the same of work and losses */
  double *a;                              /* coords: accelerations at t */
} radau_step;

struct pw_method_data {
  pw_dae dae;                           /* the matrix in dae.tangent.scatter is -F_y */
  pw_sparse real, complex;              /* factors of gamma/h B - F_y and (alpha + i beta)/h B - F_y */
  double *value;                        /* of the real matrix; of the complex one, in pairs */
  double *row_factor, *column_factor;   /* unknowns: by which rows and columns of both are multiplied */
  int64_t *diagonal;                    /* 2 coords: index in -F_y of the diagonal entry, to which B is added */
  double *B;                            /* 2 coords: diagonal of B */
  double factored_h;                    /* step size for which both are factorised; 0: none */
  int choose_pivots;                    /* 1: select pivots anew */
  int F_y_at_state;                     /* 1: F_y has been evaluated at the state reached */
  int renew_F_y;                        /* 1: F_y must be evaluated before the next iteration */
  double *W[STAGES], *F[STAGES];        /* unknowns: T^-1 Z; F at the stages, then corrections of W */
  double *Y;                            /* unknowns: at a stage */
  double *complex_x;                    /* unknowns: scratch, complex numbers as pairs */
  double *rate;                         /* entries: scratch */
  double *unit;                         /* 2 coords: units of the states */
  double *tolerance, *newton_tolerance; /* 2 coords: of the error test; of corrections */
  double *round_off;                    /* 2 coords: of the states */
  double contraction;                   /* mean ratio of successive corrections, when last known */
  double remaining;                     /* remaining error over the last correction */
  int iterations;                       /* of the last step */
  double reduction;                     /* factor of the step size if the iteration does not converge */
  radau_step now, last;                 /* the one being made: only y, Z, ledger_change until accepted; the last one */
  double *a_end;                        /* coords: accelerations at the end of the last step */
  int near_singular;                    /* 1: the state reached is near a singular configuration */
  double noise;                         /* corrections up to this, in round_off, are accepted even if they grow */
  double h;                             /* adaptive: size of the next step */
  double previous_h, previous_error;    /* adaptive: size and error of the last step; 0: there is none */
  pw_projector projector;
  char *memory;
};

#define RADAU_REUSE_CONTRACTION 1e-2 /* `contraction` up to which F_y is reused */
#define RADAU_REUSE_GROWTH 1.2 /* growth up to which the step size is not changed, so that the factors are reused */
#define RADAU_SIGNAL_STEP 1e-4 /* step in units of the time scale below which a signal that fails ends the run */

/* y + the weighted sum of entry i of Z at the stages. */
static inline double radau_sum (double y, const double *weight, double *const *Z, int i) {
  return y + weight[0] * Z[0][i] + weight[1] * Z[1][i] + weight[2] * Z[2][i];
}

/* F (t, y), the right-hand side of B y' = F: minus the residual of tangent.h without its terms B y'.  Leaves
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

/* Determines the pattern of F_y and opens both matrices.  PW_OK or PW_RESOURCE. */
static int radau_open_matrices (pw_run *r) {
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

/* The relative tolerance of the error estimate. */
static double radau_rtol (const pw_run *r) {
  return 0.05 * cbrt (r->settings.rtol * r->settings.rtol);
}

/* Sets, for a step of size h, the tolerances of the error test and of Newton's corrections, and the round-off of the
 * states; in index3, which does not enforce J v = eta of holonomic equations, that of velocities is that of positions
 * over h. */
static void radau_set_tolerances (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_settings *settings = &r->settings;
  int n = d->dae.n, index3 = !d->dae.enforces_velocities && d->dae.tangent.holonomic > 0;
  double rtol = radau_rtol (r), newton = fmax (10 * DBL_EPSILON / rtol, fmin (0.03, sqrt (rtol))); /* RADAU5's */
  double largest = 1; /* the largest coordinate in units of the scene: its round-off may affect others */
  for (int j = 0; j < n; j++) largest = fmax (largest, fabs (d->now.y[j]) / d->unit[j]);
  for (int i = 0; i < 2 * n; i++) {
    double size = fabs (d->now.y[i]);
    double offset = settings->atol > 0 && d->unit[i] < INFINITY ? settings->atol / settings->rtol : d->unit[i];
    double typical = index3 && i >= n ? fmax (d->unit[i], largest * d->unit[i - n] / h) : d->unit[i];
    d->round_off[i] = fmin (8 * DBL_EPSILON * (size + typical), 0.1 * r->tolerance_bound[i]);
    d->tolerance[i] = fmax (fmin (rtol * (size + offset), r->tolerance_bound[i]), d->round_off[i]);
    d->newton_tolerance[i] = r->fixed_steps ? d->round_off[i] : fmax (newton * d->tolerance[i], d->round_off[i]);
  }
}

/* The polynomial p of degree 3 with p (0) = 0 and p (c_i) = p_i is p (x) = sum_i weight[i] p_i. */
static void radau_basis (double x, double *weight) {
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
      radau_basis (1 + ch / last->h, weight);
      for (int i = 0; i < d->dae.size; i++) Z[i] = radau_sum (last->y[i] - d->now.y[i], weight, last->Z, i);
      continue;
    }
    memset (Z, 0, (size_t)d->dae.size * sizeof *Z);
    for (int j = 0, n = d->dae.n; j < n; j++)
      Z[j] = ch * (d->now.y[n + j] + 0.5 * ch * r->a[j]), Z[n + j] = ch * r->a[j];
  }
  radau_combine (d, radau_inverse_T, d->now.Z, d->W);
}

/* Stores the unknowns at stage k in d->Y. */
static void radau_stage (const pw_method_data *d, int k) {
  for (int i = 0; i < d->dae.size; i++) d->Y[i] = d->now.y[i] + d->now.Z[k][i];
}

static double radau_time (const pw_run *r, int k, double h, double t1) {
  return k == STAGES - 1 ? t1 : r->t + radau_c[k] * h;
}

/* One correction of W; *size, *round_offs: its largest entry in q, v, in units of newton_tolerance and of round_off. */
static int radau_correct (pw_run *r, double h, double t1, double *size, double *round_offs) {
  pw_method_data *d = r->data;
  double *const *W = d->W, *const *F = d->F, *x = d->complex_x;
  for (int k = 0; k < STAGES; k++) {
    radau_stage (d, k);
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
  for (int i = 0; i < d->dae.size; i++)
    x[2 * i] = d->row_factor[i] * F[1][i], x[2 * i + 1] = d->row_factor[i] * F[2][i];
  if (radau_solve_real (d, F[0]) != PW_OK || pw_sparse_solve (&d->complex, x) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < d->dae.size; i++)
    F[1][i] = d->column_factor[i] * x[2 * i], F[2][i] = d->column_factor[i] * x[2 * i + 1];
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
  const int most = fixed ? 50 : RADAU_MOST; /* corrections after the first; a fixed step cannot be made shorter */
  d->reduction = 0.5;
  if (!isfinite (size)) return PW_DIVERGED;
  if (size == 0) return PW_CONVERGED;
  if (done == 0) { /* where forces saturate or turn, the first correction may be small far from the solution (run.c) */
    if (fixed || r->s->saturates || r->update_given) return PW_ITERATE;
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

/* Newton's iteration for the stages with the present factors.  PW_OK; PW_RETRY if it does not converge; else as
 * radau_correct.  With F_y at the state reached, corrections up to `noise` are accepted even if they grow.
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

/* Solves for the stages of the step to t1 = t + h.  PW_RETRY if Newton's iteration does not converge, PW_SINGULAR if
 * its matrix is, PW_METHOD if a signal failed, PW_RESOURCE. */
static int radau_solve (pw_run *r, double h, double t1) {
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

/* The root mean square of the errors of the states in units of their tolerances. */
static double radau_norm (const pw_method_data *d, const double *e) {
  double sum = 0;
  for (int i = 0; i < 2 * d->dae.n; i++) sum += e[i] * e[i] / (d->tolerance[i] * d->tolerance[i]);
  return sqrt (sum / (2 * d->dae.n));
}

/* The error of the states in units of their tolerances.  filter_twice: 1 to filter an error that is too large a second
 * time, as is needed in initial transients (Hairer & Wanner 1996, section IV.8).  PW_OK or PW_RESOURCE. */
static int radau_estimate (pw_run *r, double h, int filter_twice, double *error) {
  pw_method_data *d = r->data;
  int n = d->dae.n;
  double *e = d->F[0], *from_stages = d->F[1];
  double *const *Z = d->now.Z;
  for (int i = 0; i < d->dae.size; i++) { /* F at the state reached is (v, M a, 0) */
    from_stages[i] = i < 2 * n ? d->B[i] / h * radau_sum (0, radau_e, Z, i) : 0;
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

/* Work and losses up to the stages; *error becomes their error, in units of their tolerance, if that is larger.
 * Returns as pw_update_kinematics. */
static int radau_work (pw_run *r, double h, double t1, double *error) {
  pw_method_data *d = r->data;
  /* the multipliers of the stages are not accurate enough in index3 */
  int entries = r->entries, recomputes = !d->dae.enforces_velocities && pw_ledger_uses_multipliers (r);
  for (int k = 0; k < STAGES; k++) memset (d->now.ledger_change[k], 0, (size_t)entries * sizeof (double));
  for (int k = 0; k < STAGES; k++) {
    radau_stage (d, k);
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
    r->ledger_at[e] = radau_sum (h * r->rate[e], radau_e, d->now.ledger_change, e) / radau_gamma;
  /* this estimate is of order h^4, too: the tolerances of the ledger are widened in the same ratio */
  *error = fmax (*error, pw_ledger_norm (r, h, r->ledger_at) / fmax (1, radau_rtol (r) / r->settings.rtol));
  return PW_OK;
}

/* Sets d->noise at the state reached.  Round-off of the largest coordinate may affect others; at the sine s, solutions
 * magnify it by 1/s^2.  r->saddle must be factorised at the state reached. */
static void radau_measure_noise (pw_run *r) {
  double sine = pw_saddle_sine (r->saddle, NULL), largest = 1;
  for (int j = 0; j < r->s->mechanical; j++) largest = fmax (largest, fabs (r->q[j]) / pw_unit (r->s, j));
  r->data->noise = fmin (64 / (sine * sine), 1e7) * largest;
}

static int radau_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  double time_scale = r->w->scale.time;
  (void)error;
  r->counter = (pw_step_counter){ .base = r->t };
  d->last.t = r->t;
  d->previous_h = d->last.h = 0;
  d->remaining = 1;
  d->renew_F_y = 1;
  d->F_y_at_state = 0;
  d->near_singular = r->near_singular;
  radau_measure_noise (r);
  d->h = pw_first_step (r);
  if (d->h >= 0.5 * time_scale * sqrt (r->settings.rtol)) /* saturating forces do not limit it */
    d->h = fmax (d->h, 0.1 * time_scale * sqrt (sqrt (radau_rtol (r))));
  memcpy (d->now.y, r->q, (size_t)d->dae.n * sizeof (double));
  memcpy (d->now.y + d->dae.n, r->v, (size_t)d->dae.n * sizeof (double));
  memset (d->now.y + 2 * d->dae.n, 0, (size_t)(d->dae.rows + d->dae.mu_count) * sizeof (double));
  pw_tangent_compress (&d->dae.tangent, r->lambda, d->dae.rows, d->now.y + 2 * d->dae.n);
  return PW_OK;
}

static int radau_allocate (pw_run *r) {
  pw_method_data *d = r->data;
  const int n = d->dae.size + 6; /* of all arrays of unknowns, with room for three more coordinates */
  double *stage, *change;
  d->memory = PW_ALLOC_ARRAYS (
      PW_ARRAY (d->B, n), PW_ARRAY (d->unit, n), PW_ARRAY (d->tolerance, n), PW_ARRAY (d->newton_tolerance, n),
      PW_ARRAY (d->round_off, n), PW_ARRAY (d->row_factor, n), PW_ARRAY (d->column_factor, n), PW_ARRAY (d->Y, n),
      PW_ARRAY (d->a_end, n), PW_ARRAY (d->now.y, n), PW_ARRAY (d->last.y, n), PW_ARRAY (d->now.a, n),
      PW_ARRAY (d->last.a, n), PW_ARRAY (d->complex_x, 2 * n), PW_ARRAY (stage, 4 * STAGES * n),
      PW_ARRAY (change, 2 * STAGES * r->entries), PW_ARRAY (d->rate, r->entries), PW_ARRAY (d->now.ledger, r->entries),
      PW_ARRAY (d->last.ledger, r->entries));
  for (int k = 0; d->memory && k < STAGES; k++, stage += 4 * n, change += 2 * r->entries) {
    d->now.Z[k] = stage, d->last.Z[k] = stage + n, d->W[k] = stage + 2 * n, d->F[k] = stage + 3 * n;
    d->now.ledger_change[k] = change, d->last.ledger_change[k] = change + r->entries;
  }
  return d->memory ? PW_OK : PW_RESOURCE;
}

static int radau_open (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  int status = d ? pw_dae_open (&d->dae, r) : PW_RESOURCE;
  if (status == PW_OK) status = radau_allocate (r);
  if (status == PW_OK) status = radau_open_matrices (r);
  if (status != PW_OK) return pw_fail_memory (r->s, error);
  for (int j = 0, n = d->dae.n; j < n; j++) {
    d->B[j] = 1, d->B[n + j] = r->s->mass[j];
    d->unit[j] = pw_is_hidden (r->s, j) ? INFINITY : pw_unit (r->s, j), d->unit[n + j] = pw_velocity_unit (r, j, 0);
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
    for (int j = 0, n = d->dae.n; j < n; j++) r->a[j] = radau_sum (0, radau_derivative_at_end, d->last.Z, n + j) / h;
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
  radau_stage (d, STAGES - 1);
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
  double safety = 0.9 * fmin (1, (1. + 2 * RADAU_MOST) / (d->iterations + 2 * RADAU_MOST));
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
 * or steps are fixed.  filter_twice: as in radau_estimate. */
static int radau_try (pw_run *r, double h, double t1, int filter_twice, double *error) {
  *error = INFINITY;
  r->near_singular = 0;
  int status = radau_solve (r, h, t1);
  if (status == PW_OK && !r->fixed_steps) status = radau_estimate (r, h, filter_twice, error);
  if (status == PW_OK && r->entries > 0 && (*error < 1 || r->fixed_steps)) status = radau_work (r, h, t1, error);
  return status;
}

static int radau_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  int whole;
  double err, t1 = pw_step_end (r, t_end, &whole), h = whole ? r->settings.step : t1 - r->t;
  int status = radau_try (r, h, t1, 0, &err);
  if (status == PW_OK) status = radau_accept (r, h, t1);
  if (status != PW_OK) return pw_implicit_fail (r, status, h, error);
  pw_count_step (r, whole, t1);
  return PW_OK;
}

/* In index3 the state reached violates g = 0 and J v = eta within the tolerances.  A step of size h removes a
 * violation d by velocities of about d/h, so that shorter steps do not reduce the error: then the state is projected.
 * */
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
    if (status == PW_OK && err < 1) {
      double next = radau_next_h (d, h, err, rejected);
      status = radau_accept (r, h, t1);
      if (status == PW_OK) { /* a shortened step does not reduce the next one */
        d->h = shortened ? fmax (next, d->h) : next;
        d->previous_h = h, d->previous_error = fmax (1e-2, err);
        return PW_OK;
      }
    }
    int signal_fails = status == PW_METHOD && h < RADAU_SIGNAL_STEP * r->w->scale.time;
    if (status == PW_RESOURCE || status == PW_SINGULAR || signal_fails) return pw_implicit_fail (r, status, h, error);
    r->statistics.rejected++;
    d->renew_F_y = !d->F_y_at_state;
    if (status == PW_OK && rejected > 0) radau_project_start (r);
    if (status == PW_OK)
      d->h = fmin (0.9 * h, radau_next_h (d, h, err, 1));
    else
      d->h = h * (status == PW_RETRY ? d->reduction : 0.25);
  }
}

/* The quintic through positions, velocities and accelerations at both ends of the last step, at x in [0, 1]. */
static void radau_quintic (const pw_run *r, double x, double *q, double *v) {
  const pw_method_data *d = r->data;
  double h = d->last.h;
  for (int j = 0; j < d->dae.n; j++) {
    double q0 = d->last.y[j], v0 = h * d->last.y[d->dae.n + j], a0 = 0.5 * h * h * d->last.a[j];
    double dq = d->now.y[j] - q0 - v0 - a0, dv = h * d->now.y[d->dae.n + j] - v0 - 2 * a0; /* not r->q: see events.h */
    double da = 0.5 * h * h * (d->a_end[j] - d->last.a[j]);
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
  radau_basis (x, weight);
  for (int i = 0; i < d->dae.size; i++) y[i] = radau_sum (p->y[i], weight, p->Z, i);
  memcpy (r->q_at, y, (size_t)n * sizeof *y);
  memcpy (r->v_at, y + n, (size_t)n * sizeof *y);
  pw_tangent_expand (&d->dae.tangent, y + 2 * n, d->dae.rows, r->lambda_at);
  for (int j = 0; j < n; j++) r->a_at[j] = (1 - x) * p->a[j] + x * d->a_end[j];
  for (int e = 0; e < r->entries; e++) r->ledger_at[e] = radau_sum (p->ledger[e], weight, p->ledger_change, e);
  radau_quintic (r, x, q, v);
  if (!radau_quintic_agrees (r, q, v)) return;
  memcpy (r->q_at, q, (size_t)n * sizeof *q);
  memcpy (r->v_at, v, (size_t)n * sizeof *v);
}

/* Projects the sample onto the constraints that the steps satisfy, in index3 onto g = 0 only, and computes
 * accelerations and multipliers from it. */
static int radau_interpolate (pw_run *r, double t) {
  pw_method_data *d = r->data;
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
  return pw_sample_last_step (r, d->last.t, t, radau_interpolate, error);
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
