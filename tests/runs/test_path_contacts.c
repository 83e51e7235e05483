/* Contacts of a disc with a path: closed forms on a circle, the contacts with lines and discs that paths approximate,
 * paths of moving bodies, what is refused. */
#include <math.h>
#include "check.h"
#include "pinwheel-selftest.h"
#include "runs.h"
#include "scene.h"

/* A spline through n points of a circle of radius 1, to the left or to the right, or of the line y = 0 (side 0). */
static pw_path *curves_path (int side, int n) {
  static double x[1600], y[1600];
  pw_error error = { 0 };
  for (int i = 0; i < n; i++)
    x[i] = side ? sin (-side * 2 * PW_PI * i / n) : 0.3 * i, y[i] = side ? cos (-side * 2 * PW_PI * i / n) : 0;
  pw_path *path = pw_path_open (x, y, n, PW_CUBIC, side != 0, &error);
  check_ok (error.status, &error);
  return path;
}

/* The scene: a disc of radius 0.1 and a contact, with its path, if it has one. */
static struct {
  pw_contact contact;
  double start[3], rate[3];
  int side, points; /* of the path; points 0: none */
} curves_scene;

SCENE (curves) {
  pw_contact c = curves_scene.contact;
  pw_body disc = { .name = "disc", .mass = 2, .inertia = 0.01 };
  for (int i = 0; i < 3; i++) disc.start[i] = curves_scene.start[i], disc.rate[i] = curves_scene.rate[i];
  pw_add_body (m, &disc);
  pw_add_body (m,
               &(pw_body){ .name = "block", .mass = 5, .inertia = 1, .start = { 0, 0, 0.3 }, .rate = { 0, 0, 0.5 } });
  pw_add_force (m, &(pw_force){ .name = "weight", .body = "disc", .fy = { .constant = -2 * 9.81 } });
  c.name = "C", c.body[0] = "disc";
  if (c.body[1] == NULL) c.body[1] = "ground";
  c.radius = 0.1;
  if (curves_scene.points > 0) c.path = curves_path (curves_scene.side, curves_scene.points);
  pw_add_contact (m, &c);
  pw_path_close (c.path);
}

/* The state of a run with the scene at t; time: of events, up to 40, to: the modes after them. */
static int curves_run (const char *method, double step, double rtol, double t, double x[12], double time[40],
                       int to[40]) {
  pw_system *s = scene_system (&curves_table, NULL);
  int count;
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = rtol, .span = t, .ledger = 1 });
  const pw_sample end = runs_to (r, t);
  const pw_event *event = pw_run_events (r, &count);
  for (int i = 0; i < count && i < 40; i++) time[i] = event[i].t, to[i] = event[i].to;
  for (int j = 0; j < 6; j++) x[j] = end.q[j], x[6 + j] = end.v[j];
  check_close (check_text ("%s, balance", method), end.balance, 0, 1e-6, "losses are counted; kinks of the curvature");
  runs_close (r, s);
  return count;
}

/* A disc that slides down a hill leaves it where cos (angle) = (2 + v0^2/(g rho))/3, rho = 1.1 m the distance of the
 * centres.  The curvature of the spline has errors of h^2/12. */
TEST (hill) {
  const double v0 = 0.5, rho = 1.1, leaves = (2 + v0 * v0 / (9.81 * rho)) / 3;
  double error[2];
  for (int fine = 0; fine < 2; fine++) {
    double x[12], time[40];
    int to[40];
    curves_scene.start[0] = 0, curves_scene.start[1] = rho, curves_scene.rate[0] = v0;
    curves_scene.side = -1, curves_scene.points = fine ? 400 : 200;
    curves_scene.contact = (pw_contact){ .heading = 0 };
    const int count = curves_run ("erk8+projection", 0, 1e-12, 1, x, time, to);
    assert_true (count == 2 && to[0] == 0 && to[1] != 0);
    (void)curves_run ("erk8+projection", 0, 1e-12, time[1], x, time, to);
    error[fine] = fabs (x[1] / hypot (x[0], x[1]) - leaves);
    check_close ("height", hypot (x[0], x[1]), rho, 1e-6, "the spline's distance from the circle");
  }
  check_below ("angle", error[1], 1e-4, "h^2/12 at h = 0.016, 4 times over");
  check_close ("order", log (error[0] / error[1]) / log (2), 2, 0.6, "of the curvature");
}

/* A disc that slides in a bowl is a pendulum of length 0.9 m. */
TEST (bowl) {
  static const char *const method[] = { "erk8+projection", "radau+ggl", "ida+ggl", "bdf+projection", "rk4+projection" };
  const double l = 0.9, A = 1, w = sqrt (9.81 / l), k2 = sin (A / 2) * sin (A / 2), t = 2;
  const double sn = sin (pw_jacobi_am (pw_elliptic_K (k2) - w * t, k2)), angle = 2 * asin (sin (A / 2) * sn);
  curves_scene.start[0] = l * sin (A), curves_scene.start[1] = -l * cos (A), curves_scene.rate[0] = 0;
  curves_scene.side = 1, curves_scene.points = 800;
  curves_scene.contact = (pw_contact){ .restitution = 0.5 };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    double x[12], time[40];
    int to[40];
    (void)curves_run (method[i], 1e-3, 1e-10, t, x, time, to);
    check_close (method[i], atan2 (x[0], -x[1]), angle, 1e-6, "the spline's distance from the circle; 1e4 rtol");
  }
}

/* What two contacts do is the same: one with a path and one with what it approximates. */
static void curves_same (const pw_contact *contact, int side, int points, double bound, const char *reason) {
  static const char *const method[] = { "erk8+projection", "radau+ggl", "rk4+projection" };
  double x[2][12], time[2][40];
  int to[2][40], count[2];
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    for (int path = 0; path < 2; path++) {
      curves_scene.side = side, curves_scene.points = path ? points : 0;
      curves_scene.contact = *contact;
      curves_scene.contact.other_radius = path ? 0 : contact->other_radius;
      curves_scene.contact.heading = path || contact->other_radius == 0 ? contact->heading : 0;
      count[path] = curves_run (method[i], 1e-3, 1e-11, 1.5, x[path], time[path], to[path]);
    }
    assert_int_equal (count[0], count[1]);
    assert_in_range (count[0], 2, 40);
    for (int k = 0; k < count[0]; k++) {
      check_close (check_text ("%s, event %d", method[i], k), time[1][k], time[0][k], bound, reason);
      assert_int_equal (to[0][k], to[1][k]);
    }
    for (int j = 0; j < 12; j++)
      check_close (check_text ("%s, %d", method[i], j), x[1][j], x[0][j], 50 * bound, reason);
  }
}

/* A disc falls on a disc, also one that moves, where it bounces, slides and rolls off. */
TEST (disc) {
  curves_scene.start[0] = 0.2, curves_scene.start[1] = 1.4, curves_scene.rate[0] = 0.3, curves_scene.rate[2] = -3;
  pw_contact c = { .other_radius = 1, .mu = 0.25, .mu_sliding = 0.2, .restitution = 0.3 };
  curves_same (&c, -1, 800, 1e-5, "h^2/12 of the curvature, at h = 0.008");
  c.body[1] = "block", c.at[1][0] = 0.1, c.at[1][1] = 0.05, c.heading = 0.7;
  curves_same (&c, -1, 800, 1e-5, "the same");
}

/* A straight path is a line, beyond its end, too, to round-off; on a block that falls and turns. */
TEST (straight) {
  curves_scene.start[0] = 0.4, curves_scene.start[1] = 0.5, curves_scene.rate[0] = 2, curves_scene.rate[1] = -3;
  curves_same (
      &(pw_contact){ .body[1] = "block", .heading = -0.4, .at[1] = { -0.5, 0.2 }, .mu = 0.2, .restitution = 0.4 }, 0, 4,
      1e-11, "round-off");
}

/* Derivatives of both types by differences; on a curve whose curvature varies, of a body that moves. */
SCENE (curves_touching) {
  static const double x[] = { -2, -1, 0, 1, 2.5 }, y[] = { 0.3, -0.2, 0.1, -0.3, 0.4 };
  pw_path *path = pw_path_open (x, y, 5, PW_CUBIC, 0, NULL);
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 2, .start = { 0.3, 0.7, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 3, .inertia = 1, .start = { -0.2, 0.1, -0.3 } });
  pw_add_contact (m, &(pw_contact){ .name = "T",
                                    .body = { "a", "b" },
                                    .at = { { 0.1, 0.2 }, { -0.2, 0.1 } },
                                    .heading = 0.2,
                                    .radius = 0.1,
                                    .path = path,
                                    .mu = 0.3 });
  pw_path_close (path);
}

TEST (derivatives) {
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  pw_system *s = scene_system (&curves_touching_table, NULL);
  double q[6] = { 0.3, 0.7, 0.4, -0.2, 0.1, -0.3 }, v[6] = { 0.2, -0.5, 0.3, 0.4, 0.6, -0.7 };
  assert_int_equal (pw_system_elements (s), 2);
  for (int i = 0; i < 2; i++) {
    check_ok (pw_selftest_scene (s, 1, pw_system_element (s, i).kind, 0, q, v, 7, &report, &error), &error);
    for (int n = 0; n < report.checks; n++)
      if (report.check[n].failed) print_error ("%s: %s\n", report.check[n].name, report.check[n].where);
    assert_int_equal (report.failed, 0);
  }
  pw_system_free (s);
}

/* A disc does not fit in a bend, between two walls, or where the tangents beyond the ends meet. */
TEST (tight) {
  static const double bend[] = { -2, 4, -1, 1, -0.5, 0.25, 0, 0, 0.5, 0.25, 1, 1, 2, 4 };
  static const double wall[] = { 0, 1, 0, 0, 0.05, -0.5, 0.3, -0.8, 0.8, -0.5, 0.5, 0, 0.3, 0.5, 0.35, 1 };
  static const struct {
    const double *point;
    int count, fits;
    double radius;
  } of[] = { { bend, 7, 1, 0.4 }, { bend, 7, 0, 0.6 }, { wall, 8, 1, 0.1 }, { wall, 8, 0, 0.2 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    double x[8], y[8];
    for (int k = 0; k < of[i].count; k++) x[k] = of[i].point[2 * k], y[k] = of[i].point[2 * k + 1];
    pw_error error = { 0 };
    pw_path *path = pw_path_open (x, y, of[i].count, PW_CUBIC, 0, &error);
    check_ok (error.status, &error);
    if (of[i].fits != isnan (pw_path_tight (path, of[i].radius))) print_error ("path %zu\n", i);
    assert_int_equal (of[i].fits, isnan (pw_path_tight (path, of[i].radius)));
    assert_true (isnan (pw_path_tight (path, 0)));
    pw_path_close (path);
  }
}

TEST (refused) {
  static const double x[] = { 0, 1, 2 }, y[] = { 0, 1, 0 };
  pw_path *line = pw_path_open (x, y, 3, PW_LINEAR, 0, NULL), *circle = curves_path (1, 40);
  curves_scene.points = 0;
  curves_scene.contact = (pw_contact){ .path = pw_path_share (line) };
  scene_refused (scene_model (&curves_table, NULL),
                 "model scene: contact C: path: a polyline: expected a cubic path, which has a normal everywhere");
  curves_scene.contact = (pw_contact){ .path = pw_path_share (circle), .other_radius = 1 };
  scene_refused (scene_model (&curves_table, NULL),
                 "model scene: contact C: path and other_radius: expected one of them");
  pw_path_close (line), pw_path_close (circle);
}
