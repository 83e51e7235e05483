/* The interface between a run and a specialised scene.  A generated file contains this header as it is; the tag
 * PW_SCENE_ABI changes with it. */
#ifndef PW_SPECIALISED_H
#define PW_SPECIALISED_H

#include "pinwheel.h"

#define PW_SCENE_ABI 4
enum { PW_LANES_MOST = 8, PW_STAGES_MOST = 16 }; /* lanes; stages of a Runge-Kutta method */
#define PW_SCENE_PIVOT 4e-4 /* least pivot of a constraint equation relative to its diagonal entry: a squared sine */

/* A run's data for specialised code.  Arrays over coordinates have `coordinates` entries, those over constraint
 * equations `rows`. */
typedef struct pw_scene {
  const void *const *element;     /* batches: prepared elements */
  const pw_kind *const *kind;     /* batches: element types */
  const pw_signal *const *signal; /* signals */
  const double *mass;             /* coordinates: diagonal of M */
  const double *force;            /* coordinates: sum of the constant forces */
  double *u;                      /* signals x 3: values and derivatives */
  double *constant;               /* what `prepare` computes */
  double *t_signal;               /* time of the last evaluation of u; NaN: none */
  int (*update) (void *workspace, double t, const double *q, const double *v); /* evaluates u; non-zero: failed */
  void *workspace;
  double length, speed; /* scales of residuals [m], [m/s] */
  double alpha, beta;   /* Baumgarte's [1/s]; 0: none */
  double follows;       /* largest scaled residual of redundant equations */

  /* Results of `project` and `residuals`: iterations; scaled and absolute residuals of positions and velocities. */
  int iterations;
  double position, g, velocity, jv;
} pw_scene;

/* The nonzero weights of a row of a Runge-Kutta tableau. */
typedef struct {
  int count, stage[PW_STAGES_MOST];
  double weight[PW_STAGES_MOST];
} pw_rk_row;

/* The stages of a step of size h.  Arrays over coordinates have room for three more entries. */
typedef struct pw_scene_step {
  int stages;           /* stage 0 is the beginning of the step, V[0] and A[0] its velocities and accelerations */
  const pw_rk_row *row; /* [i] stage i > 0; [0] the new state */
  double h;
  const double *t;             /* stages: times */
  const double *q0;            /* positions at the beginning */
  double *const *V, *const *A; /* stages: velocities, accelerations */
  double *const *R;            /* stages: the ledger's rates */
  double *q, *v, *lambda;      /* q, v: the new state; multipliers of a stage */
} pw_scene_step;

/* The watchdog (watchdog.c) in specialised code: limits, beyond which the general engine makes a step, and what it
 * records. */
typedef struct {
  double lost;                           /* largest scaled residuals */
  double sine, reach, near_sine, growth; /* sine - reach (moved + growth x motion of the step) > near_sine */
  double rank, regular, drift;           /* the sines that belong to a residual */
  double no_branch;                      /* residual below which they need no check */
  double length, per_length, per_angle;  /* scale of lengths; units of accelerations */
  double moved, step;                    /* motion since the sine was computed, and of the last step */
  double norm, reference;                /* accelerations: of the state reached, largest so far */
  double position, g, velocity, jv;      /* largest residuals of the steps */
} pw_scene_watch;

/* Consecutive steps of size h of a method with this tableau, projected or not, with what a run does after each of them.
 * Arrays are the run's. */
typedef struct pw_scene_steps {
  int count, done; /* steps to take; taken */
  int project;     /* 1: onto the constraints after each step */
  int stages;
  const pw_rk_row *row; /* as in pw_scene_step */
  const double *c;      /* stages: abscissae */
  double h, base;       /* the i-th step ends at base + (number + i) h, i > 0 */
  long number;
  double t, t0;             /* the state reached, and the one before: times */
  double *state, *state0;   /* positions, velocities, accelerations with three more entries each; state: multipliers */
  double *ledger, *ledger0; /* work and losses */
  double *rate, *rate0;     /* powers */
  double *const *V, *const *A; /* stages: scratch */
  double *const *R;
  pw_configuration *configuration; /* of the state reached */
  double *J;
  pw_scene_watch watch;
  long iterations; /* of all projections */
} pw_scene_steps;

/* Functions return 0, or 1 if the general engine has to do the work: an angle beyond the range of the own sine, a small
 * pivot, values that are not finite, a signal that failed.  The state from which they begin is unchanged then. */
typedef struct pw_specialised {
  int abi, constants;
  unsigned long shape;              /* pw_system_shape of the system */
  const unsigned char *independent; /* rows: 0 for redundant equations, which have the multiplier 0 */
  int (*prepare) (pw_scene *s);     /* 1: a constant pivot is too small */
  /* Accelerations and multipliers at a state; c (bodies + 1, with the ground), J (entries of all elements). */
  int (*evaluate) (pw_scene *s, double t, const double *q, const double *v, double *a, double *lambda,
                   pw_configuration *c, double *J);
  /* Projects a state onto the constraints in the metric of M, then as evaluate. */
  int (*project) (pw_scene *s, double t, double *q, double *v, double *a, double *lambda, pw_configuration *c,
                  double *J);
  /* Evaluates stages 1, 2, ... of a step and combines them to the new state, which is not evaluated. */
  int (*stages) (pw_scene *s, const pw_scene_step *x);
  /* Residuals of an evaluated state. */
  void (*residuals) (pw_scene *s, const double *q, const double *v, const pw_configuration *c, const double *J);
  /* Takes steps until a guard refuses one. */
  void (*steps) (pw_scene *s, pw_scene_steps *x);
} pw_specialised;

/* The same code for several runs at once, in the lanes of vector registers. */
struct pw_specialised_lanes {
  int abi, lanes;
  unsigned long shape, size; /* size: of memory, in bytes */
  /* Takes steps of `lanes` runs, whose sizes and tableaus are the same, each until a guard refuses one.
   * memory: scratch, aligned to 64 bytes. */
  void (*steps) (pw_scene *const *s, pw_scene_steps *const *x, void *memory);
};

/* Hash of what the generated text depends on besides the library's version. */
unsigned long pw_system_shape (const pw_system *s);

#endif
