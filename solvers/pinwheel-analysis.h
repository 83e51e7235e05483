/* Analysis of motions, on top of pinwheel-solvers.h. */
#ifndef PINWHEEL_ANALYSIS_H
#define PINWHEEL_ANALYSIS_H

#include "pinwheel-solvers.h"

PW_BEGIN

/* ---- Mobility and linearisation at the state reached (linear*.c) ---- */

/* Whether eigenvalues of the linearisation are growth rates of perturbations: only if the linearised equations are
 * constant along the motion, in a frame that moves with it. */
typedef enum {
  PW_STEADY,
  PW_ACCELERATED, /* no: the state accelerates in that frame */
  PW_CHANGING     /* no: the equations depend on time, or change along the motion, within the run's span */
} pw_steadiness;

/* Mobility and linearisation.  Singular values are those of the independent rows of J, each scaled to length 1, angles
 * multiplied by the length scale.  Minimal coordinates x [m] of a perturbation, in a frame that moves with the motion,
 * obey x' = A x; those of velocities are multiplied by the time scale. */
typedef struct {
  int coordinates;
  int positions;   /* degrees of freedom of configuration: coordinates less independent holonomic rows */
  int velocities;  /* of velocity: coordinates less independent rows */
  int rank;        /* of J */
  double least;    /* smallest singular value; NaN: not computed, or no rows */
  int unknowns;    /* of the linearisation: positions + velocities */
  double *A;       /* unknowns x unknowns, by rows [1/s], positions first; NULL: not computed, like all below */
  double *re, *im; /* its eigenvalues [1/s], by decreasing real part, im > 0 before im < 0; parts below round-off: 0 */
  unsigned char *rigid; /* per eigenvalue: 1 if its mode is a rigid displacement, which changes no equation */
  int symmetries;       /* number of symmetry directions among x, y, phi */
  pw_steadiness steady;
  double twist[3];     /* velocity of the frame's origin (a body or the mean of all); angular velocity [m/s, rad/s] */
  double acceleration; /* the largest in that frame; angles multiplied by the length scale [m/s^2] */
  /* Of pw_run_linear_modes, otherwise NULL; axes are those of the frame, which are the world's at this moment. */
  double *B;     /* unknowns x signals, by rows: x' = A x + B u, u added to the signals of forces [m/s per unit of the
                    signal]; NaN for signals of constraints, which enter with their derivatives */
  double *basis; /* 2 coordinates x unknowns, by rows: change of each state, numbered as in pw_system_find_state, by
                    each x [1, rad/m, 1/s, rad/(m s)] */
  double *shape; /* unknowns x 2 coordinates complex numbers (re, im): the perturbation of the states in each mode; the
                    largest of the positions, angles times L, is 1 m; if all are 0, of velocities times T; 0 for rigid
                    displacements and for eigenvalues 0, of which it is not unique */
} pw_linear;

/* Linearises at the state reached.  With more than `most` coordinates only the numbers of coordinates, positions,
 * velocities, rank and unknowns are stored: the cost of the rest is cubic.  Free the result in every case.  Errors:
 * PW_RESOURCE; PW_METHOD, also if accelerations jump; PW_INPUT if a type leaves out a derivative that is not zero. */
int pw_run_linearise (pw_run *r, int most, pw_linear *l, pw_error *error);
/* The same with B, basis and shape, at about three times the cost. */
int pw_run_linear_modes (pw_run *r, int most, pw_linear *l, pw_error *error);
void pw_linear_free (pw_linear *l);

/* The largest h such that the classical Runge-Kutta method does not amplify x' = (re + i im) x with any step up to h;
 * re > 0 counts as 0.  INFINITY if im = 0 and re >= 0. */
double pw_rk4_limit (double re, double im);

/* ---- Derivatives of the outputs of runs (derivatives.c) ---- */

/* Stores the outputs of runs at values x of the parameters, made with this relative tolerance; NaN for one that is not
 * a number.  Called by several threads at once.  PW_RETRY and PW_RESOURCE end pw_differentiate; after another error
 * there is no run at x, and steps that do not need it are chosen. */
typedef int pw_outputs (void *context, const double *x, double rtol, double *value, pw_error *error);

/* What is differentiated: any outputs as functions of parameters and initial values. */
typedef struct {
  pw_outputs *evaluate;
  void *context;
  const double *x; /* parameters: where */
  int parameters, outputs;
  int steering;             /* the first outputs, which determine the steps; 0: all */
  const double *size;       /* parameters: typical sizes; NULL: |x|, or 1 where that is 0 */
  const double *low, *high; /* parameters: bounds; NULL: none */
  double rtol;              /* of the runs */
  /* 6: steps are chosen, with `size` at the beginning, until derivatives have 8 digits or no step gives more.  2 or 4:
   * steps of size rtol^(1/3) or rtol^(1/5), for relative errors of about rtol^(2/3) or rtol^(4/5). */
  int neighbours;
  const double *value; /* outputs: at x; NULL: not known */
  int jobs;            /* threads, of which the caller is one; at least 1 */
} pw_difference_settings;

typedef struct {
  enum {
    PW_DERIVATIVE,
    PW_NO_DERIVATIVE, /* it jumps: `below`, `above` are one-sided ones, to a few digits */
    PW_UNKNOWN        /* no step gives a digit, as in chaotic motions; or the output is not a number */
  } type;
  double value;
  double error; /* it contains the true one; NaN with 2 neighbours */
  double below, above;
} pw_derivative;

/* Differentiates outputs with respect to parameters, by differences of runs at neighbouring values: beside a bound, or
 * a value that the runs refuse, on one side only.  The errors of runs are measured by others with larger tolerances.
 * out: parameters x outputs; value, unless NULL: outputs at x.  Errors: PW_INPUT for an invalid description; those of
 * `evaluate` at x; with 2 or 4 neighbours also those of these; PW_RESOURCE. */
int pw_differentiate (const pw_difference_settings *d, pw_derivative *out, double *value, pw_error *error);

/* The method by which runs of a system are most accurate at small tolerances: "erk8+projection", or "radau" if that
 * takes much fewer steps, since the motion is stiff.  settings: as of the runs, their rtol is not used; *most_steps: a
 * limit of steps for runs that are compared with this one, which may be very different.  NULL and the error if both
 * fail; if settings->stop requests a stop: NULL without an error. */
const char *pw_accurate_method (const pw_system *s, const pw_settings *settings, double t_end, long *most_steps,
                                pw_error *error);

/* ---- The error of a run, from its repetition (repetition.c) ---- */

/* The repetition of a run with a tenth of the tolerance (with ten times the tolerance if that is too small for the
 * method), or half the step.  Runs are compared at `count` increasing times from the initial one on, which must outlive
 * the repetition, as must the system, the method and what the settings refer to.  NULL and the error: PW_INPUT,
 * PW_RESOURCE. */
typedef struct pw_repetition pw_repetition;
pw_repetition *pw_repetition_open (const pw_system *s, const char *method, const pw_settings *settings,
                                   const double *times, long count, pw_error *error);
/* Makes the repetition, perhaps in another thread than the run.  PW_RETRY, without an error: it needs more than this
 * number of steps (0: no limit); call it again.  Errors: as pw_run_open and pw_run_advance. */
int pw_repetition_run (pw_repetition *r, long steps, pw_error *error);
/* States the errors of the first `count` rows of the run, as pw_run_record stores them at the times of the repetition,
 * which has been made: of each number at the last of these times, and the largest at any; NAN of the time, residuals,
 * energy of projections and balance.  They contain the true ones if the repetition has at most half the error of the
 * run.  PW_METHOD and the reason if no error can be stated: the difference is larger than 1 % of the motion and does
 * not become smaller in a second repetition, made now, with a hundredth of the tolerance or a quarter of the step. */
int pw_repetition_error (pw_repetition *r, const double *rows, long count, double *end, double *largest,
                         pw_error *error);
const char *pw_repetition_text (const pw_repetition *r); /* "a tenth of the tolerance", "half the step", ... */
void pw_repetition_close (pw_repetition *r);

/* ---- Steady motions (steady*.c) ---- */

/* Finds by name a quantity that can be held: a state, numbered as in pw_system_find_state; after these, of each body,
 * the velocity of its centre of mass along its x axis (BODY.speed), the turning radius speed / omega (BODY.radius),
 * positive to the left, and omega / speed (BODY.curvature).  PW_INPUT and the error, with the nearest name. */
int pw_system_find_held (const pw_system *s, const char *name, pw_error *error);
/* Name, unit and value of such a quantity; the name as pw_system_state_name. */
char *pw_system_held_name (const pw_system *s, int held, char *buffer, size_t size);
const char *pw_system_held_unit (const pw_system *s, int held);
double pw_system_held_value (const pw_system *s, int held, const double *q, const double *v);

typedef struct {
  const pw_initial_value *hold; /* what is held, numbered as in pw_system_find_held */
  int holds;
  double t;           /* time at which signals are evaluated [s] */
  double span;        /* as in pw_settings, default 1 s: signals must be constant in it */
  double first, last; /* range of the parameter; to follow a branch they must differ */
  int vary;           /* the parameter is the value of hold[vary]; -1: it is that of `compile`, if any */
  /* Compiles the system for a value of the parameter; the search frees it.  If it returns NULL or an error, there is no
   * system for this value.  The pointer itself may be NULL. */
  pw_system *(*compile) (void *context, double value, pw_error *error);
  void *context;
  int points; /* in the range, at least; default 50 */
} pw_steady_settings;

/* What happens at a point of a branch. */
typedef enum {
  PW_STEADY_POINT,
  PW_STEADY_FOLD,        /* the parameter has an extremum */
  PW_STEADY_REAL,        /* a real eigenvalue changes its sign */
  PW_STEADY_OSCILLATION, /* a conjugate pair crosses the imaginary axis (Hopf) */
  PW_STEADY_END          /* the branch cannot be followed further; all else is 0 or NULL */
} pw_steady_event;

/* A steady motion: velocities are those of a rigid displacement of the whole and of angles on which nothing depends,
 * and accelerations vanish in the frame that moves with it.  Arrays are valid until the next call. */
typedef struct {
  double parameter;
  const double *q, *v; /* pw_system_coordinates */
  double residual;     /* the largest, in units of the scene (pw_scale): L, L/T, L/T^2 */
  int iterations;
  int family;   /* from pw_steady_solve: number of further quantities to hold to isolate it, up to symmetries */
  int unstable; /* growing modes; at an event, without those that change */
  pw_steady_event event;
  const pw_linear *linear; /* NULL if it is not a solution */
} pw_steady_motion;

typedef struct pw_steady pw_steady;

/* Opens a search, which the system must outlive.  NULL and the error as pw_run_open; PW_INPUT with the first signal
 * that changes with time within the span; also if the system has more than 400 coordinates. */
pw_steady *pw_steady_open (const pw_system *s, const pw_steady_settings *settings, pw_error *error);
void pw_steady_close (pw_steady *x);

/* Newton's method at a value of the parameter, with corrections of least norm, from the initial state (attempt 0), the
 * end of a relaxation from there (1: positions moved along the accelerations), or a random state (2, 3, ...).
 * PW_RETRY, without an error, if it finds no solution: residual and state are where it ended.  Errors: as `compile`,
 * pw_run_open and pw_run_linearise; also PW_INPUT if the parameter changes the number of bodies or equations. */
int pw_steady_solve (pw_steady *x, int attempt, double parameter, pw_steady_motion *out, pw_error *error);
/* Why the system could not be evaluated the last time this happened, or why a branch ended within the range, or "". */
const char *pw_steady_reason (const pw_steady *x);
/* Number of symmetries: displacements of the whole, and angles on which nothing depends.  It decreases when
 * pw_steady_solve reaches a solution without some of them; solutions found before may then count as different. */
int pw_steady_symmetries (const pw_steady *x);
/* Whether two states differ by symmetries only. */
int pw_steady_same (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2);
/* Quantities to hold so that the motion last found by pw_steady_solve becomes isolated, with their values there.
 * Returns their number, at most `most`, or a status; the motion stays in a family if they are not enough. */
int pw_steady_suggest (pw_steady *x, pw_initial_value *hold, int most);

/* Follows the branch of a solution, initially towards the end of the range (direction 1) or its beginning (-1).
 * pw_steady_next stores its points, the first one included, and events in between, then PW_STEADY_END: at an end of
 * the range or the start of a closed branch, where Newton's method fails at the smallest step, or after 100 times
 * `points` points (pw_steady_reason).  It also stores PW_STEADY_END before and after a branch, and after
 * pw_steady_follow has failed.  Errors: those of pw_steady_solve; of pw_steady_follow also PW_INPUT if first = last, q
 * or v is NULL, or the direction is another; PW_METHOD if Newton's method does not converge from this state, or the
 * branch has a fold there. */
int pw_steady_follow (pw_steady *x, const double *q, const double *v, double parameter, int direction, pw_error *error);
int pw_steady_next (pw_steady *x, pw_steady_motion *out, pw_error *error);

/* ---- Periodic motions (periodic*.c) ---- */

/* The period of all signals of which it is known, harmonic ones and repeated pulses [s]; 0: there are none; NaN: they
 * have none in common. */
double pw_system_period (const pw_system *s);

typedef struct {
  const char *method;              /* default "erk8+projection" */
  const pw_method *const *methods; /* as in pw_settings */
  double rtol;                     /* default 1e-12 */
  int (*stop) (void *context);     /* as in pw_settings, but a stop counts as PW_RETRY, reason "stopped"; or NULL */
  void *stop_context;
  double t;           /* initial time [s] */
  double period;      /* [s]; 0: that of the signals at each value of the parameter; with `free` the first guess */
  int periods;        /* number of periods of the signals in one period of the motion, if `period` is 0; default 1 */
  int free;           /* 1: the period is sought; signals must not change with time */
  double first, last; /* as in pw_steady_settings */
  pw_system *(*compile) (void *context, double value, pw_error *error); /* as in pw_steady_settings */
  void *context;
  int points; /* in the range, at least; default 20 */
} pw_periodic_settings;

typedef enum {
  PW_PERIODIC_POINT,
  PW_PERIODIC_FOLD,  /* the parameter has an extremum */
  PW_PERIODIC_REAL,  /* a multiplier passes 1 elsewhere: branches cross */
  PW_PERIODIC_FLIP,  /* a multiplier passes -1: period doubling */
  PW_PERIODIC_TORUS, /* a conjugate pair crosses the unit circle (Neimark-Sacker) */
  /* The end of the range or of a closed branch; or pw_periodic_reason says why no points follow.  All else is 0. */
  PW_PERIODIC_END
} pw_periodic_event;

/* A relative periodic motion: after one period the state is the initial one up to symmetries of the system
 * (displacements of the whole, and angles on which nothing depends) and to whole turns of bodies on whose number
 * nothing depends.  Arrays are valid until the next call. */
typedef struct {
  double parameter, period;
  const double *q, *v; /* initial state: pw_system_coordinates */
  const double *end;   /* state after one period: 2 x coordinates */
  double rotation;     /* of the whole in one period, without spins [rad] */
  double residual;     /* the largest, in units of the scene (pw_scale): L, L/T */
  int iterations;
  int multipliers;       /* Floquet multipliers: those that are not trivial, the largest first, then the trivial ones */
  int trivial;           /* number of these: of symmetries and, with a free period, of a shift in time */
  const double *re, *im; /* multipliers: their values */
  int unstable;          /* number of those above 1 in absolute value, by more than 1e-6 */
  pw_periodic_event event;
} pw_periodic_orbit;

typedef struct pw_periodic pw_periodic;

/* Opens a search, which the system must outlive.  NULL and the error as pw_run_open; PW_INPUT with the first signal
 * that does not have the period, or with a free period changes with time; also if the system has more than 100
 * coordinates, or the method has fixed steps. */
pw_periodic *pw_periodic_open (const pw_system *s, const pw_periodic_settings *settings, pw_error *error);
void pw_periodic_close (pw_periodic *x);

/* Newton's method at a value of the parameter, from the state after `settle` >= 0 of the periods, with corrections of
 * least norm.  If a free period is not given, the first guess is the time of the motion's first return after settling.
 * PW_RETRY, without an error, if it finds no solution: the residual is that where it ended.  Errors: PW_INPUT if settle
 * is < 0 or the parameter not finite; PW_METHOD if LAPACK fails; PW_RESOURCE. */
int pw_periodic_solve (pw_periodic *x, int settle, double parameter, pw_periodic_orbit *out, pw_error *error);
/* Why the last motion could not be computed, or why a branch ended within the range; or "". */
const char *pw_periodic_reason (const pw_periodic *x);
/* Number of symmetries, as pw_steady_symmetries. */
int pw_periodic_symmetries (const pw_periodic *x);

/* Follows the branch of the motion that pw_periodic_solve has found last towards the end of the range (direction 1) or
 * its beginning (-1).  Errors: PW_INPUT if pw_periodic_solve has failed, first = last, or the direction is another;
 * PW_METHOD at a fold; PW_RESOURCE.
 * pw_periodic_next stores its points, the first one included, and events in between, then PW_PERIODIC_END (perhaps
 * with pw_periodic_reason), which it also stores before and after a branch, and after pw_periodic_follow has failed.
 * Errors: PW_INPUT if no run of a compiled system can be opened; PW_METHOD if LAPACK fails; PW_RESOURCE. */
int pw_periodic_follow (pw_periodic *x, int direction, pw_error *error);
int pw_periodic_next (pw_periodic *x, pw_periodic_orbit *out, pw_error *error);

PW_END

#endif
