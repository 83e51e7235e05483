/* Free parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include "unknowns.h"
#include <gsl/gsl_qrng.h>
#include <gsl/gsl_rng.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"

static int unknowns_find (pw_unknown *u, const pw_cli_model *m, const char *name, pw_error *error) {
  int status = pw_unknown_find (u, m, name, error);
  pw_domain domain = u->parameter ? u->parameter->domain : PW_REAL;
  u->low = domain == PW_REAL ? -INFINITY : 0;
  u->high = domain == PW_FRACTION ? 1 : INFINITY;
  if (domain != PW_COUNT) return status;
  return pw_fail (error, PW_INPUT, "--free %s: it is a count, and only continuous parameters can be free", name);
}

/* "LOW:HIGH" */
static int unknowns_bounds (pw_unknown *u, char *text, pw_error *error) {
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

/* name: "NAME" or "NAME=LOW:HIGH", of which it keeps the name. */
static int unknowns_add (pw_unknowns *u, char *name, pw_error *error) {
  char *equals = strchr (name, '=');
  pw_unknown *list = u->runs.list, *x = list + u->runs.count;
  if (equals) *equals = 0;
  for (int i = 0; i < u->runs.count; i++)
    if (strcmp (list[i].name, name) == 0) return pw_fail (error, PW_INPUT, "--free %s is given twice", name);
  u->runs.count++;
  int status = unknowns_find (x, u->m, name, error);
  if (status == PW_OK && equals) status = unknowns_bounds (x, equals + 1, error);
  x->scale = x->given ? x->high - x->low : x->value != 0 ? fabs (x->value) : 1;
  return status;
}

static int unknowns_read (pw_unknowns *u, const char **list, pw_error *error) {
  size_t count = 0, length = 0;
  for (; list[count]; count++) length += strlen (list[count]) + 1;
  u->runs.list = calloc (count, sizeof *u->runs.list);
  char *at = u->names = malloc (length);
  int status = at && u->runs.list ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t i = 0; i < count && status == PW_OK; i++) {
    size_t size = strlen (list[i]) + 1;
    memcpy (at, list[i], size);
    status = unknowns_add (u, at, error);
    at += size;
  }
  return status;
}

int pw_unknowns_open (pw_unknowns *u, const pw_cli_line *line, const pw_cli_model *m, const char **list, double runs,
                      pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (m->file));
  const char *name = line->method ? line->method : d.method;
  const pw_method *method;
  int stabilisation;
  pw_specialise when;
  pw_limit limit;
  *u = (pw_unknowns){ .runs = { .line = line, .file = m->file, .method = name }, .m = m };
  if (list == NULL) return pw_fail (error, PW_INPUT, "nothing is free: add --free NAME or --free NAME=LOW:HIGH");
  int status = pw_method_parse (name, &method, &stabilisation, error);
  if (status == PW_OK) status = pw_cli_settings (line, &d, &u->t_end, &u->runs.settings, &limit, error);
  u->limit = limit.most;
  if (status == PW_OK) pw_cli_unused (name, line);
  if (status == PW_OK) status = unknowns_read (u, list, error);
  if (status == PW_OK) status = pw_cli_specialise (line->specialise, &when, error);
  if (status == PW_OK)
    pw_cli_engine_open (&u->engine, m->system, when,
                        runs * pw_method_steps (name, &u->runs.settings, d.step, u->t_end));
  return status;
}

void pw_unknowns_close (pw_unknowns *u) {
  free (u->runs.list);
  free (u->names);
  pw_cli_engine_close (&u->engine);
}

int pw_unknowns_system (const pw_unknowns *u, const double *x, pw_cli_model *m, pw_settings *settings, pw_limit *limit,
                        pw_error *error) {
  int status = pw_unknown_system (m, &u->runs, x, error);
  if (status != PW_OK) return status;
  const pw_specialised *code = pw_cli_engine_code (&u->engine);
  *settings = u->runs.settings;
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
  pw_run *r = status == PW_OK ? pw_run_open (m.system, u->runs.method, &settings, NULL) : NULL;
  if (r && pw_cli_change (r, m.system, text) > 0)
    pw_cli_say ("pinwheel: the constraints changed given initial values of this result, at worst %s\n", text);
  if (r) pw_run_close (r);
  pw_cli_close_model (&m);
}

int pw_unknowns_differentiate (const pw_unknowns *u, const double *x, const char **outputs, pw_sensitivity *s,
                               pw_error *error) {
  *s = (pw_sensitivity){ .line = *u->runs.line, .of = outputs, .m = *u->m, .runs = u->runs, .t_end = u->t_end };
  s->no_error = 1;
  s->limit.most = u->limit;
  s->runs.settings.stop = pw_limit_over;
  s->runs.settings.stop_context = &s->limit;
  int status = pw_sensitivity_open (s, u->runs.count, 0, error);
  for (int i = 0; i < u->runs.count && status == PW_OK; i++) {
    s->runs.list[i] = u->runs.list[i];
    s->runs.list[i].value = x[i];
  }
  return status;
}

/* The value at this part, from 0 to 1, of the range of starts. */
static double unknowns_between (const pw_unknown *k, double part) {
  double x = k->given ? k->low + part * k->scale : k->value + (2 * part - 1) * k->scale;
  return fmin (fmax (x, k->low), k->high);
}

/* A row per start after the first one. */
static int unknowns_sobol (const pw_unknowns *u, int count, double seed, double *out) {
  double point[PW_UNKNOWNS_STARTED], shift[PW_UNKNOWNS_STARTED];
  gsl_rng *random = gsl_rng_alloc (gsl_rng_mt19937);
  gsl_qrng *sobol = gsl_qrng_alloc (gsl_qrng_sobol, (unsigned)u->runs.count);
  if (random) gsl_rng_set (random, (unsigned long)seed);
  for (int j = 0; random && j < u->runs.count; j++) shift[j] = gsl_rng_uniform (random);
  for (int i = 1; random && sobol && i < count; i++) {
    gsl_qrng_get (sobol, point);
    for (int j = 0; j < u->runs.count; j++) *out++ = unknowns_between (u->runs.list + j, fmod (point[j] + shift[j], 1));
  }
  int status = random && sobol ? PW_OK : PW_RESOURCE;
  if (random) gsl_rng_free (random);
  if (sobol) gsl_qrng_free (sobol);
  return status;
}

double *pw_unknowns_starts (const pw_unknowns *u, int count, double seed) {
  double *out = malloc ((size_t)count * (size_t)u->runs.count * sizeof *out);
  if (out == NULL) return NULL;
  for (int j = 0; j < u->runs.count; j++) out[j] = u->runs.list[j].value;
  if (count == 1 || unknowns_sobol (u, count, seed, out + u->runs.count) == PW_OK) return out;
  free (out);
  return NULL;
}

int pw_unknowns_options (const pw_unknowns *u, const double *x, char *text, size_t size) {
  size_t used = 0;
  char number[32];
  *text = 0;
  for (int i = 0; i < u->runs.count && used < size; i++)
    used += (size_t)snprintf (text + used, size - used, "%s--%s %s=%s", i ? " " : "",
                              u->runs.list[i].parameter ? "set" : "start", u->runs.list[i].name,
                              pw_format (number, x[i], 12));
  return used < size;
}
