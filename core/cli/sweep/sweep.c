/* pinwheel sweep: a table of runs, for all combinations of varied parameters and initial values.
 *
 * Every run depends only on its row of the grid.  A journal keeps the rows in the order of completion; at the end they
 * are sorted into the order of the grid.  So the table does not depend on the number of threads or on interruptions of
 * the sweep. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "parallel.h"
#include "progress.h"
#include "sweep_journal.h"

enum { SWEEP_LANES = 8 };

/* A compiled system that several runs use. */
typedef struct shared_system {
  long parameters; /* pw_grid_parameters of its rows */
  int users;       /* runs */
  int ready;       /* 0: a thread is compiling it */
  pw_sweep_system system;
  pw_error error; /* why it could not be compiled */
  struct shared_system *next;
} shared_system;

/* Code of systems whose structure is not that of the first one. */
typedef struct sweep_code {
  char *text;
  int ready; /* 0: a thread is compiling it */
  pw_scene_code *code;
  struct sweep_code *next;
} sweep_code;

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *path, *part_text, *jobs_text, *lanes_text;
  const char **ranges;
  int merge, cpu;
  /* as understood */
  pw_plan plan;
  int jobs;
  /* in progress; accessed by the thread that holds the lock */
  pthread_mutex_t lock;
  pthread_cond_t compiled;
  shared_system *shared;
  sweep_code *codes;
  long next; /* the next row to compute, as in pw_grid_ordered */
  pw_journal journal;
  pw_progress progress;
  pw_text scratch;
  pw_error *error;
  long changed, runs; /* runs whose given initial values the constraints have changed; all that were opened now */
  double change;      /* the largest change */
  char worst[PW_CHANGE_TEXT];
} sweep;

/* ---- Before the sweep ---- */

static int sweep_read (const sweep *x, pw_error *error) {
  if (x->line.arguments == 0)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel sweep %s",
                    x->merge ? "--merge PART... -o FILE.csv" : pw_cli_sweep.synopsis);
  if (x->path == NULL || *x->path == 0) return pw_fail (error, PW_INPUT, "nowhere to write the table: add -o FILE.csv");
  if (strcmp (x->path, "-") == 0)
    return pw_fail (error, PW_INPUT, "-o -: a sweep needs a file, next to which it keeps what it has done");
  if (pw_cli_csv (x->path, error) != PW_OK) return PW_INPUT;
  if (!x->merge && x->ranges == NULL)
    return pw_fail (error, PW_INPUT, "nothing is varied: add --vary NAME=lin:FIRST:LAST:COUNT, log:..., or V1,V2,...");
  return x->merge ? PW_OK : pw_cli_at_most (&pw_cli_sweep, &x->line, 1, error);
}

/* The first option given that cannot be combined with --merge; NULL if there is none. */
static const char *sweep_not_for_merge (const sweep *x) {
  const pw_cli_line *l = &x->line;
  const struct {
    const char *name;
    const void *given;
  } option[] = { { "--vary", x->ranges },
                 { "--method", l->method },
                 { "--t-end", l->t_end },
                 { "--step", l->step },
                 { "--rtol", l->rtol },
                 { "--atol", l->atol },
                 { "--limit", l->limit },
                 { "--set", l->sets },
                 { "--max-steps", l->max_steps },
                 { "--start", l->starts },
                 { "--specialise", l->specialise },
                 { "--jobs", x->jobs_text },
                 { "--part", x->part_text },
                 { "--cpu", x->cpu ? x : NULL },
                 { "--lanes", x->lanes_text },
                 { "--max-file", l->max_file } };
  for (size_t i = 0; i < sizeof option / sizeof *option; i++)
    if (option[i].given) return option[i].name;
  return NULL;
}

/* "I/N" */
static int sweep_part (sweep *x, pw_error *error) {
  pw_plan *p = &x->plan;
  char rest;
  p->part = p->parts = 1;
  if (x->part_text == NULL || (sscanf (x->part_text, "%7d/%7d%c", &p->part, &p->parts, &rest) == 2 && 1 <= p->part &&
                               p->part <= p->parts && p->parts <= 1000000))
    return PW_OK;
  return pw_fail (error, PW_INPUT, "--part %.60s: expected I/N, whole numbers with 1 <= I <= N <= 1000000",
                  x->part_text);
}

static int sweep_lanes (sweep *x, pw_error *error) {
  static const char *const width[] = { "1", "2", "4", "8", NULL };
  char hint[PW_HINT];
  int i = x->lanes_text ? pw_find_name (width, sizeof *width, x->lanes_text, hint) : -1;
  if (x->lanes_text && i < 0) return pw_fail (error, PW_INPUT, "--lanes %.60s: expected 1, 2, 4 or 8", x->lanes_text);
  x->plan.lanes = i < 0 ? 0 : 1 << i;
  return PW_OK;
}

static int sweep_settings (sweep *x, pw_error *error) {
  pw_plan *p = &x->plan;
  pw_run_defaults d = pw_cli_defaults (pw_file_table (p->file));
  p->method = x->line.method ? x->line.method : d.method;
  p->sets = x->line.sets;
  p->starts = x->line.starts;
  p->cpu = x->cpu;
  pw_limit limit;
  int status = pw_cli_settings (&x->line, &d, &p->t_end, &p->settings, &limit, error);
  p->limit = limit.most;
  if (status == PW_OK) pw_cli_unused (p->method, &x->line);
  if (status == PW_OK) status = pw_cli_specialise (x->line.specialise, &p->specialise, error);
  if (status == PW_OK) status = sweep_lanes (x, error);
  if (status == PW_OK) status = pw_parallel_jobs (x->jobs_text, &x->jobs, error);
  return status == PW_OK ? sweep_part (x, error) : status;
}

static int sweep_open (sweep *x, pw_error *error) {
  pw_use use[] = { PW_CLI_MODEL_USE, { "-o", x->path, PW_WRITES, NULL } };
  x->plan.file = pw_cli_file (&x->line, error);
  if (x->plan.file == NULL) return error->status;
  int status = sweep_settings (x, error);
  if (status == PW_OK) status = pw_plan_open (&x->plan, x->ranges, error);
  if (status == PW_OK && x->plan.parts > x->plan.grid.rows)
    status = pw_fail (error, PW_INPUT, "--part %s: the grid has only %ld rows", x->part_text, x->plan.grid.rows);
  if (status == PW_OK) status = pw_cli_uses (&x->line, x->plan.file, use, sizeof use / sizeof *use, error);
  if (status == PW_OK) status = pw_journal_open (&x->journal, &x->plan, x->path, error);
  if (status != PW_OK) return status;
  if (x->journal.done > 0)
    pw_cli_say ("pinwheel: continuing with %s: %ld of %ld runs are done\n", x->journal.part, x->journal.done,
                x->journal.rows);
  return PW_OK;
}

/* ---- Specialised code ---- */

/* The code of a text, compiled by the first thread that needs it; the caller holds the lock. */
static const pw_specialised *sweep_compile (sweep *x, char *text, const pw_system *s, pw_error *error) {
  sweep_code *c = x->codes;
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
  *c = (sweep_code){ .text = text, .next = x->codes };
  x->codes = c;
  pthread_mutex_unlock (&x->lock);
  c->code = pw_scene_code_open (text, s, error);
  pthread_mutex_lock (&x->lock);
  c->ready = 1;
  pthread_cond_broadcast (&x->compiled);
  return pw_scene_code_table (c->code);
}

/* The code of a new system: that of the first row, or of its own text, so that it does not depend on the order of runs. */
static void sweep_specialise (sweep *x, pw_sweep_system *s, pw_error *error) {
  const pw_specialised *first = pw_cli_engine_code (&x->plan.engine);
  pw_error own = { 0 };
  if (first == NULL || error->status != PW_OK) return;
  if (pw_specialised_fits (first, s->m.system)) {
    s->code = first;
    return;
  }
  char *text = pw_cli_source (s->m.system, NULL);
  if (text == NULL) return;
  pthread_mutex_lock (&x->lock);
  s->code = sweep_compile (x, text, s->m.system, &own);
  pthread_mutex_unlock (&x->lock);
  if (own.status != PW_OK && pw_stop == 0) pw_cli_say ("pinwheel: general engine: %s\n", own.text);
  if (s->code == NULL && pw_stop) error->status = PW_RETRY; /* Ctrl-C has stopped the compiler too */
}

/* ---- Compiled systems; the caller holds the lock ---- */

/* Ends the use of a system; the last user frees it. */
static void sweep_release (sweep *x, shared_system *s) {
  shared_system **at = &x->shared;
  if (s == NULL || --s->users > 0) return;
  while (*at != s) at = &(*at)->next;
  *at = s->next;
  pw_sweep_system_close (&s->system);
  free (s);
}

/* The system of a row, shared with other threads, or compiled without the lock.  NULL if out of memory. */
static shared_system *sweep_share (sweep *x, long row) {
  long parameters = pw_grid_parameters (&x->plan.grid, row);
  shared_system *s = x->shared;
  while (s && s->parameters != parameters) s = s->next;
  if (s) {
    s->users++;
    while (!s->ready) pthread_cond_wait (&x->compiled, &x->lock);
    return s;
  }
  if ((s = calloc (1, sizeof *s)) == NULL) return NULL;
  *s = (shared_system){ .parameters = parameters, .users = 1, .next = x->shared };
  x->shared = s;
  pthread_mutex_unlock (&x->lock);
  pw_sweep_system_open (&s->system, &x->plan, row, &s->error);
  sweep_specialise (x, &s->system, &s->error);
  pthread_mutex_lock (&x->lock);
  s->ready = 1;
  pthread_cond_broadcast (&x->compiled);
  return s;
}

/* ---- The sweep ---- */

/* Stores the first error, which stops the sweep. */
static void sweep_fail (sweep *x, long row, const char *why) {
  if (x->error->status == PW_OK) pw_fail (x->error, PW_RESOURCE, "row %ld of the grid: %s", row + 1, why);
  if (pw_stop == 0) pw_stop = 1;
}

/* Stores a row, or the first error. */
static void sweep_keep (sweep *x, long row, int status, const pw_text *text, const pw_error *own) {
  if (status == PW_RETRY || x->error->status != PW_OK) return;
  if (status == PW_RESOURCE)
    sweep_fail (x, row, own->text);
  else if (pw_journal_add (&x->journal, &x->plan, row, -status, text->at, &x->scratch, x->error) == PW_OK)
    pw_progress_at (&x->progress, (double)x->journal.done);
  if (x->error->status != PW_OK && pw_stop == 0) pw_stop = 1;
}

/* The next missing row of the part; -1 if there is none. */
static long sweep_take (sweep *x) {
  const pw_plan *p = &x->plan;
  while (pw_stop == 0 && x->next < p->grid.rows) {
    long row = pw_grid_ordered (&p->grid, x->next++);
    if (row % p->parts == p->part - 1 && x->journal.line[row / p->parts] == 0) return row;
  }
  return -1;
}

/* A thread's runs: as many as fit into lanes, else one. */
typedef struct {
  sweep *x;
  const pw_specialised_lanes *code;
  void *memory;
  int width;
  pw_sweep_run run[SWEEP_LANES];
  shared_system *system[SWEEP_LANES]; /* NULL: no run */
  shared_system *last; /* of a run that has ended, kept since the next row may have the same parameters */
  pw_text text;
} sweep_worker;

/* Opens the run of the next row; 0 if there is none.  The caller holds the lock. */
static int sweep_begin (sweep_worker *w, int k) {
  sweep *x = w->x;
  pw_error own = { 0 };
  long row = sweep_take (x);
  if (row < 0) return 0;
  w->system[k] = sweep_share (x, row);
  if (w->system[k] == NULL)
    sweep_fail (x, row, "out of memory");
  else
    own = w->system[k]->error;
  pthread_mutex_unlock (&x->lock);
  if (w->system[k]) pw_sweep_run_open (&w->run[k], &x->plan, &w->system[k]->system, row, &own);
  pthread_mutex_lock (&x->lock);
  return w->system[k] != NULL;
}

/* Counts changed initial values.  The caller holds the lock. */
static void sweep_change (sweep *x, const pw_sweep_run *r) {
  x->runs++;
  x->changed += r->change > 0;
  if (!(r->change > x->change)) return;
  x->change = r->change;
  memcpy (x->worst, r->changed, sizeof x->worst);
}

/* Stores the row of a run that has ended.  The caller holds the lock. */
static void sweep_end (sweep_worker *w, int k) {
  sweep *x = w->x;
  sweep_change (x, &w->run[k]);
  pthread_mutex_unlock (&x->lock);
  pw_text_clear (&w->text);
  int status = pw_sweep_run_close (&w->run[k], &w->text);
  pthread_mutex_lock (&x->lock);
  sweep_keep (x, w->run[k].row, status, &w->text, &w->run[k].error);
  sweep_release (x, w->last);
  w->last = w->system[k];
  w->system[k] = NULL;
}

/* Advances the runs, those with the first system's code in lanes, until one of them ends. */
static void sweep_advance (sweep_worker *w) {
  const double t_end = w->x->plan.t_end;
  pw_run *run[SWEEP_LANES];
  int which[SWEEP_LANES], status[SWEEP_LANES], n = 0, same = 1, ended = 0;
  pw_error error[SWEEP_LANES];
  for (int k = 0; k < w->width; k++) {
    if (w->system[k] == NULL) continue;
    if (pw_sweep_run_ended (&w->run[k])) return;
    same &= w->system[k]->system.code == pw_cli_engine_code (&w->x->plan.engine);
    which[n] = k, error[n] = (pw_error){ 0 }, run[n++] = w->run[k].run;
  }
  while (!ended) {
    pw_runs_advance (run, n, t_end, same ? w->code : NULL, w->memory, status, error);
    for (int i = 0; i < n; i++) ended |= status[i] != PW_OK || !(pw_run_time (run[i]) < t_end);
  }
  for (int i = 0; i < n; i++) w->run[which[i]].status = status[i], w->run[which[i]].error = error[i];
}

/* Computes rows until there are none. */
static void sweep_thread (void *context, int i) {
  sweep *x = context;
  sweep_worker w = { .x = x, .code = pw_scene_code_lanes (x->plan.code), .width = 1 };
  (void)i;
  if (w.code && (w.memory = pw_specialised_lanes_memory (w.code)) != NULL)
    w.width = pw_specialised_lanes_count (w.code);
  if (w.width > SWEEP_LANES) w.width = 1;
  while (w.width > 1 && x->journal.rows < (long)w.width * x->jobs) w.width--; /* work for all threads */
  pthread_mutex_lock (&x->lock);
  for (int runs = 1; runs > 0;) {
    for (int k = runs = 0; k < w.width; k++) runs += w.system[k] != NULL || sweep_begin (&w, k);
    pthread_mutex_unlock (&x->lock);
    if (runs) sweep_advance (&w);
    pthread_mutex_lock (&x->lock);
    for (int k = 0; k < w.width; k++)
      if (w.system[k] && pw_sweep_run_ended (&w.run[k])) sweep_end (&w, k);
  }
  sweep_release (x, w.last);
  pthread_mutex_unlock (&x->lock);
  pw_text_free (&w.text);
  free (w.memory);
}

static void sweep_all (sweep *x) {
  if (x->jobs > x->journal.rows) x->jobs = (int)x->journal.rows;
  pthread_mutex_init (&x->lock, NULL);
  pthread_cond_init (&x->compiled, NULL);
  pw_parallel (x->jobs, x->jobs, sweep_thread, x, x->error);
  pthread_cond_destroy (&x->compiled);
  pthread_mutex_destroy (&x->lock);
}

static int sweep_run (sweep *x, pw_error *error) {
  x->error = error;
  pw_stop_catch ();
  pw_progress_count (&x->progress, pw_file_name (x->plan.file), "runs", (double)x->journal.done,
                     (double)x->journal.rows);
  sweep_all (x);
  pw_progress_end (&x->progress);
  pw_stop_release (); /* the rest can be interrupted and repeated */
  return error->status;
}

/* ---- The end ---- */

/* Failed runs are rows; the sweep fails only if all runs failed.  A part leaves that to the merge. */
static int sweep_verdict (const pw_tally *tally, int is_part, pw_error *error) {
  if (tally->failed == 0) return PW_OK;
  if (tally->failed == tally->rows && !is_part)
    return pw_fail (error, -tally->status, "all %ld runs failed, the first one: %s", tally->rows, tally->reason);
  pw_cli_say ("pinwheel: %ld of %ld runs failed, the first of them: %s\n", tally->failed, tally->rows, tally->reason);
  return PW_OK;
}

static int sweep_merge (sweep *x, pw_error *error) {
  pw_tally tally;
  const char *option = sweep_not_for_merge (x);
  if (option)
    return pw_fail (error, PW_INPUT, "%s cannot be combined with --merge: the parts define the sweep", option);
  int status = pw_sweep_merge (x->line.argument, x->line.arguments, x->path, &tally, error);
  return status == PW_OK ? sweep_verdict (&tally, 0, error) : status;
}

static int sweep_finish (sweep *x, pw_error *error) {
  pw_tally tally;
  if (x->changed)
    pw_cli_say ("pinwheel: in %ld of %ld runs the constraints changed given initial values, at worst %s\n", x->changed,
                x->runs, x->worst);
  if (x->journal.done == 0) {
    fputs ("pinwheel: interrupted before the first run was done\n", stderr);
    return PW_INTERRUPTED;
  }
  if (x->journal.done < x->journal.rows) {
    pw_cli_say ("pinwheel: interrupted; %ld of %ld runs are kept in %s; the same command continues from there\n",
                x->journal.done, x->journal.rows, x->journal.part);
    return PW_INTERRUPTED;
  }
  int status = pw_sweep_finish (&x->journal, &x->plan, &tally, error);
  return status == PW_OK ? sweep_verdict (&tally, x->plan.parts > 1, error) : status;
}

static void sweep_close (sweep *x) {
  for (sweep_code *c = x->codes, *next; c; c = next) {
    next = c->next;
    pw_scene_code_close (c->code);
    free (c->text);
    free (c);
  }
  pw_journal_close (&x->journal);
  pw_plan_close (&x->plan);
  pw_file_close (x->plan.file);
  pw_text_free (&x->scratch);
}

static int sweep_command (void *options, pw_error *error) {
  sweep *x = options;
  x->journal.file = -1;
  int status = sweep_read (x, error);
  if (status == PW_OK && x->merge)
    status = sweep_merge (x, error);
  else if (status == PW_OK) {
    status = sweep_open (x, error);
    if (status == PW_OK) status = sweep_run (x, error);
    if (status == PW_OK) status = sweep_finish (x, error);
  }
  sweep_close (x);
  return status;
}

static const struct poptOption sweep_options[] = {
  PW_OPTION_GROUP ("Sweep"),
  PW_LIST_OPTION (sweep, ranges, "vary", 'v', "NAME=RANGE",
                  "Vary a parameter or an initial value such as frame.vx; repeatable, the last one varies fastest. "
                  "RANGE: lin:FIRST:LAST:COUNT, log:FIRST:LAST:COUNT, or a list V1,V2,..."),
  PW_TEXT_OPTION (sweep, path, "output", 'o', "FILE.csv", "Write the table to this file"),
  PW_TEXT_OPTION (sweep, jobs_text, "jobs", 'j', "N", "Number of threads (default: one per processor)"),
  PW_TEXT_OPTION (sweep, lanes_text, "lanes", 0, "N",
                  "Runs that a thread advances at once, 1, 2, 4 or 8, with steps of fixed size and specialised code "
                  "(default: as many as pay)"),
  PW_TEXT_OPTION (sweep, part_text, "part", 0, "I/N", "Compute every N-th row, from the I-th on, for a later --merge"),
  PW_FLAG_OPTION (sweep, merge, "merge", "Merge the parts named instead of a model"),
  PW_FLAG_OPTION (sweep, cpu, "cpu", "Add a column with the processor time of each run, which is never reproducible"),
  PW_METHOD_OPTIONS,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_sweep = {
  .name = "sweep",
  .synopsis = "MODEL --vary NAME=RANGE... -o FILE.csv [OPTION...]",
  .summary = "tabulate runs for all combinations of varied parameters",
  .help =
      "Run a model for all combinations of varied parameters and initial values, and write a table with one row per "
      "run. A sweep that was interrupted is continued by the same command. A sweep may be divided into parts, which "
      "`pinwheel sweep --merge PART... -o FILE.csv` puts together.",
  .size = sizeof (sweep),
  .function = sweep_command,
  .options = sweep_options,
};
