/* Inputs: signals that the caller sets between steps; ensembles of runs. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"

static const pw_signal waiting = { PW_HARMONIC, .harmonic = { .offset = 0 } };

/* A disc whose torque is an input. */
SCENE (disc) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 2 });
  pw_add (m, &pw_kind_torque, &(pw_torque){ .name = "motor", .body = { "disc", "ground" }, .value = waiting });
}

/* A car on two wheels, whose speed is an input; the force is no harmonic. */
SCENE (car) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 2, .inertia = 1 });
  pw_add (m, &pw_kind_wheel, &(pw_wheel){ .name = "rear", .body = "car", .at = { -1 } });
  pw_add (m, &pw_kind_wheel, &(pw_wheel){ .name = "front", .body = "car", .at = { 1 }, .heading = 0.3 });
  pw_add (m, &pw_kind_speed, &(pw_speed){ .name = "drive", .body = "car", .at = { -1 }, .value = waiting });
  pw_add (m, &pw_kind_force, &(pw_force){ .name = "push", .body = "car", .fx = { .constant = 1 } });
}

/* A sleigh whose blade has a grip, driven by a torque: an input, or a pulse that lasts from 0.5 s to 0.6 s. */
typedef struct {
  double pulse;
} sleigh_parameters;
static const pw_parameter sleigh_list[] = { { "pulse", offsetof (sleigh_parameters, pulse), .value = 0 },
                                            { .name = NULL } };
SCENE_WITH (sleigh, sleigh_list, sleigh_parameters) {
  const pw_signal pulse = { PW_PULSE, .pulse = { .height = p->pulse, .start = 0.5, .width = 0.1 } };
  pw_add_body (m, &(pw_body){ .name = "sleigh", .mass = 1, .inertia = 0.5, .rate = { 2 } });
  pw_add (m, &pw_kind_wheel,
          &(pw_wheel){ .name = "edge", .body = "sleigh", .at = { -0.25 }, .grip = { .constant = 1 } });
  pw_add (m, &pw_kind_torque,
          &(pw_torque){ .name = "motor", .body = { "sleigh", "ground" }, .value = p->pulse != 0 ? pulse : waiting });
}

/* A torque that is set every 10 ms: the angular velocity is the sum of its impulses, whatever the method, and the work
 * that the ledger has is the kinetic energy. */
TEST (torque) {
  static const char *const method[] = { "rk4", "erk8", "galpha", "leapfrog", "radau", "ida", "adams", "bdf" };
  for (int i = 0; i < 8; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&disc_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-9, .span = 1 });
    double omega = 0;
    for (int k = 1; k <= 100; k++) {
      check_ok (pw_run_set_input (r, 0, sin (k), &error), &error);
      pw_run_advance_to (r, 0.01 * k, 0.01 * k, &error);
      omega += 0.01 * sin (k) / 2;
    }
    const pw_sample x = runs_to (r, 1);
    check_close (method[i], x.v[2], omega, i < 5 ? 1e-12 : 1e-7, i < 5 ? "round-off" : "100 rtol");
    check_close ("balance", x.balance, 0, i < 5 ? 1e-12 : 1e-7, "the same");
    runs_close (r, s);
  }
}

/* A velocity jumps with the signal of its constraint; the steady turn that follows has a closed form. */
TEST (speed) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&car_table, NULL);
  const int drive = pw_system_find_signal (s, "drive", &error);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  check_ok (error.status, &error);
  check_ok (pw_run_set_input (r, drive, 3, &error), &error);
  check_close ("turn", runs_to (r, 0).v[2], 3 * tan (0.3) / 2, 1e-13, "round-off");
  check_close ("angle", runs_to (r, 0.5).q[2], 1.5 * tan (0.3) / 2, 1e-12, "round-off of 500 steps");
  pw_sample before = runs_to (r, 0.5);
  const double q[] = { before.q[0], before.q[1], before.q[2] };
  check_ok (pw_run_set_input (r, drive, -3, &error), &error);
  check_bits ("positions", runs_to (r, 0.5).q, q, 3);
  before = runs_to (r, 1);
  for (int j = 0; j < 3; j++) check_close ("back", before.q[j], 0, 1e-11, "h^4 and round-off");
  assert_int_equal (pw_run_set_input (r, drive, NAN, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: input drive.value = nan: expected a magnitude below 1e+100");
  error.status = 0, assert_int_equal (pw_run_set_input (r, 99, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT,
               "model scene: an input that does not exist: expected a harmonic signal, whose place the value takes");
  error.status = 0,
  assert_int_equal (pw_run_set_input (r, pw_system_find_signal (s, "push.fx", NULL), 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model scene: push.fx: expected a harmonic signal, whose place the value takes");
  assert_int_equal (pw_run_set_input (NULL, 0, 1, NULL), PW_INPUT);
  runs_close (r, s);
}

/* Where reactions have limits: an input that changes at the edges of a pulse makes the same events as the pulse. */
TEST (grip) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&sleigh_table, NULL), *same = scene_system (&sleigh_table, "pulse", 1.5, NULL);
  const pw_settings settings = { .step = 1e-3, .span = 2 };
  pw_run *r = runs_open (s, "rk4+projection", &settings), *pulsed = runs_open (same, "rk4+projection", &settings);
  int count, expected;
  runs_to (r, 0.5), pw_run_set_input (r, 0, 1.5, &error);
  runs_to (r, 0.6), pw_run_set_input (r, 0, 0, &error);
  check_ok (error.status, &error);
  const pw_sample a = runs_to (r, 4), b = runs_to (pulsed, 4);
  const pw_event *events = pw_run_events (r, &count), *pulse_events = pw_run_events (pulsed, &expected);
  assert_true (count == expected && count >= 2);
  for (int i = 0; i < count; i++) check_close ("event", events[i].t, pulse_events[i].t, 1e-12, "round-off");
  for (int j = 0; j < 3; j++) check_close ("state", a.q[j], b.q[j], 1e-12, "round-off");
  runs_close (r, s), runs_close (pulsed, same);
}

/* A run that was saved with a pending input and one that was loaded have the same bits. */
TEST (saved) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  const pw_settings settings = { .step = 1e-3 };
  pw_run *r = runs_open (s, "rk4+projection", &settings);
  runs_to (r, 0.3);
  check_ok (pw_run_set_input (r, 0, 0.07, &error), &error);
  pw_run *loaded = runs_copy (r, s, "rk4+projection", &settings);
  double q[6];
  memcpy (q, runs_to (r, 0.6).q, sizeof q);
  check_bits ("positions", runs_to (loaded, 0.6).q, q, 6);
  pw_run_close (loaded);
  runs_close (r, s);
}

/* ---- Ensembles ---- */

enum { MANY = 11, COLUMNS = 4 };

/* Runs with inputs of their own, in lanes and threads, are at every step where each is alone, to the bit; one whose
 * input is no number waits, and the others do not notice. */
static void ensemble_compare (pw_system *s, const pw_specialised *code, const pw_specialised_lanes *lanes,
                              int threads) {
  static const int signal[] = { 0 },
                   column[] = { 0, PW_RECORD_STATES + 3, PW_RECORD_STATES + 6 + 5, PW_RECORD_STATES + 12 };
  static const double duration[] = { 1e-3, 1e-2, 0, 2.5e-3 };
  pw_settings settings = { .step = 1e-3, .specialised = code };
  pw_run *run[MANY], *alone[MANY];
  double input[MANY], observed[MANY * COLUMNS];
  int status[MANY] = { 0 };
  pw_error error[MANY] = { { 0 } }, own = { 0 };
  pw_ensemble e = { run, MANY, threads, 1, COLUMNS, signal, input, column, observed, status, error, lanes };
  for (int i = 0; i < MANY; i++)
    run[i] = runs_open (s, "rk4+projection", &settings), alone[i] = runs_open (s, "rk4+projection", &settings);
  for (int k = 0; k < 60; k++) {
    const double dt = duration[k % 4];
    for (int i = 0; i < MANY; i++) input[i] = i == 5 && k == 40 ? NAN : 0.05 * sin (k / 3 + i); /* kept for 3 steps */
    pw_ensemble_step (&e, dt);
    pw_ensemble_observe (&e);
    for (int i = 0; i < MANY; i++) {
      if (i == 5 && k >= 40) {
        assert_true (status[i] == PW_INPUT && isnan (observed[COLUMNS * i]) &&
                     strstr (error[i].text, "input rider.value = nan"));
        continue;
      }
      check_ok (pw_run_set_input (alone[i], 0, input[i], &own), &own);
      const double t = pw_run_time (alone[i]) + dt;
      check_ok (pw_run_advance_to (alone[i], t, t, &own), &own);
      const pw_sample x = runs_to (alone[i], t);
      const double expected[COLUMNS] = { t, x.q[3], x.v[5], x.a[0] };
      if (dt > 0) check_bits ("observed", observed + COLUMNS * i, expected, COLUMNS);
    }
  }
  status[5] = 0, error[5] = (pw_error){ 0 }, input[5] = 0;
  pw_ensemble_step (&e, 1e-3);
  assert_int_equal (status[5], PW_OK);
  pw_ensemble_step (&e, -1);
  assert_true (status[0] == PW_INPUT && strcmp (error[0].text, "dt = -1: expected a finite time >= 0") == 0);
  for (int i = 0; i < MANY; i++) pw_run_close (run[i]), pw_run_close (alone[i]);
}

TEST (ensemble) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  ensemble_compare (s, NULL, NULL, 1);
  ensemble_compare (s, NULL, NULL, 3);
  pw_system_free (s);
}

TEST (ensemble_in_lanes) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  char *text = pw_system_source (s, NULL, &error);
  pw_scene_code *code = pw_scene_code_open (text, s, &error);
  pw_scene_code *lanes =
      pw_processor_lanes () > 1 ? pw_scene_lanes_open (text, s, pw_processor_lanes (), &error) : NULL;
  check_ok (error.status, &error);
  if (pw_scene_code_lanes (lanes) == NULL) skip ();
  ensemble_compare (s, pw_scene_code_table (code), pw_scene_code_lanes (lanes), 2);
  free (text);
  pw_scene_code_close (code), pw_scene_code_close (lanes);
  pw_system_free (s);
}

/* A run that is missing, as one that could not be opened. */
TEST (ensemble_without_runs) {
  pw_run *none[] = { NULL };
  int status[] = { 0 };
  const int column[] = { 3 };
  double observed[] = { 1 };
  pw_error error[1] = { { 0 } };
  pw_ensemble e = {
    .run = none, .count = 1, .columns = 1, .column = column, .observed = observed, .status = status, .error = error
  };
  pw_ensemble_observe (&e);
  assert_true (status[0] == PW_INPUT && isnan (observed[0]));
  status[0] = 0, pw_ensemble_step (&e, 1);
  assert_int_equal (status[0], PW_INPUT);
  e.count = 0, pw_ensemble_step (&e, 1);
}
