/* The equations of motion as differential-algebraic equations F (t, y, y') = 0, y = (q, v, lambda, mu), for implicit
 * methods:
 *
 *   kinematics    q' - v + D G^T mu
 *   momentum      M a + J^T lambda - f,   a = v'
 *   constraints, by stabilisation:
 *     none, baumgarte   J a - gamma + 2 alpha (J v - eta) + beta^2 g   (nonholonomic: + alpha (J v - eta)), no mu
 *     index2            J v - eta                                      no mu
 *     index3, rattle    g,  of nonholonomic constraints J v - eta      no mu
 *     ggl, si1          J v - eta,  g
 *
 * with G the rows of J of the holonomic equations, D diagonal: 1 for lengths, 1/L^2 for angles, so that mu has one unit
 * (baumgarte: Baumgarte 1972; ggl: Gear, Gupta & Leimkuhler 1985; si1, stabilised index 1: Gear 1988).  L is the length
 * scale.  In si1 the unknowns lambda and mu are the integrals of the multipliers. */
#ifndef PW_DAE_H
#define PW_DAE_H

#include "tangent.h"

typedef struct {
  pw_tangent tangent;
  int enforces_velocities;     /* 1: J v = eta of holonomic equations, too: index2, ggl, si1 */
  int enforces_positions;      /* 1: index3, rattle (leapfrog), ggl, si1; both are 0 for none and baumgarte */
  int integrates_multipliers;  /* 1: si1 */
  int n, rows, mu_count, size; /* numbers of coordinates, independent equations, multipliers mu, unknowns */
  double *reaction, *force;    /* coords + 3: J^T lambda or G^T mu; applied forces */
  double *residual, *scratch;  /* all constraint equations */
  char *memory;
} pw_dae;

/* The equations of a run's stabilisation.  PW_OK or PW_RESOURCE; close it in every case. */
int pw_dae_open (pw_dae *x, pw_run *r);
void pw_dae_close (pw_dae *x);

/* F with q' - v left out.  Kinematics and J must be up to date.  lambda: the multipliers of the independent equations,
 * mu after them; a: NULL for 0, except in none and baumgarte. */
void pw_dae_residual (pw_dae *x, const double *v, const double *a, const double *lambda, double *F);

/* Adds dF/dy + q_dot_factor dF/dq' + v_dot_factor dF/dv', with q' - v included, to the matrix that x->tangent.scatter
 * fills; arguments and requirements as for pw_dae_residual.  In si1, F depends on the derivatives of the unknowns
 * lambda and mu: their columns are those times v_dot_factor. */
void pw_dae_matrix (pw_dae *x, const double *v, const double *a, const double *lambda, double q_dot_factor,
                    double v_dot_factor);

/* Determines the pattern of this matrix, in x->tangent.scatter.  PW_OK or PW_RESOURCE. */
int pw_dae_lay_out (pw_dae *x, const double *v, const double *a, const double *lambda);

#endif
