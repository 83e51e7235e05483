/* Text models give the same bits as models in C: the EzyRoller both ways, parameters, what `let` defines, signals. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "model.h"
#include "runs.h"

/* A model from its text, with a parameter set. */
static gallery_scene text_of (const char *source, const char *parameter, double value) {
  cli_write ("m.yaml", source);
  return gallery_load (cli_path ("m.yaml"), parameter, value, NULL);
}

/* ---- The EzyRoller ---- */

static void text_same (const char *parameter, double value, const char *method, double t) {
  double state[2][12];
  const char *name[] = { "ezyroller", "tests/models/ezyroller.yaml" };
  for (int i = 0; i < 2; i++) {
    gallery_scene x = gallery_load (name[i], parameter, value, NULL);
    runs_state (x.system, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-8 }, t, state[i], state[i] + 6, NULL);
    gallery_close (&x);
  }
  check_bits ("the EzyRoller as text", state[0], state[1], 12);
}

TEST (ezyroller) {
  text_same (NULL, 0, "rk4+projection", 20);
  text_same ("b", 0.7, "rk4+projection", 5);
  text_same ("m2", 0.2, "ida+ggl", 5);
}

/* Parameters, run defaults and the line about it are those of the C file. */
TEST (table) {
  gallery_scene c = gallery_load ("ezyroller", NULL), y = gallery_load ("tests/models/ezyroller.yaml", NULL);
  const pw_plugin_table *a = pw_file_table (c.file), *b = pw_file_table (y.file);
  assert_string_equal (a->about, b->about);
  assert_string_equal (a->run.method, b->run.method);
  check_bits ("t_end", &a->run.t_end, &b->run.t_end, 1);
  check_bits ("step", &a->run.step, &b->run.step, 1);
  const pw_parameter *p = a->parameters, *q = b->parameters;
  for (; p->name; p++, q++) {
    assert_string_equal (p->name, q->name);
    assert_string_equal (p->unit, q->unit);
    assert_string_equal (p->about, q->about);
    assert_int_equal (p->domain, q->domain);
    check_bits (p->name, &p->value, &q->value, 1);
  }
  assert_null (q->name);
  assert_string_equal (pw_file_name (y.file), "ezyroller");
  gallery_close (&c);
  gallery_close (&y);
}

TEST (parameters) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open ("tests/models/ezyroller.yaml", &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_model *m = pw_file_model (f, &error);
  assert_int_equal (pw_model_set (m, "omga", 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller has no parameter \"omga\"; did you mean \"omega\"?");
  error.status = 0;
  assert_int_equal (pw_model_set (m, "m1", 0, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: parameter m1 = 0: expected a number > 0");
  pw_model_free (m);
  pw_file_close (f);
}

/* A unit that contains the name of a unit as part of a word, or "in" as a preposition, is only displayed. */
TEST (units_in_words) {
  static const char *const unit[] = { "persons in lane", "µgal", "mµs per ångström", "hôtel", "göteborg" };
  char source[200];
  for (int i = 0; i < 5; i++) {
    snprintf (source, sizeof source,
              "pinwheel: 1\nparameters: [{name: a, value: 1, unit: %s}]\nbodies: [{name: b, mass: a}]\n", unit[i]);
    gallery_scene x = text_of (source, NULL, 0);
    assert_string_equal (pw_file_table (x.file)->parameters->unit, unit[i]);
    gallery_close (&x);
  }
}

/* ---- What is built ---- */

TEST (let) {
  static const char source[] = "pinwheel: 1\n"
                               "parameters:\n  - {name: l, value: 2}\n"
                               "let: {half: l/2, area: half^2*pi}\n"
                               "bodies:\n  - {name: b, mass: area, start: {x: half, phi: 90*deg}}\n";
  for (int i = 0; i < 2; i++) {
    double l = i ? 6 : 2, half = l / 2, mass = half * half * PW_PI, phi = 90 * (PW_PI / 180);
    gallery_scene x = text_of (source, "l", l);
    check_bits ("mass", &x.model->body[0].mass, &mass, 1);
    check_bits ("x", &x.model->body[0].start[0], &half, 1);
    check_bits ("phi", &x.model->body[0].start[2], &phi, 1);
    gallery_close (&x);
  }
}

#define TWO_BODIES                                             \
  "pinwheel: 1\n"                                              \
  "parameters: [{name: A, value: 0.1}, {name: w, value: 2}]\n" \
  "let: {k: 2*A}\n"                                            \
  "bodies: [{name: a, mass: 1, inertia: 0.1}, {name: b, mass: 2, inertia: 0.3, start: {x: 1}}]\n"

static const pw_signal *text_signal (const gallery_scene *x, int element) {
  const pw_element *e = &x->model->element[element];
  return pw_field_at (e->kind, e->definition, PW_SIGNAL, 0);
}

/* A torque as an expression of time is the harmonic one but for round-off. */
TEST (time) {
  static const char *const value[] = { "{harmonic: {amplitude: A, omega: w, phase: 0.5, offset: k}}",
                                       "k + A*cos(w*t + 0.5)" };
  double q[2][6], v[2][6];
  char source[600];
  for (int i = 0; i < 2; i++) {
    snprintf (source, sizeof source, TWO_BODIES "elements:\n  - {torque: T, body: [a, b], value: %s}\n", value[i]);
    gallery_scene x = text_of (source, NULL, 0);
    assert_int_equal (text_signal (&x, 0)->type, i ? PW_FUNCTION : PW_HARMONIC);
    runs_state (x.system, "rk4", &(pw_settings){ .step = 1e-2 }, 3, q[i], v[i], NULL);
    gallery_close (&x);
  }
  for (int j = 0; j < 6; j++)
    check_close ("state", q[1][j], q[0][j], 1000 * CHECK_EPS * (1 + fabs (q[0][j])), "300 steps of round-off");
}

/* A torque that reads states: the derivative is what it should be, and the motion that of a spring. */
TEST (states) {
  gallery_scene x = text_of (
      TWO_BODIES "elements:\n  - {torque: T, body: [a, ground], value: -w*a.phi - A*a.omega*a.phi^2}\n", NULL, 0);
  const pw_function *f = &text_signal (&x, 0)->function;
  void *own = f->open (f->context);
  double value[3] = { 0 }, gradient[2] = { 0 };
  assert_string_equal (f->reads[0], "a.phi");
  assert_string_equal (f->reads[1], "a.omega");
  assert_null (f->reads[2]);
  assert_int_equal (f->eval (own, 0, (double[]){ 1.5, -2 }, value, gradient), 0);
  check_close ("value", value[0], -2 * 1.5 + 0.1 * 2 * 1.5 * 1.5, 8 * CHECK_EPS, "round-off");
  double bound = 100 * pow (CHECK_EPS, 2.0 / 3); /* central differences */
  check_close ("derivative with respect to phi", gradient[0], -2 + 2 * 0.1 * 2 * 1.5, bound, "differences");
  check_close ("derivative with respect to omega", gradient[1], -0.1 * 1.5 * 1.5, bound, "differences");
  f->close (own);
  gallery_close (&x);
}

/* A cart on a wheel whose spin pulls it back, by a force that is written before the wheel and by a torque of its own:
 * (I + m r^2) spin'' = -(r 0.54 + 0.054) spin. */
TEST (own_states) {
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (int i = 0; i < 2; i++) {
    double q[4], v[4], bound = i == 0 ? 1e-10 : 1e-6;
    const char *reason = i == 0 ? "(h k)^4 at h = 1e-3 and k = 3/s" : "1e4 rtol";
    gallery_scene x = text_of ("pinwheel: 1\nbodies: [{name: cart, mass: 1, inertia: 1, rate: {vx: 0.2}}]\nelements:\n"
                               "  - {force: F, body: cart, fx: -0.54*W.spin}\n"
                               "  - {rolling-wheel: W, body: cart, at: [0, 0], radius: 0.1, inertia: 0.002,\n"
                               "     torque: -0.05*W.spin - 0.004*W.spin - 0*W.spin_rate}\n",
                               NULL, 0);
    runs_state (x.system, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2 }, 2, q, v, NULL);
    check_close ("spin", q[3], 2 / 3. * sin (3 * 2), bound, reason);
    check_close ("its rate", v[3], 2 * cos (3 * 2), bound, reason);
    check_close ("x", q[0], 0.1 * q[3], bound, reason);
    gallery_close (&x);
  }
}

/* The signal of a drive with its derivatives: value, rate and acceleration at a time; a system's context outlives the
 * model. */
TEST (drive) {
  gallery_scene x =
      text_of (TWO_BODIES "elements:\n"
                          "  - drive: D\n    body: [a, ground]\n    at: [[0, 0], [0, 0]]\n    what: angle\n"
                          "    value: {expression: k*sin(w*t), rate: k*w*cos(w*t), acceleration: -k*w^2*sin(w*t)}\n",
               "A", 0.3);
  const pw_signal s = *text_signal (&x, 0);
  void *own = s.function.open (s.function.context);
  double value[3];
  pw_model_free (x.model);
  x.model = NULL;
  assert_int_equal (s.function.eval (own, 0.7, NULL, value, NULL), 0);
  s.function.close (own);
  check_close ("value", value[0], 0.6 * sin (1.4), 8 * CHECK_EPS, "round-off");
  check_close ("rate", value[1], 1.2 * cos (1.4), 8 * CHECK_EPS, "round-off");
  check_close ("acceleration", value[2], -2.4 * sin (1.4), 16 * CHECK_EPS, "round-off");
  double q[6], v[6];
  runs_state (x.system, "rk4+projection", &(pw_settings){ .step = 1e-2 }, 1, q, v, NULL);
  check_close ("the driven angle", q[2], 0.6 * sin (2), 100 * CHECK_EPS, "projected: round-off");
  gallery_close (&x);
}

/* The derivatives are compared with differences, whether the signal is slow, fast, far from zero, or at rest. */
TEST (derivatives) {
  static const double scale[][3] = { { 1e-3, 2e-4, 0 }, { 1, 1, 0 }, { 0.1, 900, 1e6 }, { 1e4, 1e5, 3 }, { 0, 1, 0 } };
  for (size_t i = 0; i < sizeof scale / sizeof *scale; i++) {
    char source[800];
    const double *s = scale[i];
    snprintf (source, sizeof source,
              TWO_BODIES "elements:\n"
                         "  - drive: D\n    body: [a, ground]\n    at: [[0, 0], [0, 0]]\n    what: x\n    value:\n"
                         "      expression: %g*sin(%g*t) + %g\n"
                         "      rate: %g*%g*cos(%g*t)\n"
                         "      acceleration: -%g*%g^2*sin(%g*t)\n",
              s[0], s[1], s[2], s[0], s[1], s[1], s[0], s[1], s[1]);
    gallery_scene x = text_of (source, NULL, 0);
    gallery_close (&x);
  }
}

/* A signal without a value stops the run. */
TEST (no_value) {
  gallery_scene x = text_of (TWO_BODIES "elements:\n  - {torque: T, body: [a, b], value: sqrt(1 - t)}\n", NULL, 0);
  pw_error error = { 0 };
  pw_run *r = runs_open (x.system, "rk4", &(pw_settings){ .step = 1e-2 });
  assert_int_equal (pw_run_advance_to (r, 2, 2, &error), PW_METHOD);
  pw_run_close (r);
  gallery_close (&x);
}

/* A value over fifty lines is one expression. */
TEST (lines) {
  char source[2000] = TWO_BODIES "elements:\n  - torque: T\n    body: [a, b]\n    value:\n      1";
  double q[6], v[6];
  for (int i = 1; i < 50; i++) strcat (source, "\n      + 1");
  gallery_scene x = text_of (source, NULL, 0);
  runs_state (x.system, "rk4", &(pw_settings){ .step = 1e-2 }, 1, q, v, NULL);
  check_close ("angular velocity", v[2], 500, 1e-10, "50 N m on 0.1 kg m^2 for a second");
  gallery_close (&x);
}

const check_fixture fixture = { cli_setup, cli_teardown };
