/* spring: an oscillator, an ellipse, coincident ends, ends off the centres of mass. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

/* ---- A damped oscillator: the length is l0 + exp (-d t) (A cos wt + B sin wt) ---- */

static const struct { double m, k, c, l0, l, v; } spring_o = { 1.5, 60, 2.4, 0.8, 1.1, 0.5 };

SCENE (spring_oscillator) {
  double c = cos (0.7), s = sin (0.7); /* along a slanted line through (1, 2) */
  pw_add_body (m, &(pw_body){ .name = "block",
                              .mass = spring_o.m,
                              .inertia = 0.1,
                              .start = { 1 + spring_o.l * c, 2 + spring_o.l * s },
                              .rate = { spring_o.v * c, spring_o.v * s } });
  pw_add_spring (m, &(pw_spring){ .name = "S",
                                  .body = { "ground", "block" },
                                  .at = { { 1, 2 } },
                                  .stiffness = spring_o.k,
                                  .damping = spring_o.c,
                                  .length = spring_o.l0 });
}

static void spring_swing (const char *method, double bound, const char *reason) {
  double d = spring_o.c / (2 * spring_o.m), w = sqrt (spring_o.k / spring_o.m - d * d);
  double A = spring_o.l - spring_o.l0, B = (spring_o.v + d * A) / w;
  pw_system *s = scene_system (&spring_oscillator_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  for (int i = 1; i <= 10; i++) {
    double t = 0.2 * i, decay = exp (-d * t), stretch = decay * (A * cos (w * t) + B * sin (w * t));
    pw_sample x = runs_to (r, t);
    check_close ("length", hypot (x.q[0] - 1, x.q[1] - 2), spring_o.l0 + stretch, bound, reason);
    check_close ("potential", x.potential, spring_o.k * stretch * stretch / 2, 100 * bound, reason);
    check_close ("balance", x.balance, 0, 100 * bound, reason);
    assert_true (x.loss > 0);
  }
  runs_close (r, s);
}

TEST (oscillator) {
  spring_swing ("rk4+projection", 1e-10, "(h w)^4 / 10 at h = 1e-3 and w = 6/s");
  spring_swing ("ida", 1e-6, "1e4 rtol");
}

/* ---- Free length 0: a planar oscillator, on an ellipse or on a line through the point where the ends coincide ---- */

static const struct { double x[2], v[2]; } spring_start[] = { { { 1, 0 }, { 0, 0.5 } }, { { 0, 0 }, { 0.6, 0.8 } } };

static const pw_parameter spring_which[] = { { .name = "which", .value = 0, .domain = PW_NONNEGATIVE },
                                             { .name = NULL } };

SCENE_WITH (spring_ellipse, spring_which, double) {
  int i = (int)*p;
  pw_add_body (m, &(pw_body){ .name = "bead",
                              .mass = 2,
                              .inertia = 1,
                              .start = { spring_start[i].x[0], spring_start[i].x[1] },
                              .rate = { spring_start[i].v[0], spring_start[i].v[1] } });
  pw_add_spring (m, &(pw_spring){ .name = "S", .body = { "bead", "ground" }, .stiffness = 18 });
}

TEST (ellipse) {
  const double w = 3, t = 4;
  for (int i = 0; i < 2; i++) {
    pw_system *s = scene_system (&spring_ellipse_table, "which", (double)i, NULL);
    pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
    pw_sample x = runs_to (r, t);
    for (int j = 0; j < 2; j++)
      check_close ("coordinate", x.q[j], spring_start[i].x[j] * cos (w * t) + spring_start[i].v[j] / w * sin (w * t),
                   1e-11, "(h w)^4 / 10 at h = 1e-3 and w = 3/s");
    check_close ("balance", x.balance, 0, 1e-10, "(h w)^4 at h = 1e-3 and w = 3/s");
    runs_close (r, s);
  }
}

/* ---- Coincident ends, without a direction: the force is 0, its derivatives are finite ---- */

SCENE (spring_meeting) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1, .rate = { 1, 2, 3 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .start = { 1, 0, 0 } });
  for (int i = 0; i < 2; i++)
    pw_add_spring (m, &(pw_spring){ .name = i ? "loose" : "tight",
                                    .body = { "a", "b" },
                                    .at = { { 0.5, 0 }, { -0.5, 0 } },
                                    .stiffness = 5,
                                    .damping = 2,
                                    .length = i ? 0.3 : 0 });
}

TEST (meeting) {
  pw_system *s = scene_system (&spring_meeting_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double out[72];
  assert_int_equal (pw_update_kinematics (w, 0, s->q0, s->v0), PW_OK);
  const pw_batch *b = &w->batch[0].b;
  pw_kind_spring.force (b, out);
  for (int i = 0; i < 12; i++) assert_true (out[i] == 0);
  pw_kind_spring.force_q (b, out);
  for (int i = 0; i < 72; i++) assert_true (isfinite (out[i]));
  for (int e = 0; e < 2; e++) assert_true (out[36 * e] == -5 && out[36 * e + 1] == 0 && out[36 * e + 7] == -5);
  pw_kind_spring.force_v (b, out);
  for (int i = 0; i < 72; i++) assert_true (out[i] == 0);
  pw_kind_spring.energy (b, out);
  assert_true (out[0] == 0);
  check_close ("energy", out[1], 5 * 0.3 * 0.3 / 2, CHECK_EPS, "k l0^2 / 2");
  pw_kind_spring.loss (b, out);
  assert_true (out[0] == 0 && out[1] == 0);
  pw_workspace_free (w);
  pw_system_free (s);
}

/* ---- Free length 0, lengths so small that their inverse overflows: derivatives are bounded ---- */

SCENE (spring_settling) {
  pw_add_body (m, &(pw_body){ .name = "bead", .mass = 1, .inertia = 1, .start = { 3e-308, 4e-308 } });
  pw_add_spring (m, &(pw_spring){ .name = "S", .body = { "bead", "ground" }, .stiffness = 5, .damping = 2 });
}

TEST (settling) {
  pw_system *s = scene_system (&spring_settling_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double out[36];
  for (double size = 1; size > 1e-17; size /= 10) {
    const double q[3] = { 3e-308 * size, 4e-308 * size, 0 }, v[3] = { -1e-308 * size, 0, 0 };
    assert_int_equal (pw_update_kinematics (w, 0, q, v), PW_OK);
    pw_batch_function *const derivative[] = { pw_kind_spring.force_q, pw_kind_spring.force_v };
    for (int i = 0; i < 2; i++) {
      derivative[i](&w->batch[0].b, out);
      for (int j = 0; j < 36; j++) check_below ("derivative", fabs (out[j]), 20, "stiffness and damping are 5 and 2");
    }
  }
  pw_workspace_free (w);
  pw_system_free (s);
}

/* ---- By all methods: three bodies connected by springs, one of them to the ground ---- */

SCENE (spring_web) {
  static const char *const body[] = { "a", "b", "c", "a" };
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 0.1, .rate = { 0.3, -0.2, 1 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = 0.2, .start = { 1.5, 0.2, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "c", .mass = 0.5, .inertia = 0.02, .start = { 0.7, 1.3, -0.8 } });
  static const char *const name[] = { "ab", "bc", "ca" };
  for (int i = 0; i < 3; i++)
    pw_add_spring (m, &(pw_spring){ .name = name[i],
                                    .body = { body[i], body[i + 1] },
                                    .at = { { 0.2, 0.1 }, { -0.15, 0.1 } },
                                    .stiffness = 20 + 10 * i,
                                    .damping = 0.3 * i,
                                    .length = 0.8 });
  pw_add_spring (
      m,
      &(pw_spring){
          .name = "hook", .body = { "ground", "b" }, .at = { { 3, 3 }, { 0, 0.1 } }, .stiffness = 4, .damping = 0.2 });
}

TEST (methods) {
  trial (&spring_web_table, 2);
}
