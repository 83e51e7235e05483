/* A parallelogram with a redundant crank: its motion, and equal reactions of the cranks, by every method. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* Checks the results of a run of 1 s, within a bound that follows from the method. */
typedef void parallelogram_check (pw_system *s, pw_run *r, double bound, const char *reason);

static void parallelogram_try (const char *method, parallelogram_check *check, double bound, const char *reason) {
  pw_system *s = scene_named ("redundant-parallelogram", NULL, 0);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 1, .ledger = 1 });
  check (s, r, bound, reason);
  runs_close (r, s);
}

static void parallelogram_every_method (parallelogram_check *check, double adaptive, const char *reason) {
  const pw_method *m;
  char method[40];
  for (int i = 0; (m = runs_method (i, method)) != NULL; i++)
    if (m->adaptive)
      parallelogram_try (method, check, adaptive, reason);
    else
      parallelogram_try (method, check, 10 * pow (1e-3, m->order), "10 h^order at h = 1e-3");
  parallelogram_try ("rk4+projection:metric=identity", check, 10 * pow (1e-3, 4), "10 h^4 at h = 1e-3");
}

/* ---- Digits: theta'' = -(7/6) g cos theta, by Taylor series in arithmetic of 45 digits ---- */

static void parallelogram_digits (pw_system *s, pw_run *r, double bound, const char *reason) {
  static const char *const crank[] = { "crank1.phi", "crank2.phi", "crank3.phi" };
  pw_sample x = runs_to (r, 1);
  for (int i = 0; i < 3; i++)
    check_close (crank[i], trial_state (s, &x, crank[i]), -2.351451216583941994, bound, reason);
  check_close ("crank2.omega", trial_state (s, &x, "crank2.omega"), 0.2767502772591703, 10 * bound, reason);
  check_close ("balance", x.balance, 0, 1e2 * bound, reason);
}

TEST (digits) {
  parallelogram_every_method (parallelogram_digits, 1e-7, "1e3 rtol");
}

/* ---- Reactions: by symmetry those of least norm are equal ---- */

static void parallelogram_shares (pw_system *s, pw_run *r, double bound, const char *reason) {
  static const char *const name[] = { "B1.Fx", "B2.Fx", "B3.Fx", "B1.Fy", "B2.Fy", "B3.Fy" };
  double share[6];
  pw_sample x = runs_to (r, 0.7);
  for (int i = 0; i < 6; i++) share[i] = trial_reaction (s, &x, name[i]);
  for (int i = 1; i < 6; i++)
    if (i != 3) check_close (name[i], share[i], share[i / 3 * 3], bound * hypot (share[0], share[3]), reason);
  check_close ("coupler's angle", trial_state (s, &x, "coupler.phi"), 0, bound, "the cranks are parallel");
  check_close ("Newton's law of the coupler, y", -(share[3] + share[4] + share[5]), 2 * (x.a[1] + 9.81), 1e2 * bound,
               reason);
  check_close ("Newton's law of the coupler, x", -(share[0] + share[1] + share[2]), 2 * x.a[0], 1e2 * bound, reason);
}

TEST (shares) {
  parallelogram_every_method (parallelogram_shares, 1e-6, "1e4 rtol");
}

/* ---- Messages: all elements that a redundant row depends on are named; a short buffer truncates the text ---- */

TEST (partners) {
  char text[500];
  pw_system *s = scene_named ("redundant-parallelogram", NULL, 0);
  pw_run *r = runs_open (s, "ida+ggl", NULL);
  assert_int_equal (pw_run_redundant (r), 1);
  assert_string_equal (pw_run_redundancy (r, 0, text, sizeof text),
                       "pin B2 (B2.Fy) follows from pin A1, pin B1, pin A2, pin A3, pin B3");
  pw_run_redundancy (r, 0, text, 10);
  assert_int_equal (strlen (text), 9);
  runs_close (r, s);
}
