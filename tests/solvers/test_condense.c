/* Condensation to the constraint equations: rows of prescribed coordinates alone, bodies that are not condensed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "block_ldl.h"
#include "saddle.h"
#include "scene.h"

/* The saddle-point system of a scene at its initial state. */
static pw_saddle *condense_open (pw_workspace *w, const double *weight) {
  const pw_system *s = w->s;
  pw_error error = { 0 };
  assert_int_equal (pw_update_kinematics (w, 0, s->q0, s->v0), PW_OK);
  pw_evaluate_J (w);
  pw_saddle *k = pw_saddle_open (w, weight, s->rows, NULL, &error);
  check_ok (k ? PW_OK : error.status, &error);
  return k;
}

/* ---- Prescribed coordinates ---- */

/* A disc whose centre is at the end of a massless arm. */
SCENE (condense_arm) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 2, .inertia = 0.5, .start = { 0.6, 0.8, 0 } });
  pw_add_body (m, &(pw_body){ .name = "arm", .start = { 0.3, 0.4, 0.3 } });
  double x = 0.5 * cos (atan2 (0.8, 0.6) - 0.3), y = 0.5 * sin (atan2 (0.8, 0.6) - 0.3);
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "disc", "arm" }, .at = { { 0, 0 }, { x, y } } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" }, .at = { { -x, -y } } });
}

/* The equation that remains after the elimination of the arm contains the position of the disc only, not its angle.
 * It has no multiplier, also after the arm has turned so far that another equation remains. */
TEST (prescribed_centre) {
  pw_system *s = scene_system (&condense_arm_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  const double weight[] = { INFINITY, INFINITY, 0.5, 0, 0, 0 }, gamma[4] = { 0 }, f[9] = { 0, 0, 3, 5, 7, 2 };
  const double expected[] = { 0, 0, 6, 0, 0, 0 };
  pw_saddle *k = condense_open (w, weight);
  for (int turn = 0; turn < 12; turn++) {
    double a[9], lambda[4], q[9], sum[9] = { 0 };
    memcpy (q, s->q0, 6 * sizeof *q);
    q[5] += 0.55 * turn;
    assert_int_equal (pw_update_kinematics (w, 0, q, s->v0), PW_OK);
    pw_evaluate_J (w);
    assert_int_equal (pw_saddle_factor (k), PW_OK);
    pw_saddle_solve (k, f, gamma, a, lambda);
    pw_add_JT (w, lambda, sum);
    for (int j = 0; j < 6; j++) check_close ("acceleration", a[j], expected[j], 16 * CHECK_EPS, "round-off");
    for (int j = 3; j < 6; j++) check_close ("force", sum[j], f[j], 64 * CHECK_EPS, "round-off of their terms");
    assert_int_equal ((lambda[0] == 0) + (lambda[1] == 0) + (lambda[2] == 0) + (lambda[3] == 0), 1);
  }
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
}

/* ---- Bodies that are not condensed ---- */

enum { PLATFORM_LEGS = 10, PLATFORM_COORDS = 3 * PLATFORM_LEGS + 3, PLATFORM_ROWS = 4 * PLATFORM_LEGS };

typedef struct {
  double mass, last, feet; /* of the platform; 1: it is declared after its legs; legs that stand on the ground */
  double slots;            /* 1: the platform slides on these, in slots */
} platform;

static const pw_parameter platform_list[] = {
  { PW_AT (platform, mass), 1, "kg", "of the platform", PW_POSITIVE },
  { PW_AT (platform, last), .about = "1: the platform is the last body" },
  { PW_AT (platform, feet), 2, .about = "legs that stand on the ground" },
  { PW_AT (platform, slots), .about = "1: the platform has slots for these" },
  { .name = NULL },
};

/* A platform with legs.  In the coordinates of a leg that stands on the ground its two pins are dependent; its foot is
 * therefore eliminated after the platform. */
SCENE_WITH (platform_build, platform_list, platform) {
  char leg[20], pin[20];
  for (int i = -1; i <= PLATFORM_LEGS; i++) {
    snprintf (leg, sizeof leg, "leg%d", i);
    if (i == (p->last != 0 ? PLATFORM_LEGS : -1))
      pw_add_body (m,
                   &(pw_body){ .name = "platform", .mass = p->mass, .inertia = 0.3 * p->mass, .start = { 0, 1, 0 } });
    if (i >= 0 && i < PLATFORM_LEGS)
      pw_add_body (m, &(pw_body){ .name = leg, .mass = 0.1, .inertia = 0.01, .start = { 0.3 * i, 0.5, 0.1 * i } });
  }
  for (int i = 0; i < PLATFORM_LEGS; i++) {
    double c = 0.5 * cos (0.1 * i), s = 0.5 * sin (0.1 * i);
    snprintf (leg, sizeof leg, "leg%d", i);
    snprintf (pin, sizeof pin, "foot%d", i);
    if (i < p->feet)
      pw_add_pin (m,
                  &(pw_pin){ .name = pin, .body = { leg, "ground" }, .at = { { 0.1 - s, -c }, { 0.3 * i + 0.1, 0 } } });
    snprintf (pin, sizeof pin, "pin%d", i);
    if (i < p->feet && p->slots != 0)
      pw_add_slot (
          m,
          &(pw_slot){ .name = pin, .body = { leg, "platform" }, .at = { { s, c }, { 0.3 * i, 0 } }, .heading = 1 + i });
    else
      pw_add_pin (m, &(pw_pin){ .name = pin, .body = { leg, "platform" }, .at = { { s, c }, { 0.3 * i, 0 } } });
  }
}

typedef struct {
  double a[PLATFORM_COORDS + 3], lambda[PLATFORM_ROWS], sine;
  int status, row;
} solution;

/* The accelerations of the legs come first. */
static solution platform_solve (double mass, int last, int feet, int slots) {
  solution x = { .row = -1 };
  pw_system *s = scene_system (&platform_build_table, "mass", mass, "last", (double)last, "feet", (double)feet, "slots",
                               (double)slots, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double f[PLATFORM_COORDS + 3] = { 0 }, gamma[PLATFORM_ROWS], a[PLATFORM_COORDS + 3];
  const int first = last ? 0 : 3, coords = PLATFORM_COORDS;
  assert_true (s->coords == coords && s->rows == 2 * (PLATFORM_LEGS + feet) - slots * feet);
  pw_saddle *k = condense_open (w, s->mass);
  for (int j = 0; j < coords; j++) f[(j + first) % coords] = cos (j);
  for (int i = 0; i < s->rows; i++) gamma[i] = sin (3 * i);
  x.status = pw_saddle_factor (k);
  x.sine = pw_saddle_sine (k, &x.row);
  if (x.status == PW_OK) pw_saddle_solve (k, f, gamma, a, x.lambda);
  for (int j = 0; j < coords; j++) x.a[j] = a[(j + first) % coords];
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
  return x;
}

static void platform_compare (const char *what, const double *a, const double *b, int n) {
  double size = 0;
  for (int i = 0; i < n; i++) size = fmax (size, fabs (a[i]));
  for (int i = 0; i < n; i++)
    check_close (what, a[i] / size, b[i] / size, 1e4 * CHECK_EPS, "round-off, over the square of a sine above 0.01");
}

/* Accelerations, multipliers, the smallest pivot and the verdict do not depend on the order of the bodies. */
static void platform_check (int slots) {
  for (double mass = 1e-3; mass < 2e3; mass *= 10)
    for (int feet = 1; feet <= 4; feet++) {
      const solution x = platform_solve (mass, 0, feet, slots), y = platform_solve (mass, 1, feet, slots);
      assert_int_equal (x.status, feet < 4 || slots ? PW_OK : PW_RETRY); /* three pinned legs hold the platform */
      assert_int_equal (y.status, x.status);
      if (x.status != PW_OK) continue;
      platform_compare ("acceleration", x.a, y.a, PLATFORM_COORDS);
      platform_compare ("multiplier", x.lambda, y.lambda, 2 * (PLATFORM_LEGS + feet) - slots * feet);
      check_close ("sine", x.sine / y.sine, 1, 1e4 * CHECK_EPS, "round-off, over the square of a sine above 0.01");
      assert_int_equal (x.row, y.row);
    }
}

TEST (order_of_bodies) {
  platform_check (0);
}

TEST (order_with_slots) {
  platform_check (1);
}

static const pw_parameter bent_leg_list[] = { { .name = "base", .about = "1: the leg stands on a body" },
                                              { .name = NULL } };

/* A platform with free arms, on a leg of two links that is bent. */
SCENE_WITH (bent_leg_build, bent_leg_list, double) {
  const char *below = *p != 0 ? "base" : "ground";
  if (*p != 0) pw_add_body (m, &(pw_body){ .name = "base", .mass = 1, .inertia = 1, .start = { 0, 1, 0 } });
  pw_add_body (m, &(pw_body){ .name = "thigh", .mass = 0.2, .inertia = 0.01, .start = { 0, 0, 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "shank", .mass = 0.2, .inertia = 0.01 });
  pw_add_body (m, &(pw_body){ .name = "platform", .mass = 1, .inertia = 0.3 });
  pw_add_pin (m, &(pw_pin){ .name = "hip", .body = { below, "thigh" }, .at = { { 0, *p != 0 ? 0 : 1 }, { 0, 0.5 } } });
  pw_add_pin (m, &(pw_pin){ .name = "knee", .body = { "thigh", "shank" }, .at = { { 0, -0.5 }, { 0, 0.5 } } });
  pw_add_pin (m, &(pw_pin){ .name = "foot", .body = { "shank", "platform" }, .at = { { 0, -0.5 }, { 0, 0 } } });
  for (int i = 0; i < PLATFORM_LEGS; i++) {
    char arm[20], pin[20];
    snprintf (arm, sizeof arm, "arm%d", i);
    snprintf (pin, sizeof pin, "pin%d", i);
    pw_add_body (m, &(pw_body){ .name = arm, .mass = 0.1, .inertia = 0.01 });
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { arm, "platform" }, .at = { { 0, 0.5 }, { 0.3 * i, 0 } } });
  }
}

/* A stretched leg is singular for a platform at rest, not for one that moves; also if it stands on a body whose centre
 * does not move. */
static void stretched_leg (int on_base) {
  pw_system *s = scene_system (&bent_leg_build_table, "base", (double)on_base, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double *q = calloc (2 * (size_t)s->coords, sizeof *q), *weight = q + s->coords;
  int row;
  memcpy (weight, s->mass, (size_t)s->coords * sizeof *weight);
  if (on_base) weight[0] = weight[1] = INFINITY, q[1] = 1;
  pw_saddle *k = condense_open (w, weight);
  assert_int_equal (pw_saddle_factor (k), PW_OK);
  assert_int_equal (pw_update_kinematics (w, 0, q, s->v0), PW_OK);
  pw_evaluate_J (w);
  assert_int_equal (pw_saddle_factor (k), PW_OK);
  assert_true (pw_saddle_sine (k, &row) > 0.05);
  free (q);
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
}

TEST (stretched_leg) {
  for (int on_base = 0; on_base < 2; on_base++) stretched_leg (on_base);
}

enum { CART_WHEELS = 50 };

SCENE (cart_build) {
  char name[20];
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 1, .inertia = 1 });
  for (int i = 0; i < CART_WHEELS; i++) {
    snprintf (name, sizeof name, "wheel%d", i);
    pw_add_rolling_wheel (
        m, &(pw_rolling_wheel){ .name = name, .body = "cart", .at = { 0, sin (i) }, .radius = 0.1, .inertia = 0.001 });
  }
}

/* Wheels that roll are coupled with their body only. */
TEST (rolling_wheels) {
  pw_system *s = scene_system (&cart_build_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  unsigned char active[2 * CART_WHEELS];
  pw_error error = { 0 };
  for (int i = 0; i < s->rows; i++) active[i] = i == 0 || i % 2 == 1;
  assert_int_equal (pw_update_kinematics (w, 0, s->q0, s->v0), PW_OK);
  pw_evaluate_J (w);
  pw_saddle *k = pw_saddle_open (w, s->mass, s->rows, active, &error);
  check_ok (k ? PW_OK : error.status, &error);
  assert_int_equal (pw_saddle_factor (k), PW_OK);
  assert_in_range (k->block->values, CART_WHEELS, 10 * CART_WHEELS);
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
}

/* ---- Platforms on many legs, with prescribed coordinates ---- */

enum { STOOL_LEGS = 80 };
static const pw_parameter stool_list[] = { { .name = "legs", .about = "that stand on the ground" }, { .name = NULL } };

/* A platform on bent legs of two links; further links hang from it. */
SCENE_WITH (stool_build, stool_list, double) {
  char name[5][20];
  pw_add_body (m, &(pw_body){ .name = "platform", .mass = 1, .inertia = 0.3, .start = { 0.2, 0.1, 0.3 } });
  for (int i = 0; i < STOOL_LEGS; i++) {
    static const char *const part[] = { "thigh", "shank", "hip", "knee", "foot" };
    for (int k = 0; k < 5; k++) snprintf (name[k], sizeof name[k], "%s%d", part[k], i);
    for (int k = 0; k < 2; k++)
      pw_add_body (m, &(pw_body){ .name = name[k], .mass = 0.1, .inertia = 0.01, .start = { i, k, 0.7 * i + k } });
    pw_add_pin (m, &(pw_pin){ .name = name[2], .body = { name[0], "platform" }, .at = { { 0.5, 0 }, { i, 0 } } });
    pw_add_pin (m, &(pw_pin){ .name = name[3], .body = { name[0], name[1] }, .at = { { -0.5, 0 }, { 0.5, 0 } } });
    if (i < *p) pw_add_pin (m, &(pw_pin){ .name = name[4], .body = { name[1], "ground" }, .at = { { -0.5, 0 } } });
  }
}

/* Solutions satisfy the equations, whichever coordinates of the platform are prescribed; it is not condensed. */
TEST (stool) {
  for (int legs = 0; legs <= STOOL_LEGS; legs += STOOL_LEGS)
    for (int prescribed = 0; prescribed < 7; prescribed++) {
      pw_system *s = scene_system (&stool_build_table, "legs", (double)legs, NULL);
      pw_workspace *w = pw_workspace_new (s, NULL);
      const size_t n = (size_t)s->coords, rows = (size_t)s->rows;
      double *weight = calloc (6 * n + 4 * rows + 6, sizeof *weight), *f = weight + n, *a = f + n, *sum = a + n + 3;
      double *lambda = sum + n + 3, *gamma = lambda + rows, *Ja = gamma + rows;
      for (int j = 0; j < s->coords; j++) weight[j] = j < 3 && prescribed & 1 << j ? INFINITY : s->mass[j];
      for (int j = 0; j < s->coords; j++) f[j] = cos (j);
      for (int i = 0; i < s->rows; i++) gamma[i] = sin (3 * i);
      pw_saddle *k = condense_open (w, weight);
      assert_int_equal (k->extra, 3);
      assert_int_equal (pw_saddle_factor (k), PW_OK);
      pw_saddle_solve (k, f, gamma, a, lambda);
      pw_add_JT (w, lambda, sum);
      pw_mul_J (w, a, Ja);
      double unit = 1e4 * CHECK_EPS;
      for (int j = 0; j < s->coords; j++)
        if (isinf (weight[j]))
          check_close ("prescribed", a[j], 0, 0, "it does not move");
        else
          check_close ("force", s->mass[j] * a[j] + sum[j], f[j], unit * (1 + fabs (sum[j])),
                       "round-off over a sine^2");
      for (int i = 0; i < s->rows; i++)
        check_close ("acceleration", Ja[i], gamma[i], 1e4 * unit, "round-off of accelerations of 1e3");
      free (weight);
      pw_saddle_close (k);
      pw_workspace_free (w);
      pw_system_free (s);
    }
}
