/* The command `pinwheel periodic`, its result and its reports (periodic_report.c). */
#ifndef PW_PERIODIC_REPORT_H
#define PW_PERIODIC_REPORT_H

#include "vary.h"

/* A periodic motion found, or a point of a branch. */
typedef struct {
  pw_periodic_orbit orbit; /* its arrays are in `state` */
  double *state;           /* q, v at the beginning, q, v at the end; then re, im of the multipliers */
} pw_periodic_point;

enum { PW_PERIODIC_ATTEMPTS = 3 }; /* of Newton's method, each from the state after more periods of a run */

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
  pw_periodic_point *point; /* points: the motion, or those of the branch */
  int points;
  size_t room;                           /* points allocated */
  double residual[PW_PERIODIC_ATTEMPTS]; /* of Newton's method, in units of the scene; INFINITY: not begun */
  char reason[300];                      /* why the attempt with the least residual failed, or "" */
  int stopped;                           /* 1: by Ctrl-C or --limit */
} pw_periodic_command;

/* Prints the motion or the branch; there is at least one point. */
void pw_periodic_print (const pw_periodic_command *cmd);
/* Writes periodic.json, periodic.csv and the figure into the folder.  A status. */
int pw_periodic_write (const pw_periodic_command *cmd, pw_error *error);

#endif
