/* The plan of a sweep: the model, the grid, the columns, the fingerprint. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fingerprint.h"
#include "sweep_plan.h"

enum { PLAN_TRIES = 1000 }; /* number of failed models after which the grid is refused */

/* ---- Models ---- */

/* Sets the parameters of a row, and the initial values of the command line. */
static int plan_build (const pw_plan *p, long row, pw_model *m, pw_error *error) {
  int status = pw_cli_apply (m, "--set", p->line->sets, pw_model_set, error);
  for (int i = 0; i < p->grid.axes && status == PW_OK; i++)
    if (p->grid.axis[i].parameter)
      status = pw_model_set (m, p->grid.axis[i].name, pw_grid_value (&p->grid, i, row), error);
  if (status == PW_OK) status = pw_cli_apply (m, "--start", p->line->starts, pw_model_set_initial, error);
  return status == PW_OK ? pw_model_build (m, error) : status;
}

int pw_plan_compile (const pw_plan *p, long row, pw_cli_model *m, pw_error *error) {
  *m = (pw_cli_model){ .model = pw_file_model (p->file, error) };
  if (m->model && plan_build (p, row, m->model, error) == PW_OK) m->system = pw_system_compile (m->model, error);
  if (m->system == NULL) return error->status;
  for (const pw_axis *a = p->grid.axis; a < p->grid.axis + p->grid.axes; a++)
    if (a->parameter == NULL && pw_system_find_state (m->system, a->name, error) < 0) return PW_INPUT;
  return PW_OK;
}

/* ---- Axes ---- */

/* 1 if a list of "NAME=VALUE" has this name. */
static int plan_named (const char **list, const char *name) {
  size_t n = strlen (name);
  for (; list && *list; list++)
    if (strncmp (*list, name, n) == 0 && (*list)[n] == '=') return 1;
  return 0;
}

/* Every value of a parameter must lie in its domain; other names with a dot are states. */
static int plan_axis (const pw_plan *p, pw_axis *a, pw_model *m, pw_error *error) {
  const pw_parameter *q = a->parameter = pw_cli_parameter (m, a->name);
  if (q) a->unit = q->unit;
  const char *option = a->parameter ? "--set" : "--start";
  if (plan_named (a->parameter ? p->line->sets : p->line->starts, a->name))
    return pw_fail (error, PW_INPUT, "%s is given by --vary and by %s", a->name, option);
  if (a->parameter == NULL && strchr (a->name, '.')) return PW_OK;
  if (a->parameter == NULL) return pw_model_set (m, a->name, pw_axis_value (a, 0), error);
  for (long i = 0; i < a->count; i++)
    if (*pw_domain_check (q->domain, pw_axis_value (a, i)))
      return pw_model_set (m, a->name, pw_axis_value (a, i), error);
  return PW_OK;
}

/* ---- Columns ---- */

/* The i-th state in the order of the table: positions and velocities of each body, then each internal coordinate and its
 * velocity. */
static int plan_state (const pw_system *s, int i) {
  int n = pw_system_coordinates (s), bodies = pw_system_bodies (s), internal = i - 6 * bodies;
  if (internal >= 0) return 3 * bodies + internal / 2 + (internal % 2 ? n : 0);
  return 3 * (i / 6) + i % 3 + (i % 6 < 3 ? 0 : n);
}

/* The hash table of names must not be full. */
static int plan_grow (pw_plan *p) {
  if ((size_t)p->columns < p->room) return PW_OK;
  if (pw_grow (&p->column, (size_t)p->columns, &p->room, sizeof *p->column) != PW_OK) return PW_RESOURCE;
  pw_names_close (&p->index);
  if (pw_names_open (&p->index, p->room) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < p->columns; i++) pw_names_add (&p->index, p->column[i].name, i);
  return PW_OK;
}

/* Adds the new states of a system, and the units of varied initial values. */
static int plan_columns_of (pw_plan *p, const pw_system *s, pw_error *error) {
  char name[300];
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++) {
    int state = plan_state (s, i);
    pw_system_state_name (s, state, name, sizeof name);
    if (p->room && pw_names_find (&p->index, name) >= 0) continue;
    const char *copy = pw_arena_copy (&p->arena, name);
    if (copy == NULL || plan_grow (p) != PW_OK) return pw_fail (error, PW_RESOURCE, "out of memory");
    p->column[p->columns] = (struct pw_column){ copy, pw_system_state_unit (s, state) };
    pw_names_add (&p->index, copy, p->columns++);
  }
  for (pw_axis *a = p->grid.axis; a < p->grid.axis + p->grid.axes; a++)
    if (a->parameter == NULL) a->unit = pw_system_state_unit (s, pw_system_find_state (s, a->name, error));
  return PW_OK;
}

/* Models built to find the columns. */
typedef struct {
  int built, refused;
  pw_error first; /* why a model could not be built */
} plan_scan;

/* The engine depends on the whole sweep, not on its part. */
static void plan_engine (pw_plan *p, const pw_system *s) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (p->file));
  double steps = (double)p->grid.rows * pw_method_steps (p->method, &p->settings, d.step, p->t_end);
  pw_cli_engine_open (&p->engine, s, p->specialise, steps);
  const char *why = p->cpu                        ? "--cpu measures each run"
                    : isfinite (p->limit.seconds) ? "--limit stops each run by itself"
                                                  : NULL;
  if (why == NULL) p->code = pw_cli_engine_lanes (&p->engine, s, p->method, p->lanes, steps);
  if (why && p->lanes > 1) pw_cli_say ("pinwheel: one run after the other: %s\n", why);
}

static int plan_scan_row (pw_plan *p, long row, plan_scan *scan, pw_error *error) {
  pw_cli_model m;
  pw_error own = { 0 };
  int status = pw_plan_compile (p, row, &m, &own);
  if (status == PW_OK) p->tables = pw_fingerprint_tables (p->tables, m.model);
  if (status == PW_OK) status = plan_columns_of (p, m.system, &own);
  if (status == PW_OK && !scan->built) plan_engine (p, m.system);
  pw_cli_close_model (&m);
  if (status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  scan->built |= status == PW_OK;
  if (status != PW_OK && scan->refused++ == 0) scan->first = own;
  return PW_OK;
}

/* The bodies may depend on integer parameters.  So one model is built for each value of these, with the others as in
 * the first row, and one for the last row; without such parameters one that can be built suffices. */
static int plan_columns (pw_plan *p, pw_error *error) {
  plan_scan x = { .built = 0 };
  int counts = 0, status = plan_scan_row (p, 0, &x, error);
  for (const pw_axis *a = p->grid.axis; a < p->grid.axis + p->grid.axes; a++) {
    int is_count = a->parameter && a->parameter->domain == PW_COUNT;
    counts += is_count;
    for (long i = 1; i < a->count && status == PW_OK && (is_count || !x.built) && x.refused < PLAN_TRIES; i++)
      status = plan_scan_row (p, i * a->stride, &x, error);
  }
  if (status == PW_OK && counts) status = plan_scan_row (p, p->grid.rows - 1, &x, error);
  if (status != PW_OK || x.built) return status;
  return pw_fail (error, x.first.status, "%s", x.first.text);
}

static void plan_head (pw_plan *p) {
  char name[300];
  for (const pw_axis *a = p->grid.axis; a < p->grid.axis + p->grid.axes; a++) {
    snprintf (name, sizeof name, "%s%s", a->parameter ? "" : "start.", a->name);
    pw_text_name (&p->head, name, a->unit);
  }
  pw_text_cell (&p->head, "status");
  pw_text_name (&p->head, "t", "s");
  for (int i = 0; i < p->columns; i++) pw_text_name (&p->head, p->column[i].name, p->column[i].unit);
  pw_text_name (&p->head, "kinetic", "J");
  pw_text_add (&p->head, ",residual.position,residual.velocity,steps,rhs");
  if (p->cpu) pw_text_name (&p->head, "cpu", "s");
  pw_text_cell (&p->head, "reason");
}

/* ---- The fingerprint ---- */

/* Parameters that are not varied, with --set applied. */
static void plan_parameters (pw_plan *p, const pw_model *m) {
  for (const pw_parameter *q = pw_model_table (m)->parameters; q && q->name; q++) {
    int varied = 0;
    for (int i = 0; i < p->grid.axes; i++) varied |= p->grid.axis[i].parameter == q;
    if (!varied) pw_fingerprint_number (&p->fingerprint, "parameter", q->name, pw_model_parameter (m, q));
  }
}

static void plan_grid (pw_plan *p) {
  pw_fingerprint_initial (&p->fingerprint, p->line->starts);
  pw_text order = { .chars = NULL };
  for (int i = 0; i < p->grid.axes; i++) {
    pw_fingerprint_line (&p->fingerprint, "vary", p->grid.axis[i].name, p->grid.axis[i].range);
    pw_text_cell (&order, p->grid.axis[i].name);
  }
  p->fingerprint.failed |= order.failed;
  pw_fingerprint_line (&p->fingerprint, "order", NULL, order.chars ? order.chars : "");
  pw_text_free (&order);
}

static int plan_fingerprint (pw_plan *p, const pw_model *m, pw_error *error) {
  char part[60];
  if (pw_fingerprint_run (&p->fingerprint, PW_SWEEP_MAGIC, p->file, p->tables, p->method, &p->settings, error) != PW_OK)
    return error->status;
  if (p->settings.max_steps != PW_MAX_STEPS)
    pw_fingerprint_number (&p->fingerprint, "max-steps", NULL, (double)p->settings.max_steps);
  if (isfinite (p->limit.seconds)) pw_fingerprint_number (&p->fingerprint, "limit", NULL, p->limit.seconds);
  if (p->engine.code) pw_fingerprint_line (&p->fingerprint, "engine", NULL, "specialised");
  plan_parameters (p, m);
  plan_grid (p);
  pw_fingerprint_number (&p->fingerprint, "rows", NULL, (double)p->grid.rows);
  pw_fingerprint_line (&p->fingerprint, "columns", NULL, p->head.chars ? p->head.chars : "");
  snprintf (part, sizeof part, "%d/%d", p->part, p->parts);
  pw_fingerprint_line (&p->fingerprint, "part", NULL, part);
  pw_text_add (&p->fingerprint, "end\n");
  if (p->fingerprint.failed || p->head.failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  return PW_OK;
}

/* ---- The plan ---- */

int pw_plan_open (pw_plan *p, const char **ranges, pw_error *error) {
  const pw_method *method;
  int stabilisation, status = pw_method_parse (p->method, &method, &stabilisation, error);
  if (status == PW_OK) status = pw_grid_read (&p->grid, (const char *const *)ranges, error);
  if (status != PW_OK) return status;
  pw_model *m = pw_file_model (p->file, error);
  if (m == NULL) return error->status;
  status = pw_cli_apply (m, "--set", p->line->sets, pw_model_set, error);
  for (int i = 0; i < p->grid.axes && status == PW_OK; i++) status = plan_axis (p, p->grid.axis + i, m, error);
  if (status == PW_OK) status = plan_columns (p, error);
  if (status == PW_OK) plan_head (p);
  if (status == PW_OK) status = plan_fingerprint (p, m, error);
  pw_model_free (m);
  return status;
}

void pw_plan_close (pw_plan *p) {
  pw_cli_engine_close (&p->engine);
  pw_scene_code_close (p->code);
  pw_grid_free (&p->grid);
  pw_names_close (&p->index);
  pw_arena_free (&p->arena);
  pw_text_free (&p->head);
  pw_text_free (&p->fingerprint);
  free (p->column);
}
