/* Repeated assembly of a sparse matrix by the same sequence of contributions: the sequence is recorded once and laid
 * out in compressed columns; from then on the number of a contribution in the sequence determines where it is added. */
#ifndef PW_TANGENT_H_
#define PW_TANGENT_H_
#include <string.h>
#include "method.h"

typedef struct {
  int recording;      /* 1: contributions are recorded; 0: they are added */
  size_t count, room; /* number of contributions; number that `entry` has room for */
  struct pw_scatter_entry {
    int row, col;
    size_t number;
  } * entry;                /* while recording */
  int failed;               /* 1: out of memory while recording */
  int64_t *colptr, *rowind; /* the pattern laid out, in compressed columns */
  size_t nonzeros;          /* of the matrix */
  double *value;            /* nonzeros: for the values; callers may have them elsewhere */
  size_t *place;            /* of each contribution: the index of the value to which it is added */
  size_t next;              /* while filling: number of the next contribution */
  double *filled;           /* while filling: the values */
} pw_scatter_map;

/* From now on contributions are recorded; their values are ignored.  *t: new or closed; it is overwritten. */
static inline void pw_scatter_begin_record (pw_scatter_map *t) {
  *t = (pw_scatter_map){ .recording = 1 };
}

/* Ends the recording, of a matrix with n columns and at most n rows.  PW_OK or PW_RESOURCE; close the map in both
 * cases. */
int pw_scatter_lay_out (pw_scatter_map *t, int n);
void pw_scatter_close (pw_scatter_map *t);

/* From now on contributions are added to these values, which are set to 0 first. */
static inline void pw_scatter_begin_fill (pw_scatter_map *t, double *value) {
  t->next = 0;
  t->filled = memset (value, 0, t->nonzeros * sizeof *value);
}

void pw_scatter_record_entry (pw_scatter_map *t, int row, int col);

/* The next contribution. */
static inline void pw_scatter_add (pw_scatter_map *t, int row, int col, double value) {
  if (t->recording)
    pw_scatter_record_entry (t, row, col);
  else
    t->filled[t->place[t->next++]] += value;
}

/* Adds derivatives of the equations of motion to a sparse matrix: for the linearisation, J and the second-order blocks
 * (system.h) of all elements; for the Newton matrices of implicit methods, the rows of these equations:
 *
 *   momentum        M a + J^T lambda - f
 *   accelerations   J a - gamma + 2 alpha (J v - eta) + beta^2 g   (nonholonomic: + alpha (J v - eta))
 *
 * with Baumgarte's alpha and beta.  Some methods have further multipliers mu, one for each of the first mu_count
 * active equations. */

typedef struct {
  pw_run *run;
  int rows, holonomic; /* active equations; holonomic ones */
  int *row_index;      /* all equations: index among the active ones, or -1 */
  int *row;            /* rows: index among all equations */
  double *lambda;      /* all equations: scratch for pw_tangent_expand */
  double *D;           /* coords: 1 for lengths, 1/L^2 for angles, as below */
  double *block;       /* scratch: the largest block of a batch, or its force_u */
  double *direction;   /* scratch: the largest count x cols */
  double *gradient;    /* scratch for pw_feedback_rate_gradient */
  pw_scatter_map scatter;
  char *memory;
} pw_tangent;

int pw_tangent_open (pw_tangent *x, pw_run *r); /* PW_OK or PW_RESOURCE; close it in every case */
void pw_tangent_close (pw_tangent *x);

/* Fills `all`, which is returned: multipliers of the first `count` active equations, 0 for the others. */
const double *pw_tangent_expand (const pw_tangent *x, const double *active, int count, double *all);
/* Values of the first `count` active equations from those of all. */
void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *active);

/* Where and how a block is added.  Its rows are coordinates or constraint equations. */
typedef struct {
  int row, col;               /* row and column of the matrix for coordinate or equation 0 */
  int rows;                   /* constraint equations included: all, s->rows, or the holonomic ones, s->holonomic */
  double factor;              /* of blocks of forces and (J^T lambda)_q, and of what holonomic equations add */
  double factor_nonholonomic; /* of what nonholonomic equations add: to J, J^T, and blocks whose rows they are */
  const double *row_scale;    /* further factors, one for each row from `row` on; NULL: 1 */
  const int *row_index;       /* equations: new index of each, -1: omitted; NULL: indices do not change */
  const double *direction;    /* coordinates: w of the block (J w)_q; NULL for other blocks */
  const double *lambda;       /* equations: multipliers of the block (J^T lambda)_q; NULL for other blocks */
} pw_placement;

/* Adds a block of every batch, at the kinematics last updated. */
void pw_tangent_add_block (pw_tangent *x, pw_block block, const pw_placement *put);
/* Adds J^T, with the J last evaluated; its columns are constraint equations. */
void pw_tangent_add_JT (pw_tangent *x, const pw_placement *put);
/* Adds -(derivative of the force with respect to signals) x (derivative of signals with respect to states): rows from
 * `row` on, q in columns from col_q on, v in columns from col_v on. */
void pw_tangent_add_signals (pw_tangent *x, int row, int col_q, int col_v);

/* What depends on the signals of velocity constraints that read states: (J^T lambda)_u, rows from `row` on are
 * coordinates; or, if lambda is NULL, derivatives of J w - eta or, if a is not NULL, of J a - gamma with w = v, where
 * rows are constraint equations. */
typedef struct {
  int row, q, v;         /* first row; first columns of q and v */
  double factor, q_part; /* factor of all; further factor of derivatives with respect to q */
  const int *row_index;  /* as in pw_placement */
  const double *lambda;  /* equations */
  const double *w, *a;   /* coordinates */
} pw_feedback;
void pw_tangent_add_feedback (pw_tangent *x, const pw_feedback *put);

/* Adds a block whose rows are the active constraint equations, from a row and column on, times the factors `holonomic`
 * and `nonholonomic`; w: the vector of the block (J w)_q. */
void pw_tangent_add_equations (pw_tangent *x, pw_block block, int row, int col, const double *w, double holonomic,
                               double nonholonomic);
/* Adds in the same way the active rows of J: of all equations (rows = s->rows), or of the holonomic ones
 * (s->holonomic). */
void pw_tangent_add_J (pw_tangent *x, int rows, int row, int col, double holonomic, double nonholonomic);

/* Where the parts of the equations are in the matrix, and factors of derivatives. */
typedef struct {
  int momentum, constraint; /* first row of each */
  int q, v, a, lambda;      /* first column of each; a may share its columns with v */
  double a_factor;          /* of derivatives with respect to a */
  double lambda_factor;     /* of those with respect to lambda */
} pw_tangent_layout;

/* Add the rows of one part at the current configuration, where J is evaluated; lambda: all equations. */
void pw_tangent_add_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda);
void pw_tangent_add_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a);

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
