/* The compiled system and the workspace of a run, for core/ and solvers/, not for models.
 *
 * Each is one allocation.  Index names: body b, batch k, element e of a batch, local column c of an element,
 * global coordinate j, row i.  Arrays that are scattered into have three entries more than there are coordinates:
 * the ground's, never read. */
#ifndef PW_SYSTEM_H
#define PW_SYSTEM_H

#include "run.h"
#include "model.h"
#include "signal.h"

/* One element type in use: its batch, and where its constraint equations and coordinates are.  What a run modifies (the last four
 * arrays, and the pointers of the batch to configurations, velocities and signals) is only in the batches of a workspace. */
typedef struct {
  pw_batch b; /* as the element type sees it */
  const pw_kind *kind;
  int row;           /* global index of its first row */
  int own;           /* global index of its first internal coordinate */
  const int *column; /* count x bodies: first coordinate of each body; the ground's is s->coords */
  const char **name; /* count */
  double *J;         /* count x rows x cols */
  double *block;     /* forces, energies, contacts: count x cols scratch */
  double *u;         /* count x signals x 3, as b.u */
  pw_source *source; /* count x signals, among all */
} pw_element_batch;

/* An account of work or loss. */
typedef struct {
  int batch, element;
  enum { PW_WORK, PW_LOSS } type;
} pw_entry;

/* Never modified after pw_system_compile: any number of runs and threads share it. */
struct pw_system {
  const char *model;
  int bodies, coords, rows, holonomic, batches, entries;
  int constraints;         /* batches with rows */
  int forces;              /* batches with a force that is not constant */
  int saturates;           /* 1: some of these have a sweep `saturation` */
  int sources;             /* signals */
  int readers;             /* function signals that read states */
  int reads;               /* states read by them, in all */
  int moving;              /* batches with an eta: constraints that move */
  pw_scale scale;          /* its time is 1 s: that of a run is in the workspace */
  const char **body_name;  /* bodies */
  double *mass;            /* coords: diagonal of M */
  double *constant;        /* coords + 3: sum of the forces that never change */
  double *metric;          /* coords: M, and small weights where M is zero */
  double *q0, *v0;         /* coords: the described start */
  unsigned char *held;     /* 2 coords: where initial values are from: PW_GIVEN, ... */
  pw_element_batch *batch; /* batches: holonomic kinds first, then nonholonomic ones, then forces */
  pw_source *source;       /* sources: batch by batch */
  pw_entry *entry;         /* entries */
};

/* What a run modifies (pinwheel.h). */
struct pw_workspace {
  const pw_system *s;
  pw_element_batch *batch;         /* batches: the system's, with arrays of this workspace */
  pw_element_batch **force;        /* those with a force that is not constant */
  pw_source *source;               /* sources */
  pw_configuration *configuration; /* bodies + 1; the last is the ground */
  double *scratch;                 /* rows x 3 + coords + 3 */
  pw_scale scale;                  /* the run's */
  int hold;                        /* 1: signals of forces keep their values (inputs=held) */
  double t_signal;                 /* the time the signals were last evaluated at; NaN: never */
  const pw_source *failed;         /* the signal that has failed last; NULL: none */
};

/* Closes the contexts that functions have of their own; signals that have not been opened are all zero. */
void pw_close_signals (const pw_source *source, int count);

/* Where an initial value is from: given by the user, who has the last word; specified by the model; or a position 0 of a model
 * that does not say whether it is meant.  0: left out. */
enum { PW_GIVEN = 1, PW_SPECIFIED = 2, PW_PERHAPS = 4 };

/* The signal that has failed last, "torque T: value", or "".  Returns the buffer. */
char *pw_failed_signal (const pw_workspace *w, char *buffer, size_t size);

/* 1 for a coordinate that is an angle, 0 for a length; coordinates that elements own are angles. */
static inline int pw_is_angle (const pw_system *s, int j) {
  return j >= 3 * s->bodies || j % 3 == 2;
}

/* The scene's unit of a coordinate: L or 1 rad. */
static inline double pw_unit (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? 1 : s->scale.length;
}

/* The larger of two numbers, at the price of a comparison; the second if one is none. */
static inline double pw_larger (double a, double b) {
  return a > b ? a : b;
}

/* ---- Placing: configurations and signals for one (t, q, v), on which all sweeps below work ---- */

int pw_update_kinematics (pw_workspace *w, double t, const double *q, const double *v);
/* New velocities at unchanged time and positions; signals that read velocities are evaluated anew.  Returns as pw_update_kinematics. */
int pw_update_velocities (pw_workspace *w, const double *v);

/* 1: the signals of forces keep the values of the last placed time; 0: they follow the time again. */
void pw_hold_signals (pw_workspace *w, int hold);

/* ---- Sweeps; g and the like are `rows` long, f and w `coords` + 3 ---- */

void pw_evaluate_J (pw_workspace *w);                    /* fills every batch's J */
void pw_evaluate_g (pw_workspace *w, double *g);         /* holonomic rows only */
void pw_evaluate_g_size (pw_workspace *w, double *size); /* not below the length scale */
void pw_evaluate_eta (pw_workspace *w, double *eta);
void pw_evaluate_gamma (pw_workspace *w, double *gamma);
void pw_evaluate_force (pw_workspace *w, double *f);
void pw_evaluate_constant (pw_workspace *w, double *f); /* adds the forces that never change */
/* By how much each state may change until a force at the placed state that saturates has changed by its own size: 2 coords;
 * INFINITY where none does.  Works as long as the scene `saturates`. */
void pw_evaluate_saturation (pw_workspace *w, double *least);
/* The smallest of them for velocities, its state, or -1 if none saturates, and its element: "friction hinge". */
int pw_find_saturation (pw_workspace *w, double *least, char *element, size_t size);
double pw_potential (pw_workspace *w);
double pw_kinetic (const pw_system *s, const double *v);
/* Rates of the ledger's entries [W]; needs J, and lambda. */
void pw_evaluate_ledger (pw_workspace *w, const double *lambda, double *rate);

/* out = J x, out += J^T lambda with the J last swept. */
void pw_mul_J (const pw_workspace *w, const double *x, double *out);
void pw_add_JT (const pw_workspace *w, const double *lambda, double *out);

/* Global coordinate of a local column; >= coords: the ground's. */
static inline int pw_global (const pw_element_batch *k, int e, int c) {
  int n = 3 * k->kind->bodies;
  return c < n ? k->column[e * k->kind->bodies + c / 3] + c % 3 : k->own + e * k->kind->own + c - n;
}

/* Residuals of the placed state with J swept: scaled and absolute worst. */
typedef struct {
  double position, velocity, g, jv;
  int row_position, row_velocity; /* where */
} pw_residuals;
/* Of the rows with enforced[i] != 0, if that is given. */
void pw_evaluate_residuals (pw_workspace *w, const unsigned char *enforced, pw_residuals *r);
void pw_evaluate_position_residual (pw_workspace *w, const unsigned char *enforced,
                                    pw_residuals *r); /* only the positions' */
void pw_evaluate_velocity_residual (pw_workspace *w, const unsigned char *enforced,
                                    pw_residuals *r); /* only the rates' */
/* The worst of g into the part of the positions. */
void pw_worst_position (const pw_system *s, const double *g, const double *size, const unsigned char *enforced,
                        pw_residuals *r);

/* First discontinuity of any signal after t, or INFINITY, with `knots` also kinks in the acceleration of what drives a
 * constraint; NaN if a function tells none of both: it has failed. */
double pw_next_breakpoint (pw_workspace *w, int knots, double t);

/* 1 if an element's force, J or gamma is not finite at the state in place, and which: "force of attraction sun", written to
 * the buffer. */
int pw_find_nonfinite (pw_workspace *w, char *buffer, size_t size);

/* Second-order blocks: what the exact Newton matrices of implicit methods need besides M, J and J^T. */
typedef enum { PW_JW_Q, PW_JTL_Q, PW_ETA_Q, PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V, PW_BLOCKS } pw_block;

/* The kind's sweep for a block: NULL if identically zero, pw_by_differences if the core has to difference. */
pw_batch_function *pw_block_function (const pw_kind *kind, pw_block block);

/* Rows of a block per element: kind->rows, or the local columns. */
int pw_block_rows (const pw_kind *kind, pw_block block);

/* Fills count x block rows x cols for a batch whose configurations, w and lambda are placed; by central differences of the
 * function below where the kind asks for it.  Returns 0 and leaves out alone where the block is identically zero. */
int pw_evaluate_block (const pw_workspace *w, const pw_element_batch *k, pw_block block, double *out);

/* 1 if the kind leaves the block of element e out as identically zero, but by differences it is not; configurations, w and lambda are
 * placed. */
int pw_block_missing (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block);

/* Looks for such a block near the state q, v at time t, in a few elements of each kind that is not built in (these pass the
 * self-test).  1 and its name ("force_q of element type well"), written to the buffer; 0 if there is none; PW_RESOURCE.
 * The state has to be placed again afterwards. */
int pw_find_missing (pw_workspace *w, double t, const double *q, const double *v, char *buffer, size_t size);

/* The same block of element e by central differences, whatever the kind provides; for the self-test as well. */
void pw_difference (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block, double *out);

#endif
