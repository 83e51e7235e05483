/* Branches of steady motions with closed forms: pitchforks, folds and the onset of oscillations are where they ought to
 * be. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "steady_case.h"
#include "search.h"

/* ---- A rod on a turning hub ---- */

typedef struct {
  double W, beta;
} whirl;

static const pw_parameter whirl_parameters[] = { { PW_AT (whirl, W), 2, "rad/s", "", PW_REAL },
                                                 { PW_AT (whirl, beta), 0.1, "rad", "", PW_REAL },
                                                 { .name = NULL } };

/* The rod (m = 2, I = 0.1, l = 0.3) points inwards from its hinge at d = 0.5, with a torsion spring (k = 3, c = 0.3):
 * with the angle theta from there,  (I + m l^2) theta'' = -c theta' - k (theta - beta) + m d l W^2 sin theta. */
SCENE_WITH (whirl_build, whirl_parameters, whirl) {
  pw_add_body (m, &(pw_body){ .name = "hub", .mass = 1, .inertia = 1, .rate = { 0, 0, p->W } });
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 2, .inertia = 0.1, .start = { 0.2, 0, PW_PI } });
  pw_add_pin (m, &(pw_pin){ .name = "centre", .body = { "hub", "ground" } });
  pw_add_speed (
      m, &(pw_speed){
             .name = "spin", .body = "hub", .at = { 1, 0 }, .heading = PW_PI / 2, .value = { .constant = p->W } });
  pw_add_pin (m, &(pw_pin){ .name = "hinge", .body = { "hub", "rod" }, .at = { { 0.5, 0 }, { -0.3, 0 } } });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){
             .name = "twist", .body = { "rod", "hub" }, .stiffness = 3, .damping = 0.3, .angle = PW_PI + p->beta });
}

static pw_system *whirl_at (void *beta, double W, pw_error *error) {
  (void)error;
  return scene_system (&whirl_build_table, "W", W, "beta", *(double *)beta, NULL);
}

static steady whirl_open (double *beta) {
  steady t = { .s = whirl_at (beta, 2, NULL),
               .set = { .vary = -1, .compile = whirl_at, .context = beta, .first = 0.5, .last = 8 } };
  steady_open (&t);
  return t;
}

/* Without the free angle: a pitchfork at W^2 = k / (m d l), after which the rod is stable on both sides. */
TEST (pitchfork) {
  double beta = 0;
  int sides = 0;
  steady t = whirl_open (&beta);
  pw_steady_motion m = steady_solve (&t, 0, 0.5);
  branch_events e = steady_follow (&t, &m, 1);
  assert_int_equal (e.count[PW_STEADY_REAL], 1);
  check_close ("pitchfork", e.at[PW_STEADY_REAL][0], sqrt (10), 1e-8, "located to 1e-9 of a step of 0.15 rad/s");
  for (int k = 0; k <= 30; k++) {
    m = steady_solve (&t, k, 5);
    double theta = remainder (m.q[5] - m.q[2] - PW_PI, 2 * PW_PI);
    check_close ("equilibrium", 3 * theta, 0.3 * 25 * sin (theta), 1e-9, "Newton to round-off");
    assert_int_equal (m.unstable, fabs (theta) < 0.1);
    sides |= theta > 0.1 ? 1 : theta < -0.1 ? 2 : 4;
  }
  assert_int_equal (sides, 7);
  steady_close (&t);
}

/* Without a branch there are no points: before the first one, and after one that could not be followed. */
TEST (no_branch) {
  double beta = 0, q[6], v[6];
  pw_error error = { 0 };
  steady t = whirl_open (&beta);
  pw_steady_motion m;
  check_ok (pw_steady_next (t.x, &m, &error), &error);
  assert_int_equal (m.event, PW_STEADY_END);
  m = steady_solve (&t, 0, 0.5);
  memcpy (q, m.q, sizeof q), memcpy (v, m.v, sizeof v);
  for (int missing = 0; missing < 2; missing++) {
    error = (pw_error){ 0 };
    check_ok (pw_steady_follow (t.x, q, v, 0.5, 1, &error), &error);
    check_ok (pw_steady_next (t.x, &m, &error), &error);
    assert_int_equal (m.event, PW_STEADY_POINT);
    const double other[6] = { NAN };
    assert_true (pw_steady_follow (t.x, missing ? NULL : other, v, 0.5, 1, &error) < 0);
    assert_int_equal (pw_steady_next (t.x, &m, &(pw_error){ 0 }), PW_OK);
    assert_int_equal (m.event, PW_STEADY_END);
  }
  check_error (&error, PW_INPUT, "q is missing");
  steady_close (&t);
}

/* A second rod, with a stiffer spring. */
static void twins_build (pw_model *m, const void *parameters) {
  whirl_build (m, parameters);
  pw_add_body (m, &(pw_body){ .name = "second", .mass = 2, .inertia = 0.1, .start = { -0.2, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "joint", .body = { "hub", "second" }, .at = { { -0.5, 0 }, { -0.3, 0 } } });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){ .name = "bend", .body = { "second", "hub" }, .stiffness = 3.2, .damping = 0.3 });
}

static pw_system *twins_at (void *context, double W, pw_error *error) {
  pw_plugin_table table = whirl_build_table;
  (void)context, (void)error;
  table.build = twins_build;
  return scene_system (&table, "W", W, "beta", 0., NULL);
}

/* Two changes between two points, of which there are few. */
TEST (two_changes) {
  steady t = { .s = twins_at (NULL, 2, NULL),
               .set = { .vary = -1, .compile = twins_at, .first = 0.5, .last = 8, .points = 1 } };
  steady_open (&t);
  pw_steady_motion m = steady_solve (&t, 0, 0.5);
  branch_events e = steady_follow (&t, &m, 1);
  assert_int_equal (e.count[PW_STEADY_REAL], 2);
  assert_int_equal (e.count[PW_STEADY_OSCILLATION], 0);
  check_close ("first", e.at[PW_STEADY_REAL][0], sqrt (10), 1e-8, "located to 1e-9 of a step of 5 rad/s");
  check_close ("second", e.at[PW_STEADY_REAL][1], sqrt (3.2 / 0.3), 1e-8, "located to 1e-9 of a step of 5 rad/s");
  steady_close (&t);
}

/* With it: a branch that turns where tan theta = theta - beta.  AUTO-07p, on the equation above as two of first order,
 * has its limit point at W = 3.5200604503, theta = -0.631659. */
TEST (fold) {
  double beta = 0.1, W, theta;
  pw_steady_motion m;
  steady t = whirl_open (&beta);
  for (int k = 1, unstable = 0; !unstable; k++) {
    m = steady_solve (&t, k, 8);
    unstable = m.unstable;
    assert_true (k < 30);
  }
  branch_events e = steady_follow (&t, &m, -1);
  assert_int_equal (e.count[PW_STEADY_FOLD], 1);
  assert_int_equal (e.count[PW_STEADY_REAL] + e.count[PW_STEADY_OSCILLATION], 0);
  theta = -0.6316594726612051; /* a root of tan theta = theta - 0.1 */
  W = sqrt (3 * (theta - beta) / (0.3 * sin (theta)));
  check_close ("fold", e.at[PW_STEADY_FOLD][0], W, 1e-9, "quadratic in the distance along the branch");
  check_close ("fold", e.at[PW_STEADY_FOLD][0], 3.5200604503, 1e-9, "the digits of AUTO-07p");
  steady_close (&t);
}

/* Eigenvalues of a steady motion in closed form: (I + m l^2) mu^2 + c mu + k - m d l W^2 cos theta = 0. */
TEST (whirl_eigenvalues) {
  double beta = 0.1, J = 0.1 + 2 * 0.09;
  steady t = whirl_open (&beta);
  pw_steady_motion m = steady_solve (&t, 0, 2.5);
  double theta = m.q[5] - m.q[2] - PW_PI, k = 3 - 0.3 * 6.25 * cos (theta);
  steady_expect (m.linear, -0.3 / (2 * J), sqrt (k / J - pow (0.3 / (2 * J), 2)));
  steady_close (&t);
}

/* ---- A caster that shimmies ---- */

typedef struct {
  double c, V, y;
} caster;

static const pw_parameter caster_parameters[] = { { PW_AT (caster, c), 0.5, "N s/m", "", PW_REAL },
                                                  { PW_AT (caster, V), 5, "m/s", "", PW_REAL },
                                                  { PW_AT (caster, y), 0, "m", "", PW_REAL },
                                                  { .name = NULL } };

/* A cart with constant speed V draws a caster (m = 1, J = 0.01) whose kingpin (mass 0.2) gives way sideways (k = 100,
 * c); its wheel is l = 0.1 after the kingpin, its centre of mass e = 0.02.  With A = (l - e) m + l 0.2 and I = J + (l
 * - e)^2 m + l^2 0.2, small motions have
 *
 *     I mu^3 + (A V + l^2 c) mu^2 + (l^2 k + l c V) mu + l k V = 0. */
SCENE_WITH (caster_build, caster_parameters, caster) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 1, .inertia = 1, .rate = { p->V } });
  pw_add_body (m, &(pw_body){ .name = "king", .mass = 0.2, .inertia = 1, .start = { 0, p->y }, .rate = { p->V } });
  pw_add_body (m,
               &(pw_body){ .name = "wheel", .mass = 1, .inertia = 0.01, .start = { -0.02, p->y }, .rate = { p->V } });
  pw_add_slider (m, &(pw_slider){ .name = "road", .body = { "cart", "ground" } });
  pw_add_speed (m, &(pw_speed){ .name = "drive", .body = "cart", .value = { .constant = p->V } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "king", "cart" }, .heading = PW_PI / 2 });
  pw_add_spring (m, &(pw_spring){ .name = "side",
                                  .body = { "cart", "king" },
                                  .at = { { 0, -1 } },
                                  .stiffness = 100,
                                  .damping = p->c,
                                  .length = 1 });
  pw_add_pin (m, &(pw_pin){ .name = "kingpin", .body = { "king", "wheel" }, .at = { { 0 }, { 0.02, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "contact", .body = "wheel", .at = { -0.08, 0 } });
}

static pw_system *caster_at (void *context, double V, pw_error *error) {
  (void)context, (void)error;
  return scene_system (&caster_build_table, "V", V, NULL);
}

/* The polynomial has imaginary roots where (A V + l^2 c) (l k + c V) = I k V, of frequency^2 = l (l k + c V) / I. */
static void caster_boundaries (double V[2]) {
  double k = 100, c = 0.5, l = 0.1, A = 0.08 + 0.02, I = 0.01 + 0.0064 + 0.002;
  double half = (A * l * k + l * l * c * c - I * k) / (2 * A * c), root = sqrt (half * half - l * l * l * k / A);
  V[0] = -half - root, V[1] = -half + root;
}

TEST (shimmy) {
  double exact[2];
  caster_boundaries (exact);
  steady t = { .s = caster_at (NULL, 0.05, NULL),
               .set = { .vary = -1, .compile = caster_at, .first = 0.05, .last = 30, .points = 1 } };
  steady_open (&t);
  assert_int_equal (pw_steady_symmetries (t.x), 1);
  pw_steady_motion m = steady_solve (&t, 0, 0.05);
  branch_events e = steady_follow (&t, &m, 1);
  assert_int_equal (e.count[PW_STEADY_OSCILLATION], 2);
  for (int i = 0; i < 2; i++)
    check_close ("boundary", e.at[PW_STEADY_OSCILLATION][i], exact[i], 1e-8, "located to 1e-9 of a step of 0.3 m/s");
  steady_close (&t);
}

/* The growth rate of a run that begins beside the straight motion, from its deflections in two spans of ten periods. */
static double caster_growth (double V, double frequency) {
  pw_system *s = scene_system (&caster_build_table, "V", V, "y", 1e-6, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  double most[2] = { 0 }, span = 10 / frequency;
  for (int i = 0; i < 2; i++)
    for (double t = (i + 1) * span; t < (i + 1.3) * span; t += 1e-3) {
      pw_sample x = runs_to (r, t);
      most[i] = fmax (most[i], fabs (x.q[4]));
    }
  pw_run_close (r);
  pw_system_free (s);
  return log (most[1] / most[0]) / span;
}

/* On both sides of a boundary runs grow and decay at the rate of the eigenvalue. */
TEST (shimmy_runs) {
  double exact[2];
  caster_boundaries (exact);
  for (int i = 0; i < 4; i++) {
    double V = exact[1] * (i < 2 ? 0.85 + 0.1 * i : 0.85 + 0.1 * i);
    steady t = { .s = caster_at (NULL, V, NULL), .set.vary = -1 };
    steady_open (&t);
    pw_steady_motion m = steady_solve (&t, 0, 0);
    assert_int_equal (m.unstable, V < exact[1] ? 2 : 0);
    int k = 0;
    while (k + 1 < m.linear->unknowns && m.linear->im[k] == 0) k++;
    check_close ("growth rate", caster_growth (V, m.linear->im[k] / (2 * PW_PI)), m.linear->re[k],
                 3e-3 * fabs (m.linear->re[k]) + 1e-3, "samples of a maximum: 1e-3 s of its period of 0.1 s, squared");
    steady_close (&t);
  }
}
