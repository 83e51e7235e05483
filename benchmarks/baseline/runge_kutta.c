/* A step of an explicit Runge-Kutta method by hand, for the six coordinates of the EzyRoller; see ezy_step.  The first
 * stage is the state with its accelerations; the step ends with a projection. */
#include "baseline.h"

enum { STAGES = 16 }; /* at most */

/* y + h sum_k w_k K_k; zeros of the tableau are skipped. */
static inline void step_sum (double *out, const double *y, double (*const K)[6], const double *w, double h, int count) {
  double sum[6] = { 0 };
  for (int k = 0; k < count; k++)
    if (w[k] != 0)
      for (int j = 0; j < 6; j++) sum[j] += w[k] * K[k][j];
  for (int j = 0; j < 6; j++) out[j] = y[j] + h * sum[j];
}

void ezy_step (const ezy *e, const ezy_tableau *tableau, double t1, ezy_state *s) {
  double V[STAGES][6], A[STAGES][6], q[6], v[6], lambda[4], h = t1 - s->t;
  const double *row = tableau->A;
  for (int j = 0; j < 6; j++) V[0][j] = s->v[j], A[0][j] = s->a[j];
  for (int i = 1; i < tableau->stages; row += i++) {
    step_sum (q, s->q, V, row, h, i);
    step_sum (V[i], s->v, A, row, h, i);
    ezy_massive (e, s->t + tableau->c[i] * h, q, V[i], A[i], lambda);
  }
  step_sum (q, s->q, V, tableau->b, h, tableau->stages);
  step_sum (v, s->v, A, tableau->b, h, tableau->stages);
  ezy_project (e, t1, q, v, s);
}
