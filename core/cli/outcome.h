/* The OUTPUT of analyses, here called an outcome to distinguish it from files that are written: a number that a run
 * yields.
 *
 *   OUTPUT   an expression of [final:|max:|min:|mean:|integral:|rms:|at T:]COLUMN, such as "frame.x / rider.work",
 *            and of numbers and times of events: events, events:NAME, event:NAME, event N:NAME
 *   COLUMN   a column of the table of `run`, or the total work or loss
 *   NAME     an element whose reactions have limits, or one of these reactions
 *
 * Values at the end or at a time, extrema, means and integrals of columns are functionals of the run.  They are as
 * accurate as the run: integrals are entries of its ledger (pw_settings.integrals), and extrema are located by its
 * dense output. */
#ifndef PW_OUTCOME_H
#define PW_OUTCOME_H

#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* An OUTPUT in the help of an option. */
#define PW_OUTPUT_HELP                                                                                      \
  "a column of the table of `run` at the end; its max:, min:, mean:, integral:, rms: or at TIME:, such as " \
  "max:B.Fx; events:ELEMENT, their number, or event:ELEMENT, the time of the first one; or an expression of these"

/* 1 for work and losses: their rates are known, and they are integrals themselves. */
static inline int pw_column_is_integrated (pw_column_type type) {
  return type == PW_COLUMN_LEDGER || type == PW_COLUMN_WORK || type == PW_COLUMN_LOSS;
}

typedef enum {
  PW_FINAL,
  PW_MAX,
  PW_MIN,
  PW_MEAN,
  PW_INTEGRAL,
  PW_RMS,
  PW_EVENTS, /* their number */
  PW_EVENT,  /* the time of one of them */
  PW_AT_TIME
} pw_functional_type;

enum { PW_FUNCTIONAL_TIMES = 9 }; /* at which a step of the run is sampled before refinements (outcome.c) */

/* 1 if it is the integral of a column over the run, or a function of that: mean, root mean square. */
static inline int pw_is_integral (pw_functional_type type) {
  return type == PW_MEAN || type == PW_INTEGRAL || type == PW_RMS;
}
static inline int pw_is_extremum (pw_functional_type type) {
  return type == PW_MAX || type == PW_MIN;
}

/* A functional of a column, or of the events of some constraint equations. */
typedef struct {
  pw_functional_type type;
  pw_column column;                       /* of events: the time */
  int row, rows;                          /* of events: the first equation, their number; rows 0: all events */
  long number;                            /* of PW_EVENT, from 1 */
  double value;                           /* set by pw_outcomes_run */
  double t;                               /* time of the extremum so far, or that of PW_AT_TIME [s] */
  double values[PW_FUNCTIONAL_TIMES + 1]; /* of the column: set by functional_read */
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
  double *value; /* outcomes: for the caller's use */
  int outcomes;
  pw_functional *functional; /* each once */
  int functionals;
  int ledger;    /* 1: runs need pw_settings.ledger */
  int extrema;   /* their number; every step of the run is sampled for them */
  int integrals; /* number of integrals, means and root mean squares */
  double t;      /* time reached [s], that at which the condition has become true once `ended` is 1 */
  int ended;     /* 1: the condition has become true */
  /* private */
  const char *until; /* text of the condition; NULL: there is none */
  pw_condition *condition;
  pw_crossing crossing;
  double begin, span;      /* initial time of the run, and how long it may be [s] */
  pw_workspace *workspace; /* for contact points */
} pw_outcomes;

/* Reads `count` texts of outputs; `option` ("--of") begins messages.  until: a condition that ends the run, or NULL.
 * System and texts must outlive the set.  Close it in every case.  PW_INPUT for an unknown column, with the nearest
 * name, or an invalid expression; PW_RESOURCE. */
int pw_outcomes_open (pw_outcomes *set, const pw_system *s, const char *option, const char *const *text, int count,
                      const char *until, pw_error *error);
void pw_outcomes_close (pw_outcomes *set);

/* Names the integrands that may jump within steps, since their conditions are not located. */
void pw_outcomes_report (const pw_outcomes *set);

/* Values of outputs along a run, all of whose terms are final values. */
typedef struct {
  const double *t; /* rows: increasing times from that of the initial state to the end of the run [s] */
  int rows;
  double *value; /* outcomes x rows; NaN for outputs with other terms */
} pw_outcome_table;

/* 1 if all terms of an output are final values. */
int pw_outcome_is_final (const pw_outcomes *set, int outcome);

/* A run along which outputs are computed: settings that they need, before it is opened; its beginning; a step, or steps
 * up to time t <= t_end if no functional needs each; its end, where values are set.  Statuses. */
void pw_outcomes_settings (pw_outcomes *set, pw_settings *settings);
int pw_outcomes_begin (pw_outcomes *set, pw_run *r, double t_end, pw_error *error);
int pw_outcomes_advance (pw_outcomes *set, pw_run *r, double t, double t_end, pw_error *error);
int pw_outcomes_end (pw_outcomes *set, pw_run *r, pw_error *error);
/* Evaluates the functionals along a run to t_end, and a table unless that is NULL; settings.stop_context is a pw_limit.
 * A status: that of pw_limit_status if the run is stopped; PW_METHOD if the condition does not become true. */
int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end,
                     const pw_outcome_table *table, pw_error *error);

/* The value of output number `outcome`. */
double pw_outcome_value (const pw_outcomes *set, int outcome);
/* Its unit, in the buffer, which is returned; "" for expressions, whose units are not derived. */
const char *pw_outcome_unit (const pw_outcomes *set, int outcome, char *buffer, size_t size);

#endif
