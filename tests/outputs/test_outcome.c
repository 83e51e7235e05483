/* Outputs of analyses: functionals of columns against closed forms, with methods of short and long steps; their
 * texts. */
#include <math.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "outcome.h"

/* A wheel turned by cos (w t): phi = (1 - cos (w t)) / w^2, omega = sin (w t) / w.  A slider on which a force acts
 * that grows and drops: (t, t + 1) until t = 0.7, then (0, 1.699), a small drop.  Another one shaken faster than steps
 * follow. */
static const char model[] = "pinwheel: 1\n"
                            "about: functionals with closed forms\n"
                            "parameters: [{name: w, value: 3}]\n"
                            "bodies: [{name: wheel, mass: 1, inertia: 1}, {name: block-a, mass: 1, inertia: 1},\n"
                            "         {name: block-b, mass: 1, inertia: 1}]\n"
                            "elements:\n"
                            "  - {pin: P, body: [wheel, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {pin: Q, body: [block-a, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {torque: motor-1, body: [wheel, ground], value: {expression: cos(w*t)}}\n"
                            "  - {force: push, body: block-a, at: [0, 0],\n"
                            "     fx: {expression: 't < 0.7 ? t : 0'}, fy: {expression: 't < 0.7 ? t + 1 : 1.699'}}\n"
                            "  - {pin: R, body: [block-b, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {force: shake, body: block-b, at: [0, 0], fx: {expression: 'sin(40*t)'}}\n";

static gallery_scene scene;
static pw_system *s; /* of the scene */

static int outcome_setup (void) {
  if (cli_setup () != 0) return 1;
  cli_write ("functionals.yaml", model);
  scene = gallery_load (cli_path ("functionals.yaml"), NULL);
  s = scene.system;
  return 0;
}

static int outcome_teardown (void) {
  gallery_close (&scene);
  return cli_teardown ();
}

static double outcome_run (const char *text, const char *method, double step, double rtol, double t_end) {
  pw_outcomes x;
  pw_error error = { 0 };
  check_ok (pw_outcomes_open (&x, s, "--of", &text, 1, NULL, &error), &error);
  pw_settings settings = { .step = step, .rtol = rtol, .span = t_end, .ledger = x.ledger };
  check_ok (pw_outcomes_run (&x, method, &settings, t_end, NULL, &error), &error);
  double value = pw_outcome_value (&x, 0);
  pw_outcomes_close (&x);
  return value;
}

/* ---- Values ---- */

/* At t = 4, w = 3. */
TEST (functionals) {
  const double w = 3, t = 4, phi = (1 - cos (w * t)) / (w * w), area = (t - sin (w * t) / w) / (w * w);
  const struct {
    const char *text;
    double value;
  } expected[] = {
    { "wheel.phi", phi },
    { "final:wheel.phi", phi },
    { "max:wheel.phi", 2 / (w * w) },
    { "min:wheel.omega", -1 / w },
    { "max:wheel.omega", 1 / w },
    { "max:t", t },
    { "integral:wheel.phi", area },
    { "mean:wheel.phi", area / t },
    { "rms:wheel.omega", sqrt ((t / 2 - sin (2 * w * t) / (4 * w)) / t) / w },
    { "max:motor-1.work", 1 / (2 * w * w) },
    { "work", pow (sin (w * t) / w, 2) / 2 },
    { "mean:work", (t / 2 - sin (2 * w * t) / (4 * w)) / (2 * w * w) / t },
    { "integral:motor-1.work", (t / 2 - sin (2 * w * t) / (4 * w)) / (2 * w * w) },
    { "mean:kinetic", (t / 2 - sin (2 * w * t) / (4 * w)) / (2 * w * w) / t },
    { "integral:t", t * t / 2 },
    { "wheel.phi/max:wheel.phi - 2*sin(pi/6)", phi / (2 / (w * w)) - 1 },
    { "max(wheel.phi, 7) + max:wheel.phi-wheel.phi", 7 + 2 / (w * w) - phi },
    { "2e-1*motor-1.work", 0.1 * pow (sin (w * t) / w, 2) },
  };
  static const struct {
    const char *method;
    double step, rtol, bound;
    const char *reason;
  } way[] = {
    { "rk4", 0.01, 0, 1e-7, "(w h)^4, 0.8e-6, times the constant 1/120 of the method and a few periods" },
    { "erk8", 0, 1e-12, 1e-10, "100 rtol" },
    { "radau", 0, 1e-9, 1e-7, "100 rtol" },
    { "bdf", 0, 1e-8, 1e-5, "error of 1000 steps" },
    { "erk5+nullspace", 0, 1e-10, 1e-7, "1000 rtol" },
    { "adams", 0, 1e-9, 1e-5, "error of 1000 steps" },
    { "ida", 0, 1e-9, 1e-5, "error of 1000 steps" },
    { "galpha", 1e-3, 0, 1e-5, "(w h)^2, 1e-5" },
    { "leapfrog", 1e-3, 0, 1e-5, "(w h)^2, 1e-5" },
  };
  for (size_t k = 0; k < sizeof way / sizeof *way; k++)
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
      check_close (expected[i].text, outcome_run (expected[i].text, way[k].method, way[k].step, way[k].rtol, t),
                   expected[i].value, way[k].bound, way[k].reason);
}

/* Each step ends at the jump, where the value has its limit from the right. */
TEST (jump) {
  static const char *const method[] = { "rk4", "erk8", "radau" };
  for (int i = 0; i < 3; i++) {
    check_close ("least reaction", outcome_run ("min:Q.Fx", method[i], 0.03, 1e-9, 2), -0.7, 1e-9,
                 "1e-8 of a step, refined");
    check_close ("mean reaction", outcome_run ("mean:Q.Fx", method[i], 0.03, 1e-9, 2), -0.7 * 0.35 / 2, 1e-9, "exact");
  }
}

/* A drop so small that the ends of a step and its middle lie nearly on a line. */
TEST (small_jump) {
  check_close ("least reaction", outcome_run ("min:Q.Fy", "rk4", 0.03, 0, 2), -1.7, 1e-9, "1e-8 of a step, refined");
}

/* Steps of 0.2 s and more contain more than a period of sin (40 t). */
TEST (fast) {
  check_close ("rms", outcome_run ("rms:R.Fx", "erk8", 0, 1e-9, 4), sqrt ((2 - sin (320.) / 160) / 4), 1e-8,
               "10 rtol: an integral is in the error test of the run");
}

/* Events of a stop of 60 degrees and of one that is never reached: a pendulum on a horizontal plane that turns by
 * 1 rad/s and bounces back by e = 1/2 at pi/3, then by 1/4 at the start, and so on. */
TEST (events) {
  cli_write ("stops.yaml", "pinwheel: 1\nbodies: [{name: bob, mass: 1, inertia: 1, rate: {omega: 1}}]\nelements:\n"
                           "  - {pin: P, body: [bob, ground], at: [[0, 0], [0, 0]]}\n"
                           "  - {stop: S, body: [bob, ground], what: angle, low: -1, high: 60*deg, restitution: 0.5}\n"
                           "  - {stop: far-1, body: [bob, ground], what: angle, low: -9, high: 9}\n");
  static const struct {
    const char *text;
    double value;
  } of[] = { { "events", 2 },
             { "events:S", 2 },
             { "events:S.high", 1 },
             { "events:S.low + events:far-1", 1 },
             { "event:S", PW_PI / 3 },
             { "event 2:S", PW_PI / 3 + 2 * (PW_PI / 3 + 1) },
             { "event 2:S-event 1:S", 2 * (PW_PI / 3 + 1) },
             { "event:S.low/event:S", 1 + 2 * (1 + 3 / PW_PI) },
             { "event:far-1", NAN },
             { "event 3:S", NAN } };
  gallery_scene stops = gallery_load (cli_path ("stops.yaml"), NULL);
  pw_system *const before = s;
  s = stops.system;
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    const double value = outcome_run (of[i].text, "rk4+projection", 0.1, 0, 8);
    if (isnan (of[i].value))
      assert_true (isnan (value));
    else
      check_close (of[i].text, value, of[i].value, 1e-11, "constant velocities");
  }
  s = before;
  gallery_close (&stops);
  cli_bad ("pinwheel sensitivity @/stops.yaml --of events:far --by bob.omega", 2,
           "--of events:far: no element or reaction with a limit \"far\"; did you mean \"far-1\"?");
  cli_bad ("pinwheel sensitivity @/stops.yaml --of 'event 0:S' --by bob.omega", 2,
           "--of event 0:S: events are counted from 1");
  cli_bad ("pinwheel sensitivity @/functionals.yaml --of event:R --by w", 2,
           "--of event:R: no reaction of the model has a limit, so there are no events");
}

TEST (units) {
  static const char *const text[] = { "t", "integral:t", "integral:wheel.phi", "integral:wheel.omega", "mean:t" };
  static const char *const unit[] = { "s", "s^2", "rad s", "rad/s s", "s" };
  char buffer[40];
  pw_outcomes x;
  pw_error error = { 0 };
  check_ok (pw_outcomes_open (&x, s, "--of", text, 5, NULL, &error), &error);
  for (int i = 0; i < 5; i++) assert_string_equal (pw_outcome_unit (&x, i, buffer, sizeof buffer), unit[i]);
  pw_outcomes_close (&x);
}

TEST (extremum) {
  const char *text = "max:wheel.phi";
  pw_outcomes x;
  pw_error error = { 0 };
  check_ok (pw_outcomes_open (&x, s, "--of", &text, 1, NULL, &error), &error);
  check_ok (pw_outcomes_run (&x, "erk8", &(pw_settings){ .rtol = 1e-10, .span = 2 }, 2, NULL, &error), &error);
  check_close ("time of the maximum", x.functional[0].t, PW_PI / 3, 1e-7, "sqrt (eps) and the error of the run");
  pw_outcomes_close (&x);
}

/* ---- Texts ---- */

TEST (bad) {
  static const struct {
    const char *text, *message;
  } bad[] = {
    { "", "--of is empty: expected a column, such as frame.x" },
    { "wheel.phy", "--of wheel.phy: no column \"wheel.phy\"; did you mean \"wheel.phi\"?" },
    { "max:motor-2.work", "--of max:motor-2.work: no column \"motor-2.work\"; did you mean \"motor-1.work\"?" },
    { "wheel.phi/works", "--of wheel.phi/works: no column \"works\"; did you mean \"work\"?" },
    { "maxi:wheel.phi", "--of maxi:wheel.phi: no \"maxi:\"; valid are final:, max:, min:, mean:, integral:, rms:, at "
                        "TIME:, events:, event: and event N:" },
    { "mean:balance", "--of mean:balance: balance describes the integration, not the motion: it has no mean" },
    { "rms:motor-1.work", "--of rms:motor-1.work: no rms: of work and losses; valid are final:, max:, min:, mean: and "
                          "integral:" },
    { "max:abs (wheel.phi)",
      "--of max:abs (wheel.phi): max: takes a column; for an expression, define an output of the model" },
    { "2*rms (wheel.phi)", "--of 2*rms (wheel.phi): write rms: and the column" },
    { "max (wheel.phi)",
      "--of max (wheel.phi): too few arguments; extrema over the run are max:COLUMN and min:COLUMN" },
    { "wheel.phi +", "--of wheel.phi +: something is missing after \"+\"" },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    pw_outcomes x;
    pw_error error = { 0 };
    assert_int_equal (pw_outcomes_open (&x, s, "--of", &bad[i].text, 1, NULL, &error), PW_INPUT);
    check_error (&error, PW_INPUT, bad[i].message);
    pw_outcomes_close (&x);
  }
}

const check_fixture fixture = { outcome_setup, outcome_teardown };
