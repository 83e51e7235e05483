/* The command `pinwheel linearise`, its result and its reports (linearise_report.c). */
#ifndef PW_LINEARISE_H
#define PW_LINEARISE_H

#include "cli.h"
#include "pinwheel-analysis.h"

typedef struct {
  pw_cli_line line;
  const char *t_text;                       /* of --at */
  const char *name;                         /* of -o, for the files NAME.json, NAME.csv, NAME.npz; or NULL */
  const char *page_path;                    /* of --animate, or NULL */
  const char **hold_texts;                  /* of --hold */
  int steady;                               /* 1: --steady */
  const char **input_names, **output_names; /* ended by NULL; or NULL: all signals of forces, all states */
  pw_cli_model m;
  pw_files files;
  pw_run *r;
  double t;                  /* of the state that is linearised [s] */
  pw_initial_value *initial; /* 2 x coordinates: the steady motion; NULL: the model's initial state */
  pw_limit limit;
  pw_linear linear;
  int inputs, outputs, *input, *output; /* numbers of the signals u and the states y, and their indices */
} pw_linearise_command;

/* Prints eigenvalues and mode shapes. */
void pw_linearise_print (const pw_linearise_command *cmd);
/* Write the result as JSON, [ A B ; C D ] as a table, a page of modes, matrices and eigenvalues for NumPy; a status. */
void pw_linearise_json (const pw_linearise_command *cmd, pw_json *j);
int pw_linearise_csv (const pw_linearise_command *cmd, FILE *f, pw_error *error);
int pw_linearise_page (const pw_linearise_command *cmd, FILE *f, pw_error *error);
int pw_linearise_npz (const pw_linearise_command *cmd, FILE *f, pw_error *error);

#endif
