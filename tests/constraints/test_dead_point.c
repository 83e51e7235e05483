/* Dead points: every method ends with the drive, the time and the elements at their limit; other motions go on. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "runs.h"
#include "scene.h"

const check_fixture fixture = { cli_setup, cli_teardown };

/* A four-bar linkage 2/3/1.5/2, the crank at the angle 1; then the element that drives it. */
#define FOUR_BAR                                                                                          \
  "pinwheel: 1\nbodies:\n"                                                                                \
  "  - {name: crank, mass: 1, inertia: 0.1, start: {x: 1.5*cos(1), y: 1.5*sin(1), phi: 1}}\n"             \
  "  - {name: coupler, mass: 1, inertia: 0.1, start: {x: 2.270748647292777, y: 2.1499724032601657, phi: " \
  "-0.5227376617191829}}\n"                                                                               \
  "  - {name: rocker, mass: 1, inertia: 0.1, start: {x: 2.4602951884905675, y: 0.887765926048321, phi: "  \
  "1.092468649807932}}\nelements:\n"                                                                      \
  "  - {pin: A, body: [crank, ground], at: [[-1.5, 0], [0, 0]]}\n"                                        \
  "  - {pin: B, body: [crank, coupler], at: [[1.5, 0], [-0.75, 0]]}\n"                                    \
  "  - {pin: C, body: [coupler, rocker], at: [[0.75, 0], [1, 0]]}\n"                                      \
  "  - {pin: D, body: [rocker, ground], at: [[-1, 0], [2, 0]]}\n"

/* A slider-crank 1/2 from the crank angle pi/2; the drive of the slider. */
#define SLIDER_CRANK                                                                    \
  "pinwheel: 1\nbodies:\n"                                                              \
  "  - {name: crank, mass: 1, inertia: 0.1, start: {y: 0.5, phi: pi/2}}\n"              \
  "  - {name: bar, mass: 1, inertia: 0.1, start: {x: sqrt(3)/2, y: 0.5, phi: -pi/6}}\n" \
  "  - {name: piston, mass: 1, inertia: 0.1, start: {x: sqrt(3)}}\nelements:\n"         \
  "  - {pin: A, body: [crank, ground], at: [[-0.5, 0], [0, 0]]}\n"                      \
  "  - {pin: B, body: [crank, bar], at: [[0.5, 0], [-1, 0]]}\n"                         \
  "  - {pin: C, body: [bar, piston], at: [[1, 0], [0, 0]]}\n"                           \
  "  - {slider: guide, body: [piston, ground], at: [[0, 0], [0, 0]]}\n"

static const struct {
  const char *name, *drive, *limit;
  double t, error; /* of the dead point [s]; that of methods with steps of 1e-2 s and default tolerances */
  const char *text;
} dead[] = {
  { "four-bar", "drive motor", "pin A, pin B, pin C, pin D", 1.016511129997, 1e-5, /* (acos (1/16) - 1) / 0.5 */
    FOUR_BAR "  - {drive: motor, body: [crank, ground], what: angle, value: {expression: 1 + t/2, rate: 1/2}}\n" },
  { "four-bar-speed", "speed motor", "pin A, pin B, pin C, pin D", 1.016511129997, 2e-3,
    FOUR_BAR "  - {speed: motor, body: crank, at: [1.5, 0], heading: pi/2, value: 1.5}\n" },
  { "slider-crank", "drive ram", "pin A, pin B, pin C", 1.58493649054, 1e-5, /* (3 - sqrt (3)) / 0.8 */
    SLIDER_CRANK
    "  - {drive: ram, body: [piston, ground], what: x, value: {expression: sqrt(3) + 0.8*t, rate: 0.8}}\n" },
  /* bars of 1 m on a free cart, pushed apart by a cylinder: 0.3 t + 0.05 t^2 = 2 - sqrt (2) */
  { "arm", "drive ram", "pin A, pin B, pin E, pin C", 1.551453476917, 1e-5,
    "pinwheel: 1\nbodies:\n"
    "  - {name: cart, mass: 5, inertia: 0.3}\n"
    "  - {name: upper, mass: 1, inertia: 0.1, start: {x: sqrt(2)/4, y: sqrt(2)/4, phi: pi/4}}\n"
    "  - {name: lower, mass: 1, inertia: 0.1, start: {x: 3*sqrt(2)/4, y: sqrt(2)/4, phi: -pi/4}}\n"
    "  - {name: barrel, mass: 1, inertia: 0.1, start: {x: 0.3}}\n"
    "  - {name: piston, mass: 1, inertia: 0.1, start: {x: sqrt(2)}}\nelements:\n"
    "  - {slider: track, body: [cart, ground], at: [[0, 0], [0, 0]]}\n"
    "  - {pin: A, body: [upper, cart], at: [[-0.5, 0], [0, 0]]}\n"
    "  - {pin: B, body: [upper, lower], at: [[0.5, 0], [-0.5, 0]]}\n"
    "  - {pin: E, body: [barrel, cart], at: [[-0.3, 0], [0, 0]]}\n"
    "  - {slider: cylinder, body: [piston, barrel], at: [[0, 0], [0, 0]]}\n"
    "  - {pin: C, body: [lower, piston], at: [[0.5, 0], [0, 0]]}\n"
    "  - {drive: ram, body: [piston, barrel], what: x,\n"
    "     value: {expression: sqrt(2) - 0.3 + 0.3*t + 0.05*t^2, rate: 0.3 + 0.1*t}}\n"
    "  - {gravity: g, acceleration: [0, -9.81]}\n" },
  /* the front wheel, at right angles, blocks the driven rear wheel */
  { "bicycle", "speed cruise", "steered-wheel front", 1.96349540849, 2e-3,
    "pinwheel: 1\nbodies:\n  - {name: car, mass: 10, inertia: 4, rate: {vx: 1}}\nelements:\n"
    "  - {wheel: rear, body: car, at: [-1, 0]}\n"
    "  - {steered-wheel: front, body: car, at: [1, 0], heading: {expression: 0.8*t, rate: 0.8}}\n"
    "  - {speed: cruise, body: car, at: [-1, 0], value: 1}\n" },
};

static pw_system *dead_system (const char *name, const char *text) {
  char file[60];
  snprintf (file, sizeof file, "%s.yaml", name);
  cli_write (file, text);
  return scene_named (cli_path (file), NULL, 0);
}

/* Advances to t_end, or the error. */
static int dead_run (pw_system *s, const char *method, double step, double t_end, pw_error *error) {
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .span = t_end });
  int status = pw_run_advance_to (r, t_end, t_end, error);
  pw_run_close (r);
  return status;
}

TEST (every_method) {
  char method[40], expected[200];
  for (size_t i = 0; i < sizeof dead / sizeof *dead; i++) {
    pw_system *s = dead_system (dead[i].name, dead[i].text);
    snprintf (expected, sizeof expected,
              " s: dead point: %s cannot go on: at the limit of %s, it requires unbounded velocities", dead[i].drive,
              dead[i].limit);
    for (int k = 0; runs_method (k, method); k++) {
      pw_error error = { 0 };
      double t;
      assert_int_equal (dead_run (s, method, 1e-2, 6, &error), PW_METHOD);
      assert_int_equal (sscanf (error.text, "t = %lf", &t), 1);
      check_close (check_text ("%s by %s", dead[i].name, method), t, dead[i].t, dead[i].error,
                   "closed form; drives on positions: digits of the message");
      assert_string_equal (strstr (error.text, " s:"), expected);
    }
    pw_system_free (s);
  }
}

/* The time does not depend on the size of the steps, even if one step passes the dead point by far. */
TEST (step_sizes) {
  for (size_t i = 0; i < sizeof dead / sizeof *dead; i += 2) {
    pw_system *s = dead_system (dead[i].name, dead[i].text);
    static const double step[] = { 1e-3, 0.03, 0.1 };
    for (int k = 0; k < 3; k++) {
      pw_error error = { 0 };
      double t;
      assert_int_equal (dead_run (s, "rk4+projection", step[k], 6, &error), PW_METHOD);
      assert_int_equal (sscanf (error.text, "t = %lf", &t), 1);
      check_close (dead[i].name, t, dead[i].t, dead[i].error, "as with any step");
    }
    pw_system_free (s);
  }
}

/* Compiled code, and a limit on the number of steps. */
TEST (program) {
  cli_write ("four-bar.yaml", dead[0].text);
  static const char message[] =
      "t = 1.01651 s: dead point: drive motor cannot go on: at the limit of pin A, pin B, pin C, "
      "pin D, it requires unbounded velocities\n";
  assert_int_not_equal (cli_run ("pinwheel run @/four-bar.yaml --t-end 3 --specialise always"), 0);
  assert_non_null (strstr (cli_err, message));
  assert_int_not_equal (cli_run ("pinwheel run @/four-bar.yaml --t-end 3 -m erk8+projection --max-steps 60"), 0);
  assert_non_null (strstr (cli_err, message));
}

/* A slider that reverses in the end of its stroke, and the driven crank of a parallelogram, stop at no dead point; nor
 * does a drive that fails for another reason before one. */
TEST (none) {
  static const struct {
    const char *name, *text;
  } passes[] = {
    { "stroke", SLIDER_CRANK "  - drive: ram\n    body: [piston, ground]\n    what: x\n    value:\n"
                             "      expression: 3 - (3 - sqrt(3))*cos(t)^2\n      rate: (3 - sqrt(3))*sin(2*t)\n" },
    { "parallelogram",
      "pinwheel: 1\nbodies:\n"
      "  - {name: left, mass: 1, inertia: 0.1, start: {x: 0, y: 0.5, phi: pi/2}}\n"
      "  - {name: right, mass: 1, inertia: 0.1, start: {x: 2, y: 0.5, phi: pi/2}}\n"
      "  - {name: bar, mass: 1, inertia: 0.1, start: {x: 1, y: 1, phi: 0}}\nelements:\n"
      "  - {pin: A, body: [left, ground], at: [[-0.5, 0], [0, 0]]}\n"
      "  - {pin: B, body: [left, bar], at: [[0.5, 0], [-1, 0]]}\n"
      "  - {pin: C, body: [bar, right], at: [[1, 0], [0.5, 0]]}\n"
      "  - {pin: D, body: [right, ground], at: [[-0.5, 0], [2, 0]]}\n"
      "  - {drive: motor, body: [left, ground], what: angle, value: {expression: pi/2 - t, rate: -1}}\n" },
  };
  char method[40];
  for (size_t i = 0; i < sizeof passes / sizeof *passes; i++) {
    pw_system *s = dead_system (passes[i].name, passes[i].text);
    for (int k = 0; runs_method (k, method); k++) {
      pw_error error = { 0 };
      dead_run (s, method, 1e-2, 2.5, &error);
      if (strstr (error.text, "dead point")) fail_msg ("%s by %s: %s", passes[i].name, method, error.text);
    }
    pw_system_free (s);
  }
  pw_error error = { 0 };
  pw_system *s =
      dead_system ("ends", SLIDER_CRANK "  - drive: ram\n    body: [piston, ground]\n    what: x\n"
                                        "    value: {expression: sqrt(3) + 0.8*t + 0*sqrt(1.5 - t), rate: 0.8}\n");
  assert_int_equal (dead_run (s, "rk4+projection", 1e-2, 6, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "drive ram"));
  assert_null (strstr (error.text, "dead point"));
  pw_system_free (s);
}
