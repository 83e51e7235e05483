/* ida: the variable-order BDF code IDAS of SUNDIALS (Hindmarsh et al. 2005) on the index-reduced equations,
 *
 *   none, baumgarte   q' = v,               M v' + J^T lambda = f,   J v' = gamma - 2 alpha (J v - eta) - beta^2 g
 *   ggl               q' = v - D G^T mu,    M v' + J^T lambda = f,   J v = eta,   g = 0
 *
 * with D = 1 for lengths and 1/L^2 for angles, so that mu has one unit (Gear, Gupta & Leimkuhler 1985; Baumgarte
 * 1972).  Unknowns y = (q, v, lambda, mu).  The Newton matrix dF/dy + c dF/dy' is exact and sparse, factorised by KLU.
 * lambda and mu are kept out of the error test, and only they: rates of massless coordinates are in it. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <idas/idas.h>
#include "method.h"
#include "newton.h"
#include "sundials.h"

struct pw_method_data {
  pw_run *run;
  int ggl;
  int n, rows, holonomic, size; /* coordinates, active rows, active rows with mu, unknowns */
  int *map;                     /* all rows: number among the active ones, or -1; then the row of each active one */
  const int *row;               /* rows: its number among all */
  double *lambda, *mu;          /* all rows */
  SUNContext context;
  void *ida;
  N_Vector y, yp, id, work, work0;
  SUNMatrix matrix;
  SUNLinearSolver solver;
  pw_tape tape;
  sunindextype *colptr, *rowind; /* the pattern */
  pw_newton newton;
  double *scale;        /* D: coords */
  double *given;        /* scratch: 2 (coords + 3) + 2 rows */
  double stop;          /* the stop time IDA knows */
  double begun;         /* time of the start or the last restart */
  pw_statistics before; /* what was counted up to then: IDA counts from there */
  char message[256];    /* the last one IDA sent */
};

typedef struct pw_method_data ida_data;

/* ---- Residual ---- */

static int ida_place (ida_data *d, double t, const double *y) {
  int status = pw_place (d->run->s, pw_before_breakpoint (d->run, t), y, y + d->n);
  if (status == PW_OK) pw_sweep_J (d->run->s);
  return status == PW_OK ? 0 : -1;
}

/* Multipliers of all rows from the unknowns, which hold those of the active rows. */
static const double *ida_expand (const ida_data *d, const double *active, int count, double *all) {
  if (d->map == NULL && count == d->rows) return active;
  for (int i = 0; i < count; i++) all[d->map ? d->row[i] : i] = active[i];
  return all;
}

/* From values of all rows those of the first so many active ones. */
static void ida_compress (const ida_data *d, const double *all, int count, double *active) {
  for (int i = 0; i < count; i++) active[i] = all[d->map ? d->row[i] : i];
}

/* q' - v + D G^T mu */
static void ida_kinematics (ida_data *d, const double *y, const double *yp, double *out) {
  pw_system *s = d->run->s;
  int n = d->n;
  for (int j = 0; j < n; j++) out[j] = yp[j] - y[n + j];
  if (!d->ggl || d->holonomic == 0) return;
  double *pull = d->given;
  memset (pull, 0, (size_t)n * sizeof *pull);
  pw_add_JT (s, ida_expand (d, y + 2 * n + d->rows, d->holonomic, d->mu), pull);
  for (int j = 0; j < n; j++) out[j] += d->scale[j] * pull[j];
}

/* M v' + J^T lambda - f */
static void ida_momentum (ida_data *d, const double *y, const double *yp, double *out) {
  pw_system *s = d->run->s;
  int n = d->n;
  double *pull = d->given, *f = pull + n + 3;
  memset (pull, 0, (size_t)n * sizeof *pull);
  pw_add_JT (s, ida_expand (d, y + 2 * n, d->rows, d->lambda), pull);
  pw_sweep_force (s, f);
  for (int j = 0; j < n; j++) out[j] = s->mass[j] * yp[n + j] + pull[j] - f[j];
}

/* J v' - gamma + 2 alpha (J v - eta) + beta^2 g, all rows, onto J v - eta */
static void ida_stabilised (ida_data *d, const double *yp, double *jv, double *other) {
  pw_run *r = d->run;
  pw_system *s = r->s;
  for (int i = 0; i < s->rows; i++) jv[i] *= (i < s->holonomic ? 2 : 1) * r->alpha;
  pw_mul_J (s, yp + d->n, other);
  for (int i = 0; i < s->rows; i++) jv[i] += other[i];
  pw_sweep_gamma (s, other);
  for (int i = 0; i < s->rows; i++) jv[i] -= other[i];
  if (r->beta == 0) return;
  pw_sweep_g (s, other);
  for (int i = 0; i < s->holonomic; i++) jv[i] += r->beta * r->beta * other[i];
}

/* J v - eta and g; or the stabilised accelerations */
static void ida_constraints (ida_data *d, const double *y, const double *yp, double *out) {
  pw_system *s = d->run->s;
  double *jv = d->given, *other = jv + s->rows;
  pw_mul_J (s, y + d->n, jv);
  pw_sweep_eta (s, other);
  for (int i = 0; i < s->rows; i++) jv[i] -= other[i];
  if (!d->ggl) ida_stabilised (d, yp, jv, other);
  ida_compress (d, jv, d->rows, out);
  if (!d->ggl) return;
  pw_sweep_g (s, other);
  ida_compress (d, other, d->holonomic, out + d->rows);
}

static int ida_residual (pw_real t, N_Vector vy, N_Vector vyp, N_Vector out, void *user) {
  ida_data *d = user;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp);
  double *f = N_VGetArrayPointer (out);
  if (ida_place (d, t, y) != 0) return -1;
  ida_kinematics (d, y, yp, f);
  ida_momentum (d, y, yp, f + d->n);
  ida_constraints (d, y, yp, f + 2 * d->n);
  return 0;
}

/* ---- Newton matrix ---- */

/* Rows of q': c I + D (G^T mu)_q, -I, D G^T */
static void ida_matrix_kinematics (ida_data *d, const double *y, double c) {
  pw_system *s = d->run->s;
  int n = d->n;
  for (int j = 0; j < n; j++) {
    pw_tape_put (&d->tape, j, j, c);
    pw_tape_put (&d->tape, j, n + j, -1);
  }
  if (!d->ggl) return;
  pw_put put = { .col = 0,
                 .rows = s->holonomic,
                 .factor = 1,
                 .row_scale = d->scale,
                 .map = d->map,
                 .lambda = ida_expand (d, y + 2 * n + d->rows, d->holonomic, d->mu) };
  pw_newton_block (&d->newton, s, &d->tape, PW_JTL_Q, &put);
  put.col = 2 * n + d->rows;
  pw_newton_JT (s, &d->tape, &put);
}

/* Rows of v': (J^T lambda)_q - f_q, c M - f_v, J^T */
static void ida_matrix_momentum (ida_data *d, const double *y, double c) {
  pw_system *s = d->run->s;
  int n = d->n;
  pw_put put = { .row = n,
                 .col = 0,
                 .rows = s->rows,
                 .factor = 1,
                 .factor_nonholonomic = 1,
                 .map = d->map,
                 .lambda = ida_expand (d, y + 2 * n, d->rows, d->lambda) };
  pw_newton_block (&d->newton, s, &d->tape, PW_JTL_Q, &put);
  put.factor = -1;
  pw_newton_block (&d->newton, s, &d->tape, PW_FORCE_Q, &put);
  put.col = n;
  pw_newton_block (&d->newton, s, &d->tape, PW_FORCE_V, &put);
  pw_newton_readers (&d->newton, s, &d->tape, n, 0, n);
  for (int j = 0; j < n; j++) pw_tape_put (&d->tape, n + j, n + j, c * s->mass[j]);
  put.factor = 1;
  put.col = 2 * n;
  pw_newton_JT (s, &d->tape, &put);
}

/* Rows of J v = eta and g = 0: (J v)_q - eta_q, J; G */
static void ida_matrix_ggl (ida_data *d, const double *y) {
  pw_system *s = d->run->s;
  int n = d->n;
  pw_put put = {
    .row = 2 * n, .col = 0, .rows = s->rows, .factor = 1, .factor_nonholonomic = 1, .map = d->map, .w = y + n
  };
  pw_newton_block (&d->newton, s, &d->tape, PW_JW_Q, &put);
  put.factor = put.factor_nonholonomic = -1;
  pw_newton_block (&d->newton, s, &d->tape, PW_ETA_Q, &put);
  put.factor = put.factor_nonholonomic = 1;
  put.col = n;
  pw_newton_J (s, &d->tape, &put);
  pw_newton_J (s, &d->tape,
               &(pw_put){ .row = 2 * n + d->rows, .col = 0, .rows = s->holonomic, .factor = 1, .map = d->map });
}

/* Rows of J v' = ...: (J v')_q - gamma_q + 2 alpha ((J v)_q - eta_q) + beta^2 G, (c + 2 alpha) J - gamma_v */
static void ida_matrix_accelerations (ida_data *d, const double *y, const double *yp, double c) {
  pw_run *r = d->run;
  pw_system *s = r->s;
  int n = d->n;
  double alpha = r->alpha;
  pw_put put = {
    .row = 2 * n, .col = 0, .rows = s->rows, .factor = 1, .factor_nonholonomic = 1, .map = d->map, .w = yp + n
  };
  pw_newton_block (&d->newton, s, &d->tape, PW_JW_Q, &put);
  put.w = y + n;
  put.factor = 2 * alpha, put.factor_nonholonomic = alpha;
  pw_newton_block (&d->newton, s, &d->tape, PW_JW_Q, &put);
  put.factor = -2 * alpha, put.factor_nonholonomic = -alpha;
  pw_newton_block (&d->newton, s, &d->tape, PW_ETA_Q, &put);
  put.factor = put.factor_nonholonomic = -1;
  pw_newton_block (&d->newton, s, &d->tape, PW_GAMMA_Q, &put);
  put.col = n;
  pw_newton_block (&d->newton, s, &d->tape, PW_GAMMA_V, &put);
  put.factor = c + 2 * alpha, put.factor_nonholonomic = c + alpha;
  pw_newton_J (s, &d->tape, &put);
  pw_newton_J (s, &d->tape,
               &(pw_put){ .row = 2 * n, .col = 0, .rows = s->holonomic, .factor = r->beta * r->beta, .map = d->map });
}

static void ida_matrix_fill (ida_data *d, const double *y, const double *yp, double c) {
  ida_matrix_kinematics (d, y, c);
  ida_matrix_momentum (d, y, c);
  if (d->ggl)
    ida_matrix_ggl (d, y);
  else
    ida_matrix_accelerations (d, y, yp, c);
}

/* IDA clears the pattern together with the values before each evaluation. */
static void ida_matrix_pattern (const ida_data *d, SUNMatrix matrix) {
  memcpy (SUNSparseMatrix_IndexPointers (matrix), d->colptr, ((size_t)d->size + 1) * sizeof *d->colptr);
  memcpy (SUNSparseMatrix_IndexValues (matrix), d->rowind, (size_t)d->colptr[d->size] * sizeof *d->rowind);
}

static int ida_matrix (pw_real t, pw_real c, N_Vector vy, N_Vector vyp, N_Vector residual, SUNMatrix matrix, void *user,
                       N_Vector t1, N_Vector t2, N_Vector t3) {
  ida_data *d = user;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp);
  (void)residual, (void)t1, (void)t2, (void)t3;
  if (ida_place (d, t, y) != 0) return -1;
  double *value = SUNSparseMatrix_Data (matrix);
  ida_matrix_pattern (d, matrix);
  memset (value, 0, (size_t)d->colptr[d->size] * sizeof *value);
  pw_tape_fill (&d->tape, value);
  ida_matrix_fill (d, y, yp, c);
  return 0;
}

/* ---- The rest IDA asks for ---- */

/* Multipliers of a placed state, J swept.  Those among the unknowns are good in ggl.  On the level of accelerations
 * nothing but Newton's iteration holds them where the motion is prescribed, and they may wander off without harm to
 * the motion: there they are computed anew.  Factorises the saddle in any case. */
static int ida_multipliers (const ida_data *d, const double *v, double *a, double *lambda) {
  pw_run *r = d->run;
  int status = pw_saddle_factor (r->saddle);
  if (status == PW_OK && !d->ggl) pw_accelerate_placed (r, v, a, lambda);
  return status;
}

/* Rates of the ledger's entries. */
static int ida_work (pw_real t, N_Vector vy, N_Vector vyp, N_Vector rate, void *user) {
  ida_data *d = user;
  const double *y = N_VGetArrayPointer (vy);
  (void)vyp;
  const double *lambda = ida_expand (d, y + 2 * d->n, d->rows, d->lambda);
  if (ida_place (d, t, y) != 0) return -1;
  if (!d->ggl) {
    if (ida_multipliers (d, y + d->n, d->given, d->mu) < 0) return -1;
    lambda = d->mu;
  }
  pw_sweep_ledger (d->run->s, lambda, N_VGetArrayPointer (rate));
  return 0;
}

/* The first step: an order 1 method's error, h^2 / T^2, at the tolerance. */
static double ida_first_step (const ida_data *d) {
  const pw_run *r = d->run;
  return 0.5 * r->s->scale.time * sqrt (r->settings.rtol);
}

/* The coefficient c of the current step, 1 / h before there is one; not below 1 / T. */
static double ida_leading (const ida_data *d) {
  pw_real c = 0;
  if (d->run->t == d->begun || IDAGetCurrentCj (d->ida, &c) != IDA_SUCCESS || c == 0) c = 1 / ida_first_step (d);
  return fmax (c, 1 / d->run->s->scale.time);
}

/* Error weights: by unit for q and v; lambda and mu, which the error test does not see, by the scale of the forces and
 * rates.  In ggl a correction of lambda or mu is as large as one of v or q divided by the step, so the convergence
 * test sees them divided by c. */
static int ida_weights (N_Vector vy, N_Vector weights, void *user) {
  ida_data *d = user;
  const pw_run *r = d->run;
  const pw_system *s = r->s;
  const pw_settings *set = &r->settings;
  const double *y = N_VGetArrayPointer (vy), L = s->scale.length, T = s->scale.time;
  double *w = N_VGetArrayPointer (weights), c = d->ggl ? ida_leading (d) : 1 / T, force = 0;
  for (int j = 0; j < d->n; j++) {
    w[j] = 1 / (set->rtol * fabs (y[j]) + pw_atol (r, j));
    w[d->n + j] = 1 / (set->rtol * fabs (y[d->n + j]) + pw_atol_rate (r, j));
    force = fmax (force, s->mass[j] / (T * T) * (pw_is_angle (s, j) ? 1 / L : L));
  }
  double relax = c * T, mu = (set->atol > 0 ? set->atol : set->rtol * L / T) * relax;
  for (int i = 0; i < d->rows; i++) w[2 * d->n + i] = 1 / (relax * set->rtol * (fabs (y[2 * d->n + i]) + force));
  for (int i = 2 * d->n + d->rows; i < d->size; i++) w[i] = 1 / mu;
  return 0;
}

static void ida_message (int code, const char *module, const char *function, char *text, void *user) {
  ida_data *d = user;
  (void)code, (void)module, (void)function;
  snprintf (d->message, sizeof d->message, "%s", text);
}

/* ---- Opening ---- */

static int ida_no_memory (const pw_run *r, pw_error *error) {
  return pw_fail (error, PW_MACHINE, "model %s: out of memory in ida", r->s->model);
}

/* The pattern, by recording one filling, and the matrix with it.  SUNDIALS' index type is 64 bits wide, as the tape's. */
static_assert (sizeof (sunindextype) == sizeof (int64_t), "SUNDIALS with 64-bit indices is expected");

static int ida_open_matrix (ida_data *d) {
  const double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp);
  pw_tape_record (&d->tape);
  ida_matrix_fill (d, y, yp, 1);
  if (pw_tape_lay_out (&d->tape, d->size, &d->colptr, &d->rowind) != PW_OK) return PW_MACHINE;
  d->matrix = SUNSparseMatrix (d->size, d->size, d->colptr[d->size], CSC_MAT, d->context);
  if (d->matrix == NULL) return PW_MACHINE;
  ida_matrix_pattern (d, d->matrix);
  d->solver = SUNLinSol_KLU (d->y, d->matrix, d->context);
  return d->solver ? PW_OK : PW_MACHINE;
}

static void ida_fill_vectors (ida_data *d) {
  const pw_run *r = d->run;
  size_t n = (size_t)d->n;
  double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp), *id = N_VGetArrayPointer (d->id);
  for (int i = 0; i < d->size; i++) {
    y[i] = yp[i] = 0;
    id[i] = i < 2 * d->n;
  }
  memcpy (y, r->q, n * sizeof *y);
  memcpy (y + n, r->v, n * sizeof *y);
  ida_compress (d, r->lambda, d->rows, y + 2 * n);
  memcpy (yp, r->v, n * sizeof *y);
  memcpy (yp + n, r->a, n * sizeof *y);
}

static int ida_open_vectors (ida_data *d) {
  const pw_system *s = d->run->s;
  if (SUNContext_Create (PW_SUN_NO_COMM, &d->context) != 0) return PW_MACHINE;
  d->y = N_VNew_Serial (d->size, d->context);
  d->yp = N_VNew_Serial (d->size, d->context);
  d->id = N_VNew_Serial (d->size, d->context);
  d->work = N_VNew_Serial (s->entries + 1, d->context);
  d->work0 = N_VNew_Serial (s->entries + 1, d->context);
  d->scale = calloc ((size_t)(3 * d->n + 6 + 4 * s->rows), sizeof *d->scale);
  if (!d->y || !d->yp || !d->id || !d->work || !d->work0 || !d->scale) return PW_MACHINE;
  d->lambda = d->scale + d->n;
  d->mu = d->lambda + s->rows;
  d->given = d->mu + s->rows;
  for (int j = 0; j < d->n; j++) d->scale[j] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
  N_VConst (0, d->work);
  N_VConst (0, d->work0);
  memcpy (N_VGetArrayPointer (d->work), d->run->ledger, (size_t)s->entries * sizeof (double));
  memcpy (N_VGetArrayPointer (d->work0), d->run->ledger, (size_t)s->entries * sizeof (double));
  ida_fill_vectors (d);
  return PW_OK;
}

static int ida_open_solver (ida_data *d) {
  pw_run *r = d->run;
  int flag = 0;
  d->ida = IDACreate (d->context);
  if (d->ida == NULL) return PW_MACHINE;
  flag |= IDASetErrHandlerFn (d->ida, ida_message, d);
  flag |= IDASetUserData (d->ida, d);
  flag |= IDAInit (d->ida, ida_residual, r->t, d->y, d->yp);
  flag |= IDAWFtolerances (d->ida, ida_weights);
  flag |= IDASetId (d->ida, d->id);
  flag |= IDASetSuppressAlg (d->ida, 1);
  flag |= IDASetMaxNumSteps (d->ida, -1);
  flag |= IDASetInitStep (d->ida, ida_first_step (d));
  flag |= IDASetLinearSolver (d->ida, d->solver, d->matrix);
  flag |= IDASetJacFn (d->ida, ida_matrix);
  if (r->settings.ledger && r->s->entries > 0) {
    flag |= IDAQuadInit (d->ida, ida_work, d->work0);
    flag |= IDASetQuadErrCon (d->ida, 0);
  }
  return flag == 0 ? PW_OK : PW_MACHINE;
}

/* Only independent rows are shown to IDA. */
static int ida_number_rows (ida_data *d) {
  const pw_run *r = d->run;
  const pw_system *s = r->s;
  d->rows = s->rows;
  d->holonomic = d->ggl ? s->holonomic : 0;
  if (r->active == NULL) return PW_OK;
  d->map = malloc ((size_t)(2 * s->rows) * sizeof *d->map);
  if (d->map == NULL) return PW_MACHINE;
  int *row = d->map + s->rows;
  d->row = row;
  d->rows = d->holonomic = 0;
  for (int i = 0; i < s->rows; i++) {
    d->map[i] = r->active[i] ? d->rows : -1;
    if (!r->active[i]) continue;
    d->holonomic += d->ggl && i < s->holonomic;
    row[d->rows++] = i;
  }
  return PW_OK;
}

static int ida_open (pw_run *r, pw_error *error) {
  ida_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return ida_no_memory (r, error);
  d->run = r;
  d->ggl = pw_stabilised_by (r, "ggl");
  pw_read_baumgarte (r);
  d->n = r->s->coords;
  if (ida_number_rows (d) != PW_OK) return ida_no_memory (r, error);
  d->size = 2 * d->n + d->rows + d->holonomic;
  d->stop = NAN;
  d->begun = r->t;
  if (r->statistics.steps > 0) d->before = r->statistics;
  if (pw_newton_open (&d->newton, r->s) != PW_OK || ida_open_vectors (d) != PW_OK || ida_open_matrix (d) != PW_OK ||
      ida_open_solver (d) != PW_OK)
    return ida_no_memory (r, error);
  return PW_OK;
}

static void ida_close (pw_run *r) {
  ida_data *d = r->data;
  if (d->ida) IDAFree (&d->ida);
  if (d->solver) SUNLinSolFree (d->solver);
  if (d->matrix) SUNMatDestroy (d->matrix);
  N_Vector const vector[] = { d->y, d->yp, d->id, d->work, d->work0 };
  for (size_t i = 0; i < sizeof vector / sizeof *vector; i++)
    if (vector[i]) N_VDestroy (vector[i]);
  if (d->context) SUNContext_Free (&d->context);
  pw_tape_close (&d->tape);
  pw_newton_close (&d->newton);
  free (d->map);
  free (d->colptr);
  free (d->rowind);
  free (d->scale);
  free (d);
}

/* ---- Advancing ---- */

static void ida_statistics (ida_data *d) {
  pw_statistics *s = &d->run->statistics, now = { 0 };
  const pw_statistics *before = &d->before;
  long tests = 0, newton = 0;
  IDAGetNumSteps (d->ida, &now.steps);
  IDAGetNumErrTestFails (d->ida, &tests);
  IDAGetNumNonlinSolvConvFails (d->ida, &newton);
  IDAGetNumResEvals (d->ida, &now.rhs);
  IDAGetNumJacEvals (d->ida, &now.jacobians);
  IDAGetNumLinSolvSetups (d->ida, &now.factorisations);
  s->steps = before->steps + now.steps;
  s->rejected = before->rejected + tests + newton;
  s->rhs = before->rhs + now.rhs;
  s->jacobians = before->jacobians + now.jacobians;
  s->factorisations = before->factorisations + now.factorisations;
}

/* Reads (q, v, a, lambda) out of y and y'. */
static void ida_read (const ida_data *d, double *q, double *v, double *a, double *lambda) {
  size_t n = (size_t)d->n;
  const double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp);
  memcpy (q, y, n * sizeof *q);
  memcpy (v, y + n, n * sizeof *v);
  memcpy (a, yp + n, n * sizeof *a);
  for (int i = 0; d->map && i < d->run->s->rows; i++) lambda[i] = 0;
  for (int i = 0; i < d->rows; i++) lambda[d->map ? d->row[i] : i] = y[2 * n + (size_t)i];
}

static int ida_fail (ida_data *d, int flag, pw_error *error) {
  const char *why = flag == IDA_ERR_FAIL       ? "the error test fails however small the step"
                    : flag == IDA_CONV_FAIL    ? "Newton's iteration does not converge however small the step"
                    : flag == IDA_LSETUP_FAIL  ? "the Newton matrix is singular"
                    : flag == IDA_RES_FAIL     ? "a signal failed"
                    : flag == IDA_TOO_MUCH_ACC ? "the tolerance is beyond the accuracy of the machine"
                                               : d->message;
  ida_statistics (d);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s (rtol %.3g)", d->run->t, why, d->run->settings.rtol);
}

static int ida_advance (pw_run *r, double t_end, pw_error *error) {
  ida_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), t = r->t;
  if (stop != d->stop) {
    IDASetStopTime (d->ida, stop);
    d->stop = stop;
  }
  int flag = IDASolve (d->ida, stop, &t, d->y, d->yp, IDA_ONE_STEP);
  if (flag < 0) return ida_fail (d, flag, error);
  r->t = flag == IDA_TSTOP_RETURN ? stop : t;
  if (flag == IDA_TSTOP_RETURN) d->stop = NAN;
  ida_read (d, r->q, r->v, r->a, r->lambda);
  if (ida_place (d, r->t, N_VGetArrayPointer (d->y)) != 0) return ida_fail (d, IDA_RES_FAIL, error);
  int status = ida_multipliers (d, r->v, r->a_at, r->lambda);
  if (status < 0) return ida_fail (d, IDA_RES_FAIL, error);
  r->near = status != PW_OK || pw_saddle_below (r->saddle, r->watch);
  ida_statistics (d);
  return PW_OK;
}

static int ida_at (pw_run *r, double t, pw_error *error) {
  ida_data *d = r->data;
  double *work = N_VGetArrayPointer (d->work);
  if (t == d->begun) {
    ida_fill_vectors (d);
  } else if (t > r->t || IDAGetDky (d->ida, t, 1, d->yp) != IDA_SUCCESS ||
             IDAGetDky (d->ida, t, 0, d->y) != IDA_SUCCESS) {
    return pw_fail (error, PW_INPUT, "t = %.17g s lies outside the last step, which ends at %.17g s", t, r->t);
  } else if (r->settings.ledger && r->s->entries > 0) {
    IDAGetQuadDky (d->ida, t, 0, d->work);
  }
  ida_read (d, r->q_at, r->v_at, r->a_at, r->lambda_at);
  for (int i = 0; i < r->s->entries; i++) r->ledger_at[i] = work[i];
  if (ida_place (d, t, N_VGetArrayPointer (d->y)) != 0)
    return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
  pw_statistics keep = r->statistics;
  ida_multipliers (d, r->v_at, d->given, r->lambda_at);
  r->statistics = keep;
  return PW_OK;
}

static int ida_restart (pw_run *r, pw_error *error) {
  ida_data *d = r->data;
  if (r->settings.ledger && r->s->entries > 0) {
    double t;
    IDAGetQuad (d->ida, &t, d->work0);
    IDAQuadReInit (d->ida, d->work0);
  }
  ida_fill_vectors (d);
  d->stop = NAN;
  d->begun = r->t;
  d->before = r->statistics;
  IDASetInitStep (d->ida, ida_first_step (d));
  if (IDAReInit (d->ida, r->t, d->y, d->yp) == IDA_SUCCESS) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: restart: %s", r->t, d->message);
}

static const pw_stabilisation ida_stabilisations[] = {
  { "none", "acceleration level: the constraints drift" },
  { "baumgarte", "feedback of the residuals into the accelerations (Baumgarte 1972)" },
  { "ggl", "stabilised index 2: positions and rates both enforced (Gear, Gupta & Leimkuhler 1985)" },
  { NULL, NULL },
};

static const pw_option ida_options[] = {
  PW_BAUMGARTE_OPTIONS,
  { .name = NULL },
};

const pw_method pw_method_ida = {
  .name = "ida",
  .about = "variable-order BDF on the differential-algebraic equations, SUNDIALS IDAS with KLU (Hindmarsh et al. 2005)",
  .adaptive = 1,
  .stabilisations = ida_stabilisations,
  .options = ida_options,
  .open = ida_open,
  .advance = ida_advance,
  .at = ida_at,
  .restart = ida_restart,
  .close = ida_close,
};
