/* Outputs of models: their values as columns, functionals of them against closed forms, in signals; the time at which a
 * condition becomes true. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "outcome.h"

/* A point thrown upwards: y = 10 t - 5 t^2; a block driven by a signal that is an output, x = cos (2 t). */
static const char model[] = "pinwheel: 1\n"
                            "outputs:\n"
                            "  - {name: twice, value: 2*height, unit: m}\n"
                            "  - {name: height, value: ball.y, unit: m, about: above the ground}\n"
                            "  - {name: pull, value: -4*tip.x}\n"
                            "  - {name: normal, value: 'abs (S.N)', unit: N}\n"
                            "  - {name: energy, value: kinetic + potential - work, unit: J}\n"
                            "bodies:\n"
                            "  - {name: ball, mass: 1, inertia: 1, rate: {vx: 1, vy: 10}}\n"
                            "  - {name: block, mass: 1, inertia: 1, start: {x: 1}}\n"
                            "elements:\n"
                            "  - {marker: tip, body: block, at: [0, 0.3]}\n"
                            "  - {slider: S, body: [block, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {force: F, body: block, at: [0, 0], fx: pull, fy: 0}\n"
                            "  - {gravity: g, acceleration: [0, -10]}\n";

static gallery_scene scene;

static int outputs_setup (void) {
  if (cli_setup () != 0) return 1;
  cli_write ("outputs.yaml", model);
  scene = gallery_load (cli_path ("outputs.yaml"), NULL);
  return 0;
}

static int outputs_teardown (void) {
  gallery_close (&scene);
  return cli_teardown ();
}

static void outputs_near (double value, double expected, double bound) {
  if (!(fabs (value - expected) <= bound)) fail_msg ("%.17g, expected %.17g", value, expected);
}

static double outputs_value (const char *text, const char *method, double t_end) {
  pw_outcomes x;
  pw_error error = { 0 };
  check_ok (pw_outcomes_open (&x, scene.system, "--of", &text, 1, &error), &error);
  pw_settings settings = { .step = 1e-3, .rtol = 1e-10, .span = t_end, .ledger = x.ledger };
  check_ok (pw_outcomes_run (&x, method, &settings, t_end, NULL, &error), &error);
  double value = pw_outcome_value (&x, 0);
  pw_outcomes_close (&x);
  return value;
}

TEST (values) {
  static const char *const methods[] = { "rk4", "erk8", "bdf", "ida", "radau" };
  const struct {
    const char *text;
    double value;
  } expected[] = { { "height", 10 * 1.5 - 5 * 2.25 },
                   { "twice - 2*ball.y", 0 },
                   { "pull", -4 * cos (3) },
                   { "max:height", 5 },
                   { "integral:height", 5 * 2.25 - 5 * 3.375 / 3 },
                   { "mean:twice", 2 * (5 * 2.25 - 5 * 3.375 / 3) / 1.5 },
                   { "rms:pull", 4 * sqrt ((1.5 / 2 + sin (6) / 8) / 1.5) },
                   { "normal", 10 },
                   { "max:energy - min:energy", 0 } };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
    for (int m = 0; m < 5; m++)
      outputs_near (outputs_value (expected[i].text, methods[m], 1.5), expected[i].value, 1e-6);
}

TEST (integrals_of_works_are_refused) {
  pw_outcomes x;
  pw_error error = { 0 };
  const char *text = "mean:energy";
  assert_int_equal (pw_outcomes_open (&x, scene.system, "--of", &text, 1, &error), PW_INPUT);
  assert_non_null (strstr (error.text, "energy reads works or losses"));
  pw_outcomes_close (&x);
}

/* The time at which a condition becomes true in a run to 3 s; NaN: it does not. */
static double outputs_until (const char *condition, const char *method, double step) {
  pw_error error = { 0 };
  double t = NAN;
  pw_condition *c = pw_condition_open (scene.system, condition, &error);
  check_ok (error.status, &error);
  pw_settings settings = { .step = step, .rtol = 1e-9, .span = 3, .ledger = pw_condition_needs_ledger (c) };
  pw_run *r = pw_run_open (scene.system, method, &settings, &error);
  pw_crossing crossing = { .value = pw_condition_value, .context = c };
  check_ok (pw_run_find_crossing (r, &crossing, &t, &error), &error);
  while (isnan (t) && pw_run_time (r) < 3) {
    check_ok (pw_run_advance (r, 3, &error), &error);
    check_ok (pw_run_find_crossing (r, &crossing, &t, &error), &error);
  }
  pw_run_close (r);
  pw_condition_close (c);
  return t;
}

TEST (conditions) {
  static const struct {
    const char *method;
    double step;
  } methods[] = { { "rk4", 1e-3 }, { "rk4", 0.05 }, { "erk8", 0 }, { "erk5", 0 },
                  { "radau", 0 },  { "ida", 0 },    { "bdf", 0 } };
  const struct {
    const char *text;
    double t;
  } expected[] = { { "ball.x > 1.25", 1.25 },
                   { "height < 0 && t > 0.1", 2 },
                   { "ball.x > 1 || height > 4.9", 1 - sqrt (0.02) },
                   { "height >= 4.9999", 1 - sqrt (0.0001 / 5) }, /* for 9 ms */
                   { "block.x < -0.9999", acos (-0.9999) / 2 },
                   { "t > 0.5 ? ball.x > 0.7 : height > 3.2", 0.4 },
                   { "height > 5.1", NAN },
                   { "t >= 0", 0 } };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
      const double t = outputs_until (expected[i].text, methods[m].method, methods[m].step);
      if (isnan (expected[i].t))
        assert_true (isnan (t));
      else
        outputs_near (t, expected[i].t, 1e-4);
      if (m == 2 && expected[i].t > 0) outputs_near (t, expected[i].t, 2e-6);
    }
}

TEST (bad_conditions) {
  static const char *const bad[][2] = { { "hight > 1", "did you mean \"height\"?" },
                                        { "ball.x == 1", "==" },
                                        { "ball.x", "expected a condition" },
                                        { "ball.x >", "something is missing" } };
  for (int i = 0; i < 4; i++) {
    pw_error error = { 0 };
    assert_null (pw_condition_open (scene.system, bad[i][0], &error));
    assert_int_equal (error.status, PW_INPUT);
    assert_non_null (strstr (error.text, bad[i][1]));
  }
}

const check_fixture fixture = { outputs_setup, outputs_teardown };
