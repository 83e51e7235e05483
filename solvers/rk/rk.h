/* Explicit Runge-Kutta methods: their coefficients, and the functions and options that all of them share
 * (rk.c). */
#ifndef PW_RK_H_
#define PW_RK_H_
#include "method.h"

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

/* The distance of the state (q, v) from the sample (q_at, v_at): the largest difference in units of the scene; NaN if
 * there is one. */
double pw_rk_distance (const pw_run *r, const double *q, const double *v);

#endif
