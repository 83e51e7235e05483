/* The cost of an evaluation of the accelerations.
 *
 * Measurements are made after the run: each part of an evaluation is repeated at the last state, often enough for the
 * clock.  So a profile changes neither the results nor the cost of the run. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "method.h"
#include "util.h"

enum { PROFILE_BATCHES = 5, PROFILE_PIECES = 6 };
#define PROFILE_BATCH 0.005    /* minimum processor time of a batch [s] */
#define PROFILE_DISTANCE 1e-10 /* displacement off the constraints before a projection, in units of the length scale */

typedef struct {
  pw_run *r;
  const pw_system *s;
  pw_saddle *saddle;         /* as that of the run */
  pw_projector projector;    /* if the method projects */
  const pw_element_batch *k; /* the kind being measured */
  pw_statistics done;        /* counts of the run, before the measurements */
  double t, before;          /* two times, so that signals are evaluated each time */
  double *q, *v, *far;       /* the last state, and positions off the constraints */
  const double *from;        /* q or far */
  double *a, *f, *y;         /* coords + 3: results */
  double *gamma, *eta, *jv;  /* rows: results */
  double *lambda;
  char *memory;
} profile;

/* ---- Pieces of work, done n times ---- */

typedef void profile_work (profile *p, long n);

static void profile_configurations (profile *p, long n) {
  for (; n > 0; n--) pw_update_kinematics (p->r->w, p->t, p->q, p->v);
}

static void profile_kinematics (profile *p, long n) {
  for (; n > 0; n--) pw_update_kinematics (p->r->w, n % 2 ? p->t : p->before, p->q, p->v);
}

static void profile_signals (profile *p, long n) {
  const pw_element_batch *k = p->k;
  int derivatives = !pw_kind_forced (k->kind), count = k->b.count * k->kind->signals;
  for (; n > 0; n--)
    for (int i = 0; i < count; i++) pw_signal_eval (&k->source[i], p->t, derivatives, k->u + 3 * i);
}

static void profile_J_gamma (profile *p, long n) {
  const pw_element_batch *k = p->k;
  const pw_kind *kind = k->kind;
  for (; n > 0; n--) {
    kind->J (&k->b, k->J);
    if (kind->gamma) kind->gamma (&k->b, p->gamma + k->row);
  }
}

static void profile_force (profile *p, long n) {
  for (; n > 0; n--) p->k->kind->force (&p->k->b, p->k->block);
}

static void profile_g (profile *p, long n) {
  const pw_element_batch *k = p->k;
  for (; n > 0; n--) {
    k->kind->g (&k->b, p->eta + k->row);
    if (k->kind->g_size) k->kind->g_size (&k->b, p->jv + k->row);
  }
}

static void profile_equations (profile *p, long n) {
  for (; n > 0; n--) {
    pw_evaluate_J (p->r->w);
    pw_evaluate_gamma (p->r->w, p->gamma);
    pw_evaluate_force (p->r->w, p->f);
  }
}

/* The work for Baumgarte's terms. */
static void profile_stabilise (profile *p, long n) {
  for (; n > 0; n--) {
    pw_mul_J (p->r->w, p->v, p->jv);
    pw_evaluate_eta (p->r->w, p->eta);
    pw_evaluate_g (p->r->w, p->eta);
  }
}

static void profile_factor (profile *p, long n) {
  for (; n > 0; n--) pw_saddle_factor (p->saddle);
}

static void profile_solve (profile *p, long n) {
  for (; n > 0; n--) pw_saddle_solve (p->saddle, p->f, p->gamma, p->a, p->lambda);
}

static void profile_evaluation (profile *p, long n) {
  for (; n > 0; n--) pw_run_accelerate (p->r, n % 2 ? p->t : p->before, p->q, p->v, p->a, p->lambda);
}

/* A projection from p->from and the evaluation after it, which reuses J and its factors. */
static void profile_project (profile *p, long n) {
  size_t bytes = (size_t)p->s->coords * sizeof (double);
  for (; n > 0; n--) {
    memcpy (p->f, p->from, bytes);
    memcpy (p->y, p->v, bytes);
    pw_project_state (&p->projector, p->r, n % 2 ? p->t : p->before, p->f, p->y, p->a, p->lambda);
  }
}

/* ---- The clock ---- */

static int profile_order (const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double profile_clock (void) {
  struct timespec t;
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double profile_batch (profile *p, profile_work *work, long n) {
  double start = profile_clock ();
  work (p, n);
  return profile_clock () - start;
}

/* The median time [ns] of each kind of work; the kinds take turns, so that a temporary slowdown of the machine affects
 * all of them.  0 for NULL. */
static void profile_times (profile *p, profile_work *const *work, int count, double *ns) {
  double time[PROFILE_PIECES][PROFILE_BATCHES];
  long n[PROFILE_PIECES];
  for (int i = 0; i < count; i++)
    for (n[i] = 1; work[i] && profile_batch (p, work[i], n[i]) < PROFILE_BATCH;) n[i] *= 2;
  for (int j = 0; j < PROFILE_BATCHES; j++)
    for (int i = 0; i < count; i++) time[i][j] = work[i] ? profile_batch (p, work[i], n[i]) : 0;
  for (int i = 0; i < count; i++) {
    qsort (time[i], PROFILE_BATCHES, sizeof **time, profile_order);
    ns[i] = 1e9 * time[i][PROFILE_BATCHES / 2] / (double)n[i];
  }
}

static double profile_time (profile *p, profile_work *work) {
  double ns;
  profile_times (p, &work, 1, &ns);
  return ns;
}

/* ---- The measurements ---- */

static void profile_kind (profile *p, pw_profile_kind *x) {
  const pw_kind *kind = p->k->kind;
  *x = (pw_profile_kind){ .kind = kind, .elements = p->k->b.count };
  if (kind->signals) x->signals = profile_time (p, profile_signals);
  if (kind->rows) x->constraints = profile_time (p, profile_J_gamma);
  if (kind->force && !kind->constant) x->force = profile_time (p, profile_force);
  if (kind->g) x->positions = profile_time (p, profile_g);
}

static void profile_stages (profile *p, pw_profile *x) {
  int stabilised = p->r->alpha != 0 || p->r->beta != 0;
  profile_work *const work[PROFILE_PIECES] = {
    profile_kinematics, profile_equations, stabilised ? profile_stabilise : NULL,
    profile_factor,     profile_solve,     profile_evaluation
  };
  double ns[PROFILE_PIECES];
  profile_equations (p, 1);
  profile_times (p, work, PROFILE_PIECES, ns);
  x->kinematics = ns[0], x->equations = ns[1], x->stabilisation = ns[2];
  x->factorisation = ns[3], x->solution = ns[4], x->evaluation = ns[5];
}

/* The cost of a projection with the average number of iterations of the run, interpolated between none and some. */
static void profile_projection (profile *p, pw_profile *x) {
  double steps = (double)p->done.steps, none, some;
  x->projections = 1 / fmax (1, pw_run_option (p->r, "every"));
  double others = (double)p->done.rhs + (p->projector.own_velocity ? x->projections * steps : 0);
  x->iterations = fmax (0, (double)p->done.factorisations - others) / (x->projections * steps);
  p->from = p->q;
  none = profile_time (p, profile_project);
  p->from = p->far;
  some = profile_time (p, profile_project);
  int count = p->projector.iterations;
  x->projection = none + (count > 0 ? fmax (0, some - none) / count * x->iterations : 0);
}

static void profile_measure (profile *p, pw_profile *x) {
  profile_stages (p, x);
  /* explicit methods only: their steps consist of these evaluations */
  if (p->done.jacobians == 0 && p->done.steps > 0) {
    if (p->projector.position) profile_projection (p, x);
    x->evaluations = (double)p->done.rhs / (double)p->done.steps - x->projections;
  }
  x->configurations = profile_time (p, profile_configurations);
  for (; x->kinds < p->s->batches; x->kinds++) {
    p->k = &p->r->w->batch[x->kinds];
    profile_kind (p, &x->kind[x->kinds]);
  }
}

/* ---- Opening ---- */

static int profile_allocate (profile *p, pw_error *error) {
  size_t n = (size_t)p->s->coords + 3, rows = (size_t)p->s->rows;
  const pw_array array[] = { { &p->q, n },     { &p->v, n },        { &p->far, n },      { &p->a, n },
                             { &p->f, n },     { &p->y, n },        { &p->gamma, rows }, { &p->eta, rows },
                             { &p->jv, rows }, { &p->lambda, rows } };
  p->memory = pw_take_arrays (array, sizeof array / sizeof *array);
  return p->memory ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

static int profile_open (profile *p, pw_error *error) {
  int status = profile_allocate (p, error);
  if (status != PW_OK) return status;
  size_t bytes = (size_t)p->s->coords * sizeof (double);
  p->t = p->r->t;
  p->before = nextafter (p->t, -INFINITY);
  memcpy (p->q, p->r->q, bytes);
  memcpy (p->v, p->r->v, bytes);
  for (int j = 0; j < p->s->coords; j++) p->far[j] = p->q[j] + PROFILE_DISTANCE * p->s->scale.length * pw_sin (j + 1);
  pw_update_kinematics (p->r->w, p->t, p->q, p->v);
  pw_evaluate_J (p->r->w);
  p->saddle = pw_saddle_open (p->r->w, p->s->mass, p->s->rows, p->r->active, error);
  if (p->saddle == NULL) return PW_RESOURCE;
  return pw_stabilised_by (p->r, PW_PROJECTION) ? pw_projector_open_asked (&p->projector, p->r, error) : PW_OK;
}

int pw_run_profile (pw_run *r, pw_profile *x, pw_error *error) {
  profile p = { .r = r, .s = r->s, .done = r->statistics };
  *x = (pw_profile){ .kind = calloc ((size_t)r->s->batches + 1, sizeof *x->kind) };
  int status = x->kind ? profile_open (&p, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_run_accelerate (r, p.t, p.q, p.v, p.a, p.lambda) == PW_OK ? PW_OK : PW_RETRY;
  if (status == PW_OK) profile_measure (&p, x);
  r->statistics = p.done;
  pw_projector_close (&p.projector);
  pw_saddle_close (p.saddle);
  free (p.memory);
  return status;
}

void pw_profile_free (pw_profile *x) {
  free (x->kind);
  *x = (pw_profile){ .kinds = 0 };
}
