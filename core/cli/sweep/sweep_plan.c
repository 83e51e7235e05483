/* Makes the plan of a sweep: finds the parameters that are varied, the columns of the table and the fingerprint. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fingerprint.h"
#include "sweep_plan.h"

enum { PLAN_TRIES = 1000 }; /* failures to build a model after which no other values are tried */

/* ---- Models ---- */

/* Builds the model of a row: --set, varied parameters, --start.  Varied initial values are set when its run begins. */
static int plan_build (const pw_plan *plan, long row, pw_model *model, pw_error *error) {
  int status = pw_cli_apply (model, "--set", plan->line->sets, pw_model_set, error);
  for (int i = 0; i < plan->grid.axes && status == PW_OK; i++)
    if (plan->grid.axis[i].parameter)
      status = pw_model_set (model, plan->grid.axis[i].name, pw_grid_value (&plan->grid, i, row), error);
  if (status == PW_OK) status = pw_cli_apply (model, "--start", plan->line->starts, pw_model_set_initial, error);
  return status == PW_OK ? pw_model_build (model, error) : status;
}

int pw_plan_compile (const pw_plan *plan, long row, pw_cli_model *compiled, pw_error *error) {
  *compiled = (pw_cli_model){ .model = pw_file_model (plan->file, error) };
  if (compiled->model && plan_build (plan, row, compiled->model, error) == PW_OK)
    compiled->system = pw_system_compile (compiled->model, error);
  if (compiled->system == NULL) return error->status;
  for (const pw_axis *axis = plan->grid.axis; axis < plan->grid.axis + plan->grid.axes; axis++)
    if (axis->parameter == NULL && pw_system_find_state (compiled->system, axis->name, error) < 0) return PW_INPUT;
  return PW_OK;
}

/* ---- Axes ---- */

/* 1 if a list of "NAME=VALUE", which ends with NULL or is NULL, has this name. */
static int plan_has_name (const char **list, const char *name) {
  size_t n = strlen (name);
  for (; list && *list; list++)
    if (strncmp (*list, name, n) == 0 && (*list)[n] == '=') return 1;
  return 0;
}

/* Finds the parameter of an axis, in whose domain all values must lie.  Other names with a dot are those of states,
 * which exist only in a compiled model. */
static int plan_match_axis (const pw_plan *plan, pw_axis *axis, pw_model *model, pw_error *error) {
  const pw_parameter *parameter = axis->parameter = pw_cli_parameter (model, axis->name);
  if (parameter) axis->unit = parameter->unit;
  if (plan_has_name (parameter ? plan->line->sets : plan->line->starts, axis->name))
    return pw_fail (error, PW_INPUT, "%s is given by --vary and by %s", axis->name, parameter ? "--set" : "--start");
  if (parameter == NULL && strchr (axis->name, '.')) return PW_OK;
  for (long i = 0; i < axis->count; i++)
    if (parameter == NULL || *pw_domain_check (parameter->domain, pw_axis_value (axis, i)))
      return pw_model_set (model, axis->name, pw_axis_value (axis, i), error); /* fails with the reason */
  return PW_OK;
}

/* ---- Columns ---- */

/* The index of the i-th state in the order of the table: positions and velocities of each body, then each internal
 * coordinate and its velocity.  In a system all coordinates come before all velocities. */
static int plan_table_state (const pw_system *system, int i) {
  int n = pw_system_coordinates (system), bodies = pw_system_bodies (system), internal = i - 6 * bodies;
  if (internal >= 0) return 3 * bodies + internal / 2 + (internal % 2 ? n : 0);
  return 3 * (i / 6) + i % 3 + (i % 6 < 3 ? 0 : n);
}

/* Makes room for a column; a larger hash table of names is filled anew. */
static int plan_reserve_column (pw_plan *plan) {
  if ((size_t)plan->columns < plan->column_room) return PW_OK;
  if (pw_grow (&plan->column, (size_t)plan->columns, &plan->column_room, sizeof *plan->column) != PW_OK)
    return PW_RESOURCE;
  pw_names_close (&plan->column_of);
  if (pw_names_open (&plan->column_of, plan->column_room) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < plan->columns; i++) pw_names_add (&plan->column_of, plan->column[i].name, i);
  return PW_OK;
}

/* Adds the new states of a system, and the units of varied initial values. */
static int plan_add_columns (pw_plan *plan, const pw_system *system, pw_error *error) {
  for (int i = 0; i < 2 * pw_system_coordinates (system); i++) {
    int state = plan_table_state (system, i);
    const char *name = PW_NAME (pw_system_state_name, system, state);
    if (plan->column_room && pw_names_find (&plan->column_of, name) >= 0) continue;
    const char *copy = pw_arena_copy (&plan->arena, name);
    if (copy == NULL || plan_reserve_column (plan) != PW_OK) return pw_fail (error, PW_RESOURCE, "out of memory");
    plan->column[plan->columns] = (struct pw_column){ copy, pw_system_state_unit (system, state) };
    pw_names_add (&plan->column_of, copy, plan->columns++);
  }
  for (pw_axis *axis = plan->grid.axis; axis < plan->grid.axis + plan->grid.axes; axis++)
    if (axis->parameter == NULL)
      axis->unit = pw_system_state_unit (system, pw_system_find_state (system, axis->name, error));
  return PW_OK;
}

/* Models built to find the columns. */
typedef struct {
  int built;            /* 1: at least one */
  int complete;         /* 1: at least one has all states that are varied */
  int failed;           /* number of the others */
  pw_error first_error; /* why the first of these failed */
} plan_scan;

/* Chooses what evaluates the equations, of one run and of several at once: the same in all parts of a sweep, since
 * results of different codes differ by round-off. */
static void plan_open_engines (pw_plan *plan, const pw_system *system) {
  pw_run_defaults defaults = pw_cli_defaults (pw_file_table (plan->file));
  double steps = (double)plan->grid.rows * pw_method_steps (plan->method, &plan->settings, defaults.step, plan->t_end);
  pw_cli_report_tables (system, plan->t_end);
  pw_cli_engine_open (&plan->engine, system, plan->specialise, steps);
  const char *reason = plan->with_cpu                   ? "--cpu measures each run"
                       : isfinite (plan->limit.seconds) ? "--limit stops each run by itself"
                                                        : NULL;
  if (reason == NULL) plan->lanes_code = pw_cli_engine_lanes (&plan->engine, system, plan->method, plan->lanes, steps);
  if (reason && plan->lanes > 1) pw_cli_say ("pinwheel: one run after the other: %s\n", reason);
}

static int plan_scan_row (pw_plan *plan, long row, plan_scan *scan, pw_error *error) {
  pw_cli_model compiled;
  pw_error row_error = { 0 };
  int status = pw_plan_compile (plan, row, &compiled, &row_error);
  if (status == PW_OK) plan->tables_sum = pw_fingerprint_tables (plan->tables_sum, compiled.model);
  if (status == PW_OK) status = plan_add_columns (plan, compiled.system, &row_error);
  if (status == PW_OK && !scan->complete) plan_open_engines (plan, compiled.system);
  scan->built |= compiled.system != NULL;
  pw_cli_close_model (&compiled);
  if (status == PW_RESOURCE) return pw_fail (error, status, "%s", row_error.text);
  scan->complete |= status == PW_OK;
  if (status != PW_OK && scan->failed++ == 0) scan->first_error = row_error;
  return PW_OK;
}

/* The bodies, and so the states, may depend on integer parameters: models are built for the first row, for each value
 * of an integer with all else as in the first row, and for the last row.  Values of other axes are tried in the same
 * way until a model can be built; without integers the last row is not tried. */
static int plan_find_columns (pw_plan *plan, pw_error *error) {
  plan_scan scan = { .built = 0 };
  int any_integer = 0, status = plan_scan_row (plan, 0, &scan, error);
  for (const pw_axis *axis = plan->grid.axis; axis < plan->grid.axis + plan->grid.axes; axis++) {
    int integer = axis->parameter && axis->parameter->domain == PW_COUNT;
    any_integer |= integer;
    for (long i = 1; i < axis->count && (integer || !scan.built) && scan.failed < PLAN_TRIES && status == PW_OK; i++)
      status = plan_scan_row (plan, i * axis->stride, &scan, error);
  }
  if (status == PW_OK && any_integer) status = plan_scan_row (plan, plan->grid.rows - 1, &scan, error);
  if (status != PW_OK || scan.complete) return status;
  return pw_fail (error, scan.first_error.status, "%s", scan.first_error.text);
}

/* ---- Cells ---- */

/* A cell of a row or, if that is NULL, of the heading, which alone uses name and unit. */
static void plan_cell (const pw_plan_row *row, pw_text *text, const char *name, const char *unit, double value) {
  row ? pw_text_number (text, value) : pw_text_name (text, name, unit);
}

void pw_plan_cells (const pw_plan *plan, const pw_plan_row *row, pw_text *text) {
  const pw_run *run = row ? row->run : NULL;
  const pw_sample *last = row ? row->last : NULL;
  const pw_statistics *statistics = run ? pw_run_statistics (run) : NULL;
  for (int i = 0; i < plan->grid.axes; i++) {
    const pw_axis *axis = &plan->grid.axis[i];
    const char *name = row ? NULL : PW_PRINTED (300, "%s%s", axis->parameter ? "" : "start.", axis->name);
    plan_cell (row, text, name, axis->unit, row ? pw_grid_value (&plan->grid, i, row->number) : 0);
  }
  pw_text_cell (text, row ? pw_cli_status_word (row->status) : "status");
  plan_cell (row, text, "t", "s", run ? pw_run_time (run) : NAN);
  for (int i = 0; i < plan->columns; i++) {
    int state = last ? row->state[i] : -1, n = last ? row->coordinates : 0;
    plan_cell (row, text, plan->column[i].name, plan->column[i].unit,
               state < 0   ? NAN
               : state < n ? last->q[state]
                           : last->v[state - n]);
  }
  plan_cell (row, text, "kinetic", "J", last ? last->kinetic : NAN);
  plan_cell (row, text, "residual.position", NULL, run ? statistics->position : NAN);
  plan_cell (row, text, "residual.velocity", NULL, run ? statistics->velocity : NAN);
  plan_cell (row, text, "steps", NULL, run ? (double)statistics->steps : NAN);
  plan_cell (row, text, "rhs", NULL, run ? (double)statistics->rhs : NAN);
  if (plan->with_cpu) plan_cell (row, text, "cpu", "s", row ? row->cpu : 0);
  row ? pw_text_quoted (text, row->reason) : pw_text_cell (text, "reason");
}

/* ---- The fingerprint ---- */

/* The values of parameters that are not varied: the model's or those of --set. */
static void plan_fingerprint_parameters (pw_plan *plan, const pw_model *model) {
  for (const pw_parameter *parameter = pw_model_table (model)->parameters; parameter && parameter->name; parameter++) {
    int is_varied = 0;
    for (int i = 0; i < plan->grid.axes; i++) is_varied |= plan->grid.axis[i].parameter == parameter;
    if (!is_varied)
      pw_fingerprint_number (&plan->fingerprint, "parameter", parameter->name, pw_model_parameter (model, parameter));
  }
}

static void plan_fingerprint_grid (pw_plan *plan) {
  pw_text *text = &plan->fingerprint;
  pw_fingerprint_initial (text, plan->line->starts);
  pw_text order = { .chars = NULL }; /* of the axes, which determines the order of the rows */
  for (int i = 0; i < plan->grid.axes; i++) {
    pw_fingerprint_line (text, "vary", plan->grid.axis[i].name, plan->grid.axis[i].range);
    pw_text_cell (&order, plan->grid.axis[i].name);
  }
  text->failed |= order.failed;
  pw_fingerprint_line (text, "order", NULL, order.chars ? order.chars : "");
  pw_text_free (&order);
}

static int plan_fingerprint (pw_plan *plan, const pw_model *model, pw_error *error) {
  pw_text *text = &plan->fingerprint;
  if (pw_fingerprint_run (text, PW_SWEEP_MAGIC, plan->file, plan->tables_sum, plan->method, &plan->settings, error) !=
      PW_OK)
    return error->status;
  if (plan->settings.max_steps != PW_MAX_STEPS)
    pw_fingerprint_number (text, "max-steps", NULL, (double)plan->settings.max_steps);
  if (isfinite (plan->limit.seconds)) pw_fingerprint_number (text, "limit", NULL, plan->limit.seconds);
  if (plan->engine.code) pw_fingerprint_line (text, "engine", NULL, "specialised");
  plan_fingerprint_parameters (plan, model);
  plan_fingerprint_grid (plan);
  pw_fingerprint_number (text, "rows", NULL, (double)plan->grid.rows);
  pw_fingerprint_line (text, "columns", NULL, plan->heading.chars ? plan->heading.chars : "");
  pw_fingerprint_line (text, "part", NULL, PW_PRINTED (60, "%d/%d", plan->part, plan->parts));
  pw_text_add (text, "end\n");
  if (text->failed || plan->heading.failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  return PW_OK;
}

/* ---- The plan ---- */

int pw_plan_open (pw_plan *plan, const char **ranges, pw_error *error) {
  const pw_method *method;
  int stabilisation, status = pw_method_parse (plan->method, &method, &stabilisation, error);
  if (status == PW_OK) status = pw_grid_read (&plan->grid, (const char *const *)ranges, &plan->arena, error);
  if (status != PW_OK) return status;
  pw_model *model = pw_file_model (plan->file, error);
  if (model == NULL) return error->status;
  status = pw_cli_apply (model, "--set", plan->line->sets, pw_model_set, error);
  for (int i = 0; i < plan->grid.axes && status == PW_OK; i++)
    status = plan_match_axis (plan, plan->grid.axis + i, model, error);
  if (status == PW_OK) status = plan_find_columns (plan, error);
  if (status == PW_OK) pw_plan_cells (plan, NULL, &plan->heading);
  if (status == PW_OK) status = plan_fingerprint (plan, model, error);
  pw_model_free (model);
  return status;
}

void pw_plan_close (pw_plan *plan) {
  pw_cli_engine_close (&plan->engine);
  pw_scene_code_close (plan->lanes_code);
  pw_names_close (&plan->column_of);
  pw_arena_free (&plan->arena);
  pw_text_free (&plan->heading);
  pw_text_free (&plan->fingerprint);
  free (plan->column);
}
