/* The common part of compare and drift: reads --methods, performs the runs, writes tables and figures. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "study.h"

static int methods_add (pw_study *study, const char *name, pw_error *error) {
  const pw_method *integrator;
  int stabilisation, status = pw_method_parse (name, study->line.methods, &integrator, &stabilisation, error);
  if (status != PW_OK) return status;
  for (int i = 0; i < study->methods; i++)
    if (strcmp (study->method[i], name) == 0) return PW_OK;
  void *more = realloc (study->method, (size_t)(study->methods + 1) * sizeof *study->method);
  if (more == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  study->method = more;
  strcpy (study->method[study->methods++], name);
  return PW_OK;
}

/* Adds each stabilisation of an integrator, or this one; 1 if it has it. */
static int methods_add_stabilisations (pw_study *study, const pw_method *integrator, pw_nearest *stabilisation,
                                       pw_error *error) {
  int found = 0;
  for (const pw_stabilisation *s = integrator->stabilisations; error->status == PW_OK && s->name; s++) {
    if (stabilisation->sought) pw_nearest_try (stabilisation, s->name);
    if (stabilisation->sought && strcmp (stabilisation->sought, s->name) != 0) continue;
    methods_add (study, PW_PRINTED (STUDY_NAME, "%s+%s", integrator->name, s->name), error);
    found = 1;
  }
  return found;
}

/* Adds the methods of "all", "INTEGRATOR+all", "all+STABILISATION", or a method. */
static int methods_add_pattern (pw_study *study, char *pattern, pw_error *error) {
  char *tail = pattern + strcspn (pattern, "+:");
  int any_integrator = strncmp (pattern, "all+", 4) == 0 || strcmp (pattern, "all") == 0;
  const pw_method *const *const list[] = { pw_methods, study->line.methods };
  const pw_method *integrator;
  pw_nearest near = { .sought = any_integrator && *tail && strcmp (tail, "+all") != 0 ? tail + 1 : NULL }; /* or all */
  int found = 0;
  if (!any_integrator && strcmp (tail, "+all") != 0) return methods_add (study, pattern, error);
  *tail = 0;
  if (!any_integrator) {
    if (pw_method_parse (pattern, study->line.methods, &integrator, NULL, error) == PW_OK)
      methods_add_stabilisations (study, integrator, &near, error);
    return error->status;
  }
  for (int l = 0; l < 2; l++)
    for (const pw_method *const *m = list[l]; m && *m; m++)
      found |= methods_add_stabilisations (study, *m, &near, error);
  if (error->status != PW_OK || found) return error->status;
  return pw_fail (error, PW_INPUT, "--methods all+%.60s: no integrator has this stabilisation%s", near.sought,
                  pw_nearest_text (&near));
}

static int methods_add_list (pw_study *study, const char *text, pw_error *error) {
  for (const char *rest = text;; rest++) {
    char pattern[STUDY_NAME];
    size_t n = strcspn (rest, ",");
    if (n == 0 || n >= sizeof pattern)
      return pw_fail (error, PW_INPUT, "--methods \"%.80s\": %s", text, n ? "too long a name" : "a name is missing");
    snprintf (pattern, sizeof pattern, "%.*s", (int)n, rest);
    int status = methods_add_pattern (study, pattern, error);
    rest += n;
    if (status != PW_OK || *rest == 0) return status;
  }
}

int pw_study_read_methods (pw_study *study, const char *otherwise, pw_error *error) {
  int status = methods_add_list (study, study->methods_text ? study->methods_text : otherwise, error);
  for (const pw_method *const *m = study->line.methods; m && *m && study->methods_text == NULL && status == PW_OK; m++)
    status = methods_add_list (study, PW_PRINTED (STUDY_NAME, "%s+all", (*m)->name), error);
  return status;
}

pw_row *pw_study_add (pw_study *study, int group, int curve, const char *method, int points, pw_error *error) {
  pw_row *row = realloc (study->row, (size_t)(study->rows + 1) * sizeof *row);
  double (*point)[STUDY_COORDINATES] = pw_arena_alloc (&study->line.arena, (size_t)points * sizeof *point);
  if (row) study->row = row;
  if (row == NULL || point == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  row += study->rows++;
  *row = (pw_row){ .group = group, .curve = curve, .points = points, .point = point };
  snprintf (row->method, sizeof row->method, "%s", method);
  snprintf (row->label, sizeof row->label, "%s", method);
  for (int i = 0; i < STUDY_COLUMNS; i++) row->value[i] = NAN;
  for (int k = 0; k < points; k++)
    for (int i = 0; i < STUDY_COORDINATES; i++) row->point[k][i] = NAN;
  return row;
}

void pw_study_begin_progress (pw_study *study, const char *what, const char *unit, int rows) {
  study->progress_sum = 0;
  pw_progress_start (&study->progress, what, unit, 0, rows);
}

void pw_study_progress (pw_study *study, pw_row *row, double part) {
  pthread_mutex_lock (&study->mutex);
  study->progress_sum += fmin (part, 1) - row->progress;
  row->progress = fmin (part, 1);
  pw_progress_at (&study->progress, study->progress_sum);
  pthread_mutex_unlock (&study->mutex);
}

static int study_advance (pw_study *study, pw_row *row, pw_run *run, const pw_limit *limit, pw_visitor *visitor,
                          pw_error *error) {
  int status = PW_OK;
  long batch = 8; /* calls of pw_run_advance_towards between readings of the clock, at first */
  while (status == PW_OK && pw_run_time (run) < study->settings.span) {
    double start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
    long n = 0;
    do {
      status = pw_run_advance_towards (run, visitor ? visitor->due : study->settings.span, study->settings.span, error);
      if (status == PW_OK && visitor && pw_run_time (run) >= visitor->due)
        status = visitor->visit (visitor, run, error);
    } while (status == PW_OK && ++n < batch && pw_run_time (run) < study->settings.span);
    double used = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - start;
    row->cpu += used;
    pw_batch_adapt (&batch, n, used);
    pw_study_progress (study, row, study->run_share * (row->runs + pw_run_time (run) / study->settings.span));
    int stopped = status == PW_STOPPED;
    if (stopped && (pw_stop || isinf (study->cpu_limit))) return pw_limit_status (limit, pw_run_time (run), error);
    if (stopped || (status == PW_OK && row->cpu > study->cpu_limit && pw_run_time (run) < study->settings.span)) {
      row->state = ROW_STOPPED;
      return PW_RETRY;
    }
  }
  return status;
}

int pw_study_run (pw_study *study, pw_row *row, const pw_settings *settings, pw_visitor *visitor, pw_error *error) {
  pw_settings run_settings = *settings;
  pw_limit limit = study->limit;
  if (visitor == NULL) limit.seconds = INFINITY; /* timed: not slowed down by readings of the clock in every step */
  row->cpu = 0;
  pw_limit_start (&limit);
  run_settings.methods = study->line.methods;
  run_settings.stop = pw_limit_over;
  run_settings.stop_context = &limit;
  run_settings.specialised = pw_scene_code_table (study->engine.code);
  pw_run *run = pw_run_open (study->line.m.system, row->method, &run_settings, error);
  if (run == NULL && error->status == PW_STOPPED) {
    *error = (pw_error){ 0 };
    if (pw_stop || isinf (study->cpu_limit)) return pw_limit_status (&limit, settings->t, error);
    row->state = ROW_STOPPED, row->t = settings->t;
    return PW_RETRY;
  }
  if (run == NULL) return error->status;
  int status = study_advance (study, row, run, &limit, visitor, error);
  row->t = pw_run_time (run);
  row->statistics = *pw_run_statistics (run);
  row->runs += status == PW_OK;
  pw_run_close (run);
  return status;
}

int pw_study_parallel (pw_study *study, int count, pw_task *task, void *context, pw_error *error) {
  int status = (study->type->timed ? pw_parallel_timed : pw_parallel) (study->jobs, count, task, context, error);
  pw_progress_end (&study->progress);
  return status;
}

int pw_study_record_run (const pw_study *study, pw_row *row, int status, const pw_error *run_error, pw_error *error) {
  const pw_statistics *stats = &row->statistics;
  const long count[] = { stats->steps, stats->rejected, stats->rhs, stats->jacobians, stats->factorisations };
  for (int i = 0; i < 5; i++) row->value[study->type->first_count_column + i] = (double)count[i];
  row->value[study->type->time_column] = row->t;
  if (status == PW_OK || row->state == ROW_STOPPED) return PW_OK;
  if (status == PW_RESOURCE || status == PW_INITIAL) return pw_fail (error, status, "%s", run_error->text);
  if (pw_stop) return PW_RETRY;
  row->state = status == PW_INPUT ? ROW_REFUSED : ROW_FAILED;
  snprintf (row->reason, sizeof row->reason, "%s",
            run_error->status ? run_error->text : "the method failed without giving a reason");
  return PW_OK;
}

const char *pw_study_method (const pw_row *row) {
  return row->method;
}

const char *pw_study_status (const pw_row *row) {
  static const char *const status[] = { "ok", "failed", "refused", "stopped", "not run" };
  return status[row->state];
}

/* The width of the first column, which contains the methods. */
static int table_width (const pw_study *study) {
  size_t width = strlen ("method");
  for (const pw_row *row = study->row; row < study->row + study->rows; row++)
    if (strlen (row->method) > width) width = strlen (row->method);
  return (int)width;
}

/* Prints a row: columns after the status only if its runs have reached the end, else the reason. */
static void table_print (const pw_study *study, const pw_row *row) {
  const pw_study_column *column = study->type->column;
  int shown = 1;
  printf ("%-*s", table_width (study), row->method);
  for (int i = 0; shown && i < study->type->columns; i++) {
    char text[32] = "<", *number = text + (row->upper_bounds >> i & 1); /* "-": unknown, "<1e-9": an upper bound */
    if (isnan (row->value[i]) || column[i].format == NULL)
      strcpy (number, "-");
    else
      snprintf (number, sizeof text - 1, column[i].format, row->value[i]);
    if (column[i].head) printf ("%*s", column[i].width, text);
    if (column[i].text == pw_study_status) shown = row->state == ROW_DONE;
  }
  if (row->state != ROW_DONE) {
    printf ("  %s", pw_study_status (row));
    if (row->state == ROW_FAILED && strncmp (row->reason, "t = ", 4) != 0)
      printf (" at t = %s s", PW_DIGITS (row->t, 4));
    printf (": %s", row->reason);
  }
  putchar ('\n');
  fflush (stdout);
}

/* Ends a line of the CSV file, which has all lines so far if the study is stopped. */
static int table_end_line (const pw_study *study, pw_cells *line, pw_error *error) {
  pw_cells_end (line);
  if (fflush (line->f) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "cannot write into %s: %s", study->table_path ? study->table_path : study->folder,
                  strerror (errno));
}

/* Prints a row unless the study is quiet, and writes it into the CSV file. */
static int table_write_row (pw_study *study, const pw_row *row, pw_error *error) {
  const pw_study_column *column = study->type->column;
  if (!study->quiet && study->headed != row->group + 1) {
    const int width = table_width (study);
    printf ("%s%-*s%s\n%-*s", study->headed ? "\n" : "", width, study->type->group[row->group],
            study->type->heading_above, width, "method");
    for (int i = 0; i < study->type->columns; i++)
      if (column[i].head) printf ("%*s", column[i].width, column[i].head);
    putchar ('\n');
    study->headed = row->group + 1;
  }
  if (!study->quiet) table_print (study, row);
  if (study->csv == NULL) return PW_OK;
  pw_cells line = { .f = pw_output_stream (study->csv) };
  for (int i = 0; i < study->type->columns; i++)
    if (column[i].text)
      pw_cells_text (&line, column[i].text (row));
    else if (column[i].name)
      pw_cells_number (&line, row->value[i]);
  pw_cells_quoted (&line, row->reason);
  return table_end_line (study, &line, error);
}

/* The coordinates of the next defined point of a group, after point *point of *row; NULL after the last one.  A point
 * is defined if its coordinates 1, 2, ... are, which are set together. */
static const double *table_next_point (const pw_study *study, int group, const pw_row **row, int *point) {
  for (; *row < study->row + study->rows; ++*row, *point = -1)
    while ((*row)->group == group && ++*point < (*row)->points)
      if (!isnan ((*row)->point[*point][1])) return (*row)->point[*point];
  return NULL;
}

void pw_study_add_curves (const pw_study *study, int group, pw_curves *c, int x, int y) {
  const pw_row *row = study->row;
  const pw_method *integrator;
  const double *point;
  int stabilisation;
  for (int k = -1, curve = -1; (point = table_next_point (study, group, &row, &k)) != NULL; curve = row->curve) {
    if (row->curve != curve) {
      int known = pw_method_parse (row->label, study->line.methods, &integrator, &stabilisation, NULL) == PW_OK;
      const char *name = known ? integrator->stabilisations[stabilisation].name : "";
      pw_curves_add (c, PW_PRINTED (60, "method %s", name), row->label);
    }
    pw_curves_point (c, point[x], point[y], 0);
  }
}

int pw_study_close_figure (pw_study *study, pw_curves *c, pw_error *error) {
  int script = 0, status = pw_curves_close (c, error);
  while (study->scripts[script]) script++;
  if (c->panels) study->scripts[script] = c->name;
  return status;
}

static int study_open_folder (pw_study *study, pw_error *error) {
  const char *const *tables = study->type->table_names;
  const char *names[FIGURE_ENDINGS + 3] = { NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--reference", study->reference_path, PW_READS, NULL },
                   { "-o", study->table_path, PW_WRITES, pw_cli_csv },
                   { "--plots", study->folder, PW_WRITES_INTO, names } };
  double width;
  memcpy (names, pw_figure_endings, FIGURE_ENDINGS * sizeof *names);
  names[FIGURE_ENDINGS] = tables[0], names[FIGURE_ENDINGS + 1] = tables[1];
  if (study->table_path && !pw_cli_names_file (study->table_path) && study->folder == NULL) {
    pw_cli_say ("pinwheel: -o %s: an old spelling of --plots %s\n", study->table_path, study->table_path);
    use[3].path = study->folder = study->table_path, use[2].path = study->table_path = NULL;
  }
  int status = pw_cli_requires ("--width", study->line.width, "--plots DIR", study->folder != NULL, error);
  if (status == PW_OK) status = pw_figure_width (study->line.width, &width, error);
  if (status == PW_OK) status = pw_files_open (&study->line, use, sizeof use / sizeof *use, error);
  if (status != PW_OK || (study->folder == NULL && study->table_path == NULL)) return status;
  study->csv = study->table_path ? study->line.files.output[2] : pw_figure_open_file (study->folder, tables[0], error);
  study->line.files.output[2] = NULL;
  if (study->csv == NULL) return error->status;
  /* Rows follow as they finish, in NAME.part, which remains if the study is stopped. */
  pw_cells heading = { .f = pw_output_stream (study->csv) };
  for (const pw_study_column *c = study->type->column; c < study->type->column + study->type->columns; c++)
    if (c->name) pw_cells_name (&heading, c->name, c->unit);
  pw_cells_text (&heading, "reason");
  return table_end_line (study, &heading, error);
}

static int study_open (pw_study *study, pw_error *error) {
  study->run_share = 1;
  study->cpu_limit = INFINITY;
  pthread_mutex_init (&study->mutex, NULL);
  int status = pw_cli_open (&study->line, error);
  study->jobs = pw_parallel_jobs (&study->line);
  if (status == PW_OK) status = study->type->plan (study, error);
  if (status == PW_OK) status = pw_report_initial_state (&study->line.m, study->limit.seconds, error);
  if (status != PW_OK) return status;
  pw_cli_report_tables (study->line.m.system, study->settings.span);
  double steps = 0; /* of all runs, estimated */
  for (const pw_row *row = study->row; row < study->row + study->rows; row++) {
    pw_settings settings = study->settings;
    if (row->level > 0) settings.step = settings.rtol = row->level;
    steps += study->type->runs_per_row *
             pw_method_steps (row->method, &settings, study->line.m.defaults.step, study->settings.span);
  }
  /* one engine for all runs, since `compare` compares their processor times */
  pw_cli_engine_open (&study->engine, study->line.m.system, study->line.when, steps);
  return study_open_folder (study, error);
}

/* Measures a row, then writes the measured rows before the first one that is not: rows are written in their order. */
static int study_measure_row (void *context, int i, pw_error *error) {
  pw_study *study = context;
  int status = study->type->measure (study, &study->row[i], error);
  if (status != PW_OK) return status;
  pw_study_progress (study, &study->row[i], 1);
  pthread_mutex_lock (&study->mutex);
  study->row[i].measured = 1;
  pw_progress_end (&study->progress);
  for (; status == PW_OK && study->written < study->rows && study->row[study->written].measured; study->written++)
    status = table_write_row (study, &study->row[study->written], error);
  pthread_mutex_unlock (&study->mutex);
  return status;
}

/* Measures the rows of a method one after the other; if a study is timed, the curves are its methods. */
static int study_measure_method (void *context, int curve, pw_error *error) {
  const pw_study *study = context;
  int status = PW_OK;
  for (int i = 0; status == PW_OK && i < study->rows; i++)
    if (study->row[i].curve == curve) status = study_measure_row (context, i, error);
  return status;
}

static int study_perform (pw_study *study, pw_error *error) {
  pw_stop_catch ();
  int status = study->type->begin (study, error);
  if (status == PW_OK)
    printf ("all runs use %s%s\n\n",
            study->engine.code ? "code specialised for this scene, if their method can use it" : "the general engine: ",
            study->engine.code ? "" : study->engine.reason);
  pw_study_begin_progress (study, pw_file_name (study->line.m.file), study->type->row_noun, study->rows);
  if (status == PW_OK)
    status = study->type->timed ? pw_study_parallel (study, study->methods, study_measure_method, study, error)
                                : pw_study_parallel (study, study->rows, study_measure_row, study, error);
  /* those measured after the row that an interruption has stopped */
  for (const pw_row *row = study->row + study->written, *end = study->row + study->rows;
       status == PW_RETRY && pw_stop && row < end; row++) {
    if (row->measured && table_write_row (study, row, error) != PW_OK) status = error->status;
    study->written += row->measured && status == PW_RETRY;
  }
  if (status == PW_OK && study->type->conclude) study->type->conclude (study);
  pw_stop_release ();
  return status;
}

/* Gives a complete CSV file its final name and draws the figures; an incomplete one remains as NAME.part. */
static int study_finish (pw_study *study, int status, pw_error *error) {
  char part_path[FIGURE_PATH + 16] = "";
  if (study->csv && status == PW_OK)
    status = pw_output_finish (study->csv, error);
  else if (study->csv)
    pw_cli_abandon_table (study->csv, study->written, part_path, sizeof part_path);
  if (status == PW_RETRY && pw_stop) {
    pw_cli_say ("pinwheel: interrupted; %d of %d %s are done%s%s\n", study->written, study->rows, study->type->row_noun,
                *part_path ? ", and kept in " : "", part_path);
    return PW_INTERRUPTED;
  }
  if (*part_path) pw_cli_say ("pinwheel: the %s so far are kept in %s\n", study->type->row_noun, part_path);
  if (study->folder && status == PW_OK) status = study->type->figures (study, error);
  return status == PW_OK && study->scripts[0] ? pw_figure_draw (study->folder, study->scripts, error) : status;
}

int pw_study_command (pw_study *study, const pw_study_type *type, pw_error *error) {
  study->type = type;
  int status = study_open (study, error);
  if (status == PW_OK) status = study_perform (study, error);
  status = study_finish (study, status, error);
  const pw_row *failed = NULL, *done = NULL;
  for (const pw_row *row = study->row; row < study->row + study->rows; row++) {
    if (row->state == ROW_DONE) done = row;
    if (row->state == ROW_FAILED || row->state == ROW_REFUSED) failed = row;
  }
  if (status == PW_OK && done == NULL && failed)
    status = pw_fail (error, PW_METHOD, "no method has reached the end; the last error: %s", failed->reason);
  else if (status == PW_OK && done == NULL)
    status = pw_fail (error, PW_METHOD, "no method has reached the end within the limit; see --limit");
  if (type->close) type->close (study);
  free (study->row);
  free (study->method);
  pthread_mutex_destroy (&study->mutex);
  pw_cli_engine_close (&study->engine);
  return status == PW_INTERRUPTED ? status : error->status;
}
