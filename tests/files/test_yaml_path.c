/* Paths of text models: values and derivatives of their functions in expressions, where they jump, files, lifetime; a
 * vehicle that follows a track. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "expression.h"
#include "gallery.h"
#include "runs.h"

static pw_arena arena;
static pw_path *path[3];

/* An expression of t, a.x, a.y and the paths "eight", a spline that crosses itself, "zig", a polyline with right angles
 * at (1, 0) and (1, 1), and "arc", an open spline of 2 m along x. */
static const pw_expression *read (const char *text) {
  static const char *const variable[] = { "t", "a.x", "a.y", NULL };
  const pw_expression *x = NULL;
  pw_expression_error trouble;
  pw_error error = { 0 };
  double px[200], py[200];
  pw_scope s = { 0 };
  for (int i = 0; i < 200 && path[0] == NULL; i++)
    px[i] = 3 * cos (2 * PW_PI * i / 200), py[i] = 2 * sin (4 * PW_PI * i / 200);
  if (path[0] == NULL) {
    path[0] = pw_path_open (px, py, 200, PW_CUBIC, 1, &error);
    path[1] = pw_path_open ((double[]){ 0, 1, 1, 5 }, (double[]){ 0, 0, 1, 1 }, 4, PW_LINEAR, 0, &error);
    path[2] = pw_path_open ((double[]){ 0, 0.5, 1, 2 }, (double[]){ 0, 0, 0, 0 }, 4, PW_CUBIC, 0, &error);
    check_ok (error.status, &error);
  }
  assert_int_equal (pw_scope_reserve (&s, 3, &arena), PW_OK);
  pw_scope_add_path (&s, "eight", path[0]);
  pw_scope_add_path (&s, "zig", path[1]);
  pw_scope_add_path (&s, "arc", path[2]);
  if (pw_expression_read (&s, variable, text, &arena, &x, &trouble) != PW_OK)
    print_error ("%s: %s\n", text, trouble.text);
  pw_scope_close (&s);
  assert_non_null (x);
  return x;
}

/* First and second derivatives by each variable against central differences. */
static void check_derivatives (const char *text, const double at[3]) {
  const pw_expression *x = read (text);
  const double h = 1e-4;
  for (int by = 0; by < 3; by++) {
    double u[3], v[3][3], variable[3];
    for (int k = -1; k <= 1; k++) {
      memcpy (variable, at, sizeof variable);
      variable[by] += k * h;
      pw_expression_derivatives (x, variable, by, v[k + 1]);
    }
    memcpy (u, v[1], sizeof u);
    check_close (text, u[0], pw_expression_value (x, at), 0, "the same formulas");
    check_close (text, (v[2][0] - v[0][0]) / (2 * h), u[1], 1e-5 * (1 + fabs (u[1])), "differences");
    check_close (text, (v[2][1] - v[0][1]) / (2 * h), u[2], 1e-5 * (1 + fabs (u[2])), "differences");
  }
}

TEST (derivatives) {
  static const char *const function[] = { "s", "x", "y", "heading", "curvature", "offset" };
  char text[200];
  for (int k = 0; k < 12; k++) {
    const double at[] = { 0.3 + 1.7 * k, 2.6 * cos (0.3 + k), 1.9 * sin (0.6 + 2 * k) };
    for (size_t f = 0; f < 6; f++) {
      snprintf (text, sizeof text, "eight.%s (a.x, a.y + 0.1*sin (a.x))", function[f]);
      check_derivatives (text, at);
      snprintf (text, sizeof text, "eight.%s (a.x, a.y, %.17g)", function[f], 2.0 * k);
      check_derivatives (text, at);
      snprintf (text, sizeof text, "eight.%s (9*sin (t/3))", function[f]);
      if (f > 0 && f < 5) check_derivatives (text, at);
    }
  }
  const double corner[] = { 0, 1.4, -0.7 }, side[] = { 0, 0.5, 0.2 }, beyond[] = { 0, -1, 0.3 };
  for (size_t f = 0; f < 6; f++) {
    snprintf (text, sizeof text, "zig.%s (a.x, a.y)", function[f]);
    check_derivatives (text, corner);
    check_derivatives (text, side);
    snprintf (text, sizeof text, "eight.%s (a.x, a.y)", function[f]);
    check_derivatives (text, beyond);
  }
}

/* Jumps and kinks in time are breakpoints; those of the nearest place are reported as jumps in states. */
TEST (breaks) {
  static const struct {
    const char *text;
    double first; /* breakpoint after t = 0 */
    const char *jump;
  } expected[] = {
    { "zig.heading (2*t)", 0.5, "" },
    { "zig.heading (1.5 - t)", 0.5, "" },
    { "zig.y (t + 0.25)", 0.75, "" },
    { "arc.curvature (t)", 2, "" },
    { "eight.x (t)", INFINITY, "" },
    { "eight.x (t) > 3 - 1e-3 ? 1 : 0", 0, "" },
    { "eight.offset (a.x, a.y)", INFINITY, "eight.offset (a.x, a.y)" },
    { "2*eight.s (t, 0, 3)", INFINITY, "eight.s (t, 0, 3)" },
    { "eight.s (t, 0, a.x)", INFINITY, "" },
    { "eight.s (a.x, a.y) + sign (a.y)", INFINITY, "eight.s (a.x, a.y)" },
    { "zig.offset (a.x, a.y, t)", INFINITY, "zig.offset (a.x, a.y, t)" },
    { "zig.heading (a.x)", INFINITY, "zig.heading (a.x)" },
    { "zig.x (a.x)", INFINITY, "" },
    { "eight.heading (a.x)", INFINITY, "" },
  };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
    const pw_expression *x = read (expected[i].text);
    char jump[100] = "";
    if (x->jump) snprintf (jump, sizeof jump, "%.*s", x->jump_size, x->jump);
    assert_string_equal (jump, expected[i].jump);
    double first = pw_expression_breakpoint (x, 0);
    if (expected[i].first == INFINITY)
      assert_true (first == INFINITY);
    else if (expected[i].first > 0)
      check_close (expected[i].text, first, expected[i].first, CHECK_EPS, "1.5 - t is rounded");
    if (expected[i].first == 0) check_close ("x falls below", first, 0.1033, 5e-4, "3 cos (u), ds = 4 du");
  }
  assert_int_equal (read ("arc.curvature (a.x)")->jumps, PW_JUMPS_RARELY);
  assert_int_equal (read ("eight.offset (a.x, a.y)")->jumps, PW_JUMPS_RARELY);
  assert_int_equal (read ("zig.heading (a.x)")->jumps, PW_JUMPS);
  double turn[] = { 0.5 }, before[] = { nextafter (0.5, 0) };
  check_close ("just after", pw_expression_value (read ("zig.heading (2*t)"), turn), PW_PI / 2, 0, "exact");
  check_close ("just before", pw_expression_value (read ("zig.heading (2*t)"), before), 0, 0, "exact");
  check_close ("just after", pw_expression_value (read ("zig.heading (1.5 - t)"), turn), 0, 0, "exact");
}

/* ---- Models ---- */

static const char follower[] =
    "pinwheel: 1\n"
    "parameters: [{name: R, value: 5}, {name: d, value: 0.25}]\n"
    "paths:\n  - {name: track, file: track.csv, columns: [E, N], interpolation: cubic, closed: true}\n"
    "bodies:\n"
    "  - {name: car, mass: 1, inertia: 0.1, start: {x: track.x (0) - d, phi: track.heading (0)}, rate: {vx: 0, vy: "
    "1}}\n"
    "elements:\n"
    "  - {wheel: rear, body: car, at: [0, 0]}\n"
    "  - {force: F, body: car, axes: body, fx: \"1 - hypot (car.vx, car.vy)\"}\n"
    "  - {torque: steer, body: [car, ground], value: \"@\"}\n";

/* A circular track, in a file in mm, and a law of steering. */
static gallery_scene follower_scene (const char *law) {
  char text[1500];
  const char *at = strchr (follower, '@');
  snprintf (text, sizeof text, "%.*s%s%s", (int)(at - follower), follower, law, at + 1);
  cli_write ("follower.yaml", text);
  FILE *f = fopen (cli_path ("track.csv"), "w");
  fputs ("N [mm];E [mm]\n", f);
  for (int i = 0; i < 1000; i++)
    fprintf (f, "%.15g;%.15g\n", 5000 * sin (2 * PW_PI * i / 1000), 5000 * cos (2 * PW_PI * i / 1000));
  fclose (f);
  return gallery_load (cli_path ("follower.yaml"), NULL);
}

/* Offset and heading of a spline through points of a circle: the motion is that with the formulas of the circle. */
TEST (follow) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "bdf+projection", "ida+ggl", "radau" };
  static const char *const law[] = {
    "4*(hypot (car.x, car.y) - R) + 6*sin (atan2 (car.y, car.x) + pi/2 - car.phi) - 2*(car.omega - 1/R)",
    "-4*track.offset (car.x, car.y) + 6*sin (track.heading (car.x, car.y) - car.phi) - 2*(car.omega - 1/R)",
    "-4*track.offset (car.x, car.y, R*(car.phi - pi/2)) + 6*sin (track.heading (car.x, car.y, R*(car.phi - pi/2)) - "
    "car.phi) "
    "- 2*(car.omega - track.curvature (car.x, car.y))"
  };
  double q[3][3], v[3][3];
  for (size_t m = 0; m < sizeof method / sizeof *method; m++) {
    for (int k = 0; k < 3; k++) {
      gallery_scene x = follower_scene (law[k]);
      runs_state (x.system, method[m], &(pw_settings){ .step = 5e-3, .rtol = 1e-9 }, 20, q[k], v[k], NULL);
      gallery_close (&x);
    }
    for (int k = 1; k < 3; k++)
      for (int j = 0; j < 3; j++) {
        check_close (method[m], q[k][j], q[0][j], 2e-6, "the spline differs by h^4, its curvature by h^2, h = 0.006");
        check_close (method[m], v[k][j], v[0][j], 2e-6, "the same");
      }
  }
  check_close ("on the track", hypot (q[0][0], q[0][1]), 5, 1e-2, "settled");
}

/* By default the columns named x and y are read, if there are both, else the first two; no number may be missing. */
TEST (columns) {
  static const struct {
    const char *table, *expected;
  } file[] = { { "t,x [mm],y [m]\n0,5000,2\n1,6000,3\n", "points: [[5, 2], [6, 3]]" },
               { "y,x\n0,5\n1,6\n", "points: [[5, 0], [6, 1]]" },
               { "x,N\n0,5\n1,6\n", "points: [[0, 5], [1, 6]]" },
               { "E,N,y\n0,5,1\n1,6,1\n", "points: [[0, 5], [1, 6]]" },
               { "0;5\n1;6\n", "points: [[0, 5], [1, 6]]" },
               { "x,y\n0,5\n,\n1,6\n", "p.csv:3: column 1 has no number" },
               { "E,N\n0,5\n1,\n1,6\n", "p.csv:3: column 2 has no number" },
               { "E,N\n0,5\n1,nan\n1,6\n", "p.csv:3: column 2: expected a finite number, found \"nan\"" },
               { "x,y,x\n0,5,1\n1,6,1\n", "p.csv:1: columns 1 and 3 are both named \"x\"" } };
  cli_write ("p.yaml", "pinwheel: 1\npaths: [{name: p, file: p.csv}]\nbodies: [{name: a, mass: 1}]\n");
  for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
    cli_write ("p.csv", file[i].table);
    assert_int_equal (cli_run ("pinwheel show --yaml @/p.yaml"), i > 4 ? 2 : 0);
    if (!strstr (i > 4 ? cli_err : cli_out, file[i].expected)) fail_msg ("%s: %s%s", file[i].table, cli_out, cli_err);
  }
}

/* An initial s that is 0, also by a parameter, is given, and written again. */
TEST (start) {
  static const char *const value[] = { "-0.1", "0", "0.1" };
  cli_write ("start.yaml", "pinwheel: 1\nparameters: [{name: s0, value: 1}]\nbodies: [{name: bead, mass: 1}]\n"
                           "elements: [{on-curve: wire, body: bead, x: 1 + cos (s), y: 3 + sin (2*s), start: s0, "
                           "rate: 0*s0}]\n");
  for (int i = 0; i < 3; i++) {
    cli_shell (check_text ("pinwheel show --yaml @/start.yaml --set s0=%s >@/again.yaml", value[i]));
    for (int again = 0; again < 2; again++) {
      pw_error error = { 0 };
      gallery_scene x = again ? gallery_load (cli_path ("again.yaml"), NULL)
                              : gallery_load (cli_path ("start.yaml"), "s0", atof (value[i]), NULL);
      pw_run *r = pw_run_open (x.system, "erk8", NULL, &error);
      check_ok (error.status, &error);
      pw_sample now = runs_to (r, 0);
      check_close ("s", now.q[3], atof (value[i]), 1e-12, "given");
      check_close ("its rate", now.v[3], 0, 1e-12, "given");
      pw_run_close (r);
      gallery_close (&x);
    }
  }
}

/* A bead on a spline through points of a circle swings like a pendulum. */
TEST (on_path) {
  static const char *const method[] = { "erk8", "radau", "ida+ggl" };
  double q[7], v[7];
  gallery_close (&(gallery_scene[]){ follower_scene ("0") }[0]); /* writes the file */
  cli_write ("bead.yaml",
             "pinwheel: 1\n"
             "paths: [{name: circle, file: track.csv, columns: [E, N], interpolation: cubic, closed: true}]\n"
             "bodies: [{name: bead, mass: 1}, {name: bob, mass: 1, start: {x: 5, y: 0}}]\n"
             "elements:\n"
             "  - {on-curve: wire, body: bead, x: circle.x (s), y: circle.y (s), start: 0}\n"
             "  - {rod: R, body: [bob, ground], at: [[0, 0], [0, 0]], length: 5}\n"
             "  - {gravity: g, acceleration: [0, -9.81]}\n");
  for (int i = 0; i < 3; i++) {
    gallery_scene x = gallery_load (cli_path ("bead.yaml"), NULL);
    runs_state (x.system, method[i], &(pw_settings){ .rtol = 1e-9 }, 3, q, v, NULL);
    for (int j = 0; j < 2; j++) {
      check_close (method[i], q[j], q[3 + j], 1e-6, "the methods' errors; h^4");
      check_close (method[i], v[j], v[3 + j], 1e-6, "the methods' errors; h^3");
    }
    gallery_close (&x);
  }
}

/* A compiled system has the paths after its model is freed, as have its runs. */
TEST (lifetime) {
  pw_error error = { 0 };
  gallery_scene x = follower_scene ("-4*track.offset (car.x, car.y)");
  pw_workspace *w = pw_workspace_new (x.system, &error);
  pw_model_free (x.model);
  x.model = NULL;
  pw_run *r = pw_run_open (x.system, "radau", NULL, &error);
  check_ok (error.status, &error);
  runs_to (r, 1);
  pw_workspace_free (w);
  runs_to (r, 2);
  pw_run_close (r);
  gallery_close (&x);
}

/* `show --yaml` keeps the motion to the bit. */
TEST (round_trip) {
  double q[2][3], v[2][3];
  gallery_scene x = follower_scene ("-4*track.offset (car.x, car.y)");
  runs_state (x.system, "erk8", NULL, 5, q[0], v[0], NULL);
  gallery_close (&x);
  cli_good ("pinwheel show --yaml @/follower.yaml >@/again.yaml");
  x = gallery_load (cli_path ("again.yaml"), NULL);
  runs_state (x.system, "erk8", NULL, 5, q[1], v[1], NULL);
  gallery_close (&x);
  check_bits ("positions", q[0], q[1], 3);
  check_bits ("velocities", v[0], v[1], 3);
}

/* Numbers and expressions of an included file use its paths by their names there, outer files by prefixed ones. */
TEST (included) {
  cli_write ("inner.yaml", "pinwheel: 1\npaths: [{name: road, points: [[0, 0], [3, 4], [6, 8]]}]\n"
                           "bodies: [{name: car, mass: 1, inertia: 1, start: {x: \"road.x (5)\", y: \"road.y (5)\"}}]\n"
                           "outputs: [{name: way, value: \"road.s (car.x, car.y)\"}]\n");
  cli_write ("middle.yaml", "pinwheel: 1\ninclude: [{file: inner.yaml, prefix: a_}]\n"
                            "bodies: [{name: car, mass: 1, inertia: 1, start: {x: \"a_road.x (2.5)\"}}]\n");
  cli_write ("outer.yaml", "pinwheel: 1\ninclude: [{file: middle.yaml, prefix: b_}]\n"
                           "bodies: [{name: car, mass: 1, inertia: 1, start: {y: \"b_a_road.y (2.5)\"}}]\n");
  gallery_scene x = gallery_load (cli_path ("outer.yaml"), NULL);
  const double *q = pw_system_initial_q (x.system), expected[] = { 3, 4, 0, 1.5, 0, 0, 0, 2, 0 };
  for (int j = 0; j < 9; j++) check_close ("initial positions", q[j], expected[j], 4 * CHECK_EPS, "round-off");
  gallery_close (&x);
  cli_write ("inner.yaml", "pinwheel: 1\npaths: [{name: road, points: [[0, 0], [3, 4]]}]\n"
                           "bodies: [{name: car, mass: 1, inertia: 1, start: {x: road}}]\n");
  assert_int_equal (cli_run ("pinwheel check @/outer.yaml"), 2);
  assert_non_null (strstr (cli_err, "\"road\" is a path"));
}

/* A contact names a path, also in an included file; `show --yaml` keeps the motion to the bit. */
TEST (contact) {
  double q[2][3], v[2][3];
  cli_write ("hill.yaml",
             "pinwheel: 1\npaths: [{name: hill, points: [[-1, 0], [0, 1], [1, 0.8], [2, -1]], interpolation: "
             "cubic}]\nbodies: [{name: ball, mass: 1, inertia: 0.1, start: {y: 1.5}}]\n"
             "elements:\n  - {gravity: g, acceleration: [0, -9.81]}\n  - {contact: C, body: [ball, ground], "
             "at: [[0, 0], [0, 0]], radius: 0.1, path: hill, mu: 0.3, restitution: 0.5}\n");
  cli_write ("world.yaml", "pinwheel: 1\ninclude: [{file: hill.yaml, prefix: a_}]\n");
  cli_good ("pinwheel show --yaml @/world.yaml >@/again.yaml");
  for (int i = 0; i < 2; i++) {
    gallery_scene x = gallery_load (cli_path (i ? "again.yaml" : "hill.yaml"), NULL);
    runs_state (x.system, "erk8", NULL, 1, q[i], v[i], NULL);
    gallery_close (&x);
  }
  check_bits ("positions", q[0], q[1], 3);
  check_bits ("velocities", v[0], v[1], 3);
  assert_true (fabs (q[0][0]) > 0.05); /* it bounced off the slope */
  cli_good ("sed 's/path: a_hill/path: hill/' @/again.yaml >@/bad.yaml");
  assert_int_equal (cli_run ("pinwheel run @/bad.yaml"), 2);
  assert_non_null (strstr (cli_err, "error: contact a_C: path: there is no path \"hill\"; did you mean \"a_hill\"?"));
}

/* A run is not resumed after a point of its path, far ahead, has changed. */
TEST (resume) {
  static const char track[] = "x,y\n0,0\n9,0\n900,0\n";
  cli_write ("ahead.csv", track);
  cli_write ("ahead.yaml", "pinwheel: 1\npaths: [{name: track, file: ahead.csv}]\n"
                           "bodies: [{name: car, mass: 1, inertia: 1, rate: {vx: 1}}]\n"
                           "elements: [{torque: T, body: [car, ground], value: \"track.offset (car.x, car.y)\"}]\n");
  cli_shell ("pinwheel run @/ahead.yaml --checkpoint @/ahead.save");
  cli_shell ("pinwheel run @/ahead.yaml --resume @/ahead.save");
  cli_write ("ahead.csv", "x,y\n0,0\n9,0\n900,1\n");
  assert_int_equal (cli_run ("pinwheel run @/ahead.yaml --resume @/ahead.save"), 2);
  assert_non_null (strstr (cli_err, "tables is contents "));
}

static int teardown (void) {
  pw_arena_free (&arena);
  for (int i = 0; i < 3; i++) pw_path_close (path[i]);
  return cli_teardown ();
}

const check_fixture fixture = { cli_setup, teardown };
