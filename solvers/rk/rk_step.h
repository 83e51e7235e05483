/* Private to Runge-Kutta methods: stages and steps (rk_step.c), step-size control (rk_adapt.c), fixed steps and samples
 * (rk_divide.c), null-space method (nullspace.c). */
#ifndef PW_RK_STEP_H
#define PW_RK_STEP_H

#include "rk.h"
#include "specialised.h"

/* Null-space velocities (nullspace.c). */
enum { PW_NULLSPACE_MOST = 256 }; /* constraint equations: their matrix is dense */

typedef struct {
  int rows;          /* active ones */
  int *place;        /* all equations: index among the active ones, or -1 */
  double *reference; /* coords x rows: W^-1 J0^T */
  double *K;         /* rows x rows: J W^-1 J0^T, factorised in place */
  double *mu;        /* rows */
  double *eta;       /* all equations */
  double *v;         /* coords + 3: scratch */
  int *pivot;        /* rows */
  char *memory;
} pw_nullspace;

/* The beginning of a step. */
typedef struct {
  double t, *q; /* q, v, a in one block, as in the run */
  double *ledger, *rate, projected;
} pw_rk_begin;

struct pw_method_data {
  const pw_tableau *tableau;
  pw_rk_row row[PW_RK_STAGES];        /* [i] stage i > 0; [0] the new state, as stage 0 needs no weights */
  pw_rk_row estimate[3];              /* e, e3, e6; the last weight is that of the new state's derivative */
  int projects, held, every;          /* projection; signals constant over the step; steps between projections */
  int null_space, projects_positions; /* stabilisation nullspace; it projects positions too */
  pw_projector projector;
  pw_nullspace nullspace;
  pw_step_counter counter; /* of fixed steps */
  int split;               /* 1: the last step ended between their ends */
  /* velocities, accelerations and ledger rates of the stages */
  double *V[PW_RK_STAGES], *A[PW_RK_STAGES], *R[PW_RK_STAGES];
  double *q, *v, *a, *lambda; /* state of a stage, then the new state: one block, as in the run */
  double h, last_error;       /* adaptive: next step, error of the last one */
  double *weight;             /* adaptive: reciprocal tolerances of each position and its velocity */
  pw_rk_begin last, middle;   /* of the last step, for samples inside it; of the second part of a divided step */
  char *memory;
};

/* A step from the current state to t1 = t + h; the new state is left in d->q, d->v, d->a, d->lambda.  project: onto the
 * constraints; *added grows by the energy this adds, unless NULL.  PW_RETRY: a smaller step may succeed. */
int pw_rk_step (pw_run *r, double h, double t1, int project, double *added);

/* The state reached is the beginning of the last step. */
void pw_rk_keep (pw_run *r);

/* Makes the new state the current one. */
void pw_rk_accept (pw_run *r, double h, double t1, double added);

/* Size in bytes of the block of q, v, a, which has the layout of the run's; with `multipliers` including lambda. */
static inline size_t pw_rk_block (const pw_run *r, int multipliers) {
  return (3 * ((size_t)r->s->coords + 3) + (size_t)(multipliers ? r->s->rows : 0)) * sizeof (double);
}

/* out = y + h sum_j b_j R_j of the ledger's entries, after a step */
void pw_rk_ledger (const pw_run *r, double *out, const double *y, double h);

/* The distance of the state in d->q, d->v from the one in q_at, v_at, in units of the scene. */
double pw_rk_distance (const pw_run *r);

/* Reports why no step from the current state succeeds. */
int pw_rk_fail (pw_run *r, int status, double h, pw_error *error);

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error);
int pw_rk_advance_adaptive (pw_run *r, double t_end, pw_error *error);

/* Sets the size of the first step of an adaptive method, also after a discontinuity. */
void pw_rk_begin_adaptive (pw_run *r);

/* ---- Null-space velocities of a step, which satisfy the constraints by construction (nullspace.c) ---- */

/* PW_INPUT if the scene has more than PW_NULLSPACE_MOST independent constraint equations; PW_RESOURCE. */
int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error);
void pw_nullspace_close (pw_nullspace *b);

/* Begins a step at the current state of the run.  PW_METHOD if a signal failed. */
int pw_nullspace_begin (pw_nullspace *b, pw_run *r);

/* Replaces v by the velocities at (t, q) with the same null-space velocities; updates kinematics and J.  PW_RETRY if the
 * step is too large for its basis, or the configuration is singular; PW_METHOD if a signal failed. */
int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v);

/* Accelerations and multipliers right after pw_nullspace_velocities.  Returns as pw_run_accelerate. */
int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda);

/* Velocities at the end of a step, after projecting positions onto g = 0 if there is a projector; *added grows by the
 * energy this adds, unless added is NULL. */
int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added);

#endif
