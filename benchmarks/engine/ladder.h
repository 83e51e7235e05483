/* Runs down a ladder of steps or tolerances, and what an accuracy costs by it: read off a line through the points nearby
 * (least squares of the logarithms). */
#ifndef LADDER_H
#define LADDER_H

#include "timing.h"

enum { LADDER_ROUNDS = 7, LADDER_RUNGS = 24 };

typedef struct {
  double level, error, evaluations; /* step [s] or tolerance; [m]; of the accelerations or the residual */
  double cpu[LADDER_ROUNDS];        /* [s], sorted in the end */
} ladder_point;

/* One way to go down: from `first`, by `factor`. */
typedef struct ladder ladder;
struct ladder {
  const char *name, *method;
  double first, factor;
  int count;
  /* Runs to the end, q taking the positions there (NaN: it fails); returns the evaluations. */
  double (*run) (void *scene, const ladder *way, double level, double *q);
  const char *function; /* what callgrind counts, if asked */
  ladder_point point[LADDER_RUNGS];
};

double ladder_rung (const ladder *l, int i);

/* Takes one point; the error is that of the lengths among n coordinates, with room for them in q. */
void ladder_take (ladder *l, void *scene, const double *reference, int n, double *q, int round, int level);

/* Sorts the times of all rounds; the median is then in the middle. */
void ladder_sort (ladder *l, int rounds);

/* Processor time [s] and evaluations for an error [m]; 0: it is not reached. */
double ladder_time (const ladder *l, double error, int rounds);
double ladder_evaluations (const ladder *l, double error);

#endif
