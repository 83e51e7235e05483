/* A bead on a curve under gravity: on the parabola y = x^2, whose functions are in C, and on x = cos s, y = sin 2s,
 * through the point where this curve crosses itself; reference digits by a reduced equation in s with 30 digits. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

static int parabola_x (void *context, double s, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = s, value[1] = 1, value[2] = 0;
  return 0;
}

static int parabola_y (void *context, double s, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = s * s, value[1] = 2 * s, value[2] = 2;
  return 0;
}

typedef struct {
  double lissajous, inertia, arm, laps;
} curve_parameters;

static const pw_parameter curve_list[] = { { PW_AT (curve_parameters, lissajous), 0, "", "", PW_REAL },
                                           { PW_AT (curve_parameters, inertia), 0, "", "", PW_NONNEGATIVE },
                                           { PW_AT (curve_parameters, arm), 0, "", "", PW_REAL },
                                           { PW_AT (curve_parameters, laps), 0, "", "", PW_REAL },
                                           { .name = NULL } };

/* The bead is a point mass or a body with an inertia, its centre or a point beside it on the curve.  On the parabola s
 * follows from the position, on the other curve the position from s. */
SCENE_WITH (curve_build, curve_list, curve_parameters) {
  pw_body bead = { .name = "bead", .mass = 1, .inertia = p->inertia };
  pw_on_curve wire = { .name = "wire", .body = "bead", .at = { p->arm, 0 } };
  if (p->lissajous != 0) {
    wire.x = (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = 1, .omega = 1 } };
    wire.y = (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = 1, .omega = 2, .phase = -PW_PI / 2 } };
    wire.start = 0.2 + 2 * PW_PI * p->laps;
    bead.specified = PW_SPECIFIES_NOTHING; /* not that the bead is at the origin */
  } else {
    wire.x = (pw_signal){ PW_FUNCTION, .function = { .eval = parabola_x } };
    wire.y = (pw_signal){ PW_FUNCTION, .function = { .eval = parabola_y } };
    bead.start[0] = bead.start[1] = 1;
  }
  pw_add_body (m, &bead);
  pw_add_on_curve (m, &wire);
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

/* t, x, y, vx, vy, Fx, Fy */
static const double curve_reference[2][3][7] = {
  { { 0.5, 0.376429823214, 0.141699411805, -3.27840611588, -2.46817966925, -15.042749023, 19.9808146105 },
    { 1, -0.927359881589, 0.859996349981, -0.786553756682, 1.45883679732, 4.61481427479, 2.48814638546 },
    { 5, 0.881289166899, 0.776670595694, -1.03294428633, -1.8206452191, -5.1263140524, 2.9084177163 } },
  { { 0.5, 0.886746902295, -0.819806851014, -1.8230587284, -4.51679700294, -32.9675067287, 13.3062656692 },
    { 1, -0.135196334188, 0.267910146958, -0.706067760776, 1.37312020958, 3.82249465339, 1.96555277656 },
    { 3, 0.38115934005, -0.704770755371, -2.52943908431, 3.88200051716, 12.1362535619, 7.90775631295 } },
};

static void curve_run (const char *method, int lissajous, double laps, const pw_settings *settings, double bound) {
  pw_system *s = scene_system (&curve_build_table, "lissajous", (double)lissajous, "laps", laps, NULL);
  pw_run *r = runs_open (s, method, settings);
  for (int i = 0; i < 3; i++) {
    const double *expected = curve_reference[lissajous][i];
    pw_sample x = runs_to (r, expected[0]);
    const double found[] = { x.q[0], x.q[1], x.v[0], x.v[1], -x.lambda[0], -x.lambda[1] };
    for (int k = 0; k < 6; k++)
      check_close (check_text ("%s, t = %g, number %d", method, expected[0], k), found[k], expected[1 + k],
                   bound * fmax (1, fabs (expected[1 + k])), "the method's error");
  }
  runs_close (r, s);
}

TEST (digits) {
  static const struct {
    const char *method;
    double step, rtol;
  } run[] = { { "rk4+projection", 2e-4, 1e-6 }, { "erk8", 1, 1e-12 },    { "erk8+projection", 1, 1e-12 },
              { "bdf+projection", 1, 1e-13 },   { "ida+ggl", 1, 1e-13 }, { "radau", 1, 1e-12 } };
  for (size_t i = 0; i < sizeof run / sizeof *run; i++)
    for (int lissajous = 0; lissajous < 2; lissajous++)
      curve_run (run[i].method, lissajous, 0, &(pw_settings){ .step = run[i].step, .rtol = run[i].rtol }, 1e-8);
}

/* Every method and stabilisation. */
TEST (methods) {
  char method[40];
  for (int i = 0; runs_method (i, method); i++)
    for (int lissajous = 0; lissajous < 2; lissajous++)
      curve_run (method, lissajous, 0, &(pw_settings){ .step = 2e-4, .rtol = 1e-9 }, 1e-3);
}

/* After many laps the round-off of s, and thus of the place, is much larger than that of the coordinates: after 1e6,
 * 1e-9, about the tolerance of the implicit methods. */
TEST (laps) {
  static const double laps[] = { 1e3, -1e3, 1e6 };
  char method[40];
  for (int i = 0; runs_method (i, method); i++)
    for (int k = 0; k < (strstr (method, "projection") || strstr (method, "nullspace") ? 3 : 2); k++)
      curve_run (method, 1, laps[k], &(pw_settings){ .step = 2e-4, .rtol = 1e-9 }, 1e-3);
}

typedef struct {
  double radius, unit, rate, specified; /* unit: of s per radian */
} circle_parameters;

static const pw_parameter circle_list[] = { { PW_AT (circle_parameters, radius), 1, "m", "", PW_POSITIVE },
                                            { PW_AT (circle_parameters, unit), 1, "", "", PW_POSITIVE },
                                            { PW_AT (circle_parameters, rate), 0, "", "", PW_REAL },
                                            { PW_AT (circle_parameters, specified), 0, "", "", PW_REAL },
                                            { .name = NULL } };

/* A bead at (0.5, 0.8) R with the velocity (-3, 2) R, unless the wire says where it is. */
SCENE_WITH (circle_build, circle_list, circle_parameters) {
  const double R = p->radius;
  pw_on_curve wire = { .name = "wire", .body = "bead", .rate = p->rate * p->unit };
  wire.x = (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = R, .omega = 1 / p->unit } };
  wire.y = (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = R, .omega = 1 / p->unit, .phase = -PW_PI / 2 } };
  wire.specified[0] = wire.specified[1] = p->specified != 0;
  pw_body bead = { .name = "bead", .mass = 1, .start = { 0.5 * R, 0.8 * R }, .rate = { -3 * R, 2 * R } };
  bead.specified = PW_SPECIFIES_NOTHING;
  pw_add_body (m, &bead);
  pw_add_on_curve (m, &wire);
}

/* A bead goes round circles of several sizes, whose parameter is an angle or a length, 140 times. */
TEST (circles) {
  static const double radius[] = { 0.01, 1, 1000 };
  static const char *const method[] = { "rk4+projection", "erk8+projection", "bdf+projection", "rk4+nullspace" };
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 8; k++) {
      const double R = radius[i];
      pw_system *s = scene_system (&circle_build_table, "radius", R, "unit", k < 4 ? 1 : R, "rate", 3., NULL);
      pw_run *r = runs_open (s, method[k % 4], &(pw_settings){ .step = 0.02, .rtol = 1e-9 });
      pw_sample x = runs_to (r, 300);
      check_close (method[k % 4], hypot (x.q[0], x.q[1]), R, 1e-9 * R,
                   "the projection, or the null space, which drifts");
      check_close (method[k % 4], hypot (x.v[0], x.v[1]), 3 * R, 1e-3 * R, "the method's error");
      runs_close (r, s);
    }
}

/* An initial s and velocity of 0 that are specified are kept; otherwise they follow from the bead. */
TEST (specified) {
  for (int specified = 0; specified < 2; specified++) {
    pw_system *s = scene_system (&circle_build_table, "specified", (double)specified, NULL);
    pw_run *r = runs_open (s, "erk8", NULL);
    pw_sample x = runs_to (r, 0);
    assert_int_equal (fabs (x.q[3]) < 1e-12, specified);
    assert_int_equal (fabs (x.v[3]) < 1e-12, specified);
    check_close ("x", x.q[0], cos (x.q[3]), 1e-12, "round-off");
    check_close ("vy", x.v[1], cos (x.q[3]) * x.v[3], 1e-12, "round-off");
    runs_close (r, s);
  }
}

/* A point beside the centre of mass of a body that turns. */
TEST (arm) {
  double q[2][4], v[2][4];
  for (int k = 0; k < 2; k++) {
    pw_system *s = scene_system (&curve_build_table, "lissajous", 1., "inertia", 0.2, "arm", 0.3, NULL);
    runs_state (s, k ? "radau+index3" : "erk8", &(pw_settings){ .rtol = 1e-11 }, 2, q[k], v[k], NULL);
    pw_system_free (s);
  }
  for (int j = 0; j < 4; j++) {
    check_close ("position", q[1][j], q[0][j], 1e-7, "the methods' errors");
    check_close ("velocity", v[1][j], v[0][j], 1e-7, "the methods' errors");
  }
}

/* s is found from the position, and the other way round; the velocity of one from that of the other. */
TEST (initial) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&curve_build_table, NULL);
  pw_run *r = runs_open (s, "erk8", NULL);
  check_close ("s of (1, 1)", runs_to (r, 0).q[3], 1, 1e-12, "round-off");
  runs_close (r, s);
  pw_model *m = scene_model (&curve_build_table, NULL);
  check_ok (pw_model_set_initial (m, "bead.vx", 0.5, &error), &error);
  s = scene_compile (m);
  r = runs_open (s, "erk8", NULL);
  pw_sample x = runs_to (r, 0);
  check_close ("velocity of s", x.v[3], 0.5, 1e-12, "round-off");
  check_close ("vy", x.v[1], 1, 1e-12, "2 s s'");
  char name[PW_NAME_BYTES];
  assert_string_equal (pw_system_state_name (s, 3, name, sizeof name), "wire.s");
  assert_string_equal (pw_system_state_unit (s, 3), "");
  assert_string_equal (pw_system_state_name (s, 7, name, sizeof name), "wire.s_rate");
  assert_string_equal (pw_system_state_unit (s, 7), "1/s");
  runs_close (r, s);
}
