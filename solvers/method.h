/* A run from inside: what the integrators share.  For solvers/ only. */
#ifndef PW_METHOD_H
#define PW_METHOD_H

#include <math.h>
#include "pinwheel-method.h"
#include "saddle.h"
#include "system.h"
#include "watchdog.h"

enum { PW_MAX_OPTIONS = 12 };

struct pw_run {
  const pw_system *s;
  pw_workspace *w;
  const pw_method *method;
  int stabilisation;             /* index in method->stabilisations */
  double option[PW_MAX_OPTIONS]; /* one per method->options */
  pw_settings settings;
  int fixed_steps;             /* 1: steps of the given size */
  pw_saddle *saddle;           /* with the mass matrix and all rows: accelerations, impulses */
  const unsigned char *active; /* rows: 0 for the redundant ones; NULL: there are none */
  int redundant;               /* how many */
  int *redundant_row;          /* which */
  double *coefficient;         /* redundant x rows: of the active rows in each; then scratch */
  double *shared;              /* rows: least-norm multipliers for the ledger; NULL: no redundant row moves */
  char *rank_memory;
  double grip, reselect; /* of the active rows at the state reached (rank.h); below this others are tried */
  pw_watchdog limits;    /* its thresholds */
  pw_geometry geometry;  /* how near the constraints are to a singular configuration */
  double refuse;         /* sine at which an evaluation is refused */
  int near;              /* 1 as soon as one was near a singular configuration */
  double
      reference_level; /* the largest accelerations away from singular configurations, in units of L / T^2; at least 1 */
  double before;       /* those of the last state away from them */
  int differentiates;  /* 1: the method uses the derivatives of the equations (tangent.h) */
  double alpha, beta;  /* Baumgarte's, used by pw_run_accelerate; 0: none */
  double breakpoint;   /* first discontinuity of a signal after t */
  int stuck;           /* steps in a row that were as good as none */
  pw_residuals known;  /* of the state reached; NaN: not known */

  /* the state reached: always with its accelerations and multipliers */
  double t;
  double *q, *v, *a; /* coords + 3 each */
  double *lambda;    /* rows; one block, from q on */
  double *ledger;    /* entries: work and losses up to t */
  double *rate;      /* entries: their rates at t */
  double projected;  /* energy added by projections up to t; only counted with settings.ledger */

  /* the state asked for by pw_run_sample */
  double t_at;
  double *q_at, *v_at, *a_at, *lambda_at, *ledger_at; /* the same block, from q_at on */
  double projected_at;

  int stopped;     /* 1: settings.stop has asked for it */
  int interrupted; /* 1: inside a step of SUNDIALS, which has to start anew */
  double marked,
      mark; /* time since the start at which speeds were looked at, doubled each time [s]; the largest there */
  double earlier, speed; /* the same of the time before */

  double energy0, potential0; /* kinetic + potential at the start; potential */
  double exchanged;           /* the largest kinetic energy so far, or change of the potential (ledger.c) */
  double power;               /* the largest sum of the ledger's rates so far */
  double
      energy_scene; /* kinetic energy at the velocities L and 1 rad per span; of a massless scene what stands for it */
  double *scratch;  /* 2 (coords + 3) + 3 rows */
  double *saturation;                  /* 2 coords: tolerances are not above; INFINITY: any */
  double *matrix_state, *matrix_range; /* 2 coords: where the Newton matrix was evaluated; how far it serves */
  int outdated;                        /* 1: the state reached is farther */
  double *q_given, *v_given;
  pw_initial_report start;
  pw_statistics statistics;
  pw_method_data *data; /* the integrator's own */
  char *memory;
};

/* Absolute tolerances of coordinate j and of its rate: the one the user gave, or rtol in units of the scene. */
static inline double pw_atol (const pw_run *r, int j) {
  return r->settings.atol > 0 ? r->settings.atol : r->settings.rtol * pw_unit (r->s, j);
}
static inline double pw_atol_velocity (const pw_run *r, int j) {
  return r->settings.atol > 0 ? r->settings.atol : r->settings.rtol * pw_unit (r->s, j) / r->w->scale.time;
}
/* Takes over how small a change of the state reached, which is placed, reverses a force that saturates; and notes whether the
 * Newton matrix is `outdated` by it (tolerances.c). */
void pw_bound_tolerances (pw_run *r);
/* By how much a state (as pw_system_find_state numbers them) may change from the state reached until a force reverses. */
double pw_saturation_range (const pw_run *r, int state);
/* The Newton matrix is that of this state, which is placed. */
void pw_matrix_evaluated (pw_run *r, const double *q, const double *v);
/* The tolerances of coordinate j and of its velocity at a value, for methods that iterate: not above what a force saturates
 * within, or an iteration would end anywhere between the force and its opposite. */
static inline double pw_tolerance (const pw_run *r, int j, double q) {
  return fmin (r->settings.rtol * fabs (q) + pw_atol (r, j), r->saturation[j]);
}
static inline double pw_tolerance_velocity (const pw_run *r, int j, double v) {
  return fmin (r->settings.rtol * fabs (v) + pw_atol_velocity (r, j), r->saturation[r->s->coords + j]);
}
/* 1 if the run takes steps of the given size. */
static inline int pw_fixed_steps (const pw_run *r) {
  return r->fixed_steps;
}
/* The end of the next step of the given size, `count` of which were taken since the time `base`: a multiple of the size,
 * t_end or a breakpoint, whichever is first; *whole: the first. */
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

/* Baumgarte's options, the same for all integrators that have them, and their way into r->alpha and r->beta. */
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
void pw_read_baumgarte (pw_run *r);

/* Those of the projection, read by pw_projector_open_asked, but for `every`. */
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

/* A first step for methods that begin with order 1: its error, h^2 / T^2, is at the tolerance; no state moves by more than its
 * tolerance beside a force that saturates. */
double pw_first_step (const pw_run *r);

/* Plans the linear algebra at the state reached, where J is swept, and opens the method there.  fresh: what a small pivot
 * is follows from those here; else it stays what it was. */
int pw_run_renew (pw_run *r, int fresh, pw_error *error);

/* The largest of the sizes so far and another one; no number once one of them is none. */
static inline double pw_largest (double most, double x) {
  return x > most || isnan (x) ? x : most;
}

/* The size of the accelerations at the state reached, in units of L / T^2 (branch.c). */
double pw_run_acceleration_norm (const pw_run *r);
/* Looks at the state reached.  PW_METHOD if constraints are lost or contradict each other, or if the motion has jumped to
 * another branch. */
int pw_run_watchdog (pw_run *r, pw_error *error);

/* ---- Limits (limits.c) ---- */

/* 1 if the caller asks the run to stop. */
static inline int pw_run_asked (pw_run *r) {
  if (r->settings.stop && r->settings.stop (r->settings.stop_context)) r->stopped = 1;
  return r->stopped;
}

/* Before each attempted step: PW_OK; PW_STOPPED if the caller asks for it; PW_METHOD after too many. */
int pw_run_attempt (pw_run *r, pw_error *error);

/* After each step: PW_METHOD if the run has led so far away that numbers no longer resolve the scene; marks speeds. */
int pw_run_resolve (pw_run *r, pw_error *error);

/* ---- Energy (ledger.c) ---- */

/* The energies of the start, which is placed, and takes note of those of the state reached, which is placed. */
void pw_ledger_begin (pw_run *r);
void pw_ledger_note (pw_run *r);

/* Rates of the ledger's entries [W] from the active rows' multipliers, at the state in place, where J is evaluated.
 * Redundant drives share their work as they share their reactions. */
void pw_ledger_rates (pw_run *r, const double *lambda, double *rate);

/* 1 if work or losses follow from multipliers. */
int pw_ledger_reacts (const pw_system *s);

/* What a step of size h may leave of error in all work and losses together [J]: rtol times the energy that has been
 * exchanged so far, at least that of the scene at L per span; not below the round-off of their rates. */
double pw_ledger_tolerance (const pw_run *r, double h);

/* ---- Dynamics ---- */

/* pw_run_accelerate leaves J swept and the saddle factorised. */

/* A step that ends at a discontinuity sees what the signals are just before it. */
static inline double pw_before_breakpoint (const pw_run *r, double t) {
  return t < r->breakpoint ? t : nextafter (r->breakpoint, -INFINITY);
}

/* The same where J is swept and the saddle factorised at this configuration, and the rates are placed. */
void pw_run_accelerate_updated (pw_run *r, const double *v, double *a, double *lambda);

/* The same where J is swept and the rates are placed, but the saddle is not factorised; gamma is in lambda. */
int pw_run_accelerate_evaluated (pw_run *r, const double *v, double *a, double *lambda);

/* The state reached, into the sample arrays; the system is placed there, J swept. */
void pw_show_reached (pw_run *r);

/* Says why the J last evaluated could not be used, and when: the rank is lost, or nearly so, or the values are too extreme
 * (watchdog.c). */
int pw_fail_singular (pw_run *r, double t, pw_error *error);

/* Takes the residuals of the state just accelerated into r->known and the statistics; those that a projection knows are not
 * computed twice. */
void pw_note_residuals (pw_run *r);
static inline void pw_forget_residuals (pw_run *r) {
  r->known.position = r->known.velocity = NAN;
}

/* What the i-th redundant row follows from, at the configuration J is swept and the saddle factorised at. */
void pw_rank_coefficients (pw_run *r, int i);

/* ---- Projection ---- */

typedef struct {
  pw_saddle *position;         /* metric of the positions, holonomic rows; or the run's */
  int own_position;            /* position is not the run's saddle */
  pw_saddle *velocity;         /* all rows */
  int own_velocity;            /* velocity is not the run's saddle */
  double *scratch;             /* 3 rows + coords */
  int iterations;              /* of the last position projection */
  const unsigned char *active; /* rows that are enforced; NULL: all */
  int alone;                   /* 1: nobody asks what becomes of the others */
  int against;                 /* a redundant row that the last position projection left open, or -1 */
} pw_projector;

/* Position metric `weight_q` and velocity metric `weight_v` (NULL: the mass matrix).  The
 * system must be placed at a typical configuration with J swept. */
int pw_projector_open (pw_projector *p, pw_run *r, const double *weight_q, const double *weight_v, pw_error *error);
/* The same with the metric that the method's options ask for. */
int pw_projector_open_asked (pw_projector *p, pw_run *r, pw_error *error);
void pw_projector_close (pw_projector *p);

/* Gauss-Newton on g(q) = 0 to round-off: minimal changes in the metric.  Leaves the system placed at (t, q, v) with J
 * swept.  PW_RETRY if it does not converge; *row then tells the worst constraint and *worst its residual. */
int pw_project_positions (pw_projector *p, pw_run *r, double t, double *q, const double *v, int *row, double *worst);

/* One linear solve for J v = eta at the placed configuration; the rates are placed.  PW_RETRY if singular; PW_METHOD if a signal of
 * them failed. */
int pw_project_velocities (pw_projector *p, pw_run *r, double *v);

/* Both, and then accelerations and multipliers of the state reached, with the run's saddle factorised there.  Rates that obey
 * J v = eta to round-off may be left as they are. */
int pw_project_state (pw_projector *p, pw_run *r, double t, double *q, double *v, double *a, double *lambda);

/* Takes from an error of positions or velocities what a projection onto the first `rows` equations removes, in the metric of the
 * saddle `k` (all rows), which is factorised at the placed configuration. */
void pw_project_error (pw_run *r, pw_saddle *k, double *e, int rows);

/* ---- Start ---- */

/* Makes r->q, r->v consistent at r->t and fills the report.  Errors: PW_INITIAL. */
int pw_run_make_consistent (pw_run *r, const unsigned char *held, pw_error *error);
/* Counts what moved in the report, when the scales are known. */
void pw_run_count_moved (pw_run *r);

#endif
