/* What `pinwheel run` says about a run: what the start moved, and how it ended. */
#ifndef PW_REPORT_H
#define PW_REPORT_H

#include "cli.h"
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Says on standard error that a tolerance was given to a method of fixed steps, or a step to one that follows tolerances.  Who
 * gives both, as scripts do, is not told. */
void pw_report_unused (const char *method, const pw_cli_line *w);

/* Says on standard error which headings and starting angles are more than a turn: degrees, most likely. */
void pw_report_angles (const pw_model *m);

/* Says on standard error which expressions may jump as states change, where no step ends. */
void pw_report_jumps (const pw_model *m);

/* Says on standard error that a fixed step is longer than what moves at the start takes to change. */
void pw_report_step (const pw_run *r, const char *method, double step);
/* Of an absolute tolerance within which a force saturates; 0: none is given. */
void pw_report_atol (pw_run *r, const pw_system *s, const char *method, double atol);

/* Says on standard error which states the consistent start has moved, if any. */
void pw_report_start (const pw_system *s, const pw_start_report *start);

/* Says on standard error which second-order blocks are differenced, for want of a formula, if any. */
void pw_report_differences (const pw_system *s);

/* Copies of what the run says about its redundant rows, ended by NULL, to be freed as one; NULL if there are none, or no
 * memory.  pw_report_redundant says the first of them on standard error. */
const char **pw_report_redundancies (pw_run *r);
void pw_report_redundant (const char *const *text);

/* Says on standard error that speeds have grown out of all proportion, and still grow. */
void pw_report_growth (const pw_system *s, const pw_run *r);

/* Says on standard error that a part of the energy is unaccounted for, if it is more than 1 %. */
void pw_report_unbalanced (const pw_run *r, double part);

/* A table for the eye on standard output: last state, reactions, residuals, energies, cost. */
void pw_report_end (const pw_summary *summary, const pw_system *s, const pw_sample *last, int energy,
                    const pw_statistics *statistics);

#endif
