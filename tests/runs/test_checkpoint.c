/* A run loaded from a checkpoint continues like the one that was saved, bit for bit: every method, every
 * stabilisation. */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"

static const struct {
  const char *scene, *parameter;
  double value, t_end;
} saved_scenes[] = {
  { "models/vehicles/ezyroller.c", NULL, 0, 1 },
  { "models/vehicles/ezyroller.c", "omega", 20, 1 },
  { "tests/scenes/zoo.c", NULL, 0, 0.3 },
  { "models/linkages/redundant-parallelogram.c", NULL, 0, 0.4 },
  { "models/linkages/n-four-bar.yaml", NULL, 0, 0.4 },
  { "tests/scenes/chain.c", "links", 30, 0.05 },
  { "tests/models/ezyroller.yaml", NULL, 0, 1 },
};

enum { SAVED_SCENES = sizeof saved_scenes / sizeof *saved_scenes, SAVED_MOMENTS = 3, SAVED_MOST = 4000 };

static pw_file *saved_file[SAVED_SCENES];

static int saved_setup (void) {
  pw_error error = { 0 };
  for (int i = 0; i < SAVED_SCENES; i++)
    if ((saved_file[i] = pw_file_open (saved_scenes[i].scene, &error)) == NULL) check_ok (error.status, &error);
  return 0;
}

static int saved_teardown (void) {
  for (int i = 0; i < SAVED_SCENES; i++) pw_file_close (saved_file[i]);
  return 0;
}

static pw_system *saved_system (int scene) {
  pw_error error = { 0 };
  pw_model *m = pw_file_model (saved_file[scene], &error);
  assert_non_null (m);
  if (saved_scenes[scene].parameter)
    check_ok (pw_model_set (m, saved_scenes[scene].parameter, saved_scenes[scene].value, &error), &error);
  check_ok (pw_model_build (m, &error), &error);
  pw_system *s = pw_system_compile (m, &error);
  pw_model_free (m);
  check_ok (error.status, &error);
  return s;
}

static pw_run *saved_open (pw_system *s, int scene, const char *method) {
  return runs_open (s, method,
                    &(pw_settings){ .step = 1e-3, .rtol = 1e-6, .span = saved_scenes[scene].t_end, .ledger = 1 });
}

/* The final state and all counts of a run. */
typedef struct {
  int size;
  double number[SAVED_MOST];
} saved_end;

static void saved_keep (saved_end *e, const double *x, int n) {
  assert_true (e->size + n <= SAVED_MOST);
  memcpy (e->number + e->size, x, (size_t)n * sizeof *x);
  e->size += n;
}

/* Advances to the end; on the way saves the run at the SAVED_MOMENTS equally spaced times, from number `moment` (from
 * 0) on, each into its archive, or after a later step if a save is refused near a singular configuration. */
static void saved_finish (pw_run *r, pw_system *s, int scene, pw_archive *archive, int moment, saved_end *e) {
  pw_error error = { 0 };
  double t_end = saved_scenes[scene].t_end;
  while (pw_run_time (r) < t_end) {
    double due = t_end * (moment + 1) / (SAVED_MOMENTS + 1);
    check_ok (pw_run_advance (r, pw_run_time (r) < due ? due : t_end, &error), &error);
    if (moment == SAVED_MOMENTS || pw_run_time (r) < due) continue;
    int status = pw_run_save (r, &archive[moment], &error);
    check_ok (status > 0 ? PW_OK : status, &error);
    if (status == PW_OK) moment++;
  }
  assert_int_equal (moment, SAVED_MOMENTS);
  pw_sample x = runs_to (r, t_end);
  const pw_statistics *n = pw_run_statistics (r);
  e->size = 0;
  saved_keep (e, x.q, pw_system_coordinates (s));
  saved_keep (e, x.v, pw_system_coordinates (s));
  saved_keep (e, x.a, pw_system_coordinates (s));
  saved_keep (e, x.lambda, pw_system_rows (s));
  saved_keep (e, x.ledger, pw_system_ledger_entries (s));
  saved_keep (e, (double[]){ x.balance, x.projection, n->position, n->velocity, n->g, n->jv }, 6);
  saved_keep (e,
              (double[]){ (double)n->steps, (double)n->rejected, (double)n->rhs, (double)n->jacobians,
                          (double)n->factorisations, (double)n->restarts },
              6);
}

/* A method whose step size and counts are saved takes the same steps as without saving. */
static void saved_undisturbed (int scene, const char *method, const pw_method *integrator, const pw_statistics *n) {
  double t_end = saved_scenes[scene].t_end;
  if (integrator->serialise == NULL) return;
  pw_error error = { 0 };
  pw_system *s = saved_system (scene);
  pw_run *r = saved_open (s, scene, method);
  for (int i = 1; i <= SAVED_MOMENTS + 1; i++)
    check_ok (pw_run_advance_to (r, t_end, t_end * i / (SAVED_MOMENTS + 1), &error), &error);
  const pw_statistics *plain = pw_run_statistics (r);
  assert_int_equal (n->restarts, 0);
  assert_int_equal (n->steps, plain->steps);
  assert_int_equal (n->rejected, plain->rejected);
  pw_run_close (r);
  pw_system_free (s);
}

/* Compares the run that is saved with runs loaded from each of its archives. */
static void saved_compare (int scene, const char *method) {
  pw_error error = { 0 };
  pw_archive archive[SAVED_MOMENTS] = { { .at = NULL } };
  static saved_end whole, part;
  pw_system *s = saved_system (scene);
  pw_run *r = saved_open (s, scene, method);
  saved_finish (r, s, scene, archive, 0, &whole);
  const pw_method *integrator;
  int stabilisation;
  check_ok (pw_method_parse (method, NULL, &integrator, &stabilisation, &error), &error);
  if (integrator->serialise == NULL) assert_int_equal (pw_run_statistics (r)->restarts, SAVED_MOMENTS);
  saved_undisturbed (scene, method, integrator, pw_run_statistics (r));
  pw_run_close (r);
  for (int moment = 0; moment < SAVED_MOMENTS; moment++) {
    pw_archive again[SAVED_MOMENTS] = { { .at = NULL } };
    pw_archive from = { .at = archive[moment].at, .size = archive[moment].used, .loading = 1 };
    r = saved_open (s, scene, method);
    check_ok (pw_run_load (r, &from, &error), &error);
    assert_true (from.used == from.size);
    saved_finish (r, s, scene, again, moment + 1, &part);
    if (part.size != whole.size || memcmp (part.number, whole.number, (size_t)whole.size * sizeof (double)) != 0)
      print_error ("%s, %s, from %d of %d\n", saved_scenes[scene].scene, method, moment + 1, SAVED_MOMENTS);
    assert_int_equal (part.size, whole.size);
    assert_memory_equal (part.number, whole.number, (size_t)whole.size * sizeof (double));
    pw_run_close (r);
    for (int i = 0; i < SAVED_MOMENTS; i++) pw_archive_free (&again[i]);
  }
  for (int i = 0; i < SAVED_MOMENTS; i++) pw_archive_free (&archive[i]);
  pw_system_free (s);
}

TEST (same) {
  char name[40];
  for (int scene = 0; scene < SAVED_SCENES; scene++)
    for (int i = 0; runs_method (i, name); i++) saved_compare (scene, name);
}

TEST (options) {
  static const char *const method[] = { "rk4+projection:every=3", "rk4+projection:metric=identity",
                                        "rk4:inputs=held",        "erk5:steps=fixed",
                                        "erk8+baumgarte:alpha=3", "rk4+nullspace",
                                        "galpha+ggl:rho=0.5",     "leapfrog" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) saved_compare (1, method[i]);
}

/* After a checkpoint, the energy added by a change of velocities is still known. */
TEST (kicked) {
  pw_error error = { 0 };
  pw_archive archive = { .at = NULL };
  double v[6];
  pw_system *s = saved_system (0);
  pw_run *r = saved_open (s, 0, "rk4+projection");
  pw_sample now = runs_to (r, 0.5);
  for (int j = 0; j < 6; j++) v[j] = 3 * now.v[j];
  check_ok (pw_run_restart (r, NULL, v, &error), &error);
  check_ok (pw_run_save (r, &archive, &error), &error);
  double balance = runs_to (r, 1).balance;
  pw_run_close (r);
  r = saved_open (s, 0, "rk4+projection");
  pw_archive from = { .at = archive.at, .size = archive.used, .loading = 1 };
  check_ok (pw_run_load (r, &from, &error), &error);
  check_close ("balance", runs_to (r, 1).balance, balance, 0, "to the bit");
  pw_run_close (r);
  pw_archive_free (&archive);
  pw_system_free (s);
}

/* Replaces each number in the saved state that equals the number of steps by LONG_MAX: some of these states are
 * refused, and loading the others is harmless. */
TEST (counts) {
  static const char *const method[] = { "rk4+projection", "leapfrog", "ida+ggl" };
  for (size_t m = 0; m < sizeof method / sizeof *method; m++) {
    pw_error error = { 0 };
    pw_archive archive = { .at = NULL };
    pw_system *s = saved_system (0);
    pw_run *r = saved_open (s, 0, method[m]);
    check_ok (pw_run_advance (r, 1, &error), &error);
    check_ok (pw_run_save (r, &archive, &error), &error);
    pw_statistics done = *pw_run_statistics (r);
    pw_run_close (r);
    int refused = 0;
    for (size_t at = 0; at + sizeof (long) <= archive.used; at++) {
      if (memcmp (archive.at + at, &done.steps, sizeof done.steps) != 0) continue;
      memcpy (archive.at + at, &(long){ LONG_MAX }, sizeof (long));
      pw_archive from = { .at = archive.at, .size = archive.used, .loading = 1 };
      r = saved_open (s, 0, method[m]);
      error = (pw_error){ 0 };
      refused += pw_run_load (r, &from, &error) == PW_INPUT;
      pw_run_close (r);
      memcpy (archive.at + at, &done.steps, sizeof done.steps);
    }
    assert_true (refused > 0);
    pw_archive_free (&archive);
    pw_system_free (s);
  }
}

static const char saved_refusal[] = "the saved state does not belong to this run";

/* Loads a saved state into a run, which is closed; if refused, it must be with PW_INPUT and this text.  Returns the
 * status. */
static int saved_load_and_close (const pw_archive *saved, pw_run *r, const char *text) {
  pw_error error = { 0 };
  pw_archive from = { .at = saved->at, .size = saved->used, .loading = 1 };
  int status = pw_run_load (r, &from, &error);
  if (status != PW_OK) check_error (&error, PW_INPUT, text);
  pw_run_close (r);
  return status;
}

/* Archives of other runs, and truncated ones, are refused. */
TEST (other) {
  pw_error error = { 0 };
  pw_archive archive = { .at = NULL };
  pw_system *s = saved_system (0), *other = saved_system (2);
  pw_run *r = saved_open (s, 0, "erk8+projection");
  check_ok (pw_run_advance (r, 1, &error), &error);
  check_ok (pw_run_save (r, &archive, &error), &error);
  pw_run_close (r);
  for (size_t size = 0; size < archive.used; size += 1 + archive.used / 50) {
    const pw_archive truncated = { .at = archive.at, .used = size };
    r = saved_open (s, 0, "erk8+projection");
    assert_int_equal (saved_load_and_close (&truncated, r, saved_refusal), PW_INPUT);
  }
  r = saved_open (other, 2, "erk8+projection");
  assert_int_equal (saved_load_and_close (&archive, r, saved_refusal), PW_INPUT);
  pw_archive_free (&archive);
  pw_system_free (s);
  pw_system_free (other);
}

/* Method, options, settings and system must be those of the saved run, and the run must not have advanced. */
TEST (identity) {
  static const char *const method[] = { "rk4+baumgarte", "rk4+none", "rk4+projection:every=2",
                                        "erk5",          "erk8",     "erk5:steps=fixed",
                                        "radau",         "bdf",      "ida",
                                        "adams",         "galpha",   "leapfrog" };
  enum { METHODS = sizeof method / sizeof *method };
  const pw_settings own = { .step = 1e-3, .rtol = 1e-6 };
  const pw_settings changed[] = { { .step = 2e-3, .rtol = 1e-6 },
                                  { .step = 1e-3, .rtol = 1e-7 },
                                  { .step = 1e-3, .rtol = 1e-6, .span = 3 },
                                  { .step = 1e-3, .rtol = 1e-6, .ledger = 1 } };
  pw_system *s = saved_system (0), *faster = saved_system (1);
  for (int i = 0; i < METHODS; i++) {
    pw_error error = { 0 };
    pw_archive a = { .at = NULL };
    pw_run *r = runs_open (s, method[i], &own);
    check_ok (pw_run_advance_to (r, 0.1, 1, &error), &error);
    check_ok (pw_run_save (r, &a, &error), &error);
    for (int k = 0; k < METHODS; k++)
      assert_int_equal (saved_load_and_close (&a, runs_open (s, method[k], &own), saved_refusal),
                        k == i ? PW_OK : PW_INPUT);
    for (size_t k = 0; k < sizeof changed / sizeof *changed; k++)
      assert_int_equal (saved_load_and_close (&a, runs_open (s, method[i], &changed[k]), saved_refusal), PW_INPUT);
    assert_int_equal (saved_load_and_close (&a, runs_open (faster, method[i], &own), saved_refusal), PW_INPUT);
    char text[120];
    snprintf (text, sizeof text, "the run has advanced to t = %g s: a saved state needs a new one", pw_run_time (r));
    assert_int_equal (saved_load_and_close (&a, r, text), PW_INPUT);
    pw_archive_free (&a);
  }
  pw_system_free (s);
  pw_system_free (faster);
}

/* The ledger includes work done before the run was saved: the energy balances to the accuracy of each method. */
TEST (ledger) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "adams",
                                        "bdf+projection", "ida+ggl",         "galpha" };
  for (int i = 0; i < 6; i++) {
    const pw_settings settings = { .step = 1e-3, .rtol = 1e-8, .span = 2, .ledger = 1 };
    pw_system *s = saved_system (0);
    pw_run *r = runs_open (s, method[i], &settings);
    runs_to (r, 1);
    pw_run *loaded = runs_copy (r, s, method[i], &settings);
    pw_sample x = runs_to (loaded, 2);
    check_below (method[i], fabs (x.balance), 1e-4 * x.work, "errors of galpha at h = 1e-3, the others less");
    check_below (method[i], 1e-3, x.work, "there is work to be accounted for");
    pw_run_close (loaded);
    runs_close (r, s);
  }
}

/* Times may be negative. */
TEST (negative) {
  char name[40];
  pw_system *s = saved_system (0);
  int n = pw_system_coordinates (s);
  for (int i = 0; runs_method (i, name); i++) {
    const pw_settings settings = { .t = -2, .step = 0.01, .rtol = 1e-6, .span = 3 };
    pw_run *r = runs_open (s, name, &settings);
    runs_to (r, -1);
    pw_run *loaded = runs_copy (r, s, name, &settings);
    check_bits (name, runs_to (loaded, 1).q, runs_to (r, 1).q, n);
    pw_run_close (loaded);
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* ---- A signal that fails once, while a run is saved ---- */

static int saved_calls, saved_failing; /* evaluations of the signal; the one that fails */

static int saved_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = ++saved_calls == saved_failing ? NAN : 0.1 - 0.2 * x[0];
  if (gradient) gradient[0] = -0.2;
  return 0;
}

SCENE (saved_build) {
  static const char *const reads[] = { "arm.omega", NULL };
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 0.5, .start = { 0.5 } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "arm", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_torque (m, &(pw_torque){ .name = "M",
                                  .body = { "arm", "ground" },
                                  .value = { PW_FUNCTION, .function = { .eval = saved_torque, .reads = reads } } });
}

/* After a failed save the run stays where it was, and continues; if the method has been opened again, earlier times can
 * no longer be sampled. */
static void saved_fail (pw_system *s, const char *method, double phi) {
  pw_sample x;
  int reopened = 0;
  for (saved_failing = 1; saved_failing <= 4; saved_failing++) {
    pw_error error = { 0 };
    pw_archive archive = { .at = NULL };
    saved_calls = 10;
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-6 });
    check_ok (pw_run_advance_to (r, 0.5, 1, &error), &error);
    check_ok (pw_run_sample (r, pw_run_time (r), &x, &error), &error);
    saved_calls = 0;
    int failed = pw_run_save (r, &archive, &error) == PW_METHOD;
    saved_calls = 10;
    error = (pw_error){ 0 };
    check_ok (pw_run_sample (r, pw_run_time (r), &x, &error), &error);
    int inside = pw_run_sample (r, pw_run_time (r) - 1e-6, &x, &error);
    reopened += failed && inside == PW_INPUT;
    if (inside != PW_OK) assert_non_null (strstr (error.text, "lies outside the last step"));
    check_close (method, runs_to (r, 1).q[2], phi, 1e-4, "100 rtol");
    pw_run_close (r);
    pw_archive_free (&archive);
  }
  assert_true (reopened > 0);
}

TEST (failing) {
  char name[40];
  double q[3], v[3];
  pw_system *s = scene_system (&saved_build_table, NULL);
  saved_failing = 0;
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-10 }, 1, q, v, NULL);
  for (int i = 0; runs_method (i, name); i++) saved_fail (s, name, q[2]);
  pw_system_free (s);
}

/* ---- An arm without inertia, in line with the rod that determines its angle ---- */

SCENE (undetermined_build) {
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1 });
  pw_add_rod (m,
              &(pw_rod){ .name = "rod", .body = { "arm", "ground" }, .at = { { 0.5, 0 }, { 0.5, 1 } }, .length = 1 });
}

/* In this state matrices cannot be planned again: saving fails, and the run cannot continue. */
TEST (undetermined) {
  pw_error error = { 0 };
  pw_archive a = { 0 };
  pw_system *s = scene_system (&undetermined_build_table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  r->q[0] = 0.5, r->q[1] = -0.5, r->q[2] = PW_PI / 2;
  assert_int_equal (pw_run_save (r, &a, &error), PW_INPUT);
  assert_non_null (strstr (error.text, "arm.phi has no inertia, and no constraint determines how it moves"));
  error.status = PW_OK;
  assert_int_equal (pw_run_advance (r, 1, &error), PW_RESOURCE);
  check_error (&error, PW_RESOURCE, "model scene: t = 0 s: the method could not be reopened");
  pw_archive_free (&a);
  pw_run_close (r);
  pw_system_free (s);
}

const check_fixture fixture = { saved_setup, saved_teardown };
