/* A linearisation in progress; for linear*.c only.  Index names: n coordinates, m constraint equations; a variation of
 * the state is x = (dq, dv), and has `size` minimal coordinates: first those of positions, then those of velocities. */
#ifndef PW_LINEAR_H
#define PW_LINEAR_H

#include "method.h"
#include "pinwheel-analysis.h"
#include "newton.h"

/* The co-moving frame, at a reference body, at rest or with the twist of the body. */
typedef struct {
  double origin[2];    /* of the frame [m] */
  double twist[3];     /* velocity of the origin, angular velocity [m/s, rad/s] */
  double residual;     /* largest acceleration in the frame, in units of the scene */
  double acceleration; /* the same in m/s^2, angles times L */
} pw_linear_frame;

/* An entry of the derivatives. */
typedef struct {
  int row, column;
  double value;
} pw_linear_entry;

typedef struct {
  pw_run *r;
  int n, m;
  int holonomic, rank; /* independent constraint equations, those of positions first */
  int positions, velocities, size;
  int *row; /* rank: indices of these equations */
  pw_linear_frame frame;
  double *a, *lambda;            /* n + 3, m: at the state last evaluated */
  double *norm;                  /* m: lengths of the rows of J in units of the scene */
  double *R;                     /* rank x rank: J^T = Q R, by columns; before that the rows of J, n long each */
  double *Q;                     /* n x n, by columns */
  double *A;                     /* size x size, by rows: in the result */
  double *S;                     /* 3 x size: symmetry directions in minimal coordinates */
  double *x;                     /* 2 n: a variation */
  double *y;                     /* n + 2 m: derivatives times x: those of -F, gamma - J a, J v - eta */
  double *da;                    /* n + 3: the resulting variation of accelerations */
  double *z, *c;                 /* n + 3 m + 3, m: scratch */
  double *residual;              /* 3 x (2 m + n): violations by rigid displacements; then scratch, 2 m + n + 15 */
  double *a0, *along, *response; /* n, 2 n, n: accelerations, a variation and its da at the current state */
  double *there;                 /* 2 n: a later state */
  pw_newton_scratch newton;
  pw_scatter_map scatter;
  int64_t *colptr, *rowind; /* the derivatives: columns q, v; rows as y */
  double *value;
  pw_linear_entry *entry; /* entries: those that are not 0 */
  int entries;
  char *memory;
  int modes; /* 1: with B, basis, shapes */
  double *left, *top,
      tau[3]; /* size^2 + size: eigenvectors of the split matrix, then imaginary parts; 4 x size: its upper
                                 rows; scalars of the reflections in S */
} pw_linearisation;

/* Round-off of derivatives of moderate size, relative to them. */
#define PW_LINEAR_SYMMETRIC 1e-9

/* ---- linear.c ---- */

/* Opens a linearisation of the run's system; only counts if there are more than `most` coordinates.  PW_OK or PW_RESOURCE;
 * close it in every case. */
int pw_linear_open (pw_linearisation *x, pw_run *r, int modes, int most);
void pw_linear_close (pw_linearisation *x);

/* ---- linear_variation.c ---- */

/* Records the scatter map of the derivatives.  PW_OK or PW_RESOURCE. */
int pw_linear_derivatives (pw_linearisation *x);
/* The smallest singular value of J, rows of length 1; NaN without constraint equations. */
double pw_linear_least (pw_linearisation *x);
/* J^T = Q R of the independent constraint equations at the state evaluated. */
void pw_linear_bases (pw_linearisation *x);
/* Evaluates accelerations and derivatives at a state; kinematics are left there.  Returns as pw_run_accelerate. */
int pw_linear_evaluate (pw_linearisation *x, double t, const double *q, const double *v);
/* Computes y from the variation x; y and da. */
void pw_linear_multiply (pw_linearisation *x);
void pw_linear_vary (pw_linearisation *x);
/* Sets x to the variation along minimal coordinate c. */
void pw_linear_tangent (pw_linearisation *x, int c);
/* The minimal coordinates of a variation, `stride` apart. */
void pw_linear_coordinates (const pw_linearisation *x, const double *dq, const double *dv, int stride, double *out);
/* out += W in: (x, y) of each body, times w and rotated by 90 degrees. */
void pw_linear_turn (const pw_linearisation *x, double w, const double *in, double *out);
/* out = in with (x, y) of each body rotated by an angle. */
void pw_linear_rotate (const pw_linearisation *x, double angle, const double *in, double *out);

/* ---- linear_eigenvalues.c ---- */

/* Splits off rigid displacements of the whole, an invariant subspace with known eigenvalues (in a rotating frame a
 * displaced motion rotates at -w), so that they do not cause defective zeros; then computes the other eigenvalues.
 * Into l, sorted. */
int pw_linear_eigenvalues (pw_linearisation *x, pw_linear *l, pw_error *error);

/* ---- linear_modes.c ---- */

/* Fills B and basis. */
int pw_linear_matrices (pw_linearisation *x, pw_linear *l);
/* Fills the shapes after k rigid displacements have been split off; eigenvalues are not yet sorted. */
int pw_linear_shapes (pw_linearisation *x, int k, pw_linear *l);

/* ---- linear_frame.c ---- */

/* Chooses the frame in which the accelerations of the evaluated state are smallest. */
void pw_linear_choose_frame (pw_linearisation *x);
/* What the variation x changes, in units of the scene, 0 for a symmetry: violations, then `n` accelerations; turns: 1 if it is a
 * rotation of the whole by 1 rad, with which accelerations rotate. */
void pw_linear_asymmetry (pw_linearisation *x, int turns, double *out);
/* Number of rigid displacements of the whole (x, y, phi) under which the equations are invariant to first order; their
 * directions go to S. */
int pw_linear_symmetries (pw_linearisation *x);
/* Determines whether A is constant along the motion; see pw_linear.  Leaves the workspace at the current state. */
pw_steadiness pw_linear_steady (pw_linearisation *x);

#endif
