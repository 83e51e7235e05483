/* Explicit Runge-Kutta methods: one driver, a tableau for each. */
#ifndef PW_RK_H
#define PW_RK_H

#include "method.h"

enum { PW_RK_STAGES = 16 };

/* c and b have `stages` entries; A holds the rows below the diagonal, one after the other. */
typedef struct {
  int stages, order;
  const double *c, *A, *b;
} pw_tableau;

/* What a pw_method of this family puts in its table. */
int pw_rk_open (pw_run *r, const pw_tableau *tableau, pw_error *error);
int pw_rk_advance (pw_run *r, double t_end, pw_error *error);
int pw_rk_at (pw_run *r, double t, pw_error *error);
int pw_rk_restart (pw_run *r, pw_error *error);
void pw_rk_close (pw_run *r);
extern const pw_stabilisation pw_rk_stabilisations[];
extern const pw_option pw_rk_options[];

#endif
