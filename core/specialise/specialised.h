/* The interface between a run and specialised code, which has a copy of it: raise PW_SCENE_ABI if it changes. */
#ifndef PW_SPECIALISED_H
#define PW_SPECIALISED_H

#include "pinwheel.h"

#define PW_SCENE_ABI 7
enum { PW_STAGES_MOST = 16 }; /* most stages of a Runge-Kutta method */
/* Least pivot of a constraint equation in the elimination of J M^-1 J^T, relative to its diagonal entry: the squared
 * sine of the angle between its row of J and the rows eliminated before, in the metric of M^-1.  The sine is that below
 * which the general engine refines solutions (pw_thresholds.refine), which this code does not. */
#define PW_SCENE_PIVOT 4e-4

/* A run's data for specialised code. */
typedef struct pw_scene {
  const void *const *element;     /* batches: prepared elements */
  const pw_kind *const *kind;     /* batches: element types */
  const pw_signal *const *signal; /* signals */
  const double *mass;             /* coordinates: diagonal of M */
  const double *force;            /* coordinates: sum of the constant forces */
  double *u;                      /* signals x 3: value; first and second time derivatives, unless it is of a force */
  double *constant;               /* what `prepare` computes */
  double *t_signal;               /* time of the last evaluation of u; NaN: none */
  /* Evaluates u; non-zero: failed.  q, v may be NULL if no signal reads states. */
  int (*update) (void *workspace, double t, const double *q, const double *v);
  void *workspace;
  double length, speed;      /* scales of residuals [m], [m/s] */
  double alpha, beta;        /* of Baumgarte's stabilisation [1/s]; 0: none */
  double redundant_residual; /* largest scaled residual of redundant equations that is round-off */

  /* Results of `project` and `residuals`. */
  int iterations;            /* of positions; `project` only */
  double position, velocity; /* largest scaled residuals */
  double g, jv;              /* the same, absolute */
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
  const double *c;      /* stages: abscissae */
  double h, t0, t1;     /* size; times of beginning and end */
  const double *q0;     /* positions at the beginning */
  double *const *V, *const *A; /* stages: velocities, accelerations */
  double *const *R;            /* stages: powers of the ledger's entries [W] */
  double *q, *v;               /* the new state */
  double *lambda;              /* scratch: multipliers of a stage */
} pw_scene_step;

/* The watchdog (method.h) in specialised code.  The motion of a step is the largest change of a body's coordinate, in
 * units of the scene; `sine` is that of the smallest angle between a row of J and those before it.  All members are of
 * the type double, since specialised code copies them as an array. */
typedef struct {
  /* Set by the run: limits, beyond which the general engine makes a step, and factors. */
  double lost;              /* limit of scaled residuals */
  double sine;              /* when last computed */
  double reach;             /* largest change of the sine per unit of motion */
  double near_sine, growth; /* the sine must exceed near_sine even after a next step of `growth` times the motion */
  /* A residual d may decide which branch is followed where the sine is below min (sqrt (d / drift), regular).  That
   * matters only if this minimum exceeds rank_lost; residuals d < no_branch need not be tested. */
  double drift, regular, rank_lost, no_branch;
  double length;                /* L [m] */
  double per_length, per_angle; /* convert accelerations [m/s^2], [rad/s^2] to units of the scene */
  /* Set by the run, then updated by specialised code. */
  double moved;           /* motion since the sine was computed */
  double norm, reference; /* accelerations in units of the scene: of the state reached; largest so far */
  /* Recorded by specialised code. */
  double step;                      /* motion of the last step */
  double position, g, velocity, jv; /* largest residuals of the steps, as in pw_scene */
} pw_scene_watch;
_Static_assert(sizeof (pw_scene_watch) == 20 * sizeof (double), "the 20 members are of the type double");

/* Consecutive steps of size h of a Runge-Kutta method, with watchdog and ledger.  The arrays belong to the run. */
typedef struct pw_scene_steps {
  int count, done; /* steps to take, >= 1; taken */
  int project;     /* 1: onto the constraints after each step */
  int stages;
  const pw_rk_row *row; /* as in pw_scene_step */
  const double *c;      /* stages: abscissae */
  double h, base;       /* the i-th step ends at base + (number + i) h, i > 0 */
  long number;
  double t, t0; /* time of the state reached, of the one before */
  /* coordinates + 3 each: positions, velocities, accelerations; `state` then has the multipliers */
  double *state, *state0;
  double *ledger, *ledger0;    /* work and losses [J] */
  double *rate, *rate0;        /* their powers [W] */
  double *const *V, *const *A; /* stages: scratch */
  double *const *R;
  pw_configuration *configuration; /* of the state reached; if done < count, perhaps of the refused step */
  double *J;                       /* of the same state */
  pw_scene_watch watch;
  long iterations; /* of all projections */
} pw_scene_steps;

/* Functions return 0, or 1 if the general engine has to do the work: for an angle from PW_SINE_LIMIT on, a small pivot,
 * values that are not finite, a signal or projection that failed, `stages` with stabilisation.  The state from which
 * they begin is unchanged then. */
typedef struct pw_specialised {
  int abi, constants;               /* constants: entries of pw_scene.constant */
  unsigned long shape;              /* hash of the system's structure */
  const unsigned char *independent; /* rows: 0 for redundant equations, which have the multiplier 0 */
  int (*prepare) (pw_scene *s);     /* 1: a constant pivot is too small */
  /* Stores accelerations and multipliers at a state; configurations of the bodies in c, which end with that of the
   * ground, set by the caller; entries of J. */
  int (*evaluate) (pw_scene *s, double t, const double *q, const double *v, double *a, double *lambda,
                   pw_configuration *c, double *J);
  /* Projects a state onto the constraints in the metric of M, then evaluates it. */
  int (*project) (pw_scene *s, double t, double *q, double *v, double *a, double *lambda, pw_configuration *c,
                  double *J);
  /* Evaluates stages 1, 2, ... of a step and combines them to the new state, which is not evaluated. */
  int (*stages) (pw_scene *s, const pw_scene_step *x);
  /* Residuals of an evaluated state. */
  void (*residuals) (pw_scene *s, const double *q, const double *v, const pw_configuration *c, const double *J);
  /* Takes `count` steps, or fewer if one has to be made by the general engine. */
  void (*steps) (pw_scene *s, pw_scene_steps *x);
} pw_specialised;

/* The same code for several runs at once, in the lanes of vector registers. */
struct pw_specialised_lanes {
  int abi, lanes;            /* lanes: runs at once; 0: none, the compiler does not vectorise the code */
  unsigned long shape, size; /* as in pw_specialised; bytes of `memory` */
  /* The same for `lanes` runs with the same step size, tableau and `project`, without stabilisation or redundant
   * equations; memory: scratch, aligned to 64 bytes. */
  void (*steps) (pw_scene *const *s, pw_scene_steps *const *x, void *memory);
};

#endif
