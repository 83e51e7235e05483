/* Messages and results of a run. */
#ifndef PW_REPORT_H
#define PW_REPORT_H

#include "cli.h"

/* ---- Warnings on standard error ---- */

/* Initial phi and headings that are probably degrees; expressions that may jump with states. */
void pw_report_model (const pw_cli_model *m);

/* Options without effect, tables that do not cover the run, long fixed steps, an absolute tolerance within which a
 * force saturates. */
void pw_report_settings (pw_run *run, const pw_system *system, const char *method, const pw_cli_line *line,
                         const pw_settings *settings);

/* Derivatives by differences, states changed by the consistent initialisation, redundant constraint equations. */
void pw_report_initialisation (pw_run *run, const pw_system *system, const char *const *redundant);

/* States that the consistent initialisation changes, if it succeeds within this processor time [s].  PW_OK or
 * PW_RESOURCE. */
int pw_report_initial_state (const pw_cli_model *m, double limit, pw_error *error);

/* After the run: a relative energy defect of more than 1 % (NaN: not known), steps that did not resolve a
 * change. */
void pw_report_warnings (const pw_run *run, double defect);

/* ---- Results ---- */

/* Descriptions of the redundant constraint equations, ended by NULL; release them with one free.  NULL if there are
 * none or memory is exhausted. */
const char **pw_report_redundancies (pw_run *run);

#endif
