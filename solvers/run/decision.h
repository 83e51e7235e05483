/* The problem of a decision: multipliers within limits (decision.c). */
#ifndef PW_DECISION_H_
#define PW_DECISION_H_
#include <math.h>
#include "pinwheel.h"

/* n equations; arrays of that length, unless said otherwise.  z = b - A x are their accelerations, x minus their
 * multipliers' excess over what is known. */
typedef struct {
  int n, *list; /* the equations, by their number in `limit` */
  const pw_bounds *limit;
  double *A, *b, *x, *lo, *hi, *factor; /* A: n x n; factor: scratch, n (n + 1) */
  double *towards;                      /* of circles at their limit, the direction of x */
  int *held;                            /* those that hold */
  int *on;                /* of friction the place of its normal equation, whose x its lo and hi multiply; -1: none */
  unsigned char *fixed;   /* 1: it slides at a velocity, its trial mode stays */
  unsigned char *extra;   /* 1: it depends on those that hold, and is left out */
  unsigned char *blocked; /* 1: it depends on those that hold, and stays at its limit */
  signed char *trial;     /* modes: 0: z = 0; 1: x = hi, z >= 0; -1: x = lo, z <= 0 */
  double *choice;         /* scratch, 3 n */
} pw_decision;

enum { PW_DECISION_MIXED = -2 }; /* number of solutions: friction of contacts and circles, which are not solved */

/* The sign of a multiplier that has one limit. */
static inline int pw_limit_sign (const pw_bounds *limit) {
  return isinf (limit->least) ? -1 : 1;
}

/* Solves the problem, from the present trial modes on.  PW_RETRY if that fails; *count: of solutions, 0 or 2, where
 * friction depends on reactions; else -1: not known; PW_DECISION_MIXED. */
int pw_decide (pw_decision *d, int *count);

/* Finds x and trial modes between lo and hi, from the present trial modes on: the largest violation changes its mode;
 * after many changes, which may cycle, the first one (Murty).  An equation that depends on those that hold stays at its
 * limit, where it is satisfied, too; if `skips` is 1, it is left out.  PW_RETRY if that fails. */
int pw_decision_pivot (pw_decision *d, int skips);

/* Solves z = 0 for those whose trial mode is 0, with x of the others given.  Of equations that depend on each other the
 * later ones are left out, with x = 0, if they are friction or `skips` is 1; otherwise PW_RETRY. */
int pw_decision_solve (pw_decision *d, int skips);

double pw_decision_z (const pw_decision *d, int k);

/* 1 for friction whose contact is open: nothing is required of it. */
int pw_decision_apart (const pw_decision *d, int k);

#endif
