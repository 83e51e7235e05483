/* One run of a sweep. */
#ifndef PW_SWEEP_ROW_H
#define PW_SWEEP_ROW_H

#include "sweep_plan.h"

/* Performs a run with the system of its parameters and appends its cells, without the end of the line.  `error` has the
 * reason if the system could not be opened.  Returns the status of the run, which has a row even if it failed; PW_RETRY
 * if pw_stop became non-zero; PW_RESOURCE with the error if the run was impossible.  May be called by several threads
 * at once. */
int pw_sweep_row (const pw_plan *p, const pw_sweep_system *s, long row, pw_text *text, pw_error *error);

#endif
