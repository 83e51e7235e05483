/* rod: two free bodies on a rod, a four-bar linkage with a rod or an equivalent link with pins. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- Two free bodies on a rod revolve about their common centre of mass at a constant rate ---- */

static const struct { double m[2], L, w, vx; } rod_d = { { 1.5, 0.5 }, 0.8, 3, 0.4 };

SCENE (rod_dumbbell) {
  double r0 = rod_d.L * rod_d.m[1] / (rod_d.m[0] + rod_d.m[1]), r1 = rod_d.L - r0;
  pw_add_body (
      m, &(pw_body){
             .name = "a", .mass = rod_d.m[0], .inertia = 0.1, .start = { r0 }, .rate = { rod_d.vx, r0 * rod_d.w, 1 } });
  pw_add_body (
      m,
      &(pw_body){
          .name = "b", .mass = rod_d.m[1], .inertia = 0.1, .start = { -r1 }, .rate = { rod_d.vx, -r1 * rod_d.w, -2 } });
  pw_add_rod (m, &(pw_rod){ .name = "rod", .body = { "a", "b" }, .length = rod_d.L });
}

static void rod_whirl (const char *method, double bound, const char *reason) {
  pw_system *s = scene_system (&rod_dumbbell_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  double r0 = rod_d.L * rod_d.m[1] / (rod_d.m[0] + rod_d.m[1]), pull = rod_d.m[0] * r0 * rod_d.w * rod_d.w;
  check_below ("start", pw_run_initial (r)->velocity, 16 * CHECK_EPS, "given consistently");
  for (int i = 1; i <= 4; i++) {
    double t = 0.5 * i;
    pw_sample x = runs_to (r, t);
    check_close ("x", x.q[0], rod_d.vx * t + r0 * cos (rod_d.w * t), bound, reason);
    check_close ("y", x.q[1], r0 * sin (rod_d.w * t), bound, reason);
    check_close ("spin", x.q[5], -2 * t, bound, reason);
    check_close ("rod", trial_reaction (s, &x, "rod.F"), -pull, 100 * bound, reason);
    check_close ("balance", x.balance, 0, 100 * bound, reason);
  }
  runs_close (r, s);
}

TEST (whirl) {
  rod_whirl ("rk4+projection", 1e-10, "(h w)^4 at h = 1e-3 and w = 3/s");
  rod_whirl ("ida+ggl", 1e-6, "1e4 rtol");
}

/* ---- A four-bar whose coupler is a rod, or a massless body between two pins ---- */

typedef struct {
  double link; /* see rod_list */
} rod_parameters;

static const pw_parameter rod_list[] = {
  { PW_AT (rod_parameters, link), 0, "", "1: a massless body instead of a rod", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (rod_fourbar, rod_list, rod_parameters) {
  int link = p->link > 0;
  const double L = hypot (0.9, 0.3); /* from (0.1, 0.6) to (1, 0.9) */
  pw_add_body (m, &(pw_body){ .name = "crank", .mass = 1, .inertia = 0.05, .start = { 0, 0.3 }, .rate = { 0, 0, 1 } });
  pw_add_body (m, &(pw_body){ .name = "rocker", .mass = 2, .inertia = 0.2, .start = { 1.1, 0.4 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "crank", "ground" }, .at = { { 0, -0.3 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "Q", .body = { "rocker", "ground" }, .at = { { 0, -0.4 }, { 1.1, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  if (!link) {
    pw_add_rod (
        m,
        &(pw_rod){ .name = "rod", .body = { "crank", "rocker" }, .at = { { 0.1, 0.3 }, { -0.1, 0.5 } }, .length = L });
    return;
  }
  pw_add_body (m, &(pw_body){ .name = "link", .start = { 0.1, 0.6, atan2 (0.3, 0.9) } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "crank", "link" }, .at = { { 0.1, 0.3 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "rocker", "link" }, .at = { { -0.1, 0.5 }, { L, 0 } } });
}

TEST (link) {
  const char *reason = "(h w)^4 at h = 1e-3 and w = 10/s: two projections";
  pw_system *s = scene_system (&rod_fourbar_table, NULL), *p = scene_system (&rod_fourbar_table, "link", 1.0, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3 }),
         *q = runs_open (p, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  for (int i = 1; i <= 4; i++) {
    pw_sample x = runs_to (r, 0.3 * i), y = runs_to (q, 0.3 * i);
    for (int j = 0; j < 6; j++) {
      check_close ("q", x.q[j], y.q[j], 1e-8, reason);
      check_close ("v", x.v[j], y.v[j], 1e-7, reason);
    }
    double phi = trial_state (p, &y, "link.phi"), F = trial_reaction (s, &x, "rod.F"); /* away from the rocker */
    check_close ("Fx", trial_reaction (p, &y, "A.Fx"), -F * cos (phi), 1e-6, reason);
    check_close ("Fy", trial_reaction (p, &y, "A.Fy"), -F * sin (phi), 1e-6, reason);
  }
  pw_run_close (r), pw_run_close (q);
  pw_system_free (s), pw_system_free (p);
}

/* ---- By all methods: a chain of bodies on rods with ends off the centres of mass ---- */

SCENE (rod_chain) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 0.1, .start = { 1 }, .rate = { 0, 0.5, 1 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = 0.2, .start = { 2, 0.2, 0.3 } });
  pw_add_rod (m, &(pw_rod){ .name = "1",
                            .body = { "ground", "a" },
                            .at = { { 0.1, 0.5 }, { -0.1, 0.1 } },
                            .length = hypot (0.8, 0.4) });
  pw_add_rod (m, &(pw_rod){ .name = "2", .body = { "b", "a" }, .at = { { -0.2, 0 }, { 0.2, 0.1 } }, .length = 0.62 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -4 } });
}

TEST (methods) {
  trial (&rod_chain_table, 1.5);
}
