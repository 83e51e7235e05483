/* Reference solutions of comparisons. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "reference.h"

#define REFERENCE_LIMIT 10     /* smallest limit of the CPU time of a candidate [s] */
#define REFERENCE_LOOSEST 1e-9 /* the tolerance of a method that fails is loosened up to this, */
#define REFERENCE_FEWEST 1000  /* and its step of fixed size enlarged up to t_end over this */
#define REFERENCE_STEPS 1e5    /* steps of fixed size are t_end over this at first, or the smallest of the comparison */
#define REFERENCE_ROUND_OFF 8  /* eps of the largest number: the smallest uncertainty */

/* ---- Runs ---- */

typedef struct {
  pw_study_visitor base;
  pw_motion *motion;
} sampler;

/* Stores the samples up to the time reached. */
static int sampler_visit (pw_study_visitor *v, pw_run *run, pw_error *error) {
  pw_motion *m = ((sampler *)v)->motion;
  pw_sample sample;
  while ((v->due = pw_motion_next (m)) <= pw_run_time (run)) {
    int status = pw_run_sample (run, v->due, &sample, error);
    if (status != PW_OK) return status;
    pw_motion_take (m, v->study->m.system, &sample);
    v->row->balance = fmax (v->row->balance, fabs (sample.balance));
  }
  return PW_OK;
}

int pw_motion_run (pw_study *x, pw_row *r, pw_motion *motion, pw_error *error) {
  sampler v = { { .visit = sampler_visit, .study = x, .row = r }, motion };
  pw_settings settings = { .span = x->t_end, .ledger = motion != NULL };
  *(r->adaptive ? &settings.rtol : &settings.step) = r->level;
  if (motion) r->balance = motion->next = 0;
  return pw_study_run (x, r, &settings, motion ? &v.base : NULL, error);
}

/* ---- Uncertainty ---- */

/* Sizes of coordinates and velocities; raises uncertainties to round-off. */
static void reference_floor (const pw_system *s, pw_reference *ref) {
  int n = pw_system_coordinates (s), loads = 0;
  for (int k = 0; k < ref->motion.samples; k++)
    for (int j = 0; j < ref->motion.width; j++) {
      double value = fabs (ref->motion.x[k * ref->motion.width + j]);
      if (isnan (value)) continue;
      loads |= j >= 2 * n;
      if (j < 2 * n) ref->size[pw_motion_unit (s, j)] = fmax (ref->size[pw_motion_unit (s, j)], value);
    }
  for (int i = 0; i < MOTION_ERRORS; i++) {
    double size = i < MOTION_LAMBDA ? ref->size[i % MOTION_UNITS] : loads;
    if (i < MOTION_MOST) ref->uncertainty[i] = ref->uncertainty[i + MOTION_MOST]; /* at the end it may be accidental */
    ref->uncertainty[i] = fmax (ref->uncertainty[i], REFERENCE_ROUND_OFF * DBL_EPSILON * size);
  }
  if (ref->uncertainty[MOTION_LAMBDA] >= 1)
    ref->uncertainty[MOTION_LAMBDA] = 0; /* as large as the multipliers: unknown */
}

/* ---- Candidates ---- */

typedef struct {
  pw_study *study;
  pw_row row;
  int good;
  pw_motion motion;
} candidate;

/* Runs candidate i; increases a tolerance or step that is too small.  PW_RETRY: interrupted. */
static int reference_run (void *context, int i, pw_error *error) {
  candidate *c = (candidate *)context + i;
  pw_study *x = c->study;
  double loosest = c->row.adaptive ? REFERENCE_LOOSEST : x->t_end / REFERENCE_FEWEST;
  pw_error own = { 0 };
  int status = pw_motion_open (&c->motion, x->m.system, MOTION_SAMPLES, x->t_end, error);
  if (status != PW_OK) return status;
  status = PW_RETRY;
  while (status != PW_OK && c->row.level <= loosest) {
    own = (pw_error){ 0 };
    status = pw_motion_run (x, &c->row, &c->motion, &own);
    if (status == PW_OK || pw_stop || c->row.state == ROW_STOPPED || status == PW_RESOURCE || status == PW_INITIAL)
      break;
    c->row.level *= 10;
  }
  c->good = status == PW_OK;
  pw_study_part (x, &c->row, 1);
  return c->good ? PW_OK : pw_study_outcome (x, &c->row, status, &own, error);
}

/* The distance of two motions, relative to their size; NaN if it is unknown. */
static double reference_distance (const pw_system *s, const candidate *a, const candidate *b) {
  double error[MOTION_ERRORS], most = 0;
  pw_reference sizes = { .motion = a->motion };
  reference_floor (s, &sizes);
  pw_motion_distance (s, &a->motion, &b->motion, error);
  for (int i = 0; i < MOTION_UNITS; i++) {
    double part = error[MOTION_MOST + i] / (sizes.size[i] > 0 ? sizes.size[i] : 1);
    if (!isnan (most) && !(part <= most)) most = part;
  }
  return most;
}

static void reference_name (const candidate *c, char *text, size_t size) {
  char level[32];
  snprintf (text, size, "%s, %s %s%s", c->row.method, c->row.adaptive ? "rtol" : "step",
            pw_format (level, c->row.level, 4), c->row.adaptive ? "" : " s");
}

/* 1 if two methods have the same integrator. */
static int reference_related (const candidate *a, const candidate *b) {
  size_t n = strcspn (a->row.method, "+");
  return strncmp (a->row.method, b->row.method, n + 1) == 0;
}

/* The two candidates with the smallest distance, which is returned; INFINITY if there are fewer than two. */
static double reference_pair (const pw_system *s, const candidate *c, int related, int *best, int *with) {
  double least = INFINITY;
  for (int i = 0; i < REFERENCE_CANDIDATES; i++)
    for (int j = i + 1; j < REFERENCE_CANDIDATES; j++) {
      if (!c[i].good || !c[j].good || reference_related (&c[i], &c[j]) != related) continue;
      double apart = reference_distance (s, &c[i], &c[j]);
      if (apart < least) least = apart, *best = i, *with = j;
    }
  return least;
}

/* Selects the reference: the first of the two candidates that agree best, with different integrators if possible. */
static void reference_choose (pw_reference *ref, const pw_system *s, candidate *c) {
  int best = -1, with = -1;
  if (isinf (reference_pair (s, c, 0, &best, &with)) && isinf (reference_pair (s, c, 1, &best, &with))) return;
  ref->known = 1;
  reference_name (&c[best], ref->about, sizeof ref->about);
  pw_motion_distance (s, &c[best].motion, &c[with].motion, ref->uncertainty);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) {
    int place = i == with ? 0 : ref->partners + (ref->partners == 0);
    if (i == best || !c[i].good) continue;
    reference_name (&c[i], ref->partner[place].about, sizeof ref->partner[place].about);
    pw_motion_distance (s, &c[best].motion, &c[i].motion, ref->partner[place].error);
    ref->partners = place + 1 > ref->partners ? place + 1 : ref->partners;
  }
  ref->motion = c[best].motion;
  c[best].motion = (pw_motion){ .samples = 0 };
  reference_floor (s, ref);
}

static int reference_compute (pw_reference *ref, pw_study *x, double step, pw_error *error) {
  candidate c[REFERENCE_CANDIDATES] = {
    { x, .row = { .method = "erk8+projection", .adaptive = 1, .level = 3e-14 } },
    { x, .row = { .method = "rk4+projection", .level = fmin (step, x->t_end / REFERENCE_STEPS) } },
    { x, .row = { .method = "ida+ggl", .adaptive = 1, .level = 1e-13 } },
    { x, .row = { .method = "ida+baumgarte", .adaptive = 1, .level = 1e-13 } },
  };
  double limit = x->cpu_end;
  x->cpu_end = fmax (limit, REFERENCE_LIMIT);
  pw_study_show (x, "reference", "methods", REFERENCE_CANDIDATES);
  int status = pw_study_parallel (x, REFERENCE_CANDIDATES, reference_run, c, error);
  x->cpu_end = limit;
  if (status == PW_OK) reference_choose (ref, x->m.system, c);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) pw_motion_close (&c[i].motion);
  return status;
}

/* The exact solution of the model holds only for its own initial conditions. */
int pw_reference_find (pw_reference *ref, pw_study *x, double step, pw_error *error) {
  double t_end = x->line.t_end ? x->t_end : 0; /* 0: that of the table */
  int status, exact = x->reference_path == NULL && pw_system_has_reference (x->m.model) && x->line.starts == NULL;
  if (x->reference_path == NULL && !exact) return reference_compute (ref, x, step, error);
  snprintf (ref->about, sizeof ref->about, "%s", exact ? "the exact solution of the model" : x->reference_path);
  if (exact)
    status = pw_motion_reference (&ref->motion, x->m.model, x->m.system, x->t_end, error);
  else
    status = pw_motion_read (&ref->motion, x->m.system, x->reference_path, &t_end, 1, error);
  if (status != PW_OK) return status;
  if (!exact) x->t_end = t_end;
  ref->known = 1;
  reference_floor (x->m.system, ref);
  return PW_OK;
}

/* ---- Output ---- */

void pw_reference_print (const pw_reference *ref, int measured, int all) {
  if (!ref->known) {
    puts ("no two methods reach the end, so errors are unknown; --reference FILE.csv provides a reference\n");
    return;
  }
  pw_cli_print (stdout, "errors are measured against %s%s\n", ref->about, measured ? ", as if it were exact" : "");
  for (int i = 0; i < (all ? ref->partners : ref->partners > 0); i++)
    printf ("  %s agrees with it to %.1e m, %.1e rad%s\n", ref->partner[i].about,
            ref->partner[i].error[MOTION_MOST + MOTION_LENGTH], ref->partner[i].error[MOTION_MOST + MOTION_ANGLE],
            i == 0 ? ": the uncertainty of the reference" : "");
  putchar ('\n');
}

int pw_reference_write (const pw_reference *ref, const char *folder, const pw_study_column *of, pw_error *error) {
  pw_output *o = pw_figure_open (folder, "truth.csv", error);
  if (o == NULL) return error->status;
  FILE *f = pw_output_stream (o);
  pw_text t = { .chars = NULL };
  pw_text_cell (&t, "truth,against");
  for (int k = 0; k < MOTION_ERRORS; k++) pw_text_name (&t, of[k].name, of[k].unit);
  int status = pw_text_line (&t, f, folder, error);
  for (int i = -1; status == PW_OK && ref->known && i < ref->partners; i++) {
    pw_text_quoted (&t, ref->about);
    pw_text_quoted (&t, i < 0 ? "uncertainty" : ref->partner[i].about);
    for (int k = 0; k < MOTION_ERRORS; k++) pw_text_number (&t, i < 0 ? ref->uncertainty[k] : ref->partner[i].error[k]);
    status = pw_text_line (&t, f, folder, error);
  }
  return pw_cli_close_table (o, status, error);
}
