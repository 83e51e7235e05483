/* Runs a method at decreasing steps or tolerances, for the program peers.  The cost of an accuracy is interpolated:
 * a line through the points near that error, by least squares of the logarithms. */
#ifndef LADDER_H
#define LADDER_H

#include "timing.h"

enum { LADDER_ROUNDS = 5, LADDER_LEVELS = 24 };

typedef struct {
  double level;              /* step [s] or relative tolerance */
  double error;              /* of the positions at the end [m]; NaN: the run failed */
  double evaluations;        /* of the accelerations or the residual */
  double cpu[LADDER_ROUNDS]; /* processor time [s]; sorted by ladder_sort */
} ladder_point;

/* A method at `count` levels: `first`, and each `factor` times the one before. */
typedef struct ladder ladder;
struct ladder {
  const char *name, *method;
  double first, factor;
  int count;
  /* Runs to the end; q takes the coordinates there (NaN: the run fails); returns the number of evaluations. */
  double (*run) (void *scene, const ladder *self, double level, double *q);
  const char *function; /* whose instructions callgrind counts */
  ladder_point point[LADDER_LEVELS];
};

/* Runs the i-th level.  Its error is the largest of x and y of all bodies; q: room for the n coordinates. */
void ladder_take (ladder *l, void *scene, const double *reference, int n, double *q, int round, int i);

/* Sorts the times of all rounds; the median is then in the middle. */
void ladder_sort (ladder *l);

/* Processor time [s] and evaluations for an error [m]; 0: no level reaches it. */
double ladder_time (const ladder *l, double error);
double ladder_evaluations (const ladder *l, double error);

#endif
