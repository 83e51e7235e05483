/* The command `pinwheel steady`, its result and its reports (steady_report.c). */
#ifndef PW_STEADY_REPORT_H
#define PW_STEADY_REPORT_H

#include "states.h"
#include "vary.h"

/* A steady motion found, or a point of a branch. */
typedef struct {
  int branch;              /* number of its branch, from 1; without --vary the number of the motion */
  int attempt;             /* number of the attempt of pw_steady_solve that found it */
  pw_steady_motion motion; /* its arrays are in `state`; motion.linear is NULL */
  pw_linear linear;        /* twist, unknowns, and in `state` re, im, rigid; the other members are not set */
  double *state;           /* q, v, re, im, rigid */
  char advice[1000];       /* options that select it in its family, " --hold NAME=VALUE..."; "" if none or too long */
} pw_steady_point;

enum { PW_STEADY_REASON = 200 }; /* longest reason, its end included */

typedef struct {
  pw_cli_line line;
  const char **hold_texts, *vary_text, *starts_text, *at_text, *folder;
  pw_cli_model m;
  pw_files files;
  pw_limit limit;
  pw_steady_settings settings;
  pw_initial_value hold[PW_HOLDS]; /* settings.holds values */
  pw_vary vary;
  int random_attempts; /* in each search: those that begin at random states */
  pw_steady *search;
  pw_steady_point *point; /* points: the motions, or those of each branch in turn */
  int points;
  size_t room;                   /* points allocated */
  char (*end)[PW_STEADY_REASON]; /* branches: why each ended; "" at the end of the range, or if stopped */
  int branches;
  double residual[2]; /* the least of the attempts: from the initial state, from random ones */
  int changing;       /* solutions that are not steady, as the equations change with time or along the motion */
  int families;       /* solutions of which no branch begins, since they are members of families */
  int stopped;        /* 1: by Ctrl-C or --limit */
} pw_steady_command;

/* Prints the motions or the branches; there is at least one point. */
void pw_steady_print (const pw_steady_command *cmd);
/* Writes steady.json, steady.csv and, with --vary, the figure into the folder.  A status. */
int pw_steady_write (const pw_steady_command *cmd, pw_error *error);

#endif
