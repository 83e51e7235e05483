/* Pinwheel's methods: an integrator and a stabilisation, found by name, behind one table.
 *
 *     pw_run *r = pw_run_open (system, "rk4+projection", &settings, &error);
 *     while (pw_run_advance (r, t_end, &error) == PW_OK && pw_run_time (r) < t_end) ...
 *     pw_run_sample (r, t, &sample, &error);
 *     pw_run_close (r);
 *
 * A method is written  integrator[+stabilisation][:option=value]...,  "rk4+baumgarte:alpha=10:beta=10". */
#ifndef PINWHEEL_SOLVERS_H
#define PINWHEEL_SOLVERS_H

#include "run.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif

typedef struct pw_run pw_run;
typedef struct pw_method pw_method;
typedef struct pw_method_data pw_method_data; /* what an integrator keeps; each defines its own */

/* An option of a method; a number, or one of some choices. */
typedef struct {
  const char *name;
  const char *with;           /* the stabilisation it belongs to; NULL: all of the integrator's */
  double value;               /* default: the number, or the choice's index */
  pw_domain domain;           /* of a number */
  const char *const *choices; /* NULL-terminated; NULL: a number */
  const char *unit, *about;
} pw_option;

/* Stabilisations that the run treats in a way of their own; a method may have others. */
typedef enum {
  PW_STABILISED_OTHERWISE,
  PW_UNSTABILISED,
  PW_BAUMGARTE,
  PW_PROJECTION,
  PW_NULLSPACE,
  PW_INDEX2,
  PW_GGL,
  PW_SI1
} pw_stabilisation_kind;

typedef struct {
  const char *name, *about;
  pw_stabilisation_kind kind;
} pw_stabilisation;

/* An integrator: one const table in one file.  All methods of Pinwheel are such tables; pinwheel-method.h is for your own. */
struct pw_method {
  const char *name;                       /* "rk4" */
  const char *about;                      /* one line, with its source (author, year) */
  int adaptive;                           /* 1: follows rtol and atol; 0: follows step */
  int order;                              /* of convergence, of fixed-step methods; 0: variable */
  const pw_stabilisation *stabilisations; /* ended by a NULL name; the first one is taken if none is named */
  const pw_option *options;               /* ended by a NULL name */
  const pw_stabilisation *refused;        /* those it cannot have, each with the reason; ended likewise, or NULL */
  int (*open) (pw_run *r, pw_error *error);
  int (*advance) (pw_run *r, double t_end, pw_error *error);
  int (*at) (pw_run *r, double t, pw_error *error); /* leaves the state in the run's sample arrays */
  int (*restart) (pw_run *r, pw_error *error);
  void (*close) (pw_run *r);
  void (*carry) (pw_run *r, pw_archive *a); /* saves or loads what steps after a checkpoint need beyond the state: step
                                               size, counts; NULL: the method starts anew at checkpoints */
};

/* All integrators, ended by NULL. */
extern const pw_method *const pw_methods[];

/* Makes the start of the system consistent and opens a method on it.  The system must outlive the run, which
 * only reads it: any number of runs, in any threads, may share it.  Errors: PW_INPUT for a method, option or setting that does
 * not exist or fit, with the nearest valid name, or whose method uses a derivative that a kind leaves out though it is not
 * zero; PW_INITIAL for a start that cannot be made consistent; PW_RESOURCE. */
pw_run *pw_run_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error);

/* Checks a method's name and options without a system; fills the integrator and the stabilisation's number. */
int pw_method_parse (const char *method, const pw_method **integrator, int *stabilisation, pw_error *error);

/* One accepted step that does not pass t_end.  PW_STOPPED, without an error, if settings.stop has asked for it: the run stays
 * where it was, and the next call goes on.  Errors: PW_METHOD with the time reached and the reason, such as max_steps. */
int pw_run_advance (pw_run *r, double t_end, pw_error *error);

/* Steps until t is reached or passed by a step that pw_run_sample can look back into, or t_end is reached.  Returns as pw_run_advance. */
int pw_run_advance_to (pw_run *r, double t, double t_end, pw_error *error);

/* The time reached. */
double pw_run_time (const pw_run *r);

/* The state at a time inside the last accepted step, its end included.  PW_STOPPED as pw_run_advance, but never at the end: the
 * state reached is there however a run has stopped; after a stop it may be all there is. */
int pw_run_sample (pw_run *r, double t, pw_sample *sample, pw_error *error);

/* How much energy a sample has too much or too little, what projections have added included, relative to the energy that the
 * run has exchanged: the largest of its kinetic energy, of the change of its potential energy, and of what the scene has
 * that moves by L and 1 rad in the span of the run.  Where that is nothing, relative to the larger of work and loss. */
double pw_run_energy_defect (const pw_run *r, const pw_sample *sample);

/* In words what may help against an energy defect of this size, as pw_run_energy_defect tells it. */
const char *pw_run_energy_advice (const pw_run *r, double defect);

/* How many times faster than L/T (lengths) or 1/T (angles), the scale of the scene at its start, the fastest coordinate has
 * become, if that is more than 1e3 and it grows on; else 0.  *state: which rate; *power: of the time, with which it grows. */
double pw_run_growth (const pw_run *r, int *state, double *power);

/* Starts anew from a state at the time reached, after the caller has changed something.  The state is made consistent
 * first.  q and v may be NULL: they stay.  A ledger goes on; what the change does to the energy is left out of its balance.
 * Errors: PW_INPUT for a value that is not finite, PW_INITIAL, PW_METHOD: the run stays where it was; PW_RESOURCE. */
int pw_run_restart (pw_run *r, const double *q, const double *v, pw_error *error);

void pw_run_close (pw_run *r);

/* ---- Checkpoints ---- */

/* Saves the state reached, behind what the archive has already, and goes on from there as a run that is loaded from it:
 * matrices are planned anew, and a method with a memory of earlier steps starts anew, which its statistics count.
 * Samples of the last step must have been taken.  PW_RETRY near a singular configuration, where nothing is done: try after the
 * next step.  Errors: PW_RESOURCE. */
int pw_run_save (pw_run *r, pw_archive *a, pw_error *error);

/* Brings a run that was opened alike (system, method, settings) and has not advanced to a saved state: from there it
 * goes on, bit for bit, as the run that was saved.  Errors: PW_INPUT if the archive does not fit; PW_RESOURCE. */
int pw_run_load (pw_run *r, pw_archive *a, pw_error *error);

/* Redundant rows, and in words what one of them follows from, written to the buffer, which is returned.  Reactions are
 * then not unique: samples give the smallest. */
int pw_run_redundant (const pw_run *r);
char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size);

/* ---- What a model is like at the state reached (linear.c) ---- */

/* Whether the eigenvalues of a linearisation are the exponents of disturbances: only if the linearised equations stay the
 * same along the motion, seen from a frame that moves with it. */
typedef enum {
  PW_STEADY,
  PW_ACCELERATED, /* no: there are accelerations in the frame */
  PW_CHANGING     /* no: the equations depend on time, or change along the motion, within the run's span */
} pw_steadiness;

/* Mobility and linearisation.  Singular values are those of the independent rows of J, each row of length 1, angles in
 * units of the length scale.  A variation of the state by its minimal coordinates x, seen from a frame that moves with the
 * motion, obeys x' = A x. */
typedef struct {
  int coordinates;
  int positions;  /* degrees of freedom of configuration: coordinates less independent holonomic rows */
  int velocities; /* of velocity: coordinates less independent rows */
  int rank;       /* of J */
  double least;   /* smallest singular value; NaN: not computed, or no rows */
  int unknowns;   /* of the linearisation: positions + velocities */
  double
      *A; /* unknowns x unknowns, by rows [1/s], coordinates of positions first; NULL: not computed, nor what follows */
  double *re,
      *im; /* its eigenvalues [1/s], the one that grows most first, of a conjugate pair that with im > 0; what round-off
                      hides is 0 */
  unsigned char *rigid; /* unknowns: 1 for those of displacements of the whole, which change nothing */
  int symmetries;       /* how many: of the directions x, y, phi */
  pw_steadiness steady;
  double twist[3];     /* of the frame [m/s, m/s, rad/s] */
  double acceleration; /* the largest seen from it; angles in units of the length scale [m/s^2] */
} pw_linear;

/* Examines the state a run has reached.  With more coordinates than `most` only integers are filled: the rest takes time
 * as their cube.  Close it in every case.  Errors: PW_RESOURCE, PW_METHOD. */
int pw_run_linearise (pw_run *r, int most, pw_linear *l, pw_error *error);
void pw_linear_free (pw_linear *l);

/* The largest step h with which the classical Runge-Kutta method damps x' = (re + i im) x, for all smaller steps too;
 * INFINITY if the solution itself grows without turning, or rests. */
double pw_rk4_limit (double re, double im);

/* The smallest velocity within which a force saturates, at the configuration reached and at rest [m/s] or [rad/s]: the velocity
 * (as pw_system_find_state numbers states), or -1 if none does, and the element, "friction hinge".  Methods with Newton's iteration
 * keep their tolerances below it, whatever the settings ask for. */
int pw_run_saturation (pw_run *r, double *least, char *element, size_t size);

/* ---- What an evaluation of the accelerations costs (timing.c) ---- */

/* Processor times [ns] of all elements of a kind: of signals, of J and gamma, of forces; of g.  0: there is none. */
typedef struct {
  const pw_kind *kind;
  int elements;
  double signals, constraints, force, positions;
} pw_profile_kind;

/* Processor times [ns] of an evaluation and of its stages; medians. */
typedef struct {
  int kinds;
  pw_profile_kind *kind;
  double configurations; /* kinematics of the bodies alone */
  double kinematics;     /* and signals */
  double equations;      /* J, gamma, f */
  double stabilisation;  /* Baumgarte's terms */
  double factorisation, solution;
  double evaluation;  /* all in one go */
  double evaluations; /* per step, without those after projections; 0: steps are not made of such evaluations */
  double projection;  /* with the evaluation after it */
  double projections; /* per step */
  double iterations;  /* of the positions in each */
} pw_profile;

/* Measures at the state reached, in a second or a few.  Afterwards the run can only be closed.  PW_RETRY: it is in a singular
 * configuration, and nothing is measured.  Errors: PW_RESOURCE.  Free the profile in every case. */
int pw_run_profile (pw_run *r, pw_profile *p, pw_error *error);
void pw_profile_free (pw_profile *p);

const pw_statistics *pw_run_statistics (const pw_run *r);
const pw_initial_report *pw_run_initial (const pw_run *r);
/* 1 if the consistent start moved this state (as pw_system_find_state numbers them) by more than round-off. */
int pw_initial_moved (const pw_system *s, const pw_initial_report *report, int state);
/* 1 if the model specifies the initial value of this state, or the user gave it; 0 if it was left out. */
int pw_initial_specified (const pw_system *s, int state);
const pw_scale *pw_run_scale (const pw_run *r);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#ifdef __cplusplus
}
#endif

#endif
