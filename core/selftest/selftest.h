/* Random numbers, and random scenes of elements of one type, for the self-test and specialise.c. */
#ifndef PW_SELFTEST_H_
#define PW_SELFTEST_H_
#include <stdint.h>
#include "system.h"
#include "pinwheel-selftest.h"

enum {
  PW_SCENE_BODIES = 4,
  PW_SCENE_ELEMENTS = 3,
  PW_SCENE_BATCH = 4, /* most elements of the compiled scene: one per body, or the described ones */
  PW_SCENE_COORDS = 3 * PW_SCENE_BODIES + PW_SCENE_BATCH * PW_MAX_INTERNAL /* most coordinates */
};

/* Random numbers, the same on every machine. */
typedef struct {
  uint64_t state; /* initially the seed */
} pw_random;
double pw_random_between (pw_random *r, double low, double high);

/* Compiles a scene of bodies b0 to b3 and elements e0 to e2, which form its only batch, with random definitions within
 * the domains of the type's fields.  If e2 has several bodies, one is the ground.  A type that acts on every body has
 * one element only.  NULL and the error if the type rejects 200 such definitions, or if out of memory.  error: not
 * NULL; cleared first. */
pw_system *pw_random_scene (const pw_kind *kind, pw_random *random, pw_error *error);

/* The probe of the self-tests: the elements of one type in a scene (a batch), in a state that is moved to compute
 * differences of the type's functions. */

enum {
  PW_PROBE_OUT = PW_SCENE_BATCH * PW_MAX_COLS * PW_MAX_COLS, /* most numbers that a function fills in a random scene */
  PW_PROBE_GUARD = 8                                         /* guard numbers after an array, which must not change */
};

/* Moves by h: along dq; along dv; in time, by h tau; in time and along the motion q + v s + a s^2 / 2, s = h tau. */
typedef enum { PW_PROBE_Q, PW_PROBE_V, PW_PROBE_TIME, PW_PROBE_MOTION } pw_probe_move;

/* The checks of both self-tests: names, and identities checked. */
#define PW_PROBE_CHECKS                                                    \
  PW_PROBE_CHECK (table, "consistent sizes, fields and functions")         \
  PW_PROBE_CHECK (size, "each function fills exactly its array")           \
  PW_PROBE_CHECK (J, "J = dg/dq")                                          \
  PW_PROBE_CHECK (eta, "eta = -dg/dt")                                     \
  PW_PROBE_CHECK (g_size, "g_size >= |g|")                                 \
  PW_PROBE_CHECK (gamma, "J a - gamma = d(J v - eta)/dt")                  \
  PW_PROBE_CHECK (force_u, "force_u = d force/du")                         \
  PW_PROBE_CHECK (constant, "a constant force does not change")            \
  PW_PROBE_CHECK (jw_q, "jw_q = d(J w)/dq")                                \
  PW_PROBE_CHECK (eta_q, "eta_q = d eta/dq")                               \
  PW_PROBE_CHECK (gamma_q, "gamma_q = d gamma/dq")                         \
  PW_PROBE_CHECK (gamma_v, "gamma_v = d gamma/dv")                         \
  PW_PROBE_CHECK (force_q, "force_q = d force/dq")                         \
  PW_PROBE_CHECK (force_v, "force_v = d force/dv")                         \
  PW_PROBE_CHECK (saturation, "saturation velocity of a saturating force") \
  PW_PROBE_CHECK (power, "force . v = power - loss - d energy/dt")         \
  PW_PROBE_CHECK (loss, "loss >= 0")                                       \
  PW_PROBE_CHECK (gradient, "gradient = d signal/d state")
#define PW_PROBE_CHECK(name, about) PW_CHECK_##name,
typedef enum { PW_PROBE_CHECKS } pw_check;
#undef PW_PROBE_CHECK

typedef struct {
  const pw_kind *kind;
  const pw_system *s;
  pw_workspace *workspace;
  pw_element_batch *batch;     /* of the element type, in the workspace */
  int elements, rows, cols;    /* rows and cols per element */
  double t, tau;               /* the time, and the unit of its changes [s] */
  double *q, *v, *a, *dq, *dv; /* coords: the state and its acceleration; directions of moves */
  double *q_now, *v_now;       /* coords: the state as moved by the last update */
  double *w, *lambda;          /* elements x cols, elements x rows: the vector w of jw_q, the multipliers */
  double *J, *eta;             /* at the moved state */
  int failed;                  /* 1: a signal failed */
  int check_sizes;             /* 1: also checks that each function fills exactly its array */
  pw_selftest_report *report;
  char *memory; /* of the arrays; the caller frees it in every case */
} pw_probe;

/* Computes numbers at the moved state; `out` has room for PW_PROBE_GUARD more. */
typedef void pw_probe_function (pw_probe *probe, double *out);

/* Allocates the arrays of a probe whose s, workspace, batch and report the caller has set.  PW_OK or PW_RESOURCE. */
int pw_probe_open (pw_probe *probe, pw_error *error);

/* Updates the kinematics to the state moved by h. */
void pw_probe_update (pw_probe *probe, pw_probe_move move, double h);

/* Calls a function of the type, which fills n numbers; NULL gives zeros.  name: of the function, for the report. */
void pw_probe_evaluate (pw_probe *probe, pw_batch_function *f, const char *name, int n, double *out);

/* Functions of the type; J w; J v - eta. */
pw_probe_function pw_probe_g, pw_probe_g_size, pw_probe_eta, pw_probe_J, pw_probe_gamma, pw_probe_force,
    pw_probe_energy, pw_probe_power, pw_probe_loss, pw_probe_Jw, pw_probe_drift;

/* out += factor x block x vector, element by element: the block has `rows` rows per element, the vector an entry for
 * each coordinate of the scene.  terms, unless NULL, += absolute values of the terms. */
void pw_probe_multiply (const pw_probe *probe, const double *block, int rows, const double *vector, double factor,
                        double *out, double *terms);
void pw_probe_multiply_J (pw_probe *probe, const double *vector, double *out); /* out = J vector */

int pw_probe_ground (const pw_probe *probe, int e, int c); /* 1: local column c of element e belongs to the ground */
/* The entry of local column c of element e in a vector with an entry for each coordinate; 0 for the ground. */
double pw_probe_local (const pw_probe *probe, const double *vector, int e, int c);

/* Records the result of a check, keeping the worst. */
void pw_probe_record (pw_selftest_report *r, pw_check check, double error, double bound, const char *reason,
                      const char *where);
const char *pw_check_name (pw_check check);

#endif
