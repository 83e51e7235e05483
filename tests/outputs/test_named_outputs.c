/* Outputs of models: their values as columns, functionals of them against closed forms, in signals; the time at which a
 * condition becomes true. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "outcome.h"
#include "scene.h"

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

static double outputs_value (const pw_system *s, const char *text, const char *until, const char *method,
                             double t_end) {
  pw_outcomes x;
  pw_error error = { 0 };
  check_ok (pw_outcomes_open (&x, s, "--of", &text, 1, until, &error), &error);
  pw_settings settings = { .step = 1e-3, .rtol = 1e-12, .span = t_end, .ledger = x.ledger };
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
                   { "max:energy - min:energy", 0 },
                   { "at 0.5:height - at 1.25:height", 3.75 - 4.6875 },
                   { "at 0:height + at 1.5:height", 3.75 } };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
    for (int m = 0; m < 5; m++)
      outputs_near (outputs_value (scene.system, expected[i].text, NULL, methods[m], 1.5), expected[i].value, 1e-6);
}

TEST (integrals_of_works_are_refused) {
  pw_outcomes x;
  pw_error error = { 0 };
  const char *text = "mean:energy";
  assert_int_equal (pw_outcomes_open (&x, scene.system, "--of", &text, 1, NULL, &error), PW_INPUT);
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
                                        { "ball.x == 1", "use <= or >=" },
                                        { "ball.x = 1", "use <= or >=" },
                                        { "ball.x", "expected a condition" },
                                        { "ball.x >", "something is missing" } };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    pw_error error = { 0 };
    assert_null (pw_condition_open (scene.system, bad[i][0], &error));
    assert_int_equal (error.status, PW_INPUT);
    assert_non_null (strstr (error.text, bad[i][1]));
  }
}

/* Outputs of runs that end within a step: at the time 1.25 s, or 0.5 s on the way up. */
TEST (until) {
  static const char *const methods[] = { "rk4", "erk8", "bdf", "ida", "radau" };
  const struct {
    const char *text, *until;
    double value;
  } expected[] = { { "t", "ball.x > 1.25", 1.25 },
                   { "integral:height", "ball.x > 1.25", 5 * 1.5625 - 5 * 1.953125 / 3 },
                   { "mean:height", "ball.x > 1.25", (5 * 1.5625 - 5 * 1.953125 / 3) / 1.25 },
                   { "max:height", "ball.x > 1.25", 5 },
                   { "max:height", "height > 3.75", 3.75 },
                   { "min:pull", "height > 3.75", -4 },
                   { "max:pull", "height > 3.75", -4 * cos (1) },
                   { "at 0.25:height", "height > 3.75", 2.1875 } };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
    for (int m = 0; m < 5; m++)
      outputs_near (outputs_value (scene.system, expected[i].text, expected[i].until, methods[m], 1.5),
                    expected[i].value, 1e-6);
}

/* A car that follows the path y = A sin (kap x): root mean square and extremum of its tracking error, the time at which
 * it passes x = 20 m.  Digits: reduced equations integrated by extrapolation with 30 digits, and the same by another
 * code in redundant coordinates; both agree to 3e-14. */
TEST (path_tracking) {
  static const char *const methods[] = { "rk4", "erk8", "bdf", "ida+ggl", "radau" };
  const struct {
    const char *text, *until;
    double value;
  } expected[] = { { "rms:error", NULL, 0.0648312940152 },       { "min:error", NULL, -0.125155053173 },
                   { "at 10:delta", NULL, -0.0394766106272 },    { "mean:square", NULL, 0.0578254220892 / 30 },
                   { "rear.y", NULL, -0.392953452972 },          { "front.N", NULL, 0.00540486794882 },
                   { "t", "rear.x > 20", 20.2570348555 },        { "rear.y", "rear.x > 20", -0.790734096358 },
                   { "car.phi", "rear.x > 20", -0.143408958305 } };
  cli_write ("tracking.yaml",
             "pinwheel: 1\n"
             "let: {a: 0.6, b: 0.4, k: 0.5, A: 1, kap: 0.2}\n"
             "outputs:\n"
             "  - {name: error, value: rear.y - A*sin (kap*rear.x), unit: m}\n"
             "  - {name: delta, value: atan (A*kap*cos (kap*rear.x)) - atan (k*error) - car.phi, unit: rad}\n"
             "  - {name: square, value: delta^2}\n"
             "bodies:\n"
             "  - {name: car, mass: 2, inertia: 0.5, start: {x: b}}\n"
             "elements:\n"
             "  - {wheel: rear, body: car, at: [-b, 0]}\n"
             "  - {speed: X, body: car, at: [-b, 0], value: 1}\n"
             "  - {steered-wheel: front, body: car, at: [a, 0], heading: delta}\n");
  gallery_scene car = gallery_load (cli_path ("tracking.yaml"), NULL);
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
    for (int m = 0; m < 5; m++)
      outputs_near (outputs_value (car.system, expected[i].text, expected[i].until, methods[m], 30), expected[i].value,
                    1e-9);
  gallery_close (&car);
}

TEST (sweep_columns) {
  cli_good (
      "pinwheel sweep @/outputs.yaml -t 3 --vary ball.vx=1,2,4 --of max:height --of 'at 0.5:height' --of 2*height "
      "--until 'ball.x > 1' --rtol 1e-10 -m erk8 -o @/s.csv");
  double t[3], height[3], at[3];
  char word[3][20];
  const char *line = cli_file ("s.csv");
  assert_non_null (strstr (line, ",max:height [m],at 0.5:height [m],2*height,"));
  for (int i = 0; i < 3; i++) {
    line = strchr (line, '\n') + 1;
    double twice;
    const char *end = strstr (line, ",ok,") + 4;
    assert_int_equal (sscanf (end, "%lf", &t[i]), 1);
    for (int k = 0; k < 13; k++) end = strchr (end, ',') + 1; /* t and twelve states */
    assert_int_equal (sscanf (end, "%lf,%19[^,],%lf", &height[i], word[i], &twice), 3);
    outputs_near (twice, 2 * (10 * t[i] - 5 * t[i] * t[i]), 1e-8);
    at[i] = strtod (word[i], NULL);
  }
  const double end[] = { 1, 0.5, 0.25 }, most[] = { 5, 3.75, 2.1875 };
  for (int i = 0; i < 3; i++) outputs_near (t[i], end[i], 1e-9), outputs_near (height[i], most[i], 1e-8);
  outputs_near (at[0], 3.75, 1e-8);
  assert_string_equal (word[2], "nan"); /* the run ends before */
  cli_bad_each (
      "sweep",
      (const cli_wrong[]){
          { "@/outputs.yaml --vary ball.vx=1,2 --of hight -o @/x.csv",
            "--of hight: no column \"hight\"; did you "
            "mean \"height\"? (in the run with ball.vx = 1)" },
          { "@/outputs.yaml --vary ball.vx=1,2 --until 'hight > 1' -o @/x.csv",
            "--until hight > 1: no column \"hight\"; did you mean \"height\"? (in the run with ball.vx = 1)" },
          { "@/outputs.yaml --vary ball.vx=1,2 --of height --error -o @/x.csv",
            "--error compares complete runs: it cannot be given together with --of" } },
      3);
}

/* The time t = 1.25 m/vx at which the ball passes a point, and its height there. */
TEST (derivatives_of_an_arrival) {
  const double expected[] = { -1.25, 0, -1.25 * (10 - 12.5), 1.25 };
  double value[CLI_MOST], error[CLI_MOST];
  cli_good ("mkdir @/sens && pinwheel sensitivity @/outputs.yaml -t 3 --of t --of height --by ball.vx --by ball.vy "
            "--until 'ball.x > 1.25' --json @/sens/sensitivity.json");
  cli_shows ("t = 1.25 s");
  cli_bad ("pinwheel sensitivity @/outputs.yaml -t 1 --of t --by ball.vx --until 'ball.x > 1.25'", 4,
           "--until ball.x > 1.25: not true before the end of the run at t = 1 s");
  assert_int_equal (cli_sensitivity ("derivative", value), 4);
  assert_int_equal (cli_sensitivity ("error", error), 4);
  for (int i = 0; i < 4; i++) {
    outputs_near (value[i], expected[i], error[i] + 1e-14);
    outputs_near (error[i], 0, 1e-7);
  }
  assert_null (cli_file ("sens/sensitivity.csv"));
}

/* ---- Outputs in C ---- */

/* The square of the distance from the origin, a number of times. */
static int outputs_distance (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)t, (void)gradient;
  value[0] = *(const double *)context * (x[0] * x[0] + x[1] * x[1]);
  return 0;
}

SCENE (point) {
  pw_add_body (m, &(pw_body){ .name = "ball", .mass = 1, .inertia = 1, .start = { 3, 4, 0 } });
}

/* Adds an output that depends on these columns; factor: how often. */
static void interface_add (pw_model *m, const char *name, const char *const *reads, double *factor) {
  pw_add_output (
      m, &(pw_named_output){ name, "m^2", NULL, { .eval = outputs_distance, .context = factor, .reads = reads } });
}

TEST (interface) {
  static double one = 1, two = 2;
  static const char *const places[] = { "ball.x", "ball.y", NULL }, *const none[] = { "ball.z", NULL };
  static const struct {
    const char *name, *const *reads, *message;
  } bad[] = {
    { "square", places,
      "model scene: output \"square\": a body, an element, another output or a column of tables has this name" },
    { "a b", places, "model scene: output \"a b\": expected a letter, then letters, digits and _, at most 63 in all" },
    { "t", places,
      "model scene: output \"t\": a body, an element, another output or a column of tables has this name" },
    { "other", none, "model scene: output other: no column \"ball.z\"; did you mean \"ball.x\"?" },
  };
  pw_sample sample;
  pw_error error = { 0 };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    pw_model *m = scene_model (&point_table, NULL);
    interface_add (m, "square", places, &one);
    interface_add (m, bad[i].name, bad[i].reads, &two);
    scene_refused (m, bad[i].message);
  }
  pw_model *m = scene_model (&point_table, NULL);
  interface_add (m, "square", places, &one);
  interface_add (m, "twice", places, &two);
  pw_system *s = scene_compile (m);
  pw_run *r = pw_run_open (s, "rk4", &(pw_settings){ .step = 0.1 }, &error);
  check_ok (pw_run_sample (r, 0, &sample, &error), &error);
  assert_int_equal (pw_system_outputs (s), 2);
  assert_string_equal (pw_system_output_name (s, 1), "twice");
  assert_string_equal (pw_system_output_unit (s, 0), "m^2");
  outputs_near (sample.output[0], 25, 0);
  outputs_near (sample.output[1], 50, 0);
  pw_run_close (r);
  pw_system_free (s);
}

const check_fixture fixture = { outputs_setup, outputs_teardown };
