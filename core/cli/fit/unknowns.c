/* Free parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include "unknowns.h"
#include <gsl/gsl_qrng.h>
#include <gsl/gsl_rng.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"

/* An unknown name is reported as --set or --start would. */
static int unknowns_find (pw_free_number *u, const pw_cli_model *m, pw_error *error) {
  u->parameter = pw_cli_parameter (m->model, u->name);
  if (u->parameter) {
    u->unit = u->parameter->unit;
    u->value = pw_model_parameter (m->model, u->parameter);
    u->low = u->parameter->domain == PW_REAL ? -INFINITY : 0;
    u->high = u->parameter->domain == PW_FRACTION ? 1 : INFINITY;
    if (u->parameter->domain != PW_COUNT) return PW_OK;
    return pw_fail (error, PW_INPUT, "--free %s: it is a count, and only continuous parameters can be free", u->name);
  }
  if (strchr (u->name, '.') == NULL) {
    pw_model *other = pw_file_model (m->file, error);
    int status = other ? pw_model_set (other, u->name, 1, error) : error->status;
    pw_model_free (other);
    return status;
  }
  int state = pw_system_find_state (m->system, u->name, error), n = pw_system_coordinates (m->system);
  if (state < 0) return error->status;
  u->unit = pw_system_state_unit (m->system, state);
  u->value = state < n ? pw_system_initial_q (m->system)[state] : pw_system_initial_v (m->system)[state - n];
  u->low = -INFINITY, u->high = INFINITY;
  return PW_OK;
}

/* "LOW:HIGH" */
static int unknowns_bounds (pw_free_number *u, char *text, pw_error *error) {
  char *colon = strchr (text, ':');
  double low, high;
  if (colon) *colon = 0;
  if (colon == NULL || pw_read_expression (text, &low) != PW_OK || pw_read_expression (colon + 1, &high) != PW_OK ||
      !(isfinite (low) && isfinite (high) && low < high))
    return pw_fail (error, PW_INPUT, "--free %s=...: expected bounds LOW:HIGH, two numbers, the first one smaller",
                    u->name);
  if (u->parameter && *pw_domain_check (u->parameter->domain, low))
    return pw_fail (error, PW_INPUT, "--free %s: the lower bound is %g, expected %s", u->name, low,
                    pw_domain_check (u->parameter->domain, low));
  if (u->parameter && *pw_domain_check (u->parameter->domain, high))
    return pw_fail (error, PW_INPUT, "--free %s: the upper bound is %g, expected %s", u->name, high,
                    pw_domain_check (u->parameter->domain, high));
  u->low = low, u->high = high, u->given = 1;
  if (low <= u->value && u->value <= high) return PW_OK;
  return pw_fail (error, PW_INPUT, "--free %s: its initial value %.9g is not between %.9g and %.9g; set it by %s",
                  u->name, u->value, low, high, u->parameter ? "--set" : "--start");
}

static int unknowns_add (pw_unknowns *u, const char *text, pw_error *error) {
  char copy[300];
  if (snprintf (copy, sizeof copy, "%s", text) >= (int)sizeof copy)
    return pw_fail (error, PW_INPUT, "--free %.60s...: too long a name", text);
  char *equals = strchr (copy, '=');
  if (equals) *equals = 0;
  for (int i = 0; i < u->count; i++)
    if (strcmp (u->at[i].name, copy) == 0) return pw_fail (error, PW_INPUT, "--free %s is given twice", copy);
  pw_free_number *x = u->at + u->count;
  if ((x->name = strdup (copy)) == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  u->count++;
  int status = unknowns_find (x, u->m, error);
  if (status == PW_OK && equals) status = unknowns_bounds (x, equals + 1, error);
  x->scale = x->given ? x->high - x->low : x->value != 0 ? fabs (x->value) : 1;
  return status;
}

int pw_unknowns_open (pw_unknowns *u, const pw_cli_line *line, const pw_cli_model *m, const char **list, double runs,
                      pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (m->file));
  const pw_method *method;
  int stabilisation, count = 0;
  pw_specialise when;
  pw_limit limit;
  *u = (pw_unknowns){ .line = line, .m = m, .method = line->method ? line->method : d.method };
  if (list == NULL) return pw_fail (error, PW_INPUT, "nothing is free: add --free NAME or --free NAME=LOW:HIGH");
  while (list[count]) count++;
  if ((u->at = calloc ((size_t)count, sizeof *u->at)) == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_method_parse (u->method, &method, &stabilisation, error);
  if (status == PW_OK) status = pw_cli_settings (line, &d, &u->t_end, &u->settings, &limit, error);
  u->limit = limit.most;
  if (status == PW_OK) pw_cli_unused (u->method, line);
  for (int i = 0; i < count && status == PW_OK; i++) status = unknowns_add (u, list[i], error);
  if (status == PW_OK) status = pw_cli_specialise (line->specialise, &when, error);
  if (status == PW_OK)
    pw_cli_engine_open (&u->engine, m->system, when,
                        runs * pw_method_steps (u->method, &u->settings, d.step, u->t_end));
  return status;
}

void pw_unknowns_close (pw_unknowns *u) {
  for (int i = 0; i < u->count; i++) free (u->at[i].name);
  free (u->at);
  pw_cli_engine_close (&u->engine);
}

int pw_unknowns_system (const pw_unknowns *u, const double *x, pw_cli_model *m, pw_settings *settings, pw_limit *limit,
                        pw_error *error) {
  *m = (pw_cli_model){ .model = pw_file_model (u->m->file, error) };
  if (m->model == NULL) return error->status;
  int status = pw_cli_apply (m->model, "--set", u->line->sets, pw_model_set, error);
  for (int i = 0; i < u->count && status == PW_OK; i++)
    if (u->at[i].parameter) status = pw_model_set (m->model, u->at[i].name, x[i], error);
  if (status == PW_OK) status = pw_cli_apply (m->model, "--start", u->line->starts, pw_model_set_initial, error);
  for (int i = 0; i < u->count && status == PW_OK; i++)
    if (u->at[i].parameter == NULL) status = pw_model_set_initial (m->model, u->at[i].name, x[i], error);
  if (status == PW_OK) status = pw_model_build (m->model, error);
  if (status == PW_OK) m->system = pw_system_compile (m->model, error);
  if (m->system == NULL) return error->status;
  const pw_specialised *code = pw_cli_engine_code (&u->engine);
  *settings = u->settings;
  *limit = (pw_limit){ .most = u->limit };
  settings->stop = pw_limit_over;
  settings->stop_context = limit;
  settings->specialised = code && pw_specialised_fits (code, m->system) ? code : NULL;
  pw_limit_start (limit);
  return PW_OK;
}

void pw_unknowns_report (const pw_unknowns *u, const double *x) {
  char text[PW_CHANGE_TEXT];
  pw_cli_model m;
  pw_settings settings;
  pw_limit limit;
  int status = pw_unknowns_system (u, x, &m, &settings, &limit, &(pw_error){ 0 });
  pw_run *r = status == PW_OK ? pw_run_open (m.system, u->method, &settings, NULL) : NULL;
  if (r && pw_cli_change (r, m.system, text) > 0)
    pw_cli_say ("pinwheel: the constraints changed given initial values of this result, at worst %s\n", text);
  if (r) pw_run_close (r);
  pw_cli_close_model (&m);
}

int pw_unknowns_differentiate (const pw_unknowns *u, const double *x, const char **outputs, pw_sensitivity *s,
                               pw_error *error) {
  pw_error none = { 0 };
  *s = (pw_sensitivity){ .line = *u->line, .of = outputs, .m = *u->m, .method = u->method, .settings = u->settings };
  s->t_end = u->t_end;
  s->no_error = 1;
  s->limit.most = u->limit;
  s->settings.stop = pw_limit_over;
  s->settings.stop_context = &s->limit;
  int status = pw_sensitivity_open (s, u->count, 0, error);
  for (int i = 0; i < u->count && status == PW_OK; i++) {
    const pw_free_number *f = u->at + i;
    s->unknown[i] = (pw_unknown){ .name = f->name, .parameter = f->parameter, .state = -1, .value = x[i] };
    snprintf (s->unknown[i].unit, sizeof s->unknown[i].unit, "%s", f->unit);
    if (f->parameter == NULL) s->unknown[i].state = pw_system_find_state (u->m->system, f->name, &none);
  }
  return status;
}

/* In a range of length 1. */
static double unknowns_between (const pw_free_number *k, double part) {
  double x = k->given ? k->low + part * k->scale : k->value + (2 * part - 1) * k->scale;
  return fmin (fmax (x, k->low), k->high);
}

/* A row per start after the first one. */
static int unknowns_sobol (const pw_unknowns *u, int count, double seed, double *out) {
  double point[PW_UNKNOWNS_STARTED], shift[PW_UNKNOWNS_STARTED];
  gsl_rng *random = gsl_rng_alloc (gsl_rng_mt19937);
  gsl_qrng *sobol = gsl_qrng_alloc (gsl_qrng_sobol, (unsigned)u->count);
  if (random) gsl_rng_set (random, (unsigned long)seed);
  for (int j = 0; random && j < u->count; j++) shift[j] = gsl_rng_uniform (random);
  for (int i = 1; random && sobol && i < count; i++) {
    gsl_qrng_get (sobol, point);
    for (int j = 0; j < u->count; j++) *out++ = unknowns_between (u->at + j, fmod (point[j] + shift[j], 1));
  }
  int status = random && sobol ? PW_OK : PW_RESOURCE;
  if (random) gsl_rng_free (random);
  if (sobol) gsl_qrng_free (sobol);
  return status;
}

double *pw_unknowns_starts (const pw_unknowns *u, int count, double seed) {
  double *out = malloc ((size_t)count * (size_t)u->count * sizeof *out);
  if (out == NULL) return NULL;
  for (int j = 0; j < u->count; j++) out[j] = u->at[j].value;
  if (count == 1 || unknowns_sobol (u, count, seed, out + u->count) == PW_OK) return out;
  free (out);
  return NULL;
}

int pw_unknowns_options (const pw_unknowns *u, const double *x, char *text, size_t size) {
  size_t used = 0;
  char number[32];
  *text = 0;
  for (int i = 0; i < u->count && used < size; i++)
    used += (size_t)snprintf (text + used, size - used, "%s--%s %s=%s", i ? " " : "",
                              u->at[i].parameter ? "set" : "start", u->at[i].name, pw_format (number, x[i], 12));
  return used < size;
}
