/* Shared by the parts of the program engine, and by effects and peers: comparisons of two pieces of work, scenes, cost
 * against size, instructions, memory.  The internal header method.h is for evaluations outside of a step. */
#ifndef ENGINE_H
#define ENGINE_H

#include "baseline/baseline.h"
#include "method.h"
#include "timing.h"

/* A comparison: the base (a program by hand, or Pinwheel in another mode) and ours, in alternating batches. */
typedef struct engine_case engine_case;
struct engine_case {
  const char *key;               /* its name on the command line */
  const char *what;              /* its name in the table */
  const char *unit;              /* of the work: "evaluation", "step", "body" */
  double target;                 /* largest ratio of the times, ours / base; 0: none */
  void (*open) (engine_case *c); /* fills what follows; ends the program if it cannot */
  void (*close) (engine_case *c);
  const char *base_function, *our_function; /* whose instructions are counted */
  long calls;                               /* times that callgrind does the work; 0: does not count */
  int links;                                /* chain: bodies */
  int massless;                             /* EzyRoller: steering without mass */
  int specialised;                          /* EzyRoller: specialised code */
  const char *model;                        /* a model of the gallery */
  double rtol;                              /* IDA */

  timing_work base, ours;
  double difference;                                         /* largest of both results, relative */
  long base_steps, our_steps, base_residuals, our_residuals; /* IDA: of one run */
  void *data;
};

/* Ends the program with a message; exit status 2. */
_Noreturn void engine_die (const char *what, const char *why);
/* The same, with the program's usage, if there are more than `most` arguments, or one that looks like an option. */
void engine_check_arguments (int argc, char **argv, int most, const char *usage);

/* ---- Scenes ---- */

pw_system *engine_ezyroller (int massless);
pw_system *engine_chain (int links); /* pendulums under gravity, from the horizontal */
pw_system *engine_snake (int links); /* a free chain with a wheel on each link */
pw_system *engine_grid (int cells);  /* cells x cells squares of pinned bars, 2 cells (cells + 1) bodies */
pw_run *engine_open (pw_system *s, const char *method, const pw_settings *settings);
pw_model *engine_describe_chain (int links); /* the chain's description, built */

/* n steps of a fixed size. */
void engine_steps (pw_run *r, long n);
/* The same, where the run restarts from (q, v) after every `round` steps; `done` counts the steps of all calls. */
void engine_rounds (pw_run *r, long *done, long round, const double *q, const double *v, long n);

/* Specialised code of a system. */
struct pw_scene_code *engine_specialise (const pw_system *s);

/* States for evaluations: the described one, or bent joints of a chain that is pinned to the ground or free. */
typedef enum { ENGINE_DESCRIBED, ENGINE_PINNED, ENGINE_FREE } engine_shape;

/* Consistent positions and velocities of a bent chain, 3 links each. */
void engine_bend (int links, engine_shape shape, double *q, double *v);

/* The largest difference of two arrays, relative to the largest value. */
double engine_difference (const double *a, const double *b, int n);

/* ---- The comparisons ---- */

void engine_open_rhs (engine_case *c);     /* EzyRoller, one evaluation, against the hand-written one */
void engine_open_light (engine_case *c);   /* the same: massless against massive steering, both Pinwheel */
void engine_open_minimal (engine_case *c); /* against minimal coordinates by hand */
void engine_open_step (engine_case *c);    /* a step of rk4+projection */
void engine_open_light_step (engine_case *c);
void engine_close_ezy (engine_case *c);
void engine_open_specialised (engine_case *c);      /* an evaluation: general against specialised */
void engine_open_specialised_step (engine_case *c); /* a step of rk4+projection */
void engine_close_specialised (engine_case *c);
void engine_open_lanes (engine_case *c); /* a step of several runs at once, per run */
void engine_close_lanes (engine_case *c);
void engine_open_chain (engine_case *c); /* one evaluation, per body */
void engine_close_chain (engine_case *c);
void engine_open_ida (engine_case *c); /* a step of ida+ggl */
void engine_close_ida (engine_case *c);

/* ---- How cost grows with size ---- */

/* Times per body of an evaluation, a projection, a step of ida+ggl.  All sizes are open at once, and take one batch
 * each in turn, so that a slow phase of the machine affects all of them. */
typedef enum { ENGINE_EVALUATION, ENGINE_PROJECTION, ENGINE_IDA } engine_task;
typedef struct engine_cost engine_cost;
engine_cost *engine_cost_open (pw_system *s, engine_task task, engine_shape shape); /* takes over the system */
void engine_cost_take (engine_cost *c);                                             /* one batch */
double engine_cost_close (engine_cost *c);                                          /* the median, per body [ns] */

/* ---- Instructions ---- */

/* Instructions of all calls of the function in a run of `program --count KEY SIDE` under callgrind; 0 if there is no
 * valgrind. */
double engine_count (const char *program, const char *key, const char *side, const char *function);

/* Does the work in that run: callgrind counts inside this function only. */
long engine_counted (const timing_work *w, long n);

/* ---- Memory ---- */

/* Memory of a chain, and the time to build it. */
typedef struct {
  double description, system, run; /* [bytes per body]; the run is one of rk4+projection */
  double touched;                  /* in pages that an evaluation touches [bytes per body]; 0: not known */
  double compile, open;            /* processor time of description and compilation, of opening the run [s] */
} engine_memory;
engine_memory engine_measure_memory (int links);

#endif
