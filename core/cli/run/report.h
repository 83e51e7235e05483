/* Messages before a run, on standard error. */
#ifndef PW_REPORT_H
#define PW_REPORT_H

#include "cli.h"

/* The end of a list of which `more` entries are not printed. */
void pw_report_more (FILE *f, int more, const char *hint);

/* Initial phi and headings that are probably degrees; expressions that may jump with states. */
void pw_report_model (const pw_cli_model *m);

/* Derivatives by differences, states changed by the consistent initialisation, redundant constraint equations. */
void pw_report_initialisation (pw_run *run, const pw_system *system, const char *const *redundant);

/* States that the consistent initialisation changes, if it succeeds within this processor time [s].  PW_OK or
 * PW_RESOURCE. */
int pw_report_initial_state (const pw_cli_model *m, double limit, pw_error *error);

/* Descriptions of the redundant constraint equations, ended by NULL; release them with one free.  NULL if there are
 * none or memory is exhausted. */
const char **pw_report_redundancies (pw_run *run);

#endif
