/* Work and losses along the steps of a multistep method, from their rates at the states it has reached. */
#ifndef PW_QUADRATURE_H
#define PW_QUADRATURE_H

#include "method.h"

enum { PW_QUADRATURE_POINTS = 7 }; /* at most: of more the polynomial costs more than nodes where it is not enough */

/* The rates of the ledger's entries at a time inside the last step, by the method's own interpolation; it leaves the run as
 * it is, but for the sample arrays and where the system is placed.  Returns as pw_update_kinematics. */
typedef int pw_velocities_at (pw_run *r, double t, double *rate);

typedef struct {
  pw_velocities_at *rates;
  int points, order;                  /* since the last restart; of the last step */
  int refined;                        /* 1: the last step was integrated by nodes inside it */
  double t[PW_QUADRATURE_POINTS];     /* newest first */
  double *rate[PW_QUADRATURE_POINTS]; /* entries */
  double *ledger0;                    /* entries: at the beginning of the last step */
  double *sum, *finer, *node;         /* entries: scratch */
  double energy;                      /* kinetic + potential of the state reached */
  char *memory;
} pw_quadrature;

/* PW_OK or PW_RESOURCE. */
int pw_quadrature_open (pw_quadrature *x, pw_run *r, pw_velocities_at *rates);
void pw_quadrature_close (pw_quadrature *x);

/* Begins anew at the state reached, where the system is placed, and the ledger and its rates are known. */
void pw_quadrature_restart (pw_quadrature *x, pw_run *r);

/* The ledger goes on to the state reached by a step of this order: the system is placed there, and r->rate is of there.  1 if
 * the system was placed elsewhere. */
int pw_quadrature_step (pw_quadrature *x, pw_run *r, int order);

/* The ledger at a time inside the last step, into r->ledger_at. */
void pw_quadrature_at (pw_quadrature *x, pw_run *r, double t);

#endif
