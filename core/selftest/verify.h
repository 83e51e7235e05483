/* The independent verifier: how far a state, its accelerations and multipliers are from the equations. */
#ifndef PW_VERIFY_H
#define PW_VERIFY_H

#include "pinwheel.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How well one set of equations holds. */
typedef struct {
  double scaled;   /* worst residual over the sum of the absolute values of its terms; inf: not a number */
  double absolute; /* the largest residual itself, in the units of its row */
  char name[80];   /* where the worst scaled one is: "B.Fx", "frame.vx" */
} pw_verdict;

typedef struct {
  pw_verdict position;     /* g (q, t) = 0 */
  pw_verdict velocity;     /* J v = eta */
  pw_verdict acceleration; /* J a = gamma */
  pw_verdict force;        /* M a + J^T lambda = f; absolute in N or N m */
} pw_verification;

/* Recomputes all four residuals at a state from the elements themselves, one after the other, with none of the
 * solvers' arithmetic.  q, v and a have pw_count_coordinates entries, lambda pw_count_rows.  Errors: PW_MACHINE,
 * PW_METHOD if a signal fails. */
int pw_verify (pw_system *s, double t, const double *q, const double *v, const double *a, const double *lambda,
               pw_verification *result);

#ifdef __cplusplus
}
#endif

#endif
