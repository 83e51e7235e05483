/* Singular configurations: runs pass them or stop with a message. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "scene.h"
#include "trial.h"
#include "turns.h"

/* ---- Passing singular configurations ---- */

/* Two four-bar linkages; all cranks pass the horizontal ten times in 10 s. */
TEST (four_bar) {
  pw_system *s = scene_named ("n-four-bar", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 });
  int passes = 0;
  double energy = 0, balance = 0, start = NAN, before = 1;
  pw_error error = { 0 };
  while (pw_run_time (r) < 10) {
    check_ok (pw_run_advance (r, 10, &error), &error);
    pw_sample x = runs_to (r, pw_run_time (r));
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
  /* between passes the energy defect oscillates by 1.01e-9 J, of order h^4: relative to 36 J */
  check_below ("balance, worst of the run", balance, 1e-9 * start, "kept over ten passes, relative to the energy");
  assert_true (pw_run_statistics (r)->rejected > 0);
  runs_close (r, s);
}

/* A step that would end at a singular configuration is replaced by a longer one, for all step sizes. */
TEST (steps_ending_there) {
  static const struct {
    double cranks, step, t;
    int parts; /* number of samples */
  } steps[] = { { 2, 7.75e-4, 10, 10 }, { 2, 7.842e-4, 10, 1 }, { 5, 1e-4, 1, 10 }, { 40, 3.1e-4, 1.5, 10 } };
  for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
    double t = steps[i].t, most = 0, before = NAN;
    pw_system *s = scene_named ("n-four-bar", "N", steps[i].cranks);
    pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = steps[i].step, .span = t, .ledger = 1 });
    for (int k = 1; k <= steps[i].parts; k++) {
      pw_sample x = runs_to (r, t * k / steps[i].parts);
      most = fmax (most, fabs (x.balance));
      before = x.kinetic + x.potential;
    }
    check_below ("balance", most, 1e-8 * before, "kept over the passes, relative to the energy");
    assert_true ((double)pw_run_statistics (r)->steps < 1.01 * t / steps[i].step);
    runs_close (r, s);
  }
}

/* The same by implicit methods: these steps end at a singular configuration at 1.2, 2.7, 3.2, 5.1 or 6.5 s. */
TEST (implicit_steps_ending_there) {
  static const struct {
    const char *method;
    double step;
  } steps[] = { { "galpha+ggl", 7.6e-4 },     { "galpha+ggl", 7.606666666666667e-4 },
                { "galpha+index3", 7.62e-4 }, { "galpha+index3", 7.66333333333e-4 },
                { "leapfrog", 7.7e-4 },       { "leapfrog", 7.71e-4 } };
  double four = atan2 (0.9445185381786009622, 0.3284581115408153787);
  for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
    pw_system *s = scene_named ("n-four-bar", NULL, 0);
    pw_run *r = runs_open (s, steps[i].method, &(pw_settings){ .step = steps[i].step, .span = 10 });
    pw_sample x = runs_to (r, 10);
    check_close (steps[i].method, remainder (trial_state (s, &x, "crank0.phi") - four, 2 * PW_PI), 0, 1e-4,
                 "published digits; of order 2: an error of 3e-5 at neighbouring steps");
    runs_close (r, s);
  }
}

/* Stops at the second call. */
static int singular_stop (void *calls) {
  return ++*(int *)calls == 2;
}

/* Before each further attempt at such a step a stop is possible; the step is then made by the next call. */
TEST (stopped_attempts) {
  static const char *const method[] = { "galpha+index3", "leapfrog" };
  static const double step[] = { 7.66333333333e-4, 7.7e-4 };
  for (int i = 0; i < 2; i++) {
    int calls = 0, status = PW_OK;
    pw_error error = { 0 };
    pw_system *s = scene_named ("n-four-bar", NULL, 0);
    pw_run *r = runs_open (
        s, method[i], &(pw_settings){ .step = step[i], .span = 10, .stop = singular_stop, .stop_context = &calls });
    for (; status == PW_OK && pw_run_time (r) < 10; calls = 0) status = pw_run_advance (r, 10, &error);
    assert_int_equal (status, PW_STOPPED);
    const double stopped = pw_run_time (r);
    calls = 2;
    error = (pw_error){ 0 };
    check_ok (pw_run_advance (r, 10, &error), &error);
    assert_true (pw_run_time (r) > stopped);
    runs_close (r, s);
  }
}

TEST (slider_crank) {
  static const char *const method[] = { "rk4+projection", "rk4+projection:metric=identity", "rk4+none", "rk4+baumgarte",
                                        "rk4+nullspace" };
  for (int i = 0; i < 5; i++) {
    pw_system *s = scene_named ("slider-crank", NULL, 0);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .span = 1, .ledger = 1 });
    pw_sample x = runs_to (r, 1);
    check_close (method[i], trial_state (s, &x, "crank.phi"), 2.428234829106999646, 1e-9, "published digits");
    check_close ("balance", x.balance, 0, 1e-9, "energy is kept");
    runs_close (r, s);
  }
}

/* Where the crank starts near the vertical or beyond it, the rod has the opposite angle and angular velocity; the angle
 * of the crank follows from the kinetic energy. */
TEST (slider_crank_start) {
  static const double theta[] = { 1.57079, 1.5708, 2, 4, -2 };
  for (size_t i = 0; i < sizeof theta / sizeof *theta; i++) {
    pw_system *s = scene_named ("slider-crank", "theta", theta[i]);
    pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 0.3, .ledger = 1 });
    for (int k = 0; k < 2; k++) {
      pw_sample x = runs_to (r, 0.3 * k);
      double phi = trial_state (s, &x, "crank.phi"), omega = trial_state (s, &x, "crank.omega");
      double inertia = 5. / 12 + 2.25 * pow (sin (phi), 2) + 0.25 * pow (cos (phi), 2) + 4 * pow (sin (phi), 2);
      check_close ("rod.phi", trial_state (s, &x, "rod.phi"), -phi, 1e-9, "an isosceles triangle");
      check_close ("rod.omega", trial_state (s, &x, "rod.omega"), -omega, 1e-9, "an isosceles triangle");
      check_close ("kinetic energy", x.kinetic, inertia * omega * omega / 2, 1e-8, "relative to 14 J");
    }
    check_close ("balance", runs_to (r, 0.3).balance, 0, 1e-8, "energy is kept");
    runs_close (r, s);
  }
}

/* An adaptive method passes or stops with a message; it never ends with status ok and a wrong result. */
static void singular_passes_or_stops (const char *model, const char *method, double rtol, const char *name, double t,
                                      double exact, double period) {
  pw_error error = { 0 };
  pw_sample x;
  char what[80];
  pw_system *s = scene_named (model, NULL, 0);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .span = t });
  int status = pw_run_advance_to (r, t, t, &error);
  snprintf (what, sizeof what, "%s, rtol %g", model, rtol);
  if (status == PW_OK) {
    check_ok (pw_run_sample (r, t, &x, &error), &error);
    double off = remainder (trial_state (s, &x, name) - exact, period);
    check_below (what, fabs (off), 1e5 * rtol, "1e4 rtol, and 10 for the passes");
  } else {
    print_message ("%s: %s\n", what, error.text);
    assert_int_equal (status, PW_METHOD);
    assert_true (strlen (error.text) > 20);
  }
  runs_close (r, s);
}

/* Without the watchdog's criteria for drift, all of these end on another branch with status ok. */
TEST (turned) {
  static const struct {
    const char *method;
    double cranks, rtol;
  } turns[] = {
    { "bdf+none", 1, 1e-5 },      { "bdf+none", 2, 1e-5 },   { "bdf+none", 1, 1e-7 },  { "bdf+baumgarte", 1, 3e-5 },
    { "bdf+baumgarte", 2, 1e-5 }, { "adams+none", 2, 1e-5 }, { "ida+none", 1, 1e-5 },  { "ida+baumgarte", 1, 3e-4 },
    { "ida+index2", 1, 1e-4 },    { "erk8+none", 1, 1e-5 },  { "erk8+none", 2, 3e-5 }, { "erk5+none", 1, 3e-4 },
  };
  int reported = 0, count = sizeof turns / sizeof *turns;
  for (int i = 0; i < count; i++) reported += turns_try (turns[i].method, turns[i].rtol, "n-four-bar", turns[i].cranks);
  assert_true (2 * reported > count);
}

TEST (ida) {
  static const double rtol[] = { 1e-6, 1e-8 };
  for (int i = 0; i < 2; i++) {
    double four = atan2 (0.9445185381786009622, 0.3284581115408153787);
    singular_passes_or_stops ("n-four-bar", "ida+ggl", rtol[i], "crank0.phi", 10, four, 2 * PW_PI);
    singular_passes_or_stops ("slider-crank", "ida+ggl", rtol[i], "crank.phi", 1, 2.428234829106999646, 2 * PW_PI);
  }
}

/* A four-bar linkage that is initially flat has two branches. */
SCENE (singular_flat) {
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

/* A platform between sliders on parallel rails, `offset` apart, at `angle`; the line of its pins is at `phi`. */
typedef struct {
  double angle, phi, offset, length, sliders, sketch;
} rails;

static const pw_parameter rails_list[] = {
  { PW_AT (rails, angle), 0, "rad", "of the rails", PW_REAL },
  { PW_AT (rails, phi), PW_PI / 2, "rad", "of the line of the pins, from the rails", PW_REAL },
  { PW_AT (rails, offset), 1, "m", "between the outer rails", PW_NONNEGATIVE },
  { PW_AT (rails, length), 1, "m", "between the outer pins", PW_POSITIVE },
  { PW_AT (rails, sliders), 2, "", "number of sliders", PW_COUNT },
  { PW_AT (rails, sketch), 0, "rad", "by which the angle of the platform is wrong", PW_REAL },
  { .name = NULL },
};

SCENE_WITH (rails_scene, rails_list, rails) {
  static const char *const slider[] = { "s0", "s1", "s2" }, *const rail[] = { "R0", "R1", "R2" },
                           *const pin[] = { "P0", "P1", "P2" };
  double c = cos (p->angle), s = sin (p->angle), phi = p->angle + p->phi;
  pw_add_body (m, &(pw_body){ .name = "platform",
                              .mass = 2,
                              .inertia = 0.3,
                              .start = { -s * p->offset / 2, c * p->offset / 2, phi + p->sketch },
                              .rate = { c, s, 0 } });
  for (int i = 0; i < (int)p->sliders; i++) {
    double part = i / (p->sliders - 1), at = (part - 0.5) * p->length, height = part * p->offset;
    pw_add_body (m, &(pw_body){ .name = slider[i],
                                .mass = 0.2,
                                .inertia = 0.01,
                                .start = { -s * p->offset / 2 + at * cos (phi), c * p->offset / 2 + at * sin (phi),
                                           p->angle } });
    pw_add_slider (m, &(pw_slider){ .name = rail[i],
                                    .body = { slider[i], "ground" },
                                    .at = { { 0, 0 }, { -s * height, c * height } },
                                    .heading = p->angle,
                                    .angle = p->angle });
    pw_add_pin (m, &(pw_pin){ .name = pin[i], .body = { "platform", slider[i] }, .at = { { at, 0 }, { 0, 0 } } });
  }
}

/* Perpendicular to the rails, the platform cannot turn, but only the square of its angle enters the equations: a run
 * is refused, with the equation and the remedy; otherwise it moves along the rails. */
TEST (rails) {
  static const double angle[] = { 0, 0.3, PW_PI / 2, 2, -2.7 }, sketch[] = { 0, 0.05, 1e-3 };
  for (int i = 0; i < 5; i++)
    for (int sliders = 2; sliders <= 3; sliders++) {
      for (int k = 0; k < (sliders == 2 ? 3 : 1); k++) {
        pw_error error = { 0 };
        pw_system *s =
            scene_system (&rails_scene_table, "angle", angle[i], "sliders", (double)sliders, "sketch", sketch[k], NULL);
        assert_null (pw_run_open (s, "rk4+projection", NULL, &error));
        assert_int_equal (error.status, PW_INITIAL);
        assert_non_null (strstr (error.text, "model scene: the initial configuration is singular: pin P"));
        assert_non_null (strstr (error.text, " follows from slider R0"));
        assert_non_null (strstr (error.text, ", but forbids a change of platform.phi, which nothing else prevents; "
                                             "prevent it by another element (a weld in place of a pin), or "));
        pw_system_free (s);
      }
      pw_system *s = scene_system (&rails_scene_table, "angle", angle[i], "sliders", (double)sliders, "phi", PW_PI / 6,
                                   "length", 2., NULL);
      pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01, .span = 1 });
      pw_sample x = runs_to (r, 1);
      check_close ("x", x.q[0], -sin (angle[i]) / 2 + cos (angle[i]), 1e-9, "uniform motion");
      check_close ("y", x.q[1], cos (angle[i]) / 2 + sin (angle[i]), 1e-9, "uniform motion");
      assert_int_equal (pw_run_redundant (r), sliders - 2);
      runs_close (r, s);
    }
}

TEST (flat_start) {
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&singular_flat_table, NULL);
    assert_null (pw_run_open (s, method[i], NULL, &error));
    check_error (
        &error, PW_INITIAL,
        "model scene: the initial configuration is singular: pin B (B.Fx) follows from pin A, pin C, pin D, but not "
        "nearby; begin slightly off it");
    pw_system_free (s);
  }
}

/* ---- Restarts in a singular configuration ---- */

typedef struct {
  double angle;
} singular_angle;

static const pw_parameter singular_angle_list[] = {
  { PW_AT (singular_angle, angle), 1, "rad", "of the cranks", PW_REAL },
  { .name = NULL },
};

/* A parallelogram of bars of 1 m. */
SCENE_WITH (singular_rhombus, singular_angle_list, singular_angle) {
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

/* A restart in a singular configuration is refused with the name of a pin; the run continues from its former state. */
TEST (restart_there) {
  static const double flat[9] = { 0.5, 0, 0, 1.5, 0, 0, 1.5, 0, 0 }, rest[9] = { 0 };
  static const char *const method[] = { "rk4+projection", "galpha+ggl", "bdf+projection" };
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    char pin = 0;
    pw_system *s = scene_system (&singular_rhombus_table, NULL);
    pw_run *r = runs_open (s, method[i], NULL);
    double start[9];
    memcpy (start, pw_run_initial (r)->q, sizeof start);
    assert_int_equal (pw_run_restart (r, flat, rest, &error), PW_METHOD);
    assert_int_equal (sscanf (error.text, "t = 0 s: singular configuration: pin %c depends on other constraints", &pin),
                      1);
    assert_true (pin >= 'A' && pin <= 'D');
    pw_sample now = runs_to (r, 0.01);
    for (int j = 0; j < 9; j++)
      check_close ("displacement after restart", now.q[j], start[j], 0.1, "from rest, in 10 ms");
    runs_close (r, s);
  }
}

/* After a restart, the reference level of accelerations is that of the new state: a linkage accelerated just before a
 * singular configuration passes it like one that arrives at the same speed. */
TEST (accelerated_by_restart) {
  static const char *const method[] = { "rk4", "leapfrog", "galpha+index3" };
  const double slow = 1.4908, fast = 40, end = 1.5; /* 0.08 rad before it: a step of 2 ms at 40 rad/s */
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    double v[15];
    pw_system *s = scene_named ("n-four-bar", "g", 0);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 2e-3, .span = 2 });
    pw_sample x = runs_to (r, slow);
    for (int j = 0; j < 15; j++) v[j] = fast * x.v[j];
    check_ok (pw_run_restart (r, NULL, v, &error), &error);
    x = runs_to (r, end);
    check_close ("angle", x.q[2], PW_PI / 2 - slow - fast * (end - slow), 1e-3,
                 "(0.08 rad)^3 of the methods of order 2");
    runs_close (r, s);
  }
}

/* A norm is NaN if any entry is NaN. */
TEST (nan) {
  pw_system *s = scene_named ("n-four-bar", NULL, 0);
  pw_run *r = runs_open (s, "rk4", NULL);
  for (int j = 0; j < s->coords; j++) {
    double q = r->q[j], v = r->v[j], a = r->a[j];
    pw_error error = { 0 };
    pw_residuals now;
    r->near_singular = 1;
    check_ok (pw_run_watchdog (r, &error), &error);
    r->a[j] = NAN;
    assert_int_equal (pw_run_watchdog (r, &error), PW_METHOD);
    r->a[j] = a, r->q[j] = NAN, r->v[j] = NAN;
    assert_int_equal (pw_update_kinematics (r->w, 0, r->q, r->v), PW_OK);
    pw_evaluate_J (r->w);
    pw_evaluate_residuals (r->w, NULL, &now);
    assert_true (isnan (now.position) && isnan (now.velocity));
    r->q[j] = q, r->v[j] = v;
    assert_int_equal (pw_update_kinematics (r->w, 0, r->q, r->v), PW_OK);
    pw_evaluate_J (r->w);
  }
  runs_close (r, s);
}
