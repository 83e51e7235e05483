/* With drifted constraints a motion can change its branch smoothly, without a jump of the accelerations. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "turns.h"

/* Deviation from the initial branch [rad]: cranks of four-bar linkages parallel and couplers horizontal, or crank
 * and rod of equal lengths at opposite angles. */
static double turns_apart (const pw_system *s, const pw_sample *x, int four_bars) {
  double most = 0, first = x->q[2];
  if (!four_bars) return fabs (remainder (x->q[5] + first, 2 * PW_PI));
  for (int j = 5; j < pw_system_coordinates (s); j += 3) /* alternately coupler and crank */
    most = fmax (most, fabs (remainder (x->q[j] - (j / 3 % 2 == 0 ? 0 : first), 2 * PW_PI)));
  return most;
}

int turns_try (const char *method, double rtol, const char *model, double value) {
  pw_error error = { 0 };
  pw_sample x;
  int four_bars = strcmp (model, "n-four-bar") == 0, status = PW_OK;
  double apart = 0;
  pw_system *s = scene_named (model, four_bars ? "N" : "g", value);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .step = 20 * rtol, .span = 10 });
  for (int k = 1; k <= 100 && status == PW_OK; k++) {
    status = pw_run_advance_to (r, 0.1 * k, 10, &error);
    if (status != PW_OK) break;
    check_ok (pw_run_sample (r, 0.1 * k, &x, &error), &error);
    apart = fmax (apart, turns_apart (s, &x, four_bars));
  }
  print_message ("%s %g, %s, rtol %g: %s\n", model, value, method, rtol, status == PW_OK ? "passed" : error.text);
  check_below (method, apart, 0.3, "on the initial branch, or stopped before leaving it");
  runs_close (r, s);
  return status == PW_METHOD && strstr (error.text, "methods with projection pass") != NULL;
}
