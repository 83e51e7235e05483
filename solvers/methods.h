/* The list of integrators: the one line to add for a new file in solvers/. */
#ifndef PW_METHODS_H
#define PW_METHODS_H

#include "pinwheel-solvers.h"

#define PW_METHODS   \
  PW_METHOD (rk4)    \
  PW_METHOD (erk5)   \
  PW_METHOD (erk8)   \
  PW_METHOD (adams)  \
  PW_METHOD (bdf)    \
  PW_METHOD (ida)    \
  PW_METHOD (galpha) \
  PW_METHOD (leapfrog)

/* pw_method_parse that keeps the options, values has room for PW_MAX_OPTIONS, and looks through `own` methods, too (NULL: there
 * are none). */
int pw_parse_options (const char *text, const pw_method *const *own, const pw_method **method, int *stabilisation,
                      double *values, pw_error *error);

/* Whether the run takes steps of the given size: its method, or an option of it, says so. */
void pw_choose_steps (pw_run *r);

#endif
