/* What the parts of the hard cases share: cases as written, a cell of the matrix and how it came out, the matrix. */
#ifndef HARD_H
#define HARD_H

#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

enum { HARD_VALUES = 24, HARD_EXPECTATIONS = 24, HARD_CASES = 100, HARD_METHODS = 60 };

/* Worst first: of several bounds the worst verdict counts. */
typedef enum {
  HARD_CRASH,   /* ended by a signal */
  HARD_WRONG,   /* claims success outside every bound, or refuses without a reason: never allowed */
  HARD_SLOW,    /* stopped for taking too long */
  HARD_REFUSE,  /* stops with its reason */
  HARD_LIMITED, /* bounded and stable, accuracy stated */
  HARD_PASS,    /* within the bound */
  HARD_VERDICTS
} hard_verdict;

extern const char *const hard_verdict_name[HARD_VERDICTS];

/* What is measured of a run, and judged by a case's bounds. */
typedef enum {
  HARD_ERROR,     /* of the states at the end, relative to their truth or to the scene's unit, whichever is larger */
  HARD_BALANCE,   /* of the energy, at worst, relative to the largest energy, work or loss */
  HARD_RESIDUAL,  /* scaled, of g = 0 and J v = eta, at worst over the accepted steps */
  HARD_EQUATIONS, /* scaled, of J a = gamma and M a + J^T lambda = f, by the independent verifier, at the end */
  HARD_MEASURES
} hard_measure;

extern const char *const hard_measure_name[HARD_MEASURES];

typedef struct {
  char name[80];
  double value;
} hard_value;

/* A verdict for all methods whose name fits a pattern, in the order written: the last one that fits counts. */
typedef struct {
  char pattern[400]; /* or several, with blanks between them */
  int verdict;       /* bits: 1 << hard_verdict, more than one where the outcome is a matter of luck */
  char why[200];     /* in words, for what is no pass */
  char reason[80];   /* of a refusal: what its message must contain */
} hard_expectation;

/* A case: a model, a time span, a truth or invariant, and what is expected of each method. */
typedef struct {
  char group[80], name[48], about[200], source[200];
  char model[300];
  hard_value set[HARD_VALUES], start[HARD_VALUES], truth[HARD_VALUES];
  int sets, starts, truths;
  double t_end, step, rtol;       /* [s]; step of fixed-step methods [s]; rtol of adaptive ones */
  double seconds;                 /* processor time a cell may take [s] */
  char stops[80];                 /* "": it runs; else the truth is that it must stop, with this in the message */
  double stop_time[2];            /* by then: pass, limited [s] */
  double bound[HARD_MEASURES][2]; /* pass, limited; 0, 0: not judged */
  hard_expectation expect[HARD_EXPECTATIONS];
  int expectations;
} hard_case;

/* How one method came out of one case. */
typedef struct {
  hard_verdict verdict;
  int status;                    /* pw_status */
  double t;                      /* time reached [s] */
  double measure[HARD_MEASURES]; /* NaN: not taken */
  double cpu;                    /* [s] */
  char reason[500];              /* of a refusal */
} hard_result;

/* Reads all cases of one file, behind the `count` there are; the new count.  Ends the program on a mistake. */
int hard_read (const char *path, const char *models, hard_case *cases, int count);

/* Runs one cell in this process, without a verdict. */
void hard_run (const hard_case *c, const char *method, hard_result *r);

/* The verdict of a run that has come to an end by itself. */
hard_verdict hard_judge (const hard_case *c, const hard_result *r);

/* What the case expects of a method. */
const hard_expectation *hard_expected (const hard_case *c, const char *method);

/* 1 if the result is what is expected. */
int hard_as_expected (const hard_expectation *e, const hard_result *r);

/* The matrix: result[i * methods + k] is that of case i by method k; a verdict below 0 was not run. */
typedef struct {
  const hard_case *cases;
  int count, methods;
  const char (*method)[48];
  const hard_result *result;
} hard_matrix;

/* The matrix and the counts as text for a terminal. */
void hard_print (const hard_matrix *m, FILE *out);
/* The same as a page of the documentation, with the reason for each cell that does not pass. */
void hard_page (const hard_matrix *m, FILE *out);

#endif
