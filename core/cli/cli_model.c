/* The model of a command line: opens it with --set and --start; its parameters, changed initial values and defaults. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"

/* Refuses a parameter in --start, and a state in --set: names of states have a dot, those of parameters have none. */
static int model_check_name (const pw_model *m, const char *option, const char *text, const char *name,
                             pw_error *error) {
  int is_parameter = pw_cli_parameter (m, name) != NULL;
  if (is_parameter && strcmp (option, "--start") == 0)
    return pw_fail (error, PW_INPUT, "--start %s: %s is a parameter, expected a state; use --set", text, name);
  if (!is_parameter && strcmp (option, "--set") == 0 && strchr (name, '.'))
    return pw_fail (error, PW_INPUT, "--set %s: expected a parameter; initial values of states are given by --start",
                    text);
  return PW_OK;
}

int pw_cli_assignment (const char *option, const char *text, const char *form, char name[PW_ASSIGNED_NAME],
                       double *value, pw_error *error) {
  const char *equals = strchr (text, '=');
  if (equals == NULL || equals == text || equals - text >= PW_ASSIGNED_NAME)
    return pw_fail (error, PW_INPUT, "%s %s: expected %s", option, text, form);
  snprintf (name, PW_ASSIGNED_NAME, "%.*s", (int)(equals - text), text);
  int status = pw_read_expression (equals + 1, value);
  if (status == PW_RESOURCE) return pw_fail (error, status, "out of memory");
  return status == PW_OK ? status : pw_fail (error, status, "%s %s: \"%s\" is not a number", option, text, equals + 1);
}

int pw_cli_apply (pw_model *m, const char *option, const char **list,
                  int (*set) (pw_model *m, const char *name, double value, pw_error *error), pw_error *error) {
  for (; list && *list; list++) {
    char name[PW_ASSIGNED_NAME];
    double value;
    int status = pw_cli_assignment (option, *list, "NAME=VALUE", name, &value, error);
    if (status == PW_OK) status = model_check_name (m, option, *list, name, error);
    if (status == PW_OK) status = set (m, name, value, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

const pw_parameter *pw_cli_parameter (const pw_model *m, const char *name) {
  const pw_parameter *p = pw_model_table (m)->parameters;
  while (p && p->name && strcmp (p->name, name) != 0) p++;
  return p && p->name ? p : NULL;
}

pw_file *pw_cli_file (const pw_cli_line *line, pw_error *error) {
  const double largest = PW_FILE_MAX_BYTES >> 20; /* [MB] */
  double size = PW_FILE_DEFAULT_BYTES >> 20;
  if (pw_cli_number ("--max-file", line->max_file, PW_POSITIVE, &size, error) != PW_OK) return NULL;
  if (size < 1e-3) return pw_fail (error, PW_INPUT, "--max-file %s: expected at least 0.001 MB", line->max_file), NULL;
  if (size <= largest) return pw_file_open_limited (line->argument[0], (size_t)(size * (1 << 20)), error);
  pw_fail (error, PW_INPUT, "--max-file %s: expected at most %g MB", line->max_file, largest);
  return NULL;
}

int pw_cli_open (pw_cli_model *m, const pw_cli_line *line, pw_error *error) {
  *m = (pw_cli_model){ .file = pw_cli_file (line, error) };
  if (m->file) m->model = pw_file_model (m->file, error);
  if (m->model && pw_cli_apply (m->model, "--set", line->sets, pw_model_set, error) == PW_OK &&
      pw_cli_apply (m->model, "--start", line->starts, pw_model_set_initial, error) == PW_OK &&
      pw_model_build (m->model, error) == PW_OK)
    m->system = pw_system_compile (m->model, error);
  return m->system ? PW_OK : error->status;
}

void pw_cli_close_model (pw_cli_model *m) {
  pw_system_free (m->system);
  pw_model_free (m->model);
  pw_file_close (m->file);
  *m = (pw_cli_model){ .file = NULL };
}

void pw_cli_report_tables (const pw_system *s, double t_end) {
  char notice[PW_NOTICE_BYTES];
  for (int i = 0; i < pw_system_signals (s); i++)
    if (*pw_system_table_notice (s, i, t_end, notice, sizeof notice)) pw_cli_say ("pinwheel: %s\n", notice);
}

pw_state_change pw_cli_state_change (const pw_system *system, const pw_initial_report *initial, int state) {
  int n = pw_system_coordinates (system);
  pw_state_change change = { .unit = pw_system_state_unit (system, state),
                             .given = state < n ? initial->q_given[state] : initial->v_given[state - n],
                             .consistent = state < n ? initial->q[state] : initial->v[state - n] };
  pw_system_state_name (system, state, change.name, sizeof change.name);
  return change;
}

double pw_cli_largest_change (const pw_run *r, const pw_system *s, char text[PW_CHANGE_TEXT]) {
  const pw_initial_report *initial = pw_run_initial (r);
  double largest = 0;
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++) {
    if (!pw_initial_given (initial, i) || !pw_initial_moved (s, initial, i)) continue;
    const pw_state_change c = pw_cli_state_change (s, initial, i);
    if (!(fabs (c.consistent - c.given) > largest)) continue;
    largest = fabs (c.consistent - c.given);
    pw_print (text, PW_CHANGE_TEXT, "%s from %s to %s %s", c.name, PW_DIGITS (c.given, 10),
              PW_DIGITS (c.consistent, 10), c.unit);
  }
  return largest;
}

const char *pw_cli_short_path (const char *path) {
  char folder[4096];
  size_t n = getcwd (folder, sizeof folder) ? strlen (folder) : 0;
  return n > 1 && strncmp (path, folder, n) == 0 && path[n] == '/' ? path + n + 1 : path;
}

pw_run_defaults pw_cli_defaults (const pw_plugin_table *table) {
  pw_run_defaults d = table->run;
  if (d.t_end == 0) d.t_end = 10;
  if (d.step == 0) d.step = 1e-3;
  if (d.method == NULL) d.method = "rk4+projection";
  return d;
}
