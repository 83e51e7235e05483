/* The one place that knows which SUNDIALS is there.  Built and tested with 6.4; what 7.x renames is written below and
 * marked unverified. */
#ifndef PW_SUNDIALS_H
#define PW_SUNDIALS_H

#include <stdint.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#if SUNDIALS_VERSION_MAJOR >= 7 /* unverified */
#define PW_SUN_NO_COMM SUN_COMM_NULL
typedef sunrealtype pw_real;
#else
#define PW_SUN_NO_COMM NULL
typedef realtype pw_real;
#endif

/* How often a step is retaken, at about a quarter of its size, because Newton's iteration does not converge or the error is too
 * large: from 1 s down to the round-off of time.  SUNDIALS' own 10 times, a millionth, do not resolve where friction brings a body to rest. */
enum { PW_SUN_ATTEMPTS = 27 };

/* A context for an integrator of so many unknowns.  PW_OK or PW_MACHINE. */
int pw_sun_open (SUNContext *context, int unknowns);

/* The last message of an integrator, instead of its printing. */
typedef struct {
  char text[256];
} pw_sun_said;
void pw_sun_message (int code, const char *module, const char *function, char *text, void *said);
/* That message, or the flag in words if there was none. */
const char *pw_sun_reason (pw_sun_said *said, int flag);

/* Has the corrections of a Newton iteration count as they are: SUNDIALS' own test multiplies the first one by the
 * rate at which steps before have converged, which says nothing where a force saturates in between.  To be called when
 * the integrator has the solver; `size` is scratch that lives as long.  Returns as SUNDIALS. */
int pw_sun_test_newton (SUNNonlinearSolver newton, double *size);

/* A vector whose operations, and those of its clones, are ours (vectors.c); NULL: out of memory. */
N_Vector pw_sun_vector (sunindextype length, SUNContext context);

/* Whether KLU was refused memory by the last factorisation. */
int pw_sun_lacks_memory (SUNLinearSolver klu);

/* A square sparse matrix of this pattern in compressed columns, all 0; NULL: out of memory. */
SUNMatrix pw_sun_matrix (int size, const int64_t *colptr, const int64_t *rowind, SUNContext context);
/* All values 0, and the pattern anew: SUNDIALS clears it together with the values. */
void pw_sun_clear (SUNMatrix matrix, const int64_t *colptr, const int64_t *rowind);

#endif
