/* The cost of an evaluation of the accelerations and its parts: pw_run_profile.
 *
 * Measurements are made after the run: each part of an evaluation is repeated at the last state, often enough for the
 * clock.  So a profile changes neither the results nor the cost of the run. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "method.h"
#include "util.h"

enum { PROFILE_REPETITIONS = 5 }; /* of a measurement, of which the median counts */
#define PROFILE_MEASUREMENT 0.005 /* minimum processor time of a measurement [s] */
#define PROFILE_DISTANCE 1e-10    /* displacement off the constraints before a projection, in units of the scene */

/* What is measured: the stages of an evaluation and the whole (PROFILE_STAGES in number), then other parts. */
typedef enum {
  PROFILE_KINEMATICS,
  PROFILE_EQUATIONS,
  PROFILE_STABILISE, /* Baumgarte's terms */
  PROFILE_FACTOR,
  PROFILE_SOLVE,
  PROFILE_EVALUATION,
  PROFILE_STAGES,
  PROFILE_CONFIGURATIONS,
  PROFILE_PROJECT, /* a projection from p->from and the evaluation after it, which reuses J */
  PROFILE_SIGNALS, /* this and the following: of one batch of elements */
  PROFILE_J_GAMMA,
  PROFILE_FORCE,
  PROFILE_G
} profile_part;

typedef struct {
  pw_run *r;
  pw_projector projector;    /* if the method projects */
  const pw_element_batch *k; /* the batch being measured */
  pw_statistics of_run;      /* counts before the measurements */
  double t, earlier;         /* times that alternate, so that signals are evaluated each time */
  double *off;               /* coords: positions off the constraints */
  const double *from;        /* positions before a projection: of the run, or off */
  double *q, *v, *f;         /* coords + 3: results; accelerations and multipliers go to the run's sample arrays */
  double *gamma, *eta, *jv;  /* rows: results */
  char *memory;
} profile;

/* Does a part for the batch p->k. */
static void profile_do_batch (profile *p, profile_part part) {
  const pw_element_batch *k = p->k;
  const pw_kind *kind = k->kind;
  if (part == PROFILE_SIGNALS)
    for (int i = 0; i < k->b.count * kind->signals; i++) pw_signal_eval (&k->source[i], p->t);
  else if (part == PROFILE_J_GAMMA) {
    kind->J (&k->b, k->J);
    if (kind->gamma) kind->gamma (&k->b, p->gamma + k->row);
  } else if (part == PROFILE_FORCE)
    kind->force (&k->b, k->block);
  else {
    kind->g (&k->b, p->eta + k->row);
    if (kind->g_size) kind->g_size (&k->b, p->jv + k->row);
  }
}

static void profile_do (profile *p, profile_part part, double t) {
  pw_run *r = p->r;
  pw_workspace *w = r->w;
  size_t bytes = (size_t)r->s->coords * sizeof (double);
  switch (part) {
  case PROFILE_CONFIGURATIONS:
    pw_update_configurations (w, r->q, r->v);
    break;
  case PROFILE_KINEMATICS:
    pw_update_kinematics (w, t, r->q, r->v);
    break;
  case PROFILE_EQUATIONS:
    pw_evaluate_J (w);
    pw_evaluate_gamma (w, p->gamma);
    pw_evaluate_force (w, p->f);
    break;
  case PROFILE_STABILISE:
    pw_mul_J (w, r->v, p->jv);
    pw_evaluate_eta (w, p->eta);
    pw_evaluate_g (w, p->eta);
    break;
  case PROFILE_FACTOR:
    pw_saddle_factor (r->saddle);
    break;
  case PROFILE_SOLVE:
    pw_saddle_solve (r->saddle, p->f, p->gamma, r->a_at, r->lambda_at);
    break;
  case PROFILE_EVALUATION:
    pw_run_accelerate (r, t, r->q, r->v, r->a_at, r->lambda_at);
    break;
  case PROFILE_PROJECT:
    memcpy (p->q, p->from, bytes);
    memcpy (p->v, r->v, bytes);
    pw_project_state (&p->projector, r, t, p->q, p->v, r->a_at, r->lambda_at, NULL);
    break;
  default:
    profile_do_batch (p, part);
  }
}

/* ---- The clock ---- */

static double profile_clock (void) {
  struct timespec t;
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Processor time [s] of doing a part `count` times. */
static double profile_repeat (profile *p, profile_part part, long count) {
  double start = profile_clock ();
  for (; count > 0; count--) profile_do (p, part, count % 2 ? p->t : p->earlier);
  return profile_clock () - start;
}

/* The median times [ns] of `parts` parts, from `first` on.  They take turns, so that a temporary slowdown of the
 * machine affects all of them. */
static void profile_times (profile *p, profile_part first, int parts, double *ns) {
  double time[PROFILE_STAGES][PROFILE_REPETITIONS];
  long n[PROFILE_STAGES];
  for (int i = 0; i < parts; i++)
    for (n[i] = 1; profile_repeat (p, first + (profile_part)i, n[i]) < PROFILE_MEASUREMENT;) n[i] *= 2;
  for (int j = 0; j < PROFILE_REPETITIONS; j++)
    for (int i = 0; i < parts; i++) time[i][j] = profile_repeat (p, first + (profile_part)i, n[i]);
  for (int i = 0; i < parts; i++) {
    LAPACKE_dlasrt_work ('I', PROFILE_REPETITIONS, time[i]);
    ns[i] = 1e9 * time[i][PROFILE_REPETITIONS / 2] / (double)n[i];
  }
}

static double profile_time (profile *p, profile_part part) {
  double ns;
  profile_times (p, part, 1, &ns);
  return ns;
}

/* ---- The measurements ---- */

static void profile_kind (profile *p, pw_profile_kind *x) {
  const pw_kind *kind = p->k->kind;
  *x = (pw_profile_kind){ .kind = kind, .elements = p->k->b.count };
  if (kind->signals) x->signals = profile_time (p, PROFILE_SIGNALS);
  if (kind->rows) x->constraints = profile_time (p, PROFILE_J_GAMMA);
  if (kind->force && !kind->constant) x->force = profile_time (p, PROFILE_FORCE);
  if (kind->g) x->positions = profile_time (p, PROFILE_G);
}

static void profile_stages (profile *p, pw_profile *x) {
  double ns[PROFILE_STAGES];
  profile_do (p, PROFILE_EQUATIONS, p->t);
  profile_times (p, 0, PROFILE_STAGES, ns);
  x->kinematics = ns[PROFILE_KINEMATICS], x->equations = ns[PROFILE_EQUATIONS];
  x->stabilisation = p->r->alpha != 0 || p->r->beta != 0 ? ns[PROFILE_STABILISE] : 0;
  x->factorisation = ns[PROFILE_FACTOR], x->solution = ns[PROFILE_SOLVE], x->evaluation = ns[PROFILE_EVALUATION];
}

/* The cost of a projection with the average number of iterations of the run, interpolated between none and some. */
static void profile_projection (profile *p, pw_profile *x) {
  double steps = (double)p->of_run.steps, none, some;
  x->projections = 1 / fmax (1, pw_run_option (p->r, "every"));
  double others = (double)p->of_run.rhs + (p->projector.owns_velocity ? x->projections * steps : 0);
  x->iterations = fmax (0, (double)p->of_run.factorisations - others) / (x->projections * steps);
  p->from = p->r->q;
  none = profile_time (p, PROFILE_PROJECT);
  p->from = p->off;
  some = profile_time (p, PROFILE_PROJECT);
  int count = p->projector.iterations;
  x->projection = none + (count > 0 ? fmax (0, some - none) / count * x->iterations : 0);
}

static void profile_measure (profile *p, pw_profile *x) {
  profile_stages (p, x);
  /* only without Newton matrices: the steps then consist of these evaluations */
  if (p->of_run.jacobians == 0 && p->of_run.steps > 0) {
    if (p->projector.position) profile_projection (p, x);
    x->evaluations = (double)p->of_run.rhs / (double)p->of_run.steps - x->projections;
  }
  x->configurations = profile_time (p, PROFILE_CONFIGURATIONS);
  for (; x->kinds < p->r->s->batches; x->kinds++) {
    p->k = &p->r->w->batch[x->kinds];
    profile_kind (p, &x->kind[x->kinds]);
  }
}

/* ---- Opening ---- */

static int profile_open (profile *p, pw_error *error) {
  const pw_run *r = p->r;
  size_t n = (size_t)r->s->coords + 3, rows = (size_t)r->s->rows;
  const pw_array array[] = { { &p->off, n },      { &p->q, n },      { &p->v, n },    { &p->f, n },
                             { &p->gamma, rows }, { &p->eta, rows }, { &p->jv, rows } };
  p->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  if (p->memory == NULL) return pw_fail_memory (r->s, error);
  for (int j = 0; j < r->s->coords; j++) p->off[j] = r->q[j] + PROFILE_DISTANCE * pw_unit (r->s, j) * pw_sin (j + 1);
  (void)pw_evaluate_J_at (r->w, p->t, r->q, r->v);
  return pw_stabilised_by (r, PW_PROJECTION) ? pw_projector_open_by_options (&p->projector, p->r, error) : PW_OK;
}

int pw_run_profile (pw_run *r, pw_profile *x, pw_error *error) {
  *x = (pw_profile){ .kinds = 0 };
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  profile p = { .r = r, .of_run = r->statistics, .t = r->t, .earlier = nextafter (r->t, -INFINITY) };
  x->kind = calloc ((size_t)r->s->batches + 1, sizeof *x->kind);
  int status = x->kind ? profile_open (&p, error) : pw_fail_memory (r->s, error);
  if (status == PW_OK && pw_run_accelerate (r, r->t, r->q, r->v, r->a_at, r->lambda_at) != PW_OK) status = PW_RETRY;
  if (status == PW_OK) profile_measure (&p, x);
  r->statistics = p.of_run;
  pw_projector_close (&p.projector);
  free (p.memory);
  return status;
}

void pw_profile_free (pw_profile *x) {
  free (x->kind);
  *x = (pw_profile){ .kinds = 0 };
}
