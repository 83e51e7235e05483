/* Internals of a run, shared by the integrators.  For solvers/ only. */
#ifndef PW_METHOD_H
#define PW_METHOD_H

#include <float.h>
#include <math.h>
#include "pinwheel-method.h"
#include "saddle.h"
#include "system.h"
#include "watchdog.h"

enum { PW_MAX_OPTIONS = 12 };

struct pw_scene_step;

struct pw_run {
  const pw_system *s;
  pw_workspace *w;
  const pw_method *method;
  int stabilisation;             /* index in method->stabilisations */
  double option[PW_MAX_OPTIONS]; /* one per method->options */
  pw_settings settings;
  int fixed_steps;             /* 1: fixed step size */
  pw_saddle *saddle;           /* mass matrix, all constraint equations: accelerations, impulses */
  const unsigned char *active; /* rows: 0 for redundant ones; NULL: none is redundant */
  int redundant;               /* number of redundant rows; the following only if there are any */
  int redundant_moves;         /* 1: one of them has an eta, so that work depends on its multiplier */
  int *redundant_row;          /* redundant: their indices */
  unsigned char *independent;  /* rows: the run's own `active` */
  double *coefficient;         /* redundant x rows: each redundant row as a combination of active rows */
  double *normal;              /* redundant x (redundant + 1): normal equations of least-norm multipliers */
  double *row_force, *zero;    /* coords + 3, rows: right-hand sides */
  double *least_norm;          /* rows: least-norm multipliers for the ledger */
  char *rank_memory;
  double independence;                      /* of the active rows at the state reached (rank.h) */
  double reselect_below;                    /* independence below which other rows are tried */
  const struct pw_specialised *specialised; /* compiled code of the scene in use, or NULL */
  struct pw_scene *scene;                   /* data of that code */
  char *scene_memory;
  int scene_ready;        /* 1: its constants have been computed */
  pw_thresholds limits;   /* thresholds */
  pw_geometry geometry;   /* distance of the constraints from a singular configuration */
  double refuse;          /* sine at which an evaluation is refused */
  int near_singular;      /* 1 after an evaluation near a singular configuration */
  double reference_level; /* largest acceleration norm away from singular configurations, in units of L / T^2; >= 1 */
  double previous_norm;   /* acceleration norm of the last such state */
  int differentiates;     /* 1: the method uses the derivatives of the equations (tangent.h) */
  double alpha, beta;     /* Baumgarte's, used by pw_run_accelerate; 0: none */
  double breakpoint;      /* first discontinuity of a signal after t */
  int stalled;            /* consecutive steps that did not advance */
  pw_residuals residuals; /* of the state reached; NaN: not computed */

  /* The state reached, always with its accelerations and multipliers. */
  double t;
  double *q, *v, *a; /* coords + 3 each */
  double *lambda;    /* rows; contiguous with q, v, a: pw_state_length numbers */
  double *ledger;    /* entries: work and losses up to t */
  double *rate;      /* entries: powers at t */
  double projected;  /* energy added by projections up to t; only with settings.ledger */

  /* The state requested from pw_run_sample. */
  double *q_at, *v_at, *a_at, *lambda_at, *ledger_at; /* same layout */
  double projected_at;

  int stopped;     /* 1: settings.stop requested it */
  int interrupted; /* 1: inside a step of SUNDIALS, which must be restarted */
  double mark_time,
      mark_speed; /* last record of the largest speed: elapsed time [s], doubled each time; speed (limits.c) */
  double before_time, before_speed; /* the same of the record before */

  double energy0, potential0; /* initial kinetic + potential energy; initial potential energy */
  double exchanged;           /* the largest kinetic energy or change of potential energy so far (ledger.c) */
  double power;               /* the largest sum of the ledger's rates so far */
  double energy_scene; /* kinetic energy at the velocities L and 1 rad per span; for a massless scene see ledger.c */
  double *scratch;     /* 2 (coords + 3) + 3 rows, for projections and evaluations */
  double *saturation;  /* 2 coords: upper bounds of tolerances; INFINITY: unbounded */
  double *matrix_state, *matrix_range; /* 2 coords: state at which the Newton matrix was evaluated; its
                                           valid range; only if the system `saturates` */
  int outdated;                        /* 1: the state reached is outside that range */
  double *q_given, *v_given;
  unsigned char *origin; /* 2 coords: of initial values, as in pw_system */
  pw_initial_report initial;
  pw_statistics statistics;
  pw_method_data *data; /* private to the integrator */
  char *memory;
};

/* Absolute tolerance of a state, numbered as in pw_system_find_state: the user's atol, or rtol in units of the
 * scene. */
static inline double pw_atol (const pw_run *r, int state) {
  const int n = r->s->coords;
  if (r->settings.atol > 0) return r->settings.atol;
  double atol = r->settings.rtol * pw_unit (r->s, state < n ? state : state - n);
  return state < n ? atol : atol / r->w->scale.time;
}
/* Updates r->saturation, the change of state that reverses a saturating force, and r->outdated, at the state
 * reached, whose kinematics must be up to date (tolerances.c). */
void pw_bound_tolerances (pw_run *r);
/* Change of a state (numbered as in pw_system_find_state) from the state reached that reverses a force. */
double pw_saturation_range (const pw_run *r, int state);
/* Records the state at which the Newton matrix was evaluated; kinematics must be up to date there. */
void pw_matrix_evaluated (pw_run *r, const double *q, const double *v);
/* Tolerance of a state at a given value, for iterative methods.  It is bounded by the range in which a force saturates;
 * otherwise an iteration could converge to any value of the force. */
static inline double pw_tolerance (const pw_run *r, int state, double value) {
  return fmin (r->settings.rtol * fabs (value) + pw_atol (r, state), r->saturation[state]);
}
/* 1 if the step size is fixed. */
static inline int pw_fixed_steps (const pw_run *r) {
  return r->fixed_steps;
}
/* End of the next fixed-size step, `count` steps after the time `base`: a multiple of the size, t_end or a breakpoint,
 * whichever is first; *whole = 1 for the first.  Times within 1e-9 h of each other differ by round-off only. */
static inline double pw_step_end (const pw_run *r, double base, long count, double t_end, int *whole) {
  double h = r->settings.step, t1 = base + (double)(count + 1) * h,
         stop = t_end < r->breakpoint ? t_end : r->breakpoint;
  *whole = t1 < stop + 1e-9 * h;
  return t1 > stop - 1e-9 * h ? stop : t1;
}
/* 1 if the run's stabilisation is of this kind. */
static inline int pw_stabilised_by (const pw_run *r, pw_stabilisation_kind kind) {
  return r->method->stabilisations[r->stabilisation].kind == kind;
}

/* Stabilisations of methods that integrate the accelerations. */
#define PW_ACCELERATION_STABILISATIONS                                                             \
  { "none", "accelerations only: the constraints drift", PW_UNSTABILISED }, {                      \
    "baumgarte", "feedback of the residuals into the accelerations (Baumgarte 1972)", PW_BAUMGARTE \
  }

/* Baumgarte's options, the same for all integrators. */
#define PW_BAUMGARTE_OPTIONS                                                                   \
  { .name = "alpha",                                                                           \
    .with = "baumgarte",                                                                       \
    .value = 10,                                                                               \
    .domain = PW_NONNEGATIVE,                                                                  \
    .unit = "1/s",                                                                             \
    .about = "damping of the residuals" },                                                     \
  {                                                                                            \
    .name = "beta", .with = "baumgarte", .value = 10, .domain = PW_NONNEGATIVE, .unit = "1/s", \
    .about = "stiffness of the position residuals"                                             \
  }

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
 * saturating forces depend on change by at most their tolerance, unless that takes less than 1e-9 T. */
double pw_first_step (const pw_run *r);

/* ---- Parts of opening and advancing a run (run.c) ---- */

/* Adds the name of the signal that failed in the last attempted step, if any, to the error.  Returns status. */
int pw_run_annotate_error (const pw_run *r, int status, pw_error *error);

/* Replaces the saddle by one for the active rows.  PW_OK or PW_RESOURCE. */
int pw_run_open_saddle (pw_run *r, pw_error *error);

/* Evaluates accelerations, multipliers and the ledger's powers at the state reached; errors contain the reason. */
int pw_run_evaluate (pw_run *r, pw_error *error);

/* Sets the reference values of the watchdog at the state reached, which must be regular. */
void pw_run_set_references (pw_run *r);

/* Finds the next discontinuity after the state reached. */
int pw_run_look_ahead (pw_run *r, pw_error *error);

/* Makes the accelerations of this state the reference level for later ones. */
void pw_run_set_reference_level (pw_run *r);

/* Plans the linear algebra at the state reached, where J is evaluated, and reopens the method.  fresh: reference
 * pivots are those of this state; otherwise they are unchanged. */
int pw_run_renew (pw_run *r, int fresh, pw_error *error);

/* Numbers in q, v, a and lambda of a state. */
static inline size_t pw_state_length (const pw_system *s) {
  return 3 * ((size_t)s->coords + 3) + (size_t)s->rows;
}

static inline int pw_fail_memory (const pw_system *s, pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
}
static inline int pw_fail_signal (double t, pw_error *error) {
  return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
}

/* Updates kinematics and evaluates J at a state; returns as pw_update_kinematics. */
static inline int pw_evaluate_J_at (pw_workspace *w, double t, const double *q, const double *v) {
  int status = pw_update_kinematics (w, t, q, v);
  if (status == PW_OK) pw_evaluate_J (w);
  return status;
}

/* The larger of two values; NaN if either is NaN, unlike pw_larger. */
static inline double pw_larger_or_nan (double most, double x) {
  return x > most || isnan (x) ? x : most;
}

/* Norm of the accelerations at the state reached, in units of L / T^2 (watchdog.c). */
double pw_run_acceleration_norm (const pw_run *r);
/* Checks the state reached.  PW_METHOD if constraints are lost or contradict each other, or if the motion has jumped to
 * another branch. */
int pw_run_watchdog (pw_run *r, pw_error *error);

/* ---- Limits (limits.c) ---- */

/* 1 if the caller requests a stop. */
static inline int pw_run_stop_requested (pw_run *r) {
  if (r->settings.stop && r->settings.stop (r->settings.stop_context)) r->stopped = 1;
  return r->stopped;
}

/* Before each attempted step: PW_OK; PW_STOPPED if the caller requests it; PW_METHOD at max_steps. */
int pw_run_check_limits (pw_run *r, pw_error *error);

/* Steps between checks of coordinates and records of energies; at most as many are made in one call of specialised
 * code. */
enum { PW_CHECK_INTERVAL = 16 };

/* After each step: records speeds; PW_METHOD if coordinates are too large for double precision to resolve the scene. */
int pw_run_check_resolution (pw_run *r, pw_error *error);

/* ---- Energy (ledger.c) ---- */

/* Record the initial energies, and those of the state reached; kinematics must be up to date. */
void pw_ledger_begin (pw_run *r);
void pw_ledger_note (pw_run *r);

/* Powers of the ledger's entries [W] from the multipliers of the active rows, where kinematics are up to date and J is
 * evaluated.  Work is divided between redundant drives like their least-norm reactions. */
void pw_ledger_rates (pw_run *r, const double *lambda, double *rate);

/* 1 if work or losses depend on multipliers. */
int pw_ledger_reacts (const pw_system *s);

/* Tolerance of the total work and loss of a step of size h [J]: rtol times the energy exchanged so far, at least
 * that of the scene at L per span; not below the round-off of their rates. */
double pw_ledger_tolerance (const pw_run *r, double h);

/* ---- Dynamics ---- */

/* pw_run_accelerate leaves J evaluated and the saddle factorised. */

/* A step that ends at a discontinuity evaluates signals just before it. */
static inline double pw_before_breakpoint (const pw_run *r, double t) {
  return t < r->breakpoint ? t : nextafter (r->breakpoint, -INFINITY);
}

/* pw_run_accelerate where J is evaluated and the saddle factorised at this configuration, and velocities are up to
 * date. */
void pw_run_accelerate_updated (pw_run *r, const double *v, double *a, double *lambda);

/* The same where the saddle is not factorised. */
int pw_run_accelerate_evaluated (pw_run *r, const double *v, double *a, double *lambda);

/* Copies the state reached to the sample arrays; updates kinematics and J there. */
void pw_show_reached (pw_run *r);

/* Reports why the J last evaluated is unusable at time t: rank lost or nearly lost, or values too extreme
 * (singular.c). */
int pw_fail_singular (pw_run *r, double t, pw_error *error);

/* Adds the residuals of the state just evaluated to r->residuals and the statistics; those that a projection has
 * computed are reused. */
void pw_note_residuals (pw_run *r);
static inline void pw_forget_residuals (pw_run *r) {
  r->residuals.position = r->residuals.velocity = NAN;
}

/* ---- Projection ---- */

/* Scaled residuals to which an iteration converges, the round-off of the few terms of a row; accepted where it
 * stalls. */
#define PW_RESIDUAL_GOOD (4 * DBL_EPSILON)
#define PW_RESIDUAL_ENOUGH (64 * DBL_EPSILON)

typedef struct {
  pw_saddle *position;         /* position metric, holonomic rows; or the run's saddle */
  int owns_position;           /* 1: position is not the run's saddle */
  pw_saddle *velocity;         /* velocity metric, all rows */
  int owns_velocity;           /* 1: velocity is not the run's saddle */
  int iterations;              /* of the last position projection */
  const unsigned char *active; /* rows that are enforced; NULL: all */
  int ignores_inactive;        /* 1: inactive rows are not checked */
  int mass_metric;             /* 1: both metrics are the mass matrix */
  int worst_row;               /* row with the largest residual in the last position projection */
  int contradicting_row;       /* redundant row violated after it, or -1 */
} pw_projector;

/* Position metric `weight_q` and velocity metric `weight_v` (NULL: the mass matrix).  J must be evaluated at a typical
 * configuration. */
int pw_projector_open (pw_projector *p, pw_run *r, const double *weight_q, const double *weight_v, pw_error *error);
/* The same with the metric of the method's options. */
int pw_projector_open_by_options (pw_projector *p, pw_run *r, pw_error *error);
void pw_projector_close (pw_projector *p);

/* Gauss-Newton iteration on g(q) = 0 to round-off, minimal changes in the metric.  Leaves kinematics and J evaluated at
 * (t, q, v).  PW_RETRY if it does not converge, or if a redundant equation contradicts the others. */
int pw_project_positions (pw_projector *p, pw_run *r, double t, double *q, const double *v);

/* A linear solve for J v = eta at the current configuration, near a singular one two; updates the velocity kinematics.
 * PW_RETRY if singular; PW_METHOD if a signal that depends on velocities failed. */
int pw_project_velocities (pw_projector *p, pw_run *r, double *v);

/* Both, then accelerations and multipliers of the projected state, with the run's saddle factorised there.
 * Velocities that satisfy J v = eta to round-off may stay unchanged. */
int pw_project_state (pw_projector *p, pw_run *r, double t, double *q, double *v, double *a, double *lambda);

/* Removes from an error of positions or velocities the part that a projection onto the first `rows` equations
 * removes, in the metric of `saddle` (all rows), which must be factorised at the current configuration. */
void pw_project_error (pw_run *r, pw_saddle *saddle, double *e, int rows);

/* ---- Specialised code (specialised.c) ---- */

/* Opens the settings' specialised code, if any.  Errors: PW_INPUT, PW_RESOURCE. */
int pw_specialised_open (pw_run *r, pw_error *error);
/* Uses it if it has the run's independent equations. */
void pw_specialised_select (pw_run *r);

/* As pw_run_accelerate and pw_project_state, if specialised code can do it: 1; 0 if not. */
int pw_specialised_evaluate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda);
int pw_specialised_project (const pw_projector *p, pw_run *r, double t, double *q, double *v, double *a,
                            double *lambda);
/* The stages of a step, if specialised code can evaluate all of them: 1; 0 if not.  Kinematics and J are not
 * updated. */
int pw_specialised_stages (pw_run *r, const struct pw_scene_step *x);
/* Residuals of the state reached, unless they are known or the general engine has to evaluate them. */
void pw_specialised_residuals (pw_run *r);

/* 1 if specialised code may do the run's next evaluation. */
int pw_specialised_suits (const pw_run *r);
/* Passes the scales of residuals to specialised code. */
void pw_specialised_scale (pw_run *r);
/* Adds to the statistics: evaluations, and iterations of projections, of specialised code. */
void pw_specialised_count (pw_run *r, long evaluations, long iterations);

/* ---- Initial conditions ---- */

/* Makes r->q, r->v consistent at r->t and fills the report; origin (or NULL): origins of states, of which those given
 * or specified are kept if possible.  Errors: PW_INITIAL. */
int pw_run_make_consistent (pw_run *r, const unsigned char *origin, pw_error *error);
/* Counts the states that moved, in the report; needs the scales. */
void pw_run_count_moved (pw_run *r);

#endif
