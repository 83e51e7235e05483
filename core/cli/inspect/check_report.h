/* The results of `pinwheel check`, and their report. */
#ifndef PW_CHECK_REPORT_H
#define PW_CHECK_REPORT_H

#include "cli.h"
#include "pinwheel-analysis.h"
#include "pinwheel-selftest.h"

enum {
  CHECK_COORDINATES = 400, /* above this number computations of cubic cost are omitted */
  CHECK_DIGITS = 5
};

/* The self-test of an element type in use. */
typedef struct {
  const pw_kind *kind;
  int count;                           /* elements */
  pw_selftest_report random, in_model; /* of elements in random scenes; of those in this model */
  char untested[500];                  /* why there is no test in random scenes, or "" */
} pw_checked_kind;

/* Messages; `room`: number of those for which there is memory. */
typedef struct {
  int count, out_of_memory; /* out_of_memory 1: one could not be added */
  size_t room;
  char (*text)[700];
} pw_check_list;

/* Problems make the check fail; findings do not: the model can be run, but may not be what was intended. */
typedef struct {
  pw_cli_line line;
  const char *json_path; /* NULL: not given */
  pw_cli_model model;
  pw_run *run; /* NULL: initialisation failed with `run_error` */
  pw_error run_error;
  pw_linear linear;       /* at the initial state; A is NULL if it was not computed */
  const char **redundant; /* a description of each redundant constraint equation, ended by NULL; or NULL */
  pw_checked_kind *kind;  /* kinds: the element types in use */
  int kinds;
  int reference_states; /* states of the model's reference solution, compared with the initial state */
  double step;          /* the model's step size [s] */
  int uses_rk4;         /* 1: the model's method is rk4 */
  double rk4_limit;     /* the largest stable step of RK4 [s]; INFINITY: all are stable */
  int fastest;          /* the eigenvalue of largest modulus except rigid displacements; -1: none, or all 0 */
  double doubling_time; /* of the fastest growing perturbation [s]; INFINITY: none grows, or the motion is not steady */
  pw_check_list problem, finding;
} pw_check;

/* Writes the report: as JSON to j, or as text to standard output if j is NULL. */
void pw_check_report (const pw_check *check, pw_json *j);

#endif
