/* Singular poses are passed or told; wheels that lock hold still; what contradicts itself is named. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"
#include "turns.h"

/* ---- Through singular poses ---- */

/* Two four-bar linkages: all cranks pass through the horizontal ten times in 10 s. */
static void test_four_bar (void **state) {
  (void)state;
  pw_system *s = scene_named ("n-four-bar", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 });
  int passes = 0;
  double energy = 0, balance = 0, start = NAN, before = 1;
  pw_error error = { 0 };
  while (pw_time (r) < 10) {
    check_ok (pw_advance (r, 10, &error), &error);
    pw_sample x = runs_to (r, pw_time (r));
    if (isnan (start)) start = x.kinetic + x.potential;
    energy = fmax (energy, fabs (x.kinetic + x.potential - start));
    balance = fmax (balance, fabs (x.balance));
    passes += before * x.q[1] < 0;
    before = x.q[1];
  }
  assert_int_equal (passes, 10);
  pw_sample x = runs_to (r, 10);
  double c = cos (x.q[2]), n = sin (x.q[2]), w = x.v[2];
  check_close ("x", c, 0.3284581115408153787, 1e-9, "published digits");
  check_close ("y", n, 0.9445185381786009622, 1e-9, "published digits");
  check_close ("vx", -n * w, 1.423051470206944123, 1e-9, "published digits");
  check_close ("vy", c * w, -0.4948688454870429590, 1e-9, "published digits");
  check_below ("energy, worst of the run", energy, 1e-9, "kept over ten passes");
  check_close ("balance at the end", x.balance, 0, 1e-9, "kept over ten passes");
  /* between passes the balance swings by 1.01e-9 J, which falls with the fourth power of the step: relative to 36 J */
  check_below ("balance, worst of the run", balance, 1e-9 * start, "kept over ten passes, of the energy there is");
  assert_true (pw_run_statistics (r)->rejected > 0);
  pw_close (r);
  pw_free (s);
}

/* Steps that end on a singular pose are passed by a longer one, however small they are. */
static void test_steps_on_it (void **state) {
  static const struct { double cranks, step, t; } steps[] = { { 2, 7.7e-4, 10 }, { 5, 1e-4, 1 }, { 40, 3.1e-4, 1.5 } };
  (void)state;
  for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
    double t = steps[i].t, most = 0, before = NAN;
    pw_system *s = scene_named ("n-four-bar", "N", steps[i].cranks);
    pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = steps[i].step, .span = t, .ledger = 1 });
    for (int k = 1; k <= 10; k++) {
      pw_sample x = runs_to (r, t * k / 10);
      most = fmax (most, fabs (x.balance));
      before = x.kinetic + x.potential;
    }
    check_below ("balance", most, 1e-8 * before, "kept over the passes, of the energy there is");
    assert_true ((double)pw_run_statistics (r)->steps < 1.01 * t / steps[i].step);
    pw_close (r);
    pw_free (s);
  }
}

static void test_slider_crank (void **state) {
  static const char *const method[] = { "rk4+projection", "rk4+projection:metric=identity", "rk4+none", "rk4+baumgarte",
                                        "rk4+nullspace" };
  (void)state;
  for (int i = 0; i < 5; i++) {
    pw_system *s = scene_named ("slider-crank", NULL, 0);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .span = 1, .ledger = 1 });
    pw_sample x = runs_to (r, 1);
    check_close (method[i], trial_state (s, &x, "crank.phi"), 2.428234829106999646, 1e-9, "published digits");
    check_close ("balance", x.balance, 0, 1e-9, "energy is kept");
    pw_close (r);
    pw_free (s);
  }
}

/* An adaptive method passes, or stops with its reason: it never ends well with a wrong answer. */
static void singular_or_told (const char *model, const char *method, double rtol, const char *name, double t,
                              double exact, double period) {
  pw_error error = { 0 };
  pw_sample x;
  char what[80];
  pw_system *s = scene_named (model, NULL, 0);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .span = t });
  int status = pw_advance_to (r, t, t, &error);
  snprintf (what, sizeof what, "%s, rtol %g", model, rtol);
  if (status == PW_OK) {
    check_ok (pw_at (r, t, &x, &error), &error);
    double off = remainder (trial_state (s, &x, name) - exact, period);
    check_below (what, fabs (off), 1e5 * rtol, "1e4 rtol, and 10 for the passes");
  } else {
    print_message ("%s: %s\n", what, error.text);
    assert_int_equal (status, PW_METHOD);
    assert_true (strlen (error.text) > 20);
  }
  pw_close (r);
  pw_free (s);
}

/* All of these ended with status ok on another branch before drifted constraints were watched. */
static void test_turned (void **state) {
  static const struct {
    const char *method;
    double cranks, rtol;
  } turns[] = {
    { "bdf+none", 1, 1e-5 },      { "bdf+none", 2, 1e-5 },   { "bdf+none", 1, 1e-7 },  { "bdf+baumgarte", 1, 3e-5 },
    { "bdf+baumgarte", 2, 1e-5 }, { "adams+none", 2, 1e-5 }, { "ida+none", 1, 1e-5 },  { "ida+baumgarte", 1, 3e-4 },
    { "ida+index2", 1, 1e-4 },    { "erk8+none", 1, 1e-5 },  { "erk8+none", 2, 3e-5 }, { "erk5+none", 1, 3e-4 },
  };
  int told = 0, count = sizeof turns / sizeof *turns;
  (void)state;
  for (int i = 0; i < count; i++) told += turns_try (turns[i].method, turns[i].rtol, "n-four-bar", turns[i].cranks);
  assert_true (2 * told > count);
}

static void test_ida (void **state) {
  static const double rtol[] = { 1e-6, 1e-8 };
  (void)state;
  for (int i = 0; i < 2; i++) {
    double four = atan2 (0.9445185381786009622, 0.3284581115408153787);
    singular_or_told ("n-four-bar", "ida+ggl", rtol[i], "crank0.phi", 10, four, 2 * PW_PI);
    singular_or_told ("slider-crank", "ida+ggl", rtol[i], "crank.phi", 1, 2.428234829106999646, 2 * PW_PI);
  }
}

/* A four-bar linkage that starts flat could open two ways. */
static void singular_flat (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m,
               &(pw_body){ .name = "left", .mass = 1, .inertia = 0.1, .start = { 0.5, 0, 0 }, .rate = { 0, 0.5, 1 } });
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = 0.1, .start = { 1.5, 0, 0 }, .rate = { 0, 1, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "right", .mass = 1, .inertia = 0.1, .start = { 1.5, 0, 0 }, .rate = { 0, 0.5, 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "left", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "left", "rod" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "rod", "right" }, .at = { { 0.5, 0 }, { 0.5, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "D", .body = { "right", "ground" }, .at = { { -0.5, 0 }, { 1, 0 } } });
}

static void test_flat_start (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (singular_flat);
  (void)state;
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&table, NULL);
    assert_null (pw_open (s, method[i], NULL, &error));
    check_error (&error, PW_START,
                 "model scene: the start is a singular pose: 7 constraint rows are independent there, 8 nearby; start "
                 "a little off it");
    pw_free (s);
  }
}

/* ---- Put into one ---- */

typedef struct {
  double angle;
} singular_angle;

static const pw_parameter singular_angle_list[] = {
  { PW_AT (singular_angle, angle), 1, "rad", "of the cranks", PW_REAL },
  { .name = NULL },
};

/* A parallelogram of bars 1 m long. */
static void singular_rhombus (pw_model *m, const void *parameter) {
  const singular_angle *p = parameter;
  double c = cos (p->angle), n = sin (p->angle);
  pw_add_body (m, &(pw_body){ .name = "left", .mass = 1, .inertia = 0.1, .start = { 0.5 * c, 0.5 * n, p->angle } });
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = 0.1, .start = { 0.5 + c, n, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "right", .mass = 1, .inertia = 0.1, .start = { 1 + 0.5 * c, 0.5 * n, p->angle } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "left", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "left", "rod" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "rod", "right" }, .at = { { 0.5, 0 }, { 0.5, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "D", .body = { "right", "ground" }, .at = { { -0.5, 0 }, { 1, 0 } } });
}

/* A run that is put into a singular pose says so, with the name of a pin, and goes on from where it was. */
static void test_restarted_in (void **state) {
  static const pw_plugin_table table = { .abi = PW_ABI,
                                         .size = sizeof (pw_plugin_table),
                                         .parameters = singular_angle_list,
                                         .parameters_size = sizeof (singular_angle),
                                         .build = singular_rhombus };
  static const double flat[9] = { 0.5, 0, 0, 1.5, 0, 0, 1.5, 0, 0 }, rest[9] = { 0 };
  static const char *const method[] = { "rk4+projection", "galpha+ggl", "bdf+projection" };
  (void)state;
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    char pin = 0;
    pw_system *s = scene_system (&table, NULL);
    pw_run *r = runs_open (s, method[i], NULL);
    double start[9];
    memcpy (start, pw_run_start (r)->q, sizeof start);
    assert_int_equal (pw_restart (r, flat, rest, &error), PW_METHOD);
    assert_int_equal (
        sscanf (error.text, "t = 0 s: singular pose: pin %c says what other constraints say already", &pin), 1);
    assert_true (pin >= 'A' && pin <= 'D');
    pw_sample now = runs_to (r, 0.01);
    for (int j = 0; j < 9; j++) check_close ("it has hardly moved", now.q[j], start[j], 0.1, "from rest, in 10 ms");
    pw_close (r);
    pw_free (s);
  }
}

/* ---- Wheels that lock a body ---- */

typedef struct {
  double wheels, speed, torque;
} singular_cart;

static const pw_parameter singular_cart_list[] = {
  { PW_AT (singular_cart, wheels), 3, "", "wheels, no two of which roll alike", PW_COUNT },
  { PW_AT (singular_cart, speed), 0, "m/s", "at the start", PW_REAL },
  { PW_AT (singular_cart, torque), 2, "N m", "on the body", PW_REAL },
  { .name = NULL },
};

static void singular_locked (pw_model *m, const void *parameter) {
  static const char *const name[] = { "front", "left", "right", "rear" };
  static const double at[][3] = { { 0.5, 0, 0.3 }, { 0, 0.4, -0.2 }, { 0, -0.4, 0.1 }, { -0.5, 0.1, 0.7 } };
  const singular_cart *p = parameter;
  pw_add_body (
      m, &(pw_body){ .name = "cart", .mass = 3, .inertia = 0.2, .start = { 1, 2, 0.3 }, .rate = { p->speed, 0, 0 } });
  for (int i = 0; i < (int)p->wheels; i++)
    pw_add_wheel (m, &(pw_wheel){ .name = name[i], .body = "cart", .at = { at[i][0], at[i][1] }, .heading = at[i][2] });
  pw_add_torque (m, &(pw_torque){ .name = "push", .body = { "cart", "ground" }, .value = { .constant = p->torque } });
}

static const pw_plugin_table singular_cart_table = { .abi = PW_ABI,
                                                     .size = sizeof (pw_plugin_table),
                                                     .parameters = singular_cart_list,
                                                     .parameters_size = sizeof (singular_cart),
                                                     .build = singular_locked };

/* It stays where it is, to the bit, whatever pushes it. */
static void test_locked (void **state) {
  static const char *const method[] = {
    "rk4+none",       "rk4+baumgarte", "rk4+projection", "rk4+projection:metric=identity",
    "ida+none",       "ida+baumgarte", "ida+ggl",        "ida+index2",
    "ida+si1",        "adams+none",    "bdf+none",       "bdf+baumgarte",
    "bdf+projection", "rk4+nullspace", "galpha+index3",  "galpha+ggl",
    "leapfrog"
  };
  (void)state;
  for (int wheels = 3; wheels <= 4; wheels++)
    for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
      pw_system *s = scene_system (&singular_cart_table, "wheels", (double)wheels, NULL);
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .rtol = 1e-8, .span = 2 });
      assert_int_equal (pw_run_redundant (r), wheels - 3);
      pw_sample x = runs_to (r, 2);
      const double q[] = { 1, 2, 0.3 };
      for (int j = 0; j < 3; j++) {
        check_close (method[i], x.q[j], q[j], 16 * CHECK_EPS, "at rest");
        check_close (method[i], x.v[j], 0, 16 * CHECK_EPS, "at rest");
      }
      pw_close (r);
      pw_free (s);
    }
}

static void test_locked_start (void **state) {
  (void)state;
  for (int wheels = 3; wheels <= 4; wheels++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&singular_cart_table, "wheels", (double)wheels, "speed", 1.5, NULL);
    assert_null (pw_open (s, "rk4+projection", NULL, &error));
    check_error (&error, PW_START,
                 wheels == 3
                     ? "model scene: the given rates would have to be removed entirely: wheel front, wheel left, "
                       "wheel right allow no such motion"
                     : "model scene: the given rates would have to be removed entirely: wheel front, wheel left, "
                       "wheel right, wheel rear allow no such motion");
    pw_free (s);
  }
}

/* Three axles that meet in one point at the start, until the third wheel is steered away. */
static int singular_steer (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = 0.5 * t * t;
  value[1] = t;
  value[2] = 1;
  return 0;
}

static void singular_steered (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 3, .inertia = 0.2, .rate = { 1, 0, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "fork", .mass = 0.2, .inertia = 0.01, .start = { 0.5, 0, 0 }, .rate = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "head", .body = { "cart", "fork" }, .at = { { 0.5, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "steering",
                                .body = { "fork", "cart" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_FUNCTION, .function = { .eval = singular_steer } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "middle", .body = "cart" });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "cart", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "fork" });
}

/* A locking that arises on the way stops the run and names a wheel. */
static void test_locks_in_motion (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (singular_steered);
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte",  "rk4+none",      "ida+baumgarte",
                                        "ida+ggl",        "rk4+nullspace",  "galpha+index3", "galpha+ggl",
                                        "adams+none",     "ida+si1",        "ida+index2",    "adams+baumgarte",
                                        "bdf+baumgarte",  "bdf+projection", "leapfrog" };
  (void)state;
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&table, NULL);
    pw_run *r = pw_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 1 }, &error);
    int status = r ? pw_advance_to (r, 1, 1, &error) : error.status;
    print_message ("%s: %s\n", method[i], error.text);
    assert_true (status == PW_METHOD || status == PW_START);
    assert_non_null (strstr (error.text, "wheel "));
    /* the heading is t^2 / 2: within 20 steps of 1e-3 s, or when it is above what the tolerance leaves of the others */
    if (r) check_below ("time", pw_time (r), 0.05, "told at once");
    if (r) pw_close (r);
    pw_free (s);
  }
}

/* ---- What contradicts itself ---- */

/* Two bodies hang from pivots 10 m apart, and are to be welded at their ends, 1 m from each. */
static void singular_gap (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "left", .mass = 1, .inertia = 0.1, .start = { 0.5, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "right", .mass = 1, .inertia = 0.1, .start = { 9.5, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "left", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "right", "ground" }, .at = { { 0.5, 0 }, { 10, 0 } } });
  pw_add_weld (m, &(pw_weld){ .name = "joint", .body = { "left", "right" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
}

static void test_gap (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (singular_gap);
  (void)state;
  pw_error error = { 0 };
  double open = 0;
  pw_system *s = scene_system (&table, NULL);
  assert_null (pw_open (s, "rk4+projection", NULL, &error));
  print_message ("%s\n", error.text);
  assert_int_equal (error.status, PW_START);
  const char *by = strstr (error.text, " is open by ");
  assert_non_null (by);
  assert_true (sscanf (by, " is open by %lf", &open) == 1 && open > 1 && open < 10);
  pw_free (s);
}

typedef struct {
  double offset;
} singular_offset;

static const pw_parameter singular_offset_list[] = {
  { PW_AT (singular_offset, offset), 0, "rad", "of the second drive at the start", PW_REAL },
  { .name = NULL },
};

/* Two drives turn one body; the second one would like another angle. */
static void singular_drives (pw_model *m, const void *parameter) {
  const singular_offset *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 0.1 });
  pw_add_pin (m, &(pw_pin){ .name = "hub", .body = { "disc", "ground" } });
  pw_add_drive (m, &(pw_drive){ .name = "one", .body = { "disc", "ground" }, .what = PW_DRIVE_ANGLE });
  pw_signal other = { .constant = p->offset };
  if (p->offset == 0) other = (pw_signal){ PW_FUNCTION, .function = { .eval = singular_steer } };
  pw_add_drive (m, &(pw_drive){ .name = "two", .body = { "disc", "ground" }, .what = PW_DRIVE_ANGLE, .value = other });
}

static const pw_plugin_table singular_drives_table = { .abi = PW_ABI,
                                                       .size = sizeof (pw_plugin_table),
                                                       .parameters = singular_offset_list,
                                                       .parameters_size = sizeof (singular_offset),
                                                       .build = singular_drives };

static void test_drives (void **state) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte",   "ida+ggl",    "ida+baumgarte",
                                        "rk4+nullspace",  "galpha+index3",   "galpha+ggl", "ida+si1",
                                        "bdf+projection", "adams+baumgarte", "leapfrog" };
  (void)state;
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&singular_drives_table, "offset", 0.1, NULL);
    assert_null (pw_open (s, method[i], NULL, &error));
    print_message ("%s\n", error.text);
    assert_int_equal (error.status, PW_START);
    assert_non_null (strstr (error.text, "drive "));
    pw_free (s);
    error = (pw_error){ 0 };
    s = scene_system (&singular_drives_table, NULL);
    pw_run *r = pw_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-6, .span = 1 }, &error);
    int status = r ? pw_advance_to (r, 1, 1, &error) : error.status;
    print_message ("%s\n", error.text);
    assert_true (status == PW_METHOD || status == PW_START);
    assert_non_null (strstr (error.text, "drive "));
    if (r) pw_close (r);
    pw_free (s);
  }
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_four_bar),     cmocka_unit_test (test_slider_crank),    cmocka_unit_test (test_ida),
    cmocka_unit_test (test_flat_start),   cmocka_unit_test (test_restarted_in),    cmocka_unit_test (test_locked),
    cmocka_unit_test (test_locked_start), cmocka_unit_test (test_locks_in_motion), cmocka_unit_test (test_gap),
    cmocka_unit_test (test_drives),       cmocka_unit_test (test_steps_on_it),     cmocka_unit_test (test_turned),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
