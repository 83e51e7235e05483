/* The consistent start: what is given stays, what is consistent is left alone, what cannot be is named. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "model.h"
#include "runs.h"
#include "scene.h"
#include "system.h"
#include "toys.h"

#define START_ROUND_OFF (64 * CHECK_EPS)
static const char start_reason[] = "64 eps of the row's terms: round-off";

/* Opens a run on the EzyRoller with start values, NULL-terminated names and values, and checks the constraints. */
static pw_run *start_open (pw_system **system, const char *const *name, const double *value) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  for (int i = 0; name && name[i]; i++) check_ok (pw_model_set_initial (m, name[i], value[i], &error), &error);
  *system = scene_compile (m);
  pw_run *r = runs_open (*system, "rk4", NULL);
  pw_sample now = runs_to (r, 0);
  check_below ("position", now.position, START_ROUND_OFF, start_reason);
  check_below ("velocity", now.velocity, START_ROUND_OFF, start_reason);
  return r;
}

static void start_close (pw_run *r, pw_system *s) {
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Initial values of the settings ---- */

/* They replace the system's for this run alone, as if the model had them, to the bit. */
static void test_settings (void **state) {
  static const char *const name[] = { "frame.omega", "steer.phi", NULL };
  static const double value[] = { 0.3, 0.2 };
  pw_system *own, *shared;
  pw_error error = { 0 };
  (void)state;
  pw_run *expected = start_open (&own, name, value), *plain = start_open (&shared, NULL, NULL);
  pw_initial_value initial[2];
  for (int i = 0; i < 2; i++)
    initial[i] = (pw_initial_value){ pw_system_find_state (shared, name[i], &error), value[i] };
  pw_run *r = runs_open (shared, "rk4", &(pw_settings){ .initial = initial, .initials = 2 });
  const pw_initial_report *a = pw_run_initial (r), *b = pw_run_initial (expected);
  check_bits ("positions", a->q, b->q, 6);
  check_bits ("velocities", a->v, b->v, 6);
  assert_true (a->moved == b->moved && a->changed == b->changed && a->released == b->released && a->moved > 0);
  for (int i = 0; i < 12; i++) assert_int_equal (pw_initial_specified (a, i), pw_initial_specified (b, i));
  assert_true (pw_initial_specified (a, initial[0].state) && !pw_initial_specified (pw_run_initial (plain), 2));
  pw_run_close (r);
  pw_run_close (plain);
  pw_run *again = runs_open (shared, "rk4", NULL);
  check_bits ("the system's", pw_run_initial (again)->q, shared->q0, 6);
  start_close (again, shared);
  start_close (expected, own);
}

static void test_bad_settings (void **state) {
  static const pw_initial_value bad[] = { { -1, 0 }, { 12, 0 }, { 0, NAN }, { 0, 1e200 } };
  static const char *const expected[] = { "state -1 = 0: expected a state from 0 to 11", "state 12 = 0: expected",
                                          "state 0 = nan: expected",
                                          "values too extreme: frame.x is initially 1e+200" };
  (void)state;
  pw_system *s = scene_compile (scene_model (&scene_ezyroller, NULL));
  for (int i = 0; i < 4; i++) {
    pw_error error = { 0 };
    assert_null (pw_run_open (s, "rk4", &(pw_settings){ .initial = bad + i, .initials = 1 }, &error));
    assert_int_equal (error.status, PW_INPUT);
    assert_non_null (strstr (error.text, expected[i]));
  }
  pw_system_free (s);
}

/* ---- Nothing to do ---- */

static void test_no_harm (void **state) {
  (void)state;
  pw_system *s;
  pw_run *r = start_open (&s, NULL, NULL);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->moved == 0 && start->released == 0);
  check_bits ("positions", start->q, s->q0, 6);
  check_bits ("rates", start->v, s->v0, 6);
  start_close (r, s);
}

/* What is off by more than round-off is moved, however little that is. */
static void test_little (void **state) {
  static const char *const name[] = { "steer.x", "frame.vy", NULL };
  static const double value[] = { 0.375 + 1e-10, 1e-10 };
  (void)state;
  for (int i = 0; i < 2; i++) {
    pw_system *s;
    const char *const one[] = { name[i], NULL };
    pw_run *r = start_open (&s, one, value + i);
    assert_true (pw_run_initial (r)->moved > 0);
    start_close (r, s);
  }
}

/* Round-off is put right, but nothing is said of it. */
static void test_round_off (void **state) {
  static const char *const name[] = { "steer.x", NULL };
  static const double value[] = { 0.375 + 12 * CHECK_EPS };
  (void)state;
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  int changed = 0;
  for (int j = 0; j < 6; j++) changed += start->q[j] != start->q_given[j];
  assert_true (changed > 0 && start->moved == 0);
  start_close (r, s);
}

/* A state on the way is as consistent as it can be: it is not touched, either. */
static void test_no_harm_on_the_way (void **state) {
  (void)state;
  for (double t = 0.25; t <= 2; t += 0.25) {
    double q[6], v[6];
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    pw_sample now = runs_to (r, t);
    memcpy (q, now.q, sizeof q);
    memcpy (v, now.v, sizeof v);
    check_ok (pw_run_restart (r, q, v, &error), &error);
    assert_int_equal (pw_run_initial (r)->moved, 0);
    now = runs_to (r, t);
    check_bits ("positions", now.q, q, 6);
    check_bits ("rates", now.v, v, 6);
    start_close (r, s);
  }
}

/* ---- What is specified stays, too ---- */

/* A rod on a pin, of which one state or two are specified. */
static void start_rod (pw_model *m, const void *parameters) {
  const double *p = parameters;
  pw_add_body (m, &(pw_body){ .name = "rod",
                              .mass = 1,
                              .inertia = 1. / 12,
                              .start = { p[1], 0, p[0] },
                              .rate = { 0, p[3], p[2] },
                              .specified = (unsigned)p[4] });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "ground", "rod" }, .at = { { 0 }, { -0.5, 0 } } });
}

static const pw_parameter start_rod_list[] = { { .name = "phi" },
                                               { .name = "x", .offset = 8 },
                                               { .name = "omega", .offset = 16 },
                                               { .name = "vy", .offset = 24 },
                                               { .name = "specified", .offset = 32 },
                                               { .name = NULL } };
static const pw_plugin_table start_rod_table = { .abi = PW_ABI,
                                                 .size = sizeof (pw_plugin_table),
                                                 .parameters = start_rod_list,
                                                 .parameters_size = 40,
                                                 .build = start_rod };

static const pw_initial_report *start_of_rod (pw_system **s, pw_run **r, double phi, double x, double omega, double vy,
                                              double specified) {
  *s = scene_system (&start_rod_table, "phi", phi, "x", x, "omega", omega, "vy", vy, "specified", specified, NULL);
  *r = runs_open (*s, "rk4", NULL);
  check_below ("position", runs_to (*r, 0).position, START_ROUND_OFF, start_reason);
  check_below ("velocity", runs_to (*r, 0).velocity, START_ROUND_OFF, start_reason);
  return pw_run_initial (*r);
}

/* An angle and a rate that are specified stay to the bit; what is left out follows. */
static void test_specified (void **state) {
  pw_system *s;
  pw_run *r;
  (void)state;
  const pw_initial_report *start = start_of_rod (&s, &r, PW_PI / 6, 0, 2, 0, 0);
  assert_true (start->q[2] == PW_PI / 6 && start->v[2] == 2 && start->moved == 4 && start->changed == 0);
  check_close ("x", start->q[0], 0.5 * cos (PW_PI / 6), START_ROUND_OFF, start_reason);
  check_close ("vy", start->v[1], cos (PW_PI / 6), START_ROUND_OFF, start_reason);
  assert_true (pw_initial_specified (start, 2) && pw_initial_specified (start, 5) && !pw_initial_specified (start, 0));
  start_close (r, s);
}

/* A 0 that is meant, and x in its place: the angle follows from x = 0.5 cos phi, omega from vy = 0.5 omega cos phi. */
static void test_specified_zero (void **state) {
  pw_system *s;
  pw_run *r;
  (void)state;
  const pw_initial_report *start = start_of_rod (&s, &r, 1.5, 0, 0, 0, PW_SPECIFIES_X);
  assert_true (start->q[0] == 0 && start->changed == 0);
  check_close ("phi", start->q[2], PW_PI / 2, START_ROUND_OFF, start_reason);
  start_close (r, s);
  start = start_of_rod (&s, &r, PW_PI / 3, 0, 0, 0.75, 0);
  assert_true (start->q[2] == PW_PI / 3 && start->v[1] == 0.75 && start->changed == 0);
  check_close ("omega", start->v[2], 3, START_ROUND_OFF, start_reason);
  start_close (r, s);
}

/* More than the pin allows: as little as possible moves, and the report has what was specified; the rates stay none the less. */
static void test_specified_too_much (void **state) {
  pw_system *s;
  pw_run *r;
  (void)state;
  const pw_initial_report *start = start_of_rod (&s, &r, PW_PI / 6, 0.5, 2, 0, 0);
  assert_true (start->released == 0 && start->changed == 2 && start->v[2] == 2);
  assert_true (start->q[2] > 0.1 && start->q[2] < PW_PI / 6 && start->q[0] < 0.5);
  start_close (r, s);
}

/* What the user gives has the last word. */
static void test_given_before_specified (void **state) {
  pw_error error = { 0 };
  (void)state;
  pw_model *m = scene_model (&start_rod_table, "phi", PW_PI / 6, NULL);
  check_ok (pw_model_set_initial (m, "rod.y", 0.4, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, "rk4", NULL);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->q[1] == 0.4 && start->released == 0 && start->changed == 1);
  check_close ("phi", start->q[2], asin (0.8), START_ROUND_OFF, start_reason);
  start_close (r, s);
}

/* ---- What is given stays ---- */

static void test_held (void **state) {
  (void)state;
  static const char *const name[] = { "frame.phi", "steer.phi", "frame.vx", NULL };
  static const double value[] = { 0.3, 2, 1.5 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 0);
  assert_true (start->q[2] == 0.3 && start->q[5] == 2 && start->v[0] == 1.5);
  int moved = 0;
  for (int j = 0; j < 6; j++) moved += (start->q[j] != start->q_given[j]) + (start->v[j] != start->v_given[j]);
  assert_true (start->moved == moved && moved > 0);
  assert_true (start->q_given[3] == 0.375 && start->v_given[0] == 1.5 && start->position > 0.01 &&
               start->velocity > 0.01);
  start_close (r, s);
}

/* Everything about the frame is given, though wheel A then has nothing left to move: its row holds as it is. */
static void test_held_row (void **state) {
  (void)state;
  static const char *const name[] = { "frame.x",  "frame.y",     "frame.phi", "frame.vx",
                                      "frame.vy", "frame.omega", "steer.phi", NULL };
  static const double value[] = { 1, 2, 0, 1, 0.1, 0.2, PW_PI / 2 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 0);
  const double q[] = { 1, 2, 0, 1.5, 2.125, PW_PI / 2 }, v[] = { 1, 0.1, 0.2, 1, 0.2, 4 };
  check_bits ("frame", start->q, q, 3);
  check_bits ("frame", start->v, v, 3);
  for (int j = 3; j < 6; j++) check_close ("steer", start->q[j], q[j], 8 * CHECK_EPS, "8 eps: round-off");
  /* C does not move across its heading: vx2 = vx1 - d cos(phi2) w.. with phi2 = pi/2: vx_C = vx2 - c w2 = 0 */
  check_close ("the steering turns", start->v[5], (start->v[3]) / 0.125, 64 * CHECK_EPS, "64 eps: round-off");
  start_close (r, s);
}

/* A chain of so many links, the second of which is a little off, with a gear between the first and the third. */
static void start_chain (pw_model *m, const void *parameters) {
  static char link[16][16], pin[16][16];
  for (int i = 0; i < *(const double *)parameters; i++) {
    double off = i == 1 ? 0.05 : 0;
    snprintf (link[i], sizeof link[i], "link%d", i);
    snprintf (pin[i], sizeof pin[i], "pin%d", i);
    pw_add_body (m, &(pw_body){ .name = link[i], .mass = 1, .inertia = 0.1, .start = { i + 0.5 + off, off, 0 } });
    pw_add_pin (m, &(pw_pin){ .name = pin[i],
                              .body = { i > 0 ? link[i - 1] : "ground", link[i] },
                              .at = { { i > 0 ? 0.5 : 0, 0 }, { -0.5, 0 } } });
  }
  pw_add_gear (m, &(pw_gear){ .name = "gear", .body = { "link0", "link2", "ground" }, .ratio = 1 });
}

/* Values that leave a constraint nothing to move, and obey it, are held in scenes of any size: all of a body that is pinned
 * to the ground, and both angles of a gear. */
static void test_held_rows (void **state) {
  static const char *const name[] = { "link0.x", "link0.y", "link0.phi", "link2.phi" };
  static const double value[] = { 0.5, 0, 0, 0 };
  static const pw_parameter list[] = { { .name = "links", .value = 3 }, { .name = NULL } };
  static const pw_plugin_table table = {
    .abi = PW_ABI, .size = sizeof table, .parameters = list, .parameters_size = sizeof (double), .build = start_chain
  };
  (void)state;
  for (int links = 3; links <= 16; links++) {
    pw_error error = { 0 };
    pw_model *m = scene_model (&table, "links", (double)links, NULL);
    for (int i = 0; i < 4; i++) check_ok (pw_model_set_initial (m, name[i], value[i], &error), &error);
    pw_system *s = scene_compile (m);
    pw_run *r = runs_open (s, "rk4", NULL);
    const pw_initial_report *start = pw_run_initial (r);
    assert_true (start->released == 0 && start->moved > 0);
    check_bits ("link0", start->q, value, 3);
    assert_true (start->q[8] == 0);
    check_below ("position", runs_to (r, 0).position, START_ROUND_OFF, start_reason);
    start_close (r, s);
  }
}

/* The steering assembly, which has no mass, turns on the hinge: the frame stays where it is, to the bit. */
static void test_mass_stays (void **state) {
  (void)state;
  static const char *const name[] = { "steer.phi", NULL };
  static const double value[] = { 2 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  const double frame[3] = { 0 };
  assert_int_equal (start->released, 0);
  check_bits ("frame", start->q, frame, 3);
  assert_true (start->q[5] == 2 && start->moved == 2);
  start_close (r, s);
}

/* The same where an angle is specified, and rates that the wheel does not allow: these are changed, no position is. */
static void start_slips (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1, .rate = { 1, 0.3, 0.2 } });
  pw_add_body (m, &(pw_body){ .name = "steer", .start = { 0, 0, 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "steer" });
}

static void test_rates_yield (void **state) {
  static const pw_plugin_table table = { .abi = PW_ABI, .size = sizeof table, .build = start_slips };
  (void)state;
  pw_system *s = scene_system (&table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  const pw_initial_report *start = pw_run_initial (r);
  const double frame[3] = { 0 };
  check_bits ("frame", start->q, frame, 3);
  assert_true (start->q[5] == 2 && start->v[1] != 0.3);
  start_close (r, s);
}

/* Positions that cannot all be held do not free the rates. */
static void test_rates_stay (void **state) {
  (void)state;
  static const char *const name[] = { "frame.x", "steer.x", "steer.vy", NULL };
  static const double value[] = { 0, 5.375, 5 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 1);
  assert_true (start->v[4] == 5 && start->q[3] < 1);
  start_close (r, s);
}

/* Given values that contradict each other: all move, with a notice. */
static void test_freed (void **state) {
  (void)state;
  static const char *const name[] = { "frame.x", "frame.y", "frame.phi", "steer.x", NULL };
  static const double value[] = { 0, 0, 0, 3 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->released == 1 && start->moved > 0);
  start_close (r, s);
}

/* ---- The least change: M-orthogonal to all that the constraints allow ---- */

static void start_massive (pw_model *m, const void *parameters) {
  const double *rate = parameters;
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1, .rate = { rate[0], 0.3, rate[1] } });
  pw_add_body (
      m,
      &(pw_body){
          .name = "steer", .mass = 0.4, .inertia = 0.02, .start = { 0.375, 0, PW_PI }, .rate = { 0.1, rate[1], 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
}

static void test_least_change (void **state) {
  (void)state;
  static const pw_parameter list[] = { { .name = "vx" },
                                       { .name = "omega", .offset = sizeof (double) },
                                       { .name = NULL } };
  static const pw_plugin_table table = { .abi = PW_ABI,
                                         .size = sizeof table,
                                         .parameters = list,
                                         .parameters_size = 2 * sizeof (double),
                                         .build = start_massive };
  double v[6][6], change[6][6];
  pw_system *s = NULL;
  for (int i = 0; i < 6; i++) {
    pw_system_free (s);
    s = scene_system (&table, "vx", 1.0 + i, "omega", 0.7 - i * i, NULL);
    pw_run *r = runs_open (s, "rk4", NULL);
    memcpy (v[i], pw_run_initial (r)->v, sizeof v[i]);
    for (int j = 0; j < 6; j++) change[i][j] = v[i][j] - s->v0[j];
    pw_run_close (r);
  }
  for (int i = 1; i < 6; i++) { /* differences of consistent rates are what the constraints allow */
    double sum = 0, size = 0;
    for (int j = 0; j < 6; j++) {
      sum += (v[i][j] - v[0][j]) * s->mass[j] * change[0][j];
      size += fabs ((v[i][j] - v[0][j]) * s->mass[j] * change[0][j]);
    }
    check_close ("motion allowed . M . change", sum, 0, 64 * CHECK_EPS * (1 + size), "64 eps of the terms: round-off");
  }
  pw_system_free (s);
}

/* ---- A signal that moves a constraint ---- */

static void start_driven (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add (m, &toy_kind_drive,
          &(toy_drive){ .name = "motor",
                        .body = { "disc", "ground" },
                        .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 2, .phase = 1 } } });
}

static void test_drive (void **state) {
  (void)state;
  static const pw_plugin_table table = { .abi = PW_ABI, .size = sizeof table, .build = start_driven };
  pw_system *s = scene_system (&table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .t = 3, .span = 1 });
  const pw_initial_report *start = pw_run_initial (r);
  check_close ("angle", start->q[2], 0.5 * cos (7), 4 * CHECK_EPS, "4 eps: round-off");
  check_close ("rate", start->v[2], -sin (7), 4 * CHECK_EPS, "4 eps: round-off");
  pw_sample now = runs_to (r, 4);
  check_close ("angle", now.q[2], 0.5 * cos (9), 4 * CHECK_EPS, "projected: round-off");
  start_close (r, s);
}

/* ---- What cannot be ---- */

static void start_impossible (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = 1, .start = { 1.5, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "left", .body = { "rod", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "right", .body = { "rod", "ground" }, .at = { { 0.5, 0 }, { 3, 0 } } });
}

/* Two motors turn one disc at different rates. */
static void start_torn (pw_model *m, const void *parameters) {
  (void)parameters;
  start_driven (m, NULL);
  m->body[0].start[2] = 0.5 * cos (1);
  pw_add (m, &toy_kind_drive,
          &(toy_drive){ .name = "other",
                        .body = { "disc", "ground" },
                        .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 3, .phase = 1 } } });
}

static void start_refused (void (*build) (pw_model *, const void *), const char *text) {
  const pw_plugin_table table = { .abi = PW_ABI, .size = sizeof table, .build = build };
  pw_error error = { 0 };
  pw_system *s = scene_system (&table, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (&error, PW_INITIAL, text);
  pw_system_free (s);
}

static void test_impossible (void **state) {
  (void)state;
  start_refused (start_impossible, "model scene: the initial state cannot be made consistent: pin left is open by 1 m; if it "
                                   "can close, begin nearer to where it does");
  start_refused (start_torn,
                 "model scene: the initial state cannot be made consistent: drive other is violated by 1.26221 rad/s");
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_settings),
    cmocka_unit_test (test_bad_settings),
    cmocka_unit_test (test_no_harm),
    cmocka_unit_test (test_little),
    cmocka_unit_test (test_round_off),
    cmocka_unit_test (test_no_harm_on_the_way),
    cmocka_unit_test (test_specified),
    cmocka_unit_test (test_specified_zero),
    cmocka_unit_test (test_specified_too_much),
    cmocka_unit_test (test_given_before_specified),
    cmocka_unit_test (test_held),
    cmocka_unit_test (test_held_row),
    cmocka_unit_test (test_held_rows),
    cmocka_unit_test (test_freed),
    cmocka_unit_test (test_mass_stays),
    cmocka_unit_test (test_rates_yield),
    cmocka_unit_test (test_rates_stay),
    cmocka_unit_test (test_least_change),
    cmocka_unit_test (test_drive),
    cmocka_unit_test (test_impossible),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
