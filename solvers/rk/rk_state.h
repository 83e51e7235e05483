/* What the parts of the Runge-Kutta driver share: stages and steps (rk.c), fixed steps (rk_fixed.c), steps that follow
 * the tolerances (rk_adapt.c).  For these files only. */
#ifndef PW_RK_STATE_H
#define PW_RK_STATE_H

#include "nullspace.h"
#include "rk.h"

/* The weights of a row of the tableau that are not 0. */
typedef struct {
  int count, stage[PW_RK_STAGES];
  double weight[PW_RK_STAGES];
} pw_rk_row;

struct pw_method_data {
  const pw_tableau *tableau;
  pw_rk_row
      row[PW_RK_STAGES];     /* of the stages from 1 on; in the place of stage 0, which needs none, of the new state */
  pw_rk_row estimate[3];     /* of the error estimates; behind the stages' derivatives is the new state's */
  int adaptive;              /* 1: steps follow the tolerances; 0: they are of the given size */
  int projects, held, every; /* projection; inputs held over the step; steps between projections */
  int minimal, closes;       /* nullspace: velocities are minimal; and positions are projected */
  pw_projector projector;
  pw_nullspace nullspace;
  double base;                                                 /* time from which fixed steps are counted */
  long count;                                                  /* steps since then */
  int split;                                                   /* 1: the last step ended inside one of them */
  double *V[PW_RK_STAGES], *A[PW_RK_STAGES], *R[PW_RK_STAGES]; /* rates, accelerations, ledger's rates of the stages */
  double *q, *v, *a, *lambda; /* a stage's state, then the new one: one block, as the run's */
  double h, before;           /* adaptive: next step, error of the last one */
  double *weight;             /* adaptive: one over the tolerances of each position and its rate */
  /* the beginning of the last step, for looking back into it: one block */
  double t0, *q0, *v0, *a0, *ledger0, *rate0, projected0;
  double *middle, *ledger_middle, *rate_middle; /* a state on the way from there to a sample: q, v, a in one block */
  char *memory;
};

/* From the state reached to its successor at t1 = t + h, left in d->q, d->v, d->a, d->lambda; project: onto the
 * constraints; added (NULL: not wanted) takes the energy this adds.  PW_RETRY: a smaller step may do. */
int pw_rk_step (pw_run *r, double h, double t1, int project, double *added);

/* That successor becomes the state reached. */
void pw_rk_accept (pw_run *r, double h, double t1, double added);

/* Back to the beginning of the step just accepted. */
void pw_rk_revert (pw_run *r);

/* The state q, v, a as one block, as the run's own; with lambda behind it.  Its size in bytes. */
static inline size_t pw_rk_block (const pw_run *r, int multipliers) {
  return (3 * ((size_t)r->s->coords + 3) + (size_t)(multipliers ? r->s->rows : 0)) * sizeof (double);
}

/* out = y + h sum_j b_j R_j of the ledger's entries, after a step */
void pw_rk_ledger (const pw_run *r, double *out, const double *y, double h);

/* How far the state in d->q, d->v is from the one in q_at, v_at, in units of the scene. */
double pw_rk_distance (const pw_run *r);

/* Says why no step succeeds from the state reached. */
int pw_rk_fail (pw_run *r, int status, double h, pw_error *error);

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error);
int pw_rk_advance_adaptive (pw_run *r, double t_end, pw_error *error);

/* The first step of an adaptive method. */
void pw_rk_begin_adaptive (pw_run *r);

#endif
