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
#include "pinwheel-analysis.h"
#include "figure.h"
#include "sweep.h"

/* A compiled system, shared by rows with the same parameters. */
typedef struct {
  long parameters;            /* pw_grid_parameter_index of these rows */
  int users;                  /* number of runs that use it, and one more while it is the latest system */
  int ready;                  /* 0: a thread is compiling it */
  pw_cli_model model;         /* model.file is NULL */
  int *state;                 /* index of the state in each column of the table; -1: the system does not have it */
  const pw_specialised *code; /* NULL: the general engine */
  pw_error error;             /* why it could not be compiled */
} row_system;

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
  long next;             /* number of rows of the whole grid taken so far, in the order of pw_grid_scheduled_row */
  long missing_at_start; /* number of rows to compute */
  pw_journal *journal;
  pw_progress progress;
  pw_error *error;
  long opened_runs;
  long changed_runs;     /* those whose given initial values the constraints have changed */
  double largest_change; /* pw_cli_largest_change */
  char largest_change_text[PW_CHANGE_TEXT];
} sweep_rows;

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
  if (pw_plan_compile (plan, row, &system->model, error) != PW_OK) return error->status;
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
  long parameters = pw_grid_parameter_index (&sweep->plan->grid, row);
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
                              pw_grid_value (&plan->grid, i, row->number) };
  settings.initial = initial;
  pw_limit_start (&row->limit);
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
static int row_close (sweep_row *row, const pw_plan *plan, pw_text *text) {
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
  if (row->status != PW_RETRY && row->status != PW_RESOURCE) {
    pw_plan_row shown = { row->number, row->status, row->error.text, row->run, .last = last };
    if (plan->with_cpu && row->run) shown.cpu = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - row->limit.start;
    shown.error = row->state_error, shown.of = has_outputs ? &row->of : NULL;
    if (last) shown.coordinates = pw_system_coordinates (row->system->model.system), shown.state = row->system->state;
    pw_plan_cells (plan, &shown, text);
  }
  pw_outcomes_close (&row->of);
  pw_run_close (row->run);
  free (row->state_error);
  if (!text->failed) return row->status;
  row->error = (pw_error){ 0 };
  return pw_fail (&row->error, PW_RESOURCE, "out of memory");
}

/* ---- Rows; the caller holds the lock ---- */

/* Adds a row to the journal, or keeps the first error, which stops all threads. */
static void rows_store (sweep_rows *sweep, const sweep_row *row, int status, const pw_text *text) {
  if (status == PW_RETRY || sweep->error->status != PW_OK) return;
  if (status == PW_RESOURCE)
    pw_fail (sweep->error, PW_RESOURCE, "row %ld of the grid: %s", row->number + 1, row->error.text);
  else if (pw_journal_add (sweep->journal, sweep->plan, row->number, -status, text->chars, sweep->error) == PW_OK)
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
  pw_text text; /* cells of a row */
} sweep_worker;

/* Opens the run of the next row; 0 if there is none.  The caller holds the lock, which is released meanwhile. */
static int worker_begin (sweep_rows *sweep, sweep_row *row) {
  const pw_plan *plan = sweep->plan;
  char text[PW_CHANGE_TEXT];
  long number = -1; /* of the next missing row of the part; none after a request to stop */
  while (number < 0 && pw_stop == 0 && sweep->next < plan->grid.rows) {
    long next = pw_grid_scheduled_row (&plan->grid, sweep->next++);
    if (next % plan->parts == plan->part - 1 && sweep->journal->offset[next / plan->parts] == 0) number = next;
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
      pw_text_clear (&worker.text);
      int status = row_close (row, sweep->plan, &worker.text);
      pthread_mutex_lock (&sweep->lock);
      rows_store (sweep, row, status, &worker.text);
      system_release (row->system);
      row->system = NULL;
    }
  } while (rows > 0);
  pthread_mutex_unlock (&sweep->lock);
  pw_text_free (&worker.text);
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
  const char *part_text, *jobs_text, *lanes_text;
  const char **ranges; /* --vary */
  int merge;           /* 1: --merge */
  /* as understood */
  pw_plan plan;
  pw_journal journal;
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
  int status = pw_cli_settings (&sweep->line, defaults, &plan->settings, &plan->limit, error);
  if (status == PW_OK) pw_cli_report_unused (plan->method, &sweep->line);
  if (status == PW_OK) status = pw_cli_read_specialise (sweep->line.specialise, &plan->specialise, error);
  if (status != PW_OK) return status;
  plan->lanes = lanes ? *lanes - '0' : 0;
  if (lanes && (plan->lanes < 1 || plan->lanes > PW_LANES_MOST || (plan->lanes & (plan->lanes - 1)) != 0 || lanes[1]))
    return pw_fail (error, PW_INPUT, "--lanes %.60s: expected " SWEEP_LANES, lanes);
  if (pw_parallel_jobs (sweep->jobs_text, &sweep->jobs, error) != PW_OK) return error->status;
  plan->part = plan->parts = 1; /* without --part the sweep is its only part */
  if (sweep->part_text == NULL || (sscanf (sweep->part_text, "%7d/%7d%c", &plan->part, &plan->parts, &rest) == 2 &&
                                   1 <= plan->part && plan->part <= plan->parts && plan->parts <= 1000000))
    return PW_OK;
  return pw_fail (error, PW_INPUT, "--part %.60s: expected I/N, whole numbers with 1 <= I <= N <= 1000000",
                  sweep->part_text);
}

static int sweep_open (pw_sweep *sweep, pw_error *error) {
  static const char *const figures[] = { "sweep.dat", "sweep.gp", "sweep.svg", "sweep.png", "sweep.pdf", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "-o", sweep->line.table, PW_WRITES, sweep->part_text ? pw_cli_csv : pw_cli_tables },
                   { "--json", sweep->line.json, PW_WRITES, pw_cli_json },
                   { "--plots", sweep->line.plots, PW_WRITES_INTO, figures } };
  double width;
  int status = pw_cli_file (&sweep->line, error);
  if (status == PW_OK) status = sweep_read_settings (sweep, error);
  if (status == PW_OK) status = pw_cli_check_uses (&sweep->line, use, sizeof use / sizeof *use, error);
  if (status == PW_OK) status = pw_plan_open (&sweep->plan, sweep->ranges, error);
  if (status == PW_OK && sweep->plan.parts > sweep->plan.grid.rows)
    status = pw_fail (error, PW_INPUT, "--part %s: more parts than the %ld rows of the grid", sweep->part_text,
                      sweep->plan.grid.rows);
  if (status == PW_OK && sweep->line.plots && sweep->plan.grid.axes > 2)
    status =
        pw_fail (error, PW_INPUT, "--plots: figures show one or two varied quantities, not %d", sweep->plan.grid.axes);
  if (status == PW_OK)
    status = pw_cli_requires ("--width", sweep->line.width, "--plots DIR", sweep->line.plots != NULL, error);
  if (status == PW_OK) status = pw_figure_width (sweep->line.width, &width, error);
  use[1].path = NULL; /* the journal stands for it */
  if (status == PW_OK) status = pw_files_open (&sweep->line, use, sizeof use / sizeof *use, error);
  const size_t numbers = (size_t)sweep->plan.grid.rows * (size_t)pw_plan_drawn (&sweep->plan);
  if (status == PW_OK && sweep->line.plots && (sweep->plan.drawn = malloc (numbers * sizeof (double))) == NULL)
    status = pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_journal_open (&sweep->journal, &sweep->plan, sweep->line.table, error);
  if (status != PW_OK) return status;
  if (sweep->journal.done > 0)
    pw_cli_say ("pinwheel: continuing with %s: %ld of %ld runs are done\n", sweep->journal.path, sweep->journal.done,
                sweep->journal.rows);
  return PW_OK;
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
static int sweep_draw (pw_sweep *sweep, pw_error *error) {
  const pw_plan *plan = &sweep->plan;
  const pw_axis *axis = plan->grid.axis;
  const int count = pw_plan_drawn (plan), maps = plan->grid.axes == 2;
  const char *label[2] = { "", "" };
  double range[2][2] = { { INFINITY, -INFINITY }, { INFINITY, -INFINITY } };
  double (*point)[2] = malloc ((size_t)plan->grid.rows * sizeof *point);
  pw_curves c;
  if (point == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_curves_open (&c, &sweep->line, sweep->line.plots, "sweep", "sweep", error), type = 0;
  for (int k = 0; k <= maps; k++) {
    label[k] = pw_arena_copy (&sweep->line.arena, PW_FIGURE_LABEL (axis[k].name, axis[k].unit ? axis[k].unit : ""));
    if (label[k] == NULL && status == PW_OK) status = pw_fail (error, PW_RESOURCE, "out of memory");
    if (axis[k].value == NULL && axis[k].range.logarithmic) type |= k ? PW_PANEL_LOG_Y : PW_PANEL_LOG_X;
    for (long i = 0; i < axis[k].count; i++) {
      double end[2] = { pw_axis_value (&axis[k], i), pw_axis_value (&axis[k], i) };
      if (maps) draw_ends (&axis[k], i, end);
      range[k][0] = fmin (range[k][0], end[0]), range[k][1] = fmax (range[k][1], end[1]);
    }
  }
  for (int o = 0; o < count && status == PW_OK; o++) {
    const struct pw_column *column = plan->outputs ? &plan->output[o] : &plan->column[o];
    const char *name = PW_FIGURE_LABEL (column->name, column->unit ? column->unit : "");
    pw_panel panel = {
      .x_label = label[0], .y_label = maps ? label[1] : name, .z_label = maps ? name : NULL, .type = type
    };
    memcpy (panel.x, range[0], sizeof panel.x);
    if (maps) memcpy (panel.y, range[1], sizeof panel.y), panel.type |= PW_PANEL_HALF;
    if (!maps) panel.type |= PW_PANEL_BELOW;
    pw_curves_panel (&c, &panel);
    pw_curves_add (&c, maps ? "cells" : "line", NULL);
    for (long row = 0; row < plan->grid.rows; row++) {
      const double z = plan->drawn[row * count + o];
      double end[2][2];
      for (int k = 0; k <= maps; k++) draw_ends (&axis[k], row / axis[k].stride % axis[k].count, end[k]);
      if (maps) pw_curves_cell (&c, end[0], end[1], z);
      point[row][0] = pw_grid_value (&plan->grid, 0, row), point[row][1] = z;
    }
    if (!maps) qsort (point, (size_t)plan->grid.rows, sizeof *point, draw_by_value);
    for (long row = 0; row < plan->grid.rows && !maps; row++) pw_curves_point (&c, point[row][0], point[row][1], 0);
  }
  free (point);
  return pw_curves_draw (&c, status, error);
}

static void sweep_json (const pw_sweep *sweep, const pw_tally *tally, FILE *f) {
  pw_json j = { .f = f, .lines = 1 };
  pw_json_print (
      &j, "{schema: %d, model: %s, method: %s, status: %s, runs: %ld, failed: %ld, reason: %s, table: %s, vary: [", 1,
      pw_file_name (sweep->line.m.file), sweep->plan.method,
      tally->failed == tally->rows ? pw_cli_status_word (-tally->status) : "ok", tally->rows, tally->failed,
      tally->failed ? tally->reason : "", sweep->line.table);
  for (const pw_axis *axis = sweep->plan.grid.axis; axis < sweep->plan.grid.axis + sweep->plan.grid.axes; axis++)
    pw_json_print (&j, "{name: %s, values: %s}", axis->name, axis->text);
  pw_json_print (&j, "]}");
}

static int sweep_finish (pw_sweep *sweep, pw_error *error) {
  pw_tally tally;
  pw_error drawing = { 0 };
  if (sweep->journal.done == 0) {
    fputs ("pinwheel: interrupted before the first run was done\n", stderr);
    return PW_INTERRUPTED;
  }
  if (sweep->journal.done < sweep->journal.rows) {
    pw_cli_say ("pinwheel: interrupted; %ld of %ld runs are kept in %s; the same command continues from there\n",
                sweep->journal.done, sweep->journal.rows, sweep->journal.path);
    return PW_INTERRUPTED;
  }
  int status = pw_sweep_finish (&sweep->journal, &sweep->plan, &tally, error);
  if (status != PW_OK) return status;
  const int drawn = sweep->line.plots ? sweep_draw (sweep, &drawing) : PW_OK;
  if (pw_files_stream (&sweep->line, 2)) sweep_json (sweep, &tally, pw_files_stream (&sweep->line, 2));
  status = pw_figure_status (drawn, &drawing, pw_files_finish (&sweep->line, error), error);
  if (status != PW_OK) return status;
  if (sweep->plan.parts == 1) return sweep_conclude (&tally, error);
  sweep_report_failures (&tally); /* whether all have failed is known after the merge */
  return PW_OK;
}

static int sweep_command (void *options, pw_error *error) {
  pw_sweep *sweep = options;
  pw_tally tally;
  sweep->journal.descriptor = -1;
  int status = sweep_check_options (sweep, error);
  const char *other = status == PW_OK && sweep->merge ? sweep_not_for_merge (sweep) : NULL;
  if (other)
    status = pw_fail (error, PW_INPUT, "--%s cannot be combined with --merge: the parts define the sweep", other);
  if (status == PW_OK && sweep->merge) {
    status = pw_sweep_merge (sweep->line.argument, sweep->line.arguments, sweep->line.table, &tally, error);
    return status == PW_OK ? sweep_conclude (&tally, error) : status;
  }
  if (status == PW_OK) status = sweep_open (sweep, error);
  if (status == PW_OK) status = rows_compute (&sweep->plan, &sweep->journal, sweep->jobs, error);
  if (status == PW_OK) status = sweep_finish (sweep, error);
  pw_journal_close (&sweep->journal);
  pw_plan_close (&sweep->plan);
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
  PW_TEXT_OPTION (pw_sweep, jobs_text, "jobs", 'j', "N", "Number of threads (default: one per processor)"),
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
