/* A system with its steady motions, for the tests of these. */
#ifndef STEADY_CASE_H
#define STEADY_CASE_H

#include "pinwheel-analysis.h"

typedef struct {
  pw_system *s;
  pw_steady *x;
  pw_initial_value hold[4];
  pw_steady_settings set;
} steady;

void steady_open (steady *t);
void steady_close (steady *t);
pw_steady_motion steady_solve (steady *t, int attempt, double parameter);

/* Follows a branch to its end: the number of events of each type, and the parameter at the first three. */
typedef struct {
  int count[5];
  double at[5][3];
} branch_events;
branch_events steady_follow (steady *t, const pw_steady_motion *from, int direction);

/* Checks that re + i im is an eigenvalue, to 1e-9 of its size. */
void steady_expect (const pw_linear *l, double re, double im);

#endif
