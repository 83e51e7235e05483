/* Input and output of a run: settings, samples, statistics, saved states (pinwheel-solvers.h: runs and methods). */
#ifndef PW_RUN_H
#define PW_RUN_H

#include "pinwheel.h"

PW_BEGIN

#define PW_STEP 1e-3          /* default step of fixed-step methods [s] */
#define PW_RTOL 1e-6          /* default relative tolerance of adaptive methods */
#define PW_MAX_STEPS 10000000 /* default limit of attempted steps of adaptive methods */

/* The initial value of a state, numbered as in pw_system_find_state. */
typedef struct {
  int state;
  double value;
} pw_initial_value;

/* The state at one time.  The arrays belong to the run and are valid until the next call. */
typedef struct {
  double t;
  const double *q, *v;  /* coordinates and velocities: pw_system_coordinates each */
  const double *a;      /* accelerations */
  const double *lambda; /* multipliers, M a + J^T lambda = f: pw_system_rows */
  double position;      /* scaled residual of g = 0 */
  double velocity;      /* scaled residual of J v = eta */
  double kinetic;       /* [J] */
  double potential;     /* [J] */
  const double *ledger; /* pw_system_ledger_entries: work or loss of each entry [J]; NULL without pw_settings.ledger */
  double work;          /* supplied since the initial time, by torques, forces, motors, drives, ... [J] */
  double loss;          /* dissipated since the initial time [J] */
  double projection;    /* energy added by projections after steps [J]; 0 without pw_settings.ledger, and with bdf */
  double balance;       /* change of (kinetic + potential) - work + loss - projection [J] */
  const double *integral; /* pw_settings.integrals: integrals of the functions since the initial time */
  const double *output;   /* outputs of the model, pw_system_outputs */
} pw_sample;

/* ---- Columns: the numbers of a sample by name ---- */

typedef enum {
  PW_COLUMN_TIME,
  PW_COLUMN_STATE,
  PW_COLUMN_CONTACT, /* places of wheels and markers */
  PW_COLUMN_REACTION,
  PW_COLUMN_POSITION, /* scaled residuals of g = 0 and of J v = eta */
  PW_COLUMN_VELOCITY,
  PW_COLUMN_KINETIC, /* energies; columns from PW_COLUMN_LEDGER to PW_COLUMN_BALANCE need pw_settings.ledger */
  PW_COLUMN_POTENTIAL,
  PW_COLUMN_LEDGER, /* works and losses of elements */
  PW_COLUMN_PROJECTION,
  PW_COLUMN_BALANCE,
  PW_COLUMN_WORK, /* pw_sample.work and loss, which tables do not have */
  PW_COLUMN_LOSS,
  PW_COLUMN_OUTPUT,
  PW_COLUMN_TYPES
} pw_column_type;

typedef struct {
  pw_column_type type;
  int index; /* of the state, constraint equation, ledger entry, output; contact i: 2 i for x, 2 i + 1 for y; or 0 */
} pw_column;

/* The number of columns of a type; name, as pw_system_state_name, and unit of one. */
int pw_system_columns (const pw_system *s, pw_column_type type);
char *pw_system_column_name (const pw_system *s, pw_column c, char *buffer, size_t size);
const char *pw_system_column_unit (const pw_system *s, pw_column c);

/* Finds the column of this name.  PW_INPUT, with the nearest name, if there is none. */
int pw_system_find_column (const pw_system *s, const char *name, pw_column *c, pw_error *error);

/* Finds a column of an element by the part of its name after the element's, "Fx": its type, and its index among those
 * of the element; of an entry of the ledger 0 for "work", 1 for "loss".  kind NULL: a column that is one number of a
 * sample, "kinetic".  1 if there is one, else 0. */
int pw_kind_find_column (const pw_kind *kind, const char *name, pw_column *c);

/* The number of outputs; name and unit, "" without one; the types of the columns that it reads, itself or by other
 * outputs: 1 << type or'ed. */
int pw_system_outputs (const pw_system *s);
const char *pw_system_output_name (const pw_system *s, int output);
const char *pw_system_output_unit (const pw_system *s, int output);
unsigned pw_system_output_reads (const pw_system *s, int output);
/* 1 if it has conditions that no run locates, since it reads reactions, energies or contact points. */
int pw_system_output_jumps (const pw_system *s, int output);

/* Stores the values of columns in a sample.  NaN: works and losses of elements without pw_settings.ledger, outputs that
 * have no value there.  Errors: PW_METHOD if a signal fails, PW_RESOURCE. */
int pw_workspace_columns (pw_workspace *w, const pw_sample *x, const pw_column *c, int count, double *value,
                          pw_error *error);

/* How to integrate; zeros select the defaults. */
typedef struct {
  double t; /* initial time [s] */
  /* Approximate duration of the run [s], for the scale of energy, and an upper bound of the time scale; default 1 s, or
   * 1000 steps of a fixed size. */
  double span;
  double step; /* fixed-step methods: step size [s]; default PW_STEP */
  double rtol; /* adaptive methods: relative tolerance; default PW_RTOL */
  double atol; /* absolute tolerance of every state; default rtol x (L, 1 rad, L/T, 1/T), see pw_scale */
  int ledger;  /* 1: samples contain the work or loss of each element, and the energy added by projections */

  /* Integrals over the run, from its initial time on, of `integrals` functions of its state, by the method's stages and
   * in its error control, like work and losses.  `integrand` stores the functions at a state, a sample of which only t,
   * q, v, lambda, kinetic, potential, output and, in place of ledger, work and loss, their rates [W] are set; outputs
   * that read works or losses are NaN.  Runs with integrals do not use specialised code. */
  int integrals;
  void (*integrand) (void *context, const pw_sample *state, double *value);
  void *integrand_context;

  /* Limits of long runs. */
  long max_steps; /* adaptive methods: attempted steps, including rejected ones; default PW_MAX_STEPS */
  /* Called before each attempted step (specialised code: before up to 16 steps of fixed size), each evaluation of
   * adams, bdf and ida, and each sample inside a step; if it returns non-zero, the call returns PW_STOPPED.  Called
   * while the run of a large scene is opened, too: then pw_run_open fails with PW_STOPPED.  May be NULL. */
  int (*stop) (void *context);
  void *stop_context; /* passed to stop */

  /* Initial values in place of the system's, as by pw_model_set_initial; only read by pw_run_open. */
  const pw_initial_value *initial;
  int initials;

  /* Specialised code of the system, from compiling pw_system_source; or NULL.  It must outlive the run. */
  const struct pw_specialised *specialised;

  const struct pw_method *const *methods; /* methods besides the built-in ones, ending with NULL; or NULL */
} pw_settings;

/* Scales of a system in its initial state.  "Units of the scene", in which thresholds and scaled numbers are given, are
 * L for lengths, 1 rad for angles, T for times. */
typedef struct {
  double length; /* L [m]: largest distance of an element's point, markers excepted, from its body's centre of mass; if
                  * that is 0, the first nonzero radius of gyration of a body with mass; else 1 */
  double time; /* T: 1 / max (1 / span, largest velocity, square root of the largest acceleration), in units of L [s] */
} pw_scale;

/* Cost of a run, and its worst constraint residuals at accepted steps; docs/theory.md defines scaled residuals.
 * PW_STATISTICS_COUNTS and PW_STATISTICS_RESIDUALS (util.h) list the members. */
typedef struct {
  long steps;          /* accepted */
  long rejected;       /* repeated with another step size */
  long rhs;            /* evaluations of the accelerations, or of the residual */
  long jacobians;      /* evaluations of an iteration matrix */
  long factorisations; /* of any matrix */
  long restarts;       /* at checkpoints, of methods without pw_method.serialise */
  long specialised;    /* of the evaluations, by specialised code */
  long conditions;     /* changes of sides of conditions on states, where steps end */
  long unresolved;     /* of fixed steps, those in which a signal changes more than they see */
  double position;     /* worst scaled residual of g = 0 */
  double velocity;     /* worst scaled residual of J v = eta */
  double g;            /* worst |g| [m] or [rad] */
  double jv;           /* worst |J v - eta| [m/s] or [rad/s] */
} pw_statistics;

/* A change of a constraint equation whose multiplier has limits (pw_bounds).  Mode 0: it holds; 1, -1: its multiplier
 * is at its largest or smallest value. */
typedef struct {
  double t;
  double impulse; /* of an impact: the integral of the reaction [N s], [N m s] */
  int row;        /* the equation */
  int from, to;   /* modes */
  int impact;     /* 1: velocities have jumped */
} pw_event;

/* The number of constraint equations whose multipliers have limits. */
int pw_system_limited (const pw_system *s);
const pw_bounds *pw_system_limits (const pw_system *s, int row); /* of an equation; NULL: it has none */
/* "holds"; "slides+", "slides-" where J v - eta is positive, negative; "free" of an equation with one limit. */
const char *pw_system_mode_name (const pw_system *s, int row, int mode);

/* Entries of the energy ledger: work or loss of an element.  Their names are like "rider.work", "damper.loss";
 * "drag.frame.loss" for an element that acts on every body. */
int pw_system_ledger_entries (const pw_system *s);
char *pw_system_ledger_name (const pw_system *s, int entry, char *buffer, size_t size);

/* How the consistent initial state differs from the described one. */
typedef struct {
  const double *q_given, *v_given; /* the described state */
  const double *q, *v;             /* the initial state of the run; valid until it advances */
  int moved;                       /* number of states that differ by more than round-off */
  const unsigned char *origin;     /* for pw_initial_specified */
  int released;                    /* 1: some of the user's values were not kept */
  int changed;                     /* number of moved states that the model specifies and the user does not give */
  int rounded;                     /* number of states given or specified that moved by less than 1e-2 of their unit */
  double position, velocity;       /* scaled residuals of the described state */
  double time;                     /* time scale of the run [s] */
  double speed;                    /* the largest described velocity, those of angles times L [m/s] */
} pw_initial_report;

/* ---- Saved states ---- */

/* A buffer that a state is saved to or loaded from; zero-initialised.  Saving allocates `at`. */
typedef struct {
  unsigned char *at;
  size_t used; /* bytes saved or loaded so far */
  size_t size; /* saving: capacity; loading: bytes available */
  int loading; /* 1: loading, 0: saving */
  int failed;  /* 1: out of memory, or the data are truncated or invalid */
} pw_archive;

/* Saves or loads bytes, so that one function that lists the parts of a state does both. */
void pw_archive_bytes (pw_archive *a, void *bytes, size_t count);
/* Saves or loads a count; fails if a loaded one is negative or above LONG_MAX / 2. */
void pw_archive_count (pw_archive *a, long *count);
void pw_archive_clear (pw_archive *a); /* rewinds: the next bytes are the first again */
void pw_archive_free (pw_archive *a);

PW_END

#endif
