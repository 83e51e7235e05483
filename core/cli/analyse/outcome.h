/* The OUTPUT of analyses, here called an outcome to distinguish it from files that are written: a number that a run
 * yields.
 *
 *   OUTPUT   an expression of [final:|max:|min:|mean:|integral:|rms:]COLUMN, such as "frame.x / rider.work"
 *   COLUMN   a column of the table of `run`, or the total work or loss
 *
 * A column's final value, greatest value or mean over the run is a functional of it.  Its accuracy is that of the
 * run: extrema and integrals are evaluated inside the steps. */
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
  PW_COLUMN_KINETIC, /* energies; those after PW_COLUMN_POTENTIAL need pw_settings.ledger */
  PW_COLUMN_POTENTIAL,
  PW_COLUMN_LEDGER,
  PW_COLUMN_PROJECTION,
  PW_COLUMN_BALANCE,
  PW_COLUMN_WORK, /* totals; not in the table */
  PW_COLUMN_LOSS,
  PW_COLUMN_TYPES
} pw_column_type;

typedef struct {
  pw_column_type type;
  int index; /* state, contact (2 i for x), constraint equation, entry of the ledger */
} pw_column;

/* The column of this name; `origin` begins the message ("--of max:B.Fx").  PW_INPUT with the nearest name. */
int pw_column_find (const pw_system *s, const char *name, const char *origin, pw_column *c, pw_error *error);
const char *pw_column_unit (const pw_system *s, pw_column c);
/* Its value in a sample, or its derivative if the sample contains derivatives: columns are linear in the sample, except
 * contact points, for which it is NaN. */
double pw_column_value (const pw_system *s, pw_column c, const pw_sample *sample);

typedef enum { PW_FINAL, PW_MAX, PW_MIN, PW_MEAN, PW_INTEGRAL, PW_RMS } pw_functional_type;

enum { PW_FUNCTIONAL_TIMES = 9 }; /* at which a step of the run is sampled, at most */
/* Times beside the ends of a step, where columns may jump, have this distance from them, as a fraction of the step. */
#define PW_FUNCTIONAL_INSET 1e-6

static inline int pw_is_integral (pw_functional_type type) {
  return type == PW_MEAN || type == PW_INTEGRAL || type == PW_RMS;
}
static inline int pw_is_extremum (pw_functional_type type) {
  return type == PW_MAX || type == PW_MIN;
}

/* Gauss' formula of order 10 on [-1, 1]. */
enum { PW_GAUSS_NODES = 5 };
extern const double pw_gauss_x[PW_GAUSS_NODES], pw_gauss_w[PW_GAUSS_NODES];

/* A functional of a column. */
typedef struct {
  pw_functional_type type;
  pw_column column;
  double value;                       /* so far; after pw_outcomes_run that of the run */
  double t;                           /* time of the extremum, or of the end [s] */
  double step;                        /* size of the step of the run that contains the extremum [s] */
  double values[PW_FUNCTIONAL_TIMES]; /* private: the column at times of the last step; [0] at its beginning */
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
  int ledger; /* 1: runs need pw_settings.ledger */
  /* private */
  double t0, t;            /* the beginning of the run, the time reached [s] */
  pw_workspace *workspace; /* for contact points */
  double (*contact)[3];
} pw_outcomes;

/* Reads the texts of outputs of the option "--of".  System and texts must outlive the outputs.  Close them in every
 * case.  PW_INPUT for an unknown column, with the nearest name, or an invalid expression; PW_RESOURCE. */
int pw_outcomes_open (pw_outcomes *set, const pw_system *s, const char *option, const char *const *text, int count,
                      pw_error *error);
void pw_outcomes_close (pw_outcomes *set);

/* The columns of all functionals in a sample. */
int pw_outcomes_read (pw_outcomes *set, const pw_sample *s, double *value, pw_error *error);
/* Evaluates the functionals along a run to t_end; settings.stop_context is a pw_limit.  Returns a status, as of
 * pw_limit_status if it stops the run. */
int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end, pw_error *error);

/* The value of an output.  gradient, unless NULL, receives its derivatives with respect to all functionals. */
double pw_outcome_value (const pw_outcomes *set, int outcome, double *gradient);
/* Its unit, in the buffer; "" of expressions. */
const char *pw_outcome_unit (const pw_outcomes *set, int outcome, char *buffer, size_t size);

#endif
