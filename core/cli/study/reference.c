/* The reference solution of a comparison: a table, the exact solution of the model, or else computed by methods that
 * have little in common, each at its tightest.  Of the two that agree best one is the reference; its uncertainty is
 * their distance. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "compare.h"

enum { REFERENCE_CANDIDATES = COMPARE_PARTNERS + 1 };
#define REFERENCE_LIMIT 10     /* CPU time of a candidate, at least [s] */
#define REFERENCE_LOOSEST 1e-9 /* tolerances are loosened up to this if a method fails, */
#define REFERENCE_FEWEST 1000  /* fixed steps up to t_end over this, */
#define REFERENCE_STEPS 1e5    /* from t_end over this, or the last one of the ladder */
#define REFERENCE_ROUND_OFF 8  /* eps of the largest number: the smallest uncertainty */

typedef struct {
  pw_row row;
  int good;
  pw_motion motion;
} candidate;

/* ---- Uncertainty ---- */

/* Agreement to the bit, where columns are compared, is no better than round-off. */
static void reference_floor (const pw_system *s, pw_reference *t) {
  int n = pw_system_coordinates (s), loads = 0;
  for (int k = 0; k < t->motion.samples; k++)
    for (int j = 0; j < t->motion.width; j++) {
      double value = fabs (t->motion.x[k * t->motion.width + j]);
      if (isnan (value)) continue;
      loads |= j >= 2 * n;
      if (j < 2 * n) t->size[pw_motion_unit (s, j)] = fmax (t->size[pw_motion_unit (s, j)], value);
    }
  for (int i = 0; i < MOTION_ERRORS; i++) {
    double size = i < MOTION_LAMBDA ? t->size[i % MOTION_UNITS] : loads;
    if (i < MOTION_MOST) t->uncertainty[i] = t->uncertainty[i + MOTION_MOST]; /* at the end it may be accidental */
    t->uncertainty[i] = fmax (t->uncertainty[i], REFERENCE_ROUND_OFF * DBL_EPSILON * size);
  }
  if (t->uncertainty[MOTION_LAMBDA] >= 1) t->uncertainty[MOTION_LAMBDA] = 0; /* as large as the multipliers: unknown */
}

/* ---- Candidates ---- */

/* Runs one; a tolerance or step that proves too small is increased.  PW_RETRY: interrupted. */
static int reference_run (pw_compare *x, candidate *c, pw_error *error) {
  pw_study *s = &x->study;
  double limit = s->cpu_end, loosest = c->row.adaptive ? REFERENCE_LOOSEST : s->t_end / REFERENCE_FEWEST;
  pw_error own = { 0 };
  int status = PW_RETRY;
  s->cpu_end = fmax (s->cpu_end, REFERENCE_LIMIT);
  while (status != PW_OK && c->row.level <= loosest) {
    own = (pw_error){ 0 };
    status = pw_compare_run (x, &c->row, &c->motion, &own);
    if (status == PW_OK || pw_stop || c->row.state == ROW_STOPPED || status == PW_RESOURCE || status == PW_INITIAL)
      break;
    c->row.level *= 10;
  }
  s->cpu_end = limit;
  c->good = status == PW_OK;
  return c->good ? PW_OK : pw_study_outcome (&c->row, status, &own, error);
}

/* The distance of two motions relative to the size of the motion. */
static double reference_distance (const pw_system *s, const candidate *a, const candidate *b) {
  double error[MOTION_ERRORS], most = 0;
  pw_reference t = { .motion = a->motion };
  reference_floor (s, &t);
  pw_motion_distance (s, &a->motion, &b->motion, error);
  for (int i = 0; i < MOTION_UNITS; i++) {
    double part = error[MOTION_MOST + i] / (t.size[i] > 0 ? t.size[i] : 1);
    if (!(part <= most)) most = part;
  }
  return most;
}

static void reference_name (const candidate *c, char *text, size_t size) {
  char level[32];
  snprintf (text, size, "%s, %s %s%s", c->row.method, c->row.adaptive ? "rtol" : "step",
            pw_format (level, c->row.level, 4), c->row.adaptive ? "" : " s");
}

/* Whether two methods share their integrator. */
static int reference_related (const candidate *a, const candidate *b) {
  size_t n = strcspn (a->row.method, "+");
  return strncmp (a->row.method, b->row.method, n + 1) == 0;
}

/* The two that agree best, and their distance; INFINITY if there are fewer than two. */
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

/* Two methods with the same integrator are used only if there are no others; the first of the two is the reference. */
static void reference_choose (pw_compare *x, candidate *c) {
  const pw_system *s = x->study.m.system;
  pw_reference *t = &x->reference;
  int best = -1, with = -1;
  if (isinf (reference_pair (s, c, 0, &best, &with)) && isinf (reference_pair (s, c, 1, &best, &with))) return;
  t->known = 1;
  reference_name (&c[best], t->about, sizeof t->about);
  pw_motion_distance (s, &c[best].motion, &c[with].motion, t->uncertainty);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) {
    int place = i == with ? 0 : t->partners + (t->partners == 0);
    if (i == best || !c[i].good) continue;
    reference_name (&c[i], t->partner[place].about, sizeof t->partner[place].about);
    pw_motion_distance (s, &c[best].motion, &c[i].motion, t->partner[place].error);
    t->partners = place + 1 > t->partners ? place + 1 : t->partners;
  }
  t->motion = c[best].motion;
  c[best].motion = (pw_motion){ .samples = 0 };
  reference_floor (s, t);
}

static int reference_compute (pw_compare *x, pw_error *error) {
  pw_study *s = &x->study;
  double step = fmin (x->finest_step, s->t_end / REFERENCE_STEPS);
  candidate c[REFERENCE_CANDIDATES] = {
    { .row = { .method = "erk8+projection", .adaptive = 1, .level = 3e-14 } },
    { .row = { .method = "rk4+projection", .adaptive = 0, .level = step } },
    { .row = { .method = "ida+ggl", .adaptive = 1, .level = 1e-13 } },
    { .row = { .method = "ida+baumgarte", .adaptive = 1, .level = 1e-13 } },
  };
  int status = PW_OK;
  pw_progress_count (&s->progress, "reference", "methods", 0, REFERENCE_CANDIDATES);
  for (s->done = 0; status == PW_OK && s->done < REFERENCE_CANDIDATES; s->done++) {
    status = pw_motion_open (&c[s->done].motion, s->m.system, MOTION_SAMPLES, error);
    if (status != PW_OK) break;
    pw_motion_times (&c[s->done].motion, s->t_end);
    status = reference_run (x, &c[s->done], error);
  }
  pw_progress_end (&s->progress);
  s->done = 0;
  if (status == PW_OK) reference_choose (x, c);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) pw_motion_close (&c[i].motion);
  return status;
}

/* The exact solution of the model holds only for its own initial conditions. */
int pw_reference_find (pw_compare *x, pw_error *error) {
  pw_study *s = &x->study;
  pw_reference *t = &x->reference;
  double t_end = s->line.t_end ? s->t_end : 0; /* 0: that of the table */
  int status, exact = s->reference_path == NULL && pw_system_has_reference (s->m.model) && s->line.starts == NULL;
  if (s->reference_path == NULL && !exact) return reference_compute (x, error);
  snprintf (t->about, sizeof t->about, "%s", exact ? "the exact solution of the model" : s->reference_path);
  if (exact)
    status = pw_motion_reference (&t->motion, s->m.model, s->m.system, s->t_end, error);
  else
    status = pw_motion_read (&t->motion, s->m.system, s->reference_path, &t_end, 1, error);
  if (status != PW_OK) return status;
  if (!exact) s->t_end = t_end;
  t->known = 1;
  reference_floor (s->m.system, t);
  return PW_OK;
}
