/* The compiled system and the workspace of a run, for core/ and solvers/, not for models.
 *
 * Names: system s, workspace w; body b, batch k, element e of a batch, local column c of an element, global coordinate
 * j, constraint equation (row) i.  Arrays that elements add to have three additional entries after the coordinates,
 * those of the ground: they need not be set before, and their values mean nothing. */
#ifndef PW_SYSTEM_H
#define PW_SYSTEM_H

#include <math.h>
#include "run.h"
#include "model.h"

/* A signal of one element, and the states it reads. */
typedef struct {
  pw_signal signal;
  int reads;         /* number of states a function signal reads */
  const int *state;  /* their indices: coordinate j, or coordinates + j for a velocity */
  double *x;         /* 2 reads: values of these states, then the gradient if it is needed */
  double *spline;    /* of a table: see pw_table_spline */
  double *u;         /* 3: receives value, first and second time derivative; x, u: NULL except in a workspace */
  int of_force;      /* 1: belongs to a force, which needs no derivatives */
  int of_coordinate; /* 1: a function of the coordinate that it reads, not of the time */
  int held;          /* 1: keeps its value (pw_hold_signals) */
  int gradient;      /* 1: the gradient is needed: of feedback, and where implicit methods or linearisations need it */
  int feedback; /* 1: belongs to a velocity constraint and reads states; u[2]: its partial derivative by the time */
} pw_source;

/* One element type in use: its batch, and the indices of its constraint equations and coordinates.  What a run modifies
 * (J, block, and q, v, u, w, lambda and the configurations of b) is NULL in a system: workspaces have it. */
typedef struct {
  pw_batch b; /* the argument of the type's functions */
  const pw_kind *kind;
  int unrolled;      /* bodies of an element, 1 or 2, without internal coordinates; else 0 */
  int adds_force;    /* 1: it has a force that is not constant */
  int row;           /* global index of its first constraint equation */
  int internal;      /* global index of its first internal coordinate */
  int *column;       /* count x bodies: first coordinate of each body; s->coords for the ground */
  const char **name; /* count */
  double *J;         /* count x rows x cols */
  double *block;     /* pw_workspace.block: scratch for forces, energies, powers, saturation; all batches share it */
  pw_source *source; /* count x signals, part of the array of all sources */
} pw_element_batch;

/* An entry of the ledger. */
typedef struct {
  int batch, element;
  enum { PW_WORK, PW_LOSS } type;
  int whole; /* entries from this one on if they are those of the whole batch, by a function of its type; else 0 */
} pw_entry;

/* A limit that varies: its element and field. */
typedef struct {
  int batch, element;
  const pw_field *field;
} pw_limit_signal;

/* An output of the model. */
typedef struct {
  const char *name, *unit;
  pw_function function;  /* with a context of the system or workspace */
  const pw_column *read; /* reads: the columns that it reads, also earlier outputs */
  int reads;
  unsigned types; /* of these columns, and of those that these outputs read: 1 << type or'ed */
} pw_compiled_output;

/* Constant after pw_system_compile: any number of runs and threads may share it. */
struct pw_system {
  pw_arena arena; /* contains all arrays but `batch` */
  const char *model;
  int bodies, coords, rows, holonomic, batches, entries;
  int mechanical;                /* coordinates but those of first-order states (state.c), which are the last ones */
  int constraints, positions;    /* batches with constraint equations; with holonomic ones, which come first */
  int forces, first_force;       /* batches with a force that is not constant; the first one */
  int saturates;                 /* 1: some of these have a function `saturation` */
  int sources;                   /* signals */
  int limit_sources;             /* those of limits that vary, the first ones */
  int state_dependent;           /* signals that depend on states or on an internal coordinate */
  int feedback;                  /* those of them that belong to velocity constraints */
  int reads;                     /* number of states that they read, with repetitions */
  size_t jacobian;               /* entries of J of all elements, zeros included */
  size_t block;                  /* the largest count x cols of a batch; twice that if its force saturates */
  int powers;                    /* entries of the ledger but those of impacts */
  int rheonomic;                 /* batches whose eta may be other than 0 */
  int limited;                   /* constraint equations whose multipliers have limits */
  pw_bounds *limit;              /* rows, if there are any; else NULL */
  int (*limit_source)[2];        /* rows: the signals pw_bounds.signal, -1: none */
  pw_limit_signal *limit_signal; /* limit_sources */
  pw_scale scale;                /* with T = 1 s; T of a run is in its workspace */
  const char **body_name;        /* bodies */
  double *M;                     /* coords: diagonal of M; 0 of first-order states, which have no kinetic energy */
  double *mass;            /* coords: the same, but the mean where nothing turns a body (pw_is_unturned); 1 of states */
  const char **state_unit; /* 2 (coords - mechanical): of each first-order state and of its rate */
  int *angle_user;         /* bodies: of one without inertia the first element that depends on its angle; -1: none */
  double *constant;        /* coords + 3: sum of the constant forces */
  double *metric;          /* coords: M, and small weights where M is zero */
  double *q0, *v0;         /* coords: the described initial state, or values of pw_model_set_initial */
  unsigned char *origin;   /* 2 coords: origin of initial values: PW_GIVEN | ... */
  pw_element_batch *batch; /* batches: holonomic types, then nonholonomic ones, then forces */
  pw_source *source;       /* sources: those of limits, then those of elements, ordered by batch */
  pw_entry *entry;         /* entries; losses by impacts alone are the last ones */
  pw_path **path;          /* paths: of elements */
  int paths;
  pw_compiled_output *output; /* outputs */
  int outputs;
  unsigned output_types; /* of the columns that they read, as pw_compiled_output.types */
};

/* Signals that keep their values: none; those of forces, except rates of first-order states; rates too; all. */
typedef enum { PW_HOLD_NONE, PW_HOLD_INPUTS, PW_HOLD_FORCES, PW_HOLD_ALL } pw_hold;

/* What a run modifies (pinwheel.h). */
struct pw_workspace {
  const pw_system *s;
  pw_element_batch *batch;         /* batches: copies of the system's, with arrays of this workspace */
  pw_source *source;               /* sources: copies of the system's, with contexts of this workspace */
  pw_compiled_output *output;      /* outputs: the same */
  double *output_value;            /* outputs */
  double (*contact)[3];            /* contacts: place and heading, as of the last use */
  double *u, *J;                   /* those of all batches: sources x 3; entries of J, element by element */
  pw_configuration *configuration; /* bodies + 1; the last is the ground */
  double *scratch;                 /* rows x 3 + coords + 3, for the function in progress */
  double *block;                   /* results of one function of one batch, until the next one is called */
  pw_scale scale;                  /* the run's */
  pw_hold hold;                    /* signals that keep their values (pw_hold_signals) */
  double t_signal;                 /* time of the last evaluation of signals; NaN: evaluate them again */
  const pw_source *failed;         /* the last signal that failed, or NULL */
};

static inline int pw_fail_memory (const pw_system *s, pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
}

/* Opens a function unless *status reports that one could not be opened; then nothing has to be closed. */
void pw_open_function (pw_function *f, int *status);
/* Closes the functions of signals, which may be all zero if they have not been stored yet, and of outputs. */
void pw_close_functions (const pw_source *source, int sources, const pw_compiled_output *output, int outputs);

/* Origin of an initial value: given by the user, which takes precedence; specified by the model; a position 0 of a body
 * that does not say which values are specified.  0: none of these. */
enum { PW_GIVEN = 1, PW_SPECIFIED = 2, PW_ZERO_POSITION = 4 };

/* Writes "ELEMENT.what", or "ELEMENT.BODY.what" if its type acts on every body, to the buffer, which is returned. */
char *pw_member_name (const pw_system *s, const pw_element_batch *k, int e, const char *what, char *buffer,
                      size_t size);

/* Writes the last signal that failed, "torque T: value", or "", to the buffer and returns it. */
char *pw_failed_signal (const pw_workspace *w, char *buffer, size_t size);
int pw_fail_evaluation (const pw_workspace *w, double t, pw_error *error); /* reports it; returns PW_METHOD */

/* 1 for an angle, 0 for a length; internal coordinates are angles. */
static inline int pw_is_angle (const pw_system *s, int j) {
  return j >= 3 * s->bodies || j % 3 == 2;
}

/* 1 for the angle of a body without inertia that nothing turns: no constraint, force or signal depends on it.  Its
 * acceleration is 0, whatever stands for its inertia in the equations. */
static inline int pw_is_unturned (const pw_system *s, int j) {
  return s->M[j] == 0 && s->mass[j] > 0 && j < s->mechanical;
}

/* 1 for the time integral of a first-order state, on which nothing depends (states: as in pw_system_find_state). */
static inline int pw_is_hidden (const pw_system *s, int state) {
  return state >= s->mechanical && state < s->coords;
}

/* The scene's unit of a coordinate: L or 1 rad. */
static inline double pw_unit (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? 1 : s->scale.length;
}

/* Loops over the batches k of a workspace; over those with constraint equations, which come first. */
#define PW_EACH_BATCH(k, w) for (const pw_element_batch *k = (w)->batch, *end = k + (w)->s->batches; k < end; k++)
#define PW_EACH_CONSTRAINT(k, w) \
  for (const pw_element_batch *k = (w)->batch, *end = k + (w)->s->constraints; k < end; k++)

/* The larger of two numbers by one comparison; b if one is NaN. */
static inline double pw_larger (double a, double b) {
  return a > b ? a : b;
}

/* The larger of two values; NaN if either is NaN. */
static inline double pw_larger_or_nan (double x, double y) {
  return y > x || isnan (y) ? y : x;
}

/* 1 if the multiplier of a constraint equation has a finite limit. */
static inline int pw_is_limited (const pw_system *s, int row) {
  const pw_bounds *x = s->limit ? &s->limit[row] : NULL;
  return x && (x->least > -INFINITY || x->most < INFINITY);
}

/* 1 if one of two limits is infinite: the equation leaves or hits, and does not slide. */
static inline int pw_is_one_sided (const pw_bounds *x) {
  return isinf (x->least) || isinf (x->most);
}

/* 0 if both are 0: the equation never holds, as one of a stop that has no such limit. */
static inline unsigned char pw_can_hold (const pw_bounds *x) {
  return x->least < 0 || x->most > 0;
}

/* The offset in pw_sample of a column that is one of its numbers. */
size_t pw_column_offset (pw_column_type type);

/* Sets w->output_value, the outputs at a sample whose kinematics are evaluated; ledger: its entries, NULL: unknown. */
void pw_evaluate_outputs (pw_workspace *w, const pw_sample *x, const double *ledger);
void pw_evaluate_contacts (const pw_workspace *w, double (*out)[3]); /* at the kinematics evaluated last */

/* Stores value, first and second derivative at time t, or another argument, in source->u; of a force's signal the
 * derivatives are meaningless.  source->x: the states that a function reads.  Returns non-zero if the user's function
 * does so or computes values that are not finite. */
int pw_signal_eval (const pw_source *source, double t);

/* The first time after t at which the signal, its first or its second derivative jumps, or a smooth-step starts or
 * ends, so that a step must end there; INFINITY if there is none.  kinks: 1: also where the second derivative has a
 * kink, at the points of a cubic table.  Of a function signal, what its breakpoint function returns. */
double pw_signal_breakpoint (const pw_signal *s, int kinks, double t);

/* 1 if bounds of the value over a time are known, and it is not linear between breakpoints. */
int pw_signal_is_bounded (const pw_source *source);
/* These bounds: least and largest value for times from lo[0] to hi[0] and the states that it reads from lo + 1 to
 * hi + 1; infinite if unknown. */
void pw_signal_bounds (const pw_source *source, const double *lo, const double *hi, double bounds[2]);

/* 1 if the value may jump: that of a pulse; that of a function, of which this is not known. */
static inline int pw_signal_value_may_jump (const pw_signal *s) {
  return s->type == PW_PULSE || s->type == PW_FUNCTION;
}

/* The signal at point i of a table. */
static inline double pw_table_value (const pw_signal *s, int i) {
  double scale = s->table.scale == 0 ? 1 : s->table.scale;
  return s->table.offset + scale * s->table.value[i];
}

/* Computes the spline of a checked table, 2 count numbers: the first derivative just after each point (after the last
 * one meaningless), then the second derivatives.  Ignores scale and offset, which compilation has applied. */
void pw_table_spline (const pw_signal *s, double *spline);

/* Kinematics: configurations and signals at (t, q, v), which all evaluations below use.  The workspace refers to the
 * internal coordinates in q and v from now on.  Returns PW_METHOD if a signal fails. */
int pw_update_kinematics (pw_workspace *w, double t, const double *q, const double *v);
/* Updates velocities, and signals that read them, at unchanged time and positions.  Returns as pw_update_kinematics. */
int pw_update_velocities (pw_workspace *w, const double *v);

/* Evaluates signals of time alone once per time, even if several stages of a step have the same time, and
 * state-dependent ones; of these, if q is NULL, only those that read velocities.  Returns as pw_update_kinematics. */
int pw_update_signals (pw_workspace *w, double t, const double *q, const double *v);
/* Points the batches to the internal coordinates in q, v; q NULL: only to their velocities. */
void pw_point_to_internal (pw_workspace *w, const double *q, const double *v);

/* These signals keep their values from now on; the others follow time and states again.  Call pw_update_kinematics
 * before pw_update_velocities then. */
void pw_hold_signals (pw_workspace *w, pw_hold hold);

/* Evaluations; arrays over constraint equations have `rows` entries, f has `coords` + 3. */
void pw_evaluate_J (pw_workspace *w);                    /* fills J of every batch */
void pw_evaluate_g (pw_workspace *w, double *g);         /* holonomic */
void pw_evaluate_g_size (pw_workspace *w, double *size); /* holonomic, in units of g; at least L, for angles L rad */
void pw_evaluate_eta (pw_workspace *w, double *eta);
void pw_evaluate_gamma (pw_workspace *w, double *gamma);
void pw_evaluate_J_gamma (pw_workspace *w, double *gamma); /* both */
void pw_evaluate_force (pw_workspace *w, double *f);       /* constant forces included */
void pw_add_constant_forces (const pw_workspace *w, double *f);
/* 2 coords: the smallest change of each state that reverses a saturating force or changes it by its own magnitude;
 * INFINITY if there is none. */
void pw_evaluate_saturation (pw_workspace *w, double *least);
/* The smallest of these changes of velocities, and its element ("friction hinge").  Returns the state, numbered as in
 * pw_system_find_state, or -1 if all are INFINITY. */
int pw_find_saturation (pw_workspace *w, double *least, char *element, size_t size);
double pw_potential (pw_workspace *w);
double pw_kinetic (const pw_system *s, const double *v);
/* Power of each entry of the ledger that has one [W]; does not need J. */
void pw_evaluate_ledger (pw_workspace *w, const double *lambda, double *rate);

/* out = J x; out += J^T lambda; with J as evaluated last. */
void pw_mul_J (const pw_workspace *w, const double *x, double *out);
void pw_add_JT (const pw_workspace *w, const double *lambda, double *out);

/* Global coordinate of a local column; >= coords for the ground. */
static inline int pw_global (const pw_element_batch *k, int e, int c) {
  int n = 3 * k->kind->bodies;
  return c < n ? k->column[e * k->kind->bodies + c / 3] + c % 3 : k->internal + e * k->kind->internal + c - n;
}

/* Worst residuals of g = 0 and J v = eta. */
typedef struct {
  double position, velocity;      /* scaled */
  double g, jv;                   /* absolute */
  int row_position, row_velocity; /* equations with the worst scaled residuals; -1: none, or all are 0 */
} pw_residuals;
/* At the kinematics and J of the workspace; only equations with enforced[i] != 0, unless enforced is NULL. */
void pw_evaluate_residuals (pw_workspace *w, const unsigned char *enforced, pw_residuals *r);
/* g = 0 only, J v = eta only.  A scaled residual below `known`, the largest so far, need not be computed: it becomes
 * `known`. */
void pw_evaluate_position_residual (pw_workspace *w, const unsigned char *enforced, double known, pw_residuals *r);
void pw_evaluate_velocity_residual (pw_workspace *w, const unsigned char *enforced, double known, pw_residuals *r);
/* The position part from a given g; size: scratch. */
void pw_worst_position (pw_workspace *w, const double *g, double *size, const unsigned char *enforced, double known,
                        pw_residuals *r);

/* The first time after t at which a step must end because of a signal, or INFINITY; kinks (pw_signal_breakpoint): only
 * of signals of constraints.  NaN if the breakpoint function of a signal returned no time > t. */
double pw_next_breakpoint (pw_workspace *w, int kinks, double t);

/* 1 if a force, J or gamma is not finite at the current state; writes "force of spring S" to the buffer. */
int pw_find_nonfinite (pw_workspace *w, char *buffer, size_t size);

/* The function at this offset of the type's table. */
static inline pw_batch_function *pw_kind_function (const pw_kind *kind, size_t offset) {
  return *(pw_batch_function *const *)(const void *)((const char *)kind + offset);
}

/* Second-order blocks: the terms of exact Newton matrices other than M, J and J^T.  JW_Q: d(J w)/dq; JTL_Q: d(J^T
 * lambda)/dq; ETA_Q: d eta/dq; ... */
typedef enum { PW_JW_Q, PW_JTL_Q, PW_ETA_Q, PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V, PW_BLOCKS } pw_block;
#define PW_G_Q PW_BLOCKS /* dg/dq, which is J of holonomic constraint equations; for the self-tests alone */

/* The type's function for a block (PW_JTL_Q: its jw_q): NULL if identically zero, or pw_by_differences. */
pw_batch_function *pw_block_function (const pw_kind *kind, pw_block block);

/* Rows of a block per element: kind->rows or the number of local columns. */
int pw_block_rows (const pw_kind *kind, pw_block block);

/* Fills count x block rows x cols for a batch whose configurations, w and lambda are set; by central differences if
 * the type is PW_BY_DIFFERENCES there.  Returns 0 without changing out if the block is identically zero. */
int pw_evaluate_block (const pw_workspace *w, const pw_element_batch *k, pw_block block, double *out);

/* Derivatives of an element's constraint equations with respect to its signal u: of J (rows x cols), eta and gamma
 * (rows). */
typedef struct {
  double J[PW_MAX_ROWS * PW_MAX_COLS], eta[PW_MAX_ROWS], gamma[PW_MAX_ROWS];
} pw_by_signal;
void pw_evaluate_by_signal (const pw_element_batch *k, int e, int u, pw_by_signal *out);

/* The time derivative of state j that a feedback signal reads, numbered as in pw_system_find_state: a velocity, or the
 * rate of a first-order state. */
double pw_read_rate (const pw_workspace *w, int j, const double *v);
/* The batch of an equation; *e: its element there; *J: its row of J in the columns of that element. */
static inline const pw_element_batch *pw_find_row (const pw_workspace *w, int row, int *e, const double **J) {
  const pw_element_batch *k = w->batch;
  while (row >= k->row + k->b.count * k->kind->rows) k++;
  *e = (row - k->row) / k->kind->rows;
  *J = k->J + (row - k->row) * k->b.cols;
  return k;
}

/* 1 if the signal has conditions on states (pw_function.sides). */
static inline int pw_source_has_conditions (const pw_source *x) {
  return x->signal.type == PW_FUNCTION && x->signal.function.sides && x->reads > 0;
}

/* The signal that is the rate of the first-order state that is the velocity of coordinate j. */
static inline const pw_source *pw_rate_source (const pw_workspace *w, int j) {
  return w->source + w->s->sources - w->s->coords + j; /* the last signals are those of the states */
}

/* Derivatives of the rate u' of a feedback signal with respect to the states it reads, whose rates are fixed: central
 * differences of the gradient.  out: the result (reads numbers), then scratch, 3 reads. */
void pw_feedback_rate_gradient (const pw_workspace *w, const pw_source *source, const double *v, double *out);

/* 1 if the type gives NULL for a block of element e that differences show not to be zero; needs w and lambda. */
int pw_block_missing (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block);

/* Searches for such a block near the state q, v at time t, in a few elements of each type that is not built-in
 * (built-in ones pass the self-test).  Returns 1 and writes its name ("force_q of element type magnet") to the buffer;
 * 0 if there is none; PW_RESOURCE.  Update the kinematics afterwards: until then the batches point to internal
 * coordinates in released memory. */
int pw_find_missing_block (pw_workspace *w, double t, const double *q, const double *v, char *buffer, size_t size);

/* 1 if the equations of element e depend on the angle of its n-th body or its angular velocity, or contribute to the
 * equation of that angle, at two irregular states. */
int pw_uses_angle (const pw_workspace *w, const pw_element_batch *k, int e, int n);

/* A block of element e by central differences, whatever the type provides, but 0 in columns of the ground. */
void pw_difference (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block, double *out);

#endif
