/* Vehicles of the gallery that follow a path or a wall: signals of velocity constraints that read positions, a
 * first-order state and functions of paths.  Digits of tests/reference/followers.py: other equations and splines. */
#include <math.h>
#include "check.h"
#include "gallery.h"
#include "runs.h"

enum { FOLLOWER_COLUMNS = 8, FOLLOWER_TIMES = 3 };

static const struct {
  const char *model, *column[FOLLOWER_COLUMNS];
  double digits[FOLLOWER_TIMES][1 + FOLLOWER_COLUMNS]; /* t, then the columns */
} follower[] = {
  { "pure-pursuit",
    { "car.x", "car.y", "car.phi", "steer", "offset", "cruise.F", "rear.N", "front.N" },
    { { 1, 8.3212491230302, 0.62369355352314, -0.21383392110257, -0.022997473159518, 1.1818248887563, -15.603234227566,
        -66.787570588096, 559.41358402924 },
      { 8, 38.297126035848, 14.205250660621, 0.83597313986325, -0.030139447205467, -0.094260363566095, 4.2987383617484,
        -141.2131812421, -298.81552934721 },
      { 16, 70.710590390217, 11.117405104257, -1.0201613824324, 0.028270797691661, 0.20373895400002, 10.125173269868,
        144.12264838364, 504.66726461535 } } },
  { "stanley",
    { "car.x", "car.y", "car.phi", "steer", "offset", "cruise.F", "rear.N", "front.N" },
    { { 1, 3.8865127027035, 0.18615093180193, -0.45873380110837, 0.12175888146996, 0.75715524921977, -3.8925465968423,
        541.38135072497, 606.219268076 },
      { 10, 40.100146788619, 14.245884262789, 1.5341088526696, 0.2591528442187, 8.7427244940148e-05, 46.294836814751,
        1185.62863533, 1600.7087175338 },
      { 30, 3.2865719829849, -0.74149574828864, 6.0500893222736, 0.040816779394707, -1.5393473502301e-12,
        -0.43570499210303, 180.68519362693, 200.94555652479 } } },
  { "wall-follower",
    { "robot.x", "robot.y", "robot.phi", "robot.omega", "offset", "drive.F", "edge.N", "yaw.F" },
    { { 1, 0.9174117287111, 1.36613385729, 0.5166341102334, -0.16968369718203, 0.072102927345675, 0, -0.33936739436407,
        -0.12001194764187 },
      { 5, 4.0878951703222, -0.35064586108542, -0.59732065643968, 0.43041346635059, -0.03938667513663, 0,
        0.86082693270118, 0.059336384657044 },
      { 15, 12.159570695337, -0.028110867201854, 0.83082894236378, 0.1749082580791, -0.13243843608893, 0,
        0.34981651615821, -0.058952978503696 } } },
};

/* Every column at each time to 1e-8 of its largest value. */
static void follower_run (int i, const char *method, const pw_settings *settings) {
  pw_error error = { 0 };
  pw_system *s = gallery_open (follower[i].model, NULL);
  pw_workspace *w = pw_workspace_new (s, &error);
  pw_run *r = runs_open (s, method, settings);
  for (int t = 0; t < FOLLOWER_TIMES; t++) {
    pw_sample x = runs_to (r, follower[i].digits[t][0]);
    for (int k = 0; k < FOLLOWER_COLUMNS; k++) {
      pw_column column;
      double value, largest = 1;
      for (int n = 0; n < FOLLOWER_TIMES; n++) largest = fmax (largest, fabs (follower[i].digits[n][1 + k]));
      check_ok (pw_system_find_column (s, follower[i].column[k], &column, &error), &error);
      check_ok (pw_workspace_columns (w, &x, &column, 1, &value, &error), &error);
      check_close (check_text ("%s, %s, %s at %g s", follower[i].model, method, follower[i].column[k], x.t), value,
                   follower[i].digits[t][1 + k], 1e-8 * largest, "the method's error");
    }
  }
  pw_workspace_free (w);
  runs_close (r, s);
}

TEST (digits) {
  static const struct {
    const char *method;
    double step, rtol;
  } run[] = {
    { "rk4", 2.5e-4, 1e-6 }, { "erk8", 1, 1e-12 }, { "bdf", 1, 1e-13 }, { "ida+ggl", 1, 1e-12 }, { "radau", 1, 1e-12 }
  };
  for (size_t m = 0; m < sizeof run / sizeof *run; m++)
    for (int i = 0; i < 3; i++)
      follower_run (i, run[m].method, &(pw_settings){ .step = run[m].step, .rtol = run[m].rtol });
}
