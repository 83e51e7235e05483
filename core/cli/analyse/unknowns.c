/* Unknowns of analyses: finds and reads them, and compiles models and opens runs with given values of them. */
#include <float.h>
#include <gsl/gsl_qrng.h>
#include <gsl/gsl_rng.h>
#include <stdlib.h>
#include <string.h>
#include "unknowns.h"

static int unknown_find (pw_unknown *u, const pw_cli_model *m, const char *name, pw_error *error) {
  *u = (pw_unknown){ .parameter = pw_cli_parameter (m->model, name), .state = -1, .high = INFINITY };
  snprintf (u->name, sizeof u->name, "%s", name);
  if (u->parameter) {
    u->value = pw_model_parameter (m->model, u->parameter);
    u->low = u->parameter->domain == PW_REAL ? -INFINITY : 0;
    if (u->parameter->domain == PW_FRACTION) u->high = 1;
    snprintf (u->unit, sizeof u->unit, "%s", u->parameter->unit ? u->parameter->unit : "");
    return PW_OK;
  }
  if (strchr (name, '.') == NULL && pw_system_find_state (m->system, name, NULL) < 0)
    return pw_cli_no_parameter (m->file, m->model, name, 1, error);
  u->state = pw_system_find_state (m->system, name, error), u->low = -INFINITY;
  if (u->state < 0) return error->status;
  int n = pw_system_coordinates (m->system);
  u->value = u->state < n ? pw_system_initial_q (m->system)[u->state] : pw_system_initial_v (m->system)[u->state - n];
  snprintf (u->unit, sizeof u->unit, "%s", pw_system_state_unit (m->system, u->state));
  return PW_OK;
}

int pw_unknowns_open (pw_unknowns *u, const pw_cli_line *line, pw_error *error) {
  const pw_method *method;
  int stabilisation;
  pw_limit limit;
  *u = (pw_unknowns){ .line = line, .method = line->method ? line->method : line->m.defaults.method };
  int status = pw_method_parse (u->method, line->methods, &method, &stabilisation, error);
  pw_cli_settings (line, &line->m.defaults, &u->settings, &limit);
  if (status != PW_OK) return status;
  u->settings.stop = NULL;
  if (u->settings.rtol == 0) u->settings.rtol = PW_RTOL;
  u->limit = limit.seconds;
  pw_cli_report_unused (u->method, line);
  return PW_OK;
}

int pw_unknowns_engine (pw_unknowns *u, double runs, int starts, pw_error *error) {
  if (starts > PW_UNKNOWNS_STARTS) return pw_fail (error, PW_INPUT, "--starts: at most %d", PW_UNKNOWNS_STARTS);
  if (starts > 1 && u->count > PW_UNKNOWNS_SOBOL_MOST)
    return pw_fail (error, PW_INPUT, "at most %d unknowns with more than one start; give --starts 1",
                    PW_UNKNOWNS_SOBOL_MOST);
  pw_cli_report_tables (u->line->m.system, u->settings.span);
  pw_cli_engine_open (&u->engine, u->line->m.system, u->line->when,
                      runs * starts *
                          pw_method_steps (u->method, &u->settings, u->line->m.defaults.step, u->settings.span));
  return PW_OK;
}

void pw_unknowns_close (pw_unknowns *u) {
  free (u->list);
  pw_cli_engine_close (&u->engine);
}

static int unknown_read_bounds (pw_unknown *u, const char *text, pw_error *error) {
  pw_range bounds;
  if (pw_cli_range ("--free", text, &bounds, error) != PW_OK) return error->status;
  if (!(bounds.low < bounds.high)) return pw_fail (error, PW_INPUT, "--free %s: expected LOW < HIGH", text);
  if (bounds.count) return pw_fail (error, PW_INPUT, "--free %s: a search has no COUNT; see --starts", text);
  for (int i = 0; i < 2 && u->parameter; i++) {
    const double bound = i ? bounds.high : bounds.low;
    const char *expected = pw_domain_check (u->parameter->domain, bound);
    if (*expected)
      return pw_fail (error, PW_INPUT, "--free %s: the %s bound is %g, expected %s", u->name, i ? "upper" : "lower",
                      bound, expected);
  }
  u->low = bounds.low, u->high = bounds.high, u->has_bounds = 1, u->logarithmic = bounds.logarithmic;
  if (u->low <= u->value && u->value <= u->high) return PW_OK;
  return pw_fail (error, PW_INPUT,
                  "--free %s: its value %.9g, where the search starts, is not between %.9g and %.9g; set it by %s",
                  u->name, u->value, u->low, u->high, u->parameter ? "--set" : "--start");
}

/* Adds the unknown of "NAME" or, of --free, "NAME=LOW:HIGH". */
static int unknown_add (pw_unknowns *u, const char *option, const char *text, pw_error *error) {
  const int is_free = strcmp (option, "--free") == 0;
  const size_t size = is_free ? strcspn (text, "=") : strlen (text);
  pw_unknown *added = u->list + u->count++;
  char name[sizeof added->name];
  snprintf (name, sizeof name, "%.*s", (int)size, text);
  int status = unknown_find (added, &u->line->m, name, error);
  for (const pw_unknown *x = u->list; x < added; x++)
    if (strcmp (x->name, name) == 0) return pw_fail (error, PW_INPUT, "%s %s is given twice", option, name);
  if (added->parameter && added->parameter->domain == PW_COUNT)
    return is_free
               ? pw_fail (error, PW_INPUT, "--free %s: it is a count, and only continuous parameters can be free", name)
               : pw_fail (error, PW_INPUT, "%s is a count (%g): derivatives need a number that varies continuously",
                          name, added->value);
  if (status == PW_OK && text[size]) status = unknown_read_bounds (added, text, error);
  added->scale = added->has_bounds ? added->high - added->low : added->value != 0 ? fabs (added->value) : 1;
  return status;
}

int pw_unknowns_read (pw_unknowns *u, const char *option, const char **list, pw_error *error) {
  size_t count = 0;
  int status = PW_OK;
  if (list == NULL) return pw_fail (error, PW_INPUT, "nothing is free: add --free NAME or --free NAME=LOW:HIGH");
  while (list[count]) count++;
  u->list = calloc (count, sizeof *u->list);
  if (u->list == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t i = 0; i < count && status == PW_OK; i++) status = unknown_add (u, option, list[i], error);
  return status;
}

/* The model with these values of the unknowns, compiled.  Close it by pw_cli_close_model in every case. */
static int unknowns_system (pw_cli_model *m, const pw_unknowns *u, const double *x, pw_error *error) {
  *m = (pw_cli_model){ .model = pw_file_model (u->line->m.file, error) };
  int status = m->model ? pw_cli_apply (u->line, m->model, error) : error->status;
  for (int i = 0; i < u->count && status == PW_OK; i++)
    status = (u->list[i].parameter ? pw_model_set : pw_model_set_initial) (m->model, u->list[i].name, x[i], error);
  if (status == PW_OK) status = pw_model_build (m->model, error);
  if (status == PW_OK) m->system = pw_system_compile (m->model, error);
  return m->system ? PW_OK : error->status;
}

/* Compiles the model and sets m and settings. */
static int unknown_run_prepare (pw_unknown_run *to, const pw_unknowns *u, const double *x, pw_error *error) {
  const pw_specialised *code = pw_scene_code_table (u->engine.code);
  *to = (pw_unknown_run){ .settings = u->settings, .limit = { .seconds = u->limit } };
  if (unknowns_system (&to->m, u, x, error) != PW_OK) return error->status;
  to->settings.stop = pw_limit_over;
  to->settings.stop_context = &to->limit;
  to->settings.specialised = code && pw_specialised_fits (code, to->m.system) ? code : NULL;
  return PW_OK;
}

int pw_unknown_run_open (pw_unknown_run *to, const pw_unknowns *u, const double *x, pw_error *error) {
  if (unknown_run_prepare (to, u, x, error) != PW_OK) return error->status;
  to->run = pw_limit_open (to->m.system, u->method, &to->settings, error);
  return to->run ? PW_OK : error->status;
}

void pw_unknown_run_close (pw_unknown_run *run) {
  pw_run_close (run->run);
  pw_cli_close_model (&run->m);
  *run = (pw_unknown_run){ .run = NULL };
}

void pw_unknowns_report (const pw_unknowns *u, const double *x) {
  char text[PW_CHANGE_TEXT];
  pw_unknown_run r;
  if (pw_unknown_run_open (&r, u, x, &(pw_error){ 0 }) == PW_OK && pw_cli_largest_change (r.run, r.m.system, text) > 0)
    pw_cli_say ("pinwheel: given initial values of this result were changed to satisfy the constraints, at worst %s\n",
                text);
  pw_unknown_run_close (&r);
}

int pw_unknowns_differentiate (const pw_unknowns *u, const double *x, pw_difference_settings d, pw_derivative *out,
                               pw_error *error) {
  const size_t n = (size_t)u->count;
  double *size = malloc (3 * n * sizeof *size);
  if (size == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t j = 0; j < n; j++) {
    const pw_unknown *unknown = &u->list[j];
    size[j] = unknown->size > 0 ? unknown->size : fmax (fabs (x[j]), 1e-2 * unknown->scale);
    size[n + j] = unknown->low, size[2 * n + j] = unknown->high;
  }
  d.x = x, d.parameters = u->count, d.size = size, d.low = size + n, d.high = size + 2 * n;
  int status = pw_differentiate (&d, out, NULL, error);
  free (size);
  return status;
}

int pw_run_outputs_at (const pw_run_outputs *outputs, const double *x, double *value, double *table, pw_error *error) {
  pw_outcomes outcomes = { .system = NULL };
  pw_unknown_run run;
  const pw_outcome_table rows = { outputs->t, outputs->rows, table };
  int status = unknown_run_prepare (&run, outputs->unknowns, x, error);
  if (status == PW_OK)
    status = pw_outcomes_open (&outcomes, run.m.system, outputs->option, outputs->of, outputs->count,
                               outputs->unknowns->line->until, error);
  if (outputs->method) run.settings.rtol = outputs->rtol, run.settings.atol = 0;
  if (outputs->max_steps) run.settings.max_steps = outputs->max_steps;
  if (status == PW_OK)
    status = pw_outcomes_run (&outcomes, outputs->method ? outputs->method : outputs->unknowns->method, &run.settings,
                              outputs->unknowns->settings.span, outputs->t ? &rows : NULL, error);
  for (int i = 0; status == PW_OK && value && i < outputs->count; i++) value[i] = pw_outcome_value (&outcomes, i);
  pw_outcomes_close (&outcomes);
  pw_unknown_run_close (&run);
  return status;
}

double pw_unknowns_noise (const pw_unknowns *u) {
  return pw_cli_adaptive (u->line->methods, u->method) == 1 ? u->settings.rtol : DBL_EPSILON;
}

/* Stores the points after the first one; a status. */
static int unknowns_sobol (const pw_unknowns *u, int count, double seed, double *out) {
  double point[PW_UNKNOWNS_SOBOL_MOST], shift[PW_UNKNOWNS_SOBOL_MOST];
  gsl_rng *random = gsl_rng_alloc (gsl_rng_mt19937);
  gsl_qrng *sobol = gsl_qrng_alloc (gsl_qrng_sobol, (unsigned)u->count);
  if (random) gsl_rng_set (random, (unsigned long)seed);
  for (int j = 0; random && j < u->count; j++) shift[j] = gsl_rng_uniform (random);
  for (int i = 1; random && sobol && i < count; i++) {
    gsl_qrng_get (sobol, point);
    for (int j = 0; j < u->count; j++) { /* a fraction, from 0 to 1, of the range in which searches begin */
      const pw_unknown *x = u->list + j;
      double part = fmod (point[j] + shift[j], 1), value = x->logarithmic  ? x->low * pow (x->high / x->low, part)
                                                           : x->has_bounds ? x->low + part * x->scale
                                                                           : x->value + (2 * part - 1) * x->scale;
      *out++ = fmin (fmax (value, x->low), x->high);
    }
  }
  int status = random && sobol ? PW_OK : PW_RESOURCE;
  if (random) gsl_rng_free (random);
  if (sobol) gsl_qrng_free (sobol);
  return status;
}

double *pw_unknowns_starts (const pw_unknowns *u, int count, double seed) {
  double *out = malloc ((size_t)count * (size_t)u->count * sizeof *out);
  if (out == NULL) return NULL;
  for (int j = 0; j < u->count; j++) out[j] = u->list[j].value;
  if (count == 1 || unknowns_sobol (u, count, seed, out + u->count) == PW_OK) return out;
  free (out);
  return NULL;
}

const char *pw_unknowns_options (const pw_unknowns *u, const double *x, char text[PW_UNKNOWNS_OPTIONS]) {
  size_t used = 0, size = PW_UNKNOWNS_OPTIONS;
  *text = 0;
  for (int i = 0; i < u->count && used < size; i++)
    used += (size_t)snprintf (text + used, size - used, "%s--%s %s=%.12g", i ? " " : "",
                              u->list[i].parameter ? "set" : "start", u->list[i].name, x[i]);
  return used < size ? text : NULL;
}

/* The option --vary of `steady` and `periodic`. */

int pw_vary_read (pw_vary *v, const pw_cli_line *line, const char *text, pw_error *error) {
  const size_t size = strcspn (text, "=");
  pw_range range;
  if (size == 0 || size >= sizeof v->unknown.name || text[size] == 0)
    return pw_fail (error, PW_INPUT, "--vary %s: expected NAME=LOW:HIGH", text);
  if (pw_cli_range ("--vary", text, &range, error) != PW_OK) return error->status;
  if (range.low == range.high) return pw_fail (error, PW_INPUT, "--vary %s: expected two different numbers", text);
  if (range.count || range.logarithmic)
    return pw_fail (error, PW_INPUT, "--vary %s: a branch chooses its points: leave out COUNT and log", text);
  v->first = range.low, v->last = range.high;
  v->name = memcpy (v->unknown.name, text, size);
  v->parameter = v->unknown.parameter = pw_cli_parameter (line->m.model, v->name);
  v->unknowns = (pw_unknowns){ .line = line, .list = &v->unknown, .count = 1 };
  if (v->parameter == NULL) return PW_OK;
  const pw_parameter *p = v->parameter;
  v->unit = p->unit ? p->unit : "";
  if (p->domain == PW_COUNT)
    return pw_fail (error, PW_INPUT,
                    "--vary %s: %s counts something and cannot vary continuously; use `pinwheel sweep`", text, p->name);
  for (int i = 0; i < 2; i++)
    if (*pw_domain_check (p->domain, i ? v->last : v->first))
      return pw_fail (error, PW_INPUT, "--vary %s: expected %s", text,
                      pw_domain_check (p->domain, i ? v->last : v->first));
  for (const char **set = line->sets; set && *set; set++)
    if (strncmp (*set, p->name, strlen (p->name)) == 0 && (*set)[strlen (p->name)] == '=')
      return pw_fail (error, PW_INPUT, "%s is given by --vary and by --set", p->name);
  return PW_OK;
}

void pw_vary_progress (const pw_vary *v, pw_progress *p, double from, double value, double to) {
  if (p->title == NULL) pw_progress_start (p, pw_file_name (v->unknowns.line->m.file), "", 0, 1);
  snprintf (p->note, sizeof p->note, "%.20s = %.4g", v->name, value);
  pw_progress_at (p, (value - from) / (to - from));
}

pw_system *pw_vary_compile (void *vary, double value, pw_error *error) {
  const pw_vary *v = vary;
  pw_cli_model m;
  unknowns_system (&m, &v->unknowns, &value, error);
  pw_model_free (m.model);
  return m.system;
}

/* ---- States in options and reports of `linearise`, `steady` and `periodic` ---- */

int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error) {
  if (*holds == PW_HOLDS) return pw_fail (error, PW_INPUT, "%s: more than %d values are held", option, PW_HOLDS);
  int state = pw_system_find_held (s, name, error);
  if (state < 0) return error->status;
  for (int i = 0; i < *holds; i++)
    if (hold[i].state == state) return pw_fail (error, PW_INPUT, "%s %s: %s is held already", option, text, name);
  hold[(*holds)++] = (pw_initial_value){ state, value };
  return PW_OK;
}

int pw_hold_read (const pw_system *s, const char **texts, pw_initial_value *hold, int *holds, pw_error *error) {
  int status = PW_OK;
  for (; status == PW_OK && texts && *texts; texts++) {
    char name[PW_ASSIGNED_NAME];
    double value;
    status = pw_cli_assignment ("--hold", *texts, "STATE=VALUE", name, &value, error);
    if (status == PW_OK && !isfinite (value))
      status = pw_fail (error, PW_INPUT, "--hold %s: the value is not finite", *texts);
    if (status == PW_OK) status = pw_hold_add (s, "--hold", *texts, name, value, hold, holds, error);
  }
  return status;
}

void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double least) {
  int bodies = pw_system_bodies (s);
  pw_print_bodies (s, q, v, "", -12, 12, digits, least);
  if (bodies > PW_BODIES_PRINTED) printf ("  and %d more bodies\n", bodies - PW_BODIES_PRINTED);
  for (int n = pw_system_coordinates (s), j = n - pw_system_states (s); j < n; j++)
    printf ("  %s = %s %s\n", PW_NAME (pw_system_state_name, s, n + j), PW_DIGITS (pw_rounded (v[j], least), digits),
            pw_system_state_unit (s, n + j));
}

void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j) {
  int n = pw_system_coordinates (s);
  pw_json_open (j, key, '{');
  for (int i = 0; i < 2 * n; i++)
    if (!pw_system_state_hidden (s, i))
      pw_json_number (j, PW_NAME (pw_system_state_name, s, i), i < n ? q[i] : v[i - n]);
  pw_json_close (j, '}');
}

void pw_states_header (const pw_system *s, pw_cells *t) {
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++)
    if (!pw_system_state_hidden (s, i))
      pw_cells_name (t, PW_NAME (pw_system_state_name, s, i), pw_system_state_unit (s, i));
}

void pw_states_cells (const pw_system *s, const double *state, pw_cells *t) {
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++)
    if (!pw_system_state_hidden (s, i)) pw_cells_number (t, state[i]);
}

void pw_complex_header (pw_cells *t, int most, const char *unit) {
  char name[32];
  for (int i = 0; i < 2 * most; i++)
    snprintf (name, sizeof name, "%s%d", i % 2 ? "im" : "re", i / 2 + 1), pw_cells_name (t, name, unit);
}

void pw_complex_cells (pw_cells *t, const double *re, const double *im, int count, int most) {
  for (int i = 0; i < 2 * most; i++) pw_cells_number (t, i / 2 < count ? (i % 2 ? im : re)[i / 2] : NAN);
}

const char *pw_states_symmetries (int count, char text[40]) {
  *text = 0;
  if (count > 0) snprintf (text, 40, " up to %d %s", count, count == 1 ? "symmetry" : "symmetries");
  return text;
}
