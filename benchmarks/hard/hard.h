/* Shared by the parts of the program hard: the cases, the result of one method in one case, the matrix of results. */
#ifndef HARD_H
#define HARD_H

#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Largest numbers of entries, and of characters of a name. */
enum { HARD_VALUES = 24, HARD_EXPECTATIONS = 24, HARD_CASES = 100, HARD_METHODS = 60, HARD_NAME = 48 };

/* Verdicts, the worst first; the worst one over all measures counts. */
typedef enum {
  HARD_CRASH,   /* the process ended abnormally */
  HARD_WRONG,   /* reports success outside all bounds, or stops without a reason: never allowed */
  HARD_SLOW,    /* stopped at the limit of processor time */
  HARD_REFUSE,  /* stops with a reason */
  HARD_LIMITED, /* within the second bound */
  HARD_PASS,    /* within the first bound */
  HARD_VERDICTS
} hard_verdict;

extern const char *const hard_verdict_name[HARD_VERDICTS];

/* Measures of a run, which are compared with the bounds of the case. */
typedef enum {
  HARD_ERROR,     /* largest error of a state at the end, relative to the reference, but at least to its scale */
  HARD_BALANCE,   /* largest energy defect, relative to the largest kinetic energy, work or loss */
  HARD_RESIDUAL,  /* largest scaled residual of g = 0 and J v = eta after an accepted step */
  HARD_EQUATIONS, /* scaled residual of J a = gamma and M a + J^T lambda = f at the end, by the independent verifier */
  HARD_MEASURES
} hard_measure;

extern const char *const hard_measure_name[HARD_MEASURES];

typedef struct {
  char name[80];
  double value;
} hard_value;

/* The verdict expected of all methods whose name matches a pattern; the last expectation that matches counts. */
typedef struct {
  char pattern[400]; /* or several, separated by blanks */
  int verdict;       /* bits 1 << hard_verdict; several where round-off decides */
  char why[200];     /* why it does not pass */
  char reason[80];   /* text that the message of a refusal must contain */
} hard_expectation;

/* A case: a model, a time span, a reference solution or invariant, and the verdict expected of each method. */
typedef struct {
  char group[80], group_about[200], name[HARD_NAME], about[200], source[200];
  char model[300];
  hard_value set[HARD_VALUES], initial[HARD_VALUES], reference[HARD_VALUES];
  int sets, initials, references;
  double t_end, step, rtol;       /* [s]; of fixed-step methods [s]; of adaptive methods */
  double seconds;                 /* limit of processor time per cell [s] */
  char stops[80];                 /* if not empty, the run must stop, with this text in its message */
  double stop_time[2];            /* latest time of the stop: pass, limited [s] */
  double bound[HARD_MEASURES][2]; /* pass, limited; 0, 0: not compared */
  hard_expectation expect[HARD_EXPECTATIONS];
  int expectations;
} hard_case;

/* The result of one method in one case. */
typedef struct {
  hard_verdict verdict;
  int status;                    /* pw_status */
  double t;                      /* time reached [s] */
  double measure[HARD_MEASURES]; /* NaN: not measured */
  double cpu;                    /* [s] */
  char reason[500];              /* message, if the status is not PW_OK */
} hard_result;

/* Appends the cases of a file to the `count` cases read before; models: folder of their own models.  Returns the new
 * count; ends the program on a mistake. */
int hard_read (const char *path, const char *models, hard_case *cases, int count);

/* Runs one cell in this process, without a verdict. */
void hard_run (const hard_case *c, const char *method, int specialised, hard_result *r);

/* The verdict of a run that ended by itself. */
hard_verdict hard_verdict_of (const hard_case *c, const hard_result *r);

/* The expectation of the case for a method. */
const hard_expectation *hard_expected (const hard_case *c, const char *method);

/* 1 if the result is as expected. */
int hard_as_expected (const hard_expectation *e, const hard_result *r);

/* The matrix: result[i * methods + k] belongs to case i and method k. */
typedef struct {
  const hard_case *cases;
  int count, methods;
  const char (*method)[HARD_NAME];
  const hard_result *result;
} hard_matrix;

/* The matrix and the counts as text for a terminal. */
void hard_print (const hard_matrix *m, FILE *out);
/* A page of the documentation: the cases, counts by method, and where there is no result. */
void hard_page (const hard_matrix *m, FILE *out);
/* One line of CSV per cell: what was run, measured and reported. */
void hard_table (const hard_matrix *m, FILE *out);

#endif
