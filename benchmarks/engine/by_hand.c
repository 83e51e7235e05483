/* Complete runs by the programs of benchmarks/baseline, for the program peers; see by_hand.h. */
#include <stdlib.h>
#include <string.h>
#include "by_hand.h"
#include "engine.h"

/* The coefficients of erk8 are static in its source. */
#define pw_method_erk8 by_hand_unused
#include "erk8.c"
#undef pw_method_erk8

const ezy_model by_hand_model = {
  .a = 0.5, .b = 0.5, .c = 0.125, .d = 0.125, .m1 = 1, .I1 = 0.1, .m2 = 0.1, .I2 = 0.01, .M0 = 0.1, .omega = PW_PI
};
static const ezy_tableau by_hand_tableau = { 12, erk8_c, erk8_A, erk8_b };

/* ---- EzyRoller ---- */

double by_hand_eighth (void *scene, const ladder *self, double h, double *q) {
  long steps = lround (BY_HAND_SECONDS / h);
  ezy e;
  ezy_state s;
  (void)scene, (void)self;
  ezy_open (&e, &by_hand_model);
  ezy_start (&e, &s);
  for (long i = 1; i <= steps; i++) ezy_step (&e, &by_hand_tableau, BY_HAND_SECONDS * (double)i / (double)steps, &s);
  memcpy (q, s.q, sizeof s.q);
  return 12.0 * (double)steps + 1;
}

double by_hand_classical (void *scene, const ladder *self, double h, double *q) {
  long steps = lround (BY_HAND_SECONDS / h);
  ezy e;
  ezy_state s;
  (void)scene, (void)self;
  ezy_open (&e, &by_hand_model);
  ezy_start (&e, &s);
  for (long i = 0; i < steps; i++) {
    s.t = BY_HAND_SECONDS * (double)i / (double)steps;
    ezy_massive_step (&e, BY_HAND_SECONDS / (double)steps, &s);
  }
  memcpy (q, s.q, sizeof s.q);
  return 4.0 * (double)steps + 1;
}

/* A step of the tableau in minimal coordinates. */
static void by_hand_minimal_step (const ezy *e, double t, double h, double y[6]) {
  double K[12][6], z[6];
  const double *row = erk8_A;
  ezy_minimal (e, t, y, K[0]);
  for (int i = 1; i <= 12; row += i++) {
    const double *w = i < 12 ? row : erk8_b;
    memcpy (z, y, sizeof z);
    for (int k = 0; k < i; k++)
      if (w[k] != 0)
        for (int j = 0; j < 6; j++) z[j] += h * w[k] * K[k][j];
    if (i < 12) ezy_minimal (e, t + erk8_c[i] * h, z, K[i]);
  }
  memcpy (y, z, sizeof z);
}

double by_hand_minimal (void *scene, const ladder *self, double h, double *q) {
  const ezy_model *m = &by_hand_model;
  long steps = lround (BY_HAND_SECONDS / h);
  double y[6] = { -m->a, 0, 0, acos (-1), 0, 0 };
  ezy e;
  (void)scene, (void)self;
  ezy_open (&e, m);
  h = BY_HAND_SECONDS / (double)steps;
  for (long i = 0; i < steps; i++) by_hand_minimal_step (&e, (double)i * h, h, y);
  q[0] = y[0] + m->a * cos (y[2]), q[1] = y[1] + m->a * sin (y[2]), q[2] = y[2];
  q[3] = q[0] + m->b * cos (y[2]) + m->d * cos (y[3]), q[4] = q[1] + m->b * sin (y[2]) + m->d * sin (y[3]), q[5] = y[3];
  return 12.0 * (double)steps;
}

double by_hand_cvode (void *scene, const ladder *self, double rtol, double *q) {
  ezy_cvode *d = ezy_cvode_open (&by_hand_model, self->method[0] == 'a', rtol, BY_HAND_SECONDS);
  long steps, evaluations;
  int flag = 0;
  (void)scene;
  if (d == NULL) engine_die (self->name, "cannot be opened");
  while (flag == 0) flag = ezy_cvode_step (d);
  ezy_cvode_result (d, &steps, &evaluations, q);
  ezy_cvode_close (d);
  for (int j = 0; flag < 0 && j < 6; j++) q[j] = NAN;
  return (double)evaluations;
}

double by_hand_ida (void *scene, const ladder *self, double rtol, double *q) {
  ezy_ida *d = ezy_ida_open (&by_hand_model, rtol, BY_HAND_SECONDS);
  long steps, evaluations;
  int flag = 0;
  (void)scene;
  if (d == NULL) engine_die (self->name, "cannot be opened");
  while (flag == 0) flag = ezy_ida_step (d);
  ezy_ida_result (d, &steps, &evaluations, q);
  ezy_ida_close (d);
  for (int j = 0; flag < 0 && j < 6; j++) q[j] = NAN;
  return (double)evaluations;
}

/* ---- Chain ---- */

/* out = y + h sum_k w_k K_k for n entries; skips zeros of the tableau. */
static void by_hand_sum (double *out, const double *y, double *const *K, const double *w, double h, int count, int n) {
  memcpy (out, y, (size_t)n * sizeof *out);
  for (int k = 0; k < count; k++)
    if (w[k] != 0)
      for (int j = 0; j < n; j++) out[j] += h * w[k] * K[k][j];
}

/* A step; V[0..11] and A[0..11] take the stages, A[12] is work space, q and v take the result. */
void by_hand_chain_step (chain *c, double h, double *q, double *v, double *const *V, double *const *A, double *lambda) {
  const double *row = erk8_A;
  double *stage = A[12];
  int n = 3 * c->links;
  memcpy (V[0], v, (size_t)n * sizeof *v);
  chain_accelerate (c, q, v, A[0], lambda);
  for (int i = 1; i < 12; row += i++) {
    by_hand_sum (stage, q, V, row, h, i, n);
    by_hand_sum (V[i], v, A, row, h, i, n);
    chain_accelerate (c, stage, V[i], A[i], lambda);
  }
  by_hand_sum (stage, q, V, erk8_b, h, 12, n);
  memcpy (q, stage, (size_t)n * sizeof *q);
  by_hand_sum (stage, v, A, erk8_b, h, 12, n);
  memcpy (v, stage, (size_t)n * sizeof *v);
}

double by_hand_chain (void *scene, const ladder *self, double h, double *q) {
  int links = *(const int *)scene, n = 3 * links;
  long steps = lround (1 / h);
  double *V[13], *A[13], *memory = calloc ((size_t)n * 29, sizeof *memory), *v = memory + 26 * n, *lambda = v + n;
  chain c;
  (void)self;
  if (memory == NULL || chain_open (&c, links) != 0) engine_die ("chain by hand", "out of memory");
  for (int i = 0; i < 13; i++) V[i] = memory + i * n, A[i] = memory + (13 + i) * n;
  for (int i = 0; i < links; i++) q[3 * i] = i + 0.5, q[3 * i + 1] = q[3 * i + 2] = 0;
  for (long i = 0; i < steps; i++) by_hand_chain_step (&c, 1 / (double)steps, q, v, V, A, lambda);
  chain_close (&c);
  free (memory);
  return 12.0 * (double)steps;
}
