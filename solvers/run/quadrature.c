/* Work and losses along the steps of a multistep method: the integral of a polynomial through the rates at the
 * states reached, of a degree one above the order of the step if enough are stored, at negligible cost; where that is
 * not accurate enough, of the rates that the method interpolates at nodes inside the step.
 *
 * The difference from the polynomial of the next lower degree estimates the error.  Powers may vanish at the ends of
 * all steps but not between them, so the work and losses of a step are also compared with the change of energy. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "quadrature.h"
#include "util.h"

int pw_quadrature_open (pw_quadrature *x, pw_run *r, pw_rates_at *rates) {
  size_t entries = (size_t)r->entries;
  pw_array array[PW_QUADRATURE_POINTS + 4] = {
    { &x->ledger0, entries }, { &x->integral, entries }, { &x->finer, entries }, { &x->node, entries }
  };
  for (int i = 0; i < PW_QUADRATURE_POINTS; i++) array[4 + i] = (pw_array){ &x->rate[i], entries };
  x->rates = rates;
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  if (x->memory == NULL) return PW_RESOURCE;
  pw_quadrature_restart (x, r);
  return PW_OK;
}

void pw_quadrature_close (pw_quadrature *x) {
  free (x->memory);
}

static void quadrature_store_rates (pw_quadrature *x, const pw_run *r) {
  x->t[0] = r->t;
  memcpy (x->rate[0], r->rate, (size_t)r->entries * sizeof (double));
}

void pw_quadrature_restart (pw_quadrature *x, pw_run *r) {
  x->points = 1;
  x->energy = pw_energy (r, r->v);
  quadrature_store_rates (x, r);
}

/* ---- Integrals ---- */

enum { QUADRATURE_BY_METHOD = -1 }; /* in place of a degree */

/* The rates at t: of the polynomial of this degree through those at the newest states (Lagrange's formula), or
 * QUADRATURE_BY_METHOD. */
static int quadrature_rates (const pw_quadrature *x, pw_run *r, int degree, double t, double *rate) {
  if (degree == QUADRATURE_BY_METHOD) return x->rates (r, t, rate);
  memset (rate, 0, (size_t)r->entries * sizeof *rate);
  for (int i = 0; i <= degree; i++) {
    double at_t = 1, at_node = 1;
    for (int j = 0; j <= degree; j++)
      if (j != i) at_t *= t - x->t[j], at_node *= x->t[i] - x->t[j];
    pw_add_scaled (rate, x->rate[i], at_t / at_node, r->entries);
  }
  return PW_OK;
}

/* The integrals between two times by Gauss quadrature with four nodes, exact up to degree 7, in each of equal parts. */
static int quadrature_gauss (const pw_quadrature *x, pw_run *r, int degree, double from, double to, int parts,
                             double *integral) {
  static const double node[] = { 0.8611363115940526, 0.3399810435848563 },
                      weight[] = { 0.3478548451374538, 0.6521451548625461 };
  double half = (to - from) / parts / 2;
  memset (integral, 0, (size_t)r->entries * sizeof *integral);
  for (int i = 0; i < 4 * parts; i++) {
    double middle = from + (2 * (i / 4) + 1) * half, side = i % 4 < 2 ? -1 : 1;
    int status = quadrature_rates (x, r, degree, middle + side * node[i % 2] * half, x->node);
    if (status != PW_OK) return status;
    pw_add_scaled (integral, x->node, half * weight[i % 2], r->entries);
  }
  return PW_OK;
}

/* The difference between x->finer and x->integral in a step of size h, in tolerances; in the scratch x->node. */
static double quadrature_change (const pw_quadrature *x, const pw_run *r, double h) {
  for (int e = 0; e < r->entries; e++) x->node[e] = x->finer[e] - x->integral[e];
  return pw_ledger_norm (r, h, x->node);
}

/* Halves the parts until the integrals, in x->integral, converge; stops if powers cannot be evaluated. */
static void quadrature_refine (pw_quadrature *x, pw_run *r, double from, double to) {
  const int most = 64; /* 256 nodes */
  double change = INFINITY;
  for (int parts = 1; parts <= most && change > 1; parts *= 2) {
    if (quadrature_gauss (x, r, QUADRATURE_BY_METHOD, from, to, parts, x->finer) != PW_OK) return;
    change = quadrature_change (x, r, x->t[0] - x->t[1]);
    memcpy (x->integral, x->finer, (size_t)r->entries * sizeof *x->integral);
  }
}

/* ---- Steps ---- */

static int quadrature_degree (const pw_quadrature *x, int order) {
  return order + 1 < x->points ? order + 1 : x->points - 1;
}

/* 1 if the step is much longer than the previous ones whose rates are stored, together: its polynomial then depends
 * almost only on its ends. */
static int quadrature_is_long (const pw_quadrature *x) {
  const double ratio = 10;
  return x->points > 2 && x->t[0] - x->t[1] > ratio * (x->t[1] - x->t[x->points - 1]);
}

/* Energy defect of a step: change of energy, less work, plus losses.  Stores the energy for the next step. */
static double quadrature_defect (pw_quadrature *x, pw_run *r) {
  double before = x->energy;
  x->energy = pw_energy (r, r->v);
  double defect = x->energy - before;
  for (int e = 0; e < r->s->entries; e++) defect -= r->s->entry[e].type == PW_WORK ? x->integral[e] : -x->integral[e];
  return fabs (defect);
}

int pw_quadrature_step (pw_quadrature *x, pw_run *r, int order) {
  const double method_defect = 100; /* energy defect that the method itself may cause in a step, in tolerances */
  int entries = r->entries, last = PW_QUADRATURE_POINTS - 1;
  double *oldest = x->rate[last], h = r->t - x->t[0];
  memcpy (x->ledger0, r->ledger, (size_t)entries * sizeof (double));
  if (!(h > 0)) return PW_OK;
  memmove (x->t + 1, x->t, (size_t)last * sizeof *x->t);
  memmove (x->rate + 1, x->rate, (size_t)last * sizeof *x->rate);
  x->rate[0] = oldest;
  quadrature_store_rates (x, r);
  if (x->points <= last) x->points++;
  x->order = order;
  const int degree = quadrature_degree (x, order);
  (void)quadrature_gauss (x, r, degree, x->t[1], x->t[0], 1, x->integral);
  (void)quadrature_gauss (x, r, degree - 1, x->t[1], x->t[0], 1, x->finer);
  const double error = quadrature_change (x, r, h), defect = quadrature_defect (x, r);
  x->refined = defect > method_defect * pw_ledger_tolerance (r, h) || error > 1 || quadrature_is_long (x);
  if (x->refined) quadrature_refine (x, r, x->t[1], x->t[0]);
  for (int e = 0; e < entries; e++) r->ledger[e] += x->integral[e];
  return x->refined ? pw_evaluate_J_at (r->w, pw_before_breakpoint (r, r->t), r->q, r->v) : PW_OK;
}

void pw_quadrature_at (pw_quadrature *x, pw_run *r, double t) {
  int entries = r->entries;
  if (t == x->t[0] || x->points < 2) {
    memcpy (r->ledger_at, r->ledger, (size_t)entries * sizeof (double));
    return;
  }
  (void)quadrature_gauss (x, r, quadrature_degree (x, x->order), x->t[1], t, 1, x->integral);
  if (x->refined) quadrature_refine (x, r, x->t[1], t);
  for (int e = 0; e < entries; e++) r->ledger_at[e] = x->ledger0[e] + x->integral[e];
}
