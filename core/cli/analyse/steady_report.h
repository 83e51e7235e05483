/* The result of `pinwheel steady`, and its reports. */
#ifndef PW_STEADY_REPORT_H
#define PW_STEADY_REPORT_H

#include "states.h"
#include "vary.h"

/* A steady motion found, or a point of a branch. */
typedef struct {
  int branch;              /* from 1; without --vary its number */
  int attempt;             /* of pw_steady_solve: 0 and 1 begin at the initial state */
  pw_steady_motion motion; /* its arrays are those of `state` */
  pw_linear linear;        /* twist, unknowns and eigenvalues of it */
  double *state;           /* q, v; then re, im, rigid */
  char advice[200];        /* options that select it within its family, " --hold NAME=VALUE..." */
} pw_steady_point;

enum { PW_STEADY_REASON = 200 };

typedef struct {
  pw_cli_line line;
  const char **hold_texts, *vary_text, *starts_text, *at_text, *folder;
  pw_cli_model m;
  pw_files files;
  pw_limit limit;
  pw_steady_settings set;
  pw_initial_value hold[PW_HOLDS]; /* set.holds */
  pw_vary vary;
  int attempts; /* random ones at each end */
  pw_steady *steady;
  pw_steady_point *point;
  int points;
  size_t room;
  char (*end)[PW_STEADY_REASON]; /* branches: why it ended; "" at the end of the range */
  int branches;
  double nearest[2];     /* smallest residual without solution: from the initial state, from random ones */
  int changing, stopped; /* motions of equations that change; 1: by Ctrl-C or --limit */
} pw_steady_cli;

void pw_steady_print (const pw_steady_cli *x);
/* Writes everything as JSON, as a table, and with --vary as a figure, into the folder.  A status. */
int pw_steady_write (const pw_steady_cli *x, pw_error *error);

#endif
