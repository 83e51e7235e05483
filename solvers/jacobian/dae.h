/* The equations of motion as differential-algebraic equations F (t, y, y') = 0, y = (q, v, lambda, mu):
 *
 *   kinematics    q' - v + D G^T mu
 *   momentum      M a + J^T lambda - f,   a = v'
 *   constraints, by stabilisation:
 *     none, baumgarte   J a - gamma + 2 alpha (J v - eta) + beta^2 g   (nonholonomic: + alpha (J v - eta)), no mu
 *     index2            J v - eta                                      no mu
 *     index3            g,  of nonholonomic constraints J v - eta      no mu
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
  int velocities; /* 1: J v = eta is enforced */
  int positions;  /* 1: g = 0 is enforced, by mu if `velocities`, else in place of the holonomic J v = eta; both 0: the
                     constraints on acceleration level are */
  int impulses;   /* 1: si1 */
  int n, rows, mus, size; /* coordinates, independent equations, multipliers mu, unknowns */
  double *pull, *f;       /* coords + 3: J^T lambda or G^T mu; applied forces */
  double *jv, *other;     /* all constraint equations: residuals, J v - eta and what is added; g, or one term */
  char *memory;
} pw_dae;

/* The equations of a run's stabilisation.  PW_OK or PW_RESOURCE; close it in every case. */
int pw_dae_open (pw_dae *x, pw_run *r);
void pw_dae_close (pw_dae *x);

/* F without q' - v.  Kinematics and J must be up to date.  lambda: the multipliers of the independent equations, mu after
 * them; a may be NULL, which is 0, except for constraints on acceleration level. */
void pw_dae_residual (pw_dae *x, const double *v, const double *a, const double *lambda, double *F);

/* Adds dF/dy + of_q dF/dq' + of_a dF/dv' to the matrix of x->tangent; columns of the multipliers of si1, of whose derivatives
 * F is a function, times of_a. */
void pw_dae_matrix (pw_dae *x, const double *v, const double *a, const double *lambda, double of_q, double of_a);

/* Determines the pattern of this matrix, in x->tangent.  PW_OK or PW_RESOURCE. */
int pw_dae_lay_out (pw_dae *x, const double *v, const double *a, const double *lambda);

#endif
