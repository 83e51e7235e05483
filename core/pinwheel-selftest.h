/* Verification: the self-test of an element type, which compares most functions of its table with differences of
 * others; and the residuals of the equations of motion at a sample. */
#ifndef PINWHEEL_SELFTEST_H
#define PINWHEEL_SELFTEST_H

#include "run.h"

PW_BEGIN

enum { PW_SELFTEST_CHECKS = 24 }; /* room for checks in a report */

/* One check: the worst result over all elements, entries and seeds. */
typedef struct {
  const char *name;   /* the function checked: "gamma_q" */
  const char *about;  /* the identity checked: "J a - gamma = d(J v - eta)/dt" */
  double error;       /* worst deviation, relative as `reason` says, or absolute if "exact"; inf: not finite */
  double bound;       /* largest permitted error */
  const char *reason; /* origin of the bound */
  int failed;         /* 1: an error exceeded the bound */
  char where[120];    /* location of the worst error, or the fault of the table */
} pw_selftest_check;

typedef struct {
  int checks, failed; /* number of checks, and of failed ones */
  pw_selftest_check check[PW_SELFTEST_CHECKS];
} pw_selftest_report;

/* Tests an element type, built-in or from a plug-in, using only its table, in a random scene and state generated
 * from the seed.  Start with a zero-initialised report; further calls with other seeds keep the worst result of each
 * check.  Failed checks are only in the report: the status is PW_OK.  Errors: PW_INPUT if the type rejects 200
 * random definitions that its field table permits, PW_RESOURCE. */
int pw_selftest (const pw_kind *kind, unsigned seed, pw_selftest_report *report, pw_error *error);

/* Tests an element type in a scene that uses it: its derivatives along a random motion near the state q, v at time
 * t, with the scene's elements and signals, in units of its length scale and the time T.  Use a separate report.
 * Errors, which clear the report: PW_RESOURCE; PW_METHOD if a signal fails along this motion.  PW_INPUT: no system. */
int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error);

/* ---- Independent verifier ---- */

/* Residuals of one set of equations. */
typedef struct {
  double scaled;   /* worst residual over a size; inf: not finite.  Velocities, accelerations: the sum of the absolute
                    * values of the terms, plus L/T or L/T^2.  Positions: g_size, at least L.  Forces: one size for all,
                    * the largest such sum or mass x L/T^2 (moments: times L) */
  double absolute; /* largest residual, in the units of its equation; inf: not finite */
  char name[PW_NAME_BYTES]; /* the equation with the worst scaled residual: "B.Fx", "frame.vx" */
} pw_worst_residual;

typedef struct {
  pw_worst_residual position;     /* g (q, t) = 0 */
  pw_worst_residual velocity;     /* J v = eta */
  pw_worst_residual acceleration; /* J a = gamma */
  pw_worst_residual force;        /* M a + J^T lambda = f; absolute in N or N m */
} pw_verification;

/* Recomputes all four residuals at a state, element by element, without any solver code.  q, v and a:
 * pw_system_coordinates entries; lambda: pw_system_rows; scale: of the run.  Errors: PW_RESOURCE, PW_METHOD if a
 * signal fails. */
int pw_verify (const pw_system *s, const pw_scale *scale, double t, const double *q, const double *v, const double *a,
               const double *lambda, pw_verification *result);

PW_END

#endif
