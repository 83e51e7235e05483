/* An optimisation and its results. */
#ifndef PW_OPTIMISE_H
#define PW_OPTIMISE_H

#include <pthread.h>
#include "outcome.h"
#include "progress.h"
#include "sensitivity.h"
#include "util.h"

/* The search from one start.  Runs are its rows of `trial`. */
typedef struct {
  double *first, *best; /* unknowns */
  double *value;        /* outputs at the best */
  int found;            /* 1: the best satisfies the constraints */
  int converged;        /* 0: the search ended at its limit of runs */
  long runs, failed;
  long derivatives; /* points at which derivatives were computed */
  double *trial;    /* runs x (unknowns, outputs); outputs of failed runs are NaN */
  size_t room;      /* rows allocated of `trial` */
  pw_error error;   /* of the first failed run */
} pw_search_start;

typedef struct {
  pw_cli_line line;
  const char *maximise, *minimise, *path, *json_path, *plots_path, *starts_text, *seed_text, *jobs_text;
  const char **free, **subject;
  pw_cli_model m;
  pw_files files;
  pw_unknowns unknowns;
  const char *objective;
  pw_arena arena;    /* of what follows, without trials */
  const char **text; /* outputs: the objective, then constraints */
  char (*unit)[80];  /* outputs */
  double *bound;     /* outputs: of the constraint */
  double *sign;      /* outputs: sign x (value - bound) <= 0; of the objective: sign x value is minimised */
  int outputs, starts, jobs;
  int polished; /* results from which searches continue with a tight tolerance */
  int smooth;   /* 1: outputs have derivatives, except where a motion has none */
  double seed;
  pw_search_start *start;         /* starts, then polished */
  int best;                       /* index of the search with the best result; -1: none */
  long runs, failed, derivatives; /* of all searches */
  const pw_error *why;            /* of the first failed run; NULL: there is none */
  pthread_mutex_t lock;           /* of what follows */
  pw_progress progress;
  int done;
  double leading; /* sign x best objective so far */
  pw_error error; /* that ends everything */
} pw_optimise;

/* ---- Searches (local_search.c) ---- */

#define PW_SEARCH_FINE 1e-7 /* last steps of the results that continue, relative to the scales of the unknowns */

/* 1 if outputs satisfy the constraints, with an allowance for the last digits of a solution on the boundary. */
int pw_search_feasible (const pw_optimise *x, const double *value);

/* Tasks of pw_parallel: the search from start i with a rough tolerance; from the i-th of those that continue with a tight
 * one.  The context is the optimisation. */
int pw_search_rough (void *optimise, int i, pw_error *error);
int pw_search_fine (void *optimise, int i, pw_error *error);

/* ---- Results ---- */

/* 1 if the results of two starts are the same optimum. */
int pw_optimise_same (const pw_optimise *x, const pw_search_start *a, const pw_search_start *b);

/* Prints the result; writes it as JSON and YAML; draws figures of the runs into the folder. */
void pw_optimise_print (const pw_optimise *x);
void pw_optimise_json (const pw_optimise *x, const char *status, FILE *f);
void pw_optimise_yaml (const pw_optimise *x, FILE *f);
int pw_optimise_draw (const pw_optimise *x, pw_error *error);

#endif
