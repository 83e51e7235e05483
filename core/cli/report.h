/* What `pinwheel run` says about a run: what the start moved, and how it ended. */
#ifndef PW_REPORT_H
#define PW_REPORT_H

#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Says on standard error which states the consistent start has moved, if any. */
void pw_report_start (const pw_system *s, const pw_start_report *start);

/* A table for the eye on standard output: last state, reactions, residuals, energies, cost. */
void pw_report_end (const pw_summary *summary, const pw_system *s, const pw_sample *last, int energy,
                    const pw_statistics *statistics);

#endif
