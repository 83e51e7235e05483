/* pinwheel check: its report on models whose mobility, vibrations and faults are known. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "selftest.h"
#include "scene.h"
#include "toys.h"
#include "trial.h"

static double check_number (const char *part, const char *key) {
  return cli_number (cli_out, part, key, NULL);
}

TEST (ezyroller) {
  cli_good ("pinwheel check ezyroller");
  cli_shows ("degrees of freedom, configuration  4\n");
  cli_shows ("degrees of freedom, velocity       2\n");
  cli_shows ("    steer has neither mass nor inertia\n  saddle-point matrix                regular\n");
  cli_shows ("  consistent as described\n");
  cli_shows ("  wheel (2 elements)                 good");
  cli_shows ("  eigenvalues                        all 0");
  cli_shows ("\nNo problems found\n");
}

/* Hanging, a compound pendulum: w^2 = m g l / (I + m l^2). */
TEST (pendulum) {
  cli_good ("pinwheel check pendulum --set theta=-1.5707963267948966 --set I=0.5 --set m=2 --set l=0.7 --json -");
  double w = sqrt (2 * 9.81 * 0.7 / (0.5 + 2 * 0.49));
  check_close ("frequency", check_number ("linearisation", "frequency_hz"), w / (2 * PW_PI), 1e-12, "1e4 eps");
  check_close ("step", check_number ("linearisation", "rk4_step"), sqrt (8) / w, 1e-5, "1e-12 in |R|");
  check_close ("velocity", check_number ("mobility", "velocity"), 1, 0, "exact");
}

/* What a wheel uses of its grip is the extremum of its reaction in the run. */
TEST (limits) {
  static const char model[] = "tests/models/events/ride-on.yaml --set gA=0.5";
  cli_good (check_text (
      "pinwheel check %s --json @/check.json && pinwheel run %s --of max:A.N --of min:A.N --json @/run.json", model,
      model));
  const double high = cli_number (cli_file ("run.json"), "of", "max:A.N", NULL),
               low = cli_number (cli_file ("run.json"), "of", "min:A.N", NULL),
               used = cli_number (cli_file ("check.json"), "limits", "used", NULL);
  check_close ("used", used, fmax (high, -low) / 0.5, 1e-12, "the same run");
  assert_non_null (strstr (cli_file ("check.json"), "\"mode\": \"holds\", \"events\": 0, \"first\": null"));
  cli_good ("pinwheel check tests/models/events/pendulum.yaml");
  assert_non_null (strstr (cli_out, "free at the start; 6 events, the first at t = 0.713008 s"));
  /* lateral force and traction have one limit together, of which a part says nothing; there is no brake */
  cli_write ("rolls.yaml", "pinwheel: 1\nrun: {t_end: 1}\n"
                           "bodies:\n  - {name: car, mass: 1, inertia: 1, rate: {vx: 1}}\n"
                           "elements:\n  - {rolling-wheel: W, body: car, at: [0, 0], radius: 0.1, inertia: 0.01, "
                           "grip: 5, torque: 0.1}\n");
  cli_good ("pinwheel check @/rolls.yaml");
  assert_non_null (strstr (cli_out, "W.N                                holds at the start; no events"));
  assert_null (strstr (cli_out, "W.T  "));
  assert_null (strstr (cli_out, "W.B  "));
}

TEST (spring) {
  cli_write ("spring.yaml", "pinwheel: 1\nrun: {step: 1}\n"
                            "bodies:\n  - {name: block, mass: 1.5, inertia: 0.1, start: {x: 0.8}}\n"
                            "elements:\n  - {slider: rail, body: [block, ground], at: [[0, 0], [0, 0]], heading: 0}\n"
                            "  - {spring: s, body: [block, ground], at: [[0, 0], [0, 0]], stiffness: 60, damping: 2.4, "
                            "length: 0.8}\n");
  cli_bad ("pinwheel check @/spring.yaml --json @/spring.json", 2,
           "the model's step of 1 s is too large for rk4, which is stable up to 0.468 s");
  cli_shows ("-0.8 +- 6.2738 i 1/s");
  cli_shows ("0.12649 of critical");
  check_close ("frequency", cli_number (cli_file ("spring.json"), "linearisation", "frequency_hz", NULL),
               sqrt (60 / 1.5 - 0.64) / (2 * PW_PI), 1e-12, "1e4 eps");
  check_close ("damping", cli_number (cli_file ("spring.json"), "linearisation", "damping", NULL),
               0.8 / sqrt (60 / 1.5), 1e-12, "1e4 eps");
}

TEST (redundant) {
  cli_good ("pinwheel check car");
  cli_shows ("constraint equations               4 (0 on positions, 4 on velocities)");
  cli_shows ("rank of J                          2\n");
  cli_shows ("    wheels rear-left and rear-right: the same lateral constraint\n");
  cli_shows ("  saddle-point matrix                regular without the redundant constraint equations\n");
}

TEST (start) {
  cli_good ("pinwheel check ezyroller --start frame.vy=0.5");
  cli_shows ("Initial conditions\n  ");
  cli_shows (" changed");
  cli_shows ("frame.omega ");
  cli_shows (", by ");
  cli_good ("pinwheel check ezyroller --start frame.vy=0.5 --json -");
  cli_shows ("\"changes\": [{\"state\": \"");
  double moved = check_number ("start", "moved"), omega = check_number ("frame.omega", "to");
  assert_true (moved >= 1 && omega != 0);
}

/* The first 8 of 12 findings, and how many more there are; all of them in JSON. */
TEST (many_findings) {
  char text[2000];
  int n = snprintf (text, sizeof text, "pinwheel: 1\nbodies:\n");
  for (int i = 0; i < 12; i++)
    n += snprintf (text + n, sizeof text - (size_t)n, "  - {name: b%d, mass: 1, inertia: 1, start: {x: 1}}\n", i);
  n += snprintf (text + n, sizeof text - (size_t)n, "elements:\n");
  for (int i = 0; i < 12; i++)
    n += snprintf (text + n, sizeof text - (size_t)n, "  - {pin: p%d, body: [b%d, ground], at: [[0, 0], [0, 0]]}\n", i,
                   i);
  cli_write ("many.yaml", text);
  cli_good ("pinwheel check @/many.yaml");
  cli_shows ("\n12 findings\n");
  cli_shows ("b7.x = 1 m, which was changed to 0 m; otherwise pin p7 would be open by 1 m\n  and 4 more\n");
  cli_good ("pinwheel check @/many.yaml --json -");
  cli_shows ("b11.x = 1 m, which was changed to 0 m; otherwise pin p11 would be open by 1 m\"]");
}

/* Gravity in the plane in which wheels roll, but not along a slope, nor with markers. */
TEST (gravity) {
  static const char *const wheel[] = { "wheel: W, body: a, at: [0, 0]",
                                       "tyre: W, body: a, at: [0, 0], stiffness: 100, speed: 1",
                                       "rolling-wheel: W, body: a, at: [0, 0], radius: 0.1, inertia: 0",
                                       "steered-wheel: W, body: a, at: [0, 0], heading: 0.1",
                                       "marker: W, body: a, at: [0, 0]" };
  for (int i = 0; i < 10; i++) {
    cli_write ("g.yaml", check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n"
                                     "  - {%s}\n  - {gravity: G, acceleration: [%s]}\n",
                                     wheel[i / 2], i % 2 ? "3, -4" : "0, -9.81"));
    cli_good ("pinwheel check @/g.yaml");
    int found = strstr (cli_out, "gravity G acts with 9.81 m/s^2 in the plane in which ") != NULL;
    if (found != (i < 8 && i % 2 == 0)) fail_msg ("%s: %s", wheel[i / 2], cli_out);
  }
}

/* At a kink of a signal, such as a knot of a path or an end of abs, the element type has no fault. */
TEST (kinks) {
  static const char *const element[] = {
    "force: F, body: a, at: [0, 0], fx: \"-abs (a.x)\", fy: \"max (0, a.y) - 2*max (0, -a.x)\"",
    ("steered-wheel: F, body: a, at: [1, 0], heading: \"atan (road.curvature (a.x, a.y)) + road.heading (a.x, a.y) - "
     "a.phi\""),
    "steered-wheel: F, body: a, at: [1, 0], heading: abs (a.x) + abs (a.y)",
    "on-curve: F, body: a, at: [0, 0], x: road.x (s), y: road.y (s), start: 0"
  };
  for (size_t i = 0; i < sizeof element / sizeof *element; i++) {
    cli_write ("kink.yaml", check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1, rate: {vx: 1}}]\n"
                                        "paths: [{name: road, points: [[0, 0], [3, 1], [4, 5], [-4, 3]], closed: true, "
                                        "interpolation: cubic}]\nelements:\n  - {%s}\n",
                                        element[i]));
    cli_shell ("pinwheel check @/kink.yaml");
    assert_null (strstr (cli_out, "FAILED"));
  }
}

/* Wheels steered in parallel allow no motion, unlike those of Ackermann's steering and a driven car. */
TEST (locked_wheels) {
  static const char *const rest[] = { "heading: 0.3}\n", "heading: atan(1)}\n",
                                      "heading: 0}\n  - {speed: engine, body: a, at: [0, 0], value: t}\n" };
  for (int i = 0; i < 3; i++) {
    cli_write ("locked.yaml",
               check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {wheel: left, body: a, at: [-1, 0.5]}\n  - {wheel: right, body: a, at: [-1, -0.5]}\n"
                           "  - {wheel: other, body: a, at: [1, 0.5], heading: %s}\n"
                           "  - {wheel: front, body: a, at: [1, -0.5], %s",
                           i == 0   ? "0.3"
                           : i == 1 ? "atan(2)"
                                    : "0",
                           rest[i]));
    cli_good ("pinwheel check @/locked.yaml 2>/dev/null");
    int found = strstr (cli_out, "the wheels allow no motion; wheels that slip sideways are of type tyre") != NULL;
    if (found != (i == 0)) fail_msg ("%d: %s", i, cli_out);
  }
}

TEST (singular) {
  cli_write ("loose.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1}\n  - {name: ghost}\n"
                           "elements:\n  - {pin: A, body: [a, ghost], at: [[1, 0], [0, 0]]}\n"
                           "  - {wheel: W, body: ghost, at: [0, 0]}\n");
  assert_int_equal (cli_run ("pinwheel check @/loose.yaml"), 2);
  cli_shows ("saddle-point matrix                singular; see below");
  cli_shows ("  FAILED: model loose: ");
  assert_non_null (strstr (cli_err, "ghost.phi has no inertia"));
  assert_int_equal (cli_run ("pinwheel check @/loose.yaml --json -"), 2);
  assert_non_null (strstr (cli_out, "\"saddle_point\": \"singular\""));
  assert_true (cli_says (cli_out, "status", "failed"));
  assert_int_equal (cli_run ("pinwheel check ezyroller --start frame.vx=1e120"), 2);
  cli_shows ("saddle-point matrix                not known\n");
}

/* ---- Point masses: angles that nothing turns ---- */

/* A point mass on a rod from an arm, with one more element. */
static void check_point_mass (const char *element) {
  char text[1000];
  snprintf (text, sizeof text,
            "pinwheel: 1\nrun: {t_end: 0.1}\nbodies:\n"
            "  - {name: m, mass: 1, start: {x: 0.6, y: -0.8}, rate: {omega: 2}}\n"
            "  - {name: arm, mass: 1, inertia: 1, rate: {omega: 1}}\nelements:\n"
            "  - {gravity: g, acceleration: [0, -9.81]}\n  - {pin: O, body: [arm, ground], at: [[0, 0], [0, 0]]}\n"
            "  - {rod: R, body: [m, arm], at: [[0, 0], [0, 0]], length: 1}\n  - {%s}\n",
            element);
  cli_write ("point.yaml", text);
}

TEST (point_mass) {
  static const char *const good[] = {
    "spring: S, body: [m, arm], at: [[0, 0], [0.2, 0]], stiffness: 3, damping: 1",
    "force: F, body: m, at: [0, 0], fx: 1",
    "drag: D, body: m, linear: 1, quadratic: 2",
    "slot: P, body: [m, arm], at: [[0, 0], [0, 0]], heading: -0.9272952180016122",
    "sliding-friction: P, body: [m, arm], at: [[0, 0], [0, 0]], viscous: 1",
    "torque: T, body: [arm, ground], value: {expression: \"m.x + m.vy\"}",
    "pfaffian: F, body: [arm, m], a: [0, 0, 1], b: [0, 1, 0]",
    "marker: M, body: m, at: [0.1, 0]",
  };
  for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
    check_point_mass (good[i]);
    cli_good ("pinwheel check @/point.yaml");
    cli_shows ("    m has no inertia: nothing turns it, its angle is left out of the motion\n");
    cli_shows (strstr (good[i], "slot:") ? "degrees of freedom, configuration  1\n"
                                         : "degrees of freedom, configuration  2\n");
    cli_good ("pinwheel check @/point.yaml --json -");
    cli_shows ("\"unturned\": [\"m\"]");
  }
}

/* What reads the angle of a point mass, or acts on it, makes it undetermined, unless constraints determine it. */
TEST (point_mass_refused) {
  static const char *const bad[][2] = {
    { "wheel W", "wheel: W, body: m, at: [0, 0]" },
    { "speed W", "speed: W, body: m, value: 1" },
    { "tyre T", "tyre: T, body: m, at: [0, 0], stiffness: 1, speed: 1" },
    { "force F", "force: F, body: m, at: [0, 0], axes: body, fx: 0" },
    { "force F", "force: F, body: m, at: [0.1, 0], fx: 0" },
    { "torque T", "torque: T, body: [m, ground], value: 0" },
    { "torque T", "torque: T, body: [arm, ground], value: {expression: m.phi}" },
    { "torque T", "torque: T, body: [arm, ground], value: {expression: m.omega}" },
    { "rotational-spring S", "rotational-spring: S, body: [arm, m], stiffness: 1, damping: 0" },
    { "friction F", "friction: F, body: [arm, m], viscous: 1" },
    { "drag D", "drag: D, body: m, turning: 1" },
    { "spring S", "spring: S, body: [m, arm], at: [[0, 0.1], [0, 0]], stiffness: 3" },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    check_point_mass (bad[i][1]);
    assert_int_equal (cli_run ("pinwheel run @/point.yaml"), 2);
    assert_non_null (strstr (cli_err, "m.phi has no inertia, and no constraint determines how it moves, although "));
    assert_non_null (strstr (cli_err, bad[i][0]));
  }
  check_point_mass ("wheel: W, body: m, at: [0.1, 0]"); /* it determines the angle */
  cli_good ("pinwheel check @/point.yaml");
  cli_shows ("    m has no inertia\n");
  cli_good ("pinwheel check @/point.yaml --json -");
  cli_shows ("\"unturned\": []");
}

/* A plug-in's own kind whose force is not the gradient of its energy, and whose force_q is missing. */
TEST (broken_kind) {
  cli_write ("broken.c",
             "#include \"pinwheel.h\"\n"
             "typedef struct { const char *name, *body; double k; } well;\n"
             "static const pw_field fields[] = {\n"
             "  { .name = \"body\", .offset = offsetof (well, body), .type = PW_BODY, .required = 1 },\n"
             "  { .name = \"k\", .offset = offsetof (well, k), .type = PW_NUMBER },\n"
             "  { .name = NULL } };\n"
             "static void force (const pw_batch *b, double *f) {\n"
             "  for (int e = 0; e < b->count; e++, f += 3) {\n"
             "    const pw_configuration *p = b->configuration + b->body[e];\n"
             "    f[0] = -2 * p->x, f[1] = 0, f[2] = 0;\n"
             "  }\n"
             "}\n"
             "static const pw_kind kind = { .name = \"well\", .about = \"pulls\", .definition = sizeof (well),\n"
             "  .fields = fields, .bodies = 1, .force = force, .loss = NULL };\n"
             "static void build (pw_model *m, const void *p) {\n"
             "  (void)p;\n"
             "  pw_add_body (m, &(pw_body){ .name = \"ball\", .mass = 1, .inertia = 1 });\n"
             "  pw_add (m, &kind, &(well){ .name = \"pit\", .body = \"ball\", .k = 2 });\n"
             "}\n"
             "PW_MODEL (.about = \"broken\", .build = build);\n");
  assert_int_equal (cli_run ("pinwheel check @/broken.c"), 2);
  cli_shows ("  well (1 element)                   FAILED");
  cli_shows ("in random scenes: force_q = d force/dq does not hold");
  cli_shows ("in this model: force_q = d force/dq does not hold");
  cli_shows ("not computed: the linearisation fails, see the findings");
  assert_null (strstr (cli_out, "the limit is"));
  cli_shows ("\n1 problem\n");
  assert_non_null (strstr (cli_err, "pinwheel: element type well fails its self-test: force_q = d force/dq"));
  assert_int_equal (cli_run ("pinwheel check @/broken.c --json -"), 2);
  cli_shows ("{\"check\": \"force_q\", \"in\": \"random scenes\", \"expected\": \"force_q = d force/dq\"");
  cli_shows ("{\"check\": \"force_q\", \"in\": \"this model\"");
  cli_shows ("\"status\": \"failed\"");
  static const char *const implicit[] = { "ida+ggl", "bdf", "radau", "galpha+ggl", "leapfrog" };
  char command[100];
  for (size_t i = 0; i < sizeof implicit / sizeof *implicit; i++) {
    snprintf (command, sizeof command, "pinwheel run @/broken.c --method %s --t-end 0.1", implicit[i]);
    cli_bad (
        command, 2,
        check_text (
            "model broken: force_q of element type well is left out, but it is not zero, and %s needs it: add it, or "
            "PW_BY_DIFFERENCES in its place",
            implicit[i]));
  }
  cli_shell ("pinwheel run @/broken.c --method rk4 --t-end 0.1");
  cli_good ("pinwheel sensitivity @/broken.c --of ball.x --by ball.vx -t 0.1"); /* by runs that need no derivatives */
  static const char *const linearising[] = { "linearise", "steady" };
  for (size_t i = 0; i < sizeof linearising / sizeof *linearising; i++) {
    snprintf (command, sizeof command, "pinwheel %s @/broken.c", linearising[i]);
    cli_bad (command, 2,
             "model broken: force_q of element type well is left out, but it is not zero, and the linearisation needs "
             "it: add it, or PW_BY_DIFFERENCES in its place");
  }
}

/* The derivatives of a signal that reads states: the function's own, wrong by a factor. */
TEST (broken_gradient) {
  cli_write ("gradient.c", "#include \"pinwheel.h\"\n"
                           "static const char *const reads[] = { \"a.phi\", \"a.omega\", NULL };\n"
                           "static int pull (void *c, double t, const double *x, double *u, double *gradient) {\n"
                           "  (void)c, (void)t;\n"
                           "  u[0] = -4 * x[0] - x[1], u[1] = u[2] = 0;\n"
                           "  if (gradient) gradient[0] = -4, gradient[1] = WRONG;\n"
                           "  return 0;\n"
                           "}\n"
                           "static void build (pw_model *m, const void *p) {\n"
                           "  (void)p;\n"
                           "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1 });\n"
                           "  pw_add_torque (m, &(pw_torque){ .name = \"T\", .body = { \"a\", \"ground\" },\n"
                           "    .value = { PW_FUNCTION, .function = { .eval = pull, .reads = reads } } });\n"
                           "}\n"
                           "PW_MODEL (.about = \"a signal that reads states\", .build = build);\n");
  cli_good ("sed 's/WRONG/-1/' @/gradient.c >@/right.c && pinwheel check @/right.c");
  assert_int_equal (cli_run ("sed 's/WRONG/-1.1/' @/gradient.c >@/wrong.c && pinwheel check @/wrong.c"), 2);
  cli_shows ("in this model: gradient = d signal/d state does not hold");
}

TEST (large) {
  cli_good ("pinwheel check chain --set n=200");
  cli_shows ("not computed: 600 coordinates, the limit is 400");
  cli_shows ("rank of J                          400\n");
}

TEST (bad_options) {
  cli_bad ("pinwheel check", 2, "missing argument; usage: pinwheel check MODEL [OPTION...]");
  cli_bad ("pinwheel check ezyroller --jsn x", 2, "check has no option \"--jsn\"; did you mean \"--json\"?");
}

/* ---- The self-test in a scene notices whatever is broken in a kind ---- */

static const pw_kind *check_original;

static void check_half (const pw_batch *b, double *out) {
  check_original->gamma (b, out);
  for (int i = 0; i < b->count * check_original->rows; i++) out[i] /= 2;
}

static void check_not_a_number (const pw_batch *b, double *out) {
  for (int i = 0; i < b->count * check_original->rows; i++) out[i] = NAN;
}

static void check_scene_expect (const pw_kind *kind, const char *what) {
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  pw_random random = { 5 };
  pw_system *s = pw_random_scene (kind, &random, &error);
  assert_non_null (s);
  double q[PW_SCENE_COORDS], v[PW_SCENE_COORDS];
  for (int j = 0; j < s->coords; j++) q[j] = sin (1. + 3 * j), v[j] = 0;
  check_ok (pw_selftest_scene (s, 1, kind, 0, q, v, 7, &report, &error), &error);
  for (int i = 0; i < report.checks; i++)
    if (report.check[i].failed != (what != NULL && strcmp (report.check[i].name, what) == 0))
      fail_msg ("%s: %s is %g, %s", kind->name, report.check[i].name, report.check[i].error, report.check[i].where);
  assert_int_equal (report.failed, what != NULL);
  pw_system_free (s);
}

TEST (scene) {
  for (const pw_kind *const *k = pw_kinds; *k; k++) check_scene_expect (*k, NULL);
  for (const pw_kind *const *k = toy_kinds; *k; k++) check_scene_expect (*k, NULL);
  check_original = &pw_kind_pin;
  pw_kind halved = pw_kind_pin;
  halved.gamma = check_half;
  halved.gamma_q = halved.gamma_v = pw_by_differences;
  check_scene_expect (&halved, "gamma");
  halved = pw_kind_pin;
  halved.g_size = check_not_a_number;
  check_scene_expect (&halved, "J");
  halved = pw_kind_pin;
  halved.jw_q = NULL;
  check_scene_expect (&halved, "jw_q");
  halved = pw_kind_spring;
  halved.force_v = NULL;
  check_scene_expect (&halved, "force_v");
}

/* A signal that fails at a time at which the self-test evaluates it is not an error of the element type. */

static int check_ends (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = t < 0.25 ? 1 : NAN;
  return 0;
}

SCENE (check_build_ending) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1 });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { "rotor", "ground" },
                                  .value = { PW_FUNCTION, .function = { .eval = check_ends } } });
}

TEST (failing_signal) {
  const double q[3] = { 0 }, v[3] = { 0 };
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  pw_system *s = scene_system (&check_build_ending_table, NULL);
  assert_int_equal (pw_selftest_scene (s, 1, &pw_kind_torque, 0, q, v, 1, &report, &error), PW_METHOD);
  check_error (&error, PW_METHOD,
               "t = 0.5 s: a signal failed: torque T: value is not a finite number, or its function failed");
  assert_int_equal (report.failed, 0);
  pw_system_free (s);
}

/* A signal without a next breakpoint has failed, too; a breakpoint just after the state is not a fault of the type. */

static double check_breakpoint; /* the only one; NaN: the function fails */

static double check_break (void *context, double t) {
  (void)context;
  return t < check_breakpoint ? check_breakpoint : isnan (check_breakpoint) ? t : INFINITY;
}

static int check_sine (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = sin (t), value[1] = cos (t), value[2] = -sin (t);
  return 0;
}

SCENE (check_build_driven) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1 });
  pw_add_drive (m, &(pw_drive){ .name = "D",
                                .body = { "rotor", "ground" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_FUNCTION, .function = { check_sine, .breakpoint = check_break } } });
}

TEST (breakpoint) {
  const double q[3] = { 0, 0, sin (1) }, v[3] = { 0, 0, cos (1) };
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  check_breakpoint = 1 + 1e-11;
  pw_system *s = scene_system (&check_build_driven_table, NULL);
  check_ok (pw_selftest_scene (s, 1, &pw_kind_drive, 1, q, v, 1, &report, &error), &error);
  for (int i = 0; i < report.checks; i++)
    if (report.check[i].failed) fail_msg ("%s: %s", report.check[i].name, report.check[i].where);
  check_breakpoint = NAN;
  assert_int_equal (pw_selftest_scene (s, 1, &pw_kind_drive, 1, q, v, 1, &report, &error), PW_METHOD);
  check_error (&error, PW_METHOD, "t = 1 s: drive D: value: its breakpoint function returned a time that is not later");
  assert_int_equal (report.checks, 0);
  pw_system_free (s);
}

const check_fixture fixture = { cli_setup, cli_teardown };
