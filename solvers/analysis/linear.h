/* A linearisation in progress, for linear.c and for analyses that need its parts.  The system has n coordinates and m
 * constraint equations; a variation of the state is dx = (dq, dv), and has `size` minimal coordinates: first those of
 * positions, then those of velocities.  The equations are in linear.c. */
#ifndef PW_LINEAR_H
#define PW_LINEAR_H

#include "pinwheel-analysis.h"
#include "tangent.h"

/* The co-moving frame. */
typedef struct {
  double origin[2];    /* of the frame [m] */
  double twist[3];     /* velocity of the origin, angular velocity [m/s, rad/s] */
  double residual;     /* largest acceleration in the frame, in units of the scene */
  double acceleration; /* the same in m/s^2, angles times L */
} pw_linear_frame;

typedef struct {
  pw_run *r;
  int n, m;
  pw_tangent tangent;  /* independent equations; in tangent.scatter the derivatives: columns q, v; rows as `product` */
  int holonomic, rank; /* independent constraint equations: holonomic ones; all, those first */
  /* Minimal coordinates: of positions; of velocities and first-order states, which are the last columns of Q; all. */
  int positions, velocities, size;
  int unturned;   /* angles that nothing turns (pw_is_unturned), which are left out */
  const int *row; /* rank: indices of the independent equations */
  pw_linear_frame frame;
  double *a, *lambda;            /* n + 3, m: at the state last evaluated */
  double *norm;                  /* m: lengths of the rows of J, columns of angles divided by L */
  double *R;                     /* rank x rank: J^T = Q R, by columns; before that the rows of J, n long each */
  double *Q;                     /* n x n, by columns: the unturned angles; J^T; its null space */
  double *A;                     /* size x size, by rows: in the result */
  double *symmetry;              /* 3 x size: symmetry directions in minimal coordinates */
  double *dx;                    /* 2 n: a variation */
  double *product;               /* n + 2 m: derivatives of J^T lambda - f, gamma - J a, J v - eta, times dx */
  double *da;                    /* n + 3: the resulting variation of accelerations */
  double *scratch, *row_scratch; /* n + 3 m + 3, m */
  double *residual;              /* 3 x (2 m + n): asymmetries of rigid displacements; scratch */
  double *probe, *probe_da;      /* 2 n, n: a variation at the current state, and its da */
  double *probe_a;               /* n: accelerations at the current state */
  double *later;                 /* 2 n: a later state */
  char *memory;
  int modes;            /* 1: PW_LINEAR_MODES, which needs the following */
  double *left_vectors; /* size^2 + size: left eigenvectors of A22^T, then imaginary parts of its eigenvalues */
  double *upper_rows;   /* 3 x size: [ A11 A12 ] (linear.c); then scratch, size */
  double tau[3];        /* scalars of the reflections in `symmetry` */
} pw_linearisation;

/* Round-off of derivatives of moderate size, relative to them. */
#define PW_LINEAR_SYMMETRIC 1e-9

/* What is computed: numbers; derivatives, bases and A, dense matrices; also B, basis, shapes. */
typedef enum { PW_LINEAR_COUNTS, PW_LINEAR_BASES, PW_LINEAR_MODES } pw_linear_extent;

/* Opens a linearisation of the run's system.  PW_OK or PW_RESOURCE; close it in every case. */
int pw_linear_open (pw_linearisation *x, pw_run *r, pw_linear_extent extent);
void pw_linear_close (pw_linearisation *x);

/* Evaluates accelerations and derivatives at a state; kinematics are left there.  Returns as pw_run_accelerate. */
int pw_linear_evaluate (pw_linearisation *x, double t, const double *q, const double *v);
/* J^T = Q R of the independent rows of J, as from pw_rank_rows, at the state evaluated. */
void pw_linear_bases (pw_linearisation *x);
/* Computes `product` and da from the variation dx. */
void pw_linear_vary (pw_linearisation *x);
/* Sets dx to the variation along minimal coordinate c. */
void pw_linear_tangent (pw_linearisation *x, int c);
/* The minimal coordinates of a variation, `stride` apart. */
void pw_linear_coordinates (const pw_linearisation *x, const double *dq, const double *dv, int stride, double *out);
/* out += W in: (x, y) of each body, rotated by 90 degrees and times w. */
void pw_linear_turn (const pw_linearisation *x, double w, const double *in, double *out);
/* out = in with (x, y) of each body rotated by an angle. */
void pw_linear_rotate (const pw_linearisation *x, double angle, const double *in, double *out);
/* out: orthonormal rows of length n that span the null space of M (rows x n, by columns, destroyed; rows >= n > 0).
 * Singular values up to the tolerance, or up to round-off, count as 0.  Returns the number of rows, or a status < 0. */
int pw_null_space (int rows, int n, double *M, double tolerance, double *out);
/* What the variation dx changes, in units of the scene, 0 for a symmetry: `holonomic` + `rank` residuals, then n
 * accelerations; turn: by what angle dx rotates the whole, with which accelerations rotate [rad]. */
void pw_linear_asymmetry (pw_linearisation *x, double turn, double *out);

#endif
