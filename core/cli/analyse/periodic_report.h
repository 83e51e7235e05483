/* The command `pinwheel periodic`, its result, and the reports of that (periodic_report.c). */
#ifndef PW_PERIODIC_REPORT_H
#define PW_PERIODIC_REPORT_H

#include "vary.h"

/* A periodic motion found, or a point of a branch. */
typedef struct {
  pw_periodic_orbit orbit; /* its arrays are in `state` */
  double *state;           /* q, v at the beginning, q, v at the end; then re, im of the multipliers */
} pw_periodic_point;

enum { PW_PERIODIC_ATTEMPTS = 3 }; /* of Newton's method, each after more periods of a run */

typedef struct {
  pw_cli_line line;
  const char *period_text, *periods_text, *guess_text, *vary_text, *folder;
  pw_cli_model m;
  pw_files files;
  pw_limit limit;
  pw_periodic_settings settings;
  const char *source; /* of the period: "of the signals", "--period", "found" */
  pw_vary vary;
  pw_periodic *search;
  pw_periodic_point *point;
  int points;
  size_t room;
  double nearest[PW_PERIODIC_ATTEMPTS]; /* the residual at which each attempt ended */
  char reason[300];                     /* why, of the nearest one */
  int stopped;                          /* 1: by Ctrl-C or --limit */
} pw_periodic_command;

void pw_periodic_print (const pw_periodic_command *cmd);
/* Writes everything as JSON and as a table, and a figure, into the folder.  Returns a status. */
int pw_periodic_write (const pw_periodic_command *cmd, pw_error *error);

#endif
