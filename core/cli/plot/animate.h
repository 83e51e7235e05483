/* Animation of a run: a page for a browser that needs nothing else. */
#ifndef PW_ANIMATE_H
#define PW_ANIMATE_H

#include "cli.h"
#include "plots.h"

/* Whether a file of this name can be written: PW_INPUT unless it ends in .html. */
int pw_animation_check (const char *path, pw_error *error);

/* Writes what was kept of a run, with forces, to the output of that path, which the caller completes; `reason` says why
 * it did not reach its end, else "".  0 for a run too short, which is reported. */
int pw_animate (const pw_plots *p, const char *path, pw_output *o, const char *method, const char *reason);

#endif
