/* The self-test's probe: a random state of a random scene, and the derivatives of an element type's functions there. */
#ifndef PW_PROBE_H
#define PW_PROBE_H

#include "pinwheel-selftest.h"
#include "random_scene.h"

enum {
  PW_PROBE_COORDS = 3 * PW_SCENE_BODIES + PW_SCENE_BATCH * PW_MAX_INTERNAL,
  PW_PROBE_OUT = PW_SCENE_BATCH * PW_MAX_COLS * PW_MAX_COLS,
  PW_PROBE_GUARD = 8,   /* guard numbers after an array, which must not change */
  PW_PROBE_MOTION = -1, /* moves other than of one coordinate */
  PW_PROBE_TIME = -2
};

#define PW_PROBE_STEP 0x1p-17 /* step of the differences, near eps^(1/3) = 6e-6 */

/* The scene, the state and the report of the test. */
typedef struct {
  const pw_kind *kind;
  const pw_system *s;
  pw_workspace *work;
  pw_element_batch *k;
  int elements, rows, cols; /* rows and cols per element */
  double t, q[PW_PROBE_COORDS], v[PW_PROBE_COORDS], a[PW_PROBE_COORDS];
  double q_now[PW_PROBE_COORDS], v_now[PW_PROBE_COORDS]; /* the current state */
  double w[PW_SCENE_BATCH * PW_MAX_COLS], lambda[PW_SCENE_BATCH * PW_MAX_ROWS];
  double size; /* largest value of the function last differenced */
  pw_selftest_report *report;
} pw_probe;

/* Computes n values at the current state; `out` has room for PW_PROBE_GUARD more. */
typedef void pw_probe_function (pw_probe *x, double *out);

/* Sets a random state. */
void pw_probe_randomise (pw_probe *x, pw_random *r);

/* Updates the kinematics to the state moved by h: along the motion q + v h + a h^2 / 2, in time only, or in
 * coordinate j. */
void pw_probe_update (pw_probe *x, int j, double h);

/* Calls a function that fills n numbers; NULL gives zeros.  Reports a function that writes more or fewer. */
void pw_probe_evaluate (pw_probe *x, pw_batch_function *f, const char *name, int n, double *out);

/* Derivatives of n values of f along a move (see pw_probe_update). */
void pw_probe_derivative (pw_probe *x, pw_probe_function *f, int j, int n, double *derivative);

/* out = J w, element by element; w: over all coordinates. */
void pw_probe_multiply_J (pw_probe *x, const double *w, double *out);

int pw_probe_ground (const pw_probe *x, int e, int c); /* 1: local column c of element e belongs to the ground */
double pw_probe_local (const pw_probe *x, const double *vector, int e,
                       int c); /* its entry in a vector over all coordinates; 0 for the ground */
double pw_probe_largest (int n, const double *y);

/* The bound of all comparisons with differences, and its reason. */
double pw_probe_bound (void);
extern const char pw_probe_reason[];

/* Records the result of a check, keeping the worst. */
void pw_probe_record (pw_selftest_report *r, const char *name, const char *about, double error, double bound,
                      const char *reason, const char *where);

/* Compares elements x rows x cols entries, except the meaningless columns of the ground. */
void pw_probe_compare (pw_probe *x, const char *name, const char *about, int rows, int cols, const double *value,
                       const double *reference);

#endif
