/* Evaluation of signals. */
#ifndef PW_SIGNAL_H
#define PW_SIGNAL_H

#include "util.h"

/* A signal of one element, and the states it reads. */
typedef struct {
  pw_signal signal;
  int reads;        /* number of states a function signal reads */
  const int *state; /* their indices: coordinate j, or coordinates + j for a velocity */
  double *x;        /* 2 reads: values of these states, then the gradient */
  double *spline;   /* of a table, 2 count: first derivative at each point, then second (table.c) */
  double *u;        /* 3: destination of its values */
  int of_force;     /* 1: belongs to a force, which needs no derivatives */
} pw_source;

/* Value and, if `derivatives`, first and second time derivative at time t; the states a function reads are in
 * source->x.  Returns non-zero, which stops the run, if the user's function did or if its values are not finite. */
int pw_signal_eval (const pw_source *source, double t, int derivatives, double u[3]);

/* First time after t at which the signal or its first or second derivative jumps, or INFINITY; with `knots` also
 * where the second derivative of a cubic table has a kink. */
double pw_signal_breakpoint (const pw_signal *s, int knots, double t);

/* ---- Tables (table.c) ---- */

/* The signal at point i of a table. */
static inline double pw_table_value (const pw_signal *s, int i) {
  double scale = s->table.scale == 0 ? 1 : s->table.scale;
  return s->table.offset + scale * s->table.value[i];
}

/* Fills 2 count numbers: the spline of a checked table. */
void pw_table_spline (const pw_signal *s, double *spline);
void pw_table_eval (const pw_signal *s, const double *spline, double t, double u[3]);
double pw_table_breakpoint (const pw_signal *s, int knots, double t);

#endif
