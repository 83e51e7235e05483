/* The command `sensitivity`: derivatives of outputs of a run with respect to parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "unknowns.h"

enum {
  SENSITIVITY_DIGITS = 9,   /* of numbers in the text */
  SENSITIVITY_UNIT = 64,    /* longest unit, its end included */
  SENSITIVITY_NAME = 10000, /* likewise the name of a column of the table; longer names are cut off */
  SENSITIVITY_ROWS = 1000,  /* of the table after the first, unless --every is given */
  SENSITIVITY_RUNS = 14     /* usual number of runs for an unknown: for the progress, and the choice of the engine */
};

typedef struct {
  pw_cli_line line;
  const char **by; /* of --by, ended by NULL */
  const char **of; /* of --of, ended by NULL */
  pw_cli_given every;
  pw_unknowns unknowns;   /* P of them */
  pw_run_outputs outputs; /* method NULL: the run itself; set by sensitivity_prepare for the runs that are compared */
  int jobs;               /* threads */
  pw_progress progress;
  pthread_mutex_t lock; /* of the number of runs and the progress */
  int runs;
  double cpu; /* processor time of the computation [s] */
  /* results; comments on arrays begin with their sizes */
  pw_outcomes outcomes;      /* types and units of the outputs, not their values */
  double *value;             /* outputs: of the run by the method of the unknowns */
  double *table;             /* outputs x rows; NaN for outputs that are not in the table */
  pw_derivative *derivative; /* P x (outputs + outputs x rows): of the outputs, then of the table */
} sensitivity;

static const double SENSITIVITY_RTOL = 1e-12, /* of the runs that are compared */
    SENSITIVITY_PROBE = 1e-5;                 /* change that shows what an unknown changes, relative to its size */

/* Opens the neighbours on both sides.  Refuses a parameter that changes the number of bodies or elements, and an
 * initial value that the constraints determine: making a neighbour consistent moves it by more than 1 % of the step.  A
 * neighbour that cannot be opened is no error here: the differences use the other side. */
static int sensitivity_check (const sensitivity *cmd, const double *values, int p, pw_error *error) {
  const pw_unknowns *u = &cmd->unknowns;
  const pw_unknown *unknown = &u->list[p];
  const pw_system *s = cmd->outcomes.system;
  const int n = pw_system_coordinates (s);
  const double step = SENSITIVITY_PROBE * unknown->size;
  int status = PW_OK;
  double *x = malloc ((size_t)u->count * sizeof *x);
  if (x == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  memcpy (x, values, (size_t)u->count * sizeof *x);
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    pw_unknown_run run = { .run = NULL };
    pw_error own = { 0 };
    x[p] = values[p] + side * step;
    const int opened = pw_unknown_run_open (&run, u, x, &own);
    if (opened == PW_RESOURCE) status = pw_fail (error, opened, "%s", own.text);
    const pw_system *other = run.m.system;
    if (opened == PW_OK &&
        (pw_system_elements (s) != pw_system_elements (other) ||
         pw_system_coordinates (s) != pw_system_coordinates (other) || pw_system_rows (s) != pw_system_rows (other)))
      status = pw_fail (error, PW_INPUT,
                        "%s changes the number of bodies or elements: derivatives with respect to it do not exist",
                        unknown->name);
    else if (opened == PW_OK && unknown->state >= 0) {
      const pw_initial_report *initial = pw_run_initial (run.run);
      double value = unknown->state < n ? initial->q[unknown->state] : initial->v[unknown->state - n];
      if (fabs (value - values[p] - side * step) > 0.01 * step)
        status = pw_fail (error, PW_INPUT,
                          "--by %s: it cannot change while the other initial values of --by and --start are kept: "
                          "constraints determine it",
                          unknown->name);
    }
    pw_unknown_run_close (&run);
  }
  free (x);
  return status;
}

/* pw_difference_settings.evaluate: the outputs, then the table, as one array. */
static int sensitivity_evaluate (void *context, const double *x, double rtol, double *value, pw_error *error) {
  sensitivity *cmd = context;
  pw_run_outputs outputs = cmd->outputs;
  outputs.rtol = rtol;
  int status = pw_run_outputs_at (&outputs, x, value, value + outputs.count, error);
  pthread_mutex_lock (&cmd->lock);
  pw_progress_at (&cmd->progress, fmin (++cmd->runs, cmd->progress.last));
  pthread_mutex_unlock (&cmd->lock);
  return status;
}

static int sensitivity_differentiate (sensitivity *cmd, const double *values, pw_error *error) {
  const pw_unknowns *u = &cmd->unknowns;
  const int outputs = cmd->outputs.count * (1 + cmd->outputs.rows);
  cmd->derivative = pw_arena_alloc (&cmd->line.arena, (size_t)u->count * (size_t)outputs * sizeof *cmd->derivative);
  if (cmd->derivative == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const pw_difference_settings d = { .evaluate = sensitivity_evaluate,
                                     .context = cmd,
                                     .outputs = outputs,
                                     .steering = cmd->outputs.count,
                                     .rtol = SENSITIVITY_RTOL,
                                     .neighbours = 6,
                                     .jobs = cmd->jobs };
  return pw_unknowns_differentiate (u, values, d, cmd->derivative, error);
}

/* Sets the typical size of an unknown: |value|, but at least 0.1 rad for angles and the unit of the scene for states;
 * for a parameter that is 0 its default value, or 1 if that is 0, too. */
static void sensitivity_measure (pw_unknown *u, double value, const pw_run *r) {
  double size = fabs (value), length = pw_run_scale (r)->length, time = pw_run_scale (r)->time;
  if (strcmp (u->unit, "rad") == 0) size = fmax (size, 0.1);
  if (u->state >= 0) size = fmax (size, (*u->unit == 'm' ? length : 1) / (strchr (u->unit, 's') ? time : 1));
  if (size == 0 && u->parameter) size = fabs (u->parameter->value);
  u->size = size > 0 ? size : 1;
}

/* Chooses the method of the runs that are compared, and measures the sizes of the unknowns. */
static int sensitivity_prepare (sensitivity *cmd, const double *values, pw_error *error) {
  const pw_unknowns *u = &cmd->unknowns;
  pw_unknown_run run;
  int status = pw_unknown_run_open (&run, u, values, error);
  for (int p = 0; p < u->count && status == PW_OK; p++) sensitivity_measure (&u->list[p], values[p], run.run);
  if (status == PW_OK) {
    cmd->outputs.method =
        pw_accurate_method (run.m.system, &run.settings, u->settings.span, &cmd->outputs.max_steps, error);
    if (cmd->outputs.method == NULL && error->status == PW_OK)
      status = pw_stop
                   ? PW_RETRY
                   : pw_fail (error, PW_METHOD,
                              "the limit of %s s of processor time is reached while the method of the derivatives is "
                              "chosen (--limit)",
                              PW_DIGITS (run.limit.seconds, 6));
    else if (cmd->outputs.method == NULL)
      status = error->status;
  }
  pw_unknown_run_close (&run);
  return status;
}

/* Makes the run, and differentiates the outputs at the values of the unknowns.  Errors: those of the run; PW_INPUT if
 * constraints determine an initial value, or a parameter changes the number of bodies; PW_METHOD if an output is not
 * finite at the end; PW_RETRY after Ctrl-C. */
static int sensitivity_solve (sensitivity *cmd, pw_error *error) {
  const pw_unknowns *u = &cmd->unknowns;
  const size_t count = (size_t)cmd->outputs.count, rows = (size_t)cmd->outputs.rows;
  double *values = pw_arena_alloc (&cmd->line.arena, (size_t)u->count * sizeof *values);
  cmd->value = pw_arena_alloc (&cmd->line.arena, count * (1 + rows) * sizeof *cmd->value);
  if (values == NULL || cmd->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  cmd->table = cmd->value + count;
  for (int p = 0; p < u->count; p++) values[p] = u->list[p].value;
  int status = pw_outcomes_open (&cmd->outcomes, cmd->line.m.system, cmd->outputs.option, cmd->outputs.of,
                                 cmd->outputs.count, cmd->line.until, error);
  if (status == PW_OK) pw_outcomes_report (&cmd->outcomes);
  if (status == PW_OK) status = pw_run_outputs_at (&cmd->outputs, values, cmd->value, cmd->table, error);
  if (status == PW_OK) status = sensitivity_prepare (cmd, values, error);
  for (int p = 0; p < u->count && status == PW_OK; p++) status = sensitivity_check (cmd, values, p, error);
  for (int i = 0; i < cmd->outputs.count && status == PW_OK; i++)
    if (!isfinite (cmd->value[i]))
      status = pw_fail (error, PW_METHOD, "%.300s is not a finite number at the end of the run", cmd->outputs.of[i]);
  if (status != PW_OK) return status;
  pthread_mutex_init (&cmd->lock, NULL);
  status = sensitivity_differentiate (cmd, values, error);
  pthread_mutex_destroy (&cmd->lock);
  return status;
}

/* The derivative of an output, or of its value in a row of the table, with respect to an unknown; row -1: output. */
static const pw_derivative *sensitivity_of (const sensitivity *cmd, int output, int unknown, int row) {
  const int count = cmd->outputs.count, rows = cmd->outputs.rows;
  const pw_derivative *of = cmd->derivative + unknown * count * (1 + rows);
  return of + (row < 0 ? output : count + output * rows + row);
}

/* The unit of a derivative, "m per kg"; "" if it has none, or the output is a formula, whose unit is unknown. */
static const char *sensitivity_unit (const sensitivity *cmd, int output, int unknown, char unit[SENSITIVITY_UNIT]) {
  char of[SENSITIVITY_UNIT / 2];
  const char *by = cmd->unknowns.list[unknown].unit;
  pw_outcome_unit (&cmd->outcomes, output, of, sizeof of);
  if (cmd->outcomes.outcome[output].formula) return strcpy (unit, "");
  snprintf (unit, SENSITIVITY_UNIT, *by ? "%s per %s" : "%s", *of || *by == 0 ? of : "1", by);
  return unit;
}

/* The relative change of the output per relative change of the unknown; NaN: there is none. */
static double sensitivity_elasticity (const sensitivity *cmd, int output, int unknown) {
  const double largest = 1e12, /* elasticities above it are those of an output that is 0 but for round-off */
      value = cmd->unknowns.list[unknown].value,
               elasticity = sensitivity_of (cmd, output, unknown, -1)->value * value / cmd->value[output];
  return value == 0 || !(fabs (elasticity) < largest) ? NAN : elasticity;
}

/* Why there is no derivative, in the buffer, which is returned. */
static const char *sensitivity_reason (const pw_unknown *u, const pw_derivative *d, char *text, size_t size) {
  if (d->type == PW_NO_DERIVATIVE)
    snprintf (text, size, "no derivative at %s = %.9g: %.5g from below, %.5g from above", u->name, u->value,
              fabs (d->below) < 1e-6 * fabs (d->above) ? 0 : d->below,
              fabs (d->above) < 1e-6 * fabs (d->below) ? 0 : d->above);
  else
    snprintf (text, size, "unknown by %s: no step of the differences of runs gives a digit of the derivative", u->name);
  return text;
}

static void sensitivity_print_row (const sensitivity *cmd, pw_table *table, int output, int unknown) {
  char unit[SENSITIVITY_UNIT];
  const pw_unknown *u = &cmd->unknowns.list[unknown];
  const pw_derivative *d = sensitivity_of (cmd, output, unknown, -1);
  pw_cell_unit (table, -14, u->name, u->unit);
  pw_cell_number (table, 12, u->value, SENSITIVITY_DIGITS);
  pw_cell (table, 12,
           d->type == PW_NO_DERIVATIVE ? "none"
           : d->type == PW_UNKNOWN     ? "unknown"
                                       : PW_DIGITS (d->value, SENSITIVITY_DIGITS));
  pw_cell (table, -8, sensitivity_unit (cmd, output, unknown, unit));
  pw_cell_number (table, 12, d->error, 2);
  pw_cell_number (table, 12, sensitivity_elasticity (cmd, output, unknown), 5);
  pw_row_end (table);
}

/* 1 if the derivative is not known; or if its error exceeds 1 % of it and matters: the error times the size of the
 * unknown exceeds 1 % of the output, and 1e-6 in SI units. */
static int sensitivity_is_uncertain (const sensitivity *cmd, int output, int unknown) {
  const pw_derivative *d = sensitivity_of (cmd, output, unknown, -1);
  if (d->type != PW_DERIVATIVE) return d->type == PW_UNKNOWN;
  return d->error > 0.01 * fabs (d->value) &&
         d->error * cmd->unknowns.list[unknown].size > fmax (0.01 * fabs (cmd->value[output]), 1e-6);
}

static void sensitivity_print (const sensitivity *cmd) {
  const pw_unknowns *u = &cmd->unknowns;
  char unit[SENSITIVITY_UNIT], reason[500], list[1000] = "";
  size_t used = 0;
  printf ("%s by %s to t = %.9g s\n", pw_file_name (cmd->line.m.file), u->method, u->settings.span);
  for (int o = 0; o < cmd->outputs.count; o++) {
    pw_outcome_unit (&cmd->outcomes, o, unit, sizeof unit);
    pw_cli_print (stdout, "\n%s = %s %s\n", cmd->outputs.of[o], PW_DIGITS (cmd->value[o], 12), unit);
    for (pw_table table = { 0 }; pw_table_pass (&table);) {
      pw_cell (&table, -14, "by");
      pw_cell (&table, 12, "value");
      pw_cell (&table, 12, "derivative");
      pw_cell (&table, -8, "unit");
      pw_head (&table, 12, 12, (const char *[]){ "error", "elasticity", NULL });
      for (int p = 0; p < u->count; p++) sensitivity_print_row (cmd, &table, o, p);
    }
    for (int p = 0; p < u->count; p++) {
      const pw_derivative *d = sensitivity_of (cmd, o, p, -1);
      if (d->type != PW_DERIVATIVE)
        pw_cli_print (stdout, "  %s\n", sensitivity_reason (&u->list[p], d, reason, sizeof reason));
    }
  }
  for (int o = 0; o < cmd->outputs.count; o++)
    for (int p = 0; p < u->count && used < sizeof list; p++)
      if (sensitivity_is_uncertain (cmd, o, p))
        used += (size_t)snprintf (list + used, sizeof list - used, "%s%s by %s", used ? ", " : "", cmd->outputs.of[o],
                                  u->list[p].name);
  if (used) pw_cli_say ("pinwheel: derivatives with errors above 1 %%: %s%s\n", list, used < sizeof list ? "" : " ...");
}

static void sensitivity_json (const void *context, pw_json *j) {
  const sensitivity *cmd = context;
  char unit[SENSITIVITY_UNIT], reason[500];
  pw_json_print (j, "{model: %s, method: %s, derivatives_by: %s, t_end: %g, complete: %i, cpu_seconds: %g, outputs: [",
                 pw_file_name (cmd->line.m.file), cmd->unknowns.method, cmd->outputs.method,
                 cmd->unknowns.settings.span, 1, cmd->cpu);
  for (int o = 0; o < cmd->outputs.count; o++) {
    pw_json_print (j, "{output: %s, unit: %s, value: %g, derivatives: [", cmd->outputs.of[o],
                   pw_outcome_unit (&cmd->outcomes, o, unit, sizeof unit), cmd->value[o]);
    for (int p = 0; p < cmd->unknowns.count; p++) {
      const pw_unknown *u = &cmd->unknowns.list[p];
      const pw_derivative *d = sensitivity_of (cmd, o, p, -1);
      pw_json_print (j, "{by: %s, value: %g, unit: %s, derivative: %g, error: %g, elasticity: %g", u->name, u->value,
                     sensitivity_unit (cmd, o, p, unit), d->value, d->error, sensitivity_elasticity (cmd, o, p));
      if (d->type != PW_DERIVATIVE) pw_json_text (j, "reason", sensitivity_reason (u, d, reason, sizeof reason));
      pw_json_close (j, '}');
    }
    pw_json_print (j, "]}");
  }
  pw_json_print (j, "]}");
}

static void sensitivity_csv (const void *context, pw_cells *t) {
  const sensitivity *cmd = context;
  char unit[SENSITIVITY_UNIT];
  pw_cells_text (t, "t [s]");
  for (int o = 0; o < cmd->outputs.count; o++) {
    if (!pw_outcome_is_final (&cmd->outcomes, o)) continue;
    pw_cells_name (t, cmd->outputs.of[o], pw_outcome_unit (&cmd->outcomes, o, unit, sizeof unit));
    for (int p = 0; p < cmd->unknowns.count; p++)
      pw_cells_name (t, PW_PRINTED (SENSITIVITY_NAME, "d(%s)/d(%s)", cmd->outputs.of[o], cmd->unknowns.list[p].name),
                     sensitivity_unit (cmd, o, p, unit));
  }
  pw_cells_end (t);
  for (int i = 0; i < cmd->outputs.rows; i++) {
    pw_cells_number (t, cmd->outputs.t[i]);
    for (int o = 0; o < cmd->outputs.count; o++) {
      if (!pw_outcome_is_final (&cmd->outcomes, o)) continue;
      pw_cells_number (t, cmd->table[o * cmd->outputs.rows + i]);
      for (int p = 0; p < cmd->unknowns.count; p++) pw_cells_number (t, sensitivity_of (cmd, o, p, i)->value);
    }
    pw_cells_end (t);
  }
}

/* Draws the derivatives along the run, times the value of the unknown unless that is 0, so that unknowns can be
 * compared. */
static void sensitivity_draw (const void *context, pw_curves *c) {
  const sensitivity *cmd = context;
  const pw_unknowns *u = &cmd->unknowns;
  if (cmd->outputs.rows < 2) return;
  for (int o = 0; o < cmd->outputs.count; o++) {
    char label[300], unit[SENSITIVITY_UNIT], buffer[FIGURE_NAME + 4];
    pw_curves_panel (c, &(pw_panel){ .x_label = "t [s]",
                                     .y_label = PW_FIGURE_LABEL (cmd->outputs.of[o], ""),
                                     .x[1] = u->settings.span });
    for (int p = 0; p < u->count; p++) {
      const double value = u->list[p].value, factor = value != 0 ? value : 1;
      const char *name = pw_figure_name (u->list[p].name, buffer), *times = value != 0 ? name : "";
      value != 0 ? pw_outcome_unit (&cmd->outcomes, o, unit, sizeof unit) : sensitivity_unit (cmd, o, p, unit);
      snprintf (label, sizeof label, *unit ? "%s%s∂/∂%s [%s]" : "%s%s∂/∂%s", times, *times ? " × " : "", name, unit);
      pw_curves_add (c, "line", label);
      for (int i = 0; i < cmd->outputs.rows; i++)
        pw_curves_point (c, cmd->outputs.t[i], sensitivity_of (cmd, o, p, i)->value * factor, 0);
    }
  }
}

static const pw_results sensitivity_results = {
  .name = "sensitivity",
  .title = "derivatives along the run",
  .takes_folder = 1,
  .lines = 5,
  .table = sensitivity_csv,
  .json = sensitivity_json,
  .draw = sensitivity_draw,
};

/* Sets the values of unknown initial states to those of the consistent initial state. */
static int sensitivity_start (pw_unknowns *u, pw_error *error) {
  pw_unknowns none = *u;
  pw_unknown_run run;
  none.count = 0, none.engine.code = NULL;
  int status = pw_unknown_run_open (&run, &none, NULL, error);
  for (pw_unknown *x = u->list; x < u->list + u->count && status == PW_OK; x++)
    if (x->state >= 0) x->value = pw_cli_state_change (run.m.system, pw_run_initial (run.run), x->state).consistent;
  pw_unknown_run_close (&run);
  return status;
}

static int sensitivity_open (sensitivity *cmd, pw_error *error) {
  double every = cmd->every.number;
  int status = pw_cli_open (&cmd->line, error);
  if (status == PW_OK) status = pw_unknowns_open (&cmd->unknowns, &cmd->line, error);
  if (status == PW_OK) status = pw_unknowns_engine (&cmd->unknowns, SENSITIVITY_RUNS, 1, error);
  cmd->jobs = pw_parallel_jobs (&cmd->line);
  if (status == PW_OK)
    status = pw_cli_requires ("--every", cmd->every.text, "-o FILE", cmd->line.table || cmd->line.plots, error);
  if (status != PW_OK) return status;
  if (cmd->by == NULL) return pw_fail (error, PW_INPUT, "--by is missing: expected a parameter or an initial value");
  if (cmd->of == NULL) return pw_fail (error, PW_INPUT, "--of is missing: expected an output, such as frame.x");
  if (strstr (cmd->unknowns.method, ":inputs=held"))
    return pw_fail (error, PW_INPUT, "derivatives need inputs=stage: held inputs depend on the steps");
  cmd->outputs.unknowns = &cmd->unknowns, cmd->outputs.option = "--of", cmd->outputs.of = cmd->of;
  while (cmd->of[cmd->outputs.count]) cmd->outputs.count++;
  if (cmd->line.until && cmd->every.text)
    return pw_fail (error, PW_INPUT, "--every cannot be given together with --until: there is no table");
  if ((cmd->line.table || cmd->line.plots) &&
      !cmd->line.until) { /* the table has rows from 0 to the end, whose times must not vary */
    const double t_end = cmd->unknowns.settings.span;
    if (every == 0) every = t_end / SENSITIVITY_ROWS;
    const double count = ceil (t_end / every * (1 - 1e-12)); /* the factor: no row a round-off before t_end */
    if (count > 1e7) return pw_fail (error, PW_INPUT, "--every %g: expected at most 1e7 rows", every);
    double *t = pw_arena_alloc (&cmd->line.arena, ((size_t)count + 2) * sizeof *t);
    if (t == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
    for (int i = 0; i < (int)count; i++) t[i] = i * every;
    t[(int)count] = t_end;
    cmd->outputs.t = t, cmd->outputs.rows = (int)count + 1;
  }
  status = pw_unknowns_read (&cmd->unknowns, "--by", cmd->by, error);
  return status == PW_OK ? sensitivity_start (&cmd->unknowns, error) : status;
}

static int sensitivity_command (void *options, pw_error *error) {
  sensitivity *cmd = options;
  int status = sensitivity_open (cmd, error);
  if (status == PW_OK)
    status = pw_results_open (&cmd->line, &sensitivity_results, cmd->line.until ? NULL : pw_cli_tables, (pw_use){ 0 },
                              error);
  if (status == PW_OK) pw_report_model (&cmd->line.m);
  if (status == PW_OK) status = pw_report_initial_state (&cmd->line.m, cmd->unknowns.limit, error);
  if (status == PW_OK) {
    const double start = pw_seconds (CLOCK_PROCESS_CPUTIME_ID);
    pw_stop_catch ();
    pw_progress_start (&cmd->progress, pw_file_name (cmd->line.m.file), "runs", 0,
                       SENSITIVITY_RUNS * cmd->unknowns.count);
    status = sensitivity_solve (cmd, error);
    pw_progress_end (&cmd->progress);
    pw_stop_release ();
    cmd->cpu = pw_seconds (CLOCK_PROCESS_CPUTIME_ID) - start;
  }
  if (status == PW_OK) sensitivity_print (cmd);
  if (status == PW_OK) status = pw_results_write (&cmd->line, &sensitivity_results, cmd, error);
  pw_outcomes_close (&cmd->outcomes);
  pw_unknowns_close (&cmd->unknowns);
  return status == PW_RETRY ? pw_cli_incomplete (&cmd->line, error) : status;
}

static const struct poptOption sensitivity_options[] = {
  PW_OPTION_GROUP ("Sensitivity"),
  PW_LIST_OPTION (sensitivity, of, "of", 0, "OUTPUT", "Differentiate " PW_OUTPUT_HELP "; repeatable"),
  PW_LIST_OPTION (sensitivity, by, "by", 0, "NAME",
                  "A parameter, or the initial value of a state, such as body.vx; repeatable"),
  PW_NUMBER_OPTION (sensitivity, every, "every", 0, "DT", PW_POSITIVE,
                    "Time between rows of the table [s] (default a thousandth of the final time)"),
  PW_RESULTS_OPTIONS ("Write outputs and derivatives along the run as a table", "Write the results",
                      "Draw a figure of the table"),
  PW_JOBS_OPTION ("Number of concurrent runs (default: one per processor)"),
  PW_METHOD_OPTIONS,
  PW_UNTIL_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_sensitivity = {
  .name = "sensitivity",
  .synopsis = "MODEL --of OUTPUT --by NAME [OPTION...]",
  .summary = "differentiate outputs of a run with respect to parameters and initial values",
  .help = "Differentiate outputs of a run with respect to parameters and initial values, at the end and along the run, "
          "by differences of accurate runs at neighbouring values, whatever the method of the run, with an error that "
          "the true one should not exceed.",
  .options_size = sizeof (sensitivity),
  .function = sensitivity_command,
  .options = sensitivity_options,
};
