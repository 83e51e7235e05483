/* pinwheel sweep: a table of runs, for all combinations of varied parameters and initial values.
 *
 * Every run depends only on its row of the grid.  A journal keeps the rows in the order of completion; at the end they
 * are sorted into the order of the grid.  So the table does not depend on the number of threads or on interruptions of
 * the sweep.
 *
 * Rows with the same parameters follow each other and share a compiled system; systems of the same structure share
 * specialised code. */
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"
#include "sweep_journal.h"
#include "pinwheel-analysis.h"
#include "figure.h"
#include "outcome.h"

/* ---- The plan of a sweep: the grid of its rows, the columns of its table, its fingerprint ----
 *
 * The grid is all combinations of the values of the varied quantities (axes), one per row.  Rows are numbered from 0 in
 * the order of the table, in which the last axis varies fastest.  A sweep computes all rows, or those of one part: part
 * i of n has the rows i - 1, i - 1 + n, i - 1 + 2 n, ... */

typedef struct {
  pw_axis *axis;
  int axes;
  long rows;
} pw_grid;

typedef struct {
  /* from the command line */
  const pw_cli_line *line;
  const char *method;
  pw_settings settings;
  pw_limit limit;  /* of each run */
  int with_cpu;    /* 1: a column with each run's processor time */
  int with_error;  /* 1: columns with the stated errors of states */
  const char **of; /* --of: outputs, ended by NULL; NULL: none */
  int outputs;     /* their number */
  double *drawn;   /* rows x outputs, or states if there are none: set by plan_keep_drawn; NULL: not wanted */
  int part, parts; /* --part; 1, 1 if it is not given */
  int lanes;       /* --lanes, runs that a thread advances at once by vector instructions; 0: not given */
  /* set by plan_open */
  pw_grid grid;
  pw_cli_engine engine;      /* of the first row that can be built, so that it does not depend on the part */
  pw_scene_code *lanes_code; /* the same for several runs at once; NULL: none */
  struct pw_column {
    const char *name, *unit;
    int is_known; /* of an output: 1 if the table has this column anyway */
  } * column;     /* of the states of all bodies and elements */
  int columns;
  struct pw_column *output; /* outputs: of each */
  int by_steps;             /* 1: outputs or the condition of --until need each step */
  size_t column_room;       /* entries of `column` that are allocated */
  pw_names column_of;       /* from a state's name to the index of its column */
  pw_arena arena;           /* of the grid and of names */
  uint64_t tables_sum;      /* a checksum of the points of all tables of models built so far; 0: there are none */
  pw_stream heading;        /* the table's first line, without its end */
  pw_stream fingerprint;    /* the first lines of a journal or part: everything that determines the rows */
} pw_plan;

/* A compiled system, shared by rows with the same parameters. */
typedef struct {
  long parameters;            /* grid_parameter_index of these rows */
  int users;                  /* number of runs that use it, and one more while it is the latest system */
  int ready;                  /* 0: a thread is compiling it */
  pw_cli_model model;         /* model.file is NULL */
  int *state;                 /* index of the state in each column of the table; -1: the system does not have it */
  const pw_specialised *code; /* NULL: the general engine */
  pw_error error;             /* why it could not be compiled */
} row_system;

/* A row that is being computed. */
typedef struct {
  long number;         /* in the grid */
  row_system *system;  /* NULL: no row */
  pw_run *run;         /* NULL: it could not be opened */
  double *state_error; /* of each state at the end; NULL: not known */
  pw_outcomes of;      /* outputs and condition; in use if plan->of or --until is given */
  pw_limit limit;
  int status; /* other than PW_OK: the run has ended */
  pw_error error;
} sweep_row;

enum { PLAN_TRIES = 1000 }; /* failures to build a model after which no other values are tried */

/* Of axis i. */
static double grid_value (const pw_grid *grid, int i, long row) {
  const pw_axis *axis = grid->axis + i;
  return pw_axis_value (axis, row / axis->stride % axis->count);
}

/* The row that is computed k-th, from 0: rows with the same parameters follow each other and share a compiled model.
 * Initial values vary fastest, then parameters; the order among initial values and among parameters is the table's. */
static long grid_scheduled_row (const pw_grid *grid, long k) {
  long row = 0;
  for (int parameters = 0; parameters < 2; parameters++)
    for (const pw_axis *axis = grid->axis + grid->axes; axis-- > grid->axis;) {
      if ((axis->parameter != NULL) != parameters) continue;
      row += k % axis->count * axis->stride;
      k /= axis->count;
    }
  return row;
}

/* The number, from 0, of a row's combination of parameters, without regard to its initial values. */
static long grid_parameter_index (const pw_grid *grid, long row) {
  long index = 0;
  for (const pw_axis *axis = grid->axis; axis < grid->axis + grid->axes; axis++)
    if (axis->parameter) index = index * axis->count + row / axis->stride % axis->count;
  return index;
}

/* Reads a NULL-terminated list of "NAME=RANGE".  PW_INPUT also if there are too many rows. */
static int grid_read (pw_grid *grid, const char *const *ranges, pw_arena *arena, pw_error *error) {
  int n = 0, status = PW_OK;
  while (ranges && ranges[n]) n++;
  *grid = (pw_grid){ .axis = pw_arena_alloc (arena, ((size_t)n + 1) * sizeof *grid->axis) };
  if (grid->axis == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (grid->axes < n && status == PW_OK) {
    pw_axis *axis = grid->axis + grid->axes++;
    status = pw_axis_read (axis, ranges[axis - grid->axis], arena, error);
    for (const pw_axis *other = grid->axis; other < axis && status == PW_OK; other++)
      if (strcmp (other->name, axis->name) == 0)
        status = pw_fail (error, PW_INPUT, "--vary %.200s is given twice", axis->name);
  }
  double rows = 1;
  for (int i = 0; i < grid->axes; i++) rows *= (double)grid->axis[i].count;
  if (status == PW_OK && rows > PW_AXIS_MOST)
    status =
        pw_fail (error, PW_INPUT, "the grid has %.15g rows: at most 1e8; use coarser ranges, or several sweeps", rows);
  grid->rows = 1;
  for (int i = grid->axes - 1; i >= 0 && status == PW_OK; i--) {
    grid->axis[i].stride = grid->rows;
    grid->rows *= grid->axis[i].count;
  }
  return status;
}

/* Builds and compiles the model of a row; compiled->file stays NULL.  Close it in every case.  May be called by several
 * threads at once. */
static int plan_compile (const pw_plan *plan, long row, pw_cli_model *compiled, pw_error *error) {
  pw_model *model = pw_file_model (plan->line->m.file, error);
  *compiled = (pw_cli_model){ .model = model };
  int status = model ? pw_cli_apply (plan->line, model, error) : error->status;
  for (int i = 0; i < plan->grid.axes && status == PW_OK; i++) /* varied initial values are set when the run begins */
    if (plan->grid.axis[i].parameter)
      status = pw_model_set (model, plan->grid.axis[i].name, grid_value (&plan->grid, i, row), error);
  if (status == PW_OK) status = pw_model_build (model, error);
  if (status == PW_OK) compiled->system = pw_system_compile (model, error);
  if (compiled->system == NULL) return error->status;
  for (const pw_axis *axis = plan->grid.axis; axis < plan->grid.axis + plan->grid.axes; axis++)
    if (axis->parameter == NULL && pw_system_find_state (compiled->system, axis->name, error) < 0) return PW_INPUT;
  return PW_OK;
}

/* Finds the parameter of an axis, in whose domain all values must lie.  Other names are those of states, which exist
 * only in a compiled model. */
static int plan_match_axis (const pw_plan *plan, pw_axis *axis, pw_model *model, pw_error *error) {
  const pw_parameter *parameter = axis->parameter = pw_cli_parameter (model, axis->name);
  const size_t n = strlen (axis->name);
  if (parameter) axis->unit = parameter->unit;
  for (const char **given = parameter ? plan->line->sets : plan->line->starts; given && *given; given++)
    if (strncmp (*given, axis->name, n) == 0 && (*given)[n] == '=')
      return pw_fail (error, PW_INPUT, "%s is given by --vary and by %s", axis->name, parameter ? "--set" : "--start");
  if (parameter == NULL && pw_cli_is_state (plan->line->m.file, axis->name)) return PW_OK;
  if (parameter == NULL) return pw_cli_no_parameter (plan->line->m.file, model, axis->name, 1, error);
  for (long i = 0; i < axis->count; i++)
    if (*pw_domain_check (parameter->domain, pw_axis_value (axis, i)))
      return pw_model_set (model, axis->name, pw_axis_value (axis, i), error); /* fails with the reason */
  return PW_OK;
}

static int plan_add_columns (pw_plan *plan, const pw_system *system, pw_error *error) {
  const int n = pw_system_coordinates (system), bodies = pw_system_bodies (system);
  for (int i = 0; i < 2 * n; i++) {
    /* the order of the table: positions and velocities of each body, then each internal coordinate and its velocity; in
     * a system all coordinates come before all velocities */
    int internal = i - 6 * bodies, state = internal >= 0 ? 3 * bodies + internal / 2 + (internal % 2 ? n : 0)
                                                         : 3 * (i / 6) + i % 3 + (i % 6 < 3 ? 0 : n);
    const char *name = PW_NAME (pw_system_state_name, system, state);
    if (pw_system_state_hidden (system, state)) continue;
    if (plan->column_room && pw_names_find (&plan->column_of, name) >= 0) continue;
    const char *copy = pw_arena_copy (&plan->arena, name),
               *unit = pw_arena_copy (&plan->arena, pw_system_state_unit (system, state));
    if (copy == NULL || unit == NULL ||
        pw_grow (&plan->column, (size_t)plan->columns, &plan->column_room, sizeof *plan->column) != PW_OK ||
        pw_names_reserve (&plan->column_of, plan->column_room) != PW_OK)
      return pw_fail (error, PW_RESOURCE, "out of memory");
    plan->column[plan->columns] = (struct pw_column){ copy, unit, 1 };
    pw_names_add (&plan->column_of, copy, plan->columns++);
  }
  for (pw_axis *axis = plan->grid.axis; axis < plan->grid.axis + plan->grid.axes; axis++)
    if (axis->parameter == NULL)
      axis->unit =
          pw_arena_copy (&plan->arena, pw_system_state_unit (system, pw_system_find_state (system, axis->name, error)));
  return PW_OK;
}

/* Models built to find the columns. */
typedef struct {
  int built;            /* 1: at least one */
  int complete;         /* 1: at least one has all states that are varied */
  int failed;           /* number of the others */
  pw_error first_error; /* why the first of these failed */
} plan_scan;

/* Checks outputs and the condition of --until; stores names and units of outputs. */
static int plan_open_outputs (pw_plan *plan, const pw_system *system, long row, pw_error *error) {
  pw_outcomes set;
  pw_error own = { 0 };
  char run[300] = "";
  char unit[60];
  while (plan->of && plan->of[plan->outputs]) plan->outputs++;
  plan->output = pw_arena_alloc (&plan->arena, (size_t)plan->outputs * sizeof *plan->output);
  if (plan->output == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_outcomes_open (&set, system, "--of", plan->of, plan->outputs, plan->line->until, &own);
  for (size_t i = 0, used = 0; i < (size_t)plan->grid.axes && used < sizeof run; i++)
    used += (size_t)snprintf (run + used, sizeof run - used, "%s%s = %s", i ? ", " : "", plan->grid.axis[i].name,
                              PW_DIGITS (grid_value (&plan->grid, (int)i, row), 6));
  if (status != PW_OK) pw_fail (error, status, "%.400s (in the run with %s)", own.text, run);
  for (int i = 0; i < plan->outputs && status == PW_OK; i++) {
    plan->output[i].is_known = pw_names_find (&plan->column_of, plan->of[i]) >= 0 || strcmp (plan->of[i], "t") == 0 ||
                               strcmp (plan->of[i], "kinetic") == 0;
    plan->output[i].name = plan->of[i];
    plan->output[i].unit = pw_arena_copy (&plan->arena, pw_outcome_unit (&set, i, unit, sizeof unit));
    if (plan->output[i].unit == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
  }
  if (status == PW_OK) pw_outcomes_report (&set);
  plan->by_steps = set.extrema || set.integrals || plan->line->until;
  for (int i = 0; i < set.functionals; i++) plan->by_steps |= set.functional[i].type == PW_AT_TIME;
  pw_outcomes_close (&set);
  return status;
}

static int plan_scan_row (pw_plan *plan, long row, plan_scan *scan, pw_error *error) {
  pw_cli_model compiled;
  pw_error row_error = { 0 };
  int status = plan_compile (plan, row, &compiled, &row_error);
  if (status == PW_OK) plan->tables_sum = pw_fingerprint_tables (plan->tables_sum, compiled.model);
  if (status == PW_OK) status = plan_add_columns (plan, compiled.system, &row_error);
  if (status == PW_OK && !scan->complete && (plan->of || plan->line->until) &&
      plan_open_outputs (plan, compiled.system, row, error) != PW_OK)
    status = PW_RESOURCE, row_error = *error;
  /* what evaluates the equations, of one run and of several at once: the same in all parts of a sweep, since results
   * of different codes differ by round-off */
  if (status == PW_OK && !scan->complete) {
    double steps = (double)plan->grid.rows *
                   pw_method_steps (plan->method, &plan->settings, plan->line->m.defaults.step, plan->settings.span);
    pw_cli_report_tables (compiled.system, plan->settings.span);
    pw_cli_engine_open (&plan->engine, compiled.system, plan->line->when, steps);
    const char *reason = plan->with_cpu                   ? "--cpu measures each run"
                         : plan->with_error               ? "--error repeats each run"
                         : plan->by_steps                 ? "outputs and conditions follow each step"
                         : isfinite (plan->limit.seconds) ? "--limit stops each run by itself"
                                                          : NULL;
    if (reason == NULL)
      plan->lanes_code = pw_cli_engine_lanes (&plan->engine, compiled.system, plan->method, plan->lanes, steps);
    if (reason && plan->lanes > 1) pw_cli_say ("pinwheel: one run after the other: %s\n", reason);
  }
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

/* A cell of a row or, if that is NULL, of the heading, which alone uses name and unit. */
static void plan_cell (const sweep_row *row, pw_cells *text, const char *name, const char *unit, double value) {
  row ? pw_cells_number (text, value) : pw_cells_name (text, name, unit);
}

/* Appends the cells of a row, nan where there is no run or no sample; if the row is NULL, the heading.  No end of the
 * line is added.  last: its last sample; has_outputs 1: its outputs are known. */
static void plan_cells (const pw_plan *plan, const sweep_row *row, const pw_sample *last, int has_outputs,
                        pw_cells *text) {
  const pw_run *run = row ? row->run : NULL;
  const pw_statistics *statistics = run ? pw_run_statistics (run) : NULL;
  const int *state = row && row->system ? row->system->state : NULL;
  for (int i = 0; i < plan->grid.axes; i++) {
    const pw_axis *axis = &plan->grid.axis[i];
    const char *name = row ? NULL : PW_PRINTED (300, "%s%s", axis->parameter ? "" : "start.", axis->name);
    plan_cell (row, text, name, axis->unit, row ? grid_value (&plan->grid, i, row->number) : 0);
  }
  pw_cells_text (text, row ? pw_cli_status_word (row->status) : "status");
  plan_cell (row, text, "t", "s", last ? last->t : run ? pw_run_time (run) : NAN);
  for (int i = 0; i < plan->columns; i++) {
    const int n = last ? pw_system_coordinates (row->system->model.system) : 0, k = last ? state[i] : -1;
    const double value = k < 0 ? NAN : k < n ? last->q[k] : last->v[k - n];
    plan_cell (row, text, plan->column[i].name, plan->column[i].unit, value);
  }
  for (int i = 0; plan->with_error && i < plan->columns; i++) {
    const char *name = row ? NULL : PW_PRINTED (PW_NAME_BYTES + 10, "error.%s", plan->column[i].name);
    int known = row && row->state_error && state[i] >= 0;
    plan_cell (row, text, name, plan->column[i].unit, known ? row->state_error[state[i]] : NAN);
  }
  for (int i = 0; i < plan->outputs; i++)
    if (!plan->output[i].is_known)
      plan_cell (row, text, plan->output[i].name, plan->output[i].unit,
                 has_outputs ? pw_outcome_value (&row->of, i) : NAN);
  plan_cell (row, text, "kinetic", "J", last ? last->kinetic : NAN);
  plan_cell (row, text, "residual.position", NULL, run ? statistics->position : NAN);
  plan_cell (row, text, "residual.velocity", NULL, run ? statistics->velocity : NAN);
  plan_cell (row, text, "steps", NULL, run ? (double)statistics->steps : NAN);
  plan_cell (row, text, "rhs", NULL, run ? (double)statistics->rhs : NAN);
  if (plan->with_cpu)
    plan_cell (row, text, "cpu", "s", run ? pw_seconds (CLOCK_THREAD_CPUTIME_ID) - row->limit.start : 0);
  row ? pw_cells_quoted (text, row->error.text) : pw_cells_text (text, "reason");
}

static int plan_write_fingerprint (const pw_plan *plan, const pw_model *model, FILE *text, pw_error *error) {
  if (pw_fingerprint_run (text, PW_SWEEP_MAGIC, plan->line, plan->tables_sum, plan->method, &plan->settings, error) !=
      PW_OK)
    return error->status;
  if (plan->settings.max_steps != PW_MAX_STEPS)
    pw_fingerprint_number (text, "max-steps", NULL, (double)plan->settings.max_steps);
  if (plan->with_error) pw_fingerprint_line (text, "error", NULL, "stated");
  if (plan->line->until) pw_fingerprint_line (text, "until", NULL, plan->line->until);
  if (isfinite (plan->limit.seconds)) pw_fingerprint_number (text, "limit", NULL, plan->limit.seconds);
  if (plan->engine.code) pw_fingerprint_line (text, "engine", NULL, "specialised");
  for (const pw_parameter *parameter = pw_model_table (model)->parameters; parameter && parameter->name; parameter++) {
    int is_varied = 0; /* else its value is the model's or that of --set */
    for (int i = 0; i < plan->grid.axes; i++) is_varied |= plan->grid.axis[i].parameter == parameter;
    if (!is_varied) pw_fingerprint_number (text, "parameter", parameter->name, pw_model_parameter (model, parameter));
  }
  pw_fingerprint_initial (text, plan->line->starts);
  const pw_axis *axis = plan->grid.axis;
  for (int i = 0; i < plan->grid.axes; i++) pw_fingerprint_line (text, "vary", axis[i].name, axis[i].text);
  fputs ("order = ", text); /* of the axes, which determines the order of the rows */
  for (int i = 0; i < plan->grid.axes; i++) fprintf (text, "%s%s", i ? "," : "", axis[i].name);
  fputc ('\n', text);
  pw_fingerprint_number (text, "rows", NULL, (double)plan->grid.rows);
  pw_fingerprint_line (text, "columns", NULL, plan->heading.text);
  pw_fingerprint_line (text, "part", NULL, PW_PRINTED (60, "%d/%d", plan->part, plan->parts));
  fputs ("end\n", text);
  return PW_OK;
}

/* The heading and the fingerprint. */
static int plan_texts (pw_plan *plan, const pw_model *model, pw_error *error) {
  FILE *heading = pw_stream_open (&plan->heading);
  if (heading) plan_cells (plan, NULL, NULL, 0, &(pw_cells){ .f = heading });
  int status = pw_stream_close (heading, &plan->heading);
  if (status != PW_OK) return pw_fail (error, status, "out of memory");
  FILE *f = pw_stream_open (&plan->fingerprint);
  if (f) status = plan_write_fingerprint (plan, model, f, error);
  return pw_stream_close (f, &plan->fingerprint) == PW_OK ? status : pw_fail (error, PW_RESOURCE, "out of memory");
}

/* Matches the ranges ("NAME=RANGE") to the model, whose file is open in plan->line, and finds the columns by compiling
 * models of the grid.  Close the plan in every case. */
static int plan_open (pw_plan *plan, const char **ranges, pw_error *error) {
  const pw_method *method;
  int stabilisation, status = pw_method_parse (plan->method, plan->line->methods, &method, &stabilisation, error);
  if (status == PW_OK) status = grid_read (&plan->grid, (const char *const *)ranges, &plan->arena, error);
  if (status != PW_OK) return status;
  pw_model *model = pw_file_model (plan->line->m.file, error);
  if (model == NULL) return error->status;
  status = pw_cli_apply (plan->line, model, error);
  for (int i = 0; i < plan->grid.axes && status == PW_OK; i++)
    status = plan_match_axis (plan, plan->grid.axis + i, model, error);
  if (status == PW_OK) status = plan_find_columns (plan, error);
  if (status == PW_OK) status = plan_texts (plan, model, error);
  pw_model_free (model);
  return status;
}

static void plan_close (pw_plan *plan) {
  free (plan->drawn);
  pw_cli_engine_close (&plan->engine);
  pw_scene_code_close (plan->lanes_code);
  pw_names_close (&plan->column_of);
  pw_arena_free (&plan->arena);
  free (plan->heading.text);
  free (plan->fingerprint.text);
  free (plan->column);
}

/* The number of columns that are drawn: outputs; without any, the first states. */
enum { PW_PLAN_DRAWN = 12 };
static int plan_drawn (const pw_plan *plan) {
  return plan->outputs ? plan->outputs : plan->columns < PW_PLAN_DRAWN ? plan->columns : PW_PLAN_DRAWN;
}

/* The cell of a row, see plan_cells, that contains what is drawn as number i. */
static int plan_drawn_cell (const pw_plan *plan, int i) {
  const int states = plan->grid.axes + 2;
  int cell = states + plan->columns * (1 + plan->with_error);
  if (plan->outputs == 0) return states + i;
  for (int k = 0; k < (plan->output[i].is_known ? plan->outputs : i); k++) cell += !plan->output[k].is_known;
  if (!plan->output[i].is_known || strcmp (plan->output[i].name, "kinetic") == 0) return cell;
  const int state = pw_names_find (&plan->column_of, plan->output[i].name);
  return state < 0 ? states - 1 /* t */ : states + state;
}

/* Keeps the numbers of a row that are drawn. */
static void plan_keep_drawn (void *context, long row, const char *line) {
  const pw_plan *plan = context;
  const int count = plan_drawn (plan);
  for (int i = 0; i < count; i++) {
    const char *cell = line;
    double *value = &plan->drawn[row * count + i];
    for (int k = plan_drawn_cell (plan, i); k > 0; k--) cell += strcspn (cell, ",") + 1;
    if (pw_read_number (PW_PART (cell, strcspn (cell, ",")), value) != PW_OK) *value = NAN;
  }
}

/* Specialised code of systems whose structure differs from that of the plan's engine. */
typedef struct row_code {
  char *text;          /* in C */
  int ready;           /* 0: a thread is compiling it */
  pw_scene_code *code; /* NULL: it could not be compiled */
  struct row_code *next;
} row_code;

typedef struct {
  const pw_plan *plan;
  int jobs; /* threads */
  /* accessed by the thread that holds the lock */
  pthread_mutex_t lock;
  pthread_cond_t compiled;
  row_system *latest;
  row_code *codes;
  long next;             /* number of rows of the whole grid taken so far, in the order of grid_scheduled_row */
  long missing_at_start; /* number of rows to compute */
  pw_journal *journal;
  pw_progress progress;
  pw_error *error;
  long opened_runs;
  long changed_runs;     /* those whose given initial values the constraints have changed */
  double largest_change; /* pw_cli_largest_change */
  char largest_change_text[PW_CHANGE_TEXT];
} sweep_rows;

/* The code of a text, compiled by the first thread that needs it; `sweep` owns the text from now on.  The caller
 * holds the lock, which is released meanwhile. */
static const pw_specialised *rows_compile (sweep_rows *sweep, char *text, const pw_system *system, pw_error *error) {
  row_code *entry = sweep->codes;
  while (entry && strcmp (entry->text, text) != 0) entry = entry->next;
  if (entry) {
    free (text);
    while (!entry->ready) pthread_cond_wait (&sweep->compiled, &sweep->lock);
    return pw_scene_code_table (entry->code);
  }
  if ((entry = malloc (sizeof *entry)) == NULL) {
    free (text);
    return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  }
  *entry = (row_code){ .text = text, .next = sweep->codes };
  sweep->codes = entry;
  pthread_mutex_unlock (&sweep->lock);
  entry->code = pw_scene_code_open (text, system, error);
  pthread_mutex_lock (&sweep->lock);
  entry->ready = 1;
  pthread_cond_broadcast (&sweep->compiled);
  return pw_scene_code_table (entry->code);
}

/* Chooses the code of a new system, independently of the order of runs: that of the plan's engine if it fits, else code
 * generated for this system. */
static void rows_specialise (sweep_rows *sweep, row_system *system) {
  const pw_specialised *plan_code = pw_scene_code_table (sweep->plan->engine.code);
  pw_error code_error = { 0 };
  if (plan_code == NULL) return;
  if (pw_specialised_fits (plan_code, system->model.system)) {
    system->code = plan_code;
    return;
  }
  char *text = pw_cli_source (system->model.system, NULL);
  if (text == NULL) return;
  pthread_mutex_lock (&sweep->lock);
  system->code = rows_compile (sweep, text, system->model.system, &code_error);
  pthread_mutex_unlock (&sweep->lock);
  if (code_error.status != PW_OK && pw_stop == 0) pw_cli_say ("pinwheel: general engine: %s\n", code_error.text);
  if (system->code == NULL && pw_stop) system->error.status = PW_RETRY; /* Ctrl-C ends the compiler, too */
}

static int system_open (row_system *system, const pw_plan *plan, long row, pw_error *error) {
  char name[PW_NAME_BYTES];
  if (plan_compile (plan, row, &system->model, error) != PW_OK) return error->status;
  system->state = malloc ((size_t)plan->columns * sizeof *system->state);
  if (system->state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < plan->columns; i++) system->state[i] = -1;
  for (int i = 0; i < 2 * pw_system_coordinates (system->model.system); i++) {
    if (pw_system_state_hidden (system->model.system, i)) continue;
    int column = pw_names_find (&plan->column_of, pw_system_state_name (system->model.system, i, name, sizeof name));
    if (column < 0)
      return pw_fail (error, PW_INPUT,
                      "%s has no column: not in the first or last row, nor in the first with one count changed", name);
    system->state[column] = i;
  }
  return PW_OK;
}

/* Ends the use of a system; the last user frees it.  The caller holds the lock. */
static void system_release (row_system *system) {
  if (system == NULL || --system->users > 0) return;
  pw_cli_close_model (&system->model);
  free (system->state);
  free (system);
}

/* The system of a row: the latest one if it has the same parameters, else a new one.  The caller holds the lock, which
 * is released meanwhile.  NULL if out of memory. */
static row_system *system_of (sweep_rows *sweep, long row) {
  long parameters = grid_parameter_index (&sweep->plan->grid, row);
  row_system *system = sweep->latest;
  if (system && system->parameters == parameters) {
    system->users++;
    while (!system->ready) pthread_cond_wait (&sweep->compiled, &sweep->lock);
    return system;
  }
  if ((system = malloc (sizeof *system)) == NULL) return NULL;
  *system = (row_system){ .parameters = parameters, .users = 2 };
  system_release (sweep->latest);
  sweep->latest = system;
  pthread_mutex_unlock (&sweep->lock);
  if (system_open (system, sweep->plan, row, &system->error) == PW_OK) rows_specialise (sweep, system);
  pthread_mutex_lock (&sweep->lock);
  system->ready = 1;
  pthread_cond_broadcast (&sweep->compiled);
  return system;
}

/* Makes the whole run and its repetition; stores the stated errors of the states at the end if they are known. */
static void row_state_error (sweep_row *row, const pw_plan *plan, const pw_settings *settings) {
  enum { TIMES = MOTION_SAMPLES };
  const int width = pw_run_record_width (row->run), states = 2 * pw_system_coordinates (row->system->model.system);
  double t[TIMES], *rows = malloc ((TIMES + 2) * (size_t)width * sizeof *rows),
                   *end = rows ? rows + TIMES * width : NULL;
  long recorded;
  pw_error own = { 0 };
  pw_equal_times (plan->settings.span, TIMES, t);
  row->state_error = malloc ((size_t)states * sizeof *end);
  if (rows == NULL || row->state_error == NULL)
    row->status = pw_fail (&row->error, PW_RESOURCE, "out of memory");
  else
    row->status = pw_run_record (row->run, plan->settings.span, t, TIMES, LONG_MAX, rows, &recorded, &row->error);
  int known = row->status == PW_OK;
  pw_repetition *r =
      !known ? NULL : pw_repetition_open (row->system->model.system, plan->method, settings, t, TIMES, &own);
  known = r && pw_repetition_run (r, 0, &own) == PW_OK &&
          pw_repetition_error (r, rows, TIMES, end, end + width, &own) == PW_OK;
  for (int i = 0; known && i < states; i++) row->state_error[i] = end[PW_RECORD_STATES + i];
  if (own.status == PW_RESOURCE) row->status = own.status, row->error = own;
  if (row->status == PW_OK && pw_stop) row->status = PW_STOPPED; /* the repetition is missing */
  if (!known) free (row->state_error), row->state_error = NULL;
  pw_repetition_close (r);
  free (rows);
}

static int row_has_outcomes (const pw_plan *plan) {
  return plan->of || plan->line->until;
}

static void row_open (sweep_row *row, const pw_plan *plan) {
  row->run = NULL, row->state_error = NULL;
  row->error = row->system->error;
  row->status = row->error.status;
  if (row->status != PW_OK) return;
  row->limit = plan->limit;
  pw_settings settings = plan->settings;
  settings.stop_context = &row->limit;
  settings.specialised = row->system->code;
  pw_initial_value *initial = malloc (((size_t)plan->grid.axes + 1) * sizeof *initial); /* those that the grid varies */
  for (int i = 0; initial && i < plan->grid.axes; i++)
    if (plan->grid.axis[i].parameter == NULL)
      initial[settings.initials++] =
          (pw_initial_value){ pw_system_find_state (row->system->model.system, plan->grid.axis[i].name, NULL),
                              grid_value (&plan->grid, i, row->number) };
  settings.initial = initial;
  if (initial == NULL) pw_fail (&row->error, PW_RESOURCE, "out of memory");
  if (initial && row_has_outcomes (plan) &&
      pw_outcomes_open (&row->of, row->system->model.system, "--of", plan->of, plan->outputs, plan->line->until,
                        &row->error) == PW_OK)
    pw_outcomes_settings (&row->of, &settings);
  if (row->error.status == PW_OK)
    row->run = pw_limit_open (row->system->model.system, plan->method, &settings, &row->error);
  row->status = row->error.status;
  if (row->run && row_has_outcomes (plan))
    row->status = pw_outcomes_begin (&row->of, row->run, plan->settings.span, &row->error);
  if (row->run && plan->with_error) row_state_error (row, plan, &settings);
  free (initial);
}

static int row_ended (const sweep_row *row, const pw_plan *plan) {
  return row->status != PW_OK || row->of.ended || !(pw_run_time (row->run) < plan->settings.span);
}

/* Closes the run and appends the cells of its row, without the end of the line, even if the run failed; returns its
 * status.  No cells are written if this is PW_RETRY, after a request to stop, or PW_RESOURCE. */
static int row_close (sweep_row *row, const pw_plan *plan, pw_stream *text) {
  pw_sample sample, *last = NULL;
  pw_error sample_error = { 0 };
  if (row->status == PW_STOPPED) row->status = pw_limit_status (&row->limit, pw_run_time (row->run), &row->error);
  const double end = row->run && row->of.ended ? row->of.t : row->run ? pw_run_time (row->run) : 0;
  if (row->run && row->status == PW_OK && row_has_outcomes (plan))
    row->status = pw_outcomes_end (&row->of, row->run, &row->error);
  const int has_outputs = row->status == PW_OK && plan->outputs > 0;
  if (row->run && pw_run_sample (row->run, end, &sample, &sample_error) == PW_OK) last = &sample;
  if (row->status == PW_OK && last == NULL) row->status = sample_error.status, row->error = sample_error;
  /* PW_RETRY, from a method, without a request to stop */
  if (row->status > 0 && pw_stop == 0) row->status = pw_fail (&row->error, PW_METHOD, "the method gave up");
  FILE *f = pw_stream_open (text);
  if (f && row->status != PW_RETRY && row->status != PW_RESOURCE)
    plan_cells (plan, row, last, has_outputs, &(pw_cells){ .f = f });
  pw_outcomes_close (&row->of);
  pw_run_close (row->run);
  free (row->state_error);
  if (pw_stream_close (f, text) == PW_OK) return row->status;
  row->error = (pw_error){ 0 };
  return pw_fail (&row->error, PW_RESOURCE, "out of memory");
}

/* ---- Rows; the caller holds the lock ---- */

/* Adds a row to the journal, or keeps the first error, which stops all threads. */
static void rows_store (sweep_rows *sweep, const sweep_row *row, int status, const char *text) {
  if (status == PW_RETRY || sweep->error->status != PW_OK) return;
  if (status == PW_RESOURCE)
    pw_fail (sweep->error, PW_RESOURCE, "row %ld of the grid: %s", row->number + 1, row->error.text);
  else if (pw_journal_add (sweep->journal, row->number, -status, text, sweep->error) == PW_OK)
    pw_progress_at (&sweep->progress, (double)sweep->journal->done);
  if (sweep->error->status != PW_OK) pw_stop = 1;
}

/* A thread and the rows that it computes at once.  With more than one there are neither --cpu nor --limit: both refer
 * to the processor time of the thread. */
typedef struct {
  sweep_rows *sweep;
  const pw_specialised_lanes *lanes_code; /* NULL: none */
  void *lanes_memory;
  int width; /* number of rows: at most that of lanes; 1 without lanes_code */
  sweep_row row[PW_LANES_MOST];
} sweep_worker;

/* Opens the run of the next row; 0 if there is none.  The caller holds the lock, which is released meanwhile. */
static int worker_begin (sweep_rows *sweep, sweep_row *row) {
  const pw_plan *plan = sweep->plan;
  char text[PW_CHANGE_TEXT];
  long number = -1; /* of the next missing row of the part; none after a request to stop */
  while (number < 0 && pw_stop == 0 && sweep->next < plan->grid.rows) {
    long next = grid_scheduled_row (&plan->grid, sweep->next++);
    if (pw_journal_lacks (sweep->journal, next)) number = next;
  }
  if (number < 0) return 0;
  *row = (sweep_row){ .number = number, .system = system_of (sweep, number) };
  if (row->system == NULL) {
    rows_store (sweep, row, pw_fail (&row->error, PW_RESOURCE, "out of memory"), NULL);
    return 0;
  }
  pthread_mutex_unlock (&sweep->lock);
  row_open (row, plan);
  double change = row->run ? pw_cli_largest_change (row->run, row->system->model.system, text) : 0;
  pthread_mutex_lock (&sweep->lock);
  sweep->opened_runs += row->run != NULL;
  sweep->changed_runs += change > 0;
  if (change > sweep->largest_change) {
    sweep->largest_change = change;
    memcpy (sweep->largest_change_text, text, sizeof text);
  }
  return 1;
}

/* Advances the runs until one of them ends: in lanes if all use the code of the plan's engine, else one after the
 * other. */
static void worker_advance (sweep_worker *worker) {
  const pw_plan *plan = worker->sweep->plan;
  sweep_row *running[PW_LANES_MOST];
  pw_run *run[PW_LANES_MOST];
  double t_end[PW_LANES_MOST];
  int status[PW_LANES_MOST], n = 0, same_code = 1, ended = 0;
  pw_error error[PW_LANES_MOST];
  for (sweep_row *row = worker->row; row < worker->row + worker->width; row++) {
    if (row->system == NULL) continue;
    if (row_ended (row, plan)) return; /* it could not be opened, and is stored first */
    same_code &= row->system->code == pw_scene_code_table (plan->engine.code);
    running[n] = row, error[n] = (pw_error){ 0 }, t_end[n] = plan->settings.span, run[n++] = row->run;
  }
  if (plan->by_steps) /* one run */
    while (!row_ended (running[0], plan))
      running[0]->status =
          pw_outcomes_advance (&running[0]->of, run[0], plan->settings.span, plan->settings.span, &running[0]->error);
  if (plan->by_steps) return;
  while (!ended) {
    pw_runs_advance (run, n, t_end, same_code ? worker->lanes_code : NULL, worker->lanes_memory, status, error);
    for (int i = 0; i < n; i++) ended |= status[i] != PW_OK || !(pw_run_time (run[i]) < plan->settings.span);
  }
  for (int i = 0; i < n; i++) running[i]->status = status[i], running[i]->error = error[i];
}

static int worker_thread (void *context, int i, pw_error *error) {
  sweep_rows *sweep = context;
  sweep_worker worker = { .sweep = sweep, .lanes_code = pw_scene_code_lanes (sweep->plan->lanes_code), .width = 1 };
  (void)i, (void)error;
  if (worker.lanes_code && (worker.lanes_memory = pw_specialised_lanes_memory (worker.lanes_code)) != NULL)
    worker.width = pw_specialised_lanes_count (worker.lanes_code);
  pthread_mutex_lock (&sweep->lock);
  while (worker.width > 1 && sweep->missing_at_start < (long)worker.width * sweep->jobs)
    worker.width--; /* all threads are to have rows */
  int rows;
  do {
    rows = 0;
    for (int k = 0; k < worker.width; k++) rows += worker.row[k].system != NULL || worker_begin (sweep, &worker.row[k]);
    pthread_mutex_unlock (&sweep->lock);
    if (rows) worker_advance (&worker);
    pthread_mutex_lock (&sweep->lock);
    for (sweep_row *row = worker.row; row < worker.row + worker.width; row++) { /* stores those that have ended */
      if (row->system == NULL || !row_ended (row, sweep->plan)) continue;
      pthread_mutex_unlock (&sweep->lock);
      pw_stream text;
      int status = row_close (row, sweep->plan, &text);
      pthread_mutex_lock (&sweep->lock);
      rows_store (sweep, row, status, text.text);
      free (text.text);
      system_release (row->system);
      row->system = NULL;
    }
  } while (rows > 0);
  pthread_mutex_unlock (&sweep->lock);
  free (worker.lanes_memory);
  return PW_OK;
}

/* Computes the missing rows in `jobs` threads, until all are there or pw_stop is set.  PW_RESOURCE. */
static int rows_compute (const pw_plan *plan, pw_journal *journal, int jobs, pw_error *error) {
  const long left = journal->rows - journal->done;
  sweep_rows sweep = {
    .plan = plan, .journal = journal, .missing_at_start = left, .jobs = jobs < left ? jobs : (int)left, .error = error
  };
  pthread_mutex_init (&sweep.lock, NULL);
  pthread_cond_init (&sweep.compiled, NULL);
  pw_stop_catch ();
  pw_progress_start (&sweep.progress, pw_file_name (plan->line->m.file), "runs", (double)journal->done,
                     (double)journal->rows);
  pw_parallel (sweep.jobs, sweep.jobs, worker_thread, &sweep, error);
  pw_progress_end (&sweep.progress);
  pw_stop_release (); /* the rest can be interrupted and repeated */
  if (error->status == PW_OK && sweep.changed_runs)
    pw_cli_say (
        "pinwheel: in %ld of %ld runs given initial values were changed to satisfy the constraints, at worst %s\n",
        sweep.changed_runs, sweep.opened_runs, sweep.largest_change_text);
  for (row_code *entry = sweep.codes, *next; entry; entry = next) {
    next = entry->next;
    pw_scene_code_close (entry->code);
    free (entry->text);
    free (entry);
  }
  system_release (sweep.latest);
  pthread_cond_destroy (&sweep.compiled);
  pthread_mutex_destroy (&sweep.lock);
  return error->status;
}

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *part_text, *lanes_text;
  const char **ranges; /* --vary */
  int merge;           /* 1: --merge */
  /* as understood */
  pw_plan plan;
  pw_journal journal;
  pw_tally tally;
  int jobs;
} pw_sweep;

static int sweep_check_options (const pw_sweep *sweep, pw_error *error) {
  if (sweep->line.arguments == 0)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel sweep %s",
                    sweep->merge ? "--merge PART... -o FILE.csv" : pw_cli_sweep.synopsis);
  if (sweep->line.table == NULL || *sweep->line.table == 0)
    return pw_fail (error, PW_INPUT, "nowhere to write the table: add -o FILE.csv");
  if (strcmp (sweep->line.table, "-") == 0)
    return pw_fail (error, PW_INPUT, "-o -: a sweep needs a file, next to which it keeps what it has done");
  if (sweep->line.plots && sweep->part_text)
    return pw_fail (error, PW_INPUT, "--plots cannot be combined with --part: figures need all rows");
  if (!sweep->merge && sweep->ranges == NULL)
    return pw_fail (error, PW_INPUT, "nothing is varied: add --vary NAME=LOW:HIGH[:COUNT][:log] or NAME=V1,V2,...");
  return sweep->merge ? PW_OK : pw_cli_at_most_one (&pw_cli_sweep, &sweep->line, error);
}

/* The first option given that cannot be combined with --merge; NULL if there is none. */
static const char *sweep_not_for_merge (const pw_sweep *sweep) {
  for (const struct poptOption *o = pw_cli_sweep.options; o->longName || o->descrip; o++) {
    if (o->longName == NULL || strcmp (o->longName, "output") == 0 || strcmp (o->longName, "merge") == 0) continue;
    const void *value = (const char *)sweep + (size_t)o->arg;
    if (o->argInfo == POPT_ARG_NONE ? *(const int *)value : *(const void *const *)value != NULL) return o->longName;
  }
  return NULL;
}

#define SWEEP_LANES "1, 2, 4 or 8" /* the powers of 2 up to PW_LANES_MOST */
_Static_assert(PW_LANES_MOST == 8, "SWEEP_LANES, and numbers of one digit");

static int sweep_read_settings (pw_sweep *sweep, pw_error *error) {
  pw_plan *plan = &sweep->plan;
  const pw_run_defaults *defaults = &sweep->line.m.defaults;
  const char *lanes = sweep->lanes_text;
  char rest;
  plan->line = &sweep->line;
  plan->method = sweep->line.method ? sweep->line.method : defaults->method;
  if (plan->with_error && row_has_outcomes (plan))
    return pw_fail (error, PW_INPUT, "--error compares complete runs: it cannot be given together with --%s",
                    plan->of ? "of" : "until");
  pw_cli_settings (&sweep->line, defaults, &plan->settings, &plan->limit);
  pw_cli_report_unused (plan->method, &sweep->line);
  plan->lanes = lanes ? *lanes - '0' : 0;
  if (lanes && (plan->lanes < 1 || plan->lanes > PW_LANES_MOST || (plan->lanes & (plan->lanes - 1)) != 0 || lanes[1]))
    return pw_fail (error, PW_INPUT, "--lanes %.60s: expected " SWEEP_LANES, lanes);
  sweep->jobs = pw_parallel_jobs (&sweep->line);
  plan->part = plan->parts = 1; /* without --part the sweep is its only part */
  if (sweep->part_text == NULL || (sscanf (sweep->part_text, "%7d/%7d%c", &plan->part, &plan->parts, &rest) == 2 &&
                                   1 <= plan->part && plan->part <= plan->parts && plan->parts <= 1000000))
    return PW_OK;
  return pw_fail (error, PW_INPUT, "--part %.60s: expected I/N, whole numbers with 1 <= I <= N <= 1000000",
                  sweep->part_text);
}

static void sweep_report_failures (const pw_tally *tally) {
  if (tally->failed > 0)
    pw_cli_say ("pinwheel: %ld of %ld runs failed, the first of them: %s\n", tally->failed, tally->rows, tally->reason);
}

/* A failed run has its row in the table, too; the sweep fails only if all runs failed.  tally->status: exit status of
 * the first failure, the negative of its error status. */
static int sweep_conclude (const pw_tally *tally, pw_error *error) {
  if (tally->failed == tally->rows)
    return pw_fail (error, -tally->status, "all %ld runs failed, the first one: %s", tally->rows, tally->reason);
  sweep_report_failures (tally);
  return PW_OK;
}

/* The ends of the cell of a value in a map: half way to its neighbours. */
static void draw_ends (const pw_axis *axis, long i, double end[2]) {
  const double value = pw_axis_value (axis, i);
  const int logarithmic = axis->value == NULL && axis->range.logarithmic;
  double side[2] = { -INFINITY, INFINITY };
  for (long k = axis->value ? 0 : i > 0 ? i - 1 : 0; k < axis->count && (axis->value || k <= i + 1); k++) {
    const double x = pw_axis_value (axis, k);
    if (x < value) side[0] = fmax (side[0], x);
    if (x > value) side[1] = fmin (side[1], x);
  }
  const double one = isfinite (side[0])   ? (logarithmic ? value / side[0] : value - side[0])
                     : isfinite (side[1]) ? (logarithmic ? side[1] / value : side[1] - value)
                                          : 1;
  if (isinf (side[0])) side[0] = logarithmic ? value / one : value - one;
  if (isinf (side[1])) side[1] = logarithmic ? value * one : value + one;
  for (int k = 0; k < 2; k++) end[k] = logarithmic ? sqrt (value * side[k]) : (value + side[k]) / 2;
}

static int draw_by_value (const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Curves over one varied quantity, maps over two. */
static void sweep_draw (const void *context, pw_curves *c) {
  const pw_sweep *sweep = context;
  const pw_plan *plan = &sweep->plan;
  const pw_axis *axis = plan->grid.axis;
  const int count = plan_drawn (plan), maps = plan->grid.axes == 2;
  char text[2][FIGURE_TITLE];
  const char *label[2] = { "", "" };
  double range[2][2] = { { INFINITY, -INFINITY }, { INFINITY, -INFINITY } };
  double (*point)[2] = malloc ((size_t)plan->grid.rows * sizeof *point);
  int type = 0;
  if (point == NULL) pw_fail (&c->error, PW_RESOURCE, "out of memory");
  for (int k = 0; k <= maps; k++) {
    label[k] = pw_figure_label (axis[k].name, axis[k].unit ? axis[k].unit : "", text[k]);
    if (axis[k].value == NULL && axis[k].range.logarithmic) type |= k ? PW_PANEL_LOG_Y : PW_PANEL_LOG_X;
    for (long i = 0; i < axis[k].count; i++) {
      double end[2] = { pw_axis_value (&axis[k], i), pw_axis_value (&axis[k], i) };
      if (maps) draw_ends (&axis[k], i, end);
      range[k][0] = fmin (range[k][0], end[0]), range[k][1] = fmax (range[k][1], end[1]);
    }
  }
  for (int o = 0; point && o < count; o++) {
    const struct pw_column *column = plan->outputs ? &plan->output[o] : &plan->column[o];
    const char *name = PW_FIGURE_LABEL (column->name, column->unit ? column->unit : "");
    pw_panel panel = {
      .x_label = label[0], .y_label = maps ? label[1] : name, .z_label = maps ? name : NULL, .type = type
    };
    memcpy (panel.x, range[0], sizeof panel.x);
    if (maps) memcpy (panel.y, range[1], sizeof panel.y), panel.type |= PW_PANEL_HALF;
    if (!maps) panel.type |= PW_PANEL_BELOW;
    pw_curves_panel (c, &panel);
    pw_curves_add (c, maps ? "cells" : "line", NULL);
    for (long row = 0; row < plan->grid.rows; row++) {
      const double z = plan->drawn[row * count + o];
      double end[2][2];
      for (int k = 0; k <= maps; k++) draw_ends (&axis[k], row / axis[k].stride % axis[k].count, end[k]);
      if (maps) pw_curves_cell (c, end[0], end[1], z);
      point[row][0] = grid_value (&plan->grid, 0, row), point[row][1] = z;
    }
    if (!maps) qsort (point, (size_t)plan->grid.rows, sizeof *point, draw_by_value);
    for (long row = 0; row < plan->grid.rows && !maps; row++) pw_curves_point (c, point[row][0], point[row][1], 0);
  }
  free (point);
}

static void sweep_json (const void *context, pw_json *j) {
  const pw_sweep *sweep = context;
  const pw_tally *tally = &sweep->tally;
  pw_json_print (
      j, "{schema: %d, model: %s, method: %s, status: %s, runs: %ld, failed: %ld, reason: %s, table: %s, vary: [", 1,
      pw_file_name (sweep->line.m.file), sweep->plan.method,
      tally->failed == tally->rows ? pw_cli_status_word (-tally->status) : "ok", tally->rows, tally->failed,
      tally->failed ? tally->reason : "", sweep->line.table);
  for (const pw_axis *axis = sweep->plan.grid.axis; axis < sweep->plan.grid.axis + sweep->plan.grid.axes; axis++)
    pw_json_print (j, "{name: %s, values: %s}", axis->name, axis->text);
  pw_json_print (j, "]}");
}

/* The journal stands for the table. */
static const pw_results sweep_results = {
  .name = "sweep", .title = "sweep", .lines = 1, .json = sweep_json, .draw = sweep_draw
};

static int sweep_open (pw_sweep *sweep, pw_error *error) {
  int status = pw_cli_file (&sweep->line, error);
  if (status == PW_OK) status = sweep_read_settings (sweep, error);
  if (status == PW_OK)
    status = pw_results_open (&sweep->line, &sweep_results, sweep->part_text ? pw_cli_csv : pw_cli_tables,
                              (pw_use){ 0 }, error);
  if (status == PW_OK) status = plan_open (&sweep->plan, sweep->ranges, error);
  if (status == PW_OK && sweep->plan.parts > sweep->plan.grid.rows)
    status = pw_fail (error, PW_INPUT, "--part %s: more parts than the %ld rows of the grid", sweep->part_text,
                      sweep->plan.grid.rows);
  if (status == PW_OK && sweep->line.plots && sweep->plan.grid.axes > 2)
    status =
        pw_fail (error, PW_INPUT, "--plots: figures show one or two varied quantities, not %d", sweep->plan.grid.axes);
  const size_t numbers = (size_t)sweep->plan.grid.rows * (size_t)plan_drawn (&sweep->plan);
  if (status == PW_OK && sweep->line.plots && (sweep->plan.drawn = malloc (numbers * sizeof (double))) == NULL)
    status = pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK)
    status = pw_journal_open (&sweep->journal, sweep->line.table, sweep->plan.grid.rows, sweep->plan.part,
                              sweep->plan.parts, &sweep->plan.fingerprint, error);
  if (status != PW_OK) return status;
  if (sweep->journal.done > 0)
    pw_cli_say ("pinwheel: continuing with %s: %ld of %ld runs are done\n", sweep->journal.path, sweep->journal.done,
                sweep->journal.rows);
  return PW_OK;
}

static int sweep_finish (pw_sweep *sweep, pw_error *error) {
  if (sweep->journal.done == 0) {
    fputs ("pinwheel: interrupted before the first run was done\n", stderr);
    return PW_INTERRUPTED;
  }
  if (sweep->journal.done < sweep->journal.rows) {
    pw_cli_say ("pinwheel: interrupted; %ld of %ld runs are kept in %s; the same command continues from there\n",
                sweep->journal.done, sweep->journal.rows, sweep->journal.path);
    return PW_INTERRUPTED;
  }
  int status = pw_journal_finish (&sweep->journal, &sweep->plan.heading, sweep->plan.drawn ? plan_keep_drawn : NULL,
                                  &sweep->plan, &sweep->tally, error);
  if (status == PW_OK) status = pw_results_write (&sweep->line, &sweep_results, sweep, error);
  if (status != PW_OK) return status;
  if (sweep->plan.parts == 1) return sweep_conclude (&sweep->tally, error);
  sweep_report_failures (&sweep->tally); /* whether all have failed is known after the merge */
  return PW_OK;
}

static int sweep_command (void *options, pw_error *error) {
  pw_sweep *sweep = options;
  sweep->journal.descriptor = -1;
  int status = sweep_check_options (sweep, error);
  const char *other = status == PW_OK && sweep->merge ? sweep_not_for_merge (sweep) : NULL;
  if (other)
    status = pw_fail (error, PW_INPUT, "--%s cannot be combined with --merge: the parts define the sweep", other);
  if (status == PW_OK && sweep->merge) {
    status = pw_journal_merge (sweep->line.argument, sweep->line.arguments, sweep->line.table, &sweep->tally, error);
    return status == PW_OK ? sweep_conclude (&sweep->tally, error) : status;
  }
  if (status == PW_OK) status = sweep_open (sweep, error);
  if (status == PW_OK) status = rows_compute (&sweep->plan, &sweep->journal, sweep->jobs, error);
  if (status == PW_OK) status = sweep_finish (sweep, error);
  pw_journal_close (&sweep->journal);
  plan_close (&sweep->plan);
  return status;
}

static const struct poptOption sweep_options[] = {
  PW_OPTION_GROUP ("Sweep"),
  PW_LIST_OPTION (pw_sweep, ranges, "vary", 'v', "NAME=RANGE",
                  "Vary a parameter or an initial value such as frame.vx; repeatable, the last one varies fastest. "
                  "RANGE: LOW:HIGH[:COUNT][:log], 11 values if no COUNT is given, or a list V1,V2,..."),
  PW_LIST_OPTION (pw_sweep, plan.of, "of", 0, "OUTPUT", "Add a column: " PW_OUTPUT_HELP "; repeatable"),
  PW_RESULTS_OPTIONS ("Write the table", "Write a summary",
                      "Draw the outputs, or the states, as curves over one varied quantity or as maps over two,"),
  PW_JOBS_OPTION ("Number of threads (default: one per processor)"),
  PW_TEXT_OPTION (pw_sweep, lanes_text, "lanes", 0, "N",
                  "Runs that a thread advances at once, " SWEEP_LANES ", with steps of fixed size and specialised code "
                  "(default: as many as are worthwhile)"),
  PW_TEXT_OPTION (pw_sweep, part_text, "part", 0, "I/N",
                  "Compute every N-th row, from the I-th on, for a later --merge"),
  PW_FLAG_OPTION (pw_sweep, merge, "merge", "Merge the parts of a sweep: the arguments are their files"),
  PW_FLAG_OPTION (pw_sweep, plan.with_error, "error",
                  "Add the stated errors of the final states, from repetitions as by `pinwheel run --error`"),
  PW_FLAG_OPTION (pw_sweep, plan.with_cpu, "cpu",
                  "Add a column with the processor time of each run, which is never reproducible"),
  PW_METHOD_OPTIONS,
  PW_UNTIL_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_sweep = {
  .name = "sweep",
  .synopsis = "MODEL --vary NAME=RANGE... -o FILE.csv [OPTION...]",
  .summary = "tabulate runs for all combinations of varied parameters",
  .any_arguments = 1, /* --merge takes several */
  .help =
      "Run a model for all combinations of varied parameters and initial values, and write a table with one row per "
      "run. A sweep that was interrupted is continued by the same command. A sweep may be divided into parts, which "
      "`pinwheel sweep --merge PART... -o FILE.csv` puts together.",
  .options_size = sizeof (pw_sweep),
  .function = sweep_command,
  .options = sweep_options,
};
