/* Derivatives of runs by the variational equations: closed forms; every model of the gallery against differences of
 * runs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "pinwheel-analysis.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"
#include "variation_parts.h"

/* A model with one parameter changed: a run, its neighbours, the direction. */
typedef struct {
  pw_system *s, *near[4];
  pw_run *r;
  pw_direction d;
} variation_case;

typedef pw_system *variation_make (const void *context, double value);

static variation_case variation_open (variation_make *make, const void *context, double value, double step,
                                      const char *method, const pw_settings *settings) {
  static const int offset[2][4] = { { -2, -1, 1, 2 }, { 0, 1, 2, 4 } };
  variation_case c = { .s = make (context, value), .d = { .step = step, .one_sided = value == 0 } };
  c.r = runs_open (c.s, method, settings);
  for (int i = 0; i < 4; i++) {
    c.near[i] = make (context, value + offset[c.d.one_sided][i] * step);
    c.d.neighbour[i] = runs_open (c.near[i], method, settings);
  }
  return c;
}

static void variation_free (variation_case *c) {
  for (int i = 0; i < 4; i++) {
    pw_run_close (c->d.neighbour[i]);
    pw_system_free (c->near[i]);
  }
  pw_run_close (c->r);
  pw_system_free (c->s);
}

/* ---- Closed forms ---- */

typedef struct {
  const char *name; /* of the parameter that is changed */
  double k, c, m, x0, height, start, width;
} block;

static void block_build (pw_model *m, const void *parameters) {
  const block *b = parameters;
  pw_add_body (m, &(pw_body){ .name = "block", .mass = b->m, .inertia = 1, .start = { 1 + b->x0 } });
  if (b->k > 0)
    pw_add_spring (
        m, &(pw_spring){ .name = "S", .body = { "ground", "block" }, .stiffness = b->k, .damping = b->c, .length = 1 });
  pw_signal pulse = { .type = PW_PULSE, .pulse = { .height = b->height, .start = b->start, .width = b->width } };
  pw_add_force (m, &(pw_force){ .name = "F", .body = "block", .fx = pulse });
}

static pw_system *block_make (const void *context, double value) {
  static const pw_parameter parameters[] = {
    { PW_AT (block, k), 0, "", "", 0 },      { PW_AT (block, c), 0, "", "", 0 },
    { PW_AT (block, m), 1, "", "", 0 },      { PW_AT (block, x0), 0.1, "", "", 0 },
    { PW_AT (block, height), 0, "", "", 0 }, { PW_AT (block, start), 1, "", "", 0 },
    { PW_AT (block, width), 1, "", "", 0 },  { 0 }
  };
  static const pw_plugin_table table = SCENE_TABLE_WITH (block_build, parameters, sizeof (block));
  const block *b = context;
  return scene_system (&table, "k", b->k, "c", b->c, "m", b->m, "x0", b->x0, "height", b->height, "start", b->start,
                       "width", b->width, b->name, value, NULL);
}

static double block_value (const block *b, const char *name) {
  return strcmp (name, "k") == 0       ? b->k
         : strcmp (name, "c") == 0     ? b->c
         : strcmp (name, "m") == 0     ? b->m
         : strcmp (name, "x0") == 0    ? b->x0
         : strcmp (name, "start") == 0 ? b->start
                                       : b->width;
}

/* The derivatives of x, vx and the work of the force at time t. */
static void block_derive (block b, const char *name, const char *method, double t, double out[3]) {
  double value = block_value (&b, name);
  pw_sample x, e;
  pw_error error = { 0 };
  b.name = name;
  variation_case c = variation_open (block_make, &b, value, 1e-5 * value, method,
                                     &(pw_settings){ .span = t, .rtol = 1e-10, .step = 1e-3 });
  pw_variation *v = pw_variation_open (c.r, &c.d, 1, 1, &error);
  check_ok (error.status, &error);
  check_ok (pw_variation_advance (v, t, t, &error), &error);
  check_ok (pw_variation_sample (v, 0, &x, &e, &error), &error);
  out[0] = x.q[0];
  out[1] = x.v[0];
  out[2] = x.work;
  int order2 = strcmp (method, "galpha") == 0 || strcmp (method, "leapfrog") == 0;
  check_below ("error", fmax (fabs (e.q[0]), fabs (e.v[0])), (order2 ? 1e-3 : 1e-6) * (1 + fabs (x.q[0])),
               "steps to 1e-9 each, and what the steps of the run do not resolve");
  pw_variation_close (v);
  variation_free (&c);
}

/* x = x0 cos (w t), w^2 = k / m; by methods of every family. */
TEST (oscillator) {
  static const char *const methods[] = {
    "rk4", "erk5", "erk8", "adams", "bdf", "radau", "ida+ggl", "galpha", "leapfrog"
  };
  const double t = 3, w = 2;
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    block b = { .k = 8, .m = 2, .x0 = 0.3, .start = 99, .width = 1 };
    double d[3], bound = strcmp (methods[i], "galpha") && strcmp (methods[i], "leapfrog") ? 2e-8 : 1e-5;
    const char *why = "the run's tolerance, or h^2 t w";
    block_derive (b, "k", methods[i], t, d);
    check_close ("dx/dk", d[0], -0.3 * t * sin (w * t) / (2 * sqrt (16.)), bound, why);
    check_close ("dv/dk", d[1], -0.3 * (sin (w * t) + w * t * cos (w * t)) / (2 * sqrt (16.)), 2 * bound, why);
    block_derive (b, "m", methods[i], t, d);
    check_close ("dx/dm", d[0], 0.3 * t * sin (w * t) * w / 4, bound, why);
    block_derive (b, "x0", methods[i], t, d);
    check_close ("dx/dx0", d[0], cos (w * t), bound, why);
  }
}

static int stopped_every (void *context) {
  int *calls = context;
  return ++*calls % 37 == 0;
}

/* Derivatives of a run that is stopped again and again; steps of stiff motions are implicit. */
TEST (stopped) {
  for (int stiff = 0; stiff < 2; stiff++) {
    double end[2];
    for (int stops = 0; stops < 2; stops++) {
      pw_error error = { 0 };
      pw_sample x;
      int calls = 0, status;
      block b = { .name = "k", .k = stiff ? 4e4 : 8, .c = stiff ? 4e4 : 0, .m = 2, .x0 = 0.3, .start = 99, .width = 1 };
      pw_settings set = { .rtol = 1e-8, .stop = stops ? stopped_every : NULL, .stop_context = &calls };
      variation_case c = variation_open (block_make, &b, b.k, 1e-5 * b.k, "radau", &set);
      pw_variation *v = pw_variation_open (c.r, &c.d, 1, 0, &error);
      while ((status = pw_variation_advance (v, 1, 1, &error)) == PW_STOPPED && calls < 1e6) {}
      check_ok (status, &error);
      check_ok (pw_variation_sample (v, 0, &x, NULL, &error), &error);
      end[stops] = x.q[0];
      pw_variation_close (v);
      variation_free (&c);
    }
    check_close ("dx/dk", end[1], end[0], 0, "stops change nothing");
  }
}

/* Overdamped: x = x0 (r2 exp (-r1 t) - r1 exp (-r2 t)) / (r2 - r1), r1 r2 = k / m, r1 + r2 = c / m; and the loss. */
static void stiff_closed (double k, double c, double t, double out[3]) {
  double m = 2, x0 = 0.3, r1 = c / (2 * m) + sqrt (c * c / (4 * m * m) - k / m), r2 = k / m / r1;
  double fast = exp (-r1 * t), slow = exp (-r2 * t);
  out[0] = x0 * (r2 * fast - r1 * slow) / (r2 - r1);
  out[1] = x0 * r1 * r2 * (slow - fast) / (r2 - r1);
  out[2] = k / 2 * (x0 * x0 - out[0] * out[0]) - m / 2 * out[1] * out[1];
}

/* A rate of 2e4/s beside one of 1/s, by adaptive methods and by rk4: the derivatives
 * are as accurate as those of slow motions, and their steps are much longer than an explicit method could make. */
TEST (stiff) {
  static const char *const methods[] = { "radau", "bdf", "ida+ggl", "rk4" };
  const double t = 1, k = 4e4, c = 4e4;
  for (int i = 0; i < 8; i++) {
    const char *method = methods[i / 2];
    double value = i % 2 ? c : k, step = 1e-4 * value, plus[3], minus[3];
    block b = { .name = i % 2 ? "c" : "k", .k = k, .c = c, .m = 2, .x0 = 0.3, .start = 99, .width = 1 };
    variation_case v = variation_open (block_make, &b, value, 1e-5 * value, method,
                                       &(pw_settings){ .span = t, .rtol = 1e-10, .step = 1e-5 });
    pw_error error = { 0 };
    pw_sample x, e;
    pw_variation *d = pw_variation_open (v.r, &v.d, 1, 1, &error);
    check_ok (error.status, &error);
    check_ok (pw_variation_advance (d, t, t, &error), &error);
    check_ok (pw_variation_sample (d, 0, &x, &e, &error), &error);
    stiff_closed (i % 2 ? k : k + step, i % 2 ? c + step : c, t, plus);
    stiff_closed (i % 2 ? k : k - step, i % 2 ? c - step : c, t, minus);
    const double got[3] = { x.q[0], x.v[0], x.loss }, claimed[3] = { e.q[0], e.v[0], e.loss };
    const double scale[3] = { 0.3 / value, 0.3 / value, 0.09 / 2 * k / value };
    for (int j = 0; j < 3; j++) {
      double expected = (plus[j] - minus[j]) / (2 * step);
      check_close (method, got[j], expected, 1e-7 * scale[j], "differences of 1e-4, steps to 1e-9");
      check_close ("within its error", got[j], expected, fabs (claimed[j]) + 1e-8 * scale[j], "the claim");
    }
    assert_true (pw_variation_step_size (d) > 20 * 3.3 * 2 / c);
    pw_variation_close (d);
    variation_free (&v);
  }
}

/* A run that does not resolve the motion: its error is part of the derivative's, whose next step begins with the time
 * derivative of both. */
TEST (unresolved) {
  const block b = { .name = "k", .k = 8, .c = 1, .m = 2, .x0 = 0.3, .start = 99, .width = 1 };
  variation_case v = variation_open (block_make, &b, 8, 8e-5, "rk4", &(pw_settings){ .span = 3, .step = 0.3 });
  pw_error error = { 0 };
  pw_variation *x = pw_variation_open (v.r, &v.d, 1, 1, &error);
  check_ok (error.status, &error);
  for (int i = 1; i <= 10; i++) {
    check_ok (pw_variation_advance (x, 0.3 * i, 3, &error), &error);
    const pw_variation_column *c = &x->direction->column[1];
    const double *first = c->K[0], *again = c->K[PW_VARIATION_RATES - 1];
    PW_EACH_COLUMN (each, x) memcpy (each->trial, each->Y, (size_t)x->size * sizeof *each->Y);
    check_ok (pw_variation_evaluate_at (x, x->t, &error), &error);
    check_ok (pw_variation_all_time_derivatives (x, PW_VARIATION_RATES - 1, &error), &error);
    for (int j = 0; j < 2 * x->n; j++)
      check_close ("rate", first[j], again[j], 1e-12 * (1e-3 + fabs (again[j])), "the same evaluation");
  }
  pw_variation_close (x);
  variation_free (&v);
}

/* Differences with a step that changes nothing, or little: their errors contain the result, and a few better steps
 * lead to an accurate one. */
TEST (steps) {
  const double t = 3, steps[] = { 1e-19, 1e-15 };
  for (int i = 0; i < 2; i++) {
    block b = { .name = "x0", .k = 8, .m = 2, .x0 = 1e-12, .start = 99, .width = 1 };
    double step, next = steps[i], got;
    pw_sample x, e;
    int count = 0;
    do {
      pw_error error = { 0 };
      step = next;
      variation_case c =
          variation_open (block_make, &b, b.x0, step, "erk8", &(pw_settings){ .span = t, .rtol = 1e-11 });
      pw_variation *v = pw_variation_open (c.r, &c.d, 1, 0, &error);
      check_ok (error.status, &error);
      check_ok (pw_variation_advance (v, t, t, &error), &error);
      check_ok (pw_variation_sample (v, 0, &x, &e, &error), &error);
      got = x.q[0];
      if (got != 0) check_close ("within its error", got, cos (2 * t), fabs (e.q[0]), "the claim");
      next = pw_variation_better_step (v, 0);
      pw_variation_close (v);
      variation_free (&c);
    } while (next != step && ++count < 8);
    assert_true (count > 0 && count < 8);
    check_close ("dx/dx0", got, cos (2 * t), 1e-7, "differences accurate to 1e-7");
  }
}

/* A free block pushed from `start` on for `width`: afterwards v = F width / m, x = v (t - start - width / 2). */
TEST (breakpoints) {
  block b = { .m = 2, .height = 3, .start = 0.5, .width = 0.7 };
  double d[3];
  for (int i = 0; i < 3; i++) {
    const char *method = (const char *[]){ "rk4", "erk8", "bdf" }[i];
    block_derive (b, "start", method, 2, d);
    check_close ("dx/dstart", d[0], -3 * 0.7 / 2, 1e-9, "round-off of differences");
    check_close ("dv/dstart", d[1], 0, 1e-9, "round-off of differences");
    check_close ("dW/dstart", d[2], 0, 1e-8, "round-off of differences");
    block_derive (b, "width", method, 2, d);
    check_close ("dx/dwidth", d[0], 1.5 * (2 - 0.5 - 0.7), 1e-9, "round-off of differences");
    check_close ("dv/dwidth", d[1], 1.5, 1e-9, "round-off of differences");
    check_close ("dW/dwidth", d[2], 2 * 1.5 * 0.7 * 1.5, 1e-8, "round-off of differences, W = m v^2 / 2");
  }
}

/* ---- The gallery ---- */

typedef struct {
  const char *model, *parameter;
} gallery_name;

static pw_system *gallery_make (const void *context, double value) {
  const gallery_name *g = context;
  return scene_named (g->model, g->parameter, value);
}

/* The state after a run with the parameter changed: 2 coordinates numbers. */
static void gallery_run_to (const gallery_name *g, double value, const pw_settings *settings, const char *method,
                            double t, double *out) {
  pw_system *s = gallery_make (g, value);
  runs_state (s, method, settings, t, out, out + pw_system_coordinates (s), NULL);
  pw_system_free (s);
}

/* Derivatives by differences of runs, extrapolated, and the largest error of these. */
static double gallery_difference (const gallery_name *g, double value, double step, const pw_settings *settings,
                                  const char *method, double t, int states, double *out) {
  double *x = calloc (4 * (size_t)states, sizeof *x), worst = 0;
  static const int offset[2][4] = { { -2, -1, 1, 2 }, { 0, 1, 2, 4 } };
  int side = value == 0;
  for (int i = 0; i < 4; i++)
    gallery_run_to (g, value + offset[side][i] * step, settings, method, t, x + (size_t)i * (size_t)states);
  for (int j = 0; j < states; j++) {
    const double *a = x + j, *b = a + states, *c = b + states, *d = c + states;
    double one = side ? (-1.5 * *a + 2 * *b - 0.5 * *c) / step : (*c - *b) / (2 * step);
    double two = side ? (-0.75 * *a + *c - 0.25 * *d) / step : (*d - *a) / (4 * step);
    out[j] = (4 * one - two) / 3;
    worst = fmax (worst, fabs (one - two));
  }
  free (x);
  return worst;
}

static void gallery_check (const gallery_name *g, double value, const pw_settings *settings, const char *method,
                           double t) {
  double step = 1e-5 * (value != 0 ? fabs (value) : 1), most = 0;
  pw_error error = { 0 };
  pw_sample x;
  variation_case c = variation_open (gallery_make, g, value, step, method, settings);
  int n = pw_system_coordinates (c.s);
  double *by_runs = calloc (2 * (size_t)n, sizeof *by_runs);
  double off = gallery_difference (g, value, 30 * step, settings, method, t, 2 * n, by_runs);
  pw_variation *v = pw_variation_open (c.r, &c.d, 1, 0, &error);
  if (v) check_ok (pw_variation_advance (v, t, t, &error), &error);
  check_ok (error.status, &error);
  check_ok (pw_variation_sample (v, 0, &x, NULL, &error), &error);
  for (int j = 0; j < 2 * n; j++) most = fmax (most, fabs (by_runs[j]));
  for (int j = 0; j < 2 * n; j++) {
    check_close (check_text ("%s, state %d by %s", g->model, j, g->parameter), j < n ? x.q[j] : x.v[j - n], by_runs[j],
                 10 * off + 1e-6 * most + 1e-8 / (1e5 * step),
                 "error of the differences, and of a run with steps of 1 ms");
  }
  pw_variation_close (v);
  variation_free (&c);
  free (by_runs);
}

/* The derivatives of the state by a parameter. */
static void gallery_derive (const gallery_name *g, double value, const char *method, const pw_settings *settings,
                            double t, double *out) {
  pw_error error = { 0 };
  pw_sample x;
  variation_case c = variation_open (gallery_make, g, value, 1e-5 * value, method, settings);
  size_t bytes = (size_t)pw_system_coordinates (c.s) * sizeof (double);
  pw_variation *v = pw_variation_open (c.r, &c.d, 1, 0, &error);
  check_ok (error.status, &error);
  check_ok (pw_variation_advance (v, t, t, &error), &error);
  check_ok (pw_variation_sample (v, 0, &x, NULL, &error), &error);
  memcpy (out, x.q, bytes);
  memcpy (out + pw_system_coordinates (c.s), x.v, bytes);
  pw_variation_close (v);
  variation_free (&c);
}

/* x^2 + y^2 = l^2 and its time derivative, differentiated by l; the steps alone leave the constraints. */
TEST (tangent) {
  const gallery_name g = { "pendulum", "l" };
  pw_settings settings = { .step = 1e-3, .span = 20 };
  double d[6], q[3], v[3];
  gallery_derive (&g, 1, "rk4+projection", &settings, 20, d);
  pw_system *s = gallery_make (&g, 1);
  runs_state (s, "rk4+projection", &settings, 20, q, v, NULL);
  pw_system_free (s);
  check_close ("position", q[0] * d[0] + q[1] * d[1], 1, 2e-10, "differences of 1e-5, round-off of 1e-16 by that");
  check_close ("velocity", v[0] * d[0] + q[0] * d[3] + v[1] * d[1] + q[1] * d[4], 0, 2e-9, "the same, at 10 m/s");
}

/* Without an error the result is the same, at steps of 1 % of the frequency, where the extrapolation matters. */
TEST (no_error) {
  const gallery_name g = { "ezyroller", "omega" };
  double value[2];
  for (int no_error = 0; no_error < 2; no_error++) {
    pw_sample x, e;
    pw_error error = { 0 };
    variation_case c =
        variation_open (gallery_make, &g, PW_PI, 1e-2 * PW_PI, "rk4", &(pw_settings){ .span = 2, .step = 1e-3 });
    c.d.no_error = no_error;
    pw_variation *v = pw_variation_open (c.r, &c.d, 1, 1, &error);
    check_ok (error.status, &error);
    check_ok (pw_variation_advance (v, 2, 2, &error), &error);
    check_ok (pw_variation_sample (v, 0, &x, &e, &error), &error);
    value[no_error] = x.q[0];
    assert_true (no_error ? e.q[0] == 0 : fabs (e.q[0]) > 1e-6);
    pw_variation_close (v);
    variation_free (&c);
  }
  check_close ("dx/domega", value[1], value[0], 1e-8, "linear equations, of which the steps differ");
}

/* Few steps of a method of high order: the states inside them are found to its tolerance. */
TEST (few_steps) {
  const gallery_name g = { "chaplygin-sleigh", "a" };
  double few[6], many[6];
  gallery_derive (&g, 0.25, "erk8", &(pw_settings){ .rtol = 1e-5, .span = 20 }, 20, few);
  gallery_derive (&g, 0.25, "erk8", &(pw_settings){ .rtol = 1e-10, .span = 20 }, 20, many);
  check_close ("dphi/da", few[2], many[2], 1e-6 * fabs (many[2]), "a tenth of the tolerance");
}

/* Methods of every family agree on a vehicle. */
TEST (methods) {
  static const char *const methods[] = { "rk4+nullspace", "rk4+baumgarte",  "erk5+projection", "erk8+projection",
                                         "adams",         "bdf+projection", "ida+ggl",         "radau+ggl",
                                         "galpha+ggl",    "leapfrog+rattle" };
  double expected[24], x[24];
  const gallery_name g = { "snakeboard", "steer" };
  pw_settings settings = { .step = 5e-4, .rtol = 1e-9, .span = 2 };
  gallery_derive (&g, 0.4, "rk4+projection", &settings, 2, expected);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    gallery_derive (&g, 0.4, methods[i], &settings, 2, x);
    for (int j = 0; j < 24; j++)
      check_close (methods[i], x[j], expected[j], i < 8 ? 2e-6 : 2e-5, "1000 rtol, or (2 h w)^2 with w = 4 / s");
  }
}

/* Not differentiable there. */
static int gallery_excepted (const char *model, const char *parameter) {
  static const gallery_name excepted[] = {
    { "slider-crank", "g" }, /* without it there is no gravity element: another number of elements */
  };
  for (size_t i = 0; i < sizeof excepted / sizeof *excepted; i++)
    if (strcmp (excepted[i].model, model) == 0 && strcmp (excepted[i].parameter, parameter) == 0) return 1;
  return 0;
}

static int gallery_model (void *context, const char *name, const char *path) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (path, &error);
  check_ok (error.status, &error);
  const pw_plugin_table *table = pw_file_table (f);
  pw_run_defaults d = table->run;
  double t =
      fmin (0.1 * (d.t_end > 0 ? d.t_end : 10), strcmp (name, "n-four-bar") == 0 ? 0.5 : 1); /* singular at 0.71 s */
  pw_settings settings = { .step = d.step, .span = t };
  int *count = context;
  for (const pw_parameter *p = table->parameters; p && p->name; p++) {
    if (p->domain == PW_COUNT || gallery_excepted (name, p->name)) continue;
    gallery_check (&(gallery_name){ name, p->name }, p->value, &settings, d.method, t);
    *count += 1;
  }
  pw_file_close (f);
  return 0;
}

TEST (gallery) {
  pw_error error = { 0 };
  int count = 0;
  check_ok (pw_file_list (gallery_model, &count, &error), &error);
  assert_true (count > 100);
}

/* ---- Refusals, the run itself ---- */

TEST (refusals) {
  pw_error error = { 0 };
  block b = { .name = "k", .k = 8, .m = 2, .x0 = 0.3, .start = 99, .width = 1 };
  variation_case c = variation_open (block_make, &b, 8, 1e-4, "rk4:inputs=held", NULL);
  assert_null (pw_variation_open (c.r, &c.d, 1, 0, &error));
  check_error (&error, PW_INPUT, "derivatives need inputs=stage: held inputs depend on the steps");
  variation_free (&c);
  c = variation_open (block_make, &b, 8, 1e-4, "rk4", NULL);
  error = (pw_error){ 0 };
  pw_variation *x = pw_variation_open (c.r, &c.d, 1, 0, &error);
  assert_int_equal (pw_variation_advance (x, NAN, 0.1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "t = nan: expected a time");
  for (int i = -1; i < 2; i += 2) {
    pw_sample sample;
    error = (pw_error){ 0 };
    assert_int_equal (pw_variation_sample (x, i, &sample, NULL, &error), PW_INPUT);
    assert_non_null (strstr (error.text, ": expected 0 to 0"));
  }
  pw_variation_close (x);
  assert_int_equal (pw_run_advance_to (c.r, 0.5, 0.5, NULL), PW_OK);
  error = (pw_error){ 0 };
  assert_null (pw_variation_open (c.r, &c.d, 1, 0, &error));
  check_error (&error, PW_INPUT, "direction 1: neighbours need a run that has not advanced; it is at t = 0.5 s");
  variation_free (&c);
}

/* The run makes the same steps with derivatives and without. */
TEST (run) {
  static const char *const methods[] = { "rk4+projection", "erk8+projection", "bdf+projection", "ida", "radau" };
  pw_error error = { 0 };
  double q[12], v[12];
  gallery_name g = { "ezyroller", "a" };
  for (int i = 0; i < 5; i++) {
    pw_settings settings = { .span = 2, .step = 1e-3 };
    variation_case c = variation_open (gallery_make, &g, 0.5, 1e-5, methods[i], &settings);
    pw_variation *x = pw_variation_open (c.r, &c.d, 1, 1, &error);
    check_ok (error.status, &error);
    check_ok (pw_variation_advance (x, 2, 2, &error), &error);
    pw_sample s = runs_to (c.r, 2);
    runs_state (c.s, methods[i], &settings, 2, q, v, NULL);
    check_bits (methods[i], s.q, q, 6);
    check_bits (methods[i], s.v, v, 6);
    pw_variation_close (x);
    variation_free (&c);
  }
}
