/* The list of integrators, for which a new one needs a line here, and the reading of method names with their
 * options. */
#ifndef PW_METHODS_H
#define PW_METHODS_H

#include "pinwheel-solvers.h"

#ifndef PW_METHODS /* interactive pages have fewer */
#define PW_METHODS     \
  PW_METHOD (rk4)      \
  PW_METHOD (erk5)     \
  PW_METHOD (erk8)     \
  PW_METHOD (adams)    \
  PW_METHOD (bdf)      \
  PW_METHOD (ida)      \
  PW_METHOD (radau)    \
  PW_METHOD (galpha)   \
  PW_METHOD (leapfrog) \
  PW_METHOD (moreau)
#endif

/* pw_method_parse that also returns the values of the options (room for PW_MAX_OPTIONS numbers, method.h), and also
 * searches the caller's `own` methods (NULL: none). */
int pw_parse_options (const char *text, const pw_method *const *own, const pw_method **method, int *stabilisation,
                      double *values, pw_error *error);

#endif
