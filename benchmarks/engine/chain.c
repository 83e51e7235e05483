/* The pendulum chain against its hand-written program, and how the cost of large scenes grows. */
#include <stdlib.h>
#include <string.h>
#include "engine.h"

typedef struct {
  chain hand;
  pw_system *system;
  pw_run *run;
  double *q, *v, *a[2], *lambda[2];
} chain_data;

static long chain_hand (void *context, long n) {
  chain_data *d = context;
  for (long i = 0; i < n; i++) chain_accelerate (&d->hand, d->q, d->v, d->a[0], d->lambda[0]);
  return n * d->hand.links;
}

static long chain_ours (void *context, long n) {
  chain_data *d = context;
  for (long i = 0; i < n; i++) pw_accelerate (d->run, 0, d->q, d->v, d->a[1], d->lambda[1]);
  return n * d->hand.links;
}

static double *chain_array (int links) {
  double *x = calloc ((size_t)(3 * links + 3), sizeof *x);
  if (x == NULL) engine_die ("chain", "out of memory");
  return x;
}

void engine_open_chain (engine_case *c) {
  chain_data *d = calloc (1, sizeof *d);
  if (d == NULL || chain_open (&d->hand, c->links) != 0) engine_die (c->key, "out of memory");
  double **const array[] = { &d->q, &d->v, &d->a[0], &d->a[1], &d->lambda[0], &d->lambda[1] };
  for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = chain_array (c->links);
  d->system = engine_chain (c->links);
  d->run = engine_open (d->system, "rk4+none", &(pw_settings){ .step = 1e-3, .span = 1 });
  engine_bend (c->links, 0, d->q, d->v);
  c->data = d;
  c->base = (timing_work){ chain_hand, d };
  c->ours = (timing_work){ chain_ours, d };
  c->base_function = "chain_accelerate";
  c->our_function = "pw_accelerate";
  chain_hand (d, 1);
  chain_ours (d, 1);
  c->difference = fmax (engine_difference (d->a[0], d->a[1], 3 * c->links),
                        engine_difference (d->lambda[0], d->lambda[1], 2 * c->links));
}

void engine_close_chain (engine_case *c) {
  chain_data *d = c->data;
  double *const array[] = { d->q, d->v, d->a[0], d->a[1], d->lambda[0], d->lambda[1] };
  for (size_t i = 0; i < sizeof array / sizeof *array; i++) free (array[i]);
  pw_close (d->run);
  pw_free (d->system);
  chain_close (&d->hand);
  free (d);
}

/* ---- How cost grows ---- */

typedef struct {
  pw_system *system;
  pw_run *run;
  pw_projector projector;
  const double *q, *v;
  double *q1, *v1, *lambda;
  int steps; /* IDA */
} cost_data;

static long cost_evaluation (void *context, long n) {
  cost_data *d = context;
  for (long i = 0; i < n; i++) pw_accelerate (d->run, 0, d->q, d->v, d->q1, d->lambda);
  return n * d->system->bodies;
}

/* From a state whose bodies are off by up to 1e-8: positions, then rates. */
static long cost_projection (void *context, long n) {
  cost_data *d = context;
  for (long i = 0; i < n; i++) {
    int row;
    double worst;
    for (int j = 0; j < d->system->coords; j++) {
      double off = 1e-8 * ((j * 7) % 11 - 5) / 5;
      d->q1[j] = d->q[j] + off, d->v1[j] = d->v[j] + off;
    }
    if (pw_project_positions (&d->projector, d->run, 0, d->q1, d->v1, &row, &worst) != PW_OK ||
        pw_project_velocities (&d->projector, d->run, d->v1) != PW_OK)
      engine_die ("projection", "does not converge");
  }
  return n * d->system->bodies;
}

/* The first steps of a run; opening is not part of it. */
static double cost_ida (cost_data *d) {
  double ns[3];
  pw_error error = { 0 };
  for (int i = 0; i < 3; i++) {
    pw_run *r = engine_open (d->system, "ida+ggl", &(pw_settings){ .span = 1, .rtol = 1e-6 });
    double start = timing_now ();
    for (int k = 0; k < d->steps; k++)
      if (pw_advance (r, 10, &error) != PW_OK) engine_die ("ida+ggl", error.text);
    ns[i] = 1e9 * (timing_now () - start) / d->steps / d->system->bodies;
    pw_close (r);
  }
  return timing_median (ns, 3);
}

static double cost_take (cost_data *d, engine_task task) {
  if (task == ENGINE_IDA) return cost_ida (d);
  pw_error error = { 0 };
  timing_work w = { task == ENGINE_EVALUATION ? cost_evaluation : cost_projection, d };
  d->run = engine_open (d->system, "rk4+none", &(pw_settings){ .step = 1e-3, .span = 1 });
  if (task == ENGINE_PROJECTION && pw_projector_open (&d->projector, d->run, d->system->metric, NULL, &error) != PW_OK)
    engine_die ("projection", error.text);
  double ns = timing_alone (&w, 9, 0.01);
  if (task == ENGINE_PROJECTION) pw_projector_close (&d->projector);
  pw_close (d->run);
  return ns;
}

double engine_cost (pw_system *s, engine_task task, const double *q, const double *v) {
  size_t n = (size_t)s->coords + 3;
  cost_data d = { .system = s, .q = q, .v = v, .steps = 40 };
  d.q1 = malloc ((2 * n + (size_t)s->rows) * sizeof *d.q1);
  if (d.q1 == NULL) engine_die ("engine", "out of memory");
  d.v1 = d.q1 + n;
  d.lambda = d.v1 + n;
  double ns = cost_take (&d, task);
  free (d.q1);
  return ns;
}
