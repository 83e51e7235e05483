/* Element types of a plug-in, as in elliptic-wire.c: its reference, every method, the program, the self-test. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "cli.h"
#include "pinwheel-files.h"
#include "scene.h"
#include "pinwheel-selftest.h"
#include "system.h"
#include "trial.h"

#define OWN_NOTICE "pinwheel: derivatives by differences: force_q of element type attraction\n"

/* Eccentricity and semi-minor axis of the ellipse; the semi-major axis is 1 m, the attraction 1 N m^2 / r^2. */
static const double own_e = 0.6, own_b = 0.8;

/* models/linkages/elliptic-wire.c; factor: of the speed of a planet. */
static gallery_scene own_open (double factor) {
  return gallery_load ("elliptic-wire", "factor", factor, NULL);
}

/* ---- The reference ---- */

/* The position of a planet at the time t after perihelion: Kepler's equation E - e sin E = t, by Newton's method. */
static void own_planet (double t, double p[2]) {
  double E = t;
  for (int i = 0; i < 50; i++) E -= (E - own_e * sin (E) - t) / (1 - own_e * cos (E));
  p[0] = cos (E) - own_e;
  p[1] = own_b * sin (E);
}

/* With the speed of a planet the bead moves like one, without a force on the wire. */
TEST (planet) {
  gallery_scene x = own_open (1);
  pw_run *r = runs_open (x.system, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  for (int t = 1; t <= 10; t++) {
    double p[2];
    pw_sample now = runs_to (r, t);
    own_planet (t, p);
    check_close ("x", trial_state (x.system, &now, "bead.x"), p[0], 5e-9,
                 "t (h w)^4 at h = 1 ms and w = 5/s, at perihelion");
    check_close ("y", trial_state (x.system, &now, "bead.y"), p[1], 5e-9,
                 "t (h w)^4 at h = 1 ms and w = 5/s, at perihelion");
    check_close ("N", trial_reaction (x.system, &now, "orbit.multiplier"), 0, 5e-9, "(h w)^4 times the attraction");
    check_close ("balance", now.balance, 0, 5e-9, "(h w)^4");
  }
  pw_run_close (r);
  gallery_close (&x);
}

/* A faster bead presses on the wire with m (v^2 - v_p^2) / rho, v_p the speed of a planet; v^2 - v_p^2 is constant, and
 * (1.2^2 - 1) 2^2 at perihelion. */
TEST (faster) {
  gallery_scene x = own_open (1.2);
  pw_run *r = runs_open (x.system, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  for (int t = 1; t <= 10; t++) {
    pw_sample now = runs_to (r, t);
    double X = trial_state (x.system, &now, "bead.x") + own_e, Y = trial_state (x.system, &now, "bead.y");
    double s = hypot (X, Y / (own_b * own_b)), rho = own_b * own_b * s * s * s;
    check_close ("force", -s * trial_reaction (x.system, &now, "orbit.multiplier"), (1.2 * 1.2 - 1) * 4 / rho, 1e-7,
                 "t (h w)^4 times the force at perihelion");
  }
  pw_run_close (r);
  gallery_close (&x);
}

/* ---- Every method ---- */

TEST (methods) {
  double p[2];
  own_planet (2, p);
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    gallery_scene x = own_open (1);
    pw_run *r = runs_open (x.system, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 2 });
    pw_sample now = runs_to (r, 2);
    double off = hypot (trial_state (x.system, &now, "bead.x") - p[0], trial_state (x.system, &now, "bead.y") - p[1]);
    check_below (method, off, 1e-4, "(h w)^2 for the methods of lowest order, 1e4 rtol for the others");
    pw_run_close (r);
    gallery_close (&x);
  }
}

/* ---- An element with two rows, an internal coordinate u and a force: a guide ----
 *
 *   g = r - (1, 2) u = 0,   force -k x along x,   so that 6 u'' = -k u with unit mass and inertia */

typedef struct {
  const char *name;
  const char *body;
} guide;

enum { GUIDE_STIFFNESS = 600, GUIDE_RATE = 10 };

static int guide_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *u,
                          pw_error *error) {
  (void)definition, (void)bodies, (void)element, (void)error;
  u[0] = (pw_internal){ .mass = 1, .start = 0.1 };
  return PW_OK;
}

static void guide_g (const pw_batch *b, double *out) {
  const pw_configuration *A = &b->configuration[b->body[0]];
  out[0] = A->x - b->q[0], out[1] = A->y - 2 * b->q[0];
}

static void guide_g_size (const pw_batch *b, double *out) {
  const pw_configuration *A = &b->configuration[b->body[0]];
  out[0] = fabs (A->x) + fabs (b->q[0]), out[1] = fabs (A->y) + 2 * fabs (b->q[0]);
}

static void guide_J (const pw_batch *b, double *out) {
  static const double J[] = { 1, 0, 0, -1, 0, 1, 0, -2 };
  (void)b;
  memcpy (out, J, sizeof J);
}

static void guide_force (const pw_batch *b, double *out) {
  out[0] = -GUIDE_STIFFNESS * b->configuration[b->body[0]].x;
  out[1] = out[2] = out[3] = 0;
}

static void guide_force_q (const pw_batch *b, double *out) {
  (void)b;
  memset (out, 0, 16 * sizeof *out);
  out[0] = -GUIDE_STIFFNESS;
}

static const pw_field guide_fields[] = {
  { PW_AT (guide, body), PW_BODY, .required = 1, .about = "the body that is guided" },
  { .name = NULL },
};

static const pw_quantity guide_reaction[] = { { "Fx", "N", NULL, "force on the body" },
                                              { "Fy", "N", NULL, "force on the body" } };
static const pw_quantity guide_coordinate[] = { { "u", "rad", "urate", "along the guide" } };

static const pw_kind guide_kind = {
  .name = "guide",
  .about = "the centre of mass of a body stays on a line, along which an internal coordinate counts",
  .definition = sizeof (guide),
  .element = 1,
  .fields = guide_fields,
  .bodies = 1,
  .internal = 1,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction = guide_reaction,
  .coordinate = guide_coordinate,
  .prepare = guide_prepare,
  .g = guide_g,
  .g_size = guide_g_size,
  .J = guide_J,
  .force = guide_force,
  .force_q = guide_force_q,
};

SCENE (guide_build) {
  pw_add_body (m, &(pw_body){ .name = "bead", .mass = 1, .inertia = 1, .start = { 0.1, 0.2, 0 } });
  pw_add (m, &guide_kind, &(guide){ .name = "line", .body = "bead" });
}

/* Methods with Newton's iteration have its complete matrix: few steps are rejected. */
TEST (guide) {
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    pw_system *s = scene_system (&guide_build_table, NULL);
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 2 });
    pw_sample now = runs_to (r, 2);
    const pw_statistics *n = pw_run_statistics (r);
    assert_true (n->rejected <= 5 && n->steps <= 2000 && n->jacobians <= n->steps);
    check_close (method, now.q[3], 0.1 * cos (GUIDE_RATE * 2.0), 1e-4, "t h^2 w^3, 1e4 rtol");
    runs_close (r, s);
  }
}

/* A slot along the same line. */
SCENE (slotted_build) {
  guide_build (m, parameter);
  pw_add_slot (m, &(pw_slot){ .name = "slot", .body = { "bead", "ground" }, .heading = atan2 (2, 1) });
}

/* A guide connects its body to the ground: together with another such element it can be redundant. */
TEST (redundant_guide) {
  pw_system *s = scene_system (&slotted_build_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 2 });
  assert_int_equal (pw_run_redundant (r), 1);
  pw_sample now = runs_to (r, 2);
  check_close ("u", now.q[3], 0.1 * cos (GUIDE_RATE * 2.0), 1e-9, "0.1 t w (h w)^4 / 120 of rk4, times 5");
  runs_close (r, s);
}

/* ---- The program ---- */

/* One notice, by every method. */
TEST (notice) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "ida+ggl" };
  for (int i = 0; i < 3; i++) {
    assert_int_equal (
        cli_run (check_text ("pinwheel run elliptic-wire --t-end 0.5 -m %s --json @/wire.json", method[i])), 0);
    assert_string_equal (cli_err, OWN_NOTICE);
    assert_non_null (strstr (cli_file ("wire.json"), "\"force_q of element type attraction\""));
  }
  cli_good ("pinwheel run ezyroller --t-end 0.1 --json @/none.json");
  assert_non_null (strstr (cli_file ("none.json"), "\"differences\": []"));
}

TEST (show) {
  cli_good ("pinwheel show elliptic-wire");
  assert_non_null (strstr (cli_out, "attraction sun: body [bead, ground]; strength 1 N m^2"));
  assert_non_null (strstr (cli_out, "Derivatives by differences"));
  assert_non_null (strstr (cli_out, "  force_q of element type attraction\n"));
  cli_good ("pinwheel show elliptic-wire --matrices");
  assert_non_null (strstr (cli_out, "orbit.multiplier [N]"));
  cli_bad ("pinwheel show elliptic-wire --yaml", 2,
           "model elliptic-wire cannot be written as text: attraction sun has an element type of the model's own");
  cli_bad ("pinwheel run elliptic-wire --set e=1", 2,
           "model elliptic-wire: e = 1: an ellipse has an eccentricity below 1");
  cli_good ("pinwheel show ezyroller");
  assert_null (strstr (cli_out, "by differences"));
}

/* A force that is an expression of states has exact derivatives. */
TEST (expression) {
  cli_write ("follow.yaml", "pinwheel: 1\nbodies:\n  - {name: arm, mass: 1, inertia: 1}\nelements:\n"
                            "  - {torque: T, body: [arm, ground], value: -3*arm.phi}\n"
                            "  - {torque: U, body: [arm, ground], value: sin(t)}\n");
  cli_good ("pinwheel show @/follow.yaml");
  assert_non_null (strstr (cli_out, "value {expression: \"-3*arm.phi\"} N m"));
  assert_null (strstr (cli_out, "by differences"));
}

/* ---- The self-test ---- */

TEST (selftest) {
  gallery_scene x = own_open (1);
  assert_int_equal (x.system->batches, 2);
  for (int i = 0; i < 2; i++) {
    const pw_kind *kind = x.system->batch[i].kind;
    pw_selftest_report report = { 0 };
    pw_error error = { 0 };
    for (unsigned seed = 1; seed <= 100; seed++) check_ok (pw_selftest (kind, seed, &report, &error), &error);
    assert_true (report.checks >= 4);
    for (int c = 0; c < report.checks; c++) {
      check_below (report.check[c].name, report.check[c].error, report.check[c].bound, report.check[c].reason);
      if (kind->force_q == PW_BY_DIFFERENCES) assert_string_not_equal (report.check[c].name, "force_q");
    }
  }
  gallery_close (&x);
  cli_good ("pinwheel check elliptic-wire");
  assert_non_null (strstr (cli_out, "wire (1 element)"));
  assert_non_null (strstr (cli_out, "attraction (1 element)"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
