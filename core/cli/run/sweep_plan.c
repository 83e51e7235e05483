/* The plan of a sweep: the grid of its rows, the columns of its table, its fingerprint; the journal of its rows, and
 * the table made of it. */
#define _GNU_SOURCE /* asprintf */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include "sweep.h"

enum { PLAN_TRIES = 1000 }; /* failures to build a model after which no other values are tried */

static int axis_fail (const pw_axis *axis, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: %s", axis->name, axis->text, why);
}

/* "NAME=V1,V2,..." or "NAME=LOW:HIGH[:COUNT][:log]" */
int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error) {
  *axis = (pw_axis){ .name = pw_arena_copy (arena, text) };
  if (axis->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  char *equals = strchr (axis->name, '=');
  if (equals == NULL || equals == axis->name || equals[1] == 0)
    return pw_fail (error, PW_INPUT, "--vary %.200s: expected NAME=LOW:HIGH[:COUNT][:log] or a list NAME=V1,V2,...",
                    text);
  *equals = 0, axis->text = equals + 1;
  if (axis->text[pw_cli_part (axis->text, ':')]) {
    if (pw_cli_range ("--vary", text, &axis->range, error) != PW_OK) return error->status;
    const int one = axis->range.low == axis->range.high;
    axis->count = axis->range.count ? axis->range.count : one ? 1 : PW_AXIS_VALUES;
    if ((double)axis->count > PW_GRID_MAX_ROWS) return axis_fail (axis, "too many values: at most 1e8 rows", error);
    if (axis->count == 1 && !one)
      return axis_fail (axis, "a range with two different ends needs at least 2 values", error);
    return PW_OK;
  }
  axis->count = 1;
  for (const char *c = axis->text; c[pw_cli_part (c, ',')]; axis->count++) c += pw_cli_part (c, ',') + 1;
  axis->value = pw_arena_alloc (arena, (size_t)axis->count * sizeof *axis->value);
  if (axis->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const char *c = axis->text;
  for (long i = 0; i < axis->count; i++, c += pw_cli_part (c, ',') + 1) {
    const size_t size = pw_cli_part (c, ',');
    const char *part = PW_PRINTED (100, "%.*s", (int)(size < 99 ? size : 99), c);
    if (pw_read_expression (part, &axis->value[i]) != PW_OK || !isfinite (axis->value[i]))
      return axis_fail (axis, PW_PRINTED (240, "\"%s\" is not a finite number%s", part, PW_NUMBER_HINT (part)), error);
  }
  return PW_OK;
}

/* The ends are exact.  Values between them are divided only once, so that they are rounded as little as possible: the
 * fourth value of 0:1:11 is 0.3. */
double pw_axis_value (const pw_axis *axis, long i) {
  if (axis->value) return axis->value[i];
  const double low = axis->range.low, high = axis->range.high, last = (double)(axis->count - 1), k = (double)i;
  if (i == 0 || low == high) return low;
  if (i == axis->count - 1) return high;
  if (axis->range.logarithmic) return pow (10, (log10 (low) * (last - k) + log10 (high) * k) / last);
  double value = (low * (last - k) + high * k) / last;
  if (isfinite (value)) return value;
  return low / last * (last - k) + high / last * k; /* the products were too large */
}

double pw_grid_value (const pw_grid *grid, int i, long row) {
  const pw_axis *axis = grid->axis + i;
  return pw_axis_value (axis, row / axis->stride % axis->count);
}

/* Initial values vary fastest, then parameters; the order among initial values and among parameters is the table's. */
long pw_grid_scheduled_row (const pw_grid *grid, long k) {
  long row = 0;
  for (int parameters = 0; parameters < 2; parameters++)
    for (const pw_axis *axis = grid->axis + grid->axes; axis-- > grid->axis;) {
      if ((axis->parameter != NULL) != parameters) continue;
      row += k % axis->count * axis->stride;
      k /= axis->count;
    }
  return row;
}

long pw_grid_parameter_index (const pw_grid *grid, long row) {
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
  if (status == PW_OK && rows > PW_GRID_MAX_ROWS)
    status =
        pw_fail (error, PW_INPUT, "the grid has %.15g rows: at most 1e8; use coarser ranges, or several sweeps", rows);
  grid->rows = 1;
  for (int i = grid->axes - 1; i >= 0 && status == PW_OK; i--) {
    grid->axis[i].stride = grid->rows;
    grid->rows *= grid->axis[i].count;
  }
  return status;
}

int pw_plan_compile (const pw_plan *plan, long row, pw_cli_model *compiled, pw_error *error) {
  pw_model *model = pw_file_model (plan->line->m.file, error);
  *compiled = (pw_cli_model){ .model = model };
  int status = model ? pw_cli_apply (plan->line, model, error) : error->status;
  for (int i = 0; i < plan->grid.axes && status == PW_OK; i++) /* varied initial values are set when the run begins */
    if (plan->grid.axis[i].parameter)
      status = pw_model_set (model, plan->grid.axis[i].name, pw_grid_value (&plan->grid, i, row), error);
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
    int status = copy && unit ? PW_OK : PW_RESOURCE;
    if (status == PW_OK && (size_t)plan->columns == plan->column_room) { /* a larger hash table is filled anew */
      status = pw_grow (&plan->column, (size_t)plan->columns, &plan->column_room, sizeof *plan->column);
      pw_names_close (&plan->column_of);
      if (status == PW_OK) status = pw_names_open (&plan->column_of, plan->column_room);
      for (int k = 0; status == PW_OK && k < plan->columns; k++)
        pw_names_add (&plan->column_of, plan->column[k].name, k);
    }
    if (status != PW_OK) return pw_fail (error, PW_RESOURCE, "out of memory");
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
                              PW_DIGITS (pw_grid_value (&plan->grid, (int)i, row), 6));
  if (status != PW_OK) pw_fail (error, status, "%.400s (in the run with %s)", own.text, run);
  for (int i = 0; i < plan->outputs && status == PW_OK; i++) {
    plan->output[i].is_known = pw_names_find (&plan->column_of, plan->of[i]) >= 0 || strcmp (plan->of[i], "t") == 0 ||
                               strcmp (plan->of[i], "kinetic") == 0;
    plan->output[i].name = plan->of[i];
    plan->output[i].unit = pw_arena_copy (&plan->arena, pw_outcome_unit (&set, i, unit, sizeof unit));
    if (plan->output[i].unit == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
  }
  plan->by_steps = set.extrema || set.integrals || plan->line->until;
  for (int i = 0; i < set.functionals; i++) plan->by_steps |= set.functional[i].type == PW_AT_TIME;
  pw_outcomes_close (&set);
  return status;
}

static int plan_scan_row (pw_plan *plan, long row, plan_scan *scan, pw_error *error) {
  pw_cli_model compiled;
  pw_error row_error = { 0 };
  int status = pw_plan_compile (plan, row, &compiled, &row_error);
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
    pw_cli_engine_open (&plan->engine, compiled.system, plan->specialise, steps);
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
  plan_cell (row, text, "t", "s", last ? last->t : run ? pw_run_time (run) : NAN);
  for (int i = 0; i < plan->columns; i++) {
    int state = last ? row->state[i] : -1, n = last ? row->coordinates : 0;
    plan_cell (row, text, plan->column[i].name, plan->column[i].unit,
               state < 0   ? NAN
               : state < n ? last->q[state]
                           : last->v[state - n]);
  }
  for (int i = 0; plan->with_error && i < plan->columns; i++) {
    const char *name = row ? NULL : PW_PRINTED (PW_NAME_BYTES + 10, "error.%s", plan->column[i].name);
    int known = row && row->error && row->state[i] >= 0;
    plan_cell (row, text, name, plan->column[i].unit, known ? row->error[row->state[i]] : NAN);
  }
  for (int i = 0; i < plan->outputs; i++)
    if (!plan->output[i].is_known)
      plan_cell (row, text, plan->output[i].name, plan->output[i].unit,
                 row && row->of ? pw_outcome_value (row->of, i) : NAN);
  plan_cell (row, text, "kinetic", "J", last ? last->kinetic : NAN);
  plan_cell (row, text, "residual.position", NULL, run ? statistics->position : NAN);
  plan_cell (row, text, "residual.velocity", NULL, run ? statistics->velocity : NAN);
  plan_cell (row, text, "steps", NULL, run ? (double)statistics->steps : NAN);
  plan_cell (row, text, "rhs", NULL, run ? (double)statistics->rhs : NAN);
  if (plan->with_cpu) plan_cell (row, text, "cpu", "s", row ? row->cpu : 0);
  row ? pw_text_quoted (text, row->reason) : pw_text_cell (text, "reason");
}

static int plan_fingerprint (pw_plan *plan, const pw_model *model, pw_error *error) {
  pw_text *text = &plan->fingerprint;
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
  pw_text order = { .chars = NULL }; /* of the axes, which determines the order of the rows */
  for (int i = 0; i < plan->grid.axes; i++) {
    pw_fingerprint_line (text, "vary", plan->grid.axis[i].name, plan->grid.axis[i].text);
    pw_text_cell (&order, plan->grid.axis[i].name);
  }
  text->failed |= order.failed;
  pw_fingerprint_line (text, "order", NULL, order.chars ? order.chars : "");
  pw_text_free (&order);
  pw_fingerprint_number (text, "rows", NULL, (double)plan->grid.rows);
  pw_fingerprint_line (text, "columns", NULL, plan->heading.chars ? plan->heading.chars : "");
  pw_fingerprint_line (text, "part", NULL, PW_PRINTED (60, "%d/%d", plan->part, plan->parts));
  pw_text_add (text, "end\n");
  if (text->failed || plan->heading.failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  return PW_OK;
}

int pw_plan_open (pw_plan *plan, const char **ranges, pw_error *error) {
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
  if (status == PW_OK) pw_plan_cells (plan, NULL, &plan->heading);
  if (status == PW_OK) status = plan_fingerprint (plan, model, error);
  pw_model_free (model);
  return status;
}

void pw_plan_close (pw_plan *plan) {
  free (plan->drawn);
  pw_cli_engine_close (&plan->engine);
  pw_scene_code_close (plan->lanes_code);
  pw_names_close (&plan->column_of);
  pw_arena_free (&plan->arena);
  pw_text_free (&plan->heading);
  pw_text_free (&plan->fingerprint);
  free (plan->column);
}

/* Journals and parts of a sweep, and the table made of them.
 *
 * A journal has rows in the order of completion, each appended by one write.  If the program is killed, the fingerprint
 * and complete lines remain, and perhaps an incomplete line.  The next start removes the first line that is incomplete
 * or damaged, and all after it, whose rows are computed again.  A lock excludes other processes; it ends with the
 * process.  The table is written under another name in the order of the grid and renamed, then the journal is removed:
 * if the program is killed in between, the same command finds the journal complete and writes the same bytes again.
 * The file of a part, which is written like a table, has the fingerprint and the lines of its journal in the order of
 * the grid.
 *
 *     pinwheel sweep 1              the fingerprint: lines "KEY = VALUE"
 *     ...
 *     part = 2/4
 *     end
 *     17 0 83c1f0a2 1.5,0.05,ok,... a row's number, its run's exit status, a checksum, its line of the table */

typedef struct {
  long row;         /* its number in the grid */
  int status;       /* exit status of the run */
  const char *text; /* the table's line, which ends with a newline */
  size_t text_size; /* bytes of that line, the newline included */
  size_t line_size; /* bytes of the journal's line, the newline included */
} journal_line;

/* A file in memory, read only, and not ended by 0. */
typedef struct {
  char *begin, *end;
} journal_map;

/* FNV-1a (Fowler, Noll, Vo) of a row's number, status and text. */
static uint32_t journal_line_checksum (long row, int status, const char *text, size_t size) {
  uint32_t h = 2166136261u;
  for (int i = 0; i < 32; i += 8) h = (h ^ (((uint32_t)row >> i) & 255)) * 16777619u;
  h = (h ^ (uint32_t)status) * 16777619u;
  for (size_t i = 0; i < size; i++) h = (h ^ (unsigned char)text[i]) * 16777619u;
  return h;
}

/* Reads the line that begins here; 0 if it is incomplete or damaged. */
static int journal_line_read (const char *begin, const char *end, journal_line *line) {
  const char *newline = begin < end ? memchr (begin, '\n', (size_t)(end - begin)) : NULL;
  char front[40]; /* up to the line of the table */
  int n = 0;
  unsigned long checksum;
  if (newline == NULL) return 0;
  snprintf (front, sizeof front, "%.*s", (int)(newline - begin < 39 ? newline - begin : 39), begin);
  if (sscanf (front, "%10ld %1d %8lx %n", &line->row, &line->status, &checksum, &n) != 3 || n == 0) return 0;
  line->text = begin + n;
  line->text_size = (size_t)(newline + 1 - line->text);
  line->line_size = (size_t)(newline + 1 - begin);
  return line->row >= 0 && line->status >= 0 && line->status <= 4 &&
         journal_line_checksum (line->row, line->status, line->text, line->text_size - 1) == (uint32_t)checksum;
}

static int journal_map_open (journal_map *map, int descriptor) {
  struct stat info;
  map->begin = map->end = "";
  if (fstat (descriptor, &info) != 0) return PW_RESOURCE;
  if (info.st_size == 0) return PW_OK;
  void *bytes = mmap (NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (bytes == MAP_FAILED) return PW_RESOURCE;
  map->begin = bytes;
  map->end = map->begin + info.st_size;
  return PW_OK;
}

static void journal_map_close (journal_map *map) {
  if (map->end > map->begin) munmap (map->begin, (size_t)(map->end - map->begin));
  *map = (journal_map){ NULL, NULL };
}

/* Appends a text to the journal, all or nothing. */
static int journal_write (pw_journal *journal, const char *text, size_t size, pw_error *error) {
  size_t done = 0;
  while (done < size) {
    ssize_t n = pwrite (journal->descriptor, text + done, size - done, journal->size + (off_t)done);
    if (n <= 0) {
      const char *why = n < 0 ? strerror (errno) : "nothing was written";
      int removed = done == 0 || ftruncate (journal->descriptor, journal->size) == 0;
      (void)removed; /* if not, the next start removes the incomplete line */
      return pw_fail (error, PW_RESOURCE, "cannot write %s: %s; the same command will continue after its %ld rows",
                      journal->path, why, journal->done);
    }
    done += (size_t)n;
  }
  journal->size += (off_t)size;
  return PW_OK;
}

/* Stores the offset of each row; stops at a line that is incomplete, damaged, a duplicate or of another part. */
static void journal_read_rows (pw_journal *journal, const pw_plan *plan, const journal_map *map, const char *at) {
  journal_line line;
  for (; journal_line_read (at, map->end, &line); at += line.line_size) {
    long k = line.row / plan->parts;
    if (line.row % plan->parts != plan->part - 1 || k >= journal->rows || journal->offset[k] != 0) break;
    journal->offset[k] = (off_t)(at - map->begin);
    journal->done++;
  }
  journal->size = (off_t)(at - map->begin);
}

/* Verifies that the journal is one of this sweep, and reads its rows; journal->size is where the next row goes. */
static int journal_read (pw_journal *journal, const pw_plan *plan, const journal_map *map, pw_error *error) {
  char difference[400];
  size_t size = (size_t)(map->end - map->begin), magic_size = strlen (PW_SWEEP_MAGIC);
  const char *rows = pw_fingerprint_end (PW_SWEEP_MAGIC, map->begin, map->end), *fingerprint = plan->fingerprint.chars;
  journal->size = 0;
  if (rows == NULL) { /* with an incomplete fingerprint there are no rows */
    if (memcmp (map->begin, PW_SWEEP_MAGIC, size < magic_size ? size : magic_size) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s exists and is not the journal of a sweep: remove it if it is not needed",
                    journal->path);
  }
  const pw_fingerprint there = { map->begin, rows, "there" };
  const pw_fingerprint here = { fingerprint, fingerprint + plan->fingerprint.length, "here" };
  if (pw_fingerprint_differ (there, here, NULL, difference, sizeof difference))
    return pw_fail (error, PW_INPUT,
                    "%.80s belongs to another sweep: %.300s; finish that one with its own command, or remove the file",
                    journal->path, difference);
  journal_read_rows (journal, plan, map, rows);
  return PW_OK;
}

static int journal_begin (pw_journal *journal, const pw_plan *plan, pw_error *error) {
  journal_map map;
  if (journal_map_open (&map, journal->descriptor) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", journal->path, strerror (errno));
  int status = journal_read (journal, plan, &map, error);
  off_t file_size = (off_t)(map.end - map.begin);
  journal_map_close (&map);
  if (status != PW_OK) return status;
  if (file_size > journal->size && ftruncate (journal->descriptor, journal->size) != 0)
    return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", journal->path, strerror (errno));
  journal->begun = journal->size == 0;
  return journal->begun ? journal_write (journal, plan->fingerprint.chars, plan->fingerprint.length, error) : PW_OK;
}

int pw_journal_open (pw_journal *journal, const pw_plan *plan, const char *path, pw_error *error) {
  long rows = plan->grid.rows / plan->parts + (plan->grid.rows % plan->parts >= plan->part);
  *journal = (pw_journal){ .descriptor = -1, .rows = rows };
  journal->table_path = pw_output_path (path, error);
  if (journal->table_path == NULL) return error->status;
  if (asprintf (&journal->path, "%s.part", journal->table_path) < 0) journal->path = NULL;
  journal->offset = calloc ((size_t)journal->rows + 1, sizeof *journal->offset);
  if (journal->path == NULL || journal->offset == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory for a sweep of %ld rows", journal->rows);
  journal->descriptor = pw_lock_path (journal->path, error);
  return journal->descriptor >= 0 ? journal_begin (journal, plan, error) : error->status;
}

int pw_journal_add (pw_journal *journal, const pw_plan *plan, long row, int status, const char *text, pw_error *error) {
  const off_t at = journal->size;
  const uint32_t checksum = journal_line_checksum (row, status, text, strlen (text));
  pw_text_clear (&journal->line);
  pw_text_add (&journal->line, PW_PRINTED (60, "%ld %d %08lx ", row, status, (unsigned long)checksum));
  pw_text_add (&journal->line, text);
  pw_text_add (&journal->line, "\n");
  if (journal->line.failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (journal_write (journal, journal->line.chars, journal->line.length, error) != PW_OK) return error->status;
  journal->offset[row / plan->parts] = at;
  journal->done++;
  return PW_OK;
}

void pw_journal_close (pw_journal *journal) {
  if (journal->begun && journal->done == 0 && journal->descriptor >= 0) unlink (journal->path);
  if (journal->descriptor >= 0) close (journal->descriptor);
  pw_text_free (&journal->line);
  free (journal->offset);
  free (journal->path);
  free (journal->table_path);
  *journal = (pw_journal){ .descriptor = -1 };
}

/* Reads the line of a row, and counts how its run ended; 0 if it is another line. */
static int table_read_row (const char *at, const char *end, long row, journal_line *line, pw_tally *tally) {
  if (!journal_line_read (at, end, line) || line->row != row) return 0;
  tally->rows++;
  if (line->status == 0 || tally->failed++ > 0) return 1;
  tally->status = line->status;
  /* the reason is the last cell and the only one in quotes, which are doubled inside */
  const char *c = line->text, *last = line->text + line->text_size - 2;
  while (c < last && !(c[0] == ',' && c[1] == '"')) c++;
  size_t n = 0;
  for (c += 2; c < last && n + 1 < sizeof tally->reason; c++) {
    tally->reason[n++] = *c;
    if (*c == '"') c++;
  }
  tally->reason[n] = 0;
  return 1;
}

/* Completes the file if there is no error so far, else removes it. */
static int table_close (pw_output *output, pw_error *error) {
  if (error->status == PW_OK) return pw_output_finish (output, error);
  pw_output_discard (output);
  return error->status;
}

int pw_plan_drawn (const pw_plan *plan) {
  return plan->outputs ? plan->outputs : plan->columns < PW_PLAN_DRAWN ? plan->columns : PW_PLAN_DRAWN;
}

/* The cell of a row, see pw_plan_cells, that contains what is drawn as number i. */
static int table_cell_of (const pw_plan *plan, int i) {
  const int states = plan->grid.axes + 2;
  int cell = states + plan->columns * (1 + plan->with_error);
  if (plan->outputs == 0) return states + i;
  for (int k = 0; k < (plan->output[i].is_known ? plan->outputs : i); k++) cell += !plan->output[k].is_known;
  if (!plan->output[i].is_known || strcmp (plan->output[i].name, "kinetic") == 0) return cell;
  const int state = pw_names_find (&plan->column_of, plan->output[i].name);
  return state < 0 ? states - 1 /* t */ : states + state;
}

static void table_keep (const pw_plan *plan, long row, const char *line) {
  const int count = pw_plan_drawn (plan);
  for (int i = 0; i < count; i++) {
    const char *cell = line;
    for (int k = table_cell_of (plan, i); k > 0; k--) cell += strcspn (cell, ",") + 1;
    double *value = &plan->drawn[row * count + i];
    if (pw_read_number (PW_PRINTED (60, "%.*s", (int)strcspn (cell, ","), cell), value) != PW_OK) *value = NAN;
  }
}

/* What table_write needs. */
typedef struct {
  const pw_journal *journal;
  const pw_plan *plan;
  const journal_map *map;
  pw_tally *tally;
} table_source;

static int table_write (const void *context, FILE *f, pw_error *error) {
  const table_source *x = context;
  const pw_plan *plan = x->plan;
  const int is_part = plan->parts > 1;
  fprintf (f, is_part ? "%s" : "%s\n", is_part ? plan->fingerprint.chars : plan->heading.chars);
  for (long k = 0; k < x->journal->rows; k++) {
    const char *at = x->map->begin + x->journal->offset[k];
    journal_line line;
    if (!table_read_row (at, x->map->end, plan->part - 1 + k * plan->parts, &line, x->tally))
      return pw_fail (error, PW_RESOURCE, "%s was changed by another program", x->journal->path);
    fwrite (is_part ? at : line.text, 1, is_part ? line.line_size : line.text_size, f);
    if (plan->drawn) table_keep (plan, k, line.text);
  }
  return PW_OK;
}

int pw_sweep_finish (pw_journal *journal, const pw_plan *plan, pw_tally *tally, pw_error *error) {
  journal_map map;
  pw_error failure = { 0 };
  *tally = (pw_tally){ .rows = 0 };
  if (journal_map_open (&map, journal->descriptor) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", journal->path, strerror (errno));
  pw_output *output = pw_output_open_as (journal->table_path, ".sorted", &failure);
  const table_source source = { journal, plan, &map, tally };
  if (output) pw_cli_write_table (journal->table_path, pw_output_stream (output), &source, table_write, &failure);
  if (output) table_close (output, &failure);
  journal_map_close (&map);
  if (failure.status != PW_OK)
    return pw_fail (error, failure.status, "%.300s; all rows are in %.150s, so the same command only has to sort them",
                    failure.text, journal->path);
  if (unlink (journal->path) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "%s is complete, but %s cannot be removed: %s", journal->table_path,
                  journal->path, strerror (errno));
}

typedef struct {
  const char *path;
  journal_map map;
  const char *first_row, *next_row; /* the lines of these rows */
  int number, parts;                /* part I of N */
} table_part;

static int table_open_part (table_part *part, const char *path, pw_error *error) {
  const char *reason;
  char text[40] = "";
  size_t size;
  FILE *f = pw_open_input (path, &reason);
  part->path = path;
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot open the part %s: %s", path, reason);
  int status = journal_map_open (&part->map, fileno (f)), why = errno;
  fclose (f);
  if (status != PW_OK) return pw_fail (error, PW_RESOURCE, "cannot read the part %s: %s", path, strerror (why));
  part->first_row = part->next_row = pw_fingerprint_end (PW_SWEEP_MAGIC, part->map.begin, part->map.end);
  const char *value = part->first_row ? pw_fingerprint_value (part->map.begin, part->first_row, "part", &size) : NULL;
  if (value) snprintf (text, sizeof text, "%.*s", (int)(size < 39 ? size : 39), value); /* sscanf needs its end */
  if (sscanf (text, "%9d/%9d", &part->number, &part->parts) != 2 || part->parts < 1 || part->number < 1 ||
      part->number > part->parts)
    return pw_fail (error, PW_INPUT, "%s is not a part of a sweep: parts are written by --part I/N", path);
  return PW_OK;
}

static int table_by_part (const void *a, const void *b) {
  return ((const table_part *)a)->number - ((const table_part *)b)->number;
}

/* Sorts the parts; they must be all those of one sweep, each of them once. */
static int table_match_parts (table_part *part, int count, pw_error *error) {
  char difference[400];
  for (int i = 1; i < count; i++) {
    const pw_fingerprint first = { part[0].map.begin, part[0].first_row, "in the first" };
    const pw_fingerprint second = { part[i].map.begin, part[i].first_row, "in the second" };
    if (pw_fingerprint_differ (first, second, "part", difference, sizeof difference))
      return pw_fail (error, PW_INPUT, "%.80s and %.80s are parts of different sweeps: %.300s", part[0].path,
                      part[i].path, difference);
    if (part[i].parts != part[0].parts)
      return pw_fail (error, PW_INPUT, "%.200s is one of %d parts, %.200s one of %d", part[0].path, part[0].parts,
                      part[i].path, part[i].parts);
  }
  qsort (part, (size_t)count, sizeof *part, table_by_part);
  for (int i = 0; i < count; i++) {
    if (i > 0 && part[i].number == part[i - 1].number)
      return pw_fail (error, PW_INPUT, "%.200s and %.200s are both part %d of %d", part[i - 1].path, part[i].path,
                      part[i].number, part[0].parts);
    if (part[i].number != i + 1) return pw_fail (error, PW_INPUT, "part %d of %d is missing", i + 1, part[0].parts);
  }
  if (count < part[0].parts) return pw_fail (error, PW_INPUT, "part %d of %d is missing", count + 1, part[0].parts);
  return PW_OK;
}

/* Writes the table from sorted parts: row r is the next one of part[r % count]. */
static int table_merge (table_part *part, int count, FILE *stream, pw_tally *tally, pw_error *error) {
  size_t size = 0;
  const char *rows_value = pw_fingerprint_value (part->map.begin, part->first_row, "rows", &size);
  const char *heading = pw_fingerprint_value (part->map.begin, part->first_row, "columns", &size);
  if (rows_value == NULL || heading == NULL)
    return pw_fail (error, PW_INPUT, "%s has no number of rows or no columns: it was changed", part->path);
  long rows = strtol (rows_value, NULL, 10);
  fwrite (heading, 1, size, stream);
  putc ('\n', stream);
  for (long r = 0; r < rows; r++) {
    table_part *source = part + r % count;
    journal_line line;
    if (!table_read_row (source->next_row, source->map.end, r, &line, tally))
      return pw_fail (error, PW_INPUT, "%s is not complete: row %ld is missing; finish that part first", source->path,
                      r + 1);
    fwrite (line.text, 1, line.text_size, stream);
    source->next_row += line.line_size;
  }
  for (int i = 0; i < count; i++)
    if (part[i].next_row != part[i].map.end)
      return pw_fail (error, PW_INPUT, "%s has too many rows: it was changed", part[i].path);
  return PW_OK;
}

int pw_sweep_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error) {
  *tally = (pw_tally){ .rows = 0 };
  pw_output *output = NULL;
  table_part *part = calloc ((size_t)count, sizeof *part);
  int status = part ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < count && status == PW_OK; i++) {
    const pw_use use[] = { { "-o", path, PW_WRITES, pw_cli_csv }, { "the part", parts[i], PW_READS, NULL } };
    status = pw_check_paths (use, 2, error);
    if (status == PW_OK) status = pw_cli_check_format (use, error);
    if (status == PW_OK) status = table_open_part (part + i, parts[i], error);
  }
  if (status == PW_OK) status = table_match_parts (part, count, error);
  if (status == PW_OK && (output = pw_output_open_as (path, ".sorted", error)) == NULL) status = error->status;
  if (output) table_merge (part, count, pw_output_stream (output), tally, error);
  if (output) status = table_close (output, error);
  for (int i = 0; part && i < count; i++) journal_map_close (&part[i].map);
  free (part);
  return status;
}
