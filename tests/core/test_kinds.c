/* Every element type passes the self-test, which detects each fault made in its functions or its table. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "model.h"
#include "selftest.h"
#include "pinwheel-selftest.h"
#include "scene.h"
#include "toys.h"

enum { KINDS_SEEDS = 100, KINDS_FEW = 6 }; /* random scenes for a good element type, for a faulty one */

static void kinds_run (const pw_kind *kind, int seeds, pw_selftest_report *report) {
  pw_error error = { 0 };
  *report = (pw_selftest_report){ 0 };
  for (int seed = 1; seed <= seeds; seed++) check_ok (pw_selftest (kind, (unsigned)seed, report, &error), &error);
}

static void kinds_pass (const pw_kind *const *kinds) {
  for (; *kinds; kinds++) {
    pw_selftest_report report;
    kinds_run (*kinds, KINDS_SEEDS, &report);
    assert_true (report.checks >= (pw_kind_acts (*kinds) ? 5 : 4));
    for (int i = 0; i < report.checks; i++) {
      const pw_selftest_check *c = &report.check[i];
      check_below (check_text ("%s %s", (*kinds)->name, c->name), c->error, c->bound, c->reason);
    }
  }
}

TEST (built_in) {
  kinds_pass (pw_kinds);
}

/* The types that stand for others. */
static const pw_kind *const kinds_exact[] = { &pw_kind_dry_friction, &pw_kind_dry_sliding_friction,
                                              &pw_kind_slipping_wheel, NULL };

TEST (exact) {
  kinds_pass (kinds_exact);
}

TEST (plug_in) {
  kinds_pass (toy_kinds);
}

/* Specialised code copies elements as doubles.  A small integer, or two of them, would be a subnormal number. */
TEST (doubles) {
  for (const pw_kind *const *kind = pw_kinds; *kind; kind++)
    for (unsigned seed = 1; seed <= KINDS_FEW; seed++) {
      pw_error error = { 0 };
      pw_random random = { .state = seed };
      pw_system *s = pw_random_scene (*kind, &random, &error);
      check_ok (error.status, &error);
      const double *number = s->batch->b.element;
      size_t numbers = (size_t)s->batch->b.count * (*kind)->element / sizeof *number;
      assert_int_equal ((*kind)->element % sizeof *number, 0);
      for (size_t i = 0; i < numbers; i++) assert_int_not_equal (fpclassify (number[i]), FP_SUBNORMAL);
      pw_system_free (s);
    }
}

/* ---- Faulty element types ---- */

static const struct {
  const char *name;
  size_t offset; /* in pw_kind */
} kinds_functions[] = {
#define KINDS_FUNCTION(s) \
  { #s, offsetof(pw_kind, s) }
  KINDS_FUNCTION (g),       KINDS_FUNCTION (g_size),  KINDS_FUNCTION (eta),     KINDS_FUNCTION (J),
  KINDS_FUNCTION (gamma),   KINDS_FUNCTION (force),   KINDS_FUNCTION (force_u), KINDS_FUNCTION (jw_q),
  KINDS_FUNCTION (eta_q),   KINDS_FUNCTION (gamma_q), KINDS_FUNCTION (gamma_v), KINDS_FUNCTION (force_q),
  KINDS_FUNCTION (force_v), KINDS_FUNCTION (energy),  KINDS_FUNCTION (power),   KINDS_FUNCTION (loss),
#undef KINDS_FUNCTION
};
enum { KINDS_FUNCTIONS = sizeof kinds_functions / sizeof *kinds_functions };

static pw_batch_function **kinds_member (pw_kind *kind, size_t offset) {
  return (pw_batch_function **)(void *)((char *)kind + offset);
}

/* The function that a faulty one replaces; the factor of kinds_multiplied. */
static pw_batch_function *kinds_original;
static double kinds_factor;

/* Multiplies all numbers that the original writes; the first one that stays NaN is not written. */
static void kinds_multiplied (const pw_batch *b, double *out) {
  double values[PW_SCENE_OUT];
  for (int i = 0; i < PW_SCENE_OUT; i++) values[i] = NAN;
  kinds_original (b, values);
  for (int i = 0; i < PW_SCENE_OUT && !isnan (values[i]); i++) out[i] = kinds_factor * values[i];
}

/* Saturations that are a thousand times too wide. */
static void kinds_wide (const pw_batch *b, double *out) {
  kinds_original (b, out);
  for (int i = 0; i < b->count * 2 * b->cols; i++) out[i] *= 1000;
}

static void kinds_expect_caught (const pw_kind *kind, const char *function, const char *how) {
  pw_selftest_report report;
  kinds_run (kind, KINDS_FEW, &report);
  if (report.failed > 0) return;
  print_error ("the self-test did not notice: %s of %s %s\n", function, kind->name, how);
  fail ();
}

/* Each function in turn: missing, with the wrong sign, with a relative error of 1e-5. */
static void kinds_break (const pw_kind *kind) {
  for (int i = 0; i < KINDS_FUNCTIONS; i++) {
    pw_kind broken = *kind;
    pw_batch_function **member = kinds_member (&broken, kinds_functions[i].offset);
    kinds_original = *member;
    if (kinds_original == NULL) continue;
    *member = NULL;
    kinds_expect_caught (&broken, kinds_functions[i].name, "missing");
    if (kinds_original == pw_by_differences) continue;
    *member = kinds_multiplied;
    kinds_factor = -1;
    kinds_expect_caught (&broken, kinds_functions[i].name, "with the wrong sign");
    if (strcmp (kinds_functions[i].name, "g_size") == 0) continue; /* an upper bound */
    kinds_factor = 1 + 1e-5;
    kinds_expect_caught (&broken, kinds_functions[i].name, "off by 1e-5");
  }
}

TEST (broken) {
  for (const pw_kind *const *k = pw_kinds; *k; k++) kinds_break (*k);
  for (const pw_kind *const *k = toy_kinds; *k; k++) kinds_break (*k);
  for (const pw_kind *const *k = kinds_exact; *k; k++) kinds_break (*k);
}

/* All elements as the first one: random scenes must have several. */
static void kinds_first_only (const pw_batch *b, double *out) {
  pw_batch one = *b;
  one.count = 1;
  for (int e = 0; e < b->count; e++) kinds_original (&one, out + e * 2 * b->cols);
}

/* The last element is missing. */
static void kinds_short (const pw_batch *b, double *out) {
  pw_batch fewer = *b;
  fewer.count--;
  kinds_original (&fewer, out);
}

/* One number too many is written. */
static void kinds_long (const pw_batch *b, double *out) {
  kinds_original (b, out);
  out[b->count * 2 * b->cols] = 0;
}

TEST (sizes) {
  static pw_batch_function *const wrong[] = { kinds_first_only, kinds_short, kinds_long };
  kinds_original = pw_kind_pin.J;
  for (int i = 0; i < 3; i++) {
    pw_kind broken = pw_kind_pin;
    broken.J = wrong[i];
    kinds_expect_caught (&broken, "J", "with the wrong size");
  }
}

/* A missing saturation, and one a thousand times too wide. */
TEST (saturation) {
  int kinds = 0;
  for (const pw_kind *const *k = pw_kinds; *k; k++) {
    if ((*k)->saturation == NULL) continue;
    pw_kind broken = **k;
    kinds++;
    kinds_original = broken.saturation;
    broken.saturation = NULL;
    kinds_expect_caught (&broken, "saturation", "missing");
    broken.saturation = kinds_wide;
    kinds_expect_caught (&broken, "saturation", "a thousand times too wide");
  }
  assert_int_equal (kinds, 5);
}

/* ---- Inconsistent tables ---- */

static void kinds_expect_fault (const pw_kind *kind, const char *fault) {
  pw_selftest_report report;
  kinds_run (kind, 1, &report);
  assert_int_equal (report.failed, 1);
  assert_string_equal (report.check[0].name, "table");
  assert_string_equal (report.check[0].where, fault);
}

static const pw_field kinds_choice[] = { { .name = "mode", .offset = 8, .type = PW_CHOICE }, { .name = NULL } };
static const pw_field kinds_paths[] = { { .name = "path", .offset = 8, .type = PW_TRACK, .count = 2 },
                                        { .name = NULL } };
static const pw_field kinds_typeless[] = { { .name = "mode", .offset = 8, .type = (pw_field_type)77 },
                                           { .name = NULL } };
static const pw_field kinds_far[] = { { .name = "mode", .offset = SIZE_MAX - 3, .type = PW_NUMBER }, { .name = NULL } };
static const pw_field kinds_domain[] = { { .name = "mode", .offset = 8, .domain = (pw_domain)77 }, { .name = NULL } };

#define KINDS_50 "a-name-of-fifty-bytes-that-is-longer-than-it-shoul"
#define KINDS_TEXT ": expected at most 50 bytes of UTF-8 without control characters"
static const pw_quantity kinds_long_name[] = { { "x", "N", NULL, "" }, { KINDS_50 "x", "N", NULL, "" } };
static const pw_quantity kinds_line[] = { { "x", "N\n", NULL, "" }, { KINDS_50, "N", NULL, "" } };
static const pw_quantity kinds_twice[] = { { "N", "N", NULL, "" }, { "N", "N", NULL, "" } };
static const pw_field kinds_latin1[] = { { .name = "m\xF6", .offset = 8, .type = PW_NUMBER }, { .name = NULL } };

static pw_kind kinds_rod;

SCENE (kinds_longest) {
  kinds_rod = pw_kind_rod;
  kinds_rod.reaction = kinds_line + 1;
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .start = { 2 } });
  pw_add (m, &kinds_rod, &(pw_rod){ .name = KINDS_50, .body = { "b", "ground" }, .length = 1 });
}

/* The verifier names the equation of the longest names in full. */
TEST (longest_name) {
  const double zero[8] = { 0 }, q[8] = { 2 };
  pw_verification result;
  pw_system *s = scene_system (&kinds_longest_table, NULL);
  assert_int_equal (pw_verify (s, &(pw_scale){ 1, 1 }, 0, q, zero, zero, zero, &result), PW_OK);
  assert_string_equal (result.position.name, KINDS_50 "." KINDS_50);
  pw_system_free (s);
}

TEST (faults) {
#define KINDS_FAULT(member, value, text) \
  do {                                   \
    pw_kind broken = pw_kind_pin;        \
    broken.member = value;               \
    kinds_expect_fault (&broken, text);  \
  } while (0)
  KINDS_FAULT (name, NULL, "no name");
  KINDS_FAULT (name, KINDS_50 "x", "its name" KINDS_TEXT);
  KINDS_FAULT (name, "a\nb", "its name" KINDS_TEXT);
  KINDS_FAULT (reaction, kinds_long_name, "name or unit of a reaction" KINDS_TEXT);
  KINDS_FAULT (reaction, kinds_line, "name or unit of a reaction" KINDS_TEXT);
  KINDS_FAULT (reaction, kinds_twice, "two reactions or internal coordinates of the same name");
  KINDS_FAULT (fields, kinds_latin1, "field m\xF6: name or unit" KINDS_TEXT);
  KINDS_FAULT (definition, 0, "the definition has no room for its name");
  KINDS_FAULT (bodies, 5, "at most 4 bodies, 4 internal coordinates, 6 constraint equations and 4 signals");
  KINDS_FAULT (bodies, 0, "neither a body nor an internal coordinate");
  KINDS_FAULT (level, PW_FORCE, "rows and level are inconsistent");
  KINDS_FAULT (reaction, NULL, "constraint equations whose reactions lack a name or unit");
  KINDS_FAULT (internal, 1, "internal coordinates without name, rate or unit");
  KINDS_FAULT (prepare, NULL, "a prepared element (.element > 0) or internal coordinates, but no prepare function");
  KINDS_FAULT (element, SIZE_MAX, "a prepared element of more than 2147483647 bytes");
  KINDS_FAULT (fields, NULL, "no table of fields");
  KINDS_FAULT (fields, kinds_typeless, "field mode: its type does not exist");
  KINDS_FAULT (fields, kinds_domain, "field mode: its domain does not exist");
  KINDS_FAULT (definition, 16,
               "field body: outside the definition, whose first member is its name and whose sizeof is .definition");
  KINDS_FAULT (fields, kinds_far,
               "field mode: outside the definition, whose first member is its name and whose sizeof is .definition");
  KINDS_FAULT (fields, kinds_choice, "field mode: a choice without choices");
  KINDS_FAULT (fields, kinds_paths, "more than one path");
  KINDS_FAULT (bodies, 3, "bodies is not the sum of the counts of PW_BODY fields");
  KINDS_FAULT (signals, 1, "signals is not the sum of the counts of PW_SIGNAL fields");
  KINDS_FAULT (each_body, 1, "an element type that acts on each body has one body and no body fields");
  KINDS_FAULT (constant, 1, "declared constant, but it has no force, or has signals");
  KINDS_FAULT (J, pw_by_differences, "PW_BY_DIFFERENCES is permitted only for second-order blocks");
  KINDS_FAULT (J, NULL, "constraint equations without J");
  KINDS_FAULT (force_u, pw_kind_torque.force_u, "force_u, but no force");
  KINDS_FAULT (g, NULL, "holonomic constraint equations without g");
  KINDS_FAULT (level, PW_NONHOLONOMIC, "g, but no holonomic constraint equations");
#undef KINDS_FAULT
  pw_kind broken = pw_kind_torque;
  broken.force_u = NULL;
  kinds_expect_fault (&broken, "a force with signals, but no force_u");
}

/* ---- Further checks ---- */

/* J v of a wheel is the lateral velocity of its contact point, by differences of `contact`. */
TEST (wheel_contact) {
  for (uint64_t seed = 1; seed <= 20; seed++) {
    pw_error error = { 0 };
    pw_random random = { seed };
    pw_system *s = pw_random_scene (&pw_kind_wheel, &random, &error);
    assert_non_null (s);
    pw_workspace *w = pw_workspace_new (s, NULL);
    double q[PW_SCENE_COORDS], v[PW_SCENE_COORDS], moved[PW_SCENE_COORDS], plus[9], minus[9], contact[9], speed[3];
    double *const place[] = { plus, minus, contact };
    const double h = 0x1p-17, step[] = { h, -h, 0 }; /* h: near eps^(1/3) */
    for (int j = 0; j < s->coords; j++)
      q[j] = pw_random_between (&random, -3, 3), v[j] = pw_random_between (&random, -1.5, 1.5);
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < s->coords; j++) moved[j] = q[j] + step[i] * v[j];
      assert_int_equal (pw_update_kinematics (w, 0, moved, v), PW_OK);
      pw_kind_wheel.contact (&w->batch->b, place[i]);
    }
    pw_evaluate_J (w);
    pw_mul_J (w, v, speed);
    for (int e = 0; e < 3; e++) {
      double vx = (plus[3 * e] - minus[3 * e]) / (2 * h), vy = (plus[3 * e + 1] - minus[3 * e + 1]) / (2 * h);
      double across = cos (contact[3 * e + 2]) * vy - sin (contact[3 * e + 2]) * vx;
      check_close ("lateral velocity", speed[e], across, 1e3 * pow (DBL_EPSILON, 2. / 3),
                   "central differences, terms up to 10");
    }
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

/* The self-test reports the error of a prepare function that rejects valid definitions. */
static int kinds_refuse (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  (void)definition, (void)bodies, (void)element, (void)internal;
  return pw_fail (error, PW_INPUT, "nothing suits me");
}

TEST (refused) {
  pw_kind broken = pw_kind_pin;
  broken.prepare = kinds_refuse;
  pw_selftest_report report = { 0 };
  pw_error error = { 0 };
  assert_int_equal (pw_selftest (&broken, 1, &report, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model pin: pin e0: nothing suits me");
}
