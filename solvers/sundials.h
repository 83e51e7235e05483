/* The one place that knows which SUNDIALS is there.  Built and tested with 6.4; what 7.x renames is written below and
 * marked unverified. */
#ifndef PW_SUNDIALS_H
#define PW_SUNDIALS_H

#include <sundials/sundials_config.h>
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#if SUNDIALS_VERSION_MAJOR >= 7 /* unverified */
#define PW_SUN_NO_COMM SUN_COMM_NULL
typedef sunrealtype pw_real;
#else
#define PW_SUN_NO_COMM NULL
typedef realtype pw_real;
#endif

#endif
