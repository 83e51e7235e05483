/* Runs models of the gallery and checks their invariants; see gallery.h. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include "check.h"
#include "gallery.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

pw_system *gallery_open (const char *model, ...) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (model, &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_model *m = pw_file_model (f, &error);
  check_ok (m ? PW_OK : error.status, &error);
  va_list list;
  va_start (list, model);
  for (const char *name; (name = va_arg (list, const char *)) != NULL;)
    check_ok (pw_model_set (m, name, va_arg (list, double), &error), &error);
  va_end (list);
  check_ok (pw_model_build (m, &error), &error);
  pw_system *s = scene_compile (m);
  pw_file_close (f);
  return s;
}

pw_run *gallery_run (pw_system *s, double step, double t) {
  return runs_open (s, "rk4+projection", &(pw_settings){ .step = step, .span = t, .ledger = 1 });
}

void gallery_energy (pw_system *s, double step, double t, double bound, gallery_source source) {
  pw_run *r = gallery_run (s, step, t);
  double start = runs_to (r, 0).kinetic;
  pw_sample x = runs_to (r, t);
  check_close ("balance", x.balance, 0, bound, "h^4 times a rate");
  check_close ("kinetic and potential", x.kinetic + x.potential, start + x.work, bound, "h^4 times a rate");
  if (source == GALLERY_DRIVEN)
    assert_true (x.work > 0.1);
  else
    check_close ("work", x.work, 0, 64 * CHECK_EPS, "no element does work");
  runs_close (r, s);
}

void gallery_point (const pw_system *s, const pw_sample *x, const char *body, double along, double p[2]) {
  char name[32];
  snprintf (name, sizeof name, "%s.phi", body);
  double phi = trial_state (s, x, name);
  snprintf (name, sizeof name, "%s.x", body);
  p[0] = trial_state (s, x, name) + along * cos (phi);
  snprintf (name, sizeof name, "%s.y", body);
  p[1] = trial_state (s, x, name) + along * sin (phi);
}
