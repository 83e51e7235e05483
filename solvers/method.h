/* The data of a run and the functions that the integrators share, for solvers/ only; first the watchdog.
 *
 * The watchdog checks that the states of a run follow the motion of the mechanism: constraints are not lost, and the
 * motion does not jump to another branch at a singular configuration.
 *
 * Singular configurations are a property of J alone, with rows of length 1 and columns of angles divided by L: neither
 * masses nor the initial configuration matter.  "The sine" measures the distance from them: it is that of the smallest
 * angle between a row of J and the space spanned by the rows before it.  Branches are the motions between which a
 * closed loop can change in a singular configuration, a change point. */
#ifndef PW_METHOD_H_
#define PW_METHOD_H_
#include "saddle.h"
#include <float.h>
#include "pinwheel-method.h"

struct pw_run;

/* The thresholds, of which a run has a copy; definitions, values and derivations are in watchdog.c. */
typedef struct {
  double lost, lost_unstabilised, redundant_residual, redundant_ratio;
  double rank_lost, rank_suspect, rank_refused, independent, reselect_ratio, reselect_below;
  double near, regular, refine;
  double turn_growth, turn_reference, drift_turn, drift_near, drift_far, drift_any, jump_growth;
  double lipschitz, step_growth;
  double unresolved, low, stride, progress, floor, crossing, straight, resolved;
  double ends_singular, agree, agree_best, sample, sample_best;
  double extreme, stalled;
} pw_thresholds;

extern const pw_thresholds pw_watchdog_thresholds;

/* The sine along a run, at the states reached. */
typedef struct {
  pw_saddle *saddle;          /* of weights 1 and L^2, as in rank.h; NULL: a tree of holonomic joints, never singular */
  int loops;                  /* 1: bodies form closed loops, whose branches can meet */
  double evaluated_sine;      /* of the J last checked by pw_watchdog_near, perhaps of a stage */
  double largest_sine;        /* 0: not known yet */
  double checked_sine;        /* at the last state for which it was computed */
  double moved;               /* motion since then [units of L, rad] */
  double sine_before_checked; /* one state before that; NaN: not computed */
  double sine_slope;          /* fastest recent change of the sine per unit of motion */
  int dependent_row;          /* the row that is most nearly dependent */
  int singular_ahead;         /* 1: a singular configuration may be within the next step */
  int may_have_crossed;       /* 1: the motion may recently have passed a point where branches cross */
  double step_length;         /* of the last step, in the units of `moved` */
  double previous_t;          /* at the state last checked, the beginning of the step to be checked: the time, */
  double *previous_q;         /* the coordinates and, from number coords + 3 on, the velocities, */
  double previous_sine;       /* and the sine; NaN: not computed */
} pw_watchdog;

/* Opens r->watchdog.saddle anew for the active rows.  Errors: PW_RESOURCE. */
int pw_watchdog_open (struct pw_run *r, pw_error *error);

/* Restarts at the state reached, where J is evaluated. */
void pw_watchdog_begin (struct pw_run *r);

/* The smallest sine of the angle between a row of the J last evaluated and those before it, 1 without a saddle; *row
 * (unless NULL): that row, or -1. */
double pw_watchdog_sine (struct pw_run *r, int *row);

/* pw_watchdog_near at the state reached, where it evaluates J, factorises r->saddle and sets singular_ahead to 1. */
int pw_watchdog_near_state (struct pw_run *r);

/* Rejects initial values and, in scenes with constraints, masses and inertias whose products overflow.  Errors:
 * PW_INPUT. */
int pw_watchdog_check_values (const struct pw_run *r, pw_error *error);

/* 1 if watchdog.singular_ahead and the J last evaluated, for which r->saddle must be factorised, is near a singular
 * configuration; watchdog.evaluated_sine is then its sine.  Adaptive methods: only where solutions are refined. */
int pw_watchdog_near (struct pw_run *r);

/* Checks that the motion has come from watchdog.previous_q to the state reached without leaving its branch; sine: that
 * at the state reached (watchdog.c).  PW_METHOD; PW_RESOURCE. */
int pw_change_point_check (struct pw_run *r, double sine, pw_error *error);

/* After a step that has failed with PW_METHOD: if a dead point follows the state last checked, `error` says so.
 * Returns PW_METHOD. */
int pw_dead_point_explain (struct pw_run *r, pw_error *error);

/* Conditions on states in signals, and in outputs of which there may be integrals (sides.c). */
typedef struct {
  int functions;
  pw_source *of;                                     /* functions that have conditions: of signals, then of outputs */
  int signals;                                       /* conditions of signals, which are the first ones */
  int count;                                         /* conditions; arrays of this length, unless said otherwise */
  int fixed;                                         /* 1: their sides are */
  double *start, *end, *start_rate, *end_rate, *now; /* how far they are beyond their sides in a step, and the rates */
  double *size;                                      /* the largest value so far, and at a state about L away */
  double *memory;                                    /* of pw_first_crossing */
  double *read;                                      /* states that a signal reads */
  double t, *state;                                  /* 2 coords: where the sides have been fixed */
  unsigned char *changed;                            /* 1: at the state reached */
  double h;                                          /* length of the last step, or 0 */
  struct {
    double t, projected, *q, *ledger; /* as pw_run.q_at, ... */
  } found;                            /* the first sample beyond a side */
} pw_sides;

/* Stores how far the conditions are beyond their sides at a state; beyond NULL: fixes the sides there; q NULL, too:
 * frees them (dynamics.c). */
void pw_run_evaluate_sides (struct pw_run *r, double t, const double *q, const double *v, double *beyond);

/* Fixes the sides at the state reached, where signals must be evaluated again (dynamics.c).  Does nothing without
 * conditions. */
void pw_run_fix_sides (struct pw_run *r);
void pw_run_free_sides (struct pw_run *r);
void pw_run_serialise_sides (struct pw_run *r, pw_archive *a);

/* Fixed steps end at multiples of the step size after a time `base`. */
typedef struct {
  double base;
  long count; /* steps since then */
} pw_step_counter;

enum { PW_MAX_OPTIONS = 12 };
enum { PW_FORCES_AT_LIMITS = 2 }; /* pw_run.forces: of equations that are not enforced, too */

/* Equations that are not enforced and whose multipliers are multiples of others: friction of contacts that slide,
 * lambda[row] = ratio lambda[on]. */
typedef struct {
  int row, on;
  double ratio;
} pw_coupling;

struct pw_scene_step;

/* Derivatives of the given multiplier of an equation. */
typedef struct pw_given {
  int is_given;
  int source[2]; /* signals that it may follow; -1: none */
  double by_source[2];
  int first;      /* the first equation of its circle; -1: none */
  double by_u[2]; /* by J v of the circle's equations */
} pw_given;

/* Lengths of arrays: coords, rows, entries are the numbers of coordinates, of constraint equations, and of entries of
 * the ledger, which holds the work or loss of each element that exchanges energy, then pw_settings.integrals. */
struct pw_run {
  const pw_system *s;
  pw_workspace *w; /* results of evaluations of s */
  const pw_method *method;
  int stabilisation;             /* index in method->stabilisations */
  double option[PW_MAX_OPTIONS]; /* one per method->options */
  pw_settings settings;
  int fixed_steps;               /* 1: fixed step size */
  int entries;                   /* of the ledger: s->entries, then settings.integrals */
  pw_saddle *saddle;             /* matrix of M and all active rows: for accelerations, impulses */
  const unsigned char *active;   /* rows: 0 for redundant ones and those not enforced; NULL: there are none */
  int redundant;                 /* number of redundant rows; what follows, to reselect_below, only if there are any */
  struct pw_events *events;      /* of equations whose multipliers have limits (events.h); NULL: there are none */
  const unsigned char *enforced; /* rows: 0 for those whose multipliers are at a limit; NULL: none is */
  double *reaction;              /* rows: minus the multipliers of those, else 0; NULL without events */
  /* Sets these, and their derivatives, where J is evaluated; NULL: constants. */
  void (*update_given) (struct pw_run *r);
  struct pw_given *given; /* rows: the derivatives; NULL without events */
  pw_coupling *coupling;  /* couplings: those that slide now */
  int couplings;
  double *coupling_memory; /* 2 (coords + 3) + rows, and couplings (couplings + 1) */
  int coupling_lost;       /* 1: the last evaluation had no unique solution, see dynamics.c */
  char *events_memory;     /* of r->events */
  pw_event *event;         /* events so far: `event_count` of them */
  long event_count;
  size_t event_room;
  pw_sides *sides;                  /* of conditions in signals; NULL: there are none */
  struct pw_resolution *resolution; /* of signals that change within less than a step (resolution.c); NULL: none */
  int predicted;                    /* 0: the state has changed since it was used to look ahead */
  double resolved_until;            /* time until which fixed steps resolve them */
  int jumped;                       /* 1: multipliers may have jumped at a discontinuity since the last step */
  int (*advance) (struct pw_run *r, double t_end, pw_error *error); /* the method's, or with events */
  int forces;                  /* 0: constant ones alone; 1: others, too; PW_FORCES_AT_LIMITS */
  int redundant_drive;         /* 1: one of them has an eta, or some are not enforced: work depends on multipliers */
  int *redundant_row;          /* redundant: their indices */
  unsigned char *active_array; /* rows: what `active` points to */
  double *coefficient;         /* 5 x rows: a redundant row as a combination of active rows; scratch of rank.c */
  double *row_force;           /* coords + 3: right-hand side for the coefficients of a redundant row; 0 between uses */
  double *least_norm;          /* rows: least-norm multipliers for the ledger */
  double independence;         /* of the active rows at the state reached (rank.h) */
  double reselect_below;       /* independence below which other active rows are tried */
  const struct pw_specialised *specialised; /* compiled code of the scene in use, or NULL */
  struct pw_scene *scene;                   /* its data; NULL: none, or a constant pivot is too small */
  pw_thresholds thresholds;                 /* of the watchdog */
  pw_watchdog watchdog;                     /* the sine, which measures the distance from a singular configuration */
  double refused_sine;                      /* largest sine at which an evaluation is refused */
  double located;    /* time of the last sample at which an event or a crossing was sought: it is not interpolated */
  int near_singular; /* 1 after an evaluation near a singular configuration in the last step */
  double reference_level; /* largest acceleration norm away from singular configurations, in units of L / T^2; >= 1 */
  double previous_norm;   /* acceleration norm of the last such state */
  int uses_derivatives;   /* 1: the method uses the derivatives of the equations (tangent.h); only for opening */
  double alpha, beta;     /* Baumgarte's [1/s], used by pw_run_accelerate; 0: none */
  double breakpoint;      /* next discontinuity of a signal, or INFINITY; t if it has just been reached */
  double moved_from, moved_to; /* ends of the last change of t without a step; between them the state is the same */
  int stalled;                 /* consecutive steps that did not advance */
  pw_residuals residuals;      /* of the state reached, until a sample is projected; NaN: not computed */

  /* The state reached, where `advance` leaves kinematics and J evaluated.  Of adams and bdf, a and lambda may be those
   * of the last iterate until `at` is called. */
  double t;
  double *q, *v, *a; /* coords + 3 each */
  double *lambda;    /* rows; contiguous with q, v, a: pw_state_length numbers */
  double *ledger;    /* entries: work, losses and integrals up to t */
  double *rate;      /* entries: powers and integrands at t */
  double projected;  /* energy added by projections up to t; only with settings.ledger; 0 in bdf */

  /* The state requested from pw_run_sample, where `at` leaves kinematics and J evaluated; otherwise scratch. */
  double *q_at, *v_at, *a_at, *lambda_at, *ledger_at; /* same layout */
  double projected_at;

  int stopped;     /* 1: settings.stop has requested a stop */
  int interrupted; /* 1: the method must be restarted: at a breakpoint, after a failed restart or an interrupted step */
  double checked_span; /* time since the start when pw_run_check_resolution last had a look [s] */

  double energy0, potential0; /* initial energy and potential energy [J]; energy0 includes changes by pw_run_restart */
  double exchanged;           /* the largest kinetic energy or change of potential energy so far [J] (run.c) */
  double power;               /* the largest sum of the absolute values of the ledger's rates so far [W] */
  double *integrand_size;     /* integrals: the largest |integrand| so far, and at a state about L away */
  double *integrand_state;    /* 2 coords: the state at which integrands are evaluated */
  double scene_energy;        /* kinetic energy [J] of moving by L and 1 rad in the span; if massless: see run.c */
  double *scratch;            /* 2 (coords + 3) + 3 rows, for projections and evaluations */
  double *atol;               /* 2 coords: absolute tolerances (pw_atol) */
  double *tolerance_bound;    /* 2 coords, from pw_kind.saturation; INFINITY: unbounded */
  double *matrix_state, *matrix_range; /* 2 coords: state at which the Newton matrix was evaluated, range around it
                                        * in which it is valid (pw_kind.saturation); only if the system `saturates` */
  int matrix_outdated;                 /* 1: a state reached since is outside that range */
  double *q_given, *v_given;           /* coords + 3: the values last given (opening, restart), not yet consistent */
  double *given_before;                /* 2 (coords + 3): those before a restart, which may be refused */
  unsigned char *origin;               /* 2 coords: of initial values, as in pw_system */
  int inconsistent;                    /* 1: these are left as they are given */
  pw_initial_report initial;
  unsigned long long identity; /* checkpoint_identity (run_open.c) */
  pw_statistics statistics;
  pw_step_counter counter; /* of fixed steps */
  pw_method_data *data;    /* private to the integrator */
  char *memory;            /* of the state, samples and scratch */
  pw_arena arena;          /* of redundant rows and specialised code */
};

/* Equations that are not enforced (events.h) have given multipliers.  These functions set and apply them. */

/* Sets the multipliers that are multiples of others. */
static inline void pw_couple (pw_run *r, const double *lambda) {
  for (const pw_coupling *c = r->coupling; c < r->coupling + r->couplings; c++)
    r->reaction[c->row] = -c->ratio * lambda[c->on];
}

/* f (coords + 3) += their forces, with the J last evaluated. */
static inline void pw_add_given_forces (struct pw_run *r, double *f) {
  if (r->update_given) r->update_given (r);
  pw_add_JT (r->w, r->reaction, f);
}

/* Sets their multipliers. */
static inline void pw_fill_given (struct pw_run *r, double *lambda) {
  if (r->update_given) r->update_given (r);
  for (int i = 0; i < r->s->rows; i++)
    if (!r->enforced[i]) lambda[i] = -r->reaction[i];
  for (const pw_coupling *c = r->coupling; c < r->coupling + r->couplings; c++)
    lambda[c->row] = c->ratio * lambda[c->on];
}

/* The unit of a velocity at a value: that of the scene; of a first-order state the value, but at least 1. */
static inline double pw_velocity_unit (const pw_run *r, int j, double value) {
  return j < r->s->mechanical ? pw_unit (r->s, j) / r->w->scale.time : fmax (1, fabs (value));
}

/* Absolute tolerance of a state, numbered as in pw_system_find_state: the user's atol, or rtol in units of the scene;
 * rtol of a first-order state, INFINITY of its integral. */
static inline double pw_atol (const pw_run *r, int state) {
  return r->atol[state];
}
/* Updates r->tolerance_bound, the bounds of tolerances due to saturating forces, and r->matrix_outdated at the state
 * reached, whose kinematics must be up to date (run.c). */
void pw_bound_tolerances (pw_run *r);
/* Change of a state (numbered as in pw_system_find_state) from the state reached over which a saturating force changes
 * by its own magnitude. */
double pw_saturation_range (const pw_run *r, int state);
/* Records the state at which the Newton matrix was evaluated; kinematics must be up to date there. */
void pw_matrix_evaluated (pw_run *r, const double *q, const double *v);
/* Tolerance of a state at a given value, for iterative methods.  It is bounded by the range in which a force saturates;
 * otherwise an iteration could converge to any value of the force. */
static inline double pw_tolerance (const pw_run *r, int state, double value) {
  return fmin (r->settings.rtol * fabs (value) + pw_atol (r, state), r->tolerance_bound[state]);
}

/* End of the next step of size h: the next multiple of h; or t_end or a breakpoint, if it is earlier, or later by up to
 * PW_STEP_LONGER h, so that no tiny step remains, in which round-off dominates multipliers; *whole: 1 if it is the
 * multiple.  Times within 1e-9 h of each other differ by round-off only. */
#define PW_STEP_LONGER 0.01
static inline double pw_step_end (const pw_run *r, double t_end, int *whole) {
  double h = r->settings.step, t1 = r->counter.base + (double)(r->counter.count + 1) * h,
         stop = t_end < r->breakpoint ? t_end : r->breakpoint;
  int is_before = t1 <= stop - PW_STEP_LONGER * h;
  *whole = is_before || fabs (t1 - stop) < 1e-9 * h;
  return is_before ? t1 : stop;
}
/* Counts a step to t1; after one that is not whole, steps are counted from t1. */
static inline void pw_count_step (pw_run *r, int whole, double t1) {
  r->counter.count++;
  if (!whole) r->counter = (pw_step_counter){ .base = t1 };
}

/* 1 if the run's stabilisation is of this kind. */
static inline int pw_stabilised_by (const pw_run *r, pw_stabilisation_kind kind) {
  return r->method->stabilisations[r->stabilisation].kind == kind;
}

/* The scaled residual from which on constraints are lost. */
static inline double pw_lost_residual (const pw_run *r) {
  return pw_stabilised_by (r, PW_UNSTABILISED) ? r->thresholds.lost_unstabilised : r->thresholds.lost;
}

/* Stabilisations of methods that integrate the accelerations. */
#define PW_ACCELERATION_STABILISATIONS                                                             \
  { "none", "accelerations only: the constraints drift", PW_UNSTABILISED }, {                      \
    "baumgarte", "feedback of the residuals into the accelerations (Baumgarte 1972)", PW_BAUMGARTE \
  }

/* Baumgarte's options, the same for all integrators. */
#define PW_BAUMGARTE_OPTION(NAME, ABOUT) \
  { .name = NAME, .with = "baumgarte", .value = 10, .domain = PW_NONNEGATIVE, .unit = "1/s", .about = ABOUT }
#define PW_BAUMGARTE_OPTIONS                                 \
  PW_BAUMGARTE_OPTION ("alpha", "damping of the residuals"), \
      PW_BAUMGARTE_OPTION ("beta", "stiffness of the position residuals")

/* Options of the projection; pw_projector_open_by_options reads all but `every`. */
#define PW_PROJECTION_OPTIONS                                                                         \
  { .name = "metric",                                                                                 \
    .with = "projection",                                                                             \
    .choices = pw_metrics,                                                                            \
    .about = "norm in which the correction is smallest: mass matrix, or identity (pseudo-inverse)" }, \
  {                                                                                                   \
    .name = "every", .with = "projection", .value = 1, .domain = PW_COUNT, .unit = "steps",           \
    .about = "steps from one projection to the next"                                                  \
  }
extern const char *const pw_metrics[];

/* Initial step size for methods that begin with order 1: the error h^2 / T^2 is a quarter of the tolerance; states that
 * saturating forces depend on change by at most r->tolerance_bound, unless that takes less than 1e-9 T. */
double pw_first_step (const pw_run *r);

/* Step size of an adaptive method below which steps vanish in the round-off of the time. */
static inline double pw_least_step (const pw_run *r) {
  return 16 * DBL_EPSILON * fmax (fabs (r->t), 1e-6 * r->w->scale.time);
}

/* Adds the name of r->w->failed, the last signal that failed, if any, to the error.  Returns status. */
int pw_run_annotate_error (const pw_run *r, int status, pw_error *error);

/* PW_INPUT if an element type leaves out a derivative that is not zero, so that results would be wrong: "USER NEEDS
 * it".  PW_METHOD if a signal fails; PW_RESOURCE. */
int pw_run_check_derivatives (pw_run *r, const char *user, const char *needs, pw_error *error);

/* Replaces the saddle, and the watchdog's, by one for the active rows with the J last evaluated; a saddle that cannot
 * be opened is NULL. */
int pw_run_open_saddle (pw_run *r, pw_error *error);

/* Evaluates accelerations, multipliers and the ledger's powers at the state reached, and calls pw_bound_tolerances.
 * PW_METHOD with the reason if that fails. */
int pw_run_evaluate (pw_run *r, pw_error *error);

/* After pw_run_evaluate at a regular state: restarts the watchdog there, and makes the independence of the active rows
 * the reference for later states. */
void pw_run_set_references (pw_run *r);

/* Finds the next discontinuity after the state reached, r->breakpoint. */
int pw_run_look_ahead (pw_run *r, pw_error *error);

/* Makes the norm of the accelerations at the state reached the reference level for later ones. */
void pw_run_set_reference_level (pw_run *r);

/* 1 if the saddle or the method could not be reopened: the run can only be closed.  PW_RESOURCE. */
int pw_run_has_no_method (const pw_run *r, pw_error *error);

/* Makes rows active that are independent at the state reached. */
int pw_run_select_rows (pw_run *r, pw_error *error);

/* Opens the saddle and the method anew at the state reached, where J is evaluated. */
int pw_run_renew (pw_run *r, pw_error *error);
/* Restarts the method if a discontinuity of a signal has been reached. */
int pw_run_settle (pw_run *r, pw_error *error);
/* Stores the sample at t as a row of pw_run_record (bindings.c). */
int pw_record_row (pw_run *r, double t, double *row, pw_error *error);

/* Advice where wheels lock, that is where the equation of a row contradicts others; "" if the row is not of a wheel. */
static inline const char *pw_advice_on_wheel (const pw_system *s, int row) {
  return pw_system_element (s, pw_system_row_element (s, row)).kind->contact
             ? "; wheels that slip sideways are of type tyre"
             : "";
}

/* The length of q, v, a and lambda of a state together. */
static inline size_t pw_state_length (const pw_system *s) {
  return 3 * ((size_t)s->coords + 3) + (size_t)s->rows;
}

static inline int pw_fail_signal (double t, pw_error *error) {
  return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
}

/* Two numbers at once (GNU C), at any address of a double. */
typedef double pw_pair __attribute__ ((vector_size (16), aligned (8), may_alias));
#define PW_PAIR(x, i) (*(const pw_pair *)((x) + (i)))

/* 1 if no number of a state is NaN, infinite, or so large (1e150) that its square nearly overflows. */
static inline int pw_is_finite_state (const pw_run *r, const double *q, const double *v) {
  const int n = r->s->coords;
  pw_pair sum = { n % 2 ? q[n - 1] * q[n - 1] + v[n - 1] * v[n - 1] : 0 };
  for (int j = 0; j + 1 < n; j += 2) sum += PW_PAIR (q, j) * PW_PAIR (q, j) + PW_PAIR (v, j) * PW_PAIR (v, j);
  return sum[0] + sum[1] < 1e300;
}

/* Updates kinematics and evaluates J at a state; returns as pw_update_kinematics. */
static inline int pw_evaluate_J_at (pw_workspace *w, double t, const double *q, const double *v) {
  int status = pw_update_kinematics (w, t, q, v);
  if (status == PW_OK) pw_evaluate_J (w);
  return status;
}

/* to += factor * from, two numbers at a time */
static inline void pw_add_scaled (double *restrict to, const double *restrict from, double factor, int n) {
  int i = 0;
  for (; i + 1 < n; i += 2) *(pw_pair *)(to + i) = PW_PAIR (to, i) + factor * PW_PAIR (from, i);
  if (i < n) to[i] += factor * from[i];
}

/* Norm of the accelerations at the state reached, in units of L / T^2 (watchdog.c). */
double pw_run_acceleration_norm (const pw_run *r);
/* Checks the state reached, where kinematics and J must be up to date.  PW_METHOD if constraints are lost or contradict
 * each other, if the motion has jumped to another branch, or does not resolve a change point; PW_RESOURCE. */
int pw_run_watchdog (pw_run *r, pw_error *error);

/* 1 if the caller requests a stop, or has done so since r->stopped, which this sets, was last cleared. */
static inline int pw_run_stop_requested (pw_run *r) {
  if (r->settings.stop && r->settings.stop (r->settings.stop_context)) r->stopped = 1;
  return r->stopped;
}

/* 1 if searching for consistent initial values and independent equations takes a noticeable time. */
static inline int pw_is_large (const pw_system *s) {
  return (double)s->rows * s->coords >= 1e4;
}

/* pw_run_stop_requested while the run is opened, if its scene is large. */
static inline int pw_run_stop_opening (pw_run *r) {
  return pw_is_large (r->s) && pw_run_stop_requested (r);
}

/* Before each attempted step: PW_OK; PW_STOPPED if the caller requests it; PW_METHOD at max_steps, if adaptive. */
int pw_run_check_limits (pw_run *r, pw_error *error);

/* Steps between checks of coordinates and records of energies; at most as many are made in one call of specialised
 * code. */
enum { PW_CHECK_INTERVAL = 16 };

/* After each step: records speeds; PW_METHOD if coordinates are too large for double precision to resolve the scene. */
int pw_run_check_resolution (pw_run *r, pw_error *error);

/* Kinetic and potential energy [J] at the velocities v; kinematics must be up to date. */
static inline double pw_energy (const pw_run *r, const double *v) {
  return pw_kinetic (r->s, v) + pw_potential (r->w);
}

/* Record the energies of the initial state, and of the state reached; kinematics must be up to date. */
void pw_ledger_begin (pw_run *r);
void pw_ledger_record (pw_run *r);

/* pw_ledger_rates with integrals, or where multipliers are not unique. */
void pw_ledger_all_rates (pw_run *r, const double *lambda, double *rate);

/* Powers of the ledger's entries [W], and integrands, from the multipliers of the active rows, where kinematics are up
 * to date and J is evaluated.  Work is divided between redundant drives like their least-norm reactions. */
static inline void pw_ledger_rates (pw_run *r, const double *lambda, double *rate) {
  if (r->redundant_drive || r->settings.integrals)
    pw_ledger_all_rates (r, lambda, rate);
  else
    pw_evaluate_ledger (r->w, lambda, rate);
}

/* 1 if work, losses or integrals may depend on multipliers. */
int pw_ledger_uses_multipliers (const pw_run *r);

/* Tolerance of the total work and loss of a step of size h [J]: 5 rtol (5 atol / max (L, 1), if larger) times the
 * largest of r->scene_energy, r->exchanged and the work and losses so far, at most those of a time T; plus round-off.
 * DBL_MAX if that is zero or not finite. */
double pw_ledger_tolerance (const pw_run *r, double h);
/* The norm of a change of the entries in a step of size h, such as its error, in tolerances; that of an integral is 5
 * rtol times the largest integrand so far, times T, plus round-off. */
double pw_ledger_norm (const pw_run *r, double h, const double *change);

/* t, or just before the breakpoint if t is not before it: steps that end at a discontinuity evaluate signals there. */
static inline double pw_before_breakpoint (const pw_run *r, double t) {
  return t < r->breakpoint ? t : nextafter (r->breakpoint, -INFINITY);
}

/* gamma, less Baumgarte's terms if selected (dynamics.c), at the state for which kinematics are up to date and J is
 * evaluated. */
void pw_run_gamma (pw_run *r, const double *v, double *gamma);

/* As pw_run_accelerate, at the state for which kinematics are up to date, J is evaluated and the saddle factorised. */
void pw_run_accelerate_updated (pw_run *r, const double *v, double *a, double *lambda);

/* The same, but factorises the saddle.  Returns as pw_run_accelerate, but does not set r->near_singular. */
int pw_run_accelerate_evaluated (pw_run *r, const double *v, double *a, double *lambda);
/* The same with gamma, evaluated with J, in the array of lambda. */
int pw_run_accelerate_by_gamma (pw_run *r, const double *v, double *a, double *lambda);

/* Makes the state reached the sample; updates kinematics and J there. */
void pw_sample_reached (pw_run *r);

/* Reports why the J last evaluated is unusable at time t: rank lost or nearly lost, or values too extreme
 * (dynamics.c).  PW_METHOD. */
int pw_fail_singular (pw_run *r, double t, pw_error *error);

/* Completes r->residuals at the state just evaluated, some of which a projection may have computed, and updates the
 * worst ones in the statistics. */
void pw_record_residuals (pw_run *r);
static inline void pw_forget_residuals (pw_run *r) {
  r->residuals.position = r->residuals.velocity = NAN;
}

/* Scaled residuals: the round-off of the few terms of a row, to which an iteration converges; the largest that is
 * accepted where it stalls, times the largest angle before the iteration. */
#define PW_RESIDUAL_CONVERGED (4 * DBL_EPSILON)
#define PW_RESIDUAL_ACCEPTED (64 * DBL_EPSILON)
/* The largest angle of a body, at least 1 rad: where no body with mass can take up the residual of a joint, its scaled
 * residual cannot be smaller than the round-off of that angle. */
double pw_largest_angle (const pw_system *s, const double *q);

typedef struct {
  pw_saddle *position;         /* of the metric of positions and the holonomic rows; or the run's saddle */
  int owns_position;           /* 1: position is not the run's saddle */
  pw_saddle *velocity;         /* of the metric of velocities and all rows */
  int owns_velocity;           /* 1: velocity is not the run's saddle, since its metric was given */
  int iterations;              /* of the last projection of positions */
  const unsigned char *active; /* rows that are enforced; NULL: all */
  int ignores_inactive;        /* 1: the residuals of the other rows are not checked */
  int contradictory_row;       /* redundant row that is violated after it, or -1 */
} pw_projector;

/* Position metric `weight_q` and velocity metric `weight_v` (NULL: the mass matrix).  J must be evaluated at a typical
 * configuration.  Returns PW_OK or PW_RESOURCE; the error then has the status of pw_saddle_open. */
int pw_projector_open (pw_projector *p, pw_run *r, const double *weight_q, const double *weight_v, pw_error *error);
/* The same with the metric of the method's options. */
int pw_projector_open_by_options (pw_projector *p, pw_run *r, pw_error *error);
void pw_projector_close (pw_projector *p);

/* Gauss-Newton iteration on g(q) = 0 to round-off, minimal changes in the metric.  Leaves kinematics and J evaluated at
 * (t, q, v) and, if all rows are enforced, the residuals of positions in r->residuals.  PW_RETRY if it does not
 * converge (contradictory_row: -1), or if a redundant equation contradicts the others; PW_METHOD if a signal failed. */
int pw_project_positions (pw_projector *p, pw_run *r, double t, double *q, const double *v);

/* A linear solve for J v = eta at the current configuration, near a singular one two; updates the velocity kinematics.
 * PW_RETRY if singular; PW_METHOD if a signal that depends on velocities failed. */
int pw_project_velocities (pw_projector *p, pw_run *r, double *v);

/* Both, then accelerations and multipliers of the projected state, with the run's saddle factorised there.
 * Velocities that satisfy J v = eta to round-off may stay unchanged.  *added_energy, unless it is NULL, grows by the
 * energy [J] that the projection adds. */
int pw_project_state (pw_projector *p, pw_run *r, double t, double *q, double *v, double *a, double *lambda,
                      double *added_energy);

/* Removes from an error e of positions or velocities the part that a projection onto the first `rows` equations
 * removes, in the metric of `saddle` (all rows), which must be factorised at the current configuration. */
void pw_project_error (pw_run *r, pw_saddle *saddle, double *e, int rows);

/* Opens the settings' specialised code, if any; the scales, alpha and beta must be known.  Errors: PW_INPUT,
 * PW_RESOURCE. */
int pw_specialised_open (pw_run *r, pw_error *error);
/* Uses it if it has the run's independent equations. */
void pw_specialised_select (pw_run *r);

/* As pw_project_state, if specialised code can do it: 1; 0 if not. */
int pw_specialised_project (const pw_projector *p, pw_run *r, double t, double *q, double *v, double *a,
                            double *lambda);
/* The stages of a step, if specialised code can evaluate all of them: 1; 0 if not.  Kinematics and J are not
 * updated. */
int pw_specialised_stages (pw_run *r, const struct pw_scene_step *x);
/* 1 if specialised code may be called for the run's next evaluation; it can still refuse the state.  0 also where a
 * singular configuration may be ahead and steps are fixed: the general functions then compute the sine of every stage.
 * Adaptive methods need it only below the pivots that the specialised code accepts. */
static inline int pw_specialised_suits (const pw_run *r) {
  const pw_watchdog *watch = &r->watchdog;
  return r->specialised && !r->redundant_drive && !(watch->singular_ahead && watch->saddle && r->fixed_steps) &&
         !r->near_singular && !r->w->hold;
}
/* Adds to the statistics: evaluations, and iterations of projections, of specialised code. */
void pw_specialised_count (pw_run *r, long evaluations, long iterations);

/* Opens r->resolution (resolution.c), the longest step in which signals are seen, at the initial state, whose
 * kinematics must be up to date; it stays NULL where no signal needs it. */
int pw_resolution_open (pw_run *r, pw_error *error);
/* The time at which the next adaptive step must end at the latest; INFINITY with fixed steps, which are counted if they
 * do not resolve a signal.  Sets r->resolved_until, which is INFINITY before. */
double pw_resolution_end (pw_run *r);

/* As pw_run_open, with the initial state as it is given, for evaluations at other ones. */
pw_run *pw_run_open_inconsistent (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error);
/* Makes r->q, r->v consistent at r->t and fills the report; origin (or NULL): origins of states, of which those given
 * or specified are kept if possible.  Errors: PW_INITIAL, PW_RESOURCE; PW_METHOD if a signal failed. */
int pw_run_make_consistent (pw_run *r, const unsigned char *origin, pw_error *error);
/* Counts in the report the states that differ from the given ones; needs the scales. */
void pw_run_count_moved (pw_run *r);

#endif
