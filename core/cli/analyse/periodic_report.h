/* The result of `pinwheel periodic`, and its reports. */
#ifndef PW_PERIODIC_REPORT_H
#define PW_PERIODIC_REPORT_H

#include "vary.h"

/* A periodic motion found, or a point of a branch. */
typedef struct {
  pw_periodic_orbit orbit; /* its arrays are those of `state` */
  double *state;           /* 4 coordinates: at the begin, at the end; then re, im */
} pw_periodic_point;

enum { PW_PERIODIC_ATTEMPTS = 3 };

typedef struct {
  pw_cli_line line;
  const char *period_text, *periods_text, *guess_text, *vary_text, *folder;
  pw_cli_model m;
  pw_files files;
  pw_limit limit;
  pw_periodic_settings set;
  const char *source; /* of the period: "of the signals", "--period", "found" */
  pw_vary vary;
  pw_periodic *search;
  pw_periodic_point *point;
  int points;
  size_t room;
  double nearest[PW_PERIODIC_ATTEMPTS]; /* residuals at the end of the attempts without solution */
  char reason[300];                     /* why, of the nearest one */
  int stopped;                          /* 1: by Ctrl-C or --limit */
} pw_periodic_cli;

void pw_periodic_print (const pw_periodic_cli *x);
/* Writes everything as JSON, as a table, and a figure, into the folder.  A status. */
int pw_periodic_write (const pw_periodic_cli *x, pw_error *error);

#endif
