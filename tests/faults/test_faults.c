/* Every call of SUNDIALS, KLU and AMD is made to fail in turn: each is an error in words, nothing is printed, and
 * (make san) nothing is left behind.  Linked with --wrap for the functions listed here; the Makefile reads the list. */
#include <amd.h>
#include <cvodes/cvodes.h>
#include <idas/idas.h>
#include <klu.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include "check.h"
#include "pinwheel-solvers.h"
#include "runs.h"
#include "scene.h"

static struct {
  long count;       /* calls so far */
  long fail;        /* the one that fails; 0: none */
  const char *name; /* of that */
} fault;

static int fault_here (const char *name) {
  if (++fault.count != fault.fail) return 0;
  fault.name = name;
  return 1;
}

/* A function that returns an address, and one that returns a flag; it is not called when it is to fail. */
#define FAULT_ADDRESS(type, name, parameters, arguments)        \
  type __real_##name parameters;                                \
  type __wrap_##name parameters;                                \
  type __wrap_##name parameters {                               \
    return fault_here (#name) ? NULL : __real_##name arguments; \
  }
#define FAULT_FLAG(flag, name, parameters, arguments)           \
  int __real_##name parameters;                                 \
  int __wrap_##name parameters;                                 \
  int __wrap_##name parameters {                                \
    return fault_here (#name) ? flag : __real_##name arguments; \
  }

#if KLU_MAIN_VERSION < 2
typedef SuiteSparse_long faults_klu; /* what its functions return */
#else
typedef int faults_klu;
#endif
#define FAULT_KLU(flag, name, parameters, arguments)            \
  faults_klu __real_##name parameters;                          \
  faults_klu __wrap_##name parameters;                          \
  faults_klu __wrap_##name parameters {                         \
    return fault_here (#name) ? flag : __real_##name arguments; \
  }

/* clang-format off: one line each, for the Makefile */
FAULT_FLAG (-1, SUNContext_Create, (void *comm, SUNContext *c), (comm, c))
FAULT_ADDRESS (N_Vector, N_VNew_Serial, (sunindextype n, SUNContext c), (n, c))
FAULT_ADDRESS (SUNMatrix, SUNMatNewEmpty, (SUNContext c), (c))
FAULT_ADDRESS (SUNLinearSolver, SUNLinSolNewEmpty, (SUNContext c), (c))
FAULT_ADDRESS (SUNNonlinearSolver, SUNNonlinSol_FixedPoint, (N_Vector y, int m, SUNContext c), (y, m, c))
FAULT_ADDRESS (void *, IDACreate, (SUNContext c), (c))
FAULT_FLAG (IDA_MEM_FAIL, IDAInit, (void *m, IDAResFn f, realtype t, N_Vector y, N_Vector yp), (m, f, t, y, yp))
FAULT_FLAG (IDA_MEM_FAIL, IDAReInit, (void *m, realtype t, N_Vector y, N_Vector yp), (m, t, y, yp))
FAULT_FLAG (IDA_MEM_FAIL, IDAWFtolerances, (void *m, IDAEwtFn f), (m, f))
FAULT_FLAG (IDA_MEM_FAIL, IDASetId, (void *m, N_Vector id), (m, id))
FAULT_FLAG (IDA_MEM_FAIL, IDASetLinearSolver, (void *m, SUNLinearSolver s, SUNMatrix a), (m, s, a))
FAULT_FLAG (IDA_ILL_INPUT, IDASetInitStep, (void *m, realtype h), (m, h))
FAULT_FLAG (IDA_ILL_INPUT, IDASetStopTime, (void *m, realtype t), (m, t))
FAULT_FLAG (IDA_LSOLVE_FAIL, IDASolve, (void *m, realtype end, realtype *t, N_Vector y, N_Vector yp, int task),
            (m, end, t, y, yp, task))
FAULT_FLAG (IDA_BAD_DKY, IDAGetDky, (void *m, realtype t, int k, N_Vector y), (m, t, k, y))
FAULT_ADDRESS (void *, CVodeCreate, (int lmm, SUNContext c), (lmm, c))
FAULT_FLAG (CV_MEM_FAIL, CVodeInit, (void *m, CVRhsFn f, realtype t, N_Vector y), (m, f, t, y))
FAULT_FLAG (CV_MEM_FAIL, CVodeReInit, (void *m, realtype t, N_Vector y), (m, t, y))
FAULT_FLAG (CV_MEM_FAIL, CVodeWFtolerances, (void *m, CVEwtFn f), (m, f))
FAULT_FLAG (CV_MEM_FAIL, CVodeSetLinearSolver, (void *m, SUNLinearSolver s, SUNMatrix a), (m, s, a))
FAULT_FLAG (CV_MEM_FAIL, CVodeSetNonlinearSolver, (void *m, SUNNonlinearSolver s), (m, s))
FAULT_FLAG (CV_ILL_INPUT, CVodeSetInitStep, (void *m, realtype h), (m, h))
FAULT_FLAG (CV_ILL_INPUT, CVodeSetStopTime, (void *m, realtype t), (m, t))
FAULT_FLAG (CV_LSOLVE_FAIL, CVode, (void *m, realtype end, N_Vector y, realtype *t, int task), (m, end, y, t, task))
FAULT_FLAG (CV_BAD_DKY, CVodeGetDky, (void *m, realtype t, int k, N_Vector y), (m, t, k, y))
FAULT_FLAG (AMD_OUT_OF_MEMORY, amd_order, (int n, const int p[], const int i[], int q[], double c[], double info[]),
            (n, p, i, q, c, info))
FAULT_KLU (0, klu_l_defaults, (klu_l_common * c), (c))
FAULT_ADDRESS (klu_l_symbolic *, klu_l_analyze, (int64_t n, int64_t p[], int64_t i[], klu_l_common *c), (n, p, i, c))
FAULT_ADDRESS (klu_l_numeric *, klu_l_factor,
               (int64_t p[], int64_t i[], double x[], klu_l_symbolic *s, klu_l_common *c), (p, i, x, s, c))
FAULT_KLU (0, klu_l_refactor,
           (int64_t p[], int64_t i[], double x[], klu_l_symbolic *s, klu_l_numeric *f, klu_l_common *c),
           (p, i, x, s, f, c))
FAULT_KLU (0, klu_l_rcond, (klu_l_symbolic * s, klu_l_numeric *f, klu_l_common *c), (s, f, c))
FAULT_KLU (0, klu_l_solve, (klu_l_symbolic * s, klu_l_numeric *f, int64_t n, int64_t d, double b[], klu_l_common *c),
           (s, f, n, d, b, c))
FAULT_ADDRESS (klu_l_numeric *, klu_zl_factor,
               (int64_t p[], int64_t i[], double x[], klu_l_symbolic *s, klu_l_common *c), (p, i, x, s, c))
FAULT_KLU (0, klu_zl_refactor,
           (int64_t p[], int64_t i[], double x[], klu_l_symbolic *s, klu_l_numeric *f, klu_l_common *c),
           (p, i, x, s, f, c))
FAULT_KLU (0, klu_zl_rcond, (klu_l_symbolic * s, klu_l_numeric *f, klu_l_common *c), (s, f, c))
FAULT_KLU (0, klu_zl_solve, (klu_l_symbolic * s, klu_l_numeric *f, int64_t n, int64_t d, double b[], klu_l_common *c),
           (s, f, n, d, b, c))
/* clang-format on */

/* A run with samples inside steps, a checkpoint, a restart and a discontinuity, as far as it gets. */
static int fault_run (pw_system *s, const char *method, pw_error *error) {
  pw_sample sample;
  pw_archive archive = { .at = NULL };
  pw_run *r = pw_run_open (s, method, &(pw_settings){ .step = 0.02, .rtol = 1e-3, .ledger = 1 }, error);
  int status = r ? pw_run_advance_to (r, 0.1, 0.1, error) : error->status;
  if (status == PW_OK) status = pw_run_advance (r, 0.2, error);
  if (status == PW_OK) status = pw_run_sample (r, 0.5 * (0.1 + pw_run_time (r)), &sample, error);
  if (status == PW_OK) status = pw_run_save (r, &archive, error);
  if (status == PW_OK) status = pw_run_advance (r, 0.3, error);
  if (status == PW_OK) status = pw_run_restart (r, NULL, NULL, error);
  if (status == PW_OK) status = pw_run_advance (r, 0.4, error);
  if (status == PW_OK) status = pw_run_sample (r, pw_run_time (r), &sample, error);
  pw_archive_free (&archive);
  pw_run_close (r);
  return status;
}

/* Calls whose failure the integrators may repair by themselves, with a smaller step or other pivots. */
static int fault_may_pass (const char *method) {
  static const char *const name[] = { "klu_l_refactor", "klu_l_rcond", "klu_zl_refactor", "klu_zl_rcond" };
  const int is_sundials = strncmp (method, "bdf", 3) == 0 || strncmp (method, "ida", 3) == 0;
  if (is_sundials && strcmp (fault.name, "klu_l_factor") == 0) return 1; /* the matrix seems to be singular */
  for (size_t i = 0; i < sizeof name / sizeof *name; i++)
    if (strcmp (fault.name, name[i]) == 0) return 1;
  return 0;
}

/* The same while standard output and error go to a file; returns its size in *said. */
static int fault_run_quietly (pw_system *s, const char *method, long *said, pw_error *error) {
  FILE *file = tmpfile ();
  assert_non_null (file);
  fflush (NULL);
  int out = dup (1), err = dup (2);
  dup2 (fileno (file), 1);
  dup2 (fileno (file), 2);
  int status = fault_run (s, method, error);
  fflush (NULL);
  dup2 (out, 1);
  dup2 (err, 2);
  close (out);
  close (err);
  *said = lseek (fileno (file), 0, SEEK_END);
  fclose (file);
  return status;
}

static void fault_each (pw_system *s, const char *method) {
  long said;
  for (fault.fail = 1;; fault.fail++) {
    pw_error error = { 0 };
    fault.count = 0;
    int status = fault_run_quietly (s, method, &said, &error);
    assert_int_equal (said, 0);
    if (fault.count < fault.fail) {
      check_ok (status, &error);
      break;
    }
    int good = (status == PW_RESOURCE || status == PW_METHOD) && error.status == status && strlen (error.text) > 10 &&
               strstr (error.text, "s:  ") == NULL;
    if (status == PW_OK) good = fault_may_pass (method);
    if (!good)
      print_error ("%s: call %ld, %s: status %d, \"%s\"\n", method, fault.fail, fault.name, status, error.text);
    assert_true (good);
  }
  fault.fail = 0;
}

TEST (faults) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  char name[40];
  for (int i = 0; runs_method (i, name); i++) fault_each (s, name);
  pw_system_free (s);
}

/* A scene large enough for its rows to be ordered. */
TEST (ordering) {
  pw_system *s = scene_named ("chain", "n", 20);
  fault_each (s, "rk4+projection");
  assert_true (fault.name && strcmp (fault.name, "amd_order") == 0);
  pw_system_free (s);
}
