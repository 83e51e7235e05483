/* An optimisation for `pinwheel optimise`: the problem, its searches and their results.  Comments on arrays begin with
 * their sizes. */
#ifndef PW_OPTIMISE_H
#define PW_OPTIMISE_H

#include <pthread.h>
#include "sensitivity.h"

/* A local search and its runs. */
typedef struct {
  double *from, *to;    /* unknowns: where it begins; its result, the best run that satisfies the constraints */
  double *output;       /* outputs: of that run */
  int feasible;         /* 1: there is such a run */
  int converged;        /* 1: NLopt ended the search by its tolerances or at round-off */
  long runs, failed;    /* number of runs; of those that failed */
  long derivatives;     /* number of points at which derivatives were computed */
  double *trials;       /* runs x (unknowns + outputs): all runs; outputs of failed ones are NaN */
  size_t allocated;     /* rows of `trials` */
  pw_error first_error; /* of the first failed run */
} pw_search;

typedef struct {
  pw_cli_line line;
  const char *maximise, *minimise, *path, *json_path, *plots_path, *starts_text, *seed_text, *jobs_text;
  const char **free, **subject_to;
  pw_cli_model model;
  pw_files files;
  pw_unknowns unknowns;
  pw_arena arena;      /* of the arrays below and those of the searches, except their `trials` */
  const char **output; /* outputs, as text: the objective, then the left sides of the constraints */
  char (*unit)[80];    /* outputs */
  double *sign;        /* outputs: 1 or -1; of the objective: sign x objective is minimised */
  double *bound;       /* outputs: of a constraint: sign x (output - bound) <= 0 */
  int outputs, starts, jobs;
  int refinements;    /* searches that continue from the best results of the starts, with smaller last steps */
  int differentiable; /* 1: outputs have derivatives, except where a motion has none */
  double seed;
  pw_search *search;              /* starts, then refinements */
  const pw_search *best;          /* that with the best result; NULL: none has one */
  unsigned char *without_effect;  /* unknowns: 1: changes of it alone do not change the outputs of the optimum */
  unsigned char *objective_same;  /* unknowns: 1: they do not change the objective of the optimum */
  const char *incomplete;         /* why the best result may not be an optimum; NULL: it is one */
  long runs, failed, derivatives; /* of all searches */
  const pw_error *first_error;    /* of the first failed run; NULL: there is none */
  pthread_mutex_t lock;           /* of the members below */
  pw_progress progress;
  int searches_done;
  double least; /* sign x best objective so far */
} pw_optimise;

/* ---- Searches (local_search.c) ---- */

#define PW_SEARCH_FINE 1e-7 /* last steps of refinements, relative to the scales of the unknowns */

/* 1 if the outputs of a run satisfy the constraints, up to a pw_search_violation of 1e-6. */
int pw_search_feasible (const pw_optimise *problem, const double *output);
/* The largest violation of a constraint by the outputs of a run, relative to its bound if that is not 0; <= 0: there is
 * none.  *constraint: the index in `output` of the constraint with that violation, from 1; not set without
 * constraints. */
double pw_search_violation (const pw_optimise *problem, const double *output, int *constraint);

/* Tasks of pw_parallel: the search from start i; refinement i.  The context is the pw_optimise. */
int pw_search_rough (void *context, int i, pw_error *error);
int pw_search_fine (void *context, int i, pw_error *error);
/* Sets without_effect[i] and objective_same[i], by two runs; their failure is an effect. */
int pw_search_effect (void *context, int i, pw_error *error);

/* ---- Results (optimise_report.c) ---- */

/* 1 if two searches have results, and these are the same optimum: they differ little in all unknowns but those without
 * effect. */
int pw_optimise_same (const pw_optimise *problem, const pw_search *a, const pw_search *b);

/* Print the result; write it as JSON, with this status ("ok", ...), and as YAML; draw figures of the runs into the
 * folder plots_path.  problem->best is not NULL. */
void pw_optimise_print (const pw_optimise *problem);
void pw_optimise_json (const pw_optimise *problem, const char *status, FILE *f);
void pw_optimise_yaml (const pw_optimise *problem, FILE *f);
int pw_optimise_draw (const pw_optimise *problem, pw_error *error);

#endif
