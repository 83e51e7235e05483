/* Verification: the self-test of an element type, every function of its table against differences of another one; and how far
 * a sample is from the equations of motion. */
#ifndef PINWHEEL_SELFTEST_H
#define PINWHEEL_SELFTEST_H

#include "run.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif

enum { PW_SELFTEST_CHECKS = 24 };

/* One comparison: the worst of all elements, entries and seeds. */
typedef struct {
  const char *name;   /* the sweep it judges: "gamma_q" */
  const char *about;  /* what should hold: "J a - gamma = d(J v - eta)/dt" */
  double error;       /* worst deviation, in units of the largest term it was computed from; inf: not a number */
  double bound;       /* the most it may be */
  const char *reason; /* where the bound comes from */
  int failed;         /* 1: some error was above the bound */
  char where[120];    /* the worst place, or what is wrong with the table */
} pw_selftest_check;

typedef struct {
  int checks, failed; /* in use, and failed */
  pw_selftest_check check[PW_SELFTEST_CHECKS];
} pw_selftest_report;

/* Tests a kind, built-in or a plug-in's, by its table alone, in a scene and at a state that follow from the seed.
 * Start with a zeroed report; further calls with other seeds keep the worst of every check.  A check that fails is in
 * the report; the status is PW_OK then, too.  Errors: PW_INPUT if the kind refuses whatever definition its field table
 * allows, PW_RESOURCE. */
int pw_selftest (const pw_kind *kind, unsigned seed, pw_selftest_report *report, pw_error *error);

/* The same where a scene uses the kind: its derivatives along a random motion around the state q, v at time t, with the
 * scene's own elements and signals, in units of its length scale and the time T.  The checks go into a report of their
 * own.  Errors: PW_RESOURCE. */
int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error);

/* ---- Independent verifier ---- */

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
 * solvers' arithmetic.  q, v and a have pw_system_coordinates entries, lambda pw_system_rows; scale is the run's.  Errors: PW_RESOURCE,
 * PW_METHOD if a signal fails. */
int pw_verify (const pw_system *s, const pw_scale *scale, double t, const double *q, const double *v, const double *a,
               const double *lambda, pw_verification *result);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#ifdef __cplusplus
}
#endif

#endif
