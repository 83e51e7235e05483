/* The EzyRoller by CVODES, programmed for this vehicle alone: y = (q, v), y' = (v, a) by the hand-written
 * accelerations; Adams with functional iteration, or BDF with a dense Jacobian by the library's differences and with
 * the hand-written projection after each step (Hindmarsh et al. 2005). */
#include <stdlib.h>
#include <string.h>
#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include "baseline.h"

enum { CVODE_SIZE = 12 };

struct ezy_cvode {
  ezy e;
  double t, t_end;
  SUNContext context;
  void *cvode;
  N_Vector y;
  SUNNonlinearSolver iteration; /* Adams */
  SUNMatrix matrix;             /* BDF */
  SUNLinearSolver solver;
};

static int cvode_rates (double t, N_Vector vy, N_Vector rates, void *user) {
  const ezy *e = &((const ezy_cvode *)user)->e;
  const double *y = N_VGetArrayPointer (vy);
  double *out = N_VGetArrayPointer (rates), lambda[4];
  memcpy (out, y + 6, 6 * sizeof *out);
  ezy_massive (e, t, y, y + 6, out + 6, lambda);
  return 0;
}

static int cvode_project (double t, N_Vector vy, N_Vector change, double tolerance, N_Vector error, void *user) {
  const ezy *e = &((const ezy_cvode *)user)->e;
  const double *y = N_VGetArrayPointer (vy);
  double *out = N_VGetArrayPointer (change), q[6], v[6];
  ezy_state s;
  memcpy (q, y, sizeof q);
  memcpy (v, y + 6, sizeof v);
  ezy_project (e, t, q, v, &s);
  for (int j = 0; j < 6; j++) out[j] = s.q[j] - y[j], out[6 + j] = s.v[j] - y[6 + j];
  (void)tolerance, (void)error;
  return 0;
}

static int cvode_open (ezy_cvode *d, int adams, double rtol) {
  ezy_state s;
  int flag = SUNContext_Create (NULL, &d->context);
  if (flag != 0) return flag;
  d->y = N_VNew_Serial (CVODE_SIZE, d->context);
  ezy_start (&d->e, &s);
  memcpy (N_VGetArrayPointer (d->y), s.q, sizeof s.q);
  memcpy (N_VGetArrayPointer (d->y) + 6, s.v, sizeof s.v);
  d->cvode = CVodeCreate (adams ? CV_ADAMS : CV_BDF, d->context);
  flag |= CVodeSetUserData (d->cvode, d);
  flag |= CVodeInit (d->cvode, cvode_rates, 0, d->y);
  flag |= CVodeSStolerances (d->cvode, rtol, rtol);
  flag |= CVodeSetMaxNumSteps (d->cvode, -1);
  flag |= CVodeSetMaxHnilWarns (d->cvode, -1);
  flag |= CVodeSetStopTime (d->cvode, d->t_end);
  if (adams) {
    d->iteration = SUNNonlinSol_FixedPoint (d->y, 0, d->context);
    return flag | CVodeSetNonlinearSolver (d->cvode, d->iteration);
  }
  d->matrix = SUNDenseMatrix (CVODE_SIZE, CVODE_SIZE, d->context);
  d->solver = SUNLinSol_Dense (d->y, d->matrix, d->context);
  flag |= CVodeSetLinearSolver (d->cvode, d->solver, d->matrix);
  flag |= CVodeSetProjFn (d->cvode, cvode_project);
  return flag | CVodeSetProjErrEst (d->cvode, 0);
}

ezy_cvode *ezy_cvode_open (const ezy_model *model, int adams, double rtol, double t_end) {
  ezy_cvode *d = calloc (1, sizeof *d);
  if (d == NULL) return NULL;
  ezy_open (&d->e, model);
  d->t_end = t_end;
  if (cvode_open (d, adams, rtol) == 0) return d;
  ezy_cvode_close (d);
  return NULL;
}

void ezy_cvode_close (ezy_cvode *d) {
  if (d->cvode) CVodeFree (&d->cvode);
  if (d->iteration) SUNNonlinSolFree (d->iteration);
  if (d->solver) SUNLinSolFree (d->solver);
  if (d->matrix) SUNMatDestroy (d->matrix);
  if (d->y) N_VDestroy (d->y);
  if (d->context) SUNContext_Free (&d->context);
  free (d);
}

int ezy_cvode_step (ezy_cvode *d) {
  int flag = CVode (d->cvode, d->t_end, d->y, &d->t, CV_ONE_STEP);
  return flag < 0 ? flag : flag == CV_TSTOP_RETURN;
}

void ezy_cvode_result (const ezy_cvode *d, long *steps, long *evaluations, double q[6]) {
  long of_jacobians = 0;
  CVodeGetNumSteps (d->cvode, steps);
  CVodeGetNumRhsEvals (d->cvode, evaluations);
  if (d->solver) CVodeGetNumLinRhsEvals (d->cvode, &of_jacobians);
  *evaluations += of_jacobians;
  memcpy (q, N_VGetArrayPointer (d->y), 6 * sizeof *q);
}
