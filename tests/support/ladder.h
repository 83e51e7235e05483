/* Errors of methods over halvings of the step, or of any settings, against erk8+projection at its tightest. */
#ifndef LADDER_H
#define LADDER_H

#include "runs.h"

/* A model of the gallery by name with its defaults; or "arm": an arm whose shoulder a drive moves, its elbow free,
 * with gravity (rheonomic, holonomic); or "tractor": a body whose wheel a drive steers and a speed pushes (rheonomic,
 * nonholonomic). */
pw_system *ladder_open (const char *model);

typedef struct {
  double q, v, lambda; /* largest errors at the end: in units of the scene; of multipliers over the largest one */
  pw_statistics cost;
} ladder_error;

ladder_error ladder_solve (const char *model, const char *method, const pw_settings *settings, double t);
ladder_error ladder_run (const char *model, const char *method, double step, double t);

/* Checks that errors of positions, and with `depth` of velocities or multipliers too, decrease by a factor of 2^(order
 * - band) to 2^(order + band) from each of three steps h, h/2, h/4 to the next. */
typedef enum { LADDER_Q, LADDER_V, LADDER_LAMBDA } ladder_depth;
void ladder_expect (const char *model, const char *method, double h, double t, int order, double band,
                    ladder_depth depth);

#endif
