/* Where the time of a run goes.
 *
 * Nothing is measured while it runs: when it is over, the pieces an evaluation is made of are done again at its last
 * state, each by itself and often enough for a clock.  So a run is the same to the bit with a profile and without, and
 * costs the same. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "model.h"
#include "profile.h"
#include "progress.h"
#include "signal.h"
#include "util.h"

enum { PROFILE_BATCHES = 5, PROFILE_PIECES = 6 };
#define PROFILE_BATCH 0.005    /* least processor time of a batch [s] */
#define PROFILE_DISTANCE 1e-10 /* off the constraints, before a projection, in units of the length scale */

typedef struct {
  pw_run *r;
  pw_system *s;
  pw_saddle *saddle;        /* as the run's own */
  pw_projector projector;   /* if the method projects */
  const pw_slab *k;         /* the kind being measured */
  pw_statistics done;       /* by the run, before anything was measured */
  double t, before;         /* two times, so that signals are evaluated each time */
  double *q, *v, *far;      /* the last state, and positions off the constraints */
  const double *from;       /* q or far */
  double *a, *f, *y;        /* coords + 3: results */
  double *gamma, *eta, *jv; /* rows: results */
  double *lambda;
  char *memory;
} profile;

/* ---- Pieces of work, done n times ---- */

typedef void profile_work (profile *p, long n);

static void profile_poses (profile *p, long n) {
  for (; n > 0; n--) pw_place (p->s, p->t, p->q, p->v);
}

static void profile_place (profile *p, long n) {
  for (; n > 0; n--) pw_place (p->s, n % 2 ? p->t : p->before, p->q, p->v);
}

static void profile_signals (profile *p, long n) {
  const pw_slab *k = p->k;
  int derivatives = !pw_kind_forced (k->kind), count = k->b.count * k->kind->signals;
  for (; n > 0; n--)
    for (int i = 0; i < count; i++) pw_signal_eval (&k->source[i], p->t, derivatives, k->u + 3 * i);
}

static void profile_J_gamma (profile *p, long n) {
  const pw_slab *k = p->k;
  const pw_kind *kind = k->kind;
  for (; n > 0; n--) {
    if (kind->J_gamma) {
      kind->J_gamma (&k->b, k->J, p->gamma + k->row);
      continue;
    }
    kind->J (&k->b, k->J);
    if (kind->gamma) kind->gamma (&k->b, p->gamma + k->row);
  }
}

static void profile_force (profile *p, long n) {
  for (; n > 0; n--) p->k->kind->force (&p->k->b, p->k->block);
}

static void profile_g (profile *p, long n) {
  const pw_slab *k = p->k;
  for (; n > 0; n--) {
    k->kind->g (&k->b, p->eta + k->row);
    if (k->kind->g_size) k->kind->g_size (&k->b, p->jv + k->row);
  }
}

static void profile_sweep (profile *p, long n) {
  for (; n > 0; n--) {
    pw_sweep_J_gamma (p->s, p->gamma);
    pw_sweep_force (p->s, p->f);
  }
}

/* What Baumgarte's terms take. */
static void profile_stabilise (profile *p, long n) {
  for (; n > 0; n--) {
    pw_mul_J (p->s, p->v, p->jv);
    pw_sweep_eta (p->s, p->eta);
    pw_sweep_g (p->s, p->eta);
  }
}

static void profile_factor (profile *p, long n) {
  for (; n > 0; n--) pw_saddle_factor (p->saddle);
}

static void profile_solve (profile *p, long n) {
  for (; n > 0; n--) pw_saddle_solve (p->saddle, p->f, p->gamma, p->a, p->lambda);
}

static void profile_evaluation (profile *p, long n) {
  for (; n > 0; n--) pw_accelerate (p->r, n % 2 ? p->t : p->before, p->q, p->v, p->a, p->lambda);
}

/* A projection from p->from, and the evaluation after it, which finds J and its factors there. */
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

static double profile_batch (profile *p, profile_work *work, long n) {
  double start = pw_cpu_clock ();
  work (p, n);
  return pw_cpu_clock () - start;
}

/* The median time of one piece [ns], for several that take turns, so that a machine that is slow for a while is slow for
 * all of them; a piece that is NULL takes none. */
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

/* ---- Printing ---- */

/* One decimal below 100, in any locale; nothing for what is not there. */
static void profile_number (FILE *out, int there, double value, int width) {
  char text[40] = "";
  if (there && fabs (value) >= 99.95)
    snprintf (text, sizeof text, "%.0f", value);
  else if (there)
    snprintf (text, sizeof text, "%d.%d", (int)round (10 * value) / 10, abs ((int)round (10 * value)) % 10);
  fprintf (out, "%*s", width, text);
}

static void profile_share (FILE *out, double part, double whole) {
  fprintf (out, "%8.0f %%", 100 * part / whole);
}

static void profile_kind (profile *p, double whole, FILE *out) {
  const pw_kind *kind = p->k->kind;
  int count = p->k->b.count, rows = count * kind->rows, forced = kind->force && !kind->constant;
  double signals = kind->signals ? profile_time (p, profile_signals) : 0;
  double J = rows ? profile_time (p, profile_J_gamma) : 0, force = forced ? profile_time (p, profile_force) : 0;
  fprintf (out, "  %-14s%9d%9d%9d", kind->name, count, rows, rows + count * kind->own);
  profile_number (out, kind->signals > 0, signals, 10);
  profile_number (out, rows > 0, J, 10);
  profile_number (out, forced, force, 10);
  profile_number (out, 1, signals + J + force, 10);
  profile_share (out, signals + J + force, whole);
  if (kind->g) profile_number (out, 1, profile_time (p, profile_g), 10);
  fprintf (out, "\n");
}

static void profile_kinds (profile *p, double whole, FILE *out) {
  double poses = profile_time (p, profile_poses);
  fprintf (out, "  %-14s%9s%9s%9s%10s%10s%10s%10s%10s%10s\n", "kind", "elements", "rows", "unknowns", "signals",
           "J, gamma", "force", "sum", "share", "g");
  fprintf (out, "  %-14s%9d%9d%9d%30s", "(bodies)", p->s->bodies, 0, 3 * p->s->bodies, "");
  profile_number (out, 1, poses, 10);
  profile_share (out, poses, whole);
  fprintf (out, "\n");
  for (int i = 0; i < p->s->slabs; i++) {
    p->k = &p->s->slab[i];
    profile_kind (p, whole, out);
  }
}

/* The stages of an evaluation and, last, all of it. */
static const char *const profile_stage[PROFILE_PIECES] = { "place",  "sweep", "stabilise",
                                                           "factor", "solve", "all in one go" };

/* A step of an explicit method, as the run made them. */
typedef struct {
  double stage[PROFILE_PIECES];               /* [ns]; 0: there is none */
  double evaluations;                         /* how many, but for those after a projection */
  double projection, projections, iterations; /* [ns], how many, iterations of the positions in each */
} profile_step;

static void profile_measure_stages (profile *p, profile_step *step) {
  int stabilised = p->r->alpha != 0 || p->r->beta != 0;
  profile_work *const work[PROFILE_PIECES] = { profile_place,  profile_sweep, stabilised ? profile_stabilise : NULL,
                                               profile_factor, profile_solve, profile_evaluation };
  profile_sweep (p, 1);
  profile_times (p, work, PROFILE_PIECES, step->stage);
}

/* One line of the stages; what is not positive is left out. */
static void profile_line (FILE *out, const char *name, double ns, double whole, double per_step, double step) {
  fprintf (out, "  %-14s", name);
  if (whole > 0) profile_number (out, 1, ns, 18);
  if (whole > 0) profile_share (out, ns, whole);
  if (step > 0) {
    profile_number (out, 1, ns * per_step, whole > 0 ? 14 : 42);
    profile_share (out, ns * per_step, step);
  }
  fprintf (out, "\n");
}

static void profile_stages (const profile_step *step, FILE *out) {
  double whole = step->stage[PROFILE_PIECES - 1];
  double all = step->evaluations * whole + step->projections * step->projection;
  fprintf (out, "\n  %-14s%18s%10s", "stage", "per evaluation", "share");
  if (all > 0) fprintf (out, "%14s%10s", "per step", "share");
  fprintf (out, "\n");
  for (int i = 0; i < PROFILE_PIECES; i++)
    if (step->stage[i] > 0) profile_line (out, profile_stage[i], step->stage[i], whole, step->evaluations, all);
  if (step->projections > 0) profile_line (out, "project", step->projection, 0, step->projections, all);
}

static double profile_option (const profile *p, const char *name, double otherwise) {
  const pw_option *o = p->r->method->options;
  while (o->name && strcmp (o->name, name) != 0) o++;
  return o->name ? pw_option_value (p->r, name) : otherwise;
}

/* A projection with as many iterations as those of the run had: between none and some. */
static void profile_projection (profile *p, profile_step *step) {
  double steps = (double)p->done.steps, none, some;
  step->projections = 1 / profile_option (p, "every", 1);
  double others = (double)p->done.rhs + (p->projector.own_velocity ? step->projections * steps : 0);
  step->iterations = fmax (0, (double)p->done.factorisations - others) / (step->projections * steps);
  p->from = p->q;
  none = profile_time (p, profile_project);
  p->from = p->far;
  some = profile_time (p, profile_project);
  int count = p->projector.iterations;
  step->projection = none + (count > 0 ? fmax (0, some - none) / count * step->iterations : 0);
}

static void profile_print (profile *p, double cpu, FILE *out) {
  char t[32], evaluations[32], iterations[32];
  double steps = (double)p->done.steps;
  int explicitly = p->done.jacobians == 0 && steps > 0; /* its steps are made of these evaluations */
  profile_step step = { .evaluations = 0 };
  profile_measure_stages (p, &step);
  if (explicitly && p->projector.position) profile_projection (p, &step);
  if (explicitly) step.evaluations = (double)p->done.rhs / steps - step.projections;
  fprintf (out, "\n  what an evaluation of the accelerations costs at t = %s s [ns]\n\n", pw_format (t, p->t, 8));
  profile_kinds (p, step.stage[PROFILE_PIECES - 1], out);
  profile_stages (&step, out);
  if (steps == 0) return;
  pw_format (evaluations, (double)p->done.rhs / steps, 3);
  pw_format (iterations, step.iterations, 2);
  fprintf (out, "\n  a step of the run took %.0f ns, %s evaluations%s", 1e9 * cpu / steps, evaluations,
           explicitly ? "" : " of residuals, and matrices of the method's own");
  if (step.projections > 0)
    fprintf (out, " (that after a projection is part of it), %s iterations to project", iterations);
  fprintf (out, "\n");
}

/* ---- Opening ---- */

static int profile_allocate (profile *p, pw_error *error) {
  size_t n = (size_t)p->s->coords + 3, rows = (size_t)p->s->rows;
  const pw_array array[] = { { &p->q, n },     { &p->v, n },        { &p->far, n },      { &p->a, n },
                             { &p->f, n },     { &p->y, n },        { &p->gamma, rows }, { &p->eta, rows },
                             { &p->jv, rows }, { &p->lambda, rows } };
  p->memory = pw_take_arrays (array, sizeof array / sizeof *array);
  return p->memory ? PW_OK : pw_fail (error, PW_MACHINE, "out of memory");
}

/* The projector of a method that projects, in its metric. */
static int profile_open_projector (profile *p, pw_error *error) {
  double *one = p->a;
  if (!pw_stabilised_by (p->r, PW_PROJECTION)) return PW_OK;
  if (profile_option (p, "metric", 0) == 0) return pw_projector_open (&p->projector, p->r, NULL, NULL, error);
  for (int j = 0; j < p->s->coords; j++) one[j] = 1;
  return pw_projector_open (&p->projector, p->r, one, one, error);
}

static int profile_open (profile *p, const pw_sample *last, pw_error *error) {
  int status = profile_allocate (p, error);
  if (status != PW_OK) return status;
  p->t = last->t;
  p->before = nextafter (p->t, -INFINITY);
  memcpy (p->q, last->q, (size_t)p->s->coords * sizeof (double));
  memcpy (p->v, last->v, (size_t)p->s->coords * sizeof (double));
  for (int j = 0; j < p->s->coords; j++) p->far[j] = p->q[j] + PROFILE_DISTANCE * p->s->scale.length * sin (j + 1);
  pw_place (p->s, p->t, p->q, p->v);
  pw_sweep_J (p->s);
  p->saddle = pw_saddle_open (p->s, p->s->mass, p->s->rows, p->r->active, error);
  return p->saddle ? profile_open_projector (p, error) : error->status;
}

int pw_profile (pw_run *r, const pw_sample *last, double cpu, FILE *out, pw_error *error) {
  profile p = { .r = r, .s = r->s, .done = *pw_run_statistics (r) };
  int status = profile_open (&p, last, error);
  if (status == PW_OK && pw_accelerate (r, p.t, p.q, p.v, p.a, p.lambda) == PW_OK)
    profile_print (&p, cpu, out);
  else if (status == PW_OK)
    fprintf (out, "\n  no profile: the run ended in a singular pose\n");
  pw_projector_close (&p.projector);
  pw_saddle_close (p.saddle);
  free (p.memory);
  return status;
}
