/* What the integrators of SUNDIALS share; see sundials.h. */
#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "sundials.h"
#include "util.h"

/* SUNDIALS' index type is 64 bits wide, as the tape's. */
static_assert (sizeof (sunindextype) == sizeof (int64_t), "SUNDIALS with 64-bit indices is expected");

/* SUNDIALS 6.4 writes to vectors and loggers that it had no memory for, so there has to be enough while an integrator is
 * opened: for its vectors, at most 60 of them (13 of a Nordsieck array of order 12, a dozen more, as many for quadratures,
 * and what a restart adds), each with a table of its operations, and for all else. */
int pw_sun_open (SUNContext *context, int unknowns) {
  enum { VECTORS = 60, TABLE = 1024, REST = 1 << 17 };
  if (pw_reserve (VECTORS * (TABLE + (size_t)unknowns * sizeof (double)) + REST) != PW_OK) return PW_MACHINE;
  return SUNContext_Create (PW_SUN_NO_COMM, context) == 0 ? PW_OK : PW_MACHINE;
}

void pw_sun_message (int code, const char *module, const char *function, char *text, void *said) {
  pw_sun_said *s = said;
  (void)code, (void)module, (void)function;
  snprintf (s->text, sizeof s->text, "%s", text);
}

const char *pw_sun_reason (pw_sun_said *said, int flag) {
  if (*said->text == 0) snprintf (said->text, sizeof said->text, "SUNDIALS fails with the flag %d", flag);
  return said->text;
}

void pw_sun_clear (SUNMatrix matrix, const int64_t *colptr, const int64_t *rowind) {
  size_t size = (size_t)SUNSparseMatrix_Columns (matrix), nonzeros = (size_t)colptr[size];
  memcpy (SUNSparseMatrix_IndexPointers (matrix), colptr, (size + 1) * sizeof *colptr);
  memcpy (SUNSparseMatrix_IndexValues (matrix), rowind, nonzeros * sizeof *rowind);
  memset (SUNSparseMatrix_Data (matrix), 0, nonzeros * sizeof (double));
}

int pw_sun_lacks_memory (SUNLinearSolver klu) {
  return SUNLinSol_KLUGetCommon (klu)->status == KLU_OUT_OF_MEMORY;
}

SUNMatrix pw_sun_matrix (int size, const int64_t *colptr, const int64_t *rowind, SUNContext context) {
  SUNMatrix matrix = SUNSparseMatrix (size, size, colptr[size], CSC_MAT, context);
  if (matrix) pw_sun_clear (matrix, colptr, rowind);
  return matrix;
}

/* The correction, or what is left after it if the iteration goes on converging as it does. */
static int sun_converged (SUNNonlinearSolver newton, N_Vector y, N_Vector change, pw_real enough, N_Vector weights,
                          void *data) {
  double *before = data, size = N_VWrmsNorm (change, weights), rate = size / *before;
  int iteration = 0;
  (void)y;
  SUNNonlinSolGetCurIter (newton, &iteration);
  *before = size;
  if (iteration > 0 && !(rate < 0.9)) return size <= enough ? SUN_NLS_SUCCESS : SUN_NLS_CONV_RECVR;
  double left = iteration == 0 ? 1 : rate / (1 - rate);
  return size * fmin (1, left) <= enough ? SUN_NLS_SUCCESS : SUN_NLS_CONTINUE;
}

int pw_sun_test_newton (SUNNonlinearSolver newton, double *size) {
  return SUNNonlinSolSetConvTestFn (newton, sun_converged, size);
}
