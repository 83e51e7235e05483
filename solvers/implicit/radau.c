/* radau: the Radau IIA method of order 5 with three stages, with step-size control (Hairer & Wanner 1996, Solving
 * Ordinary Differential Equations II, section IV.8; as applied to differential-algebraic equations: sections VI.4, VII.4,
 * and Hairer, Lubich & Roche 1989).  With y = (q, v, lambda, mu) the equations B y' = F (t, y) are
 *
 *   q' = v - D G^T mu,   M v' = f - J^T lambda,   D as in ida
 *   ggl       0 = eta - J v,   0 = -g
 *   index2    0 = eta - J v,                                               mu = 0
 *   index3    0 = -g,   0 = b - S v   (nonholonomic rows)                  mu = 0
 *
 * The stages y + Z_i at t + c_i h satisfy  B sum_j (A^-1)_ij Z_j = h F (t + c_i h, y + Z_i);  the last one is the new
 * state.  T^-1 A^-1 T = diag (gamma, [ alpha -beta ; beta alpha ]) decouples Newton's equations for W, Z = T W:
 *
 *   (gamma/h B - F_y) dW_1 = r_1,    ((alpha + i beta)/h B - F_y) (dW_2 + i dW_3) = r_2 + i r_3
 *
 * with F_y at y: a real and a complex sparse matrix.  F_y is kept while the iteration contracts by a factor below 1e-3,
 * the factors while in addition the step would hardly change.
 *
 *   err = (gamma/h B - F_y)^-1 (F (t, y) + B sum_i e_i Z_i / h)            of order h^4
 *
 * in units of tolerances of 0.05 rtol^(2/3), which makes the error of order 5 about proportional to rtol.  Errors of
 * lambda and mu are multiplied by h/T, in index3 those of v and lambda by h/T and (h/T)^2, with the time scale T: they
 * are larger by that power.  The step follows from the errors of this and the previous step (Gustafsson 1994).
 *
 * Accelerations and multipliers at the ends of steps and in samples are computed from positions and velocities, which
 * are more accurate than the multipliers of the stages.  Work and losses are integrated with the stages. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"
#include "sparse.h"
#include "tangent.h"
#include "util.h"

enum { STAGES = 3 };

#define RADAU_KEEP 1e-2   /* contraction rate below which F_y is kept */
#define RADAU_SIGNAL 1e-4 /* of the time scale: step below which a signal that fails ends the run */
#define RADAU_LONGER 1.2  /* factor of the step below which the matrices are kept */

static const double radau_c[STAGES] = { 0.15505102572168219018, 0.64494897427831780982, 1 };
static const double radau_A[STAGES][STAGES] = {
  { 0.19681547722366042587, -0.06553542585019838811, 0.02377097434822015242 },
  { 0.39442431473908727700, 0.29207341166522846302, -0.04154875212599793020 },
  { 0.37640306270046727505, 0.51248582618842161384, 0.11111111111111111111 },
};
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
static const double radau_gamma = 3.63783425274449573221, radau_alpha = 2.68108287362775213390,
                    radau_beta = 3.05043019924741056943;
static const double radau_e[STAGES] = { -10.04880939982741556, 1.38214273316074889, -1. / 3 };
/* The last row of A^-1: derivatives at the end of a step. */
static const double radau_end[STAGES] = { 5.53197264742180826186, -7.53197264742180826186, 5 };

/* A step from y at t; of the last one, the polynomial through its stages. */
typedef struct {
  double t, h;                /* h = 0: there is none */
  double *y, *Z[STAGES];      /* unknowns */
  double *ledger, *w[STAGES]; /* entries: at t; their changes up to the stages */
  double *a;                  /* coords: accelerations at t */
} radau_step;

struct pw_method_data {
  int fixed;              /* 1: fixed steps */
  int velocities;         /* 1: J v = eta; 0: g = 0 in place of its holonomic rows */
  int n, rows, mus, size; /* coordinates, independent equations, multipliers mu, unknowns */
  pw_tangent tangent;
  pw_sparse real, complex;
  double *matrix;                        /* -F_y */
  double *value;                         /* of the real matrix; of the complex one, in pairs */
  int64_t *diagonal;                     /* 2 n: where B is added */
  double *D, *B;                         /* coords; 2 n: diagonal of B */
  double *unit;                          /* unknowns: their units */
  double *tolerance, *enough, *floor;    /* unknowns: of the error test, of corrections; round-off */
  double *row, *column;                  /* scales of the matrices */
  double *W[STAGES], *F[STAGES], *x, *Y; /* unknowns; x: twice */
  double *pull, *f, *jv, *eta;           /* scratch: coords + 3, coords + 3, rows, rows */
  double *rates;                         /* entries */
  radau_step now, last;
  double *a1;              /* coords: accelerations at the end of the last step */
  double base;             /* fixed steps: time from which they are counted */
  long count;              /* steps since then */
  double h, before, error; /* the next step; size and error of the last one, 0: none */
  double factored;         /* step for which the matrices are factorised; 0: none */
  int forget;              /* 1: select pivots anew */
  int current, outdated;   /* F_y was evaluated at y; it must be evaluated again */
  double rate, left;       /* of the last iteration: contraction rate, remaining error over the last correction */
  double shorter;          /* factor of the step if the iteration does not converge */
  int iterations;
  int near; /* 1: the state reached is near a singular configuration */
  pw_projector projector;
  char *memory;
};

typedef struct pw_method_data radau;

/* ---- Equations ---- */

/* F (t, y); leaves kinematics and J there. */
static int radau_evaluate (pw_run *r, double t, const double *y, double *F) {
  radau *d = r->data;
  int n = d->n;
  int status = pw_update_kinematics (r->w, pw_before_breakpoint (r, t), y, y + n);
  if (status != PW_OK) return status;
  pw_evaluate_J (r->w);
  r->statistics.rhs++;
  memset (d->pull, 0, (size_t)n * sizeof *d->pull);
  if (d->mus) pw_add_JT (r->w, pw_tangent_expand (&d->tangent, y + 2 * n + d->rows, d->mus, d->tangent.mu), d->pull);
  for (int j = 0; j < n; j++) F[j] = y[n + j] - d->D[j] * d->pull[j];
  memset (d->pull, 0, (size_t)n * sizeof *d->pull);
  pw_add_JT (r->w, pw_tangent_expand (&d->tangent, y + 2 * n, d->rows, d->tangent.lambda), d->pull);
  pw_evaluate_force (r->w, d->f);
  for (int j = 0; j < n; j++) F[n + j] = d->f[j] - d->pull[j];
  pw_mul_J (r->w, y + n, d->jv);
  pw_evaluate_eta (r->w, d->eta);
  for (int i = 0; i < r->s->rows; i++) d->jv[i] = d->eta[i] - d->jv[i];
  if (d->mus || !d->velocities) pw_evaluate_g (r->w, d->eta);
  for (int i = 0; i < r->s->holonomic; i++) {
    if (!d->velocities) d->jv[i] = -d->eta[i];
    d->eta[i] = -d->eta[i];
  }
  pw_tangent_compress (&d->tangent, d->jv, d->rows, F + 2 * n);
  pw_tangent_compress (&d->tangent, d->eta, d->mus, F + 2 * n + d->rows);
  return PW_OK;
}

/* ---- Matrices ---- */

static void radau_fill (radau *d) {
  int n = d->n, mu = 2 * n + d->rows;
  const double *y = d->now.y;
  const pw_tangent_update to = {
    .momentum = n, .constraint = 2 * n, .v = n, .a = n, .lambda = 2 * n, .mu = mu, .of_lambda = 1
  };
  const double *mus = d->mus ? pw_tangent_expand (&d->tangent, y + mu, d->mus, d->tangent.mu) : NULL;
  pw_tangent_kinematics (&d->tangent, &to, mus, d->D);
  pw_tangent_momentum (&d->tangent, &to, pw_tangent_expand (&d->tangent, y + 2 * n, d->rows, d->tangent.lambda));
  pw_tangent_velocities (&d->tangent, &to, y + n, d->velocities);
  if (d->mus || !d->velocities) pw_tangent_positions (&d->tangent, &to, d->velocities ? mu : 2 * n);
}

static int radau_open_matrices (pw_run *r) {
  radau *d = r->data;
  pw_tangent *x = &d->tangent;
  pw_scatter_record (&x->tape);
  radau_fill (d);
  if (pw_scatter_lay_out (&x->tape, d->size, &x->colptr, &x->rowind) != PW_OK) return PW_RESOURCE;
  size_t nonzeros = (size_t)x->colptr[d->size] + 1;
  d->matrix = malloc (nonzeros * sizeof *d->matrix);
  d->value = malloc (2 * nonzeros * sizeof *d->value);
  d->diagonal = malloc (((size_t)(2 * d->n) + 1) * sizeof *d->diagonal);
  if (!d->matrix || !d->value || !d->diagonal) return PW_RESOURCE;
  for (int j = 0; j < 2 * d->n; j++)
    for (d->diagonal[j] = x->colptr[j]; x->rowind[d->diagonal[j]] != j;) d->diagonal[j]++;
  int status = pw_sparse_open (&d->real, d->size, x->colptr, x->rowind);
  return status == PW_OK ? pw_sparse_open_complex (&d->complex, d->size, x->colptr, x->rowind) : status;
}

/* Evaluates F_y at the beginning of the step. */
static int radau_linearise (pw_run *r) {
  radau *d = r->data;
  const double *y = d->now.y;
  int status = pw_update_kinematics (r->w, r->t, y, y + d->n);
  if (status != PW_OK) return status;
  pw_evaluate_J (r->w);
  memset (d->matrix, 0, (size_t)d->tangent.colptr[d->size] * sizeof *d->matrix);
  pw_scatter_begin (&d->tangent.tape, d->matrix);
  radau_fill (d);
  pw_matrix_evaluated (r, y, y + d->n);
  r->statistics.jacobians++;
  d->current = 1;
  d->outdated = 0;
  d->factored = 0;
  return PW_OK;
}

/* Scales of rows and columns for a step of size h, as in galpha. */
static void radau_scale (const pw_run *r, double h) {
  radau *d = r->data;
  int n = d->n, third = d->velocities ? 0 : d->tangent.holonomic;
  double c = radau_gamma / h, mass = 0;
  for (int j = 0; j < n; j++) mass = fmax (mass, r->s->mass[j]);
  if (mass == 0) mass = 1;
  for (int j = 0; j < n; j++) {
    d->row[j] = 1 / c, d->column[j] = 1;
    d->row[n + j] = 1 / (c * c * mass), d->column[n + j] = c;
  }
  for (int i = 0; i < d->rows; i++) d->row[2 * n + i] = i < third ? 1 : 1 / c, d->column[2 * n + i] = c * c * mass;
  for (int i = 2 * n + d->rows; i < d->size; i++) d->row[i] = 1, d->column[i] = c;
}

/* Stores -F_y + re B in every stride-th value, scaled, and im B in the value after it. */
static void radau_shift (radau *d, int stride, double re, double im) {
  const int64_t *colptr = d->tangent.colptr, *rowind = d->tangent.rowind;
  for (int c = 0; c < d->size; c++)
    for (int64_t i = colptr[c]; i < colptr[c + 1]; i++) {
      double scale = d->row[rowind[i]] * d->column[c], b = c < 2 * d->n && i == d->diagonal[c] ? d->B[c] : 0;
      d->value[stride * i] = scale * (d->matrix[i] + re * b);
      if (stride == 2) d->value[2 * i + 1] = scale * im * b;
    }
}

static int radau_factor (pw_run *r, double h) {
  radau *d = r->data;
  if (d->factored == h) return PW_OK;
  d->factored = 0;
  if (d->forget) pw_sparse_forget (&d->real), pw_sparse_forget (&d->complex);
  d->forget = 0;
  radau_scale (r, h);
  radau_shift (d, 1, radau_gamma / h, 0);
  int status = pw_sparse_factor (&d->real, d->value);
  radau_shift (d, 2, radau_alpha / h, radau_beta / h);
  if (status == PW_OK) status = pw_sparse_factor (&d->complex, d->value);
  r->statistics.factorisations += 2;
  if (status == PW_OK) d->factored = h;
  return status > 0 ? PW_INPUT : status;
}

/* x = (gamma/h B - F_y)^-1 x */
static int radau_solve_real (radau *d, double *x) {
  for (int i = 0; i < d->size; i++) x[i] *= d->row[i];
  int status = pw_sparse_solve (&d->real, x);
  for (int i = 0; i < d->size; i++) x[i] *= d->column[i];
  return status;
}

/* The same with the complex matrix, for re + i im. */
static int radau_solve_complex (radau *d, double *re, double *im) {
  double *x = d->x;
  for (int i = 0; i < d->size; i++) x[2 * i] = d->row[i] * re[i], x[2 * i + 1] = d->row[i] * im[i];
  int status = pw_sparse_solve (&d->complex, x);
  for (int i = 0; i < d->size; i++) re[i] = d->column[i] * x[2 * i], im[i] = d->column[i] * x[2 * i + 1];
  return status;
}

/* ---- Tolerances ---- */

/* The relative tolerance of the error estimate, whose order is 3. */
static double radau_rtol (const pw_run *r) {
  return 0.05 * cbrt (r->settings.rtol * r->settings.rtol);
}

/* Sets the tolerances for a step of size h: of the error test, of Newton's corrections, and their round-off, which in
 * index3 is that of positions over h. */
static void radau_weigh (pw_run *r, double h) {
  radau *d = r->data;
  const pw_settings *set = &r->settings;
  int n = d->n, third = !d->velocities && d->tangent.holonomic > 0;
  double rtol = radau_rtol (r), newton = fmax (10 * DBL_EPSILON / rtol, fmin (0.03, sqrt (rtol)));
  double large = 1; /* the largest coordinate: its round-off may affect others */
  for (int j = 0; j < n; j++) large = fmax (large, fabs (d->now.y[j]) / d->unit[j]);
  for (int i = 0; i < 2 * n; i++) {
    double size = fabs (d->now.y[i]), least = set->atol > 0 ? set->atol / set->rtol : d->unit[i];
    double unit = third && i >= n ? fmax (d->unit[i], large * d->unit[i - n] / h) : d->unit[i];
    d->tolerance[i] = fmin (rtol * (size + least), r->saturation[i]);
    d->floor[i] = fmin (8 * DBL_EPSILON * (size + unit), 0.1 * r->saturation[i]);
    d->enough[i] = d->fixed ? d->floor[i] : fmax (newton * d->tolerance[i], d->floor[i]);
  }
}

/* ---- Newton's iteration ---- */

/* Weights of the values at the nodes c_i in the polynomial that is 0 at 0, at x. */
static void radau_basis (double x, double *weight) {
  for (int i = 0; i < STAGES; i++) {
    weight[i] = x / radau_c[i];
    for (int k = 0; k < STAGES; k++)
      if (k != i) weight[i] *= (x - radau_c[k]) / (radau_c[i] - radau_c[k]);
  }
}

static void radau_combine (radau *d, const double by[STAGES][STAGES], double *const *from, double *const *to) {
  for (int i = 0; i < d->size; i++) {
    double a = from[0][i], b = from[1][i], c = from[2][i];
    for (int k = 0; k < STAGES; k++) to[k][i] = by[k][0] * a + by[k][1] * b + by[k][2] * c;
  }
}

/* Starting values: the polynomial of the last step, or else constant accelerations and multipliers. */
static void radau_predict (pw_run *r, double h) {
  radau *d = r->data;
  const radau_step *last = &d->last;
  double weight[STAGES];
  for (int k = 0; k < STAGES; k++) {
    double *Z = d->now.Z[k], ch = radau_c[k] * h;
    if (last->h > 0) {
      radau_basis (1 + ch / last->h, weight);
      for (int i = 0; i < d->size; i++)
        Z[i] = last->y[i] - d->now.y[i] + weight[0] * last->Z[0][i] + weight[1] * last->Z[1][i] +
               weight[2] * last->Z[2][i];
      continue;
    }
    memset (Z, 0, (size_t)d->size * sizeof *Z);
    for (int j = 0; j < d->n; j++) Z[j] = ch * (r->v[j] + 0.5 * ch * r->a[j]), Z[d->n + j] = ch * r->a[j];
  }
  radau_combine (d, radau_inverse_T, d->now.Z, d->W);
}

static void radau_stage (const radau *d, int k) {
  for (int i = 0; i < d->size; i++) d->Y[i] = d->now.y[i] + d->now.Z[k][i];
}

static double radau_time (const pw_run *r, int k, double h, double t1) {
  return k == STAGES - 1 ? t1 : r->t + radau_c[k] * h;
}

/* One correction; *size, *rough: the largest in units of `enough` and of round-off. */
static int radau_correct (pw_run *r, double h, double t1, double *size, double *rough) {
  radau *d = r->data;
  double *const *W = d->W, *const *F = d->F;
  for (int k = 0; k < STAGES; k++) {
    radau_stage (d, k);
    int status = radau_evaluate (r, radau_time (r, k, h, t1), d->Y, F[k]);
    if (status != PW_OK) return status;
  }
  radau_combine (d, radau_inverse_T, F, F);
  for (int i = 0; i < 2 * d->n; i++) {
    double b = d->B[i] / h;
    F[0][i] -= b * radau_gamma * W[0][i];
    F[1][i] -= b * (radau_alpha * W[1][i] - radau_beta * W[2][i]);
    F[2][i] -= b * (radau_beta * W[1][i] + radau_alpha * W[2][i]);
  }
  if (radau_solve_real (d, F[0]) != PW_OK || radau_solve_complex (d, F[1], F[2]) != PW_OK) return PW_RESOURCE;
  *size = *rough = 0;
  for (int i = 0; i < 2 * d->n; i++) {
    double most = pw_largest (pw_largest (fabs (F[0][i]), fabs (F[1][i])), fabs (F[2][i]));
    *size = pw_largest (*size, most / d->enough[i]);
    *rough = pw_largest (*rough, most / d->floor[i]);
  }
  for (int k = 0; k < STAGES; k++)
    for (int i = 0; i < d->size; i++) W[k][i] += F[k][i];
  radau_combine (d, radau_T, W, d->now.Z);
  return PW_OK;
}

/* 1: converged; 0: continue; -1: it will not converge in time.  size: of the correction, before: of the previous one. */
static int radau_converged (pw_run *r, int done, double size, double before, double rough) {
  radau *d = r->data;
  const int most = d->fixed ? 50 : 7;
  d->shorter = 0.5;
  if (!isfinite (size)) return -1;
  if (size == 0) return 1;
  if (done == 0) {
    if (d->fixed || r->s->saturates) return 0;
    d->left = pow (fmax (d->left, DBL_EPSILON), 0.8);
    return d->left * size <= 1;
  }
  double rate = size / before;
  d->rate = done == 1 ? rate : sqrt (rate * d->rate);
  if (rate > 0.3 && rough <= (d->near ? 1e7 : 64)) return 1;
  d->left = d->rate < 0.99 ? d->rate / (1 - d->rate) : 100;
  if (d->left * size <= 1) return 1;
  if (d->fixed && done < most && (done < 4 || d->rate < 1)) return 0;
  if (!(d->rate < 0.99)) return -1;
  double end = d->left * size * pow (d->rate, most - 1 - done);
  if (done < most && end < 1) return 0;
  d->shorter = 0.8 * pow (fmax (1e-4, fmin (20, end)), -1. / (most + 3 - done));
  return -1;
}

static int radau_iterate (pw_run *r, double h, double t1) {
  radau *d = r->data;
  double size = 0, before, rough;
  radau_predict (r, h);
  for (int done = 0;; done++) {
    before = size;
    int status = radau_correct (r, h, t1, &size, &rough);
    if (status != PW_OK) return status;
    int good = radau_converged (r, done, size, before, rough);
    d->iterations = done + 1;
    if (good) return good > 0 ? PW_OK : PW_RETRY;
  }
}

/* Solves for the stages of the step to t1 = t + h. */
static int radau_solve (pw_run *r, double h, double t1) {
  radau *d = r->data;
  if (!d->current && d->outdated) d->factored = 0;
  radau_weigh (r, h);
  d->shorter = 0.5;
  for (;;) {
    int status = d->outdated ? radau_linearise (r) : PW_OK;
    if (status == PW_OK) status = radau_factor (r, h);
    if (status == PW_OK) status = radau_iterate (r, h, t1);
    d->forget = status == PW_RETRY;
    if (status != PW_RETRY || d->current) return status;
    d->outdated = 1;
  }
}

/* ---- Errors ---- */

/* Root of the sum of the squares of errors in units of the tolerances, over the number of states. */
static double radau_norm (const radau *d, const double *e) {
  double sum = 0;
  for (int i = 0; i < 2 * d->n; i++) sum += e[i] * e[i] / (d->tolerance[i] * d->tolerance[i]);
  return sqrt (sum / (2 * d->n));
}

/* The error of the states; again: filtered twice if it is too large, as is needed in initial transients. */
static int radau_estimate (pw_run *r, double h, int again, double *error) {
  radau *d = r->data;
  int n = d->n;
  double *e = d->F[0], *rest = d->F[1];
  double *const *Z = d->now.Z;
  for (int i = 0; i < d->size; i++) {
    rest[i] = i < 2 * n ? d->B[i] / h * (radau_e[0] * Z[0][i] + radau_e[1] * Z[1][i] + radau_e[2] * Z[2][i]) : 0;
    e[i] = rest[i] + (i < n ? r->v[i] : i < 2 * n ? d->B[i] * r->a[i - n] : 0);
  }
  if (radau_solve_real (d, e) != PW_OK) return PW_RESOURCE;
  *error = radau_norm (d, e);
  if (!again || *error < 1) return PW_OK;
  for (int i = 0; i < d->size; i++) d->Y[i] = d->now.y[i] + e[i];
  if (radau_evaluate (r, r->t, d->Y, e) != PW_OK) return PW_OK;
  for (int i = 0; i < d->size; i++) e[i] += rest[i];
  if (radau_solve_real (d, e) != PW_OK) return PW_RESOURCE;
  *error = radau_norm (d, e);
  return PW_OK;
}

/* Work and losses up to the stages, and their error. */
static int radau_work (pw_run *r, double h, double t1, double *error) {
  radau *d = r->data;
  int entries = r->s->entries, again = !d->velocities && pw_ledger_reacts (r->s);
  double sum = 0;
  for (int k = 0; k < STAGES; k++) memset (d->now.w[k], 0, (size_t)entries * sizeof (double));
  for (int k = 0; k < STAGES; k++) {
    radau_stage (d, k);
    double t = pw_before_breakpoint (r, radau_time (r, k, h, t1));
    int status = pw_update_kinematics (r->w, t, d->Y, d->Y + d->n);
    if (status != PW_OK) return status;
    pw_evaluate_J (r->w);
    const double *lambda = pw_tangent_expand (&d->tangent, d->Y + 2 * d->n, d->rows, d->tangent.lambda);
    if (again && pw_saddle_factor (r->saddle) == PW_OK) {
      pw_run_accelerate_updated (r, d->Y + d->n, r->a_at, r->lambda_at);
      lambda = r->lambda_at;
    }
    pw_ledger_rates (r, lambda, d->rates);
    for (int i = 0; i < STAGES; i++)
      for (int e = 0; e < entries; e++) d->now.w[i][e] += h * radau_A[i][k] * d->rates[e];
  }
  for (int e = 0; e < entries; e++) {
    double off = h * r->rate[e];
    for (int k = 0; k < STAGES; k++) off += radau_e[k] * d->now.w[k][e];
    sum += off * off;
  }
  double tolerance = pw_ledger_tolerance (r, h) * fmax (1, radau_rtol (r) / r->settings.rtol);
  *error = fmax (*error, sqrt (sum) / radau_gamma / tolerance);
  return PW_OK;
}

/* ---- Opening ---- */

static int radau_restart (pw_run *r, pw_error *error) {
  radau *d = r->data;
  double T = r->w->scale.time;
  (void)error;
  d->base = d->last.t = r->t;
  d->count = 0;
  d->before = d->last.h = 0;
  d->left = 1;
  d->outdated = 1;
  d->current = 0;
  d->h = pw_first_step (r);
  if (d->h >= 0.5 * T * sqrt (r->settings.rtol)) d->h = fmax (d->h, 0.1 * T * sqrt (sqrt (radau_rtol (r))));
  memcpy (d->now.y, r->q, (size_t)d->n * sizeof (double));
  memcpy (d->now.y + d->n, r->v, (size_t)d->n * sizeof (double));
  memset (d->now.y + 2 * d->n, 0, (size_t)(d->rows + d->mus) * sizeof (double));
  pw_tangent_compress (&d->tangent, r->lambda, d->rows, d->now.y + 2 * d->n);
  return PW_OK;
}

static int radau_allocate (pw_run *r) {
  radau *d = r->data;
  size_t n = (size_t)d->n + 3, rows = (size_t)r->s->rows, size = (size_t)d->size, entries = (size_t)r->s->entries;
  pw_array array[64] = {
    { &d->D, n },
    { &d->B, 2 * n },
    { &d->unit, size },
    { &d->tolerance, size },
    { &d->enough, size },
    { &d->floor, size },
    { &d->row, size },
    { &d->column, size },
    { &d->x, 2 * size },
    { &d->Y, size },
    { &d->pull, n },
    { &d->f, n },
    { &d->jv, rows },
    { &d->eta, rows },
    { &d->rates, entries },
    { &d->a1, n },
    { &d->now.y, size },
    { &d->last.y, size },
    { &d->now.a, n },
    { &d->last.a, n },
    { &d->now.ledger, entries },
    { &d->last.ledger, entries },
  };
  size_t count = 22;
  for (int k = 0; k < STAGES; k++) {
    array[count++] = (pw_array){ &d->now.Z[k], size };
    array[count++] = (pw_array){ &d->last.Z[k], size };
    array[count++] = (pw_array){ &d->now.w[k], entries };
    array[count++] = (pw_array){ &d->last.w[k], entries };
    array[count++] = (pw_array){ &d->W[k], size };
    array[count++] = (pw_array){ &d->F[k], size };
  }
  d->memory = pw_take_arrays (array, count);
  return d->memory ? PW_OK : PW_RESOURCE;
}

/* The diagonals of D and B, and the units of the unknowns. */
static void radau_constants (pw_run *r) {
  radau *d = r->data;
  const pw_system *s = r->s;
  int n = d->n;
  double L = s->scale.length, T = r->w->scale.time;
  for (int j = 0; j < n; j++) {
    d->D[j] = pw_is_angle (s, j) ? 1 / (L * L) : 1;
    d->B[j] = 1;
    d->B[n + j] = s->mass[j];
    d->unit[j] = pw_unit (s, j);
    d->unit[n + j] = d->unit[j] / T;
  }
}

static int radau_open (pw_run *r, pw_error *error) {
  radau *d = r->data = calloc (1, sizeof *d);
  int status = d ? pw_tangent_open (&d->tangent, r) : PW_RESOURCE;
  if (status == PW_OK) {
    d->fixed = pw_fixed_steps (r);
    d->velocities = pw_stabilised_by (r, PW_GGL) || pw_stabilised_by (r, PW_INDEX2);
    d->n = r->s->coords;
    d->rows = d->tangent.rows;
    d->mus = pw_stabilised_by (r, PW_GGL) ? d->tangent.holonomic : 0;
    d->size = 2 * d->n + d->rows + d->mus;
    status = radau_allocate (r);
  }
  if (status == PW_OK) status = radau_open_matrices (r);
  if (status != PW_OK) return pw_fail (error, PW_RESOURCE, "model %s: out of memory", r->s->model);
  radau_constants (r);
  status = pw_projector_open (&d->projector, r, NULL, NULL, error);
  return status == PW_OK ? radau_restart (r, error) : status;
}

static void radau_close (pw_run *r) {
  radau *d = r->data;
  pw_projector_close (&d->projector);
  pw_sparse_close (&d->real);
  pw_sparse_close (&d->complex);
  pw_tangent_close (&d->tangent);
  free (d->matrix);
  free (d->value);
  free (d->diagonal);
  free (d->memory);
  free (d);
}

/* ---- Advancing ---- */

static int radau_fail (pw_run *r, int status, double h, pw_error *error) {
  if (status == PW_METHOD) return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", r->t);
  if (status == PW_RESOURCE) return pw_fail (error, PW_RESOURCE, "t = %.6g s: out of memory in KLU", r->t);
  if (r->near || pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  if (status == PW_INPUT) return pw_fail (error, PW_METHOD, "t = %.6g s: the Newton matrix is singular", r->t);
  if (r->data->fixed)
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: the iteration does not converge; the step of %.6g s may be too large", r->t, h);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s however small the step (rtol %.3g)", r->t,
                  status == PW_OK ? "the error test fails" : "the iteration does not converge", r->settings.rtol);
}

/* Accelerations and multipliers at the state reached, where J is evaluated: from the state, or in singular
 * configurations those of the last stage. */
static void radau_finish (pw_run *r, double h) {
  radau *d = r->data;
  double *const *Z = d->last.Z, *end = d->now.y + 2 * d->n;
  int status = pw_saddle_factor (r->saddle);
  d->near = r->near = status != PW_OK || pw_watchdog_near (r);
  if (status == PW_OK)
    pw_run_accelerate_updated (r, r->v, r->a, r->lambda);
  else
    for (int j = 0, i = d->n; j < d->n; j++, i++)
      r->a[j] = (radau_end[0] * Z[0][i] + radau_end[1] * Z[1][i] + radau_end[2] * Z[2][i]) / h;
  if (status != PW_OK) {
    memset (r->lambda, 0, (size_t)r->s->rows * sizeof (double));
    for (int i = 0; i < d->rows; i++) r->lambda[d->tangent.map ? d->tangent.row[i] : i] = end[i];
  }
  pw_tangent_compress (&d->tangent, r->lambda, d->rows, end);
  memcpy (d->a1, r->a, (size_t)d->n * sizeof *d->a1);
  pw_bound_tolerances (r);
  pw_ledger_rates (r, r->lambda, r->rate);
}

/* The last stage becomes the state reached. */
static int radau_accept (pw_run *r, double h, double t1) {
  radau *d = r->data;
  size_t n = (size_t)d->n * sizeof (double), entries = (size_t)r->s->entries;
  radau_step done = d->now;
  radau_stage (d, STAGES - 1);
  int status = pw_update_kinematics (r->w, pw_before_breakpoint (r, t1), d->Y, d->Y + d->n);
  if (status != PW_OK) return status;
  pw_evaluate_J (r->w);
  done.t = r->t, done.h = h;
  memcpy (done.a, r->a, n);
  memcpy (done.ledger, r->ledger, entries * sizeof (double));
  d->now = d->last;
  d->last = done;
  memcpy (d->now.y, d->Y, (size_t)d->size * sizeof (double));
  memset (d->now.y + 2 * d->n + d->rows, 0, (size_t)d->mus * sizeof (double));
  memcpy (r->q, d->Y, n);
  memcpy (r->v, d->Y + d->n, n);
  r->t = t1;
  for (size_t e = 0; e < entries; e++) r->ledger[e] += done.w[STAGES - 1][e];
  radau_finish (r, h);
  r->statistics.steps++;
  d->current = 0;
  d->outdated = r->outdated || d->rate > RADAU_KEEP;
  return PW_OK;
}

/* The size of the next step, from the errors of this and the last one. */
static double radau_next (const radau *d, double h, double error, int rejected) {
  const int most = 7;
  double safety = 0.9 * fmin (1, (1. + 2 * most) / (d->iterations + 2 * most));
  double by = fmin (5, fmax (1. / 8, pow (error, 0.25) / safety));
  if (error < 1 && d->before > 0) {
    double trend = d->before / h * pow (d->error / (error * error), 0.25) * 0.9;
    by = fmax (by, fmin (5, fmax (1. / 8, 1 / trend)));
  }
  double next = h / by;
  if (rejected) next = fmin (next, h);
  return d->rate <= RADAU_KEEP && next >= h && next <= RADAU_LONGER * h ? h : next;
}

/* A step of size h; *error: in units of the tolerances, INFINITY if its equations could not be solved. */
static int radau_try (pw_run *r, double h, double t1, int again, double *error) {
  *error = INFINITY;
  r->near = 0;
  int status = radau_solve (r, h, t1);
  if (status == PW_OK && !r->data->fixed) status = radau_estimate (r, h, again, error);
  if (status == PW_OK && r->s->entries > 0 && (*error < 1 || r->data->fixed)) {
    if (r->data->fixed) *error = 0;
    status = radau_work (r, h, t1, error);
  }
  return status;
}

static int radau_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  radau *d = r->data;
  int whole;
  double off, t1 = pw_step_end (r, d->base, d->count, t_end, &whole), h = whole ? r->settings.step : t1 - r->t;
  int status = radau_try (r, h, t1, 0, &off);
  if (status == PW_OK) status = radau_accept (r, h, t1);
  if (status != PW_OK) return radau_fail (r, status, h, error);
  d->count++;
  if (!whole) d->base = t1, d->count = 0;
  return PW_OK;
}

/* A step that was cut short does not reduce the next one. */
static int radau_accept_adaptive (pw_run *r, double h, double t1, double error, int rejected, int cut) {
  radau *d = r->data;
  double next = radau_next (d, h, error, rejected);
  int status = radau_accept (r, h, t1);
  if (status != PW_OK) return status;
  d->before = h;
  d->error = fmax (1e-2, error);
  d->h = cut ? fmax (next, d->h) : next;
  return PW_OK;
}

static int radau_advance (pw_run *r, double t_end, pw_error *error) {
  radau *d = r->data;
  if (d->fixed) return radau_advance_fixed (r, t_end, error);
  double stop = fmin (t_end, r->breakpoint), least = 16 * DBL_EPSILON * fmax (fabs (r->t), 1e-6 * r->w->scale.time),
         off;
  for (int rejected = 0, status = PW_OK;; rejected++) {
    int cut = r->t + d->h > stop - 0.01 * d->h;
    double h = cut ? stop - r->t : d->h, t1 = cut ? stop : r->t + h;
    if (!cut && !(h > least)) return radau_fail (r, status, h, error);
    if (rejected > 0 && (status = pw_run_attempt (r, error)) != PW_OK) return status;
    status = radau_try (r, h, t1, rejected > 0 || d->before == 0, &off);
    if (status == PW_OK && off < 1) status = radau_accept_adaptive (r, h, t1, off, rejected, cut);
    if (status == PW_OK && off < 1) return PW_OK;
    int signal = status == PW_METHOD && h < RADAU_SIGNAL * r->w->scale.time;
    if (status == PW_RESOURCE || status == PW_INPUT || signal) return radau_fail (r, status, h, error);
    r->statistics.rejected++;
    d->outdated = !d->current;
    d->h = status == PW_OK ? fmin (0.9 * h, radau_next (d, h, off, 1)) : h * (status == PW_RETRY ? d->shorter : 0.25);
  }
}

/* ---- Samples ---- */

/* The quintic through positions, velocities and accelerations at both ends of the last step, at x in [0, 1]. */
static void radau_quintic (const pw_run *r, double x, double *q, double *v) {
  const radau *d = r->data;
  double h = d->last.h;
  for (int j = 0; j < d->n; j++) {
    double q0 = d->last.y[j], v0 = h * d->last.y[d->n + j], a0 = 0.5 * h * h * d->last.a[j];
    double dq = r->q[j] - q0 - v0 - a0, dv = h * r->v[j] - v0 - 2 * a0, da = 0.5 * h * h * (d->a1[j] - d->last.a[j]);
    double c3 = 10 * dq - 4 * dv + da, c4 = -15 * dq + 7 * dv - 2 * da, c5 = 6 * dq - 3 * dv + da;
    q[j] = q0 + x * (v0 + x * (a0 + x * (c3 + x * (c4 + x * c5))));
    v[j] = (v0 + x * (2 * a0 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))) / h;
  }
}

/* The quintic is more accurate than the polynomial through the stages, unless the step does not resolve the motion:
 * then they differ by more than the tolerances, or in fixed steps by more than a tenth of the changes in the step. */
static int radau_resolved (const pw_run *r, const double *q, const double *v) {
  const radau *d = r->data;
  double sum = 0;
  for (int i = 0; i < 2 * d->n; i++) {
    double off = i < d->n ? q[i] - r->q_at[i] : v[i - d->n] - r->v_at[i - d->n], allowed = d->tolerance[i];
    if (d->fixed) {
      allowed = d->floor[i];
      for (int k = 0; k < STAGES; k++) allowed = fmax (allowed, 0.1 * fabs (d->last.Z[k][i]));
    }
    sum += off * off / (allowed * allowed);
  }
  return sum <= 2 * d->n;
}

static void radau_interpolate (pw_run *r, double x) {
  radau *d = r->data;
  const radau_step *p = &d->last;
  int n = d->n;
  double weight[STAGES], *y = d->Y, *q = d->F[0], *v = d->F[1];
  radau_basis (x, weight);
  for (int i = 0; i < d->size; i++)
    y[i] = p->y[i] + weight[0] * p->Z[0][i] + weight[1] * p->Z[1][i] + weight[2] * p->Z[2][i];
  memcpy (r->q_at, y, (size_t)n * sizeof *y);
  memcpy (r->v_at, y + n, (size_t)n * sizeof *y);
  memset (r->lambda_at, 0, (size_t)r->s->rows * sizeof *y);
  for (int i = 0; i < d->rows; i++) r->lambda_at[d->tangent.map ? d->tangent.row[i] : i] = y[2 * n + i];
  for (int j = 0; j < n; j++) r->a_at[j] = (1 - x) * p->a[j] + x * d->a1[j];
  for (int e = 0; e < r->s->entries; e++)
    r->ledger_at[e] = p->ledger[e] + weight[0] * p->w[0][e] + weight[1] * p->w[1][e] + weight[2] * p->w[2][e];
  radau_quintic (r, x, q, v);
  if (!radau_resolved (r, q, v)) return;
  memcpy (r->q_at, q, (size_t)n * sizeof *q);
  memcpy (r->v_at, v, (size_t)n * sizeof *v);
}

/* Projects the sample onto the constraints that the steps satisfy, with accelerations and multipliers from there. */
static int radau_inside (pw_run *r, double t) {
  radau *d = r->data;
  double worst;
  int row, status;
  radau_interpolate (r, (t - d->last.t) / d->last.h);
  if (d->mus > 0 || !d->velocities)
    status = pw_project_positions (&d->projector, r, t, r->q_at, r->v_at, &row, &worst);
  else if ((status = pw_update_kinematics (r->w, t, r->q_at, r->v_at)) == PW_OK)
    pw_evaluate_J (r->w);
  if (status == PW_OK && d->velocities) status = pw_project_velocities (&d->projector, r, r->v_at);
  if (status == PW_OK && pw_saddle_factor (r->saddle) == PW_OK)
    pw_run_accelerate_updated (r, r->v_at, r->a_at, r->lambda_at);
  return status;
}

static int radau_at (pw_run *r, double t, pw_error *error) {
  radau *d = r->data;
  if (t > r->t || t < d->last.t) return pw_fail_outside (r, d->last.t, t, error);
  if (t == r->t) {
    pw_show_reached (r);
    return PW_OK;
  }
  pw_statistics keep = r->statistics;
  int status = radau_inside (r, t);
  r->statistics = keep;
  r->projected_at = r->projected;
  if (status == PW_OK) return PW_OK;
  if (status == PW_METHOD) return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
  if (r->near) return pw_fail_singular (r, t, error);
  return pw_fail (error, PW_METHOD, "t = %.6g s: no state near the one between steps meets the constraints", t);
}

static const pw_stabilisation radau_stabilisations[] = {
  { "ggl", "stabilised index 2: positions and velocities both enforced (Gear, Gupta & Leimkuhler 1985)", PW_GGL },
  { "index2", "velocities enforced, positions drift", PW_INDEX2 },
  { "index3", "positions enforced, and the velocities of nonholonomic rows (Hairer, Lubich & Roche 1989)",
    PW_STABILISED_OTHERWISE },
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
