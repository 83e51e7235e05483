/* Animation of a run: a self-contained page for a browser. */
#ifndef PW_ANIMATE_H
#define PW_ANIMATE_H

#include "cli.h"
#include "plots.h"

/* Whether a file of this name can be written: PW_INPUT unless it ends in .html. */
int pw_animation_check (const char *path, pw_error *error);

/* Writes the samples of a run, with forces, to the output of that path, which the caller completes; `reason`: why the
 * run did not reach its end, or "".  Returns 0 and reports it if the run is too short. */
int pw_animate (const pw_plots *p, const char *path, pw_output *o, const char *method, const char *reason);

#endif
