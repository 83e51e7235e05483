/* Redundant constraint equations: the motion is that of the scene without them, reactions have the least norm, and
 * messages name the elements. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include "check.h"
#include "redundant.h"
#include "scene.h"
#include "trial.h"

#define pw_plugin redundant_parallelogram
#include "../../models/linkages/redundant-parallelogram.c"
#undef pw_plugin

/* ---- Three cranks with one coupler ---- */

/* The third crank is connected to the coupler in x only; the others determine y.  The rows are independent unless the
 * cranks are horizontal. */
SCENE (redundant_slotted) {
  double c = cos (-PW_PI / 4), s = sin (-PW_PI / 4);
  pw_add_body (m, &(pw_body){ .name = "coupler", .mass = 2, .inertia = 2. / 3, .start = { 1 + c, s, 0 } });
  for (int i = 0; i < 3; i++) {
    static const char *const crank[] = { "crank1", "crank2", "crank3" }, *const A[] = { "A1", "A2", "A3" };
    pw_add_body (
        m, &(pw_body){ .name = crank[i], .mass = 1, .inertia = 1. / 12, .start = { i + c / 2, s / 2, -PW_PI / 4 } });
    pw_add_pin (m, &(pw_pin){ .name = A[i], .body = { crank[i], "ground" }, .at = { { -0.5, 0 }, { i, 0 } } });
  }
  pw_add_pin (m, &(pw_pin){ .name = "B1", .body = { "crank1", "coupler" }, .at = { { 0.5, 0 }, { -1, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B2", .body = { "crank2", "coupler" }, .at = { { 0.5, 0 }, { 0, 0 } } });
  pw_add_drive (
      m,
      &(pw_drive){ .name = "B3", .body = { "crank3", "coupler" }, .at = { { 0.5, 0 }, { 1, 0 } }, .what = PW_DRIVE_X });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -9.81 } });
}

static const char *const redundant_cranks[] = { "coupler.x",    "coupler.y",    "coupler.phi",
                                                "crank1.phi",   "crank2.phi",   "crank3.phi",
                                                "crank1.omega", "crank3.omega", NULL };

TEST (parallelogram_twins) {
  redundant_twins (&redundant_parallelogram, &redundant_slotted_table, 1, 1e-3, redundant_cranks);
}

/* The initial angle of one crank differs from the others: where constraints are violated, all rows are independent. */
TEST (parallelogram_start) {
  static const char *const crank[] = { "crank1.phi", "crank2.phi", "crank3.phi" };
  static const double off[] = { 1e-5, 1e-3, 0.1, 0.4, 0.6, 1.0 };
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 6; k++) {
      pw_error error = { 0 };
      double phi = off[k] - PW_PI / 4;
      pw_model *m = scene_model (&redundant_parallelogram, NULL);
      check_ok (pw_model_set_initial (m, crank[i], phi, &error), &error);
      pw_system *s = scene_compile (m);
      pw_run *r = runs_open (s, "rk4+projection", NULL);
      pw_sample x = runs_to (r, 0);
      check_below ("initial residual", x.position, 64 * CHECK_EPS, "64 eps: accuracy of initial positions");
      if (off[k] == 1.0) { /* beyond the change point at 0: Newton's iteration may change the given angle */
        runs_close (r, s);
        continue;
      }
      assert_int_equal (pw_run_initial (r)->released, 0);
      for (int j = 0; j < 3; j++)
        check_close (crank[j], trial_state (s, &x, crank[j]), phi, 64 * CHECK_EPS,
                     "64 eps: accuracy of initial positions");
      runs_close (r, s);
    }
}

/* ---- A tricycle: two wheels on one axle, a steered one in front ---- */

static void redundant_tricycle (pw_model *m, int wheels) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 8, .inertia = 1.2, .rate = { 1, 0, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "fork", .mass = 1, .inertia = 0.02, .start = { 0.57, 0.03, 0.3 }, .rate = { 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "head", .body = { "frame", "fork" }, .at = { { 0.6, 0.04 }, { 0.03, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "fork", .at = { -0.05, 0 }, .heading = 0.1 });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear_left", .body = "frame", .at = { -0.4, 0.3 } });
  if (wheels > 1) pw_add_wheel (m, &(pw_wheel){ .name = "rear_right", .body = "frame", .at = { -0.4, -0.3 } });
  pw_add_torque (m, &(pw_torque){ .name = "rider",
                                  .body = { "frame", "fork" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.3, .omega = 2 } } });
}

REDUNDANT_SCENE (redundant_three, redundant_tricycle (m, 2));
REDUNDANT_SCENE (redundant_two, redundant_tricycle (m, 1));

/* Two equal drives turn a crank against its weight: each has half of the reaction and half of the work. */
SCENE (redundant_drives) {
  const pw_signal turn = { PW_SMOOTH_STEP, .ramp = { .to = 1, .duration = 1 } };
  pw_add_body (m, &(pw_body){ .name = "crank", .mass = 1, .inertia = 0.1, .start = { 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "axle", .body = { "crank", "ground" }, .at = { { -1, 0 }, { 0, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "a", .body = { "crank", "ground" }, .what = PW_DRIVE_ANGLE, .value = turn });
  pw_add_drive (m, &(pw_drive){ .name = "b", .body = { "crank", "ground" }, .what = PW_DRIVE_ANGLE, .value = turn });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -10 } });
}

TEST (drives) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "ida+ggl", "bdf+projection",
                                        "galpha+ggl" };
  for (int i = 0; i < 5; i++) {
    pw_system *s = scene_system (&redundant_drives_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .rtol = 1e-8, .step = 1e-3, .span = 1, .ledger = 1 });
    pw_sample x = runs_to (r, 1);
    assert_int_equal (pw_system_ledger_entries (s), 2);
    check_close (method[i], x.ledger[0], x.ledger[1], 1e-9 * (1 + fabs (x.ledger[0])), "shared as the reactions are");
    check_close (method[i], x.ledger[0] + x.ledger[1], 10 * sin (1), 1e-5, "the weight is lifted by sin (1)");
    runs_close (r, s);
  }
}

TEST (axle) {
  static const char *const name[] = { "frame.x",     "frame.y", "frame.phi", "fork.phi",   "frame.vx", "frame.vy",
                                      "frame.omega", "fork.vx", "fork.vy",   "fork.omega", NULL };
  redundant_twins (&redundant_three_table, &redundant_two_table, 3, 1e-3, name);
  trial (&redundant_three_table, 2);
}

/* Two wheels on one axle have half of the reaction of a single one each. */
TEST (axle_forces) {
  pw_system *s = scene_system (&redundant_three_table, NULL), *twin = scene_system (&redundant_two_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL), *one = runs_open (twin, "rk4+projection", NULL);
  for (int i = 1; i <= 4; i++) {
    pw_sample x = runs_to (r, 0.7 * i), y = runs_to (one, 0.7 * i);
    double left = trial_reaction (s, &x, "rear_left.N"), right = trial_reaction (s, &x, "rear_right.N");
    double whole = trial_reaction (twin, &y, "rear_left.N");
    check_close ("the sum", left + right, whole, 1e-12 * (1 + fabs (whole)),
                 "round-off: the same motion by the same steps");
    check_close ("the halves", left, right, 1e-12 * (1 + fabs (whole)), "reactions of least norm are equal");
  }
  runs_close (r, s);
  runs_close (one, twin);
}

/* ---- Two bodies connected by a weld and two pins, pinned to the ground ---- */

static void redundant_frame (pw_model *m, int pins) {
  pw_add_body (m, &(pw_body){ .name = "left", .mass = 2, .inertia = 0.3, .start = { 0.5, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "right", .mass = 1, .inertia = 0.1, .start = { 1.3, 0.2, 0.4 } });
  double c = cos (0.4), s = sin (0.4);
  pw_add_pin (m, &(pw_pin){ .name = "hook", .body = { "left", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  /* the point (dx, dy) from the centre of `right`, in its frame */
#define REDUNDANT_SEEN(dx, dy) { c * (dx) + s * (dy), c * (dy)-s * (dx) }
  pw_add_weld (m, &(pw_weld){ .name = "plate",
                              .body = { "left", "right" },
                              .at = { { 0.5, 0.1 }, REDUNDANT_SEEN (-0.3, -0.1) },
                              .angle = 0.4 });
  if (pins > 0)
    pw_add_pin (m, &(pw_pin){ .name = "bolt1",
                              .body = { "left", "right" },
                              .at = { { 0.4, -0.2 }, REDUNDANT_SEEN (-0.4, -0.4) } });
  if (pins > 1)
    pw_add_pin (
        m,
        &(pw_pin){ .name = "bolt2", .body = { "left", "right" }, .at = { { 0.6, 0.3 }, REDUNDANT_SEEN (-0.2, 0.1) } });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -9.81 } });
}

REDUNDANT_SCENE (redundant_bolted, redundant_frame (m, 2));
REDUNDANT_SCENE (redundant_welded, redundant_frame (m, 0));

TEST (frame) {
  static const char *const name[] = {
    "left.phi", "right.phi", "right.x", "right.y", "left.omega", "right.omega", NULL
  };
  redundant_twins (&redundant_bolted_table, &redundant_welded_table, 2, 2e-4, name);
  trial (&redundant_bolted_table, 2);
}

/* ---- Messages ---- */

/* A plate of 1 nm, held by pins at two corners and an angle. */
SCENE (redundant_plate) {
  const double size = 1e-9;
  pw_add_body (m, &(pw_body){ .name = "plate", .mass = 1, .inertia = size * size });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "plate", "ground" } });
  pw_add_drive (m, &(pw_drive){ .name = "D", .body = { "plate", "ground" }, .what = PW_DRIVE_ANGLE });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "plate", "ground" }, .at = { { size, 0 }, { size, 0 } } });
}

TEST (names) {
  static const char *const corner[] = { "pins A and B: the same x constraint",
                                        "pin B (B.Fy) follows from pin A, drive D", NULL };
  static const char *const axle[] = { "wheels rear_left and rear_right: the same lateral constraint", NULL };
  static const char *const none[] = { NULL };
  redundant_expect_reports (&redundant_three_table, axle);
  redundant_expect_reports (&redundant_two_table, none);
  redundant_expect_reports (&redundant_plate_table, corner);
}

/* An element type whose third row is the sum of the other two. */
typedef struct {
  const char *name, *body;
} redundant_stop;

static void redundant_stop_J (const pw_batch *b, double *out) {
  static const double J[9] = { 1, 0, 0, 0, 1, 0, 1, 1, 0 };
  for (int e = 0; e < b->count; e++, out += 9) memcpy (out, J, sizeof J);
}

static const pw_field redundant_stop_fields[] = {
  { PW_AT (redundant_stop, body), PW_BODY, .required = 1, .about = "the body" }, { .name = NULL }
};

static const pw_quantity redundant_stop_reaction[] = { { "Fx", "N", NULL, "force along x" },
                                                       { "Fy", "N", NULL, "force along y" },
                                                       { "F", "N", NULL, "force along both" } };

static const pw_kind redundant_kind_stop = { .name = "stop",
                                             .about = "a body that only turns",
                                             .definition = sizeof (redundant_stop),
                                             .fields = redundant_stop_fields,
                                             .bodies = 1,
                                             .rows = 3,
                                             .level = PW_NONHOLONOMIC,
                                             .reaction = redundant_stop_reaction,
                                             .J = redundant_stop_J };

SCENE (redundant_stopped) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1, .rate = { 0, 0, 1 } });
  pw_add (m, &redundant_kind_stop, &(redundant_stop){ .name = "S", .body = "disc" });
}

TEST (same_element) {
  static const char *const own[] = { "stop S (S.F) follows from its other equations", NULL };
  redundant_expect_reports (&redundant_stopped_table, own);
}

/* ---- Selection of independent rows ---- */

/* A disc on a rod and a drive cannot move.  The wheel's row has a larger angle to the drive's row than the rod's row
 * has, but holonomic rows are selected first. */
SCENE (redundant_fixed_disc) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1, .start = { 1, 1, 0 }, .rate = { 0, 0, 1 } });
  pw_add_drive (
      m, &(pw_drive){ .name = "across", .body = { "disc", "ground" }, .what = PW_DRIVE_X, .value = { .constant = 1 } });
  pw_add_rod (m, &(pw_rod){ .name = "rod", .body = { "disc", "ground" }, .length = sqrt (2) });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "disc" });
}

/* The cosine between the wheel's row and that of the drive along it is 1/200. */
SCENE (redundant_oblique_drive) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_drive (m, &(pw_drive){ .name = "ahead", .body = { "disc", "ground" }, .what = PW_DRIVE_X });
  pw_add_drive (m, &(pw_drive){ .name = "aside", .body = { "disc", "ground" }, .what = PW_DRIVE_Y });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "disc", .heading = 0.005 });
}

TEST (kept) {
  static const char *const of_fixed[] = { "wheel edge (edge.N) follows from drive across, rod rod", NULL };
  static const char *const of_oblique[] = { "wheel edge (edge.N) follows from drive ahead, drive aside", NULL };
  redundant_expect_reports (&redundant_fixed_disc_table, of_fixed);
  redundant_expect_reports (&redundant_oblique_drive_table, of_oblique);
}

/* A body with a weld at its centre and a pin at the distance d.  The pin has the part p of the weight W that minimises
 * p^2 + (W - p)^2 + (d p / L)^2, moments in units of force times the scene's length. */
SCENE (redundant_hung) {
  pw_add_body (m, &(pw_body){ .name = "sign", .mass = 3, .inertia = 2 });
  pw_add_weld (m, &(pw_weld){ .name = "weld", .body = { "sign", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "pin", .body = { "sign", "ground" }, .at = { { 4, 0 }, { 4, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -10 } });
}

TEST (moments) {
  pw_system *s = scene_system (&redundant_hung_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  pw_sample x = runs_to (r, 0);
  double L = pw_run_scale (r)->length, W = 30, d = 4, p = W / (2 + d * d / (L * L));
  check_below ("the scene's length is not 1", 0.1, fabs (L - 1), "otherwise units are not tested");
  check_close ("pin", trial_reaction (s, &x, "pin.Fy"), p, 1e-12 * W, "round-off");
  check_close ("weld", trial_reaction (s, &x, "weld.Fy"), W - p, 1e-12 * W, "round-off");
  check_close ("moment", fabs (trial_reaction (s, &x, "weld.M")), d * p, 1e-12 * W * d, "round-off");
  runs_close (r, s);
}

/* Two bodies with two common pins: the redundant equation is the one along the line between them. */
SCENE (redundant_two_pins) {
  static const char *const name[] = { "one", "two" };
  for (int i = 0; i < 2; i++)
    pw_add_body (m, &(pw_body){ .name = name[i], .mass = 1, .inertia = 0.1, .rate = { 0, 0, 1 } });
  for (int i = 0; i < 2; i++)
    pw_add_pin (m, &(pw_pin){ .name = i ? "Q" : "P", .body = { "one", "two" }, .at = { { i, 0 }, { i, 0 } } });
}

/* After a restart with this line turned by 90 degrees other equations are redundant. */
TEST (restart) {
  static const double turned[] = { 0, 0, PW_PI / 2, 0, 0, PW_PI / 2 };
  char method[40];
  pw_system *s = scene_system (&redundant_two_pins_table, NULL);
  for (int i = 0; runs_method (i, method); i++) {
    pw_error error = { 0 };
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 0.01, .rtol = 1e-6 });
    runs_to (r, 0.1);
    check_ok (pw_run_restart (r, turned, NULL, &error), &error);
    check_close (method, runs_to (r, 1).q[2], PW_PI / 2 + 0.9, 1e-5, "10 rtol");
    assert_int_equal (pw_run_redundant (r), 1);
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* ---- Thousands of equations of the same bodies ---- */

enum { MANY = 1000, MANY_COORDS = 6 };

typedef struct {
  double kind, count;
} many;

static const pw_parameter many_list[] = { { PW_AT (many, kind), .about = "of the elements" },
                                          { PW_AT (many, count), .about = "number of elements" },
                                          { .name = NULL } };

enum { PINS, PINS_APART, PINS_TO_GROUND, WELDS, RODS, SLIDERS, WHEELS, ROLLING_WHEELS, MANY_KINDS };

static const char *const many_name[] = { "pins", "pins apart", "pins to ground", "welds",
                                         "rods", "sliders",    "wheels",         "rolling wheels" };

/* An element of the bodies a and b, or of one of them and the ground. */
static void many_add (pw_model *m, int kind, int i, double count) {
  char name[20];
  double x = kind == PINS_APART || kind == WELDS ? cos (i) : 0, y = sin (1.7 * i);
  snprintf (name, sizeof name, "e%d", i);
  if (kind == PINS || kind == PINS_APART)
    pw_add_pin (m, &(pw_pin){ .name = name, .body = { "a", "b" }, .at = { { x + 1, x }, { x, x } } });
  if (kind == PINS_TO_GROUND)
    pw_add_pin (m, &(pw_pin){ .name = name, .body = { "b", "ground" }, .at = { { 1, 0 }, { 2, 0 } } });
  if (kind == WELDS)
    pw_add_weld (m, &(pw_weld){ .name = name, .body = { "a", "b" }, .at = { { x + 1, y }, { x, y } } });
  if (kind == RODS)
    pw_add_rod (m, &(pw_rod){ .name = name, .body = { "b", "ground" }, .at = { { 1, 0 }, { 2, 1 } }, .length = 1 });
  if (kind == SLIDERS)
    pw_add_slider (m, &(pw_slider){ .name = name, .body = { "a", "b" }, .at = { { 0 }, { -1, 0 } }, .heading = 0.3 });
  if (kind == WHEELS) pw_add_wheel (m, &(pw_wheel){ .name = name, .body = "b", .at = { 1, y } });
  if (kind == ROLLING_WHEELS)
    pw_add_rolling_wheel (
        m, &(pw_rolling_wheel){ .name = name, .body = "b", .at = { 1, 0.5 }, .radius = 0.1, .inertia = 0.01 / count });
}

SCENE_WITH (many_build, many_list, many) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 0.5 });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = 0.3, .start = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "hook", .body = { "a", "ground" } });
  for (int i = 0; i < (int)p->count; i++) many_add (m, (int)p->kind, i, p->count);
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 1, -9.81 } });
}

/* A scene of many elements moves like that of a few; they share the reaction of one. */
static void many_check (int kind, const char *method) {
  const int few = kind == PINS_APART ? 5 : 1, is_shared = kind != PINS_APART && kind != WELDS && kind < WHEELS;
  pw_settings settings = { .step = 0.01, .rtol = 1e-9 };
  pw_system *s = scene_system (&many_build_table, "kind", (double)kind, "count", (double)MANY, NULL),
            *twin = scene_system (&many_build_table, "kind", (double)kind, "count", (double)few, NULL);
  pw_run *r = runs_open (s, method, &settings), *one = runs_open (twin, method, &settings);
  pw_sample x = runs_to (r, 0.1), y = runs_to (one, 0.1);
  int per_element = (pw_system_rows (s) - pw_system_rows (twin)) / (MANY - few);
  for (int j = 0; j < MANY_COORDS; j++) {
    check_close (many_name[kind], x.q[j], y.q[j], 1e-9, "equivalent equations: round-off");
    check_close (many_name[kind], x.v[j], y.v[j], 1e-8, "equivalent equations: round-off");
  }
  for (int i = 0, first = 2; is_shared && i < per_element; i++) /* after those of the hook */
    for (int e = 0; e < MANY; e++)
      check_close (many_name[kind], MANY * x.lambda[first + per_element * e + i], y.lambda[first + i],
                   1e-6 * (1 + fabs (y.lambda[first + i])), "each has an equal part");
  assert_true (pw_run_redundant (r) >= MANY - 3);
  runs_close (r, s);
  runs_close (one, twin);
}

/* Subtracts from n numbers their part in the direction `from`, unless that is round-off. */
static void many_subtract (double *to, const double *from, int n) {
  double dot = 0, square = 0;
  for (int i = 0; i < n; i++) dot += to[i] * from[i], square += from[i] * from[i];
  for (int i = 0; i < n && square > 1e-20; i++) to[i] -= dot / square * from[i];
}

/* Multipliers of least norm are combinations of the columns of J. */
TEST (least_norm) {
  static const int kind[] = { PINS_APART, WHEELS, RODS };
  for (int k = 0; k < 3; k++) {
    pw_system *s = scene_system (&many_build_table, "kind", (double)kind[k], "count", 9., NULL);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    pw_sample x = runs_to (r, 0.1);
    pw_equations eq = { .rows = 0 };
    double rest[40], size = 0, column[MANY_COORDS][40] = { { 0 } };
    check_ok (pw_system_equations (s, x.t, x.q, x.v, &eq, NULL), NULL);
    for (int n = 0; n < eq.entries; n++) column[eq.column[n]][eq.row[n]] = eq.value[n];
    for (int i = 0; i < eq.rows; i++) rest[i] = x.lambda[i], size += rest[i] * rest[i];
    for (int j = 0; j < MANY_COORDS; j++) {
      for (int l = 0; l < j; l++) many_subtract (column[j], column[l], eq.rows);
      many_subtract (rest, column[j], eq.rows);
    }
    for (int i = 0; i < eq.rows; i++) check_close (many_name[kind[k]], rest[i] / sqrt (size), 0, 1e-11, "round-off");
    assert_true (pw_run_redundant (r) > 7);
    pw_equations_free (&eq);
    runs_close (r, s);
  }
}

enum { LINKS = 100 };
static const pw_parameter links_list[] = { { .name = "pins", .about = "that hold the first one" }, { .name = NULL } };

SCENE_WITH (links_build, links_list, double) {
  char link[20] = "ground", before[20], pin[20];
  for (int i = 0; i < LINKS; i++) {
    strcpy (before, link);
    snprintf (link, sizeof link, "link%d", i);
    snprintf (pin, sizeof pin, "pin%d", i);
    pw_add_body (m, &(pw_body){ .name = link, .mass = 1, .inertia = 0.1, .start = { i + 0.5, 0, 0 } });
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { before, link }, .at = { { i ? 0.5 : 0, 0 }, { -0.5, 0 } } });
  }
  for (int i = 1; i < *p; i++) {
    snprintf (pin, sizeof pin, "more%d", i);
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { "link50", "link51" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -9.81 } });
}

/* A chain with a pin in three parts: in a large scene the other equations are found to be independent by their pattern.
 * */
TEST (chain) {
  pw_system *s = scene_system (&links_build_table, "pins", 3., NULL),
            *twin = scene_system (&links_build_table, "pins", 1., NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL), *one = runs_open (twin, "rk4+projection", NULL);
  pw_sample x = runs_to (r, 0.02), y = runs_to (one, 0.02);
  char text[300];
  assert_int_equal (pw_run_redundant (r), 4);
  for (int i = 0; i < 4; i++) assert_non_null (strstr (pw_run_redundancy (r, i, text, sizeof text), "pin51"));
  for (int j = 0; j < 3 * LINKS; j++) check_close ("position", x.q[j], y.q[j], 1e-11, "the same equations: round-off");
  runs_close (r, s);
  runs_close (one, twin);
}

#ifdef __SANITIZE_ADDRESS__ /* which keeps released memory */
static const double many_memory = 100;
#else
static const double many_memory = 30;
#endif

TEST (many) {
  struct rusage before, after;
  getrusage (RUSAGE_SELF, &before);
  for (int kind = 0; kind < MANY_KINDS; kind++) many_check (kind, "rk4+projection");
  many_check (PINS, "ida+ggl");
  many_check (PINS_TO_GROUND, "radau");
  getrusage (RUSAGE_SELF, &after);
  check_below ("memory [MB]", (double)(after.ru_maxrss - before.ru_maxrss) / 1e3, many_memory,
               "some arrays of numbers for each equation, but no matrix of 2000 times 2000 of them");
}
