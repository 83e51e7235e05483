/* Work and losses along the steps of a multistep method, from their rates at the states it has reached. */
#ifndef PW_QUADRATURE_H
#define PW_QUADRATURE_H

#include "method.h"

enum { PW_QUADRATURE_POINTS = 7 }; /* at most: a polynomial through more would cost more than nodes inside the step */

/* The rates of the ledger's entries at a time inside the last step, by the method's interpolation; changes the run's
 * sample arrays, the kinematics, J and the saddle's factors.  PW_OK, or another status if they cannot be evaluated. */
typedef int pw_rates_at (pw_run *r, double t, double *rate);

typedef struct {
  pw_rates_at *rates;
  int points;                         /* states whose rates are known: at most those since the last restart */
  int order;                          /* of the last step */
  int refined;                        /* 1: the last step was integrated by nodes inside it */
  double t[PW_QUADRATURE_POINTS];     /* times of these states, newest first */
  double *rate[PW_QUADRATURE_POINTS]; /* entries: rates there */
  double *ledger0;                    /* entries: at the beginning of the last step */
  double *integral;                   /* entries: over the last step, or a part of it */
  double *finer, *node; /* entries: scratch: the same with more nodes or of a lower degree; rates at a node */
  double energy;        /* kinetic + potential energy of the state reached [J] */
  char *memory;
} pw_quadrature;

/* At the state reached, as pw_quadrature_restart.  PW_OK or PW_RESOURCE. */
int pw_quadrature_open (pw_quadrature *x, pw_run *r, pw_rates_at *rates);
void pw_quadrature_close (pw_quadrature *x);

/* Restarts at the state reached; kinematics and r->rate must be up to date. */
void pw_quadrature_restart (pw_quadrature *x, pw_run *r);

/* Integrates the ledger over the step, of this order, to the state reached, where kinematics, J and r->rate must be up
 * to date, and stay so.  Returns as pw_update_kinematics. */
int pw_quadrature_step (pw_quadrature *x, pw_run *r, int order);

/* Stores the ledger at a time inside the last step in r->ledger_at; call it before the interpolation of the sample,
 * since pw_rates_at may overwrite the other sample arrays and the kinematics. */
void pw_quadrature_at (pw_quadrature *x, pw_run *r, double t);

#endif
