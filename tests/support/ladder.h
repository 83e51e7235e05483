/* Errors of methods with given steps or settings, and their orders: errors refer to erk8+projection at rtol 3e-14. */
#ifndef LADDER_H
#define LADDER_H

#include "runs.h"

/* The system of a model of the gallery with its defaults; or "arm": two rods under gravity, the upper one turned by
 * a drive (holonomic, rheonomic); or "tractor": a body with a steered wheel and a prescribed speed (nonholonomic,
 * rheonomic). */
pw_system *ladder_open (const char *model);

typedef struct {
  double q, v;   /* largest errors at the end, relative to the scales of the states */
  double lambda; /* largest error of a multiplier, relative to the largest multiplier */
  pw_statistics cost;
} ladder_error;

/* The errors of a run to t, with settings or with a fixed step. */
ladder_error ladder_solve (const char *model, const char *method, const pw_settings *settings, double t);
ladder_error ladder_run (const char *model, const char *method, double step, double t);

/* Checks the order in runs with the steps h, h/2 and h/4: the errors of positions, and up to `depth` those of
 * velocities and multipliers, decrease by a factor of 2^(order - band) to 2^(order + band) from each step to the
 * next. */
typedef enum { LADDER_Q, LADDER_V, LADDER_LAMBDA } ladder_depth;
void ladder_expect (const char *model, const char *method, double h, double t, int order, double band,
                    ladder_depth depth);

#endif
