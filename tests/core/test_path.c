/* Paths: nearest places against closed forms and against a search of all points; arc lengths; corners, ends, laps. */
#include <math.h>
#include <stdlib.h>
#include "check.h"

static pw_path *path_of (double (*point)[2], int count, int interpolation, int closed) {
  double x[600], y[600];
  pw_error error = { 0 };
  for (int i = 0; i < count; i++) x[i] = point[i][0], y[i] = point[i][1];
  pw_path *p = pw_path_open (x, y, count, interpolation, closed, &error);
  check_ok (error.status, &error);
  return p;
}

enum { CIRCLE = 400 };

/* A spline through points of a circle of radius 2, counter-clockwise from (2, 0). */
static pw_path *path_circle (void) {
  double point[CIRCLE + 1][2];
  for (int i = 0; i <= CIRCLE; i++)
    point[i][0] = 2 * cos (2 * PW_PI * i / CIRCLE), point[i][1] = 2 * sin (2 * PW_PI * i / CIRCLE);
  return path_of (point, CIRCLE + 1, PW_CUBIC, 1); /* the last point repeats the first */
}

TEST (circle) {
  static const char why[] = "the spline differs from the circle by h^4, h = 0.016, its direction by h^3";
  pw_path *p = path_circle ();
  pw_path_place a;
  check_close ("length", pw_path_length (p), 4 * PW_PI, 2e-9, why);
  for (int k = 0; k < 60; k++) {
    double angle = 0.05 + 0.1 * k, r = 0.5 + 0.05 * k, x = r * cos (angle), y = r * sin (angle);
    pw_path_nearest (p, x, y, INFINITY, &a);
    check_close ("offset", a.offset, 2 - r, 1e-9, why);
    check_close ("s", a.s, 2 * angle, 1e-6, why);
    check_close ("heading", a.heading, angle + PW_PI / 2, 1e-6, why);
    check_close ("curvature", a.curvature[0], 0.5, 2e-5, "h^2");
    pw_path_nearest (p, x, y, 2 * angle + 1 - 40 * PW_PI, &a); /* ten laps before */
    check_close ("offset", a.offset, 2 - r, 1e-9, why);
    check_close ("s ten laps before", a.s, 2 * angle - 40 * PW_PI, 1e-6, why);
    check_close ("heading ten laps before", a.heading, angle + PW_PI / 2 - 20 * PW_PI, 1e-6, why);
  }
  pw_path_nearest (p, 1, 0.1, 2 * PW_PI - 0.3, &a);
  check_close ("the other side, from a quarter before it", a.s, 2 * atan2 (0.1, 1), 1e-6, "falls beyond the middle");
  pw_path_nearest (p, NAN, 0, INFINITY, &a);
  assert_true (isnan (a.offset) && isnan (a.curvature[2]));
  pw_path_close (p);
}

/* A figure of eight, which crosses itself at the origin. */
static void eight_point (double t, double p[2]) {
  p[0] = 3 * cos (t), p[1] = 2 * sin (2 * t);
}

static pw_path *path_eight (void) {
  double point[500][2];
  for (int i = 0; i < 500; i++) eight_point (2 * PW_PI * i / 500, point[i]);
  return path_of (point, 500, PW_CUBIC, 1);
}

/* The nearest place is the nearest of many; the place reached from an arc length is that on the same branch. */
TEST (nearest) {
  enum { MANY = 40000 };
  pw_path *p = path_eight ();
  double length = pw_path_length (p), dense[MANY][2];
  pw_path_place a, b;
  for (int i = 0; i < MANY; i++) pw_path_at (p, length * i / MANY, &a), dense[i][0] = a.x, dense[i][1] = a.y;
  for (int k = 0; k < 200; k++) {
    double x = 4 * sin (7.0 * k), y = 3 * cos (11.0 * k + 1), least = INFINITY;
    for (int i = 0; i < MANY; i++) least = fmin (least, hypot (x - dense[i][0], y - dense[i][1]));
    pw_path_nearest (p, x, y, INFINITY, &a);
    check_close ("distance", fabs (a.offset), least, 1e-5, "half a distance of dense points, squared");
    assert_true (fabs (a.offset) <= least * (1 + 1e-14));
    check_close ("offset", hypot (x - a.x, y - a.y), fabs (a.offset), 1e-12, "round-off");
    pw_path_at (p, a.s, &b);
    check_close ("x", b.x, a.x, 1e-13, "round-off");
    check_close ("y", b.y, a.y, 1e-13, "round-off");
  }
  for (int k = 0; k <= 1000; k++) { /* twice around, through the crossing, 0.05 to the left */
    double s = 2 * length * k / 1000;
    pw_path_at (p, s, &a);
    pw_path_nearest (p, a.x - 0.05 * a.sin, a.y + 0.05 * a.cos, s + 0.1, &b);
    check_close ("s", b.s, s, 1e-11, "round-off");
    check_close ("heading", b.heading, a.heading, 1e-11, "round-off");
    check_close ("offset", b.offset, 0.05, 1e-12, "round-off");
  }
  pw_path_close (p);
}

/* Derivatives by arc length and by the point against central differences. */
static void path_check_derivatives (pw_path *p) {
  static const char why[] = "differences of step 1e-5";
  const double h = 1e-5;
  for (int k = 0; k < 40; k++) {
    double s = pw_path_length (p) * (k + 0.3) / 40, offset = 0.2 * sin (k);
    pw_path_place a, plus, minus;
    pw_path_at (p, s, &a);
    pw_path_at (p, s + h, &plus);
    pw_path_at (p, s - h, &minus);
    check_close ("dx/ds", (plus.x - minus.x) / (2 * h), a.cos, 1e-9, why);
    check_close ("dy/ds", (plus.y - minus.y) / (2 * h), a.sin, 1e-9, why);
    check_close ("curvature", (plus.heading - minus.heading) / (2 * h), a.curvature[0], 1e-8, why);
    check_close ("its derivative", (plus.curvature[0] - minus.curvature[0]) / (2 * h), a.curvature[1], 1e-5, why);
    check_close ("its second one", (plus.curvature[1] - minus.curvature[1]) / (2 * h), a.curvature[2], 1e-4, why);
    double x = a.x - offset * a.sin, y = a.y + offset * a.cos;
    pw_path_nearest (p, x, y, s, &a);
    pw_path_nearest (p, x + h, y, s, &plus);
    pw_path_nearest (p, x - h, y, s, &minus);
    check_close ("offset by x", (plus.offset - minus.offset) / (2 * h), -a.sin, 1e-8, why);
    check_close ("s by x", (plus.s - minus.s) / (2 * h), a.cos / (1 - a.curvature[0] * a.offset), 1e-7, why);
  }
  pw_path_close (p);
}

/* A spline through few points at irregular distances. */
static pw_path *path_coarse (void) {
  return path_of ((double[][2]){ { 0, 0 }, { 3, 0.5 }, { 4, 3 }, { 9, 3 }, { 10, 9 }, { 22, 4 } }, 6, PW_CUBIC, 0);
}

TEST (derivatives) {
  path_check_derivatives (path_eight ());
  path_check_derivatives (path_coarse ());
}

/* The arc length is that of many chords, extrapolated. */
TEST (length) {
  pw_path *p = path_coarse ();
  double length = pw_path_length (p), sum[2] = { 0 };
  for (int k = 0; k < 2; k++) {
    const int many = 20000 << k;
    pw_path_place a, b;
    pw_path_at (p, 0, &a);
    for (int i = 1; i <= many; i++, a = b) {
      pw_path_at (p, length * i / many, &b);
      sum[k] += hypot (b.x - a.x, b.y - a.y);
    }
  }
  check_close ("length", length, (4 * sum[1] - sum[0]) / 3, 1e-12 * length, "h^4 and round-off");
  pw_path_close (p);
}

/* A polyline: at a corner, seen from outside, the direction turns with the point. */
TEST (corners) {
  pw_path *p = path_of ((double[][2]){ { 0, 0 }, { 2, 0 }, { 2, 3 }, { 0, 3 } }, 4, PW_LINEAR, 0);
  const struct {
    double x, y, s, offset, heading;
    int corner;
  } expected[] = {
    { 1, 0.5, 1, 0.5, 0, 0 },                                /* inside */
    { 1, -0.5, 1, -0.5, 0, 0 },                              /* outside */
    { 2.3, -0.4, 2, -0.5, PW_PI / 2 - atan2 (0.4, 0.3), 1 }, /* outside of the corner, */
    { 2, -1, 2, -1, 0, 0 },                                  /* from where its sector begins */
    { 3, 0, 2, -1, PW_PI / 2, 1 },                           /* to its end */
    { 2, 0, 2, 0, 0, 0 },                                    /* the corner itself */
    { 2.5, 3.5, 5, -sqrt (0.5), 3 * PW_PI / 4, 1 },
    { -3, -4, -3, -4, 0, 0 },    /* before the beginning: from its tangent */
    { -3, 4, 10, -1, PW_PI, 0 }, /* after the end */
  };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
    pw_path_place a[2];
    pw_path_nearest (p, expected[i].x, expected[i].y, INFINITY, &a[0]);
    pw_path_nearest (p, expected[i].x, expected[i].y, expected[i].s + 0.3, &a[1]);
    for (int k = 0; k < 2; k++) {
      check_close ("s", a[k].s, expected[i].s, 1e-14, "round-off");
      check_close ("offset", a[k].offset, expected[i].offset, 1e-14, "round-off");
      check_close ("heading", a[k].heading, expected[i].heading, 1e-14, "round-off");
      assert_int_equal (a[k].corner, expected[i].corner);
    }
  }
  check_close ("first corner", pw_path_break (p, -1), 2, 0, "exact");
  check_close ("next", pw_path_break (p, 2), 5, 0, "exact");
  assert_true (pw_path_break (p, 5) == INFINITY);
  pw_path_close (p);
  p = path_of ((double[][2]){ { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } }, 4, PW_LINEAR, 1);
  pw_path_place a;
  pw_path_nearest (p, -0.3, -0.4, INFINITY, &a); /* the corner between the last side and the first */
  check_close ("offset", a.offset, -0.5, 1e-15, "round-off");
  check_close ("heading", a.heading, -atan2 (0.3, 0.4), 1e-15, "round-off");
  pw_path_nearest (p, -0.3, -0.4, 7.9, &a);
  check_close ("s after a lap", a.s, 8, 1e-15, "round-off");
  check_close ("heading after two laps", a.heading, 4 * PW_PI - atan2 (0.3, 0.4), 1e-14, "round-off");
  check_close ("corner", pw_path_break (p, 7.5), 8, 0, "exact");
  pw_path_close (p);
}

/* Beyond its ends a spline goes on straight, and curvature alone jumps there. */
TEST (ends) {
  double point[20][2];
  for (int i = 0; i < 20; i++) point[i][0] = 0.1 * i, point[i][1] = 0.01 * i * i; /* y = x^2 */
  pw_path *p = path_of (point, 20, PW_CUBIC, 0);
  pw_path_place end, a;
  double length = pw_path_length (p), slope = 3.8;
  check_close ("length of the parabola", length, slope * sqrt (1 + slope * slope) / 4 + asinh (slope) / 4, 1e-5,
               "the spline is one in the distance of points");
  pw_path_at (p, length, &end);
  pw_path_nearest (p, end.x + 2 * end.cos - 0.5 * end.sin, end.y + 2 * end.sin + 0.5 * end.cos, INFINITY, &a);
  check_close ("s", a.s, length + 2, 1e-14, "round-off");
  check_close ("offset", a.offset, 0.5, 1e-14, "round-off");
  assert_true (a.curvature[0] == 0 && end.curvature[0] > 0.01);
  pw_path_nearest (p, -1, 1, length + 5, &a);
  check_close ("from beyond the end", a.s, 0, 1.5, "a minimum at the beginning");
  pw_path_nearest (p, -3, -1, length / 2, &a);
  check_close ("before the beginning", a.s, -3, 0.1, "its tangent is almost horizontal");
  check_close ("breaks", pw_path_break (p, -2), 0, 0, "the beginning");
  check_close ("breaks", pw_path_break (p, 0), length, 0, "the end");
  pw_path_close (p);
}

TEST (refused) {
  static const struct {
    double point[5][2];
    int count, interpolation, closed;
    const char *text;
  } bad[] = {
    { { { 0, 0 } }, 1, PW_LINEAR, 0, "an open linear path needs at least 2 different points, found 1" },
    { { { 0, 0 }, { 1, 1 }, { 0, 0 } },
      3,
      PW_LINEAR,
      1,
      "a closed linear path needs at least 3 different points, found 2" },
    { { { 0, 0 }, { 1, 1 }, { 0, 2 } },
      3,
      PW_CUBIC,
      1,
      "a closed cubic path needs at least 4 different points, found 3" },
    { { { 0, 0 }, { 1, 1 }, { 1, 1 } }, 3, PW_LINEAR, 0, "points 2 and 3 are equal, (1, 1)" },
    { { { 0, 0 }, { INFINITY, 1 } }, 2, PW_LINEAR, 0, "point 2 is (inf, 1): expected finite numbers" },
    { { { 0, 0 }, { 1, 0 } }, 2, 7, 0, "interpolation = 7: expected PW_LINEAR or PW_CUBIC" },
    { { { -1e308, 0 }, { 1e308, 0 } }, 2, PW_LINEAR, 0, "the length of the path is not finite" },
    { { { 0, 0 }, { 1, 0 }, { 0, 0 }, { -1, 0 } },
      4,
      PW_CUBIC,
      0,
      "the spline has a cusp, without a direction, after point 1" },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    double x[5], y[5];
    pw_error error = { 0 };
    for (int k = 0; k < 5; k++) x[k] = bad[i].point[k][0], y[k] = bad[i].point[k][1];
    assert_null (pw_path_open (x, y, bad[i].count, bad[i].interpolation, bad[i].closed, &error));
    check_error (&error, PW_INPUT, bad[i].text);
  }
  pw_error error = { 0 };
  double x[] = { 0, 1 };
  assert_null (pw_path_open (x, x, PW_PATH_POINTS + 1, PW_LINEAR, 0, &error)); /* refused before it is read */
  check_error (&error, PW_INPUT, "1000001 points; a path may have 1000000");
  error = (pw_error){ 0 };
  assert_null (pw_path_open (x, NULL, 2, PW_LINEAR, 0, &error));
  check_error (&error, PW_INPUT, "the points are missing");
  pw_path_close (NULL);
}

/* Breaks of a closed polyline in many laps, each found from the one before: all corners, none twice. */
TEST (breaks_of_laps) {
  static const double x[] = { 0, 0.3, 0.7, 0.1 }, y[] = { 0, 0.1, 0.9, 1.3 };
  pw_error error = { 0 };
  pw_path *p = pw_path_open (x, y, 4, PW_LINEAR, 1, &error);
  assert_non_null (p);
  double corner[5] = { 0 };
  for (int i = 0; i < 4; i++) corner[i + 1] = corner[i] + hypot (x[(i + 1) % 4] - x[i], y[(i + 1) % 4] - y[i]);
  double s = -10.01 * corner[4];
  for (int i = 0; i < 80; i++) {
    s = pw_path_break (p, s);
    check_close ("corner", s, (i / 4 - 10) * corner[4] + corner[i % 4], 40 * CHECK_EPS, "round-off of 10 laps");
  }
  pw_path_close (p);
}
