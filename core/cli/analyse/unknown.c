/* Parameters and initial values that analyses vary. */
#include <math.h>
#include <string.h>
#include "unknown.h"

int pw_unknown_find (pw_unknown *u, const pw_cli_model *m, const char *name, pw_error *error) {
  *u = (pw_unknown){ .name = name, .parameter = pw_cli_parameter (m->model, name), .state = -1 };
  if (u->parameter) {
    u->value = pw_model_parameter (m->model, u->parameter);
    snprintf (u->unit, sizeof u->unit, "%s", u->parameter->unit);
    return PW_OK;
  }
  if (strchr (name, '.') == NULL) { /* fails with the nearest name */
    pw_model *other = pw_file_model (m->file, error);
    if (other) pw_model_set (other, name, 0, error);
    pw_model_free (other);
    return error->status;
  }
  u->state = pw_system_find_state (m->system, name, error);
  if (u->state < 0) return error->status;
  int n = pw_system_coordinates (m->system);
  u->value = u->state < n ? pw_system_initial_q (m->system)[u->state] : pw_system_initial_v (m->system)[u->state - n];
  snprintf (u->unit, sizeof u->unit, "%s", pw_system_state_unit (m->system, u->state));
  return PW_OK;
}

/* ---- Runs ---- */

/* Sets the parameters, or the initial values. */
static int unknown_set (pw_model *m, const pw_unknown_runs *r, const double *x, int initial, pw_error *error) {
  int status = PW_OK;
  for (int i = 0; i < r->count && status == PW_OK; i++)
    if ((r->list[i].parameter == NULL) == initial)
      status = (initial ? pw_model_set_initial : pw_model_set) (m, r->list[i].name, x[i], error);
  return status;
}

int pw_unknown_system (pw_cli_model *m, const pw_unknown_runs *r, const double *x, pw_error *error) {
  *m = (pw_cli_model){ .model = pw_file_model (r->file, error) };
  int status = m->model ? pw_cli_apply (m->model, "--set", r->line->sets, pw_model_set, error) : error->status;
  if (status == PW_OK) status = unknown_set (m->model, r, x, 0, error);
  if (status == PW_OK) status = pw_cli_apply (m->model, "--start", r->line->starts, pw_model_set_initial, error);
  if (status == PW_OK) status = unknown_set (m->model, r, x, 1, error);
  if (status == PW_OK) status = pw_model_build (m->model, error);
  if (status == PW_OK) m->system = pw_system_compile (m->model, error);
  return m->system ? PW_OK : error->status;
}

int pw_unknown_open (pw_unknown_run *to, const pw_unknown_runs *r, const double *x, pw_error *error) {
  *to = (pw_unknown_run){ .run = NULL };
  if (pw_unknown_system (&to->m, r, x, error) != PW_OK) return error->status;
  to->run = pw_run_open (to->m.system, r->method, &r->settings, error);
  return to->run ? PW_OK : error->status;
}

void pw_unknown_close (pw_unknown_run *x) {
  if (x->run) pw_run_close (x->run);
  x->run = NULL;
  pw_cli_close_model (&x->m);
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

static int unknown_direction (pw_direction *d, const pw_unknown_runs *r, int i, double *x, pw_unknown_run *run,
                              pw_unknown_run *near, pw_error *error) {
  double value = x[i];
  int status = PW_OK;
  *d = (pw_direction){ .step = unknown_step (&r->list[i], run->run) };
  unknown_domain (&r->list[i], d);
  for (int k = 0; k < 4 && status == PW_OK; k++) {
    x[i] = value + pw_direction_offset (d, k);
    status = pw_unknown_open (near + k, r, x, error);
    if (status == PW_OK && !unknown_same (run->m.system, near[k].m.system))
      status = pw_fail (error, PW_INPUT,
                        "%s changes the number of bodies or elements: derivatives with respect to it do not exist",
                        r->list[i].name);
    d->neighbour[k] = near[k].run;
  }
  x[i] = value;
  return status;
}

int pw_unknown_directions (pw_direction *d, const pw_unknown_runs *r, double *x, pw_unknown_run *run,
                           pw_unknown_run *near, pw_error *error) {
  pw_unknown_runs plain = *r;
  int status = PW_OK;
  plain.settings.specialised = NULL;
  for (int i = 0; i < r->count && status == PW_OK; i++)
    status = unknown_direction (d + i, &plain, i, x, run, near + 4 * i, error);
  return status;
}
