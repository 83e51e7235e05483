/* The problem of a decision: multipliers within limits (decision.c). */
#ifndef PW_DECISION_H_
#define PW_DECISION_H_
#include <math.h>
#include "pinwheel.h"

#define PW_DECISION_DEPENDENT 1e-11 /* least pivot over the diagonal of A, a squared sine; its round-off is 1e-13 */

/* n equations; arrays of that length, unless said otherwise.  z = b - A x are their accelerations or, in impacts,
 * velocities; x are their multipliers or impulses.  An equation that depends on constraints outside of the problem has
 * z = b: its row and column of A are 0. */
typedef struct {
  int n, *list; /* the equations, by their number in `limit` */
  const pw_bounds *limit;
  double *A, *b, *x, *lo, *hi, *factor; /* A: n x n; factor: scratch, n (n + 1) */
  double *towards;                      /* the direction of x on circles at their limit */
  int *held;                            /* scratch: the equations that hold */
  int *normal;          /* of friction, the index of its normal equation, whose x its lo and hi multiply; -1: none */
  unsigned char *fixed; /* 1: it slides with u other than 0: its trial mode stays */
  unsigned char *redundant; /* 1: it depends on those that hold, and is left out */
  unsigned char *blocked;   /* 1: it depends on those that hold, and stays at its limit */
  signed char *trial;       /* modes: 0: z = 0; 1: x = hi, z >= 0; -1: x = lo, z <= 0 */
  double *choice;           /* scratch of decision_enumerate: 2 n */
} pw_decision;

/* The sign of a multiplier that has one limit. */
static inline int pw_limit_sign (const pw_bounds *limit) {
  return isinf (limit->least) ? -1 : 1;
}

/* Solves the problem, from the present trial modes on.  PW_RETRY if that fails.  *count: the number of solutions where
 * friction depends on reactions, 0, 1 or 2 (several); otherwise -1 (not known). */
int pw_decide (pw_decision *d, int *count);

/* Principal pivoting, from the present trial modes on: the equation of the largest violation changes its mode.  After
 * many changes, which may be a cycle, the first violated one does (Murty).  An equation that depends on those that hold
 * stays at its limit, where it is satisfied, too; if `skips` is 1, it is left out.  PW_RETRY if that fails. */
int pw_decision_pivot (pw_decision *d, int skips);

/* Solves z = 0 for those whose trial mode is 0, with x of the others given.  Of equations that depend on each other the
 * later ones are left out, with x = 0, if they are friction or `skips` is 1; otherwise PW_RETRY. */
int pw_decision_solve (pw_decision *d, int skips);

/* z of equation k at the present x. */
double pw_decision_z (const pw_decision *d, int k);

/* 1 if z of equation k is 0, to round-off, at the present x. */
int pw_decision_rests (const pw_decision *d, int k);

/* 1 if an equation holds though constraints outside of the problem give it a z that is not 0. */
int pw_decision_contradicts (const pw_decision *d);

/* 1 if equation k depends on those whose trial mode is 0.  Destroys x. */
int pw_decision_depends (pw_decision *d, int k);

/* 1 for friction whose contact is open: nothing is required of it. */
int pw_decision_apart (const pw_decision *d, int k);

#endif
