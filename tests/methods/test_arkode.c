/* erk5, compared with ARKODE of SUNDIALS: the same tableau in an independent program, with the same accelerations.
 * */
#include <math.h>
#include <string.h>
#include <arkode/arkode_arkstep.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "sundials.h"

enum { ARKODE_MOST = 12 };

/* (q, v)' = (v, a), evaluated by a separate run. */
static int arkode_slope (realtype t, N_Vector y, N_Vector slope, void *run) {
  pw_run *r = run;
  int n = r->s->coords;
  double q[ARKODE_MOST] = { 0 }, v[ARKODE_MOST] = { 0 }, a[ARKODE_MOST], lambda[ARKODE_MOST];
  const double *from = N_VGetArrayPointer (y);
  double *to = N_VGetArrayPointer (slope);
  memcpy (q, from, (size_t)n * sizeof *q);
  memcpy (v, from + n, (size_t)n * sizeof *v);
  if (pw_run_accelerate (r, t, q, v, a, lambda) != PW_OK) return -1;
  memcpy (to, v, (size_t)n * sizeof *v);
  memcpy (to + n, a, (size_t)n * sizeof *a);
  return 0;
}

/* Integrates from the initial state of a run to t_end in steps of h, by ARKODE. */
static void arkode_run (pw_run *r, double h, double t_end, double *y_end) {
  SUNContext context;
  int n = r->s->coords;
  assert_int_equal (SUNContext_Create (NULL, &context), 0);
  N_Vector y = N_VNew_Serial (2 * n, context);
  memcpy (N_VGetArrayPointer (y), r->q, (size_t)n * sizeof (double));
  memcpy (N_VGetArrayPointer (y) + n, r->v, (size_t)n * sizeof (double));
  void *ark = ARKStepCreate (arkode_slope, NULL, 0, y, context);
  assert_non_null (ark);
  assert_int_equal (ARKStepSetUserData (ark, r), 0);
  assert_int_equal (ARKStepSetTableNum (ark, ARKODE_DIRK_NONE, ARKODE_DORMAND_PRINCE_7_4_5), 0);
  assert_int_equal (ARKStepSetFixedStep (ark, h), 0);
  assert_int_equal (ARKStepSetStopTime (ark, t_end), 0);
  assert_int_equal (ARKStepSetMaxNumSteps (ark, 100000), 0);
  realtype t = 0;
  assert_true (ARKStepEvolve (ark, t_end, y, &t, ARK_NORMAL) >= 0);
  assert_true (fabs (t - t_end) <= 1e-12);
  memcpy (y_end, N_VGetArrayPointer (y), 2 * (size_t)n * sizeof (double));
  ARKStepFree (&ark);
  N_VDestroy (y);
  SUNContext_Free (&context);
}

TEST (same_steps) {
  static const double step[] = { 0.125, 0.0625, 0.015625 };
  for (int massive = 0; massive < 2; massive++)
    for (int i = 0; i < 3; i++) {
      double q[6], v[6], y[12];
      const double h = step[i], t_end = 5;
      pw_system *s = scene_system (&scene_ezyroller, "m2", 0.1 * massive, "I2", 0.01 * massive, NULL);
      runs_state (s, "erk5+none:steps=fixed", &(pw_settings){ .step = h, .span = t_end }, t_end, q, v, NULL);
      pw_run *r = runs_open (s, "erk5+none:steps=fixed", &(pw_settings){ .step = h, .span = t_end });
      arkode_run (r, h, t_end, y);
      double bound = 10 * CHECK_EPS * t_end / h;
      for (int j = 0; j < 6; j++) {
        check_close ("position, ARKODE", q[j], y[j], bound, "10 eps of each step");
        check_close ("rate, ARKODE", v[j], y[6 + j], bound, "10 eps of each step");
      }
      pw_run_close (r);
      pw_system_free (s);
    }
}
