/* Pinwheel's methods: an integrator and a stabilisation, selected by name.
 *
 *     pw_run *r = pw_run_open (system, "rk4+projection", &settings, &error);
 *     while (pw_run_advance (r, t_end, &error) == PW_OK && pw_run_time (r) < t_end) ...
 *     pw_run_sample (r, t, &sample, &error);
 *     pw_run_close (r);
 *
 * A method is written  integrator[+stabilisation][:option=value]...,  "rk4+baumgarte:alpha=10:beta=10". */
#ifndef PINWHEEL_SOLVERS_H
#define PINWHEEL_SOLVERS_H

#include "run.h"

PW_BEGIN

typedef struct pw_run pw_run;
typedef struct pw_method pw_method;
typedef struct pw_method_data pw_method_data; /* private data of an integrator; each defines its own */

/* An option of a method: a number, or one of several choices. */
typedef struct {
  const char *name;
  const char *with;           /* the stabilisation it belongs to; NULL: all */
  double value;               /* default: the number, or the choice's index */
  pw_domain domain;           /* of a number */
  const char *const *choices; /* NULL-terminated; NULL: a number */
  const char *unit, *about;
} pw_option;

/* Stabilisations that the run knows; methods may have others. */
typedef enum {
  PW_STABILISED_OTHERWISE,
  PW_UNSTABILISED,
  PW_BAUMGARTE,
  PW_PROJECTION,
  PW_NULLSPACE,
  PW_INDEX2,
  PW_GGL,
  PW_SI1,
  PW_INDEX3,
  PW_RATTLE
} pw_stabilisation_kind;

typedef struct {
  const char *name, *about;
  pw_stabilisation_kind kind;
} pw_stabilisation;

/* An integrator.  All of Pinwheel's are const tables of this type; for your own, see pinwheel-method.h. */
struct pw_method {
  const char *name;                       /* "rk4" */
  const char *about;                      /* one line, with its source (author, year) */
  int adaptive;                           /* 1: uses rtol and atol, unless steps=fixed; 0: uses step */
  int order;                              /* of convergence; 0: variable */
  const pw_stabilisation *stabilisations; /* ended by a NULL name; the first is the default */
  const pw_option *options;               /* ended by a NULL name */
  const pw_stabilisation *refused;        /* unsupported ones, `about` is the reason; ended likewise, or NULL */
  int locates_no_events; /* 1: of limited reactions, it decides the impulses of each step instead; moreau alone */
  int (*open) (pw_run *r, pw_error *error); /* allocates the data; returns a status, as the following */
  int (*advance) (pw_run *r, double t_end, pw_error *error); /* one step, at most to t_end or a discontinuity */
  int (*at) (pw_run *r, double t, pw_error *error); /* the state in the last step that pw_run_sample requests */
  int (*restart) (pw_run *r, pw_error *error);      /* continues at the state reached, after a discontinuity */
  void (*close) (pw_run *r);                        /* frees the data, also what a failed `open` has left */
  /* Saves or loads what steps after a checkpoint need beyond the state: step size, counts.  NULL: the method restarts
   * at checkpoints. */
  void (*serialise) (pw_run *r, pw_archive *a);
};

/* All integrators, ended by NULL. */
extern const pw_method *const pw_methods[];

/* Makes the initial state consistent and opens a method; settings NULL: defaults.  The system must outlive the run,
 * which only reads it: any number of runs, in any threads, may share it.  Errors: PW_INPUT for an unknown or invalid
 * method, option or setting, with the nearest valid name, and if the method uses a derivative that an element type
 * omits though it is not zero; PW_INITIAL if the initial state cannot be made consistent; PW_METHOD if it cannot be
 * evaluated; PW_STOPPED if settings->stop requests it; PW_RESOURCE. */
pw_run *pw_run_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error);

/* Checks name and options of a method, built-in or one of `own` (as pw_settings.methods; NULL: none), without a system;
 * returns integrator and index of the stabilisation, each unless its pointer is NULL. */
int pw_method_parse (const char *method, const pw_method *const *own, const pw_method **integrator, int *stabilisation,
                     pw_error *error);

/* 1 if a method controls its step size; 0 if steps are fixed, by the integrator or by the option steps=fixed.
 * integrator: that of pw_method_parse; method: the text. */
int pw_method_adaptive (const pw_method *integrator, const char *method);

/* Estimated number of steps of a run from time 0 of a model with this default step [s]; 0 for an unknown method.  From
 * PW_SPECIALISE_STEPS steps on, compiling specialised code saves time. */
enum { PW_SPECIALISE_STEPS = 1000000 };
double pw_method_steps (const char *method, const pw_settings *s, double step, double t_end);

/* Makes one accepted step that does not pass t_end; none if t_end is not after the time reached.  If t_end or a
 * discontinuity equals the time reached up to round-off, only the time is set to it.  PW_STOPPED, without an error, if
 * settings.stop requested it: the run stays where it was, and the next call continues; adams, bdf and ida then restart
 * their formulas, so that results depend on the stops: by about the tolerance after one, by far more if most steps are
 * stopped.  Errors: PW_INPUT if t_end is not a number; PW_METHOD with the time reached and the reason, such as
 * max_steps; PW_RESOURCE. */
int pw_run_advance (pw_run *r, double t_end, pw_error *error);

/* The same, or with specialised code several steps of a fixed size: they end where single ones would, and none is made
 * after the first that reaches t.  Returns as pw_run_advance. */
int pw_run_advance_towards (pw_run *r, double t, double t_end, pw_error *error);

/* Advances each run by one or several steps.  With `code`, steps of fixed size are made at once, one run in each of its
 * lanes, unless half of the lanes or more would be empty or there are more runs than lanes; otherwise, or with NULL,
 * one run after the other.  memory: pw_specialised_lanes_memory.  The runs' systems have the structure of the code's.
 * Results are those of pw_run_advance_towards, bit for bit, and do not depend on the other runs.  t_end, status, error:
 * of each run. */
void pw_runs_advance (pw_run *const *runs, int count, const double *t_end, const pw_specialised_lanes *code,
                      void *memory, int *status, pw_error *error);

/* Steps until t is reached or lies inside the last step, where pw_run_sample can evaluate it, or t_end is reached.
 * Returns as pw_run_advance. */
int pw_run_advance_to (pw_run *r, double t, double t_end, pw_error *error);

/* The time reached. */
double pw_run_time (const pw_run *r);

/* The state at a time inside the last accepted step, its end included; at a discontinuity accelerations and multipliers
 * are those before or after it, depending on the method.  PW_STOPPED as pw_run_advance, but never at the end: the state
 * reached is available however a run has stopped; after a stop, other times may not be.  Errors: PW_INPUT if t lies
 * outside the step; PW_METHOD if a signal fails there, or no state satisfies the constraints; PW_RESOURCE. */
int pw_run_sample (pw_run *r, double t, pw_sample *sample, pw_error *error);

/* A function of the sample of which the first time is sought at which it is positive: a condition becomes true, an
 * event occurs.  Set value and context, the rest to 0. */
typedef struct {
  double (*value) (void *context, const pw_sample *sample); /* NaN counts as not positive */
  void *context;
  /* private: the time of the last call, and the value there */
  int begun;
  double t, last;
} pw_crossing;

/* Call it before the first step and after each one (pw_run_advance).  Stores the first time in the last step, its end
 * included, at which the function is positive, up to round-off: an instant before it is not; NaN if it is not positive.
 * Once it has been positive, set `begun` to 0 where it may be sought again.
 *
 * Changes of sign between the step's ends are always found.  Of a function that becomes positive and returns within a
 * step, those are found that its values at the ends and the middle suggest: all that last more than half of a step, and
 * of smooth functions all where a parabola describes it over a sixteenth of the step. Errors: as pw_run_sample. */
int pw_run_find_crossing (pw_run *r, pw_crossing *x, double *t, pw_error *error);

/* Writes a signal that fixed steps did not resolve, "torque T: value", or "", to the buffer and returns it. */
char *pw_run_unresolved (const pw_run *r, char *signal, size_t size);

/* Energy defect of a sample, including energy added by projections, relative to the energy that the run has
 * exchanged: the largest of its kinetic energy, the change of its potential energy, and the kinetic energy of moving
 * by L and 1 rad in the span of the run.  If that is zero, relative to the larger of work and loss. */
double pw_run_energy_defect (const pw_run *r, const pw_sample *sample);

/* Advice against an energy defect of this size, as pw_run_energy_defect returns it. */
const char *pw_run_energy_advice (const pw_run *r, double defect);

/* Restarts from a state at the time reached, after the caller has changed something.  The state is made consistent
 * first.  q and v may be NULL: unchanged.  The ledger continues; the change of energy does not count in its balance.
 * Errors: PW_INPUT (a magnitude of 1e100 or more, or NaN), PW_INITIAL, PW_METHOD: the run stays where it was;
 * PW_RESOURCE. */
int pw_run_restart (pw_run *r, const double *q, const double *v, pw_error *error);

void pw_run_close (pw_run *r);

/* ---- Inputs: signals whose values the caller sets between steps, as a controller does ---- */

/* Gives a harmonic signal (PW_HARMONIC; one of amplitude 0 is a value that waits to be set) this constant value, in
 * this run, from the time reached on; it acts from the next step.  signal: pw_system_find_signal.  A signal of a
 * constraint calls pw_run_restart, since velocities may jump.  Saved states contain these values.  Errors: PW_INPUT if
 * the signal has another type or the value is not finite; those of pw_run_restart, after which the signal is what it
 * was. */
int pw_run_set_input (pw_run *r, int signal, double value, pw_error *error);

/* Runs that a caller steps together; all arrays are the caller's.  A run whose status is not PW_OK stays where it is
 * until the caller sets its status and its error to 0. */
typedef struct {
  pw_run *const *run;                /* count */
  int count, threads;                /* threads: how many share the runs */
  int inputs, columns;               /* of each run: signals that are set, numbers that are observed */
  const int *signal;                 /* inputs: numbers of signals (pw_run_set_input) */
  const double *input;               /* count x inputs: their values */
  const int *column;                 /* columns: numbers of a row of pw_run_record */
  double *observed;                  /* count x columns */
  int *status;                       /* count */
  pw_error *error;                   /* count */
  const pw_specialised_lanes *lanes; /* as in pw_runs_advance; or NULL */
} pw_ensemble;

/* Sets the inputs, then advances each run by dt >= 0 [s], to the same state as one run alone. */
void pw_ensemble_step (const pw_ensemble *e, double dt);
/* Stores the observed numbers at the time that each run has reached; NaN if its status is not PW_OK. */
void pw_ensemble_observe (const pw_ensemble *e);

/* ---- Checkpoints ---- */

/* Appends the state reached to the archive, and continues as a run loaded from it would: matrices are planned again,
 * and a method without `serialise` restarts, which the statistics count.  Take samples of the last step before.
 * PW_RETRY near a singular configuration, where nothing is done: try after the next step.  Errors: PW_METHOD or
 * PW_INPUT if the state cannot be evaluated; PW_RESOURCE. */
int pw_run_save (pw_run *r, pw_archive *a, pw_error *error);

/* Loads a saved state into a run opened with the same system, method and settings that has not advanced; it continues
 * bit for bit as the run that was saved.  Bytes after the state are left to the caller: a->used < a->size.  After an
 * error the run can only be closed: PW_INPUT if it has advanced, the archive is truncated, or method, options, settings
 * (without limits and code), masses, names, numbers of signals, initial state or accelerations there differ; PW_METHOD;
 * PW_RESOURCE.  The caller ensures that systems do not differ otherwise: by a damper that is at rest initially, or a
 * function. */
int pw_run_load (pw_run *r, pw_archive *a, pw_error *error);

/* ---- Properties of a run ---- */

/* The number of redundant constraint equations, and a description of those that the i-th one (from 0) follows from, or
 * "" if there is none, in the buffer, which is returned.  With redundant equations reactions are not unique: samples
 * have the least-norm ones. */
int pw_run_redundant (const pw_run *r);
char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size);

/* The smallest velocity scale [m/s] or [rad/s] of a saturating force, at the configuration reached and at rest:
 * returns the velocity (numbered as in pw_system_find_state) and the element, "friction hinge"; or -1 if no change of a
 * velocity saturates a force.  adams, bdf, ida and radau keep their tolerances below it, whatever the settings. */
int pw_run_saturation (pw_run *r, double *least, char *element, size_t size);

/* The mode of a constraint equation at the state reached, as of pw_event; 0 without limits. */
int pw_run_mode (const pw_run *r, int row);

/* The events since the run was opened, in the order of time; valid until it advances.  None with a method that locates
 * no events. */
const pw_event *pw_run_events (const pw_run *r, int *count);

/* These belong to the run.  After pw_run_restart, pw_run_initial reports on the state given there. */
const pw_statistics *pw_run_statistics (const pw_run *r);
const pw_initial_report *pw_run_initial (const pw_run *r);
const pw_scale *pw_run_scale (const pw_run *r);

/* Whether making the initial state consistent changed this state (numbered as in pw_system_find_state) by more than
 * round-off.  0: no; 1: by less than 1e-2 of its unit, as if it were rounded; 2: more.  The unit is L or 1 rad, that of
 * velocities the largest described one, speed (over L), or L / T (1 rad / T) if all are 0. */
int pw_initial_moved (const pw_system *s, const pw_initial_report *report, int state);
/* Why a state that moved could not begin as described: "pin A would be open by 0.02 m", the equation that is violated
 * most if this state alone has the described value; "" if none is.  Before the run advances.  Returns the buffer. */
char *pw_run_initial_reason (pw_run *r, int state, char *buffer, size_t size);
/* 1 if the model or the user specifies the initial value of this state. */
int pw_initial_specified (const pw_initial_report *report, int state);
/* 1 if the user gives it: pw_model_set_initial, pw_settings.initial. */
int pw_initial_given (const pw_initial_report *report, int state);

/* ---- For programs in other languages (bindings.c) ---- */

/* Advances to t_end and stores samples in rows of pw_run_record_width numbers, at most `count`: at the given times,
 * increasing, from the time reached on; or after every accepted step (times: NULL).  Returns PW_OK with *recorded rows
 * when t_end is reached, the rows are full, or after `steps` calls of pw_run_advance_towards (times: NULL: of
 * pw_run_advance): call it again, with the rest of the times; otherwise as pw_run_advance.  A row is t, scaled
 * residuals of g = 0 and J v = eta, kinetic and potential energy, work, loss, energy added by projections, balance
 * (PW_RECORD_STATES numbers), then q, v, a, x and y of the contact points, reactions (-lambda), outputs and,
 * with pw_settings.ledger, the ledger's entries. */
enum { PW_RECORD_STATES = 9 }; /* index of the first coordinate in a row */
int pw_run_record_width (const pw_run *r);
int pw_system_record_width (const pw_system *s, int ledger); /* of runs with pw_settings.ledger = ledger */
/* Name and unit of a number of a row, as in tables; those of accelerations: the velocity's name and "'". */
char *pw_system_record_name (const pw_system *s, int i, char *buffer, size_t size);
const char *pw_system_record_unit (const pw_system *s, int i);
/* 1 if rows of both have the same numbers: those of these names. */
int pw_system_record_same (const pw_system *a, const pw_system *b, int ledger);
int pw_run_record (pw_run *r, double t_end, const double *times, long count, long steps, double *rows, long *recorded,
                   pw_error *error);

/* PW_VERSION of the library, which may differ from that of the header. */
extern const char pw_version[];

/* Sizes of structures ("pw_error") and offsets and sizes of their members ("pw_error.text"); ends with a NULL name. */
typedef struct {
  const char *name;
  size_t offset, size;
} pw_member;
extern const pw_member pw_members[];

/* The libraries that the methods use, with their versions: "SUNDIALS 6.4.1, KLU 1.3.9, LAPACK 3.11.0". */
char *pw_library_versions (char *buffer, size_t size);

/* pw_system_source with the redundant constraint equations of the run. */
char *pw_run_source (const pw_run *r, pw_error *error);

PW_END

#endif
