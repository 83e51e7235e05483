/* Work, losses and the energy defect, compared with closed forms for every method, with and without the option
 * `ledger`. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

#define LEDGER_STEP                                                 \
  {                                                                 \
    PW_SMOOTH_STEP, .ramp = {.to = 1, .start = 0.3, .duration = 1 } \
  }

/* The smooth step and its derivative. */
static double ledger_step (double t, double *rate) {
  double s = fmin (fmax (t - 0.3, 0), 1);
  *rate = 30 * s * s * (1 - s) * (1 - s);
  return s * s * s * (10 - 15 * s + 6 * s * s);
}

/* ---- Scenes, their work and losses until t, and the energy they exchange ---- */

SCENE (ledger_turned) {
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .rate = { 1 } });
  pw_add_drive (m, &(pw_drive){ .name = "d", .body = { "b", "ground" }, .what = PW_DRIVE_ANGLE, .value = LEDGER_STEP });
}

static void ledger_turned_exact (double t, double *work, double *loss) {
  double rate;
  ledger_step (t, &rate);
  *work = rate * rate / 2, *loss = 0;
}

SCENE (ledger_lifted) {
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = 1, .rate = { 1 } });
  pw_add_drive (m, &(pw_drive){ .name = "d", .body = { "b", "ground" }, .what = PW_DRIVE_Y, .value = LEDGER_STEP });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

static void ledger_lifted_exact (double t, double *work, double *loss) {
  double rate, y = ledger_step (t, &rate);
  *work = rate * rate + 2 * 9.81 * y, *loss = 0;
}

SCENE (ledger_shaken) {
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = 1, .rate = { 0, 1 } });
  pw_add_drive (m, &(pw_drive){ .name = "d",
                                .body = { "b", "ground" },
                                .what = PW_DRIVE_X,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 3 } } });
}

static void ledger_shaken_exact (double t, double *work, double *loss) {
  *work = pow (1.5 * sin (3 * t), 2), *loss = 0;
}

/* All work is dissipated at once: the energy is always 0. */
SCENE (ledger_massless) {
  pw_add_body (m, &(pw_body){ .name = "b" });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "b", "ground" }, .at = { { -1 } } });
  pw_add_drive (m, &(pw_drive){ .name = "d", .body = { "b", "ground" }, .what = PW_DRIVE_ANGLE, .value = LEDGER_STEP });
  pw_add_friction (m, &(pw_friction){ .name = "f", .body = { "b", "ground" }, .viscous = 3 });
}

/* 3 times the integral of the squared velocity */
static void ledger_massless_exact (double t, double *work, double *loss) {
  double s = fmin (fmax (t - 0.3, 0), 1);
  *work = *loss = 2700 * pow (s, 5) * (1. / 5 - s * (4. / 6 - s * (6. / 7 - s * (4. / 8 - s / 9))));
}

/* A constant speed against drag, which also slows the transverse motion. */
SCENE (ledger_towed) {
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .rate = { 2, 1 } });
  pw_add_speed (m, &(pw_speed){ .name = "s", .body = "b", .value = { .constant = 2 } });
  pw_add_drag (m, &(pw_drag){ .name = "f", .body = "b", .linear = 3 });
}

static void ledger_towed_exact (double t, double *work, double *loss) {
  *work = 12 * t, *loss = 12 * t + (1 - exp (-6 * t)) / 2;
}

/* A torque 2 - omega, a function of the state, against a damper: omega = 1 - exp (-2 t). */
static int ledger_limited (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = 2 - x[0];
  if (gradient) gradient[0] = -1;
  return 0;
}

SCENE (ledger_driven) {
  static const char *const reads[] = { "b.omega", NULL };
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1 });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { "b", "ground" },
                                  .value = { PW_FUNCTION, .function = { .eval = ledger_limited, .reads = reads } } });
  pw_add_friction (m, &(pw_friction){ .name = "f", .body = { "b", "ground" }, .viscous = 1 });
}

static void ledger_driven_exact (double t, double *work, double *loss) {
  double e = exp (-2 * t), one = t - (1 - e) / 2, square = t - (1 - e) + (1 - e * e) / 4;
  *work = 2 * one - square, *loss = square;
}

#define LEDGER_SCENE(what, moved) \
  { .name = #what, .table = &ledger_##what##_table, .reference = ledger_##what##_exact, .size = moved }

static const struct {
  const char *name;
  const pw_plugin_table *table;
  void (*reference) (double t, double *work, double *loss);
  double size; /* energy exchanged [J] */
} ledger_scene[] = { LEDGER_SCENE (turned, 2),   LEDGER_SCENE (lifted, 25), LEDGER_SCENE (shaken, 3),
                     LEDGER_SCENE (massless, 5), LEDGER_SCENE (towed, 12),  LEDGER_SCENE (driven, 2) };
enum { LEDGER_SCENES = sizeof ledger_scene / sizeof *ledger_scene };

static void ledger_compare (int scene, const char *method, const pw_sample *x, double bound, const char *reason) {
  double work, loss;
  ledger_scene[scene].reference (x->t, &work, &loss);
  check_close (check_text ("%s, %s, work at %g s", ledger_scene[scene].name, method, x->t), x->work, work, bound,
               reason);
  check_close (check_text ("%s, %s, loss at %g s", ledger_scene[scene].name, method, x->t), x->loss, loss, bound,
               reason);
}

/* At 0.8 s the power of `turned` is as large as at 0.3 s. */
static void ledger_run (int scene, const char *method, const pw_settings *settings, double bound, const char *reason) {
  static const double t[] = { 0.2, 0.55, 0.8, 1, 1.7 };
  pw_system *s = scene_system (ledger_scene[scene].table, NULL);
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_run *r = runs_open (s, method, settings);
    for (size_t k = 0; k < sizeof t / sizeof *t; k++) {
      pw_sample x;
      check_ok (pw_run_advance_to (r, t[k], i ? t[k] : 2, &error), &error); /* inside a step, or at its end */
      check_ok (pw_run_sample (r, t[k], &x, &error), &error);
      ledger_compare (scene, method, &x, bound, reason);
      check_close ("balance", x.balance, 0, bound, reason);
      check_below ("energy defect", pw_run_energy_defect (r, &x), bound, reason);
    }
    pw_run_close (r);
  }
  pw_system_free (s);
}

TEST (closed_forms) {
  char name[40];
  for (int scene = 0; scene < LEDGER_SCENES; scene++)
    for (int i = 0; runs_method (i, name); i++) {
      double size = ledger_scene[scene].size;
      if (!runs_method (i, name)->adaptive) {
        ledger_run (scene, name, &(pw_settings){ .step = 2e-3, .span = 2 }, 100 * 4e-6 * size,
                    "100 h^2: a fourth derivative of the step and stabilisation at 10/s");
        continue;
      }
      for (int k = 6; k <= 9; k += 3) {
        double rtol = pow (10, -k);
        ledger_run (scene, name, &(pw_settings){ .rtol = rtol, .span = 2 }, 1e3 * rtol * size,
                    "1e3 rtol of the energy exchanged, as for states");
      }
    }
}

/* Work, losses and energy defect of a run are bit-identical with and without the option `ledger`. */
TEST (always_kept) {
  char name[40];
  for (int scene = 0; scene < LEDGER_SCENES; scene++)
    for (int i = 0; runs_method (i, name); i++) {
      double kept[2][9];
      for (int asked = 0; asked < 2; asked++) {
        pw_system *s = scene_system (ledger_scene[scene].table, NULL);
        pw_run *r = runs_open (s, name, &(pw_settings){ .step = 1e-2, .span = 2, .ledger = asked });
        pw_sample x = runs_to (r, 1);
        memcpy (kept[asked], (const double[]){ x.work, x.loss, pw_run_energy_defect (r, &x) }, 3 * sizeof (double));
        memcpy (kept[asked] + 3, x.q, 3 * sizeof (double));
        memcpy (kept[asked] + 6, x.v, 3 * sizeof (double));
        assert_true ((x.ledger != NULL) == asked);
        pw_run_close (r);
        pw_system_free (s);
      }
      check_bits (name, kept[0], kept[1], 2 + 7 * (scene != 3)); /* `massless` has only round-off */
    }
}

/* ---- The energy defect ---- */

/* The defect is relative to the energy exchanged, not to 1200 J of losses. */
TEST (exchanged) {
  pw_system *s = scene_system (ledger_scene[4].table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.1, .span = 100 });
  pw_sample x = runs_to (r, 100);
  assert_true (x.loss > 1000);
  x.work += 0.5;
  check_close ("defect of 0.5 J", pw_run_energy_defect (r, &x), 0.5 / 2.5, 0.01, "of 2.5 J at the start");
  pw_run_close (r);
  pw_system_free (s);
}

/* A position prescribed by a constant does no work and has no account. */
TEST (constant_drive) {
  pw_system *s = scene_named ("slider-crank", "l2", 1);
  assert_int_equal (pw_system_ledger_entries (s), 0);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  pw_sample x = runs_to (r, 1);
  check_below ("defect", pw_run_energy_defect (r, &x), 1e-10, "(h w)^4 at w = 3 / s");
  pw_run_close (r);
  pw_system_free (s);
}

static void ledger_advise (const char *model, const char *method, double rtol, double defect, const char *advice) {
  pw_system *s = scene_named (model, NULL, 0);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-2, .rtol = rtol, .span = 1 });
  runs_to (r, 1);
  const char *said = pw_run_energy_advice (r, defect);
  if (strstr (said, advice) == NULL) fail_msg ("%s, rtol %g, defect %g: %s", method, rtol, defect, said);
  pw_run_close (r);
  pw_system_free (s);
}

/* The advice recommends a smaller tolerance only where it helps. */
TEST (advice) {
  ledger_advise ("n-four-bar", "rk4+projection", 0, 0.1, "a smaller step");
  ledger_advise ("n-four-bar", "erk5+projection", 1e-3, 0.02, "a smaller tolerance");
  ledger_advise ("n-four-bar", "erk5+projection", 1e-9, 0.5, "more than the tolerance explains");
  ledger_advise ("n-four-bar", "erk8+projection", 1e-13, 0.5, "cannot be much smaller");
  ledger_advise ("pendulum", "adams+none", 1e-2, 0.02, "the constraints have drifted");
}
