/* The option --vary NAME=FIRST:LAST of `steady` and `periodic`: a number that varies continuously. */
#ifndef PW_VARY_H
#define PW_VARY_H

#include "progress.h"
#include "unknowns.h"

typedef struct {
  const char *name, *unit;       /* "" without --vary; pw_vary_read sets the unit of a parameter alone */
  const pw_parameter *parameter; /* of the model; NULL: there is none of this name */
  double first, last;
  /* private */
  pw_unknown unknown;
  pw_unknowns unknowns; /* this one, for pw_unknowns_system */
} pw_vary;

/* Reads the option into *v, which is zero-initialised and must not move later: it points to itself.  PW_INPUT if it is
 * malformed, or the parameter cannot vary in the range or is also given by --set. */
int pw_vary_read (pw_vary *v, const pw_cli_line *line, const pw_cli_model *m, const char *text, pw_error *error);
/* Shows the progress of a branch at a value between `from` and `to`; starts a progress that is zero-initialised. */
void pw_vary_progress (const pw_vary *v, pw_progress *p, double from, double value, double to);
/* The system at a value of the parameter: `compile` of pw_steady_settings and pw_periodic_settings, whose context is
 * the pw_vary. */
pw_system *pw_vary_compile (void *vary, double value, pw_error *error);

#endif
