/* Signals given by expressions: they agree with built-in signals, steps end where they jump, derivatives are exact. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "model.h"
#include "runs.h"

/* A model whose elements are given by a format and a value in it. */
static gallery_scene scene_of (const char *elements, const char *value) {
  char text[2000];
  int n = snprintf (text, sizeof text, "%s",
                    "pinwheel: 1\nparameters: [{name: A, value: 0.3}, {name: w, value: 2}, {name: T, value: 1.5}]\n"
                    "bodies: [{name: a, mass: 1, inertia: 0.1}, {name: b, mass: 2, inertia: 0.3, rate: {vx: 1}}]\n"
                    "elements:\n");
  for (const char *p = elements; *p; p++)
    n += *p == '@' ? snprintf (text + n, sizeof text - (size_t)n, "%s", value)
                   : snprintf (text + n, sizeof text - (size_t)n, "%c", *p);
  assert_true (n < (int)sizeof text);
  cli_write ("m.yaml", text);
  return gallery_load (cli_path ("m.yaml"), NULL);
}

static const pw_signal *scene_signal (const gallery_scene *x) {
  return pw_field_at (x->model->element[0].kind, x->model->element[0].definition, PW_SIGNAL, 0);
}

/* 100 N for 0.01 s give 1 kg a speed of 1 m/s, however long the steps and however the times are written: a
 * constant force is integrated without an error of the method. */
TEST (push) {
  static const char *const value[] = { "t > 7.0003 && t < 7.0103 ? 100 : 0",
                                       "100*(7.0003 < t && 7.0103 >= t)",
                                       "2*t - 1 > 13.0006 && 3*t < 21.0309 ? 100 : 0",
                                       "abs(t - 7.0053) < 0.005 ? 100 : 0",
                                       "mod(t - 7.0003, 20) < 0.01 ? 100 : 0",
                                       "50*(sign(t - 7.0003) - sign(t - 7.0103))",
                                       "t < 7.0003 ? 0 : t < 7.0103 ? 100 : 0",
                                       "100*(ceil((t - 7.0003)/30) - ceil((t - 7.0103)/30))",
                                       "t^2 > 7.0003^2 && exp(t) < exp(7.0103) ? 100 : 0" };
  char method[40];
  double q[6], v[6];
  for (size_t i = 0; i < sizeof value / sizeof *value; i++) {
    gallery_scene x = scene_of ("  - {force: F, body: a, fx: \"@\"}\n", value[i]);
    for (int k = 0; runs_method (k, method); k++) {
      runs_state (x.system, method, &(pw_settings){ .step = 0.25, .rtol = 1e-6 }, 10, q, v, NULL);
      check_close (method, v[0], 1, 1e-11, "100 N, two times with round-off, restarts");
    }
    gallery_close (&x);
  }
}

/* An expression in place of a built-in signal: the same motion but for round-off, and adaptive steps, since the bounds
 * of an expression, by which they are limited, are wider than those of a form. */
TEST (built_in) {
  static const char drive[] = "  - {drive: D, body: [a, ground], what: angle, value: @}\n"
                              "  - {pin: P, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n";
  static const char steered[] = "  - {steered-wheel: W, body: b, at: [0.4, 0.1], heading: @}\n"
                                "  - {wheel: V, body: b, at: [-0.4, 0]}\n  - {force: F, body: b, fx: 1}\n";
  static const char speed[] = "  - {speed: S, body: b, at: [0, 0], value: @}\n";
#define STEP "((t - 0.4)/T)^3*(10 + (t - 0.4)/T*(6*(t - 0.4)/T - 15))"
  static const struct {
    const char *elements, *form, *expression;
  } pair[] = {
    { drive, "{harmonic: {amplitude: A, omega: w, phase: 0.5, offset: 0.1}}", "\"0.1 + A*cos(w*t + 0.5)\"" },
    { drive, "{smooth-step: {to: A, start: 0.4, duration: T}}", "\"A*(t < 0.4 ? 0 : t < 0.4 + T ? " STEP " : 1)\"" },
    { drive, "{expression: A*sin(w*t), rate: A*w*cos(w*t), acceleration: -A*w^2*sin(w*t)}", "A*sin(w*t)" },
    { drive, "{expression: A*sin(w*t), rate: A*w*cos(w*t)}", "A*sin(w*t)" },
    { steered, "{harmonic: {amplitude: A, omega: w, phase: 0.5}}", "A*cos(w*t + 0.5)" },
    { steered, "{smooth-step: {to: A, start: 0.4, duration: T}}", "\"A*(t < 0.4 ? 0 : t < 0.4 + T ? " STEP " : 1)\"" },
    { steered, "{ramp: {to: A, start: 0.4, duration: T}}", "\"A*max(0, min(1, (t - 0.4)/T))\"" },
    { steered, "{expression: atan(A*t), rate: A/(1 + (A*t)^2)}", "atan(A*t)" },
    { speed, "{ramp: {from: 1, to: 2, start: 0.4, duration: T}}", "\"1 + max(0, min(1, (t - 0.4)/T))\"" },
  };
  static const char *const method[] = { "rk4+projection", "erk8+projection", "ida+ggl", "bdf+projection", "galpha" };
  for (size_t i = 0; i < sizeof pair / sizeof *pair; i++)
    for (size_t m = 0; m < sizeof method / sizeof *method; m++) {
      double q[2][6], v[2][6];
      for (int k = 0; k < 2; k++) {
        gallery_scene x = scene_of (pair[i].elements, k ? pair[i].expression : pair[i].form);
        runs_state (x.system, method[m], &(pw_settings){ .step = 0.05, .rtol = 1e-10 }, 3, q[k], v[k], NULL);
        gallery_close (&x);
      }
      for (int j = 0; j < 6; j++) {
        const double bound = m % 4 == 0 ? 1e-11 : 1e-7; /* the first and the last have fixed steps */
        check_close (pair[i].expression, q[1][j], q[0][j], bound,
                     "round-off; 1000 rtol, as of multistep methods, with adaptive steps");
        check_close (pair[i].expression, v[1][j], v[0][j], bound,
                     "round-off; 1000 rtol, as of multistep methods, with adaptive steps");
      }
    }
}

/* The gradient by states is that of the formula. */
TEST (gradient) {
  gallery_scene x = scene_of ("  - {torque: T, body: [b, ground], value: \"@\"}\n",
                              "t*sin(b.phi)*exp(-b.omega^2) + abs(a.x)*(b.omega > 0 ? 2 : 3)");
  const pw_signal *s = scene_signal (&x);
  void *own = s->function.open (s->function.context);
  double t = 1.3, phi = 0.4, omega = 0.7, ax = -2, value[3], gradient[3];
  const double states[] = { phi, omega, ax };
  assert_string_equal (s->function.reads[0], "b.phi");
  assert_int_equal (s->function.eval (own, t, states, value, gradient), 0);
  double e = exp (-omega * omega);
  check_close ("value", value[0], t * sin (phi) * e + 4, 8 * CHECK_EPS * 4, "round-off");
  check_close ("by phi", gradient[0], t * cos (phi) * e, 8 * CHECK_EPS, "round-off");
  check_close ("by omega", gradient[1], -2 * omega * t * sin (phi) * e, 8 * CHECK_EPS, "round-off");
  check_close ("by x", gradient[2], -2, 0, "exact");
  assert_null (s->function.text->jump); /* b.omega > 0: located in each run */
  s->function.close (own);
  gallery_close (&x);
}

/* At a jump in time it is that just after it, as the value is. */
TEST (gradient_after) {
  gallery_scene x =
      scene_of ("  - {torque: T, body: [b, ground], value: \"@\"}\n", "t <= 1 ? b.phi : 2*b.phi + a.x*floor(-t)");
  const pw_signal *s = scene_signal (&x);
  void *own = s->function.open (s->function.context);
  double value[3], gradient[2];
  assert_int_equal (s->function.eval (own, 1, (double[]){ 3, 5 }, value, gradient), 0);
  assert_true (value[0] == 6 - 10 && gradient[0] == 2 && gradient[1] == -2);
  assert_int_equal (s->function.eval (own, 0.5, (double[]){ 3, 5 }, value, gradient), 0);
  assert_true (value[0] == 3 && gradient[0] == 1 && gradient[1] == 0);
  s->function.close (own);
  gallery_close (&x);
}

/* A derivative without a value stops the run with its reason; one that is given in its place does not. */
TEST (no_derivative) {
  static const char *const value[] = { "sqrt(t^4)", "{expression: sqrt(t^4), rate: 2*t, acceleration: 2}",
                                       "{expression: sqrt(t^4), rate: 2*t}" };
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    gallery_scene x = scene_of ("  - {drive: D, body: [a, ground], what: angle, value: @}\n", value[i]);
    pw_run *r = pw_run_open (x.system, "rk4+projection", &(pw_settings){ .step = 0.1 }, &error);
    if (i == 0)
      check_error (&error, PW_METHOD,
                   "t = 0 s: a signal failed: drive D: value, or a derivative of it, is not a finite number");
    else
      check_close ("angle", runs_to (r, 2).q[2], 4, 1e-13, "round-off");
    pw_run_close (r);
    gallery_close (&x);
  }
}

/* Constraints take what is continuous where it breaks, however fast it changes; what is not is refused
 * (tests/bad-models.txt). */
TEST (continuous) {
  static const char *const value[] = { "t < 1 ? t^3 : 3*t - 2",        "abs(sin(3*t))^3",           "max(0, t - 1)^2",
                                       "sin(1e9*t) + max(0, t - 1)^2", "1e8*max(0, t - 1)^3 + 1e8", "t > 5 || 1" };
  for (size_t i = 0; i < sizeof value / sizeof *value; i++) {
    gallery_scene x = scene_of ("  - {drive: D, body: [a, ground], what: angle, value: \"@\"}\n", value[i]);
    gallery_close (&x);
  }
}

/* No name of a formula is the time: at a jump its value is that of the jump, whichever name comes first. */
TEST (formula) {
  static const struct {
    const char *text;
    double value;
  } formula[] = { { "ceil(a)", 2 }, { "ceil(b)", 2 }, { "a <= 2", 1 }, { "a == b", 1 }, { "sign(a - b)", 0 } };
  const char *const names[] = { "a", "b", NULL };
  for (size_t i = 0; i < sizeof formula / sizeof *formula; i++) {
    pw_error error = { 0 };
    pw_formula *f = pw_formula_open (formula[i].text, names, &error);
    check_ok (f ? PW_OK : error.status, &error);
    check_close (formula[i].text, pw_formula_value (f, (const double[]){ 2, 2 }), formula[i].value, 0, "exact");
    pw_formula_close (f);
  }
}

const check_fixture fixture = { cli_setup, cli_teardown };
