/* What `pinwheel check` finds out about a model. */
#ifndef PW_CHECK_H
#define PW_CHECK_H

#include "cli.h"
#include "pinwheel-selftest.h"

enum {
  CHECK_MOST = 400 /* coordinates: above it nothing is computed that takes time as their cube */,
  CHECK_DIGITS = 5
};

/* The self-test of a kind in use. */
typedef struct {
  const pw_kind *kind;
  int count;                        /* elements */
  pw_selftest_report alone, inside; /* in scenes of its own; in this one */
  char untested[500];               /* why there is no test alone; "": there is one */
} pw_checked_kind;

/* The first of some messages, and how many there are. */
typedef struct {
  int count;
  char text[8][700];
} pw_check_list;
static inline int pw_check_listed (const pw_check_list *l) {
  int most = (int)(sizeof l->text / sizeof *l->text);
  return l->count < most ? l->count : most;
}

/* Problems make the model fail; findings do not: it can be run, but may not be what was meant. */
typedef struct {
  pw_cli_line line;
  const char *json; /* path, or NULL */
  pw_cli_model m;
  pw_run *r;              /* NULL: it cannot start, for the reason in `start` */
  pw_error start;         /* why */
  pw_linear linear;       /* zero without a run */
  const char **redundant; /* what is said about each redundant row, ended by NULL; or NULL */
  pw_checked_kind *kind;  /* of the scene */
  int kinds;
  int known;          /* states whose motion the model knows, compared with the start */
  double step, limit; /* the model's step, and the largest that RK4 can take [s]; 0 and INFINITY: none */
  int explicit_rk4;   /* 1: the model wants to be run by rk4 */
  int fastest;        /* the eigenvalue of largest modulus, displacements of the whole left out; -1: all are 0 */
  pw_check_list problem, finding;
} pw_check;

/* In what time the fastest growing disturbance of a steady motion doubles [s]; INFINITY: none grows, or that is not known. */
double pw_check_doubling (const pw_check *x);
/* A state the consistent start has moved: its name, and from where to where. */
void pw_check_state (const pw_check *x, int i, char *name, size_t size, double *from, double *to);

void pw_check_text (const pw_check *x);                               /* check_text.c */
int pw_check_json (const pw_check *x, pw_output *o, pw_error *error); /* completes the output (check_json.c) */

#endif
