/* Velocities of equations with limits that reach 0: together, beside 0, and at rest; many impacts. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "runs.h"

/* The driven angle turns back, all velocities are 0 at once, and two pads change the direction in which they slide. */
TEST (turn_back_together) {
  static const char *const method[] = { "erk8+projection", "ida+index2",   "ida+ggl",
                                        "radau+ggl",       "radau+index3", "bdf+projection" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++)
    for (double rtol = 1e-6; rtol > 1e-11; rtol /= 10) {
      pw_system *s = runs_scene ("rest/turn", "");
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .rtol = rtol, .span = 5 });
      int count;
      (void)runs_to (r, 5);
      const pw_event *event = pw_run_events (r, &count);
      if (count != 4) print_error ("%s, rtol %g: %d events\n", method[i], rtol, count);
      assert_int_equal (count, 4);
      for (int k = 0; k < count; k++) {
        check_close (method[i], event[k].t, (k < 2 ? 0.5 : 1.5) * PW_PI, 0.05 * pow (rtol, 2. / 3),
                     "of radau, the largest");
        assert_int_equal (event[k].to, -event[k].from);
      }
      runs_close (r, s);
    }
}

/* In index 3 velocities have the round-off of positions over the step: the freewheel does not leave its limit. */
TEST (at_rest) {
  for (double h = 2e-3; h > 1e-4; h /= 2) {
    pw_system *s = runs_scene ("rest/arm", "");
    pw_run *r = runs_open (s, "galpha+index3", &(pw_settings){ .step = h, .span = 4 });
    int count;
    (void)runs_to (r, 4);
    (void)pw_run_events (r, &count);
    assert_int_equal (count, 2);
    check_below ("steps", (double)pw_run_statistics (r)->steps, 4 / h + 2, "one more for each event");
    runs_close (r, s);
  }
}

/* Where a wheel that slides passes 0, steps are shorter than those in which index 3 can meet its tolerance. */
TEST (short_steps) {
  double q[2][4], v[2][4], rtol = 1e-9;
  pw_system *s = runs_scene ("rest/passing", "");
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12 }, 2.5, q[0], v[0], NULL);
  for (; rtol > 1e-12; rtol /= 10) {
    runs_state (s, "radau+index3", &(pw_settings){ .rtol = rtol }, 2.5, q[1], v[1], NULL);
    for (int j = 0; j < 4; j++)
      check_close ("position", q[1][j], q[0][j], 2e-7, "the direction of the friction in steps of 1e-8 s");
  }
  pw_system_free (s);
}

/* A block rocks from corner to corner; times of impacts from elliptic integrals, in 40 digits.  At each impact a corner
 * is below the ground by the error of that event, and moving it up adds energy. */
TEST (rocking) {
  static const double expected[] = { 0.55446390466388039, 1.374850138459882,  2.0611880952825645, 2.6594496098503229,
                                     3.1921686199406001,  3.6728073322827193, 4.1103515054549822, 4.5112454421591615,
                                     4.8803503448208252,  5.2214736108553028, 5.5376851269631266, 5.8315179399437682 };
  pw_system *s = runs_scene ("rocking", "");
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = 6 });
  int count, impacts = 0;
  (void)runs_to (r, 6);
  const pw_event *event = pw_run_events (r, &count);
  for (int k = 1; k < count; k++)
    if (event[k].t > event[k - 1].t + 1e-9) {
      assert_true (impacts < 12);
      check_close ("impact", event[k].t, expected[impacts++], 3e-12, "round-off of distances over the velocities");
    }
  assert_int_equal (impacts, 12);
  runs_close (r, s);
}
