/* Comparisons of the pendulum chain with the program by hand, and the cost of large scenes against their size. */
#include <stdlib.h>
#include <string.h>
#include "engine.h"

typedef struct {
  chain hand;
  pw_system *system;
  pw_run *run;
  double *q, *v, *a[2], *lambda[2]; /* one block; results by hand and of Pinwheel */
} chain_data;

static long chain_hand (void *context, long n) {
  chain_data *d = context;
  for (long i = 0; i < n; i++) chain_accelerate (&d->hand, d->q, d->v, d->a[0], d->lambda[0]);
  return n * d->hand.links;
}

static long chain_ours (void *context, long n) {
  chain_data *d = context;
  for (long i = 0; i < n; i++) pw_run_accelerate (d->run, 0, d->q, d->v, d->a[1], d->lambda[1]);
  return n * d->hand.links;
}

void engine_open_chain (engine_case *c) {
  chain_data *d = calloc (1, sizeof *d);
  size_t n = (size_t)(3 * c->links + 3); /* accelerations: 3 per link, 3 of the ground */
  if (d) d->q = calloc (6 * n, sizeof *d->q);
  if (d == NULL || d->q == NULL || chain_open (&d->hand, c->links) != 0) engine_die (c->key, "out of memory");
  d->v = d->q + n;
  for (size_t i = 0; i < 2; i++) d->a[i] = d->v + (1 + i) * n, d->lambda[i] = d->v + (3 + i) * n;
  d->system = engine_chain (c->links);
  d->run = engine_open (d->system, "rk4+none", &(pw_settings){ .step = 1e-3, .span = 1 });
  engine_bend (c->links, ENGINE_PINNED, d->q, d->v);
  c->data = d;
  c->base = (timing_work){ chain_hand, d };
  c->ours = (timing_work){ chain_ours, d };
  c->base_function = "chain_accelerate";
  c->our_function = "pw_run_accelerate";
  chain_hand (d, 1);
  chain_ours (d, 1);
  c->difference = fmax (engine_difference (d->a[0], d->a[1], 3 * c->links),
                        engine_difference (d->lambda[0], d->lambda[1], 2 * c->links));
}

void engine_close_chain (engine_case *c) {
  chain_data *d = c->data;
  pw_run_close (d->run);
  pw_system_free (d->system);
  chain_close (&d->hand);
  free (d->q);
  free (d);
}

/* ---- How cost grows ---- */

struct engine_cost {
  engine_task task;
  pw_system *system;
  pw_run *run;
  pw_projector projector;
  double *q, *v;               /* the state */
  double *q1, *v1, *lambda;    /* results */
  long batch;                  /* repetitions of the work per batch */
  double ns[TIMING_PAIRS_MAX]; /* per body */
  int batches;
};

static long cost_evaluation (void *context, long n) {
  engine_cost *d = context;
  for (long i = 0; i < n; i++) pw_run_accelerate (d->run, 0, d->q, d->v, d->q1, d->lambda);
  return n * d->system->bodies;
}

/* Positions, then velocities, of a state that is off by up to 1e-8 [m], [rad], [m/s], [rad/s]. */
static long cost_projection (void *context, long n) {
  engine_cost *d = context;
  for (long i = 0; i < n; i++) {
    for (int j = 0; j < d->system->coords; j++) {
      double off = 1e-8 * ((j * 7) % 11 - 5) / 5;
      d->q1[j] = d->q[j] + off, d->v1[j] = d->v[j] + off;
    }
    if (pw_project_positions (&d->projector, d->run, 0, d->q1, d->v1) != PW_OK ||
        pw_project_velocities (&d->projector, d->run, d->v1) != PW_OK)
      engine_die ("projection", "does not converge");
  }
  return n * d->system->bodies;
}

/* Time per step and body [ns] of the first steps of a run, without its opening. */
static double cost_ida (engine_cost *d) {
  const int steps = 40;
  pw_error error = { 0 };
  pw_run *r = engine_open (d->system, "ida+ggl", &(pw_settings){ .span = 1, .rtol = 1e-6 });
  double start = timing_now ();
  for (int k = 0; k < steps; k++)
    if (pw_run_advance (r, 10, &error) != PW_OK) engine_die ("ida+ggl", error.text);
  double ns = 1e9 * (timing_now () - start) / steps / d->system->bodies;
  pw_run_close (r);
  return ns;
}

static timing_work cost_work (engine_cost *d) {
  return (timing_work){ d->task == ENGINE_EVALUATION ? cost_evaluation : cost_projection, d };
}

static void cost_open_run (engine_cost *d) {
  pw_error error = { 0 };
  d->run = engine_open (d->system, "rk4+none", &(pw_settings){ .step = 1e-3, .span = 1 });
  if (d->task == ENGINE_PROJECTION &&
      pw_projector_open (&d->projector, d->run, d->system->metric, NULL, &error) != PW_OK)
    engine_die ("projection", error.text);
  timing_work w = cost_work (d);
  d->batch = timing_calibrate (&w, 0.01);
}

engine_cost *engine_cost_open (pw_system *s, engine_task task, engine_shape shape) {
  size_t n = (size_t)s->coords + 3;
  engine_cost *d = calloc (1, sizeof *d);
  if (d) *d = (engine_cost){ .task = task, .system = s, .q = calloc (4 * n + (size_t)s->rows, sizeof *d->q) };
  if (d == NULL || d->q == NULL) engine_die ("engine", "out of memory");
  d->v = d->q + n, d->q1 = d->v + n, d->v1 = d->q1 + n, d->lambda = d->v1 + n;
  memcpy (d->q, s->q0, (size_t)s->coords * sizeof *d->q);
  if (shape != ENGINE_DESCRIBED) engine_bend (s->bodies, shape, d->q, d->v);
  if (task != ENGINE_IDA) cost_open_run (d);
  return d;
}

void engine_cost_take (engine_cost *d) {
  timing_work w = cost_work (d);
  if (d->batches < TIMING_PAIRS_MAX)
    d->ns[d->batches++] = d->task == ENGINE_IDA ? cost_ida (d) : timing_batch (&w, d->batch);
}

double engine_cost_close (engine_cost *d) {
  double ns = timing_median (d->ns, d->batches);
  if (d->task == ENGINE_PROJECTION) pw_projector_close (&d->projector);
  if (d->run) pw_run_close (d->run);
  pw_system_free (d->system);
  free (d->q);
  free (d);
  return ns;
}
