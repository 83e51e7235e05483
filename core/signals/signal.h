/* Evaluation of signals, and what they are made of. */
#ifndef PW_SIGNAL_H
#define PW_SIGNAL_H

#include "util.h"

/* A signal of one element, with the states it reads. */
typedef struct {
  pw_signal signal;
  int reads;        /* how many states a function signal reads */
  const int *state; /* their indices: coordinate j, or coordinates + j for a rate */
  double *x;        /* reads: their values, then reads: the gradient */
  double *spline;   /* of a table: rate, then acceleration at each of its points (table.c) */
  double *u;        /* 3: where its values go */
  int forced;       /* 1: it serves a force, which needs no derivatives */
} pw_source;

/* Value, rate and acceleration at time t (the last two only if derivatives are asked for); the states a function
 * reads are in source->x.  Returns what the user's function returned, or not 0 if its values are not finite: that stops the
 * run. */
int pw_signal_eval (const pw_source *source, double t, int derivatives, double u[3]);

/* First time after t at which the signal jumps or its rate or acceleration does, or INFINITY; with `knots` also where the
 * acceleration of a cubic table has a kink. */
double pw_signal_breakpoint (const pw_signal *s, int knots, double t);

/* ---- Tables (table.c) ---- */

/* The signal at a point. */
static inline double pw_table_value (const pw_signal *s, int i) {
  double scale = s->table.scale == 0 ? 1 : s->table.scale;
  return s->table.offset + scale * s->table.value[i];
}

/* Fills 2 count numbers: the spline of a table that has been checked. */
void pw_table_spline (const pw_signal *s, double *spline);
void pw_table_eval (const pw_signal *s, const double *spline, double t, double u[3]);
double pw_table_breakpoint (const pw_signal *s, int knots, double t);

#endif
