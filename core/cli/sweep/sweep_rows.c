/* The missing rows of a sweep, computed by several threads.
 *
 * Rows with the same parameters follow each other and share a compiled system; systems of the same structure share
 * specialised code. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "parallel.h"
#include "progress.h"
#include "sweep_journal.h"

enum { ROWS_LANES = 8 };

/* A compiled system. */
typedef struct {
  long parameters;            /* pw_grid_parameters of its rows */
  int users;                  /* runs, and the sweep while it is the latest system */
  int ready;                  /* 0: a thread is compiling it */
  pw_cli_model m;             /* m.file is NULL */
  int *state;                 /* of each column of the table; -1: the system does not have it */
  const pw_specialised *code; /* NULL: the general engine */
  pw_error error;             /* why it could not be compiled */
} row_system;

/* Code of systems whose structure is not that of the first one. */
typedef struct row_code {
  char *text;
  int ready; /* 0: a thread is compiling it */
  pw_scene_code *code;
  struct row_code *next;
} row_code;

typedef struct {
  const pw_plan *plan;
  int jobs;
  /* accessed by the thread that holds the lock */
  pthread_mutex_t lock;
  pthread_cond_t compiled;
  row_system *latest;
  row_code *codes;
  long next;    /* the next row to compute, as in pw_grid_ordered */
  long missing; /* rows to compute at the beginning */
  pw_journal *journal;
  pw_progress progress;
  pw_error *error;
  long changed, runs; /* runs whose given initial values the constraints have changed; all that were opened */
  double change;      /* the largest change */
  char worst[PW_CHANGE_TEXT];
} sweep_rows;

/* The run of a row. */
typedef struct {
  long row;
  row_system *system; /* NULL: no run */
  pw_run *run;
  pw_limit limit;
  int status; /* other than PW_OK: the run has ended */
  pw_error error;
} row_run;

/* ---- Specialised code ---- */

/* The code of a text, of which it takes ownership, compiled by the first thread that needs it.  The caller holds the lock,
 * which is released meanwhile. */
static const pw_specialised *rows_code (sweep_rows *x, char *text, const pw_system *s, pw_error *error) {
  row_code *c = x->codes;
  while (c && strcmp (c->text, text) != 0) c = c->next;
  if (c) free (text);
  if (c) {
    while (!c->ready) pthread_cond_wait (&x->compiled, &x->lock);
    return pw_scene_code_table (c->code);
  }
  if ((c = malloc (sizeof *c)) == NULL) {
    free (text);
    pw_fail (error, PW_RESOURCE, "out of memory");
    return NULL;
  }
  *c = (row_code){ .text = text, .next = x->codes };
  x->codes = c;
  pthread_mutex_unlock (&x->lock);
  c->code = pw_scene_code_open (text, s, error);
  pthread_mutex_lock (&x->lock);
  c->ready = 1;
  pthread_cond_broadcast (&x->compiled);
  return pw_scene_code_table (c->code);
}

/* Chooses the code of a new system, independently of the order of runs: that of the plan's engine if it fits, else code that is
 * generated for this system. */
static void rows_specialise (sweep_rows *x, row_system *s) {
  const pw_specialised *first = pw_scene_code_table (x->plan->engine.code);
  pw_error own = { 0 };
  if (first == NULL) return;
  if (pw_specialised_fits (first, s->m.system)) {
    s->code = first;
    return;
  }
  char *text = pw_cli_source (s->m.system, NULL);
  if (text == NULL) return;
  pthread_mutex_lock (&x->lock);
  s->code = rows_code (x, text, s->m.system, &own);
  pthread_mutex_unlock (&x->lock);
  if (own.status != PW_OK && pw_stop == 0) pw_cli_say ("pinwheel: general engine: %s\n", own.text);
  if (s->code == NULL && pw_stop) s->error.status = PW_RETRY; /* Ctrl-C has stopped the compiler too */
}

/* ---- Compiled systems ---- */

static int system_open (row_system *x, const pw_plan *p, long row, pw_error *error) {
  char name[300];
  if (pw_plan_compile (p, row, &x->m, error) != PW_OK) return error->status;
  x->state = malloc ((size_t)p->columns * sizeof *x->state);
  if (x->state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < p->columns; i++) x->state[i] = -1;
  for (int i = 0; i < 2 * pw_system_coordinates (x->m.system); i++) {
    int column = pw_names_find (&p->index, pw_system_state_name (x->m.system, i, name, sizeof name));
    if (column < 0)
      return pw_fail (error, PW_INPUT,
                      "%s has no column: the number of bodies may only depend on parameters that are counts", name);
    x->state[column] = i;
  }
  return PW_OK;
}

/* Ends the use of a system; the last user frees it.  The caller holds the lock. */
static void system_release (row_system *s) {
  if (s == NULL || --s->users > 0) return;
  pw_cli_close_model (&s->m);
  free (s->state);
  free (s);
}

/* The system of a row, shared with other threads, or compiled without the lock, which the caller holds.  NULL if out of
 * memory. */
static row_system *system_of (sweep_rows *x, long row) {
  long parameters = pw_grid_parameters (&x->plan->grid, row);
  row_system *s = x->latest;
  if (s && s->parameters == parameters) {
    s->users++;
    while (!s->ready) pthread_cond_wait (&x->compiled, &x->lock);
    return s;
  }
  if ((s = malloc (sizeof *s)) == NULL) return NULL;
  *s = (row_system){ .parameters = parameters, .users = 2 };
  system_release (x->latest);
  x->latest = s;
  pthread_mutex_unlock (&x->lock);
  if (system_open (s, x->plan, row, &s->error) == PW_OK) rows_specialise (x, s);
  pthread_mutex_lock (&x->lock);
  s->ready = 1;
  pthread_cond_broadcast (&x->compiled);
  return s;
}

/* ---- One run ---- */

/* Initial values that the row varies. */
static pw_initial_value *run_initial (const pw_plan *p, const row_run *x, int *count) {
  pw_initial_value *initial = malloc (((size_t)p->grid.axes + 1) * sizeof *initial);
  for (int i = 0; initial && i < p->grid.axes; i++)
    if (p->grid.axis[i].parameter == NULL)
      initial[(*count)++] = (pw_initial_value){ pw_system_find_state (x->system->m.system, p->grid.axis[i].name, NULL),
                                                pw_grid_value (&p->grid, i, x->row) };
  return initial;
}

static void run_open (row_run *x, const pw_plan *p) {
  x->run = NULL;
  x->error = x->system->error;
  x->status = x->error.status;
  if (x->status != PW_OK) return;
  x->limit = p->limit;
  pw_settings settings = p->settings;
  settings.stop_context = &x->limit;
  settings.specialised = x->system->code;
  pw_initial_value *initial = run_initial (p, x, &settings.initials);
  settings.initial = initial;
  pw_limit_start (&x->limit);
  if (initial)
    x->run = pw_run_open (x->system->m.system, p->method, &settings, &x->error);
  else
    pw_fail (&x->error, PW_RESOURCE, "out of memory");
  x->status = x->error.status;
  free (initial);
}

static int run_ended (const row_run *x, const pw_plan *p) {
  return x->status != PW_OK || !(pw_run_time (x->run) < p->t_end);
}

/* Appends the cells of a row: NaN where there is no sample at the end, or no run.  The last ones: kinetic energy, residuals of
 * positions and velocities, steps, evaluations, processor time (0 without a run). */
static void run_cells (const row_run *x, const pw_plan *p, const pw_sample *last, pw_text *t) {
  static const char *const word[] = { "ok", "machine", "input", "start", "method" };
  double cell[] = { NAN, NAN, NAN, NAN, NAN, 0 };
  int n = last ? pw_system_coordinates (x->system->m.system) : 0;
  if (last) cell[0] = last->kinetic;
  if (x->run) {
    const pw_statistics *s = pw_run_statistics (x->run);
    cell[1] = s->position, cell[2] = s->velocity, cell[3] = (double)s->steps, cell[4] = (double)s->rhs;
    cell[5] = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - x->limit.start;
  }
  for (int i = 0; i < p->grid.axes; i++) pw_text_number (t, pw_grid_value (&p->grid, i, x->row));
  pw_text_cell (t, word[-x->status]);
  pw_text_number (t, x->run ? pw_run_time (x->run) : NAN);
  for (int i = 0; i < p->columns; i++) {
    int state = last ? x->system->state[i] : -1;
    pw_text_number (t, state < 0 ? NAN : state < n ? last->q[state] : last->v[state - n]);
  }
  for (int i = 0; i < (p->cpu ? 6 : 5); i++) pw_text_number (t, cell[i]);
  pw_text_quoted (t, x->error.text);
}

/* Appends the cells of the row, without the end of the line.  Returns the status of the run, which has a row even if it
 * failed; without cells: PW_RETRY if a request to stop ended the run, PW_RESOURCE with the error if memory or a file was
 * missing. */
static int run_close (row_run *x, const pw_plan *p, pw_text *text) {
  pw_sample sample, *last = NULL;
  pw_error own = { 0 };
  if (x->status == PW_STOPPED) x->status = pw_limit_status (&x->limit, pw_run_time (x->run), &x->error);
  if (x->run && pw_run_sample (x->run, pw_run_time (x->run), &sample, &own) == PW_OK) last = &sample;
  if (x->status == PW_OK && last == NULL) x->status = own.status, x->error = own;
  if (x->status > 0 && pw_stop == 0) x->status = pw_fail (&x->error, PW_METHOD, "the method gave up");
  if (x->status != PW_RETRY && x->status != PW_RESOURCE) run_cells (x, p, last, text);
  pw_run_close (x->run);
  if (!text->failed) return x->status;
  x->error = (pw_error){ 0 };
  return pw_fail (&x->error, PW_RESOURCE, "out of memory");
}

/* ---- Rows; the caller holds the lock ---- */

/* Stores a row, or the first error, which stops the sweep. */
static void rows_keep (sweep_rows *x, const row_run *r, int status, const pw_text *text) {
  if (status == PW_RETRY || x->error->status != PW_OK) return;
  if (status == PW_RESOURCE)
    pw_fail (x->error, PW_RESOURCE, "row %ld of the grid: %s", r->row + 1, r->error.text);
  else if (pw_journal_add (x->journal, x->plan, r->row, -status, text->chars, x->error) == PW_OK)
    pw_progress_at (&x->progress, (double)x->journal->done);
  if (x->error->status != PW_OK && pw_stop == 0) pw_stop = 1;
}

/* The next missing row of the part; -1 if there is none. */
static long rows_take (sweep_rows *x) {
  const pw_plan *p = x->plan;
  while (pw_stop == 0 && x->next < p->grid.rows) {
    long row = pw_grid_ordered (&p->grid, x->next++);
    if (row % p->parts == p->part - 1 && x->journal->line[row / p->parts] == 0) return row;
  }
  return -1;
}

/* Counts changes of given initial values by the constraints. */
static void rows_change (sweep_rows *x, double change, const char *text) {
  x->runs++;
  x->changed += change > 0;
  if (!(change > x->change)) return;
  x->change = change;
  memcpy (x->worst, text, sizeof x->worst);
}

/* ---- Threads ---- */

/* A thread's runs: as many as fit into lanes, else one. */
typedef struct {
  sweep_rows *x;
  const pw_specialised_lanes *code;
  void *memory;
  int width;
  row_run run[ROWS_LANES];
  pw_text text;
} worker;

/* Opens the run of the next row; 0 if there is none.  The caller holds the lock. */
static int worker_begin (sweep_rows *x, row_run *r) {
  char text[PW_CHANGE_TEXT];
  long row = rows_take (x);
  if (row < 0) return 0;
  *r = (row_run){ .row = row, .system = system_of (x, row) };
  if (r->system == NULL) {
    rows_keep (x, r, pw_fail (&r->error, PW_RESOURCE, "out of memory"), NULL);
    return 0;
  }
  pthread_mutex_unlock (&x->lock);
  run_open (r, x->plan);
  double change = r->run ? pw_cli_largest_change (r->run, r->system->m.system, text) : 0;
  pthread_mutex_lock (&x->lock);
  if (r->run) rows_change (x, change, text);
  return 1;
}

/* Stores the row of a run that has ended.  The caller holds the lock. */
static void worker_end (worker *w, row_run *r) {
  sweep_rows *x = w->x;
  pthread_mutex_unlock (&x->lock);
  pw_text_clear (&w->text);
  int status = run_close (r, x->plan, &w->text);
  pthread_mutex_lock (&x->lock);
  rows_keep (x, r, status, &w->text);
  system_release (r->system);
  r->system = NULL;
}

/* Advances the runs until one of them ends: in lanes if all use the code of the plan's engine, else one after the other. */
static void worker_advance (worker *w) {
  const pw_plan *p = w->x->plan;
  row_run *of[ROWS_LANES];
  pw_run *run[ROWS_LANES];
  int status[ROWS_LANES], n = 0, same = 1, ended = 0;
  pw_error error[ROWS_LANES];
  for (row_run *r = w->run; r < w->run + w->width; r++) {
    if (r->system == NULL) continue;
    if (run_ended (r, p)) return;
    same &= r->system->code == pw_scene_code_table (p->engine.code);
    of[n] = r, error[n] = (pw_error){ 0 }, run[n++] = r->run;
  }
  while (!ended) {
    pw_runs_advance (run, n, p->t_end, same ? w->code : NULL, w->memory, status, error);
    for (int i = 0; i < n; i++) ended |= status[i] != PW_OK || !(pw_run_time (run[i]) < p->t_end);
  }
  for (int i = 0; i < n; i++) of[i]->status = status[i], of[i]->error = error[i];
}

/* Computes rows until there are none. */
static int worker_thread (void *context, int i, pw_error *error) {
  sweep_rows *x = context;
  worker w = { .x = x, .code = pw_scene_code_lanes (x->plan->code), .width = 1 };
  (void)i, (void)error;
  if (w.code && (w.memory = pw_specialised_lanes_memory (w.code)) != NULL)
    w.width = pw_specialised_lanes_count (w.code);
  if (w.width > ROWS_LANES) w.width = 1; /* no code is wider today */
  pthread_mutex_lock (&x->lock);
  while (w.width > 1 && x->missing < (long)w.width * x->jobs) w.width--; /* work for all threads */
  for (int runs = 1; runs > 0;) {
    for (int k = runs = 0; k < w.width; k++) runs += w.run[k].system != NULL || worker_begin (x, &w.run[k]);
    pthread_mutex_unlock (&x->lock);
    if (runs) worker_advance (&w);
    pthread_mutex_lock (&x->lock);
    for (int k = 0; k < w.width; k++)
      if (w.run[k].system && run_ended (&w.run[k], x->plan)) worker_end (&w, &w.run[k]);
  }
  pthread_mutex_unlock (&x->lock);
  pw_text_free (&w.text);
  free (w.memory);
  return PW_OK;
}

static void rows_close (sweep_rows *x) {
  for (row_code *c = x->codes, *next; c; c = next) {
    next = c->next;
    pw_scene_code_close (c->code);
    free (c->text);
    free (c);
  }
  system_release (x->latest);
  pthread_cond_destroy (&x->compiled);
  pthread_mutex_destroy (&x->lock);
}

int pw_sweep_rows (const pw_plan *p, pw_journal *j, int jobs, pw_error *error) {
  const long missing = j->rows - j->done;
  sweep_rows x = {
    .plan = p, .journal = j, .missing = missing, .jobs = jobs < missing ? jobs : (int)missing, .error = error
  };
  pthread_mutex_init (&x.lock, NULL);
  pthread_cond_init (&x.compiled, NULL);
  pw_stop_catch ();
  pw_progress_count (&x.progress, pw_file_name (p->file), "runs", (double)j->done, (double)j->rows);
  pw_parallel (x.jobs, x.jobs, worker_thread, &x, error);
  pw_progress_end (&x.progress);
  pw_stop_release (); /* the rest can be interrupted and repeated */
  if (error->status == PW_OK && x.changed)
    pw_cli_say ("pinwheel: in %ld of %ld runs the constraints changed given initial values, at worst %s\n", x.changed,
                x.runs, x.worst);
  rows_close (&x);
  return error->status;
}
