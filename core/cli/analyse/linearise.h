/* The result of `pinwheel linearise`, and its reports. */
#ifndef PW_LINEARISE_H
#define PW_LINEARISE_H

#include "cli.h"
#include "pinwheel-analysis.h"

typedef struct {
  pw_cli_line line;
  const char *at, *name;   /* NAME of the files, or NULL */
  const char *animate;     /* name of the page of modes, or NULL */
  const char **hold_texts; /* of --steady */
  int steady;
  const char **input_names, **output_names; /* as given, ended by NULL; or NULL: all */
  pw_cli_model m;
  pw_files files;
  pw_run *r;
  double t;
  pw_initial_value *initial; /* 2 coordinates: the steady motion; NULL: the model's initial state */
  pw_limit limit;
  pw_linear linear;
  int *input, *output; /* signals, states */
  int inputs, outputs;
} pw_linearise;

/* Writes an HTML page in which modes are animated.  A status. */
int pw_linearise_page (const pw_linearise *x, FILE *f, pw_error *error);
/* Prints eigenvalues and mode shapes. */
void pw_linearise_print (const pw_linearise *x);
/* Writes everything as JSON; [ A B ; C D ] as a table.  A status. */
void pw_linearise_json (const pw_linearise *x, pw_json *j);
int pw_linearise_csv (const pw_linearise *x, FILE *f, pw_error *error);
/* Writes A, B, C, D and the eigenvalues as a NumPy archive.  A status. */
int pw_linearise_npz (const pw_linearise *x, FILE *f, pw_error *error);

#endif
