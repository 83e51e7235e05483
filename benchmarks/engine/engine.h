/* What the parts of the engine benchmark share: the claims, each of them two pieces of work, and how they are reported.
 *
 * These benchmarks look inside: an evaluation is reached through the internal header method.h. */
#ifndef ENGINE_H
#define ENGINE_H

#include "baseline/baseline.h"
#include "method.h"
#include "timing.h"

/* One claim about speed: the base and ours, done by turns. */
typedef struct engine_case engine_case;
struct engine_case {
  const char *key;               /* as written after --count */
  const char *what;              /* one line */
  const char *unit;              /* what is counted: "evaluation", "step", "body" */
  double target;                 /* the ratio of times is to be no more than this */
  void (*open) (engine_case *c); /* fills what follows; ends the program if it cannot */
  void (*close) (engine_case *c);
  const char *base_function, *our_function; /* whose instructions are counted */
  long calls;                               /* how many of them */
  int links;                                /* chain: bodies */
  int massless;                             /* EzyRoller: steering without mass */
  int specialised;                          /* EzyRoller: specialised code */
  const char *model;                        /* a scene of the gallery */
  double rtol;                              /* IDA */

  timing_work base, ours;                                    /* base.run NULL: nothing to compare with */
  double difference;                                         /* of both results, relative */
  long base_steps, our_steps, base_residuals, our_residuals; /* IDA: of one run */
  void *data;
};

/* Ends the program. */
_Noreturn void engine_die (const char *what, const char *why);

/* ---- Scenes ---- */

pw_system *engine_ezyroller (int massless);
pw_system *engine_chain (int links); /* pendulums under gravity, from the horizontal */
pw_system *engine_snake (int links); /* a free chain with a wheel on each link */
pw_system *engine_grid (int cells);  /* cells x cells squares of pinned bars, 2 cells (cells + 1) bodies */
pw_run *engine_open (pw_system *s, const char *method, const pw_settings *settings);
pw_model *engine_describe_chain (int links); /* the chain's description, built */

/* Steps of a fixed size. */
void engine_steps (pw_run *r, long n);

/* Specialised code of a system. */
struct pw_scene_code *engine_specialise (const pw_system *s);

/* A consistent configuration and rates of the chain or snake with bent joints; arrays of 3 links (+ 3). */
void engine_bend (int links, int free, double *q, double *v);

/* The largest difference of two arrays, relative to the largest value. */
double engine_difference (const double *a, const double *b, int n);

/* ---- The claims ---- */

void engine_open_rhs (engine_case *c);     /* EzyRoller, one evaluation, against the hand-written one */
void engine_open_light (engine_case *c);   /* the same without mass against with, both ours */
void engine_open_minimal (engine_case *c); /* against minimal coordinates by hand */
void engine_open_step (engine_case *c);    /* a step of rk4+projection */
void engine_open_light_step (engine_case *c);
void engine_close_ezy (engine_case *c);
void engine_open_specialised (engine_case *c); /* a scene of the gallery, general against specialised: an evaluation */
void engine_open_specialised_step (engine_case *c); /* a step of rk4+projection */
void engine_close_specialised (engine_case *c);
void engine_open_lanes (engine_case *c); /* a step of several runs at once, per run */
void engine_close_lanes (engine_case *c);
void engine_open_chain (engine_case *c); /* one evaluation, per body */
void engine_close_chain (engine_case *c);
void engine_open_ida (engine_case *c); /* a step of ida+ggl */
void engine_close_ida (engine_case *c);

/* ---- How cost grows with size ---- */

/* Ours alone, per body: an evaluation, a projection, a step of ida+ggl.  All sizes are open at once, and take a batch
 * each in turn, so that they see the same machine. */
typedef enum { ENGINE_EVALUATION, ENGINE_PROJECTION, ENGINE_IDA } engine_task;
typedef struct engine_cost engine_cost;
engine_cost *engine_cost_open (pw_system *s, engine_task task, int bent, int free); /* the system becomes its own */
void engine_cost_take (engine_cost *c);                                             /* one batch */
double engine_cost_close (engine_cost *c);                                          /* the median, per body [ns] */

/* ---- Instructions ---- */

/* Instructions of all calls of the function while one side works, by running this program again under callgrind; 0 if
 * there is no valgrind. */
double engine_count (const char *program, const char *key, const char *side, const char *function);

/* The other end of it: does the work, in a function that callgrind finds. */
long engine_counted (const timing_work *w, long n);

/* ---- Memory ---- */

/* Bytes per body of the chain: description, system, run of rk4+projection; pages touched by an evaluation (0 if the
 * system does not tell); processor time [s] of describing and compiling, and of opening the run. */
typedef struct {
  double description, system, run, touched, compile, open;
} engine_memory;
engine_memory engine_measure_memory (int links);

#endif
