/* Runs models of the gallery and checks their invariants; see gallery.h. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include "check.h"
#include "gallery.h"
#include "runs.h"
#include "system.h"
#include "trial.h"

static gallery_scene gallery_build (const char *model, va_list sets) {
  pw_error error = { 0 };
  gallery_scene x = { .file = pw_file_open (model, &error) };
  check_ok (x.file ? PW_OK : error.status, &error);
  x.model = pw_file_model (x.file, &error);
  check_ok (x.model ? PW_OK : error.status, &error);
  check_ok (x.model ? PW_OK : error.status, &error);
  for (const char *name; (name = va_arg (sets, const char *)) != NULL;)
    check_ok (pw_model_set (x.model, name, va_arg (sets, double), &error), &error);
  check_ok (pw_model_build (x.model, &error), &error);
  x.system = pw_system_compile (x.model, &error);
  check_ok (x.system ? PW_OK : error.status, &error);
  return x;
}

gallery_scene gallery_load (const char *model, ...) {
  va_list sets;
  va_start (sets, model);
  gallery_scene x = gallery_build (model, sets);
  va_end (sets);
  return x;
}

void gallery_close (gallery_scene *x) {
  pw_system_free (x->system);
  pw_model_free (x->model);
  pw_file_close (x->file);
}

pw_system *gallery_open (const char *model, ...) {
  va_list sets;
  va_start (sets, model);
  gallery_scene x = gallery_build (model, sets);
  va_end (sets);
  pw_system *s = x.system;
  x.system = NULL;
  gallery_close (&x);
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
