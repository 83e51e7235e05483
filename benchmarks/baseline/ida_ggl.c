/* The EzyRoller by IDA, programmed for this vehicle alone: stabilised index 2, KLU, analytic Jacobian.
 *
 *   q' = v - G^T mu,   M v' + J^T lambda = f,   J v = 0,   g = 0          y = (q, v, lambda, mu), 18 unknowns
 *
 * (Gear, Gupta & Leimkuhler 1985.)  lambda and mu are excluded from the error test. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include "baseline.h"

enum { GGL_SIZE = 18 };

struct ezy_ida {
  ezy_model p;
  double t, t_end;
  SUNContext context;
  void *ida;
  N_Vector y, yp, id;
  SUNMatrix matrix;
  SUNLinearSolver solver;
};

static int ggl_residual (double t, N_Vector vy, N_Vector vyp, N_Vector vr, void *user) {
  const ezy_model *p = &((const ezy_ida *)user)->p;
  const double *q = N_VGetArrayPointer (vy), *v = q + 6, *l = q + 12, *mu = q + 16, *qp = N_VGetArrayPointer (vyp),
               *vp = qp + 6;
  double *r = N_VGetArrayPointer (vr), T = p->M0 * cos (p->omega * t);
  double c1 = cos (q[2]), s1 = sin (q[2]), c2 = cos (q[5]), s2 = sin (q[5]);
  double b1 = p->b * s1, b2 = p->b * c1, d1 = p->d * s2, d2 = p->d * c2;
  r[0] = qp[0] - v[0] + mu[0];
  r[1] = qp[1] - v[1] + mu[1];
  r[2] = qp[2] - v[2] - b1 * mu[0] + b2 * mu[1];
  r[3] = qp[3] - v[3] - mu[0];
  r[4] = qp[4] - v[4] - mu[1];
  r[5] = qp[5] - v[5] - d1 * mu[0] + d2 * mu[1];
  r[6] = p->m1 * vp[0] + l[0] - s1 * l[2];
  r[7] = p->m1 * vp[1] + l[1] + c1 * l[2];
  r[8] = p->I1 * vp[2] - b1 * l[0] + b2 * l[1] - p->a * l[2] - T;
  r[9] = p->m2 * vp[3] - l[0] - s2 * l[3];
  r[10] = p->m2 * vp[4] - l[1] + c2 * l[3];
  r[11] = p->I2 * vp[5] - d1 * l[0] + d2 * l[1] + p->c * l[3] + T;
  r[12] = v[0] - b1 * v[2] - v[3] - d1 * v[5];
  r[13] = v[1] + b2 * v[2] - v[4] + d2 * v[5];
  r[14] = -s1 * v[0] + c1 * v[1] - p->a * v[2];
  r[15] = -s2 * v[3] + c2 * v[4] + p->c * v[5];
  r[16] = q[0] + b2 + d2 - q[3];
  r[17] = q[1] + b1 + d1 - q[4];
  return 0;
}

/* The sparsity pattern, column by column: row indices, starts of columns.  IDA clears it before each Jacobian. */
static const sunindextype ggl_rows[] = {
  0, 16,                             /* x1 */
  1, 17,                             /* y1 */
  2, 6,  7,  8,  12, 13, 14, 16, 17, /* phi1 */
  3, 16,                             /* x2 */
  4, 17,                             /* y2 */
  5, 9,  10, 11, 12, 13, 15, 16, 17, /* phi2 */
  0, 6,  12, 14,                     /* vx1 */
  1, 7,  13, 14,                     /* vy1 */
  2, 8,  12, 13, 14,                 /* omega1 */
  3, 9,  12, 15,                     /* vx2 */
  4, 10, 13, 15,                     /* vy2 */
  5, 11, 12, 13, 15,                 /* omega2 */
  6, 8,  9,  11,                     /* Bx */
  7, 8,  10, 11,                     /* By */
  6, 7,  8,                          /* A */
  9, 10, 11,                         /* C */
  0, 2,  3,  5,                      /* mu x */
  1, 2,  4,  5,                      /* mu y */
};
static const sunindextype ggl_starts[GGL_SIZE + 1] = { 0,  2,  4,  13, 15, 17, 26, 30, 34, 39,
                                                       43, 47, 52, 56, 60, 63, 66, 70, 74 };

static int ggl_jacobian (double t, double c, N_Vector vy, N_Vector vyp, N_Vector vr, SUNMatrix matrix, void *user,
                         N_Vector t1, N_Vector t2, N_Vector t3) {
  const ezy_model *p = &((const ezy_ida *)user)->p;
  const double *q = N_VGetArrayPointer (vy), *v = q + 6, *l = q + 12, *mu = q + 16;
  double c1 = cos (q[2]), s1 = sin (q[2]), c2 = cos (q[5]), s2 = sin (q[5]);
  double b1 = p->b * s1, b2 = p->b * c1, d1 = p->d * s2, d2 = p->d * c2;
  /* clang-format off */
  const double value[] = {
    c, 1, c, 1,                                                                                         /* x1, y1 */
    c - b2 * mu[0] - b1 * mu[1], -c1 * l[2], -s1 * l[2], -b2 * l[0] - b1 * l[1], -b2 * v[2], -b1 * v[2],
    -c1 * v[0] - s1 * v[1], -b1, b2,                                                                    /* phi1 */
    c, -1, c, -1,                                                                                       /* x2, y2 */
    c - d2 * mu[0] - d1 * mu[1], -c2 * l[3], -s2 * l[3], -d2 * l[0] - d1 * l[1], -d2 * v[5], -d1 * v[5],
    -c2 * v[3] - s2 * v[4], -d1, d2,                                                                    /* phi2 */
    -1, c * p->m1, 1, -s1, -1, c * p->m1, 1, c1, -1, c * p->I1, -b1, b2, -p->a,         /* vx1, vy1, omega1 */
    -1, c * p->m2, -1, -s2, -1, c * p->m2, -1, c2, -1, c * p->I2, -d1, d2, p->c,        /* vx2, vy2, omega2 */
    1, -b1, -1, -d1, 1, b2, -1, d2, -s1, c1, -p->a, -s2, c2, p->c,                      /* Bx, By, A, C */
    1, -b1, -1, -d1, 1, b2, -1, d2                                                      /* mu x, mu y */
  };
  /* clang-format on */
  _Static_assert(sizeof value / sizeof *value == sizeof ggl_rows / sizeof *ggl_rows,
                 "one value per entry of the pattern");
  memcpy (SUNSparseMatrix_IndexPointers (matrix), ggl_starts, sizeof ggl_starts);
  memcpy (SUNSparseMatrix_IndexValues (matrix), ggl_rows, sizeof ggl_rows);
  memcpy (SUNSparseMatrix_Data (matrix), value, sizeof value);
  (void)t, (void)vyp, (void)vr, (void)t1, (void)t2, (void)t3;
  return 0;
}

/* From rest, with its accelerations and multipliers. */
static void ggl_start (ezy_ida *d) {
  ezy e;
  ezy_state s;
  double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp), *id = N_VGetArrayPointer (d->id);
  ezy_open (&e, &d->p);
  ezy_start (&e, &s);
  memset (y, 0, GGL_SIZE * sizeof *y);
  memset (yp, 0, GGL_SIZE * sizeof *yp);
  memcpy (y, s.q, sizeof s.q);
  memcpy (yp + 6, s.a, sizeof s.a);
  memcpy (y + 12, s.lambda, sizeof s.lambda);
  for (int i = 0; i < GGL_SIZE; i++) id[i] = i < 12;
}

static int ggl_open (ezy_ida *d, double rtol) {
  int flag = SUNContext_Create (NULL, &d->context);
  if (flag != 0) return flag;
  d->y = N_VNew_Serial (GGL_SIZE, d->context);
  d->yp = N_VNew_Serial (GGL_SIZE, d->context);
  d->id = N_VNew_Serial (GGL_SIZE, d->context);
  ggl_start (d);
  d->ida = IDACreate (d->context);
  flag |= IDASetUserData (d->ida, d);
  flag |= IDAInit (d->ida, ggl_residual, 0, d->y, d->yp);
  flag |= IDASStolerances (d->ida, rtol, rtol);
  flag |= IDASetId (d->ida, d->id);
  flag |= IDASetSuppressAlg (d->ida, 1);
  flag |= IDASetMaxNumSteps (d->ida, -1);
  flag |= IDASetStopTime (d->ida, d->t_end);
  d->matrix = SUNSparseMatrix (GGL_SIZE, GGL_SIZE, sizeof ggl_rows / sizeof *ggl_rows, CSC_MAT, d->context);
  memcpy (SUNSparseMatrix_IndexPointers (d->matrix), ggl_starts, sizeof ggl_starts);
  memcpy (SUNSparseMatrix_IndexValues (d->matrix), ggl_rows, sizeof ggl_rows);
  d->solver = SUNLinSol_KLU (d->y, d->matrix, d->context);
  flag |= IDASetLinearSolver (d->ida, d->solver, d->matrix);
  return flag | IDASetJacFn (d->ida, ggl_jacobian);
}

ezy_ida *ezy_ida_open (const ezy_model *model, double rtol, double t_end) {
  ezy_ida *d = calloc (1, sizeof *d);
  if (d == NULL) return NULL;
  d->p = *model;
  d->t_end = t_end;
  if (ggl_open (d, rtol) == 0) return d;
  ezy_ida_close (d);
  return NULL;
}

void ezy_ida_close (ezy_ida *d) {
  if (d->ida) IDAFree (&d->ida);
  if (d->solver) SUNLinSolFree (d->solver);
  if (d->matrix) SUNMatDestroy (d->matrix);
  if (d->y) N_VDestroy (d->y);
  if (d->yp) N_VDestroy (d->yp);
  if (d->id) N_VDestroy (d->id);
  if (d->context) SUNContext_Free (&d->context);
  free (d);
}

int ezy_ida_step (ezy_ida *d) {
  int flag = IDASolve (d->ida, d->t_end, &d->t, d->y, d->yp, IDA_ONE_STEP);
  return flag < 0 ? flag : flag == IDA_TSTOP_RETURN;
}

void ezy_ida_result (const ezy_ida *d, long *steps, long *residuals, double q[6]) {
  IDAGetNumSteps (d->ida, steps);
  IDAGetNumResEvals (d->ida, residuals);
  memcpy (q, N_VGetArrayPointer (d->y), 6 * sizeof *q);
}
