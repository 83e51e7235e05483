/* Models of the gallery, compared with their reference solutions. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "gallery.h"
#include "pinwheel-files.h"
#include "system.h"
#include "trial.h"
#include "pinwheel-selftest.h"

#define HW4 1.6e-11 /* (h w)^4 at h = 2 us and a crank of w = 1000 rad/s */

/* ---- Closed forms ---- */

TEST (chaplygin_sleigh) {
  pw_system *s = gallery_open ("chaplygin-sleigh", NULL);
  pw_run *r = gallery_run (s, 1e-3, 20);
  const double k2 = 0.5 + 0.25 * 0.25, A = sqrt (0.16 + k2 * 0.64), rate = 0.25 * A / k2, c = atanh (-0.4 / A);
  for (double t = 2; t < 20; t += 2) {
    pw_sample x = runs_to (r, t);
    double z = rate * t + c, gd = atan (sinh (z)) - atan (sinh (c));
    check_close ("theta", trial_state (s, &x, "sleigh.phi"), sqrt (k2) / 0.25 * gd, 100 * H4, "100 h^4");
    check_close ("w", trial_state (s, &x, "sleigh.omega"), A / sqrt (k2) / cosh (z), 100 * H4, "100 h^4");
  }
  pw_sample x = runs_to (r, 20);
  double phi = trial_state (s, &x, "sleigh.phi"), n = cos (phi), e = sin (phi);
  double u = n * trial_state (s, &x, "sleigh.vx") + e * trial_state (s, &x, "sleigh.vy");
  check_close ("theta", phi, 6.45795189339473933785, 100 * H4, "100 h^4");
  check_close ("u", u, 0.721096625581085413303, 100 * H4, "100 h^4");
  check_close ("x", trial_state (s, &x, "sleigh.x") - 0.25 * n, 8.013005665229505484, 100 * H4, "100 h^4");
  check_close ("y", trial_state (s, &x, "sleigh.y") - 0.25 * e, -2.351907635692708835, 100 * H4, "100 h^4");
  double w = trial_state (s, &x, "sleigh.omega");
  check_close ("N", trial_reaction (s, &x, "blade.N"), 0.5 * u * w / k2, 100 * H4, "m I u w / J, to 100 h^4");
  runs_close (r, s);
}

TEST (knife_edge_incline) {
  pw_system *s = gallery_open ("knife-edge-incline", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  check_close ("x", trial_state (s, &x, "skate.x"), 0.7258393717013280771, 100 * H4, "100 h^4");
  check_close ("y", trial_state (s, &x, "skate.y"), 23.40550088629524659, 100 * H4, "100 h^4");
  check_close ("N", fabs (trial_reaction (s, &x, "edge.N")), 9.81 * fabs (sin (10.)), 100 * H4, "100 h^4");
  runs_close (r, s);
}

TEST (pendulum) {
  pw_system *s = gallery_open ("pendulum", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  check_close ("x", trial_state (s, &x, "bob.x"), 0.2750874625761168601, 1000 * H4, "1000 h^4: 10 s at 4 rad/s");
  check_close ("y", trial_state (s, &x, "bob.y"), -0.9614192050991250643, 1000 * H4, "1000 h^4: 10 s at 4 rad/s");
  runs_close (r, s);
}

/* The steady turn of n trailers: only the angle changes, up to accumulated round-off. */
static void gallery_turn (int n, double longer, double ratio) {
  char name[32];
  pw_system *s = gallery_open ("n-trailer", "n", (double)n, "longer", longer, "ratio", ratio, NULL);
  pw_run *r = gallery_run (s, 1e-3, 5);
  pw_sample x = runs_to (r, 5);
  double R2 = 4, L = 0.6, m = 1;
  for (int i = 0; i <= n; i++) {
    snprintf (name, sizeof name, i ? "trailer%d.x" : "tractor.x", i);
    double X = trial_state (s, &x, name);
    snprintf (name, sizeof name, i ? "trailer%d.y" : "tractor.y", i);
    double Y = trial_state (s, &x, name);
    check_close ("radius", hypot (X, Y - 2), sqrt (R2), 10 * H4, "10 h^4 and round-off");
    snprintf (name, sizeof name, "A%d.N", i);
    check_close (name, trial_reaction (s, &x, name), m * sqrt (R2), 100 * H4, "100 h^4 and round-off");
    if (i > 0) {
      snprintf (name, sizeof name, "H%d.Fx", i);
      check_close (name, trial_reaction (s, &x, name), 0, 100 * H4, "hinges carry nothing, to 100 h^4");
      snprintf (name, sizeof name, "H%d.Fy", i);
      check_close (name, trial_reaction (s, &x, name), 0, 100 * H4, "hinges carry nothing, to 100 h^4");
    }
    R2 -= L * L;
    L += longer;
    m = i > 0 ? m * ratio : 2;
  }
  runs_close (r, s);
}

TEST (n_trailer) {
  gallery_turn (2, 0.2, 0.25);
  gallery_turn (8, 0, 0.9);
}

/* ---- Energy ---- */

TEST (chain) {
  for (double n = 1; n <= 20; n *= 4)
    gallery_energy (gallery_open ("chain", "n", n, NULL), 2e-4, 1, n * 1e4 * H4, GALLERY_CONSERVATIVE);
}

TEST (snakeboard) {
  gallery_energy (gallery_open ("snakeboard", NULL), 1e-3, 10, 100 * H4, GALLERY_DRIVEN);
  gallery_energy (gallery_open ("snakeboard", "swing", 0., "steer", 0., "trim", 0.4, "u0", 1.5, NULL), 1e-3, 10,
                  100 * H4, GALLERY_CONSERVATIVE);
}

TEST (roller_racer) {
  gallery_energy (gallery_open ("roller-racer", NULL), 1e-3, 5, 1e6 * H4, GALLERY_DRIVEN);
  gallery_energy (gallery_open ("roller-racer", "stiffness", 0., "damping", 0., "u0", 1., NULL), 1e-3, 5, 1e3 * H4,
                  GALLERY_CONSERVATIVE);
}

/* ---- Mechanisms ---- */

TEST (andrews_squeezer) {
  static const char *const name[] = { "K1.phi", "K3.phi", "K5.phi", "K7.phi" };
  static const double digits[] = { 15.8107711951537, 0.0408222401196458, 0.524409965879954, 1.04808074104194 };
  pw_system *s = gallery_open ("andrews-squeezer", NULL);
  pw_run *r = gallery_run (s, 2e-6, 0.03);
  pw_sample x = runs_to (r, 0.03);
  double beta = trial_state (s, &x, "K1.phi");
  for (int i = 0; i < 4; i++) check_close (name[i], trial_state (s, &x, name[i]), digits[i], 10 * HW4, "10 (h w)^4");
  check_close ("Theta", trial_state (s, &x, "K2.phi") - beta, -15.7563710584118, 10 * HW4, "10 (h w)^4");
  check_close ("Phi", trial_state (s, &x, "K4.phi") - digits[2], -0.534730116342080, 10 * HW4, "10 (h w)^4");
  check_close ("Omega", trial_state (s, &x, "K6.phi") - digits[3], 0.534730116342080, 10 * HW4, "10 (h w)^4");
  check_close ("work", x.work, 0.033 * (beta + 0.0617138900142764496), HW4, "torque times angle, to (h w)^4");
  check_close ("balance", x.balance, 0, 10 * HW4, "10 (h w)^4");
  runs_close (r, s);
}

TEST (peaucellier) {
  pw_system *s = gallery_open ("peaucellier", NULL);
  pw_run *r = gallery_run (s, 1e-3, 2);
  double low = 0, high = 0, P[2];
  for (double t = 0.05; t < 2; t += 0.05) {
    pw_sample x = runs_to (r, t);
    gallery_point (s, &x, "PC", -0.25, P);
    check_close ("x of P", P[0], 0.75 / 0.8, 64 * CHECK_EPS, "round-off of a projected state");
    check_close ("y of P", P[1], 0.75 / 0.8 * tan (0.6 * cos (PW_PI * t)), 64 * CHECK_EPS, "round-off");
    check_below ("closure", x.position, 16 * CHECK_EPS, "round-off");
    low = fmin (low, P[1]), high = fmax (high, P[1]);
  }
  assert_true (high > 0.5 && low < -0.5);
  runs_close (r, s);
}

/* The loops stay closed, and after one revolution the leg is back at its initial position. */
TEST (theo_jansen) {
  pw_system *s = gallery_open ("theo-jansen", NULL);
  pw_run *r = gallery_run (s, 1e-3, 2);
  pw_sample x = runs_to (r, 0);
  double foot = trial_state (s, &x, "shin.x"), shoulder = trial_state (s, &x, "shoulder.phi"), energy = x.kinetic;
  for (double t = 0.1; t < 2; t += 0.1) check_below ("closure", runs_to (r, t).position, 16 * CHECK_EPS, "round-off");
  x = runs_to (r, 2);
  check_close ("crank", trial_state (s, &x, "crank.phi"), -2 * PW_PI, 100 * H4, "100 h^4");
  check_close ("shin", trial_state (s, &x, "shin.x"), foot, 100 * H4, "100 h^4");
  check_close ("shoulder", trial_state (s, &x, "shoulder.phi"), shoulder, 100 * H4, "100 h^4");
  check_close ("kinetic", x.kinetic, energy, 100 * H4, "100 h^4");
  check_close ("balance", x.balance, 0, 100 * H4, "100 h^4");
  runs_close (r, s);
}

/* ---- All models ---- */

/* A model runs with its default settings; the consistent initial state is the one described. */
static int gallery_default (void *context, const char *model, const char *path) {
  pw_error error = { 0 };
  pw_verification off;
  (void)context;
  print_message ("%s\n", model);
  pw_file *f = pw_file_open (path, &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_run_defaults run = pw_file_table (f)->run;
  pw_system *s = gallery_open (path, NULL);
  pw_run *r = runs_open (s, run.method, &(pw_settings){ .step = run.step, .span = run.t_end, .ledger = 1 });
  assert_int_equal (pw_run_initial (r)->released, 0);
  check_below ("start, positions", pw_run_initial (r)->position, 64 * CHECK_EPS, "described to round-off");
  pw_sample x = runs_to (r, run.t_end);
  double size = 1 + fabs (x.kinetic) + fabs (x.potential) + fabs (x.work) + fabs (x.loss);
  check_below ("balance", fabs (x.balance) / size, 1e6 * H4, "h^4 times a rate");
  if (s->limit == NULL) { /* the verifier knows no limits of reactions */
    assert_int_equal (pw_verify (s, pw_run_scale (r), x.t, x.q, x.v, x.a, x.lambda, &off), PW_OK);
    check_below ("verifier, position", off.position.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
    check_below ("verifier, velocity", off.velocity.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
    check_below ("verifier, force", off.force.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
  }
  runs_close (r, s);
  pw_file_close (f);
  return 0;
}

TEST (defaults) {
  pw_error error = { 0 };
  check_ok (pw_file_list (gallery_default, NULL, &error), &error);
}
