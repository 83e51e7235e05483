/* Explicit Runge-Kutta methods: their coefficients, and the functions and options that all of them share. */
#ifndef PW_RK_H_
#define PW_RK_H_
#include "method.h"
#include "dense_output.h"
#include "specialised.h"

enum { PW_RK_STAGES = 16 }; /* more than the most stages: the new state counts as one */

/* The coefficients of a method, named as by Hairer, Norsett & Wanner 1993. */
typedef struct {
  int stages;
  const double *c, *b; /* stages: nodes, weights */
  const double *A;     /* rows 1, 2, ... (counted from 0) below the diagonal, one after the other */
  const double *e;     /* stages + 1: weights of the error estimate, the last at the new state; NULL: fixed steps */
  const double *e3;    /* the same of an estimate of lower order (rk.c); NULL: there is only e */
  const double *e6;    /* the same of an estimate of higher order, together with e3 only */
  double exponent;     /* of the error in the next step size: 1 / (order of the estimate + 1) */
  double memory;       /* exponent of the previous error there (Gustafsson 1991) */
} pw_tableau;

int pw_rk_open (pw_run *r, const pw_tableau *tableau, pw_error *error);
int pw_rk_advance (pw_run *r, double t_end, pw_error *error);
int pw_rk_at (pw_run *r, double t, pw_error *error);
int pw_rk_restart (pw_run *r, pw_error *error);
void pw_rk_close (pw_run *r);
void pw_rk_serialise (pw_run *r, pw_archive *a);
extern const pw_stabilisation pw_rk_stabilisations[];
extern const pw_option pw_rk_adaptive_options[], pw_rk_fixed_options[]; /* of methods with and without an estimate */

/* Defines pw_method_NAME with this tableau; the remaining arguments initialise the members that methods do not
 * share. */
#define PW_RK_METHOD(NAME, tableau, ...)                \
  static int NAME##_open (pw_run *r, pw_error *error) { \
    return pw_rk_open (r, &tableau, error);             \
  }                                                     \
  const pw_method pw_method_##NAME = { .name = #NAME, .open = NAME##_open, PW_RK_MEMBERS, __VA_ARGS__ }
#define PW_RK_MEMBERS                                                                                         \
  .stabilisations = pw_rk_stabilisations, .advance = pw_rk_advance, .at = pw_rk_at, .restart = pw_rk_restart, \
  .close = pw_rk_close, .serialise = pw_rk_serialise

/* Private to the explicit Runge-Kutta methods: stages and steps (rk.c), step-size control (rk.c), fixed
 * steps and samples (rk.c), null-space velocities (nullspace.c). */

enum { PW_NULLSPACE_MOST = 256 }; /* constraint equations: their matrix is dense */

/* Null-space velocities, named as at the top of nullspace.c. */
typedef struct {
  int rows;          /* active constraint equations */
  int *active_index; /* all equations: index among the active ones, or -1 */
  double *W_inv_J0T; /* coords x rows: W^-1 J0^T */
  double *K;         /* rows x rows: J W^-1 J0^T, eliminated in place */
  double *mu;        /* rows: eta - J w, then the multipliers of the correction */
  double *eta;       /* all equations */
  double *v;         /* coords + 3: scratch */
  char *memory;
} pw_nullspace;

struct pw_method_data {
  const pw_tableau *tableau;
  pw_rk_row row[PW_RK_STAGES]; /* nonzero weights: [i] of stage i > 0; [0] of the new state, as stage 0 has none */
  pw_rk_row estimate[3];       /* those of e, e3, e6 */
  int projects, every;         /* 1: coordinate projection; steps from one projection to the next */
  int uses_nullspace;          /* 1: stabilisation nullspace */
  int nullspace_projects;      /* 1: with positions projected after each step */
  int holds_signals;           /* 1: signals of forces are constant over a step */
  pw_projector projector;
  pw_nullspace nullspace;
  pw_step_counter counter; /* of fixed steps */
  int off_grid;            /* 1: the last step was divided and ended between the multiples of the step size */
  /* velocities, accelerations, and rates of the ledger's entries at the stages, then at the new state */
  double *stage_v[PW_RK_STAGES], *stage_a[PW_RK_STAGES], *stage_rate[PW_RK_STAGES];
  double *q, *v, *a, *lambda; /* the new state, laid out as in pw_run; before: q, lambda of a stage */
  double h, last_error;       /* adaptive: size of the next step, error of the last one */
  double *weight;             /* adaptive: reciprocal tolerances: [2 j] of q_j, [2 j + 1] of v_j */
  pw_step_start last, second; /* of the last step, for samples inside it; of the second part of a divided step */
  char *memory;
};

/* A step from the state reached to the new state at t1 = t + h: d->q, d->v, d->a, d->lambda.  project: 1 to project the
 * new state onto the constraints; *added_energy, unless it is NULL, grows by the energy [J] that projections add.
 * PW_RETRY if a smaller step may succeed; PW_METHOD if a signal failed. */
int pw_rk_step (pw_run *r, double h, double t1, int project, double *added_energy);

/* 1 if the next step ends with a coordinate projection. */
static inline int pw_rk_projects_next (const pw_run *r) {
  return r->data->projects && (r->statistics.steps + 1) % r->data->every == 0;
}

/* Makes the new state the state reached. */
void pw_rk_accept (pw_run *r, double h, double t1, double added_energy);

/* The ledger at the end of a step, from that at its beginning: end = beginning + h sum_j b_j rate_j. */
void pw_rk_ledger (const pw_run *r, double *end, const double *beginning, double h);

/* The distance of the new state from the sample (q_at, v_at): the largest difference in units of the scene. */
double pw_rk_distance (const pw_run *r);

/* Reports why no step from the state at t succeeds; h: the size reported; status: result of the last attempt; divided:
 * 1 if it was divided near a singular configuration. */
int pw_rk_fail (pw_run *r, int status, double t, double h, int divided, pw_error *error);

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error);
int pw_rk_advance_adaptive (pw_run *r, double t_end, pw_error *error);

/* Sets the size of the first step of an adaptive method, and of the first one after a discontinuity. */
void pw_rk_reset_step_size (pw_run *r);

/* ---- Null-space velocities of a step, which satisfy the constraints by construction (nullspace.c) ---- */

/* Errors: PW_INPUT if the scene has more than PW_NULLSPACE_MOST independent constraint equations; PW_RESOURCE. */
int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error);
void pw_nullspace_close (pw_nullspace *b);

/* Sets W^-1 J0^T for a step from the state reached.  PW_METHOD if a signal failed. */
int pw_nullspace_begin (pw_nullspace *b, pw_run *r);

/* Replaces v by the velocities at (t, q) with the same null-space velocities; updates kinematics and J.  PW_RETRY if
 * the step is too large for its basis, or the configuration is singular; PW_METHOD if a signal failed. */
int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v);

/* Accelerations and multipliers right after pw_nullspace_velocities.  Returns as pw_run_accelerate. */
int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda);

/* At the end of a step: projects positions onto g = 0 unless p is NULL, then as pw_nullspace_velocities; *added_energy,
 * unless it is NULL, grows by the energy [J] that the projection adds. */
int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v,
                           double *added_energy);

#endif
