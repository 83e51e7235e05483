/* Invalid descriptions: every message of the core about bodies, elements, fields, signals and element types. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "toys.h"
#include "trial.h"

SCENE (messages_build) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 1 });
  pw_add_body (m, &(pw_body){ .name = "steer", .mass = 1, .inertia = 1 });
}

/* ---- Invalid bodies and elements ---- */

/* Executes statements that make the valid model m invalid, and expects "model scene" with this text. */
#define BAD(text, ...)                                       \
  do {                                                       \
    pw_model *m = scene_model (&messages_build_table, NULL); \
    __VA_ARGS__;                                             \
    scene_refused (m, "model scene" text);                   \
  } while (0)
#define BODY(...) pw_add_body (m, &(pw_body){ __VA_ARGS__ })
#define PIN(...) pw_add_pin (m, &(pw_pin){ __VA_ARGS__ })
#define WHEEL(...) pw_add_wheel (m, &(pw_wheel){ __VA_ARGS__ })
#define TORQUE(...) pw_add_torque (m, &(pw_torque){ .body = { "frame", "steer" }, __VA_ARGS__ })

#define MESSAGES_50 "a-name-of-fifty-bytes-that-is-longer-than-it-shoul"

TEST (bad_names) {
  BAD (": a body without a name", BODY (.mass = 1));
  BAD (": a body without a name", BODY (.name = ""));
  BAD (": a pin without a name", PIN (.body = { "frame", "steer" }));
  BAD (": body \"ground\": this name is reserved for the ground", BODY (.name = "ground"));
  BAD (": wheel \"ground\": this name is reserved for the ground", WHEEL (.name = "ground", .body = "frame"));
  BAD (": body \"rear axle\": expected letters, digits, _, - and characters beyond ASCII", BODY (.name = "rear axle"));
  BAD (": body \"a.b\": expected letters, digits, _, - and characters beyond ASCII", BODY (.name = "a.b"));
  BAD (": body \"a?\": expected letters, digits, _, - and characters beyond ASCII", BODY (.name = "a\xFF"));
  BAD (": body \"a??\": expected letters, digits, _, - and characters beyond ASCII", BODY (.name = "a\xC2\x9B"));
  BAD (": body \"" MESSAGES_50 "...\": a name has at most 50 bytes, this one 51", BODY (.name = MESSAGES_50 "x"));
  BAD (": wheel \"" MESSAGES_50 "...\": a name has at most 50 bytes, this one 150",
       WHEEL (.name = MESSAGES_50 MESSAGES_50 MESSAGES_50, .body = "frame"));
  BAD (": two bodies are named \"steer\"", BODY (.name = "steer"));
  BAD (": a body and a wheel are both named \"frame\"", WHEEL (.name = "frame", .body = "frame"));
  BAD (": two elements are named \"A\"", WHEEL (.name = "A", .body = "frame"); WHEEL (.name = "A", .body = "steer"));
}

TEST (bad_bodies) {
  BAD (": body x: mass = -1: expected a number >= 0", BODY (.name = "x", .mass = -1));
  BAD (": body x: mass = nan: expected a finite number", BODY (.name = "x", .mass = NAN));
  BAD (": body x: inertia = -0.5: expected a number >= 0", BODY (.name = "x", .inertia = -0.5));
  BAD (": body x: start x = inf: expected a finite number", BODY (.name = "x", .start = { INFINITY, 0, 0 }));
  BAD (": body x: start y = inf: expected a finite number", BODY (.name = "x", .start = { 0, INFINITY, 0 }));
  BAD (": body x: start phi = inf: expected a finite number", BODY (.name = "x", .start = { 0, 0, INFINITY }));
  BAD (": body x: rate vx = nan: expected a finite number", BODY (.name = "x", .rate = { NAN, 0, 0 }));
  BAD (": body x: rate vy = nan: expected a finite number", BODY (.name = "x", .rate = { 0, NAN, 0 }));
  BAD (": body x: rate omega = nan: expected a finite number", BODY (.name = "x", .rate = { 0, 0, NAN }));
  static const double outline[3][2] = { { 0, 0 }, { 1, 0 }, { 0, INFINITY } };
  BAD (": body x: its outline has 3 corners, not all of them finite: expected 3 to 2000",
       BODY (.name = "x", .corners = 3, .outline = outline));
  BAD (": body x: its outline has 1000000000 corners: expected 3 to 2000",
       BODY (.name = "x", .corners = 1000000000, .outline = outline));
}

TEST (bad_references) {
  BAD (": pin B: there is no body \"ster\"; did you mean \"steer\"?", PIN (.name = "B", .body = { "frame", "ster" }));
  BAD (": pin B: there is no body \"Ground\"; did you mean \"ground\"?",
       PIN (.name = "B", .body = { "frame", "Ground" }));
  BAD (": wheel A: there is no body \"A\"; valid are frame, steer, ground", WHEEL (.name = "A", .body = "A"));
  BAD (": pin B: a body is missing (the ground is \"ground\")", PIN (.name = "B", .body = { "frame" }));
  BAD (": wheel A: a body is missing (the ground is \"ground\")", WHEEL (.name = "A", .body = ""));
  BAD (": pin B: both of its bodies are \"frame\": expected different ones",
       PIN (.name = "B", .body = { "frame", "frame" }));
  BAD (": pin B: both of its bodies are \"ground\": expected different ones",
       PIN (.name = "B", .body = { "ground", "ground" }));
  BAD (": wheel A: expected a body other than the ground, which does not move", WHEEL (.name = "A", .body = "ground"));
}

TEST (bad_numbers) {
  BAD (": pin B: at[1] = nan: expected a finite number",
       PIN (.name = "B", .body = { "frame", "steer" }, .at = { { 0, 0 }, { 0, NAN } }));
  BAD (": pfaffian p: a[2] = inf: expected a finite number",
       pw_add_pfaffian (m, &(pw_pfaffian){ .name = "p", .body = { "frame", "steer" }, .a = { 1, 0, INFINITY } }));
  BAD (": wheel A: heading = inf: expected a finite number", WHEEL (.name = "A", .body = "frame", .heading = INFINITY));
  BAD (": roller A: radius = 0: expected a number > 0",
       pw_add (m, &toy_kind_roller, &(toy_roller){ .name = "A", .body = "frame" }));
  BAD (": spring k: a length of 2 is too long", /* the kind's own check */
       pw_add (m, &toy_kind_spring, &(toy_spring){ .name = "k", .body = { "frame", "steer" }, .length = 2 }));
}

TEST (bad_signals) {
  BAD (": torque T: value: nan: expected a finite number", TORQUE (.name = "T", .value = { .constant = NAN }));
  BAD (": torque T: value: omega = inf: expected a finite number",
       TORQUE (.name = "T", .value = { PW_HARMONIC, .harmonic = { .amplitude = 1, .omega = INFINITY } }));
  BAD (": torque T: value: a function signal without eval", TORQUE (.name = "T", .value = { .type = PW_FUNCTION }));
  BAD (": torque T: value: signal type 9 does not exist", TORQUE (.name = "T", .value = { .type = (pw_signal_type)9 }));
}

/* ---- Signals that read states ---- */

static int messages_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t, (void)x, (void)gradient;
  value[0] = 0;
  return 0;
}

static const char *const messages_reads[] = { "stear.phi", NULL };

#define READER                                                                 \
  {                                                                            \
    PW_FUNCTION, .function = {.eval = messages_eval, .reads = messages_reads } \
  }

TEST (bad_readers) {
  BAD (": element T reads a state: model scene has no state \"stear.phi\"; did you mean \"steer.phi\"?",
       TORQUE (.name = "T", .value = READER));
  BAD (": drive D: angle: the signal of this constraint may depend on the time only",
       pw_add (m, &toy_kind_drive, &(toy_drive){ .name = "D", .body = { "frame", "steer" }, .angle = READER }));
}

/* ---- Choices ---- */

typedef struct {
  const char *name;
  const char *body;
  int mode;
} messages_chooser;

static const char *const messages_modes[] = { "slow", "fast", NULL };
static const pw_field messages_fields[] = {
  { PW_AT (messages_chooser, body), PW_BODY, .about = "a body" },
  { PW_AT (messages_chooser, mode), PW_CHOICE, .choices = messages_modes, .about = "a choice" },
  { .name = NULL },
};
static const pw_kind messages_kind = {
  .name = "chooser", .definition = sizeof (messages_chooser), .fields = messages_fields, .bodies = 1
};

TEST (bad_choices) {
  BAD (": chooser c: mode = 2: expected 0 to 1", pw_add (m, &messages_kind, &(messages_chooser){ "c", "frame", 2 }));
  BAD (": chooser c: mode = -1: expected 0 to 1", pw_add (m, &messages_kind, &(messages_chooser){ "c", "frame", -1 }));
}

/* ---- Invalid element types and models ---- */

TEST (bad_kinds) {
  pw_kind kind = messages_kind;
  kind.rows = 1; /* but .level is PW_FORCE */
  BAD (": element type chooser: rows and level are inconsistent",
       pw_add (m, &kind, &(messages_chooser){ "c", "frame", 0 }));
  kind = messages_kind;
  kind.fields = NULL;
  BAD (": element type chooser: no table of fields", pw_add (m, &kind, &(messages_chooser){ "c", "frame", 0 }));
  kind.name = NULL;
  BAD (": element type (unnamed): no name", pw_add (m, &kind, &(messages_chooser){ "c", "frame", 0 }));
  BAD (": element type (unnamed): the table is NULL", pw_add (m, NULL, &(messages_chooser){ "c", "frame", 0 }));
}

/* Gravity acts on each body: the scene has 6000 x 6000 elements. */
TEST (too_large) {
  enum { COUNT = 6000 };
  static char name[COUNT][2][8];
  pw_model *m = scene_model (&messages_build_table, NULL);
  for (int i = 0; i < COUNT; i++) {
    snprintf (name[i][0], sizeof name[i][0], "b%d", i);
    snprintf (name[i][1], sizeof name[i][1], "g%d", i);
    pw_add_body (m, &(pw_body){ .name = name[i][0], .mass = 1, .inertia = 1 });
    pw_add_gravity (m, &(pw_gravity){ .name = name[i][1], .acceleration = { 0, -9.81 } });
  }
  scene_refused (m, "model scene is too large");
}

/* Writes more bytes than .element declares. */
static int messages_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                             pw_error *error) {
  (void)bodies, (void)internal, (void)error;
  memcpy (element, definition, sizeof (messages_chooser));
  return PW_OK;
}

TEST (bad_prepare) {
  pw_kind kind = messages_kind;
  kind.prepare = messages_prepare;
  kind.element = sizeof (messages_chooser) - 8;
  BAD (": element type chooser: prepare writes more than the 16 bytes of .element",
       pw_add (m, &kind, &(messages_chooser){ "c", "frame", 1 }));
}

/* A flywheel.  mode 0: fails without a message; 1, 2: an invalid inertia. */
static int messages_flywheel (const void *definition, const pw_body *const *bodies, void *element,
                              pw_internal *internal, pw_error *error) {
  int mode = ((const messages_chooser *)definition)->mode;
  (void)bodies, (void)element, (void)error;
  if (mode == 0) return PW_RESOURCE;
  internal[0].mass = mode == 2 ? NAN : mode == 1 ? -3 : 1;
  return PW_OK;
}

TEST (bad_internal) {
  static const pw_quantity angle[] = { { "turn", "rad", "turn_rate", NULL } };
  static const pw_quantity length[] = { { "travel", "m", "speed", NULL } };
  static const char *const mode[] = { "zero", "one", "two", NULL };
  const pw_field fields[] = { { PW_AT (messages_chooser, body), PW_BODY },
                              { PW_AT (messages_chooser, mode), PW_CHOICE, .choices = mode },
                              { .name = NULL } };
  pw_kind kind = { .name = "flywheel",
                   .definition = sizeof (messages_chooser),
                   .fields = fields,
                   .bodies = 1,
                   .internal = 1,
                   .coordinate = angle,
                   .prepare = messages_flywheel };
  BAD (": flywheel f: inertia of turn = -3: expected a number >= 0",
       pw_add (m, &kind, &(messages_chooser){ "f", "frame", 1 }));
  BAD (": flywheel f: inertia of turn = nan: expected a finite number",
       pw_add (m, &kind, &(messages_chooser){ "f", "frame", 2 }));
  kind.coordinate = length;
  BAD (": element type flywheel: an internal coordinate whose unit is neither rad nor none",
       pw_add (m, &kind, &(messages_chooser){ "f", "frame", 0 }));
  kind.coordinate = angle;
  pw_error error = { 0 };
  pw_model *m = scene_model (&messages_build_table, NULL);
  pw_add (m, &kind, &(messages_chooser){ "f", "frame", 0 });
  assert_null (pw_system_compile (m, &error));
  check_error (&error, PW_RESOURCE, "model scene: flywheel f: prepare refuses it");
  pw_model_free (m);
}

/* A missing name is an error. */
TEST (missing_names) {
  pw_model *m = scene_model (&messages_build_table, NULL);
  const pw_signal nothing = { 0 };
  pw_error error = { 0 };
  assert_int_equal (pw_model_set (m, NULL, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: the name of a parameter is missing");
  error = (pw_error){ 0 };
  assert_int_equal (pw_model_set_initial (m, NULL, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: the name of a state is missing");
  error = (pw_error){ 0 };
  assert_int_equal (pw_model_set_signal (m, NULL, "value", &nothing, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: the name of an element is missing");
  pw_system *s = scene_compile (m);
  error = (pw_error){ 0 };
  assert_int_equal (pw_system_find_state (s, NULL, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: the name of a state is missing");
  assert_int_equal (pw_system_find_body (s, NULL), -1);
  pw_system_free (s);
}

static const pw_parameter messages_outside[] = { { "a", 8, 1, "m", "a length", PW_REAL }, { .name = NULL } };
static const pw_parameter messages_domain[] = { { "a", 0, 1, "m", "a length", (pw_domain)77 }, { .name = NULL } };

TEST (bad_parameters) {
  pw_error error = { 0 };
  pw_plugin_table table = messages_build_table;
  table.parameters = messages_outside;
  table.parameters_size = 8;
  assert_null (pw_model_new ("scene", &table, &error));
  check_error (&error, PW_INPUT,
               "model scene: parameter a lies outside the model's structure: set .parameters_size to its sizeof");
  table.parameters = (pw_parameter[]){ { "a", SIZE_MAX, 1, "m", "a length", PW_REAL }, { .name = NULL } };
  error = (pw_error){ 0 };
  assert_null (pw_model_new ("scene", &table, &error));
  check_error (&error, PW_INPUT,
               "model scene: parameter a lies outside the model's structure: set .parameters_size to its sizeof");
  error = (pw_error){ 0 };
  table.parameters = NULL;
  table.parameters_size = SIZE_MAX;
  assert_null (pw_model_new ("scene", &table, &error));
  check_error (&error, PW_RESOURCE, "model scene: out of memory");
  error = (pw_error){ 0 };
  table.parameters_size = 8;
  table.parameters = messages_domain;
  assert_null (pw_model_new ("scene", &table, &error));
  check_error (&error, PW_INPUT, "model scene: parameter a: its domain does not exist");
}

static void messages_empty (pw_model *m, const void *parameters) {
  (void)m, (void)parameters;
}

TEST (no_body) {
  pw_plugin_table table = SCENE_TABLE (messages_empty);
  scene_refused (scene_model (&table, NULL), "model scene has no body");
}
