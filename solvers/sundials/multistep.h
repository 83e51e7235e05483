/* The multistep methods of CVODES on the accelerations: one driver for both formulas.
 *
 *   y = (q, v),   y' = (v, a (t, q, v)),   a from  M a + J^T lambda = f,  J a = gamma, with Baumgarte's terms if asked for
 *
 * (Hindmarsh et al. 2005, SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers.) */
#ifndef PW_MULTISTEP_H
#define PW_MULTISTEP_H

#include "method.h"

/* What a pw_method of this family puts in its table; the formula is CV_ADAMS or CV_BDF. */
int pw_multistep_open (pw_run *r, int formula, pw_error *error);
int pw_multistep_advance (pw_run *r, double t_end, pw_error *error);
int pw_multistep_at (pw_run *r, double t, pw_error *error);
int pw_multistep_restart (pw_run *r, pw_error *error);
void pw_multistep_close (pw_run *r);

#endif
