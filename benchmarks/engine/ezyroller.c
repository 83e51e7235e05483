/* Comparisons of the EzyRoller with the programs by hand: an evaluation, a step of classical Runge-Kutta with
 * projection. */
#include <stdlib.h>
#include <string.h>
#include "by_hand.h"
#include "engine.h"
#include "pinwheel-files.h"

enum { EZY_POOL = 64, EZY_SPACING = 200 /* steps between states of the pool */ };
enum { EZY_ROUND = 100000 };              /* steps after which a run starts again */
static const double ezy_step_size = 1e-3; /* [s] */

/* One side of a comparison: the vehicle by hand and by Pinwheel, and a pool of states of its motion to evaluate. */
typedef struct {
  ezy hand;
  ezy_state state;
  long steps;
  pw_system *system;
  pw_run *run;
  pw_scene_code *code; /* or NULL */
  double t[EZY_POOL], q[EZY_POOL][6], v[EZY_POOL][6];
  double y[EZY_POOL][6]; /* the same states in minimal coordinates */
  double a[9];           /* 3 of the ground */
  double lambda[4];
} ezy_side;

typedef struct {
  ezy_side side[2];
} ezy_data;

static void ezy_open_side (ezy_side *d, int massless, int specialised, const char *method) {
  ezy_model p = by_hand_model;
  if (massless) p.m2 = p.I2 = 0;
  ezy_open (&d->hand, &p);
  ezy_start (&d->hand, &d->state);
  for (int k = 0; k < EZY_POOL; k++) {
    const double *q = d->state.q, *v = d->state.v;
    d->t[k] = d->state.t;
    memcpy (d->q[k], q, sizeof d->state.q);
    memcpy (d->v[k], v, sizeof d->state.v);
    double u = v[0] * cos (q[2]) + v[1] * sin (q[2]);
    double y[6] = { q[0] - p.a * cos (q[2]), q[1] - p.a * sin (q[2]), q[2], q[5], u, v[2] };
    memcpy (d->y[k], y, sizeof y);
    for (int i = 0; i < EZY_SPACING; i++)
      massless ? ezy_massless_step (&d->hand, ezy_step_size, &d->state)
               : ezy_massive_step (&d->hand, ezy_step_size, &d->state);
  }
  ezy_start (&d->hand, &d->state);
  d->system = engine_ezyroller (massless);
  if (specialised) d->code = engine_specialise (d->system);
  pw_settings set = { .step = ezy_step_size, .span = 100, .specialised = pw_scene_code_table (d->code) };
  d->run = engine_open (d->system, method, &set);
}

static ezy_data *ezy_open_sides (engine_case *c, int massless0, int massless1, const char *method) {
  ezy_data *d = calloc (1, sizeof *d);
  if (d == NULL) engine_die (c->key, "out of memory");
  ezy_open_side (&d->side[0], massless0, 0, method);
  ezy_open_side (&d->side[1], massless1, c->specialised, method);
  c->data = d;
  c->base.context = &d->side[0];
  c->ours.context = &d->side[1];
  return d;
}

void engine_close_ezy (engine_case *c) {
  ezy_data *d = c->data;
  for (int i = 0; i < 2; i++) {
    pw_run_close (d->side[i].run);
    pw_scene_code_close (d->side[i].code);
    pw_system_free (d->side[i].system);
  }
  free (d);
}

/* ---- One evaluation ---- */

static long ezy_hand (void *context, long n) {
  ezy_side *d = context;
  for (long i = 0; i < n; i++) {
    int k = (int)(i % EZY_POOL);
    (d->hand.p.m2 > 0 ? ezy_massive : ezy_massless) (&d->hand, d->t[k], d->q[k], d->v[k], d->a, d->lambda);
  }
  return n;
}

static long ezy_hand_minimal (void *context, long n) {
  ezy_side *d = context;
  for (long i = 0; i < n; i++) {
    int k = (int)(i % EZY_POOL);
    ezy_minimal (&d->hand, d->t[k], d->y[k], d->a);
  }
  return n;
}

static long ezy_ours (void *context, long n) {
  ezy_side *d = context;
  for (long i = 0; i < n; i++) {
    int k = (int)(i % EZY_POOL);
    pw_run_accelerate (d->run, d->t[k], d->q[k], d->v[k], d->a, d->lambda);
  }
  return n;
}

/* The largest relative difference of accelerations and multipliers over the pool. */
static double ezy_compare (engine_case *c, const ezy_data *d) {
  const ezy_side *x = &d->side[0], *y = &d->side[1];
  double worst = 0;
  for (long n = 1; n <= EZY_POOL; n++) {
    c->base.run (c->base.context, n);
    c->ours.run (c->ours.context, n);
    worst = fmax (worst, engine_difference (x->a, y->a, 6));
    worst = fmax (worst, engine_difference (x->lambda, y->lambda, 4));
  }
  return worst;
}

void engine_open_rhs (engine_case *c) {
  ezy_data *d = ezy_open_sides (c, c->massless, c->massless, "rk4+none");
  c->base.run = ezy_hand;
  c->ours.run = ezy_ours;
  c->base_function = c->massless ? "ezy_massless" : "ezy_massive";
  c->our_function = "pw_run_accelerate";
  pw_run_advance (d->side[1].run, 1, NULL); /* first evaluations of a run cost more: its watchdog starts */
  c->difference = ezy_compare (c, d);
}

void engine_open_light (engine_case *c) {
  ezy_open_sides (c, 0, 1, "rk4+none");
  c->base.run = c->ours.run = ezy_ours;
  c->base_function = c->our_function = "pw_run_accelerate";
}

/* Compares phi1'' and omega2, which both formulations have. */
void engine_open_minimal (engine_case *c) {
  ezy_data *d = ezy_open_sides (c, c->massless, c->massless, "rk4+none");
  c->base.run = ezy_hand_minimal;
  c->ours.run = ezy_ours;
  c->base_function = "ezy_minimal";
  c->our_function = "pw_run_accelerate";
  for (long n = 1; n <= EZY_POOL; n++) {
    c->base.run (c->base.context, n);
    c->ours.run (c->ours.context, n);
    double x[2] = { d->side[0].a[5], d->side[0].a[3] }, y[2] = { d->side[1].a[2], d->side[1].v[n - 1][5] };
    c->difference = fmax (c->difference, engine_difference (x, y, 2));
  }
}

/* ---- One step of rk4+projection ---- */

static long ezy_hand_step (void *context, long n) {
  ezy_side *d = context;
  for (long i = 0; i < n; i++) {
    if (d->steps++ % EZY_ROUND == 0) ezy_start (&d->hand, &d->state);
    d->hand.p.m2 > 0 ? ezy_massive_step (&d->hand, ezy_step_size, &d->state)
                     : ezy_massless_step (&d->hand, ezy_step_size, &d->state);
  }
  return n;
}

/* A round is 100 s, a multiple of the period of the torque: a restart at the time reached repeats the motion. */
static long ezy_our_step (void *context, long n) {
  ezy_side *d = context;
  ezy_state start;
  ezy_start (&d->hand, &start);
  engine_rounds (d->run, &d->steps, EZY_ROUND, start.q, start.v, n);
  return n;
}

void engine_open_step (engine_case *c) {
  ezy_data *d = ezy_open_sides (c, c->massless, c->massless, "rk4+projection");
  c->base.run = ezy_hand_step;
  c->ours.run = ezy_our_step;
  c->base_function = c->massless ? "ezy_massless_step" : "ezy_massive_step";
  c->our_function = "pw_run_advance_to";
  c->base.run (c->base.context, 10000);
  c->ours.run (c->ours.context, 10000);
  c->difference = fmax (engine_difference (d->side[0].state.q, d->side[1].run->q, 6),
                        engine_difference (d->side[0].state.v, d->side[1].run->v, 6));
}

void engine_open_light_step (engine_case *c) {
  ezy_open_sides (c, 0, 1, "rk4+projection");
  c->base.run = c->ours.run = ezy_our_step;
  c->base_function = c->our_function = "pw_run_advance_to";
}
