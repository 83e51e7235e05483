/* The first time in a step at which one of several functions becomes positive (crossing.c). */
#ifndef PW_CROSSING_H_
#define PW_CROSSING_H_
#include "pinwheel-solvers.h"

enum { PW_CROSSING_DEPTH = 4 }; /* halvings of a step; parts of 1/16 */

typedef struct {
  int count;                                                           /* functions */
  int (*at) (void *context, double t, double *value, pw_error *error); /* stores their values: a status; NaN: unknown */
  void *context;
  double *memory; /* (PW_CROSSING_DEPTH + 2) x count */
  double width;   /* to which a time is located; 0: to round-off */
  double small;   /* a positive value up to this one is at the root; 0: only the width counts */
  /* A time before the step and the values there; NULL unless functions that may be positive in it increase in it. */
  double before;
  const double *at_before;
  pw_error *error;
  int status; /* of the last evaluation */
} pw_crossing_search;

/* The first time in (a, b] at which a function is positive, of those that pw_run_find_crossing promises to find; no
 * value at a is.  NaN: there is none, or an error. */
double pw_first_crossing (pw_crossing_search *x, double a, const double *at_a, double b, const double *at_b);

#endif
