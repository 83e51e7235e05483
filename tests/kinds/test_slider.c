/* slider, slot: an incline, a scotch yoke, equivalent drives. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- A block on an incline, held at a point beside its centre of mass ----
 *
 *   s'' = -g sin(alpha),  N = m g cos(alpha),  M = -N t.a
 *
 * a = (X, Y): from the centre of mass to the point; t: unit vector up the incline. */

static const struct {
  double m, g, alpha, beta, v, at[2], foot[2];
} slider_i = { 1.7, 9.81, 0.4, 0.9, 3, { 0.2, -0.3 }, { 1, 2 } };

SCENE (slider_incline) {
  double c = cos (slider_i.beta), s = sin (slider_i.beta), X = c * slider_i.at[0] - s * slider_i.at[1],
         Y = s * slider_i.at[0] + c * slider_i.at[1];
  pw_add_body (m, &(pw_body){ .name = "block",
                              .mass = slider_i.m,
                              .inertia = 0.3,
                              .start = { slider_i.foot[0] - X, slider_i.foot[1] - Y, slider_i.beta },
                              .rate = { slider_i.v * cos (slider_i.alpha), slider_i.v * sin (slider_i.alpha) } });
  pw_add_slider (m, &(pw_slider){ .name = "rail",
                                  .body = { "block", "ground" },
                                  .at = { { slider_i.at[0], slider_i.at[1] }, { slider_i.foot[0], slider_i.foot[1] } },
                                  .heading = slider_i.alpha,
                                  .angle = slider_i.beta });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -slider_i.g } });
}

TEST (incline) {
  pw_system *s = scene_system (&slider_incline_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-2, .ledger = 1 });
  const double t = 2, c = cos (slider_i.beta), si = sin (slider_i.beta), ca = cos (slider_i.alpha),
               sa = sin (slider_i.alpha), bound = 1e4 * CHECK_EPS;
  double X = c * slider_i.at[0] - si * slider_i.at[1], Y = si * slider_i.at[0] + c * slider_i.at[1];
  double N = slider_i.m * slider_i.g * ca, distance = slider_i.v * t - slider_i.g * sa * t * t / 2;
  check_below ("start", pw_run_initial (r)->velocity, 16 * CHECK_EPS, "given consistently");
  pw_sample x = runs_to (r, t);
  check_close ("x", x.q[0], slider_i.foot[0] - X + distance * ca, bound,
               "RK4 is exact for parabolas: round-off of 200 steps");
  check_close ("y", x.q[1], slider_i.foot[1] - Y + distance * sa, bound,
               "RK4 is exact for parabolas: round-off of 200 steps");
  check_close ("N", trial_reaction (s, &x, "rail.N"), N, bound, "round-off");
  check_close ("M", trial_reaction (s, &x, "rail.M"), -N * (ca * X + sa * Y), bound, "round-off");
  check_close ("balance", x.balance, 0, 100 * bound, "round-off");
  runs_close (r, s);
}

/* ---- A scotch yoke: a crank's pin in a slot of a body that slides ----
 *
 *   x = r cos(phi),  (I + m r^2 sin^2(phi)) w^2 is constant,  m x'' = N */

static const struct { double I, m, r, w, c; } slider_y = { 0.4, 1.5, 0.5, 3, 0.3 };

SCENE (slider_yoke) {
  pw_add_body (m, &(pw_body){ .name = "crank", .mass = 1, .inertia = slider_y.I, .rate = { 0, 0, slider_y.w } });
  pw_add_body (
      m, &(pw_body){ .name = "yoke", .mass = slider_y.m, .inertia = 0.2, .start = { slider_y.r - slider_y.c, 0.1 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "crank", "ground" } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "yoke", "ground" }, .at = { { -0.2, 0 }, { 7, 0.1 } } });
  pw_add_slot (m, &(pw_slot){ .name = "slot",
                              .body = { "crank", "yoke" },
                              .at = { { slider_y.r, 0 }, { slider_y.c, -2 } },
                              .heading = PW_PI / 2 });
}

static void slider_turn (const char *method, double bound, const char *reason) {
  pw_system *s = scene_system (&slider_yoke_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  double mr = slider_y.m * slider_y.r;
  for (int i = 1; i <= 8; i++) {
    pw_sample x = runs_to (r, 0.25 * i);
    double phi = x.q[2], w = x.v[2], sn = sin (phi), cs = cos (phi), J = slider_y.I + mr * slider_y.r * sn * sn;
    double w1 = -mr * slider_y.r * sn * cs * w * w / J;
    check_close ("w", w, slider_y.w * sqrt (slider_y.I / J), bound, reason);
    check_close ("x", x.q[3], slider_y.r * cs - slider_y.c, bound, reason);
    check_close ("N", trial_reaction (s, &x, "slot.N"), -mr * (w1 * sn + w * w * cs), 100 * bound, reason);
    check_close ("balance", x.balance, 0, 100 * bound, reason);
  }
  runs_close (r, s);
}

TEST (yoke) {
  slider_turn ("rk4+projection", 1e-10, "(h w)^4 at h = 1e-3 and w = 3/s");
  slider_turn ("ida+ggl", 1e-7, "1e3 rtol");
}

/* ---- A slider and a slot on a swinging body, compared with constant drives ---- */

typedef struct {
  double by; /* what holds the bead: 0 slider, 1 drives, 2 slot, 3 one drive */
} slider_parameters;

static const pw_parameter slider_list[] = {
  { PW_AT (slider_parameters, by), 0, "", "what holds the bead", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (slider_bead, slider_list, slider_parameters) {
  int by = (int)p->by;
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 2, .inertia = 0.5, .start = { 0.3 }, .rate = { 0, 0.6, 2 } });
  pw_add_body (
      m,
      &(pw_body){ .name = "bead", .mass = 0.7, .inertia = 0.1, .start = { 0.7, 0.2, 0.4 }, .rate = { -0.1, 1.4, 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" }, .at = { { -0.3, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_spring (m, &(pw_spring){ .name = "k",
                                  .body = { "bead", "arm" },
                                  .at = { { 0.1, 0.1 }, { 0, -0.2 } },
                                  .stiffness = 60,
                                  .length = 0.5 });
  double X = cos (0.4) * 0.1 - sin (0.4) * 0.05, Y = sin (0.4) * 0.1 + cos (0.4) * 0.05;
  const double at[2][2] = { { 0.1, 0.05 }, { 0.4 + X, 0.2 + Y } };
#define SLIDER_AT             \
  {                           \
    { at[0][0], at[0][1] }, { \
      at[1][0], at[1][1]      \
    }                         \
  }
  if (by == 0) pw_add_slider (m, &(pw_slider){ .name = "S", .body = { "bead", "arm" }, .at = SLIDER_AT, .angle = 0.4 });
  if (by == 1)
    pw_add_drive (
        m,
        &(pw_drive){ .name = "turn", .body = { "bead", "arm" }, .what = PW_DRIVE_ANGLE, .value = { .constant = 0.4 } });
  if (by == 2) pw_add_slot (m, &(pw_slot){ .name = "S", .body = { "bead", "arm" }, .at = SLIDER_AT });
  if (by == 1 || by == 3)
    pw_add_drive (m, &(pw_drive){ .name = "aside", .body = { "bead", "arm" }, .at = SLIDER_AT, .what = PW_DRIVE_Y });
}

static void slider_state (double by, const char *force, const char *moment, double out[14]) {
  pw_system *s = scene_system (&slider_bead_table, "by", by, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  pw_sample x = runs_to (r, 2);
  for (int i = 0; i < 6; i++) out[i] = x.q[i], out[6 + i] = x.v[i];
  out[12] = trial_reaction (s, &x, force);
  out[13] = moment ? trial_reaction (s, &x, moment) : 0;
  runs_close (r, s);
}

TEST (drives) {
  double a[14], b[14];
  slider_state (0, "S.N", "S.M", a);
  slider_state (1, "aside.F", "turn.F", b);
  for (int i = 0; i < 14; i++) check_close ("slider", a[i], b[i], 1e6 * CHECK_EPS, "round-off of 2000 steps");
  slider_state (2, "S.N", NULL, a);
  slider_state (3, "aside.F", NULL, b);
  for (int i = 0; i < 14; i++) check_close ("slot", a[i], b[i], 1e6 * CHECK_EPS, "round-off of 2000 steps");
}

/* ---- By all methods: oblique lines on moving bodies ---- */

SCENE (slider_train) {
  pw_add_body (m, &(pw_body){ .name = "base", .mass = 3, .inertia = 0.5, .rate = { 0.3, 0, 0.8 } });
  pw_add_body (m, &(pw_body){ .name = "ram", .mass = 1, .inertia = 0.1, .start = { 0.6, 0.4, 0.3 }, .rate = { 1, 1 } });
  pw_add_body (m, &(pw_body){ .name = "cam", .mass = 0.5, .inertia = 0.05, .start = { 1.2, 0.6, -0.5 } });
  pw_add_slider (
      m,
      &(pw_slider){
          .name = "S", .body = { "ram", "base" }, .at = { { 0.1, 0 }, { 0.2, 0.1 } }, .heading = 0.6, .angle = 0.3 });
  pw_add_slot (
      m, &(pw_slot){ .name = "T", .body = { "cam", "ram" }, .at = { { -0.2, 0.1 }, { 0.3, 0.1 } }, .heading = -0.4 });
  pw_add_spring (
      m, &(pw_spring){
             .name = "k", .body = { "base", "ram" }, .at = { { -1, 0 }, { 0, 0 } }, .stiffness = 8, .damping = 0.2 });
  pw_add_spring (
      m, &(pw_spring){
             .name = "l", .body = { "cam", "ram" }, .at = { { 0, 0 }, { 0, 1 } }, .stiffness = 6, .damping = 0.1 });
}

TEST (methods) {
  trial (&slider_train_table, 2);
  trial (&slider_yoke_table, 2);
}
