/* The OUTPUT of analyses, here called an outcome to distinguish it from files that are written: a number that a run
 * yields.
 *
 *   OUTPUT   an expression of [final:|max:|min:|mean:|integral:|rms:]COLUMN, such as "frame.x / rider.work"
 *   COLUMN   a column of the table of `run`, or the total work or loss
 *
 * Final values, extrema, means and integrals of columns are functionals of the run.  They are as accurate as the run:
 * extrema and integrals are evaluated inside its steps. */
#ifndef PW_OUTCOME_H
#define PW_OUTCOME_H

#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Columns of the table of `run`. */
typedef enum {
  PW_COLUMN_TIME,
  PW_COLUMN_STATE,
  PW_COLUMN_CONTACT,
  PW_COLUMN_REACTION,
  PW_COLUMN_POSITION, /* scaled residuals of g = 0 and of J v = eta */
  PW_COLUMN_VELOCITY,
  PW_COLUMN_KINETIC, /* energies; columns after PW_COLUMN_POTENTIAL need pw_settings.ledger */
  PW_COLUMN_POTENTIAL,
  PW_COLUMN_LEDGER,
  PW_COLUMN_PROJECTION,
  PW_COLUMN_BALANCE,
  PW_COLUMN_WORK, /* pw_sample.work and loss, which the table does not have */
  PW_COLUMN_LOSS,
  PW_COLUMN_TYPES
} pw_column_type;

typedef struct {
  pw_column_type type;
  int index; /* of the state, constraint equation or entry of the ledger; contact i: 2 i for x, 2 i + 1 for y; else 0 */
} pw_column;

/* The column of this name; `origin` begins messages ("--of max:B.Fx").  PW_INPUT, with the nearest name, if there is
 * none. */
int pw_column_find (const pw_system *s, const char *name, const char *origin, pw_column *c, pw_error *error);
const char *pw_column_unit (const pw_system *s, pw_column c);
/* Its value in a sample, or its derivative if the sample contains derivatives, as columns are linear in the sample; NaN
 * for contact points, which are not, and for entries of the ledger without pw_settings.ledger. */
double pw_column_value (const pw_system *s, pw_column c, const pw_sample *sample);

typedef enum { PW_FINAL, PW_MAX, PW_MIN, PW_MEAN, PW_INTEGRAL, PW_RMS } pw_functional_type;

enum { PW_FUNCTIONAL_TIMES = 9 }; /* at which a step of the run is sampled before refinements (functional.c) */
/* Columns may jump at the ends of a step: it is sampled also at this distance from them, relative to its size. */
#define PW_FUNCTIONAL_INSET 1e-6

static inline int pw_is_integral (pw_functional_type type) {
  return type == PW_MEAN || type == PW_INTEGRAL || type == PW_RMS;
}
static inline int pw_is_extremum (pw_functional_type type) {
  return type == PW_MAX || type == PW_MIN;
}

/* Nodes and weights of Gauss' formula of order 10 on [-1, 1]. */
enum { PW_GAUSS_NODES = 5 };
extern const double pw_gauss_x[PW_GAUSS_NODES], pw_gauss_w[PW_GAUSS_NODES];
/* The time of a node in [t0, t1]. */
static inline double pw_gauss_time (double t0, double t1, int node) {
  return (t0 + t1) / 2 + pw_gauss_x[node] * (t1 - t0) / 2;
}

/* A functional of a column. */
typedef struct {
  pw_functional_type type;
  pw_column column;
  double value;                           /* set by pw_outcomes_run; final ones also by pw_sensitivity_compute */
  double t;                               /* time of the extremum so far [s] */
  double step;                            /* size of the step of the run that contains the extremum [s] */
  double values[PW_FUNCTIONAL_TIMES + 1]; /* of the column: set by pw_outcomes_read */
} pw_functional;

/* One output. */
typedef struct {
  const char *text;                  /* as the user writes it */
  pw_formula *formula;               /* a function of `terms` functionals; NULL: it is the functional term[0] itself */
  int term[PW_FORMULA_NAMES], terms; /* indices of functionals */
} pw_outcome;

/* The outputs of an analysis, with the functionals that they are functions of. */
typedef struct {
  const pw_system *system;
  pw_outcome *outcome;
  int outcomes;
  pw_functional *functional; /* each once */
  int functionals;
  int ledger;    /* 1: runs need pw_settings.ledger */
  int along_run; /* 1: there are extrema or integrals, for which every step of the run is sampled */
  /* private */
  pw_workspace *workspace; /* for contact points */
  double (*contact)[3];
} pw_outcomes;

/* Reads `count` texts of outputs; `option` ("--of") begins messages.  System and texts must outlive the set.  Close it
 * in every case.  PW_INPUT for an unknown column, with the nearest name, or an invalid expression; PW_RESOURCE. */
int pw_outcomes_open (pw_outcomes *set, const pw_system *s, const char *option, const char *const *text, int count,
                      pw_error *error);
void pw_outcomes_close (pw_outcomes *set);

/* Stores the columns in a sample as values[at] of their functionals.  pw_outcomes_run overwrites these: by the columns
 * at times of the current step, [0] at its beginning, and at another one, [PW_FUNCTIONAL_TIMES]. */
int pw_outcomes_read (pw_outcomes *set, const pw_sample *s, int at, pw_error *error);
/* Evaluates the functionals along a run to t_end; settings.stop_context is a pw_limit.  A status: that of
 * pw_limit_status if the run is stopped. */
int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end, pw_error *error);

/* The value of output number `outcome`.  gradient, unless NULL, receives its derivatives with respect to all
 * functionals of the set. */
double pw_outcome_value (const pw_outcomes *set, int outcome, double *gradient);
/* Its unit, in the buffer, which is returned; "" for expressions, whose units are not derived. */
const char *pw_outcome_unit (const pw_outcomes *set, int outcome, char *buffer, size_t size);

#endif
