/* The driver of our own methods with an implicit step of the given size: Newton's matrix, the last step, dense output. */
#ifndef PW_IMPLICIT_H
#define PW_IMPLICIT_H

#include "dense_output.h"
#include "sparse.h"
#include "tangent.h"
#include "util.h"

/* Data of such a method begin with this. */
typedef struct {
  double base;        /* time from which steps are counted */
  long count;         /* steps since then */
  double h;           /* size of the last step; 0: the next one begins anew */
  double *q1, *v1;    /* the successor: coords + 3 */
  pw_tangent tangent; /* its tape has recorded the matrix */
  pw_sparse sparse;   /* which solves with it */
  double *value;      /* of the matrix */
  pw_dense_output last;
  char *memory; /* of the method's own arrays */
} pw_implicit;

/* Allocates the method's arrays, `count` of them, and the tangent: PW_OK or PW_RESOURCE. */
int pw_implicit_open (pw_implicit *x, pw_run *r, const pw_array *array, size_t count);

/* Makes room for the matrix that was recorded, of this size: PW_OK or PW_RESOURCE. */
int pw_implicit_lay_out (pw_implicit *x, int size);

/* Ends the opening, if `status` is PW_OK so far; velocities: whether the method has J v = eta. */
int pw_implicit_opened (pw_run *r, int status, int velocities, pw_error *error);

/* Begins a filling of the matrix, whose values are then 0. */
void pw_implicit_fill (pw_implicit *x, int size);

/* From the state reached to its successor q1, v1 at t1 = t + h, where kinematics are then up to date: PW_RETRY if the iteration
 * does not converge, PW_INPUT if its matrix is singular, PW_METHOD if a signal failed, PW_RESOURCE. */
typedef int pw_implicit_step (pw_run *r, double h, double t1);

/* One step; q1 and v1 become the state reached, `accept` does the same for accelerations and multipliers. */
int pw_implicit_advance (pw_run *r, double t_end, pw_implicit_step *step, void (*accept) (pw_run *r), pw_error *error);

/* For the table of the method. */
int pw_implicit_at (pw_run *r, double t, pw_error *error);
int pw_implicit_restart (pw_run *r, pw_error *error);
void pw_implicit_close (pw_run *r);

#endif
