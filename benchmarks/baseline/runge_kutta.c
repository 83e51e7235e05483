/* Explicit Runge-Kutta steps of given sizes, by hand, for six coordinates: the state's own accelerations are the first
 * stage, and each step ends with a projection. */
#include "baseline.h"

enum { STAGES = 16 };

/* y + h sum_k w_k K_k; zeros of the tableau are skipped. */
static inline void step_sum (double *out, const double *y, double (*const K)[6], const double *w, double h, int count) {
  double sum[6] = { 0 };
  for (int k = 0; k < count; k++)
    if (w[k] != 0)
      for (int j = 0; j < 6; j++) sum[j] += w[k] * K[k][j];
  for (int j = 0; j < 6; j++) out[j] = y[j] + h * sum[j];
}

void ezy_step (const ezy_tableau *b, const ezy_dynamics *d, double t1, ezy_state *s) {
  double V[STAGES][6], A[STAGES][6], q[6], v[6], lambda[4], h = t1 - s->t;
  const double *row = b->A;
  for (int j = 0; j < 6; j++) V[0][j] = s->v[j], A[0][j] = s->a[j];
  for (int i = 1; i < b->stages; row += i++) {
    step_sum (q, s->q, V, row, h, i);
    step_sum (V[i], s->v, A, row, h, i);
    d->rate (d->context, s->t + b->c[i] * h, q, V[i], A[i], lambda);
  }
  step_sum (q, s->q, V, b->b, h, b->stages);
  step_sum (v, s->v, A, b->b, h, b->stages);
  d->project (d->context, t1, q, v, s);
}
