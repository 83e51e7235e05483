/* Drifted constraints turn one branch of a motion into another, smoothly, by accelerations that are no outburst. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "turns.h"

/* How far the cranks of four-bar linkages are from parallel and the couplers from level, or crank and rod of equal
 * lengths from opposite angles [rad]. */
static double turns_apart (const pw_system *s, const pw_sample *x, int four_bars) {
  double most = 0, first = x->q[2];
  if (!four_bars) return fabs (remainder (x->q[5] + first, 2 * PW_PI));
  for (int j = 5; j < pw_system_coordinates (s); j += 3) /* a crank, then coupler and crank in turn */
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
  pw_run_close (r);
  pw_system_free (s);
  return status == PW_METHOD && strstr (error.text, "methods with projection pass") != NULL;
}
