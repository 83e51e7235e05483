/* Comparisons of specialised code with the general engine, one run at a time and in lanes, on models of the gallery. */
#include <stdlib.h>
#include <string.h>
#include "engine.h"
#include "pinwheel-files.h"

enum {
  SPECIALISED_POOL = 64,
  SPECIALISED_SPACING = 40, /* steps between states of the pool */
  SPECIALISED_STEPS = 1000, /* after which a run starts again: a motion may become faster */
  SPECIALISED_COORDS = 300  /* most coordinates of a model */
};

/* A run by the general engine, one by specialised code, and a pool of states of a motion to evaluate. */
typedef struct {
  pw_system *system;
  pw_scene_code *code;
  pw_run *run[2];
  int n;                              /* coordinates */
  double t[SPECIALISED_POOL], *q, *v; /* pool: [k * n + j] */
  double *a, *lambda;
} specialised_data;

typedef struct {
  specialised_data *d;
  int side;
  long steps;
} specialised_side;

pw_scene_code *engine_specialise (const pw_system *s) {
  pw_error error = { 0 };
  char *text = pw_system_source (s, NULL, &error);
  pw_scene_code *code = text ? pw_scene_code_open (text, s, &error) : NULL;
  if (code == NULL) engine_die (pw_system_name (s), error.text);
  free (text);
  return code;
}

void engine_steps (pw_run *r, long n) {
  pw_error error = { 0 };
  if (pw_run_advance_to (r, r->t + ((double)n - 0.5) * r->settings.step, 1e9, &error) != PW_OK)
    engine_die (r->s->model, error.text);
}

void engine_rounds (pw_run *r, long *done, long round, const double *q, const double *v, long n) {
  for (long i = 0, count; i < n; i += count, *done += count) {
    long left = round - *done % round;
    count = n - i < left ? n - i : left;
    if (left == round) pw_run_restart (r, q, v, NULL);
    engine_steps (r, count);
  }
}

/* Compiles a model; `step` takes its default step. */
static pw_system *specialised_system (const char *name, double *step) {
  pw_error error = { 0 };
  pw_file *file = pw_file_open (name, &error);
  pw_model *m = pw_file_model (file, &error);
  pw_model_build (m, &error);
  if (file) *step = pw_file_table (file)->run.step;
  pw_system *s = pw_system_compile (m, &error);
  if (s == NULL) engine_die (name, error.text);
  pw_model_free (m);
  return s; /* the file stays open: it holds the functions of the model */
}

/* Fills the pool from a motion by the general engine. */
static void specialised_pool (specialised_data *d) {
  pw_error error = { 0 };
  for (int k = 0; k < SPECIALISED_POOL; k++) {
    for (int i = 0; i < SPECIALISED_SPACING; i++) pw_run_advance (d->run[0], 1e9, &error);
    d->t[k] = d->run[0]->t;
    memcpy (d->q + k * d->n, d->run[0]->q, (size_t)d->n * sizeof (double));
    memcpy (d->v + k * d->n, d->run[0]->v, (size_t)d->n * sizeof (double));
  }
  pw_run_advance (d->run[1], 1e9, &error); /* first evaluations of a run cost more: its watchdog starts */
  if (error.status != PW_OK) engine_die (d->system->model, error.text);
}

static long specialised_evaluate (void *context, long n) {
  specialised_side *x = context;
  specialised_data *d = x->d;
  for (long i = 0; i < n; i++) {
    int k = (int)(i % SPECIALISED_POOL);
    pw_run_accelerate (d->run[x->side], d->t[k], d->q + k * d->n, d->v + k * d->n, d->a, d->lambda);
  }
  return n;
}

static long specialised_step (void *context, long n) {
  specialised_side *x = context;
  engine_rounds (x->d->run[x->side], &x->steps, SPECIALISED_STEPS, x->d->q, x->d->v, n);
  return n;
}

static void specialised_open (engine_case *c) {
  static specialised_side side[2];
  specialised_data *d = c->data = calloc (1, sizeof *d);
  if (d == NULL) engine_die (c->key, "out of memory");
  double step = 0;
  d->system = specialised_system (c->model, &step);
  d->code = engine_specialise (d->system);
  d->n = pw_system_coordinates (d->system);
  size_t numbers = (size_t)(2 * SPECIALISED_POOL * d->n + d->n + pw_system_rows (d->system)) + 4;
  d->q = calloc (numbers, sizeof (double));
  if (d->q == NULL) engine_die (c->key, "out of memory");
  d->v = d->q + SPECIALISED_POOL * d->n, d->a = d->v + SPECIALISED_POOL * d->n, d->lambda = d->a + d->n + 3;
  for (int i = 0; i < 2; i++) {
    pw_settings set = { .step = step, .span = 100, .specialised = i ? pw_scene_code_table (d->code) : NULL };
    d->run[i] = engine_open (d->system, "rk4+projection", &set);
    side[i] = (specialised_side){ d, i, 0 };
  }
  specialised_pool (d);
  c->base.context = &side[0], c->ours.context = &side[1];
}

void engine_open_specialised (engine_case *c) {
  specialised_open (c);
  specialised_data *d = c->data;
  c->base.run = c->ours.run = specialised_evaluate;
  c->base_function = c->our_function = "pw_run_accelerate";
  for (long n = 1; n <= SPECIALISED_POOL; n++) {
    double a[SPECIALISED_COORDS];
    c->base.run (c->base.context, n);
    memcpy (a, d->a, (size_t)d->n * sizeof *a);
    c->ours.run (c->ours.context, n);
    c->difference = fmax (c->difference, engine_difference (a, d->a, d->n));
  }
}

void engine_open_specialised_step (engine_case *c) {
  specialised_open (c);
  c->base.run = c->ours.run = specialised_step;
  c->base_function = c->our_function = "pw_run_advance_to";
}

void engine_close_specialised (engine_case *c) {
  specialised_data *d = c->data;
  for (int i = 0; i < 2; i++) pw_run_close (d->run[i]);
  pw_scene_code_close (d->code);
  pw_system_free (d->system);
  free (d->q);
  free (d);
}

/* ---- Several runs at once ---- */

enum { LANES_MOST = 8, LANES_WARM_UP = 1600 /* steps, in all runs together */ };

/* Runs that start with slightly different velocities: by the general engine, one after the other; in lanes. */
typedef struct {
  pw_system *system;
  pw_scene_code *code, *lanes; /* for one run, for all at once */
  void *memory;
  int n;       /* runs */
  double step; /* [s] */
  pw_run *general[LANES_MOST], *run[LANES_MOST];
} lanes_data;

/* Restarts the k-th run from the initial state, with its own velocity. */
static void lanes_restart (pw_run *r, const pw_system *s, int k) {
  double v[SPECIALISED_COORDS];
  memcpy (v, s->v0, (size_t)s->coords * sizeof *v);
  v[0] += 1e-3 * k;
  pw_run_restart (r, s->q0, v, NULL);
}

static long lanes_general (void *context, long n) {
  lanes_data *d = context;
  n = (n + d->n - 1) / d->n;
  for (int k = 0; k < d->n; k++)
    for (long i = 0, count; i < n; i += count) {
      count = n - i < SPECIALISED_STEPS ? n - i : SPECIALISED_STEPS;
      lanes_restart (d->general[k], d->system, k);
      engine_steps (d->general[k], count);
    }
  return n * d->n;
}

static long lanes_run (void *context, long n) {
  lanes_data *d = context;
  n = (n + d->n - 1) / d->n;
  for (long i = 0, count; i < n; i += count) {
    count = n - i < SPECIALISED_STEPS ? n - i : SPECIALISED_STEPS;
    for (int k = 0; k < d->n; k++) lanes_restart (d->run[k], d->system, k);
    const double end = d->run[0]->t + (double)count * d->step;
    while (pw_run_time (d->run[0]) < end) {
      int status[LANES_MOST];
      double t_end[LANES_MOST];
      pw_error error[LANES_MOST] = { { 0 } };
      for (int k = 0; k < d->n; k++) t_end[k] = end;
      pw_runs_advance (d->run, d->n, t_end, pw_scene_code_lanes (d->lanes), d->memory, status, error);
      for (int k = 0; k < d->n; k++)
        if (status[k] != PW_OK) engine_die (d->system->model, error[k].text);
    }
  }
  return n * d->n;
}

void engine_open_lanes (engine_case *c) {
  lanes_data *d = c->data = calloc (1, sizeof *d);
  pw_error error = { 0 };
  if (d == NULL) engine_die (c->key, "out of memory");
  d->system = specialised_system (c->model, &d->step);
  d->n = pw_processor_lanes ();
  d->code = engine_specialise (d->system);
  char *text = pw_system_source (d->system, NULL, &error);
  d->lanes = text && d->n > 1 ? pw_scene_lanes_open (text, d->system, d->n, &error) : NULL;
  free (text);
  if (pw_scene_code_lanes (d->lanes) == NULL) engine_die (c->key, d->n > 1 ? error.text : "no lanes on this processor");
  d->memory = pw_specialised_lanes_memory (pw_scene_code_lanes (d->lanes));
  for (int k = 0; k < d->n; k++) {
    pw_settings set = { .step = d->step, .span = 100 };
    d->general[k] = engine_open (d->system, "rk4+projection", &set);
    set.specialised = pw_scene_code_table (d->code);
    d->run[k] = engine_open (d->system, "rk4+projection", &set);
  }
  c->base = (timing_work){ lanes_general, d }, c->ours = (timing_work){ lanes_run, d };
  lanes_general (d, LANES_WARM_UP), lanes_run (d, LANES_WARM_UP);
  c->difference = engine_difference (d->general[1]->q, d->run[1]->q, d->system->coords);
}

void engine_close_lanes (engine_case *c) {
  lanes_data *d = c->data;
  for (int k = 0; k < d->n; k++) pw_run_close (d->general[k]), pw_run_close (d->run[k]);
  pw_scene_code_close (d->code);
  pw_scene_code_close (d->lanes);
  pw_system_free (d->system);
  free (d->memory);
  free (d);
}
