/* The number that `steady` and `periodic` vary continuously, of the option --vary NAME=FIRST:LAST. */
#ifndef PW_VARY_H
#define PW_VARY_H

#include "progress.h"
#include "unknowns.h"

typedef struct {
  const char *name, *unit;
  const pw_parameter *parameter; /* of this name; NULL: there is none */
  double first, last;
  /* private */
  pw_unknown unknown;
  pw_unknowns unknowns; /* a list of this one, for pw_unknowns_system */
} pw_vary;

/* Reads the option.  PW_INPUT if the parameter, if it is one, cannot vary in the range, or is also set. */
int pw_vary_read (pw_vary *v, const pw_cli_line *line, const pw_cli_model *m, const char *text, pw_error *error);
/* Shows the progress of a branch from one value to another; starts a progress that is zero-initialised. */
void pw_vary_progress (const pw_vary *v, pw_progress *p, double from, double value, double to);
/* The system at a value of the parameter; for `compile` of pw_steady_settings and pw_periodic_settings. */
pw_system *pw_vary_compile (void *vary, double value, pw_error *error);

#endif
