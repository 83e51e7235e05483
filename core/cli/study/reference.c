/* The truth: a table's, the model's own, or where there is neither that of methods that have little in common, each at its
 * tightest.  Two of them that agree best are the truth, as far as they agree. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "compare.h"
#include "stop.h"

enum { TRUTH_CANDIDATES = COMPARE_PARTNERS + 1 };
#define TRUTH_LIMIT 10     /* processor time a candidate may take, at least [s] */
#define TRUTH_LOOSEST 1e-9 /* tolerances are loosened up to here if a method fails, */
#define TRUTH_FEWEST 1000  /* fixed steps up to the end over this, */
#define TRUTH_STEPS 1e5    /* from the end over this, or the ladder's last one */
#define TRUTH_ROUND_OFF 8  /* eps of the largest number: nothing is known better */

typedef struct {
  pw_contestant method;
  double rung;
  int good;
  pw_motion motion;
} truth_candidate;

/* ---- What is known about a motion ---- */

/* Where columns are compared, agreement to the bit is no better than round-off. */
static void truth_floor (const pw_compare *x, pw_truth *t) {
  int n = pw_count_coordinates (x->m.system), loads = 0;
  for (int k = 0; k < t->motion.samples; k++)
    for (int j = 0; j < t->motion.width; j++) {
      double value = fabs (t->motion.x[k * t->motion.width + j]);
      if (isnan (value)) continue;
      loads |= j >= 2 * n;
      if (j < 2 * n) t->size[pw_motion_unit (x->m.system, j)] = fmax (t->size[pw_motion_unit (x->m.system, j)], value);
    }
  for (int i = 0; i < MOTION_ERRORS; i++) {
    double size = i < MOTION_LAMBDA ? t->size[i % MOTION_UNITS] : loads;
    if (i < MOTION_MOST) t->uncertainty[i] = t->uncertainty[i + MOTION_MOST]; /* at the end it may be luck */
    t->uncertainty[i] = fmax (t->uncertainty[i], TRUTH_ROUND_OFF * DBL_EPSILON * size);
  }
  if (t->uncertainty[MOTION_LAMBDA] >= 1) t->uncertainty[MOTION_LAMBDA] = 0; /* as large as they are: not known */
}

/* ---- Candidates ---- */

/* Runs one; a tolerance or step that proves too small is made larger.  PW_RETRY: it has none to offer. */
static int truth_run (pw_compare *x, truth_candidate *c, pw_error *error) {
  double limit = x->limit;
  int status = PW_RETRY;
  x->limit = fmax (x->limit, TRUTH_LIMIT);
  double loosest = c->method.adaptive ? TRUTH_LOOSEST : x->t_end / TRUTH_FEWEST;
  for (; status != PW_OK && c->rung <= loosest; c->rung *= 10) {
    pw_rung r = { .method = &c->method, .rung = c->rung };
    pw_error own = { 0 };
    status = pw_compare_run (x, &r, &c->motion, &own);
    if (status == PW_OK || pw_stop || r.state == COMPARE_STOPPED) break;
    if (status == PW_MACHINE || status == PW_START) {
      *error = own;
      break;
    }
  }
  x->limit = limit;
  c->good = status == PW_OK;
  return status == PW_MACHINE || status == PW_START ? status : pw_stop ? PW_RETRY : PW_OK;
}

/* How far two are apart, as a part of how large the motion is. */
static double truth_apart (const pw_compare *x, const truth_candidate *a, const truth_candidate *b) {
  double error[MOTION_ERRORS], most = 0;
  pw_truth t = { .motion = a->motion };
  truth_floor (x, &t);
  pw_motion_distance (x->m.system, &a->motion, &b->motion, error);
  for (int i = 0; i < MOTION_UNITS; i++) {
    double part = error[MOTION_MOST + i] / (t.size[i] > 0 ? t.size[i] : 1);
    if (!(part <= most)) most = part;
  }
  return most;
}

static void truth_name (const truth_candidate *c, char *text, size_t size) {
  char rung[32];
  snprintf (text, size, "%s, %s %s%s", c->method.name, c->method.adaptive ? "rtol" : "step",
            pw_format (rung, c->rung, 4), c->method.adaptive ? "" : " s");
}

/* Whether two methods share their integrator. */
static int truth_related (const truth_candidate *a, const truth_candidate *b) {
  size_t n = strcspn (a->method.name, "+");
  return strncmp (a->method.name, b->method.name, n + 1) == 0;
}

/* The two that agree best, and how well; INFINITY if there are no two. */
static double truth_pair (const pw_compare *x, const truth_candidate *c, int related, int *best, int *with) {
  double least = INFINITY;
  for (int i = 0; i < TRUTH_CANDIDATES; i++)
    for (int j = i + 1; j < TRUTH_CANDIDATES; j++) {
      if (!c[i].good || !c[j].good || truth_related (&c[i], &c[j]) != related) continue;
      double apart = truth_apart (x, &c[i], &c[j]);
      if (apart < least) least = apart, *best = i, *with = j;
    }
  return least;
}

/* Two of one integrator are taken if there are no others; the first of the two is the truth. */
static void truth_choose (pw_compare *x, truth_candidate *c) {
  pw_truth *t = &x->truth;
  int best = -1, with = -1;
  if (isinf (truth_pair (x, c, 0, &best, &with)) && isinf (truth_pair (x, c, 1, &best, &with))) return;
  t->known = 1;
  truth_name (&c[best], t->about, sizeof t->about);
  pw_motion_distance (x->m.system, &c[best].motion, &c[with].motion, t->uncertainty);
  for (int i = 0; i < TRUTH_CANDIDATES; i++) {
    int place = i == with ? 0 : t->partners + (t->partners == 0);
    if (i == best || !c[i].good) continue;
    truth_name (&c[i], t->partner[place].about, sizeof t->partner[place].about);
    pw_motion_distance (x->m.system, &c[best].motion, &c[i].motion, t->partner[place].error);
    t->partners = place + 1 > t->partners ? place + 1 : t->partners;
  }
  t->motion = c[best].motion;
  c[best].motion = (pw_motion){ .samples = 0 };
  truth_floor (x, t);
}

static int truth_make (pw_compare *x, pw_error *error) {
  double step = fmin (x->ladder[0].to, x->t_end / TRUTH_STEPS);
  truth_candidate c[TRUTH_CANDIDATES] = { { .method = { "erk8+projection", 1 }, .rung = 3e-14 },
                                          { .method = { "rk4+projection", 0 }, .rung = step },
                                          { .method = { "ida+ggl", 1 }, .rung = 1e-13 },
                                          { .method = { "ida+baumgarte", 1 }, .rung = 1e-13 } };
  int status = PW_OK;
  pw_progress_count (&x->progress, "reference", "methods", 0, TRUTH_CANDIDATES);
  for (int i = 0; status == PW_OK && i < TRUTH_CANDIDATES; i++, x->rows++) {
    status = pw_motion_open (&c[i].motion, x->m.system, MOTION_SAMPLES, error);
    if (status == PW_OK) {
      pw_motion_times (&c[i].motion, x->t_end);
      status = truth_run (x, &c[i], error);
    }
  }
  pw_progress_end (&x->progress);
  x->rows = 0;
  if (status == PW_OK) truth_choose (x, c);
  for (int i = 0; i < TRUTH_CANDIDATES; i++) pw_motion_close (&c[i].motion);
  return status;
}

/* A table's end is that of the comparison, if there is no other. */
static int truth_table (pw_compare *x, pw_error *error) {
  double t_end = x->line.t_end ? x->t_end : 0;
  int status = pw_motion_read (&x->truth.motion, x->m.system, x->truth_path, &t_end, 1, error);
  if (status == PW_OK) x->t_end = t_end;
  snprintf (x->truth.about, sizeof x->truth.about, "%s", x->truth_path);
  return status;
}

/* What the model knows holds for the start it describes. */
static int truth_of_model (pw_compare *x, pw_error *error) {
  snprintf (x->truth.about, sizeof x->truth.about, "the model's own truth");
  return pw_motion_truth (&x->truth.motion, x->m.model, x->m.system, x->t_end, error);
}

int pw_truth_find (pw_compare *x, pw_error *error) {
  int own = x->truth_path == NULL && pw_has_truth (x->m.model) && x->line.starts == NULL;
  if (x->truth_path == NULL && !own) return truth_make (x, error);
  int status = own ? truth_of_model (x, error) : truth_table (x, error);
  if (status != PW_OK) return status;
  x->truth.known = 1;
  truth_floor (x, &x->truth);
  return PW_OK;
}

void pw_truth_close (pw_truth *t) {
  pw_motion_close (&t->motion);
}
