/* A run compared with a reference. */
#ifndef PW_COMPARISON_H
#define PW_COMPARISON_H

#include "motion.h"

typedef struct {
  int on; /* 0: there is no reference */
  pw_motion reference, motion;
  int next; /* index of the next sample */
  pw_reference_error error;
} pw_comparison;

/* Opens the reference of a run up to t_end: the table at `path`, otherwise the model's reference solution unless the run
 * has other initial values (`started`).  Close it in every case.  Errors: PW_INPUT, PW_RESOURCE. */
int pw_comparison_open (pw_comparison *c, const pw_cli_model *m, const char *path, int started, double t_end,
                        pw_error *error);
void pw_comparison_close (pw_comparison *c);
/* The time of the next sample, or INFINITY. */
double pw_comparison_next (const pw_comparison *c);
void pw_comparison_take (pw_comparison *c, const pw_system *s, const pw_sample *sample);
/* Saves or loads the samples of a checkpoint. */
void pw_comparison_serialise (pw_comparison *c, pw_archive *a);
/* The errors of the samples taken; NULL if there are none. */
const pw_reference_error *pw_comparison_errors (pw_comparison *c, const pw_system *s);

#endif
