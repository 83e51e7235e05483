/* Runs one case by one method, measures the run, and decides on its verdict. */
#include <fnmatch.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "hard.h"
#include "pinwheel-selftest.h"

enum { RUN_SAMPLES = 50 }; /* at which the energy balance is measured */

typedef struct {
  pw_file *file;
  pw_model *model;
  pw_system *system;
  pw_scene_code *code; /* or NULL */
  pw_run *run;
} run_cell;

/* ---- Opening ---- */

/* Loads specialised code, if the scene can have any, and reopens the run with it. */
static void run_specialise (run_cell *x, const char *method, pw_settings *settings, pw_error *error) {
  pw_error own = { 0 }; /* why the scene cannot have code: then the general engine is measured */
  char *text = pw_run_source (x->run, &own);
  if (own.status == PW_RESOURCE) *error = own;
  if (text) x->code = pw_scene_code_open (text, x->system, error);
  free (text);
  if (x->code == NULL) return;
  settings->specialised = pw_scene_code_table (x->code);
  pw_run_close (x->run);
  x->run = pw_run_open (x->system, method, settings, error);
}

static int run_open (const hard_case *c, const char *method, int specialised, run_cell *x, pw_error *error) {
  pw_settings settings = { .span = c->t_end, .step = c->step, .rtol = c->rtol, .ledger = 1 };
  x->file = pw_file_open (c->model, error);
  x->model = x->file ? pw_file_model (x->file, error) : NULL;
  for (int i = 0; x->model && i < c->sets; i++) pw_model_set (x->model, c->set[i].name, c->set[i].value, error);
  if (x->model && error->status == PW_OK) pw_model_build (x->model, error);
  for (int i = 0; error->status == PW_OK && i < c->initials; i++)
    pw_model_set_initial (x->model, c->initial[i].name, c->initial[i].value, error);
  if (error->status == PW_OK) x->system = pw_system_compile (x->model, error);
  if (x->system) x->run = pw_run_open (x->system, method, &settings, error);
  if (x->run && specialised) run_specialise (x, method, &settings, error);
  return error->status;
}

static void run_close (run_cell *x) {
  if (x->run) pw_run_close (x->run);
  pw_scene_code_close (x->code);
  pw_system_free (x->system);
  pw_model_free (x->model);
  if (x->file) pw_file_close (x->file);
}

/* ---- Measuring ---- */

/* The larger value; NaN counts as infinite. */
static double run_worst (double a, double b) {
  return isnan (a) || isnan (b) ? INFINITY : fmax (a, b);
}

/* The scale of a state: length of the scene or 1 rad, divided by the time of the scene for a velocity. */
static double run_scale (const run_cell *x, const char *name) {
  const pw_scale *scale = pw_run_scale (x->run);
  int i = pw_system_find_state (x->system, name, NULL);
  const char *unit = pw_system_state_unit (x->system, i);
  return (strncmp (unit, "rad", 3) == 0 ? 1 : scale->length) /
         (i < pw_system_coordinates (x->system) ? 1 : scale->time);
}

static double run_error (const hard_case *c, const run_cell *x, const pw_sample *sample) {
  double worst = 0;
  int n = pw_system_coordinates (x->system);
  for (int i = 0; i < c->references; i++) {
    int state = pw_system_find_state (x->system, c->reference[i].name, NULL);
    if (state < 0) return INFINITY;
    double value = state < n ? sample->q[state] : sample->v[state - n];
    double size = fmax (fabs (c->reference[i].value), run_scale (x, c->reference[i].name));
    worst = run_worst (worst, fabs (value - c->reference[i].value) / size);
  }
  return worst;
}

static double run_equations (const run_cell *x, const pw_sample *sample) {
  pw_verification v;
  int status =
      pw_verify (x->system, pw_run_scale (x->run), sample->t, sample->q, sample->v, sample->a, sample->lambda, &v);
  if (status != PW_OK) return INFINITY;
  /* equations at the limits of their multipliers leave accelerations free */
  return pw_system_limited (x->system) > 0 ? v.force.scaled : run_worst (v.acceleration.scaled, v.force.scaled);
}

/* Runs to t_end, and measures at samples and at the end. */
static int run_through (const hard_case *c, const run_cell *x, hard_result *r, pw_error *error) {
  double balance = 0, energy = 0;
  pw_sample sample = { .t = 0 };
  for (int i = 1; i <= RUN_SAMPLES; i++) {
    double t = i == RUN_SAMPLES ? c->t_end : c->t_end * i / RUN_SAMPLES;
    if (pw_run_advance_to (x->run, t, c->t_end, error) != PW_OK || pw_run_sample (x->run, t, &sample, error) != PW_OK)
      return error->status;
    balance = run_worst (balance, fabs (sample.balance));
    energy = run_worst (energy, fmax (sample.kinetic, fmax (fabs (sample.work), sample.loss)));
  }
  const pw_statistics *s = pw_run_statistics (x->run);
  r->measure[HARD_ERROR] = run_error (c, x, &sample);
  r->measure[HARD_BALANCE] = balance == 0 ? 0 : balance / energy;
  r->measure[HARD_RESIDUAL] = run_worst (s->position, s->velocity);
  r->measure[HARD_EQUATIONS] = run_equations (x, &sample);
  return PW_OK;
}

void hard_run (const hard_case *c, const char *method, int specialised, hard_result *r) {
  pw_error error = { 0 };
  run_cell x = { .file = NULL };
  *r = (hard_result){ .t = 0 };
  for (int k = 0; k < HARD_MEASURES; k++) r->measure[k] = NAN;
  r->status = run_open (c, method, specialised, &x, &error);
  if (r->status == PW_OK) r->status = run_through (c, &x, r, &error);
  if (x.run) r->t = pw_run_time (x.run);
  r->cpu = (double)clock () / CLOCKS_PER_SEC;
  memcpy (r->reason, error.text, sizeof r->reason);
  run_close (&x);
}

/* ---- Verdict ---- */

/* 1 if the method, or the program before the run, has rejected the case: not when memory is short. */
static int run_refused (int status) {
  return status == PW_INPUT || status == PW_INITIAL || status == PW_METHOD;
}

hard_verdict hard_verdict_of (const hard_case *c, const hard_result *r) {
  hard_verdict worst = HARD_PASS;
  if (*c->stops && r->status != PW_OK && strstr (r->reason, c->stops))
    return r->t <= c->stop_time[0] ? HARD_PASS : r->t <= c->stop_time[1] ? HARD_LIMITED : HARD_WRONG;
  if (*c->stops && r->status == PW_OK) return HARD_WRONG;
  if (r->status != PW_OK) return *r->reason && run_refused (r->status) ? HARD_REFUSE : HARD_WRONG;
  if (r->t < c->t_end) return HARD_WRONG;
  for (int k = 0; k < HARD_MEASURES; k++) {
    const double *bound = c->bound[k], value = r->measure[k];
    if (bound[1] == 0 && bound[0] == 0) continue;
    hard_verdict now = value <= bound[0] ? HARD_PASS : value <= bound[1] ? HARD_LIMITED : HARD_WRONG;
    if (now < worst) worst = now;
  }
  return worst;
}

/* 1 if a name matches one of the patterns, which are separated by blanks. */
static int run_matches (const char *patterns, const char *name) {
  char pattern[sizeof ((hard_expectation *)0)->pattern];
  for (; *patterns; patterns += strspn (patterns, " ")) {
    size_t n = strcspn (patterns, " ");
    snprintf (pattern, sizeof pattern, "%.*s", (int)n, patterns);
    if (fnmatch (pattern, name, 0) == 0) return 1;
    patterns += n;
  }
  return 0;
}

const hard_expectation *hard_expected (const hard_case *c, const char *method) {
  for (int i = c->expectations - 1; i >= 0; i--)
    if (run_matches (c->expect[i].pattern, method)) return &c->expect[i];
  fprintf (stderr, "%s: no expectation for %s\n", c->name, method);
  exit (2);
}

int hard_as_expected (const hard_expectation *e, const hard_result *r) {
  if (!(e->verdict >> r->verdict & 1)) return 0;
  return r->verdict != HARD_REFUSE || strstr (r->reason, e->reason) != NULL;
}
