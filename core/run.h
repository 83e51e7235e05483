/* What a method is asked and what it answers: settings, samples, statistics.  The methods themselves are in
 * solvers/; see pinwheel-solvers.h. */
#ifndef PW_RUN_H
#define PW_RUN_H

#include "pinwheel.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif

#define PW_MAX_STEPS 10000000 /* attempted steps of a run by an adaptive method, if nothing is said */

/* How to integrate; zeros leave the defaults. */
typedef struct {
  double t;    /* start time [s] */
  double span; /* about how long the run will be [s]; only sets the time scale of a scene that starts at rest */
  double step; /* fixed-step methods: step size [s]; default 1e-3 */
  double rtol; /* adaptive methods: relative tolerance; default 1e-6 */
  double atol; /* absolute tolerance of every state; default rtol x (L, 1 rad, L/T, 1/T), see pw_scale */
  int ledger;  /* 1: samples have the ledger's entries, and the energy that projections add is counted */

  /* What ends a run that would take too long. */
  long max_steps; /* adaptive methods: attempted steps, rejected ones included; default PW_MAX_STEPS */
  int (*stop) (
      void *context); /* asked before each attempted step, before each evaluation of adams, bdf and ida, and before a
                                  sample inside a step; not 0: the call returns PW_STOPPED at once.  May be NULL */
  void *stop_context; /* passed to stop */

  const struct pw_method *const *methods; /* the caller's own, ended by NULL, beside the built-in ones; or NULL */
} pw_settings;

/* The scales of a scene, from its description and initial state: the units of absolute thresholds. */
typedef struct {
  double length; /* L: largest distance of an attachment from its body's centre of mass, else radius of gyration [m] */
  double time;   /* T: 1 / max (1 / span, fastest rate, square root of the fastest acceleration), in units of L [s] */
} pw_scale;

/* What a run has cost and how well it held the constraints, at accepted steps. */
typedef struct {
  long steps;          /* accepted */
  long rejected;       /* retaken with another size */
  long rhs;            /* evaluations of the accelerations, or of the residual */
  long jacobians;      /* evaluations of an iteration matrix */
  long factorisations; /* of any matrix */
  long restarts;       /* of a method with a memory, at checkpoints */
  double position;     /* worst scaled residual of g = 0 */
  double velocity;     /* worst scaled residual of J v = eta */
  double g;            /* worst |g| [m] or [rad] */
  double jv;           /* worst |J v - eta| [m/s] or [rad/s] */
} pw_statistics;

/* The state at one time.  The arrays belong to the run and hold until its next call. */
typedef struct {
  double t;
  const double *q, *v;  /* coordinates and rates: pw_system_coordinates each */
  const double *a;      /* accelerations */
  const double *lambda; /* multipliers, M a + J^T lambda = f: pw_system_rows */
  double position;      /* scaled residual of g = 0 here */
  double velocity;      /* scaled residual of J v = eta here */
  double kinetic;       /* [J] */
  double potential;     /* [J] */
  const double
      *ledger;       /* work or loss of each entry of the ledger [J]: pw_system_ledger_entries; NULL if not asked for */
  double work;       /* fed in by active elements and drives since the start [J] */
  double loss;       /* dissipated [J] */
  double projection; /* energy added by projections behind steps [J]; 0 without pw_settings.ledger */
  double balance;    /* (kinetic + potential) - at the start - work + loss - projection [J] */
} pw_sample;

/* Entries of the ledger: the name of entry i is "rider.work" or "damper.loss"; "drag.frame.loss" of an element that
 * acts on every body. */
int pw_system_ledger_entries (const pw_system *s);
char *pw_system_ledger_name (const pw_system *s, int entry, char *buffer, size_t size);

/* What the consistent start did. */
typedef struct {
  const double *q_given, *v_given; /* the state as described */
  const double *q, *v;             /* the state the run starts from, until it has advanced */
  int moved;                       /* number of states that differ by more than round-off */
  int released;                    /* 1: the values the user gave could not all be held */
  int changed;                     /* of the states moved, those that the model specifies */
  double position, velocity;       /* scaled residuals before */
  double time;                     /* time scale of the run [s] */
} pw_initial_report;

/* ---- Saved states ---- */

/* Bytes that a state is saved to, or loaded from; all zero at first. */
typedef struct {
  unsigned char *at;
  size_t used; /* saved so far; taken so far when loading */
  size_t size; /* room; all there is when loading */
  int loading; /* 1: pw_archive_bytes takes bytes out */
  int failed;  /* out of memory; when loading: more was asked for than there is */
} pw_archive;

/* Saves bytes, or loads them: one function that lists what a state consists of serves both ways. */
void pw_archive_bytes (pw_archive *a, void *bytes, size_t count);
void pw_archive_count (pw_archive *a, long *count); /* fails for what no count can be, or none that goes on */
void pw_archive_clear (pw_archive *a);              /* back to the beginning */
void pw_archive_free (pw_archive *a);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#ifdef __cplusplus
}
#endif

#endif
