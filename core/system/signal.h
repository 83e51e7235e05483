/* Signals of a compiled system: values, time derivatives and breakpoints. */
#ifndef PW_SIGNAL_H
#define PW_SIGNAL_H

#include "util.h"

/* A signal of one element, and the states it reads. */
typedef struct {
  pw_signal signal;
  int reads;        /* number of states a function signal reads */
  const int *state; /* their indices: coordinate j, or coordinates + j for a velocity */
  double *x;        /* 2 reads: values of these states, then the gradient */
  double *spline;   /* of a table: see pw_table_spline */
  double *u;        /* 3: receives value, first and second time derivative; x, u: NULL except in a workspace */
  int of_force;     /* 1: belongs to a force, which needs no derivatives */
} pw_source;

/* Stores value, first and second time derivative at time t in source->u; of a force's signal the derivatives are
 * meaningless.  source->x: the states that a function reads.  Returns non-zero if the user's function does so or
 * computes values that are not finite. */
int pw_signal_eval (const pw_source *source, double t);

/* The first time after t at which the signal, its first or its second derivative jumps, or a smooth-step starts or
 * ends, so that a step must end there; INFINITY if there is none.  kinks: 1: also where the second derivative has a
 * kink, at the points of a cubic table.  Of a function signal, what its breakpoint function returns. */
double pw_signal_breakpoint (const pw_signal *s, int kinks, double t);

/* Enclosures, for steps that must see what is narrow in a signal (narrow.c): of the derivative that acts, 0 for a
 * force, 1 or 2 for a velocity or position constraint. */
typedef enum {
  PW_RESOLVED,  /* nothing to enclose: between breakpoints constant, or monotonic with a bounded curvature */
  PW_PERIODIC,  /* a harmonic */
  PW_ENCLOSED,  /* pw_signal_enclose encloses it */
  PW_UNENCLOSED /* a function without `enclose` */
} pw_enclosure;
pw_enclosure pw_signal_enclosure (const pw_source *source, int derivative);

/* As pw_function.enclose, in an interval without a breakpoint. */
void pw_signal_enclose (const pw_source *source, int derivative, const pw_interval *value, const pw_interval *rate,
                        pw_interval bound[2]);

/* The derivative that acts, at time t and the states x; NaN if the signal fails there.  Leaves source->u unchanged. */
double pw_signal_acting (const pw_source *source, int derivative, double t, const double *x);

/* 1 if the value may jump: that of a pulse; that of a function, of which this is not known. */
static inline int pw_signal_value_may_jump (const pw_signal *s) {
  return s->type == PW_PULSE || s->type == PW_FUNCTION;
}

/* ---- Tables (signal.c) ---- */

/* The signal at point i of a table. */
static inline double pw_table_value (const pw_signal *s, int i) {
  double scale = s->table.scale == 0 ? 1 : s->table.scale;
  return s->table.offset + scale * s->table.value[i];
}

/* pw_table_spline and pw_table_eval ignore scale and offset, which compilation has applied to the values.
 * Computes the spline of a checked table, 2 count numbers: the first derivative just after each point (after the last
 * one meaningless), then the second derivatives. */
void pw_table_spline (const pw_signal *s, double *spline);
void pw_table_eval (const pw_signal *s, const double *spline, double t, double u[3]);
double pw_table_breakpoint (const pw_signal *s, int kinks, double t);
/* Adds the range of derivative d of a table between two times to `bound`; d = 3: the third derivative. */
void pw_table_enclose (const pw_signal *s, const double *spline, int d, double from, double to, pw_interval *bound);

#endif
