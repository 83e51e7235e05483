/* Specialised code against the general engine: single evaluations and projections, and what it leaves to that
 * engine. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "method.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"
#include "specialised.h"

#define ROUND_OFF 1e-11
#define WHY "round-off of a factorisation in another order, angles between rows above 0.02"

/* A system with a run of the general engine and one with specialised code. */
typedef struct {
  pw_system *s;
  pw_scene_code *code;
  pw_run *general, *special;
} both;

static void both_open (both *x, pw_system *s, const char *method, const pw_settings *settings) {
  pw_error error = { 0 };
  pw_settings set = settings ? *settings : (pw_settings){ .step = 1e-4, .span = 1 };
  *x = (both){ .s = s, .general = runs_open (s, method, &set) };
  char *text = pw_run_source (x->general, &error);
  check_ok (error.status, &error);
  x->code = pw_scene_code_open (text, s, &error);
  free (text);
  check_ok (error.status, &error);
  set.specialised = pw_scene_code_table (x->code);
  x->special = runs_open (s, method, &set);
}

static void both_close (both *x) {
  pw_run_close (x->special);
  pw_run_close (x->general);
  pw_scene_code_close (x->code);
  pw_system_free (x->s);
}

static double both_scale (const double *a, int n) {
  double most = 1;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (a[i]));
  return most;
}

static void both_compare (const char *what, const double *a, const double *b, int n) {
  double scale = both_scale (a, n);
  for (int i = 0; i < n; i++) check_close (what, b[i] / scale, a[i] / scale, ROUND_OFF, WHY);
}

/* Both after the same time: state, accelerations, multipliers, ledger. */
static void both_run (both *x, double t) {
  pw_sample a = runs_to (x->general, t), b = runs_to (x->special, t);
  int n = pw_system_coordinates (x->s), rows = pw_system_rows (x->s);
  both_compare ("positions", a.q, b.q, n);
  both_compare ("velocities", a.v, b.v, n);
  both_compare ("accelerations", a.a, b.a, n);
  both_compare ("multipliers", a.lambda, b.lambda, rows);
  check_close ("work", b.work, a.work, ROUND_OFF * fmax (1, fabs (a.work)), WHY);
  check_close ("loss", b.loss, a.loss, ROUND_OFF * fmax (1, a.loss), WHY);
}

static long both_specialised (const both *x) {
  return pw_run_statistics (x->special)->specialised;
}

/* 100 steps of 1e-4 s, nearly all of them by specialised code. */
static int gallery_model (void *context, const char *name, const char *path) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte", "erk5:steps=fixed" };
  if (strcmp (name, "elliptic-wire") == 0) return 0; /* has element types of its own: see test_specialise */
  pw_error error = { 0 };
  pw_system *s = scene_named (path, NULL, 0);
  char *text = pw_system_source (s, NULL, &error);
  pw_system_free (s);
  free (text);
  if (text == NULL) { /* followers, whose wheels are steered by their position; limits of reactions */
    assert_true (strstr (error.text, "specialised code has no constraints whose signals depend on states") ||
                 strstr (error.text, "specialised code has no limits of reactions"));
    return 0;
  }
  for (size_t k = 0; k < sizeof method / sizeof *method; k++) {
    both x;
    both_open (&x, scene_named (path, NULL, 0), method[k], NULL);
    both_run (&x, 0.01);
    if (both_specialised (&x) < 350) print_error ("%s, %s: %ld\n", name, method[k], both_specialised (&x));
    assert_true (both_specialised (&x) >= 350);
    both_close (&x);
  }
  ++*(int *)context;
  return 0;
}

TEST (gallery) {
  pw_error error = { 0 };
  int models = 0;
  check_ok (pw_file_list (gallery_model, &models, &error), &error);
  assert_true (models > 20);
}

/* Steps of adaptive methods so long that a singular configuration may be within one, though none is: specialised code
 * evaluates them. */
TEST (long_steps) {
  static const struct {
    const char *model, *method;
    double t;
  } run[] = { { "ezyroller", "erk8+projection", 20 },
              { "ezyroller", "erk5+none", 20 },
              { "snakeboard", "erk8+projection", 5 },
              { "snakeboard", "bdf+projection", 5 },
              { "n-trailer", "adams+none", 10 } };
  for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
    both x;
    both_open (&x, scene_named (run[i].model, NULL, 0), run[i].method,
               &(pw_settings){ .rtol = 1e-4, .span = run[i].t });
    runs_to (x.special, run[i].t);
    const pw_statistics *count = pw_run_statistics (x.special);
    check_below ("evaluations of the general engine", (double)(count->rhs - count->specialised),
                 0.05 * (double)count->rhs, "those of the first steps and of Jacobians");
    both_close (&x);
  }
}

/* Adaptive methods pass singular configurations with either engine. */
TEST (adaptive_singular) {
  both x;
  both_open (&x, scene_named ("n-four-bar", NULL, 0), "erk8+projection", &(pw_settings){ .rtol = 1e-9, .span = 10 });
  pw_sample a = runs_to (x.general, 10), b = runs_to (x.special, 10);
  const double x0 = 0.3284581115408153787, y0 = 0.9445185381786009622;
  check_close ("general", hypot (cos (a.q[2]) - x0, sin (a.q[2]) - y0), 0, 1e-6, "published digits");
  check_close ("specialised", hypot (cos (b.q[2]) - x0, sin (b.q[2]) - y0), 0, 1e-6, "published digits");
  assert_true (both_specialised (&x) > pw_run_statistics (x.special)->rhs / 2);
  both_close (&x);
}

/* Residuals and counts that a projection reports are those of the general engine. */
TEST (report) {
  both x;
  both_open (&x, scene_named ("snakeboard", NULL, 0), "rk4+projection", NULL);
  both_run (&x, 0.05);
  const pw_statistics *a = pw_run_statistics (x.general), *b = pw_run_statistics (x.special);
  assert_int_equal (a->rhs, b->rhs);
  check_below ("difference of factorisations", fabs ((double)(a->factorisations - b->factorisations)), 20,
               "an iteration more or less where a residual is at round-off");
  check_below ("position", b->position, 4 * a->position + 4 * CHECK_EPS, "both at round-off");
  check_below ("velocity", b->velocity, 4 * a->velocity + 4 * CHECK_EPS, "both at round-off");
  assert_true (b->velocity > 0);
  both_close (&x);
}

/* The EzyRoller driven by pulses of torque. */
static pw_system *pulsed (void) {
  const pw_signal pulse = { .type = PW_PULSE,
                            .pulse = { .height = 0.2, .start = 0.1234, .width = 0.3, .period = 0.7 } };
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL);
  pw_model_set_signal (m, "rider", "value", &pulse, &error);
  check_ok (error.status, &error);
  return scene_compile (m);
}

static void same_state (const pw_sample *a, const pw_sample *b, const pw_system *s) {
  check_bits ("positions", a->q, b->q, s->coords);
  check_bits ("velocities", a->v, b->v, s->coords);
  check_bits ("accelerations", a->a, b->a, s->coords);
  check_bits ("multipliers", a->lambda, b->lambda, s->rows);
  check_bits ("work", &a->work, &b->work, 1);
  check_bits ("loss", &a->loss, &b->loss, 1);
}

/* Runs to samples inside steps that both reach; the same bits throughout. */
static void same_runs (pw_run *a, pw_run *b, double span) {
  pw_sample x, y;
  for (int k = 1; k <= 7; k++) {
    const double t = k * span / 7;
    check_ok (pw_run_advance_to (a, t, span, NULL), NULL);
    check_ok (pw_run_advance_to (b, t, span, NULL), NULL);
    check_ok (pw_run_sample (a, t, &x, NULL), NULL);
    check_ok (pw_run_sample (b, t, &y, NULL), NULL);
    same_state (&x, &y, a->s);
  }
  check_bits ("ledger", a->ledger, b->ledger, a->s->entries);
  assert_memory_equal (&a->statistics, &b->statistics, sizeof a->statistics);
}

static int refuse_stages (pw_scene *s, const pw_scene_step *x) {
  (void)s, (void)x;
  return 1;
}

static void refuse_steps (pw_scene *s, pw_scene_steps *x) {
  (void)s;
  x->done = 0;
}

/* Several steps at once, and the stages of a step at once, have the bits of single evaluations, between steps too, at
 * breakpoints, and where guards leave some of them to the general engine. */
TEST (stages) {
  static const struct {
    const char *model, *method; /* NULL: pulsed */
    double step, span;
  } all[] = {
    { NULL, "rk4+projection", 1e-2, 3 },
    { NULL, "erk5", 0, 3 },
    { NULL, "erk8+projection", 0, 3 },
    { "chaplygin-sleigh", "rk4", 1e-2, 1 },
    { "snakeboard", "erk5+projection", 0, 2 },
    { "differential-drive", "erk8+projection", 0, 4 },
    { "car-tyres", "erk8", 0, 1 },
    { "wheeled-snake", "erk5:inputs=held", 0, 1 },
    { "roller-racer", "rk4+baumgarte", 1e-2, 1 },
    { "n-four-bar", "rk4+projection", 1e-3, 3 },
    { "hatchet-planimeter", "erk5+nullspace", 0, 1 },
    { "redundant-parallelogram", "erk5", 0, 1 },
  };
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
    both x;
    pw_settings set = { .step = all[i].step, .span = all[i].span };
    both_open (&x, all[i].model ? scene_named (all[i].model, NULL, 0) : pulsed (), all[i].method, &set);
    pw_specialised single = *pw_scene_code_table (x.code);
    single.stages = refuse_stages, single.steps = refuse_steps;
    set.specialised = &single;
    pw_run *r = runs_open (x.s, all[i].method, &set);
    same_runs (x.special, r, all[i].span);
    pw_run_close (r);
    both_close (&x);
  }
}

/* Angles beyond the range of the own sine are evaluated by the general engine: the same bits. */
TEST (angles) {
  both x;
  pw_system *s = scene_named ("chaplygin-sleigh", NULL, 0);
  const pw_initial_value far = { pw_system_find_state (s, "sleigh.phi", NULL), 2e6 };
  assert_true (far.state >= 0);
  both_open (&x, s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1, .initial = &far, .initials = 1 });
  pw_sample a = runs_to (x.general, 0.1), b = runs_to (x.special, 0.1);
  check_bits ("velocities", a.v, b.v, pw_system_coordinates (s));
  assert_int_equal (both_specialised (&x), 0);
  both_close (&x);
}

SCENE (two_torques) {
  const pw_signal fast = { PW_HARMONIC, .harmonic = { .amplitude = 1, .omega = 50 } },
                  far = { PW_HARMONIC, .harmonic = { .omega = 1, .phase = 1e6 - 0.057 } };
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_torque (m, &(pw_torque){ .name = "fast", .body = { "disc", "ground" }, .value = fast });
  pw_add_torque (m, &(pw_torque){ .name = "far", .body = { "disc", "ground" }, .value = far });
}

/* At the end of the step from 0.05 s the argument of the second torque is beyond that range, of the first it is not. */
TEST (arguments) {
  both x;
  both_open (&x, scene_system (&two_torques_table, NULL), "rk4", &(pw_settings){ .step = 0.01, .span = 1 });
  both_run (&x, 0.1);
  assert_true (both_specialised (&x) > 0);
  both_close (&x);
}

/* A point mass, whose angle nothing turns, on a rod from an arm. */
SCENE (point_mass) {
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 1, .start = { 0.5, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .start = { 1, -1, 0 }, .rate = { 0, 0, 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_rod (m, &(pw_rod){ .name = "R", .body = { "arm", "bob" }, .at = { { 0.5, 0 }, { 0, 0 } }, .length = 1 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

TEST (point_mass) {
  both x;
  both_open (&x, scene_system (&point_mass_table, NULL), "rk4+projection", &(pw_settings){ .step = 0.01, .span = 1 });
  both_run (&x, 1);
  assert_true (both_specialised (&x) >= 350);
  both_close (&x);
}

/* Passing singular configurations, the guards leave some evaluations to the general engine, and the result is right. */
TEST (singular) {
  both x;
  both_open (&x, scene_named ("n-four-bar", "N", 2), "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 10 });
  pw_sample b = runs_to (x.special, 3);
  const pw_statistics *count = pw_run_statistics (x.special);
  assert_true (count->specialised > count->rhs / 2 && count->specialised < count->rhs - 10);
  pw_sample a = runs_to (x.general, 3);
  for (int j = 0; j < pw_system_coordinates (x.s); j++)
    check_close ("q", b.q[j], a.q[j], 1e-6, "round-off grows where branches meet");
  both_close (&x);
}

/* At a singular configuration, a crank and a rod of equal lengths above the slider, evaluation and projection
 * refuse. */
TEST (guard) {
  const double up = PW_PI / 2;
  double q[12] = { 0, 0.5, up, 0, 0.5, -up, 0, 0, 0 }, v[12] = { 0 }, a[12], lambda[12];
  both x;
  both_open (&x, scene_named ("slider-crank", NULL, 0), "rk4+projection", NULL);
  const pw_specialised *code = pw_scene_code_table (x.code);
  pw_workspace *w = x.special->w;
  assert_int_equal (code->evaluate (x.special->scene, 0, q, v, a, lambda, w->configuration, w->J), 1);
  assert_int_equal (code->project (x.special->scene, 0, q, v, a, lambda, w->configuration, w->J), 1);
  q[2] = 1, q[5] = -1, q[0] = 0.5 * cos (1), q[3] = 1.5 * cos (1), q[1] = q[4] = 0.5 * sin (1), q[6] = 2 * cos (1);
  assert_int_equal (code->evaluate (x.special->scene, 0, q, v, a, lambda, w->configuration, w->J), 0);
  both_close (&x);
}

/* Code without an equation that the run enforces is not used. */
TEST (independent) {
  pw_error error = { 0 };
  unsigned char independent[40];
  pw_system *s = scene_named ("snakeboard", NULL, 0);
  memset (independent, 1, sizeof independent);
  independent[pw_system_rows (s) - 1] = 0;
  char *text = pw_system_source (s, independent, &error);
  pw_scene_code *code = text ? pw_scene_code_open (text, s, &error) : NULL;
  check_ok (error.status, &error);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .specialised = pw_scene_code_table (code) });
  runs_to (r, 0.1);
  assert_int_equal (pw_run_statistics (r)->specialised, 0);
  pw_run_close (r);
  pw_scene_code_close (code);
  free (text);
  pw_system_free (s);
}

/* ---- Element types of a plug-in ---- */

/* A wall at x = 10, far from all random states: the force -k (x - 10) beyond. */
typedef struct {
  const char *name;
  const char *body;
} wall;

enum { WALL_AT = 10, WALL_STIFFNESS = 10 };

static int wall_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  (void)definition, (void)bodies, (void)element, (void)internal, (void)error;
  return PW_OK;
}

static void wall_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    out[0] = -WALL_STIFFNESS * fmax (0, b->configuration[b->body[e]].x - WALL_AT);
    out[1] = out[2] = 0;
  }
}

static const pw_field wall_fields[] = {
  { PW_AT (wall, body), PW_BODY, .required = 1, .about = "the body" },
  { .name = NULL },
};

static const pw_kind wall_kind = {
  .name = "wall",
  .about = "keeps a body at x below 10 m",
  .definition = sizeof (wall),
  .element = 1,
  .fields = wall_fields,
  .bodies = 1,
  .level = PW_FORCE,
  .prepare = wall_prepare,
  .force = wall_force,
  .force_q = PW_BY_DIFFERENCES,
};

SCENE (wall_build) {
  pw_add_body (m, &(pw_body){ .name = "ball", .mass = 1, .inertia = 1, .rate = { 2 } });
  pw_add (m, &wall_kind, &(wall){ .name = "end", .body = "ball" });
}

/* A scene without any element type of the library, whose force is 0 at the initial state and at all random ones. */
TEST (plug_in) {
  const double w = sqrt (WALL_STIFFNESS), t = 6;
  both x;
  both_open (&x, scene_system (&wall_build_table, NULL), "rk4+none", &(pw_settings){ .step = 1e-3, .span = t });
  both_run (&x, t);
  check_close ("x", runs_to (x.special, t).q[0], WALL_AT - 2 * (t - WALL_AT / 2 - PW_PI / w), 1e-6,
               "second order where the force begins");
  assert_true (both_specialised (&x) > 4 * 5900);
  both_close (&x);
}

/* ---- Codes of other scenes ---- */

/* A code with all equations does not suit a run with redundant ones, nor one for another scene at all. */
TEST (another) {
  pw_error error = { 0 };
  pw_system *s = scene_named ("redundant-parallelogram", NULL, 0), *other = scene_named ("pendulum", NULL, 0);
  char *text = pw_system_source (s, NULL, &error);
  pw_scene_code *code = text ? pw_scene_code_open (text, s, &error) : NULL;
  check_ok (error.status, &error);
  pw_settings set = { .step = 1e-3, .specialised = pw_scene_code_table (code) };
  pw_run *r = runs_open (s, "rk4+projection", &set);
  runs_to (r, 0.1);
  assert_int_equal (pw_run_statistics (r)->specialised, 0);
  pw_run_close (r);
  assert_null (pw_run_open (other, "rk4+projection", &set, &error));
  check_error (&error, PW_INPUT, "model pendulum: the specialised code belongs to another scene");
  pw_scene_code_close (code);
  free (text);
  pw_system_free (s);
  pw_system_free (other);
}

/* Scenes without a fixed order of elimination are refused with the reason. */
TEST (refused) {
  pw_error error = { 0 };
  pw_system *s = scene_named ("chain", "n", 40);
  assert_null (pw_system_source (s, NULL, &error));
  check_error (&error, PW_INPUT, "model chain: 80 constraint equations: specialised code has at most 60");
  pw_system_free (s);
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  for (int i = 0; i <= 120; i++) {
    const char name[] = { (char)('A' + i / 11), (char)('A' + i % 11), 0 };
    pw_add_torque (m, &(pw_torque){ .name = name, .body = { "frame", "ground" } });
  }
  s = scene_compile (m);
  error = (pw_error){ 0 };
  assert_null (pw_system_source (s, NULL, &error));
  check_error (&error, PW_INPUT, "model ezyroller: 125 elements: specialised code has at most 120");
  pw_system_free (s);
  m = scene_model (&scene_ezyroller, NULL);
  for (int i = 0; i < 199; i++)
    pw_add_body (m, &(pw_body){ .name = PW_PRINTED (8, "b%d", i), .mass = 1, .inertia = 1 });
  s = scene_compile (m);
  error = (pw_error){ 0 };
  assert_null (pw_system_source (s, NULL, &error));
  check_error (&error, PW_INPUT, "model ezyroller: 201 bodies: specialised code has at most 200");
  pw_system_free (s);
  assert_null (pw_system_source (NULL, NULL, &(pw_error){ 0 }));
  assert_null (pw_run_source (NULL, &(pw_error){ 0 }));
}

/* They take a sixteenth of the calls, and leave the watchdog where single steps do. */
TEST (several_steps) {
  static const char *const model[] = { "ezyroller",    "snakeboard",       "n-trailer",
                                       "theo-jansen",  "car-tyres",        "slider-crank",
                                       "roller-racer", "andrews-squeezer", "car-two-trailers" };
  static const char *const method[] = { "rk4+projection", "rk4+none", "erk5+projection:steps=fixed",
                                        "erk8:steps=fixed" };
  const double h = 1e-4, t = 310.5 * h;
  for (size_t i = 0; i < sizeof model / sizeof *model; i++)
    for (size_t k = 0; k < sizeof method / sizeof *method; k++) {
      both x;
      pw_sample a, b;
      int calls = 0;
      both_open (&x, scene_named (model[i], NULL, 0), method[k], &(pw_settings){ .step = h, .span = 1 });
      pw_run *one = runs_open (x.s, method[k], &x.special->settings), *many = x.special;
      while (pw_run_time (one) < t) check_ok (pw_run_advance (one, 1, NULL), NULL);
      for (; pw_run_time (many) < t; calls++) check_ok (pw_run_advance_towards (many, t, 1, NULL), NULL);
      assert_in_range (calls, 34, i == 7 ? 150 : 46); /* the squeezer is near a change point */
      check_ok (pw_run_sample (one, t, &a, NULL), NULL);
      check_ok (pw_run_sample (many, t, &b, NULL), NULL);
      same_state (&a, &b, x.s);
      assert_memory_equal (pw_run_statistics (one), pw_run_statistics (many), sizeof (pw_statistics));
      check_bits ("motion since the last sine", &one->watchdog.moved, &many->watchdog.moved, 1);
      check_bits ("accelerations so far", &one->reference_level, &many->reference_level, 1);
      check_bits ("energy so far", &one->exchanged, &many->exchanged, 1);
      const double end = pw_run_time (one) + 40.005 * h; /* the last step is longer */
      while (pw_run_time (one) < end) check_ok (pw_run_advance (one, end, NULL), NULL);
      check_ok (pw_run_advance_to (many, end, end, NULL), NULL);
      assert_int_equal (pw_run_statistics (one)->steps, pw_run_statistics (many)->steps);
      assert_int_equal (pw_run_advance_towards (many, 1, NAN, &(pw_error){ 0 }), PW_INPUT);
      pw_run_close (one);
      both_close (&x);
    }
}
