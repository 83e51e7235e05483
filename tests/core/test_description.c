/* The description: parameters, the order of calls, initial values, names and sizes in the compiled system.
 *
 * Together with test_messages.c this provokes every message of the core, except "out of memory" (test_alloc.c). */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "pinwheel-files.h"
#include "pinwheel-selftest.h"
#include "scene.h"
#include "system.h"
#include "toys.h"
#include "trial.h"

/* ---- A model with parameters of all domains ---- */

typedef struct {
  double length, mass, ratio, links;
} description_parameters;

static const pw_parameter description_list[] = {
  { PW_AT (description_parameters, length), 2, "m", "any", PW_REAL },
  { PW_AT (description_parameters, mass), 3, "kg", "of the frame", PW_POSITIVE },
  { PW_AT (description_parameters, ratio), 0, "", "of something", PW_NONNEGATIVE },
  { PW_AT (description_parameters, links), 1, "", "how many", PW_COUNT },
  { .name = NULL },
};

SCENE_WITH (description, description_list, description_parameters) {
  if (p->links > 5) pw_model_refuse (m, "links = %g: at most %d", p->links, 5);
  pw_add_body (
      m,
      &(pw_body){ .name = "frame", .mass = p->mass, .inertia = 1, .start = { p->length, 1, 2 }, .rate = { 3, 4, 5 } });
  pw_add_body (m, &(pw_body){ .name = "steer", .mass = 1, .inertia = 1 });
}

TEST (parameters) {
  pw_system *s = scene_system (&description_table, NULL);
  assert_true (s->q0[0] == 2 && s->mass[0] == 3); /* the defaults */
  pw_system_free (s);
  s = scene_system (&description_table, "length", -7.5, "mass", 0.25, NULL);
  assert_true (s->q0[0] == -7.5 && s->q0[1] == 1 && s->q0[2] == 2 && s->v0[0] == 3 && s->v0[1] == 4 && s->v0[2] == 5);
  assert_true (s->mass[0] == 0.25 && s->mass[1] == 0.25 && s->mass[2] == 1);
  pw_system_free (s);
}

static void description_not_set (const char *name, double value, const char *text) {
  pw_error error = { 0 };
  pw_model *m = pw_model_new ("cart", &description_table, &error);
  assert_int_equal (pw_model_set (m, name, value, &error), PW_INPUT);
  check_error (&error, PW_INPUT, text);
  pw_model_free (m);
}

TEST (bad_parameters) {
  description_not_set ("lenght", 1, "model cart has no parameter \"lenght\"; did you mean \"length\"?");
  description_not_set ("length", NAN, "model cart: parameter length = nan: expected a finite number");
  description_not_set ("length", INFINITY, "model cart: parameter length = inf: expected a finite number");
  description_not_set ("mass", 0, "model cart: parameter mass = 0: expected a number > 0");
  description_not_set ("ratio", -1, "model cart: parameter ratio = -1: expected a number >= 0");
  description_not_set ("links", 1.5, "model cart: parameter links = 1.5: expected a whole number >= 1");
}

TEST (no_parameters) {
  pw_plugin_table table = SCENE_TABLE (description);
  pw_error error = { 0 };
  pw_model *m = pw_model_new ("cart", &table, &error);
  assert_int_equal (pw_model_set (m, "length", 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model cart has no parameter \"length\"");
  pw_model_free (m);
}

TEST (refused) {
  pw_error error = { 0 };
  pw_model *m = pw_model_new ("cart", &description_table, &error);
  check_ok (pw_model_set (m, "links", 7, &error), &error);
  assert_int_equal (pw_model_build (m, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model cart: links = 7: at most 5");
  pw_model_free (m);
}

TEST (bad_tables) {
  pw_error error = { 0 };
  pw_plugin_table table = description_table;
  table.abi = PW_ABI + 6;
  assert_null (pw_model_new ("cart", &table, &error));
  check_error (
      &error, PW_INPUT,
      check_text (
          "model cart was compiled for another Pinwheel (ABI %d, this one has %d; table of %zu bytes, here %zu): "
          "recompile it",
          PW_ABI + 6, PW_ABI, sizeof table, sizeof table));
  table = description_table;
  table.build = NULL;
  error.status = PW_OK;
  assert_null (pw_model_new ("cart", &table, &error));
  check_error (&error, PW_INPUT, "model cart has no build function: PW_MODEL (...) at its end must set .build");
  static const struct pw_method *const methods[] = { NULL };
  table.methods = methods;
  error.status = PW_OK;
  assert_null (pw_model_new ("cart", &table, &error));
  check_error (&error, PW_INPUT, "model cart contains integration methods, but no build function");
}

TEST (order_of_calls) {
  pw_error error = { 0 };
  pw_model *m = pw_model_new ("cart", &description_table, &error);
  assert_null (pw_system_compile (m, &error));
  check_error (&error, PW_INPUT, "model cart: pw_system_compile before pw_model_build");
  error.status = PW_OK;
  check_ok (pw_model_build (m, &error), &error);
  assert_int_equal (pw_model_set (m, "length", 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model cart: parameter length: pw_model_set after pw_model_build");
  error.status = PW_OK;
  assert_int_equal (pw_model_build (m, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model cart: pw_model_build called twice");
  pw_model_free (m);
}

/* NULL, the result of a failed call, is an error of every function that takes it. */
TEST (missing) {
  pw_error e[] = { { 0 }, { 0 }, { 0 }, { 0 }, { 0 }, { 0 } };
  assert_int_equal (pw_model_set (NULL, "length", 1, &e[0]), PW_INPUT);
  assert_int_equal (pw_model_build (NULL, &e[1]), PW_INPUT);
  assert_int_equal (pw_model_set_signal (NULL, "motor", "value", &(pw_signal){ 0 }, &e[2]), PW_INPUT);
  assert_int_equal (pw_model_set_initial (NULL, "cart.x", 1, &e[3]), PW_INPUT);
  assert_null (pw_system_compile (NULL, &e[4]));
  for (int i = 0; i < 5; i++) check_error (&e[i], PW_INPUT, "a model is missing");
  assert_int_equal (pw_add_body (NULL, &(pw_body){ .name = "cart" }), PW_INPUT);
  assert_int_equal (pw_add_wheel (NULL, &(pw_wheel){ .name = "W", .body = "cart" }), PW_INPUT);
  assert_null (pw_file_model (NULL, &e[5]));
  check_error (&e[5], PW_INPUT, "a model file is missing");
}

TEST (missing_system) {
  pw_error e[6] = { { 0 } };
  double q[3] = { 0 };
  pw_equations equations;
  pw_selftest_report report = { 0 };
  pw_model *m = scene_model (&description_table, NULL);
  assert_int_equal (pw_system_find_state (NULL, "cart.x", &e[0]), PW_INPUT);
  assert_int_equal (pw_system_find_reaction (NULL, "W.N", &e[1]), PW_INPUT);
  assert_int_equal (pw_system_find_signal (NULL, "motor", &e[2]), PW_INPUT);
  assert_int_equal (pw_system_equations (NULL, 0, q, q, &equations, &e[3]), PW_INPUT);
  assert_int_equal (pw_system_reference (m, NULL, 0, q, q, &e[4]), PW_INPUT);
  assert_int_equal (pw_selftest_scene (NULL, 1, &pw_kind_wheel, 0, q, q, 1, &report, &e[5]), PW_INPUT);
  for (int i = 0; i < 6; i++) check_error (&e[i], PW_INPUT, "a system is missing");
  e[0] = (pw_error){ 0 };
  assert_null (pw_workspace_new (NULL, &e[0]));
  check_error (&e[0], PW_INPUT, "a system is missing");
  pw_equations_free (&equations);
  pw_model_free (m);
  assert_int_equal (pw_verify (NULL, &(pw_scale){ 1, 1 }, 0, q, q, q, q, &(pw_verification){ 0 }), PW_INPUT);
}

TEST (missing_workspace) {
  pw_error e[2] = { { 0 } };
  double q[3] = { 0 }, out[3];
  assert_int_equal (pw_workspace_contact_points (NULL, 0, q, q, &out, &e[0]), PW_INPUT);
  assert_int_equal (pw_workspace_forces (NULL, 0, q, q, q, out, &e[1]), PW_INPUT);
  for (int i = 0; i < 2; i++) check_error (&e[i], PW_INPUT, "a workspace is missing");
}

SCENE (description_add_no_body) {
  pw_add_body (m, NULL);
}

SCENE (description_add_no_pin) {
  pw_add_pin (m, NULL);
}

TEST (missing_definitions) {
  static const pw_plugin_table *const table[] = { &description_add_no_body_table, &description_add_no_pin_table };
  static const char *const text[] = { "model cart: pw_add_body without a body",
                                      "model cart: pw_add of element type pin without a definition" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_model *m = pw_model_new ("cart", table[i], &error);
    assert_int_equal (pw_model_build (m, &error), PW_INPUT);
    check_error (&error, PW_INPUT, text[i]);
    pw_model_free (m);
  }
}

/* ---- Changes of a built model ---- */

static void description_no_signal (const char *element, const char *field, const char *text) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  assert_int_equal (pw_model_set_signal (m, element, field, &(pw_signal){ 0 }, &error), PW_INPUT);
  check_error (&error, PW_INPUT, text);
  pw_model_free (m);
}

TEST (bad_set_signal) {
  description_no_signal ("ridder", "value", "model ezyroller has no element \"ridder\"; did you mean \"rider\"?");
  description_no_signal ("rider", "values",
                         "model ezyroller: torque rider has no signal \"values\"; did you mean \"value\"?");
  description_no_signal ("A", "value",
                         "model ezyroller: wheel A has no signal \"value\"; valid are grip, grip_sliding");
}

/* An element type whose field has two signals. */
typedef struct {
  const char *name, *body;
  pw_signal u[2];
} description_pair;

static const pw_field description_fields[] = {
  { PW_AT (description_pair, body), PW_BODY },
  { PW_AT (description_pair, u), PW_SIGNAL, .count = 2 },
  { .name = NULL },
};
static const pw_kind description_kind = {
  .name = "pair", .definition = sizeof (description_pair), .fields = description_fields, .bodies = 1, .signals = 2
};

TEST (set_one_of_two) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  pw_add (m, &description_kind, &(description_pair){ "pair", "frame", { { .constant = 1 }, { .constant = 2 } } });
  check_ok (pw_model_set_signal (m, "pair", "u[1]", &(pw_signal){ .constant = 5 }, &error), &error);
  pw_system *s = pw_system_compile (m, &error);
  int first = pw_system_find_signal (s, "pair.u[0]", &error), second = pw_system_find_signal (s, "pair.u[1]", &error);
  check_ok (error.status, &error);
  assert_true (s->source[first].signal.constant == 1 && s->source[second].signal.constant == 5);
  assert_int_equal (pw_model_set_signal (m, "pair", "u", &(pw_signal){ 0 }, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: pair pair has no signal \"u\"; did you mean \"u[0]\"?");
  pw_system_free (s);
  pw_model_free (m);
}

TEST (initial) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_initial (m, "frame.phi", 0.5, &error), &error);
  check_ok (pw_model_set_initial (m, "steer.vy", -2, &error), &error);
  pw_system *s = scene_compile (m);
  assert_true (s->q0[2] == 0.5 && s->v0[4] == -2 && s->origin[2] && s->origin[6 + 4]);
  int given = 0;
  for (int i = 0; i < 12; i++) given += s->origin[i] & PW_GIVEN;
  assert_int_equal (given, 2);
  pw_system_free (s);
}

TEST (bad_initial) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  assert_int_equal (pw_model_set_initial (m, "frame.phi", NAN, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: start frame.phi = nan: expected a finite number");
  error.status = PW_OK;
  check_ok (pw_model_set_initial (m, "frame.ph", 1, &error), &error);
  scene_refused (m, "model ezyroller has no state \"frame.ph\"; did you mean \"frame.phi\"?");
}

/* ---- Names and sizes in the compiled system ---- */

TEST (query) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  char text[100];
  assert_int_equal (pw_system_bodies (s), 2);
  assert_int_equal (pw_system_coordinates (s), 6);
  assert_int_equal (pw_system_rows (s), 4);
  assert_int_equal (pw_system_holonomic (s), 2);
  assert_int_equal (pw_system_ledger_entries (s), 1);
  assert_int_equal (pw_system_find_body (s, "steer"), 1);
  assert_int_equal (pw_system_find_body (s, "ster"), -1);
  static const char *const state_names[] = { "frame.x",     "frame.y",   "frame.phi", "steer.x",
                                             "steer.y",     "steer.phi", "frame.vx",  "frame.vy",
                                             "frame.omega", "steer.vx",  "steer.vy",  "steer.omega" };
  static const char *const units[] = { "m", "m", "rad", "m", "m", "rad", "m/s", "m/s", "rad/s", "m/s", "m/s", "rad/s" };
  for (int i = 0; i < 12; i++) {
    assert_string_equal (pw_system_state_name (s, i, text, sizeof text), state_names[i]);
    assert_string_equal (pw_system_state_unit (s, i), units[i]);
    assert_int_equal (pw_system_find_state (s, state_names[i], NULL), i);
  }
  static const char *const reactions[] = { "B.Fx", "B.Fy", "A.N", "C.N" }, *const elements[] = { "pin B", "pin B",
                                                                                                 "wheel A", "wheel C" };
  for (int i = 0; i < 4; i++) {
    assert_string_equal (pw_system_reaction_name (s, i, text, sizeof text), reactions[i]);
    assert_string_equal (pw_system_reaction_unit (s, i), "N");
    assert_string_equal (pw_system_row_name (s, i, text, sizeof text), elements[i]);
  }
  assert_string_equal (pw_system_ledger_name (s, 0, text, sizeof text), "rider.work");
  pw_system_free (s);
}

static void description_no_state (const pw_system *s, const char *name, const char *text) {
  pw_error error = { 0 };
  assert_int_equal (pw_system_find_state (s, name, &error), PW_INPUT);
  check_error (&error, PW_INPUT, text);
}

TEST (bad_query) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  description_no_state (s, "steer.omga", "model ezyroller has no state \"steer.omga\"; did you mean \"steer.omega\"?");
  description_no_state (s, "ster.phi", "model ezyroller has no state \"ster.phi\"; did you mean \"steer.phi\"?");
  description_no_state (s, "phi", "model ezyroller has no state \"phi\"; did you mean \"frame.phi\"?");
  pw_system_free (s);
}

/* Names of internal coordinates and losses of elements. */
TEST (internal_coordinates) {
  pw_model *m = scene_model (&description_table, NULL);
  pw_add (m, &toy_kind_roller,
          &(toy_roller){ .name = "left", .body = "frame", .at = { 0, 1 }, .radius = 0.1, .inertia = 0.2 });
  pw_add (m, &toy_kind_roller,
          &(toy_roller){ .name = "right", .body = "frame", .at = { 0, -1 }, .radius = 0.1, .inertia = 0.3 });
  pw_add (m, &toy_kind_spring,
          &(toy_spring){ .name = "k", .body = { "frame", "steer" }, .at = { { 3, 4 }, { 0 } }, .length = 1 });
  pw_error error = { 0 };
  check_ok (pw_model_set_initial (m, "right.spinrate", 7, &error), &error);
  pw_system *s = scene_compile (m);
  char text[100];
  assert_int_equal (pw_system_coordinates (s), 8);
  assert_true (s->mass[6] == 0.2 && s->mass[7] == 0.3 && s->v0[7] == 7);
  assert_string_equal (pw_system_state_name (s, 6, text, sizeof text), "left.spin");
  assert_string_equal (pw_system_state_name (s, 8 + 7, text, sizeof text), "right.spinrate");
  assert_string_equal (pw_system_state_unit (s, 7), "rad");
  assert_string_equal (pw_system_state_unit (s, 8 + 7), "rad/s");
  assert_string_equal (pw_system_reaction_name (s, 3, text, sizeof text), "right.T");
  assert_string_equal (pw_system_ledger_name (s, 0, text, sizeof text), "k.loss");
  assert_true (s->scale.length == 5); /* the largest distance of a point from its body's centre of mass */
  description_no_state (s, "left.spun", "model scene has no state \"left.spun\"; did you mean \"left.spin\"?");
  pw_system_free (s);
}

static int description_spin (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = -x[0];
  if (gradient) gradient[0] = -1;
  return 0;
}

/* The description may be changed after it has been handed over: the model keeps copies. */
TEST (copies) {
  char body[] = "cart", name[] = "W", read[] = "cart.omega";
  const char *reads[] = { read, NULL };
  pw_model *m = scene_model (&description_table, NULL);
  pw_add_body (m, &(pw_body){ .name = body });
  pw_add_wheel (m, &(pw_wheel){ .name = name, .body = body });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { body, "ground" },
                                  .value = { PW_FUNCTION, .function = { description_spin, .reads = reads } } });
  memset (body, 'x', 4);
  memset (read, 'x', 4);
  reads[0] = NULL;
  memset (name, 'x', 1);
  pw_system *s = scene_compile (m);
  char text[100];
  assert_int_equal (pw_system_find_body (s, "cart"), 2);
  assert_string_equal (pw_system_row_name (s, 0, text, sizeof text), "wheel W");
  assert_int_equal (s->source[0].reads, 1);
  pw_system_free (s);
}

/* Reactions are found by their names. */
TEST (find_reaction) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  char name[40];
  for (int row = 0; row < pw_system_rows (s); row++)
    assert_int_equal (pw_system_find_reaction (s, pw_system_reaction_name (s, row, name, sizeof name), NULL), row);
  pw_error error = { 0 };
  assert_int_equal (pw_system_find_reaction (s, "B.Fz", &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller has no reaction \"B.Fz\"; did you mean \"B.Fx\"?");
  error = (pw_error){ 0 };
  assert_int_equal (pw_system_find_reaction (s, NULL, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: the name of a reaction is missing");
  pw_system_free (s);
}
