/* Unknowns: parameters and initial values that analyses and searches vary, and runs with given values of them.  An
 * array x has a value for each unknown.  Also states in options and reports of analyses. */
#ifndef PW_UNKNOWNS_H_
#define PW_UNKNOWNS_H_
#include <math.h>
#include "cli.h"
#include "outcome.h"
#include "pinwheel-analysis.h"

typedef struct {
  char name[300];                /* "length", "body.vx" */
  const pw_parameter *parameter; /* NULL: the initial value of a state */
  int state;                     /* its number; -1 for a parameter */
  double value;                  /* in the model of the command line */
  char unit[16];
  double size;      /* a typical size: set by sensitivity_measure; else 0 */
  double low, high; /* bounds, of --free or else of the parameter's domain; infinite without one */
  /* for searches: */
  double scale;    /* size of typical changes: high - low of --free, else |value|, else 1 */
  int has_bounds;  /* 1: the bounds are those of --free, which are finite */
  int logarithmic; /* 1: searches begin at equal ratios between them */
} pw_unknown;

/* Unknowns of the model of a command line, and the options of its runs. */
typedef struct {
  const pw_cli_line *line;
  pw_unknown *list;
  int count;
  const char *method;
  pw_settings settings; /* without those that differ between runs (pw_unknown_run) */
  double limit;         /* of the processor time of each run [s] */
  pw_cli_engine engine;
} pw_unknowns;

/* Reads the options of runs; there are no unknowns yet.  Line and model must outlive it.  Close it in every case. */
int pw_unknowns_open (pw_unknowns *u, const pw_cli_line *line, pw_error *error);
void pw_unknowns_close (pw_unknowns *u);
/* Reads unknowns from a list, ended by NULL, of "NAME" or, of --free, "NAME=LOW:HIGH[:log]".  PW_INPUT for a name that
 * the model does not have or that is given twice, a parameter that is a count, and bounds outside its domain or without
 * its value between them. */
int pw_unknowns_read (pw_unknowns *u, const char *option, const char **list, pw_error *error);
/* Chooses the engine for searches from `starts` points, of about `runs` runs each.  PW_INPUT for too many starts, or
 * too many unknowns for more than one. */
enum { PW_UNKNOWNS_STARTS = 100000 };
int pw_unknowns_engine (pw_unknowns *u, double runs, int starts, pw_error *error);

/* A run with given values of the unknowns. */
typedef struct {
  pw_cli_model m;
  pw_settings settings;
  pw_limit limit; /* settings.stop_context */
  pw_run *run;
} pw_unknown_run;
/* Opens a run with the engine and a limit of its own.  *to must not move, since settings points to its limit.  Close it
 * in every case. */
int pw_unknown_run_open (pw_unknown_run *to, const pw_unknowns *u, const double *x, pw_error *error);
void pw_unknown_run_close (pw_unknown_run *run);

/* Differentiates outputs at values x of the unknowns, within their bounds; d: all but x, parameters, size, low, high.
 * out, errors: as pw_differentiate. */
int pw_unknowns_differentiate (const pw_unknowns *u, const double *x, pw_difference_settings d, pw_derivative *out,
                               pw_error *error);

/* Outputs of the runs of unknowns. */
typedef struct {
  const pw_unknowns *unknowns;
  const char *option; /* "--of", in messages */
  const char **of;    /* count: texts */
  int count;
  const char *method; /* NULL: that of the unknowns, with their settings */
  double rtol;        /* with a method */
  long max_steps;     /* likewise; 0: that of the settings */
  const double *t;    /* rows: times of a table, see pw_outcome_table; NULL: none */
  int rows;
} pw_run_outputs;

/* Runs the model with these values of the unknowns; stores the outputs, unless `value` is NULL, and the table, count x
 * rows.  Called by several threads at once.  A status; PW_RETRY after Ctrl-C. */
int pw_run_outputs_at (const pw_run_outputs *outputs, const double *x, double *value, double *table, pw_error *error);

/* Relative noise of outputs as functions of the unknowns: the tolerance of an adaptive method, or round-off with fixed
 * steps. */
double pw_unknowns_noise (const pw_unknowns *u);

/* Points where searches begin, `count` x unknowns: the unknowns' values; then points of Sobol's sequence, shifted
 * modulo 1 by random numbers from the seed, between the bounds of --free, else within `scale` of the values.  If count
 * exceeds 1, there may be at most PW_UNKNOWNS_SOBOL_MOST unknowns, the limit of GSL's sequence.  NULL if out of memory;
 * free it. */
enum { PW_UNKNOWNS_SOBOL_MOST = 40 };
double *pw_unknowns_starts (const pw_unknowns *u, int count, double seed);

/* Prints a notice if, with these values, initial values that the user has given or that are unknowns must change to
 * satisfy the constraints. */
void pw_unknowns_report (const pw_unknowns *u, const double *x);

/* Writes the options that set the values, "--set a=1 --start frame.vx=2", to a text and returns it; NULL if they do not
 * fit. */
enum { PW_UNKNOWNS_OPTIONS = 4000 };
const char *pw_unknowns_options (const pw_unknowns *u, const double *x, char text[PW_UNKNOWNS_OPTIONS]);

/* The option --vary NAME=LOW:HIGH of `steady` and `periodic`: a number that varies continuously. */

typedef struct {
  const char *name, *unit;       /* "" without --vary; pw_vary_read sets the unit of a parameter alone */
  const pw_parameter *parameter; /* of the model; NULL: there is none of this name */
  double first, last;
  /* private */
  pw_unknown unknown;
  pw_unknowns unknowns; /* this one, for unknowns_system */
} pw_vary;

/* Reads the option into *v, which is zero-initialised and must not move later: it points to itself.  PW_INPUT if it is
 * malformed, or the parameter cannot vary in the range or is also given by --set. */
int pw_vary_read (pw_vary *v, const pw_cli_line *line, const char *text, pw_error *error);
/* Shows the progress of a branch at a value between `from` and `to`; starts a progress that is zero-initialised. */
void pw_vary_progress (const pw_vary *v, pw_progress *p, double from, double value, double to);
/* The system at a value of the parameter: `compile` of pw_steady_settings and pw_periodic_settings, whose context is
 * the pw_vary. */
pw_system *pw_vary_compile (void *vary, double value, pw_error *error);

/* ---- States in options and reports of `linearise`, `steady` and `periodic` ---- */

enum { PW_HOLDS = 40 }; /* quantities held at given values (pw_system_find_held), at most */

enum { PW_STEADY_NOT_RANDOM = 2 }; /* attempts of pw_steady_solve, 0 and 1, that do not begin at a random state */

#define PW_HOLD_OPTION(type, member)                      \
  PW_LIST_OPTION (type, member, "hold", 0, "STATE=VALUE", \
                  "Seek motions with this value of a state, or of BODY.speed, .radius or .curvature; repeatable")

/* Adds the quantity of this name to the list of those held, which has room for PW_HOLDS; `option` and `text` begin
 * messages.  PW_INPUT if there is none, with the nearest name, it is held already, or the list is full. */
int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error);
/* Adds the quantity of each --hold "STATE=VALUE"; `texts` ends with NULL, or is NULL. */
int pw_hold_read (const pw_system *s, const char **texts, pw_initial_value *hold, int *holds, pw_error *error);

/* The value, or 0 if its modulus is below `least`. */
static inline double pw_rounded (double value, double least) {
  return fabs (value) < least ? 0 : value;
}
/* Prints the states of the bodies by pw_print_bodies, and the first-order states. */
void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double least);
/* Writes an object with the names and values of all states. */
void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j);

/* Add cells of a table: the names of the states; their values q, v; the names of `most` complex numbers, re1, im1,
 * re2, ...; and these numbers, nan beyond `count`. */
void pw_states_header (const pw_system *s, pw_cells *t);
void pw_states_cells (const pw_system *s, const double *state, pw_cells *t);
void pw_complex_header (pw_cells *t, int most, const char *unit);
void pw_complex_cells (pw_cells *t, const double *re, const double *im, int count, int most);

/* " up to 3 symmetries", or "" if there are none; returns the text. */
const char *pw_states_symmetries (int count, char text[40]);

#endif
