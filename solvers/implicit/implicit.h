/* What galpha and leapfrog, methods with a fixed step that solve equations by Newton's iteration, share: matrix, steps,
 * dense output. */
#ifndef PW_IMPLICIT_H
#define PW_IMPLICIT_H

#include "tangent.h"
#include "dense_output.h"
#include "sparse.h"

/* What a test of convergence decides; radau uses it, too. */
typedef enum { PW_ITERATE, PW_CONVERGED, PW_DIVERGED } pw_convergence;

/* The data of each of these methods begin with this. */
typedef struct {
  pw_dense_output last;
  double *q1, *v1;  /* coords: the new state */
  pw_dae dae;       /* the equations and the Newton matrix; leapfrog uses only its tangent */
  pw_sparse sparse; /* factors of the matrix */
} pw_implicit;

/* Completes the opening with the Newton matrix of this size, of the pattern in x->dae.tangent.scatter, and a dense
 * output of this projection; if `status`, of the functions before, is not PW_OK, reports that memory is exhausted. */
int pw_implicit_complete (pw_run *r, int status, int size, pw_dense_projection projection, pw_error *error);

/* Factors of the rows and columns of the matrix of pw_dae_matrix with q_dot_factor c and v_dot_factor e: with them its
 * entries are of about the same size for every step size (equations in galpha.c).  radau uses them, too. */
void pw_implicit_scale (const pw_dae *x, double c, double e, double *row_factor, double *column_factor);

/* A step from the state reached to the new state q1, v1 at t1 = t + h; kinematics and J are left there.  PW_RETRY if
 * the iteration does not converge, or a singular configuration prevents the solution for velocities or accelerations;
 * PW_SINGULAR if the Newton matrix is; PW_METHOD if a signal failed; PW_RESOURCE. */
typedef int pw_implicit_step (pw_run *r, double h, double t1);

/* Advances by one step: makes q1, v1 the state reached, and calls `accept`, which sets its accelerations and
 * multipliers, before r->t changes.  PW_STOPPED between attempts near a singular configuration, if requested. */
int pw_implicit_advance (pw_run *r, double t_end, pw_implicit_step *step, void (*accept) (pw_run *r), pw_error *error);

/* Reports a failed step of size h from the state reached, also of radau; status: what the step returned, PW_OK if its
 * error is too large.  The reason may be a singular configuration at its beginning or, in leapfrog, at its end. */
int pw_implicit_fail (pw_run *r, int status, double h, pw_error *error);

void pw_implicit_close (pw_run *r); /* of the method */

#endif
