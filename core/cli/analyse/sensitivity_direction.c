/* Parameters and initial values by which a run is differentiated. */
#include <math.h>
#include <string.h>
#include "sensitivity_direction.h"

static int unknown_parameter (pw_unknown *u, const pw_cli_model *m, pw_error *error) {
  u->value = pw_model_parameter (m->model, u->parameter);
  snprintf (u->unit, sizeof u->unit, "%s", u->parameter->unit);
  if (u->parameter->domain != PW_COUNT) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s is a count (%g): derivatives need a number that varies continuously", u->name,
                  u->value);
}

int pw_unknown_find (pw_unknown *u, const pw_cli_model *m, const pw_run *r, const char *name, pw_error *error) {
  *u = (pw_unknown){ .name = name, .parameter = pw_cli_parameter (m->model, name), .state = -1 };
  if (u->parameter) return unknown_parameter (u, m, error);
  if (strchr (name, '.') == NULL) { /* fails with the nearest name */
    pw_model *other = pw_file_model (m->file, error);
    if (other) pw_model_set (other, name, 0, error);
    pw_model_free (other);
    return error->status;
  }
  u->state = pw_system_find_state (m->system, name, error);
  if (u->state < 0) return PW_INPUT;
  int n = pw_system_coordinates (m->system);
  u->value = u->state < n ? pw_run_initial (r)->q[u->state] : pw_run_initial (r)->v[u->state - n];
  snprintf (u->unit, sizeof u->unit, "%s", pw_system_state_unit (m->system, u->state));
  return PW_OK;
}

/* ---- Runs ---- */

static int unknown_set (pw_model *m, const pw_unknown *list, int count, int states, int at, double by,
                        pw_error *error) {
  int status = PW_OK;
  for (int i = 0; i < count && status == PW_OK; i++) {
    double value = list[i].value + (i == at ? by : 0);
    if ((list[i].parameter == NULL) != states) continue;
    status = (states ? pw_model_set_initial : pw_model_set) (m, list[i].name, value, error);
  }
  return status;
}

int pw_unknown_open (pw_unknown_run *x, const pw_cli_line *l, const pw_file *file, const pw_unknown *list, int count,
                     int at, double by, const char *method, const pw_settings *settings, pw_error *error) {
  *x = (pw_unknown_run){ .model = pw_file_model (file, error) };
  int status = x->model ? pw_cli_apply (x->model, "--set", l->sets, pw_model_set, error) : error->status;
  if (status == PW_OK) status = unknown_set (x->model, list, count, 0, at, by, error);
  if (status == PW_OK) status = pw_cli_apply (x->model, "--start", l->starts, pw_model_set_initial, error);
  if (status == PW_OK) status = unknown_set (x->model, list, count, 1, at, by, error);
  if (status == PW_OK) status = pw_model_build (x->model, error);
  if (status == PW_OK) x->system = pw_system_compile (x->model, error);
  if (x->system) x->run = pw_run_open (x->system, method, settings, error);
  return x->run ? PW_OK : error->status;
}

void pw_unknown_close (pw_unknown_run *x) {
  if (x->run) pw_run_close (x->run);
  pw_system_free (x->system);
  pw_model_free (x->model);
  *x = (pw_unknown_run){ .model = NULL };
}

/* ---- Directions ---- */

/* 1e-5 of the number's size: the error of extrapolated differences is then about 1e-10, mostly round-off.  Angles count
 * as at least 0.1 rad, an initial value as at least that of the scene. */
static double unknown_step (const pw_unknown *u, const pw_run *r) {
  double size = fabs (u->value), length = pw_run_scale (r)->length, time = pw_run_scale (r)->time;
  if (strcmp (u->unit, "rad") == 0) size = fmax (size, 0.1);
  if (u->state >= 0) size = fmax (size, (*u->unit == 'm' ? length : 1) / (strchr (u->unit, 's') ? time : 1));
  if (size == 0 && u->parameter) size = fabs (u->parameter->value);
  return 1e-5 * (size > 0 ? size : 1);
}

/* At the end of its domain a parameter varies to one side. */
static void unknown_domain (const pw_unknown *u, pw_direction *d) {
  pw_domain domain = u->parameter ? u->parameter->domain : PW_REAL;
  d->one_sided = (domain == PW_NONNEGATIVE || domain == PW_FRACTION) && u->value - 2 * d->step < 0;
  if (domain != PW_FRACTION || u->value + 2 * d->step <= 1) return;
  d->one_sided = 1;
  d->step = -d->step;
}

static int unknown_same (const pw_system *a, const pw_system *b) {
  return pw_system_elements (a) == pw_system_elements (b) && pw_system_coordinates (a) == pw_system_coordinates (b) &&
         pw_system_rows (a) == pw_system_rows (b);
}

int pw_unknown_directions (pw_direction *d, pw_unknown_run *x, const pw_cli_line *l, const pw_file *file,
                           const pw_unknown *list, int count, const char *method, const pw_settings *settings,
                           pw_error *error) {
  static const int offset[2][4] = { { -2, -1, 1, 2 }, { 0, 1, 2, 4 } };
  pw_unknown_run middle;
  int status = pw_unknown_open (&middle, l, file, list, count, -1, 0, method, settings, error);
  memset (x, 0, 4 * (size_t)count * sizeof *x);
  for (int i = 0; i < count && status == PW_OK; i++) {
    d[i] = (pw_direction){ .step = unknown_step (&list[i], middle.run) };
    unknown_domain (&list[i], &d[i]);
    for (int k = 0; k < 4 && status == PW_OK; k++) {
      double by = offset[d[i].one_sided][k] * d[i].step;
      status = pw_unknown_open (&x[4 * i + k], l, file, list, count, i, by, method, settings, error);
      if (status == PW_OK && !unknown_same (middle.system, x[4 * i + k].system))
        status = pw_fail (error, PW_INPUT,
                          "%s changes the number of bodies or elements: derivatives with respect to it do not exist",
                          list[i].name);
      d[i].neighbour[k] = x[4 * i + k].run;
    }
  }
  pw_unknown_close (&middle);
  return status;
}
