/* Common functions of compare and drift: methods, runs, the sequence of a command. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "study.h"
#include "util.h"

#define STUDY_SHORT 0.005 /* CPU time [s] of a batch of steps below which batches become longer */
#define STUDY_LONG 0.02   /* and above which they become shorter */

/* ---- Methods ---- */

static int methods_add (pw_study *x, const char *name, pw_error *error) {
  const pw_method *integrator;
  int stabilisation, status = pw_method_parse (name, &integrator, &stabilisation, error);
  if (status != PW_OK) return status;
  for (int i = 0; i < x->methods; i++)
    if (strcmp (x->method[i], name) == 0) return PW_OK;
  void *more = realloc (x->method, (size_t)(x->methods + 1) * sizeof *x->method);
  if (more == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  x->method = more;
  strcpy (x->method[x->methods++], name);
  return PW_OK;
}

/* Adds an integrator, or all of them (NULL), with a stabilisation, or all of them (NULL). */
static int methods_add_all (pw_study *x, const pw_method *integrator, const char *stabilisation, pw_error *error) {
  char name[STUDY_NAME];
  pw_nearest near = { .sought = stabilisation };
  int status = PW_OK, found = 0;
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; status == PW_OK && s->name; s++) {
      if (integrator && integrator != pw_methods[i]) continue;
      if (stabilisation) pw_nearest_try (&near, s->name);
      if (stabilisation && strcmp (stabilisation, s->name) != 0) continue;
      snprintf (name, sizeof name, "%s+%s", pw_methods[i]->name, s->name);
      status = methods_add (x, name, error);
      found = 1;
    }
  if (status != PW_OK || found) return status;
  return pw_fail (error, PW_INPUT, "--methods all+%.60s: no integrator has this stabilisation%s", stabilisation,
                  pw_nearest_text (&near));
}

/* "all", "INTEGRATOR+all", "all+STABILISATION", or a method. */
static int methods_add_item (pw_study *x, char *item, pw_error *error) {
  const pw_method *integrator;
  int stabilisation;
  char *plus = item + strcspn (item, "+:");
  if (strcmp (item, "all") == 0 || strcmp (item, "all+all") == 0) return methods_add_all (x, NULL, NULL, error);
  if (strncmp (item, "all+", 4) == 0) return methods_add_all (x, NULL, item + 4, error);
  if (strcmp (plus, "+all") != 0) return methods_add (x, item, error);
  *plus = 0;
  int status = pw_method_parse (item, &integrator, &stabilisation, error);
  return status == PW_OK ? methods_add_all (x, integrator, NULL, error) : status;
}

int pw_study_read_methods (pw_study *x, const char *text, pw_error *error) {
  int status = PW_OK;
  for (const char *at = text; status == PW_OK; at++) {
    char item[STUDY_NAME];
    size_t n = strcspn (at, ",");
    if (n == 0 || n >= sizeof item)
      return pw_fail (error, PW_INPUT, "--methods \"%.80s\": %s", text, n ? "too long a name" : "a name is missing");
    snprintf (item, sizeof item, "%.*s", (int)n, at);
    status = methods_add_item (x, item, error);
    at += n;
    if (*at == 0) break;
  }
  return status;
}

/* ---- Rows ---- */

pw_row *pw_study_add (pw_study *x, int group, int line, const char *method, int points, pw_error *error) {
  pw_row *r = realloc (x->row, (size_t)(x->rows + 1) * sizeof *r);
  double (*point)[STUDY_COORDINATES] = malloc ((size_t)points * sizeof *point);
  if (r) x->row = r;
  if (r == NULL || point == NULL) {
    free (point);
    pw_fail (error, PW_RESOURCE, "out of memory");
    return NULL;
  }
  r += x->rows++;
  *r = (pw_row){ .group = group, .line = line, .points = points, .point = point };
  snprintf (r->method, sizeof r->method, "%s", method);
  for (int i = 0; i < STUDY_COLUMNS; i++) r->value[i] = NAN;
  for (int k = 0; k < points; k++)
    for (int i = 0; i < STUDY_COORDINATES; i++) r->point[k][i] = NAN;
  return r;
}

void pw_study_show (pw_study *x, const char *what, const char *unit, int rows) {
  x->finished = 0;
  pw_progress_count (&x->progress, what, unit, 0, rows);
}

void pw_study_part (pw_study *x, pw_row *r, double part) {
  pthread_mutex_lock (&x->mutex);
  x->finished += fmin (part, 1) - r->part;
  r->part = fmin (part, 1);
  pw_progress_at (&x->progress, x->finished);
  pthread_mutex_unlock (&x->mutex);
}

/* Advances in batches of steps, so that clocks are read rarely. */
static int study_steps (pw_study *x, pw_row *r, pw_run *run, const pw_limit *limit, pw_study_visitor *v,
                        pw_error *error) {
  int status = PW_OK;
  long batch = 8;
  while (status == PW_OK && pw_run_time (run) < x->t_end) {
    double start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
    long n = 0;
    do {
      status = pw_run_advance_towards (run, v ? v->due : x->t_end, x->t_end, error);
      if (status == PW_OK && v && pw_run_time (run) >= v->due) status = v->visit (v, run, error);
    } while (status == PW_OK && ++n < batch && pw_run_time (run) < x->t_end);
    double used = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - start;
    r->cpu += used;
    if (used < STUDY_SHORT && n == batch && batch < 65536) batch *= 2;
    if (used > STUDY_LONG && batch > 1) batch /= 2;
    pw_study_part (x, r, x->share * (r->runs + pw_run_time (run) / x->t_end));
    if (status == PW_STOPPED) return pw_limit_status (limit, pw_run_time (run), error);
    if (status == PW_OK && r->cpu > x->cpu_end && pw_run_time (run) < x->t_end) {
      r->state = ROW_STOPPED;
      return PW_RETRY;
    }
  }
  return status;
}

int pw_study_run (pw_study *x, pw_row *r, const pw_settings *settings, pw_study_visitor *v, pw_error *error) {
  pw_settings own = *settings;
  pw_limit limit = x->limit;
  r->cpu = 0;
  pw_limit_start (&limit);
  own.stop = pw_limit_over;
  own.stop_context = &limit;
  own.specialised = pw_scene_code_table (x->engine.code);
  pw_run *run = pw_run_open (x->m.system, r->method, &own, error);
  if (run == NULL) return error->status;
  int status = study_steps (x, r, run, &limit, v, error);
  r->t = pw_run_time (run);
  r->statistics = *pw_run_statistics (run);
  r->runs += status == PW_OK;
  pw_run_close (run);
  return status;
}

int pw_study_parallel (pw_study *x, int count, pw_task *task, void *context, pw_error *error) {
  int status = (x->type->timed ? pw_parallel_timed : pw_parallel) (x->jobs, count, task, context, error);
  pw_progress_end (&x->progress);
  return status;
}

int pw_study_outcome (const pw_study *x, pw_row *r, int status, const pw_error *run_error, pw_error *error) {
  const pw_statistics *s = &r->statistics;
  const long count[] = { s->steps, s->rejected, s->rhs, s->jacobians, s->factorisations };
  for (int i = 0; i < 5; i++) r->value[x->type->steps + i] = (double)count[i];
  r->value[x->type->time] = r->t;
  if (status == PW_OK || r->state == ROW_STOPPED) return PW_OK;
  if (status == PW_RESOURCE || status == PW_INITIAL) return pw_fail (error, status, "%s", run_error->text);
  if (pw_stop) return PW_RETRY;
  r->state = status == PW_INPUT ? ROW_REFUSED : ROW_FAILED;
  snprintf (r->reason, sizeof r->reason, "%s",
            run_error->status ? run_error->text : "the method failed without giving a reason");
  return PW_OK;
}

/* ---- The command ---- */

static int study_open_folder (pw_study *x, pw_error *error) {
  const char *const *tables = x->type->tables;
  const char *const names[] = { ".dat", ".gp", ".svg", ".png", ".pdf", tables[0], tables[1], NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--reference", x->reference_path, PW_READS, NULL },
                   { "-o", x->folder, PW_WRITES_INTO, names } };
  if (x->folder == NULL) return pw_cli_requires ("--width", x->line.width, "-o DIR", 0, error);
  if (pw_figures_of (&x->figures, &x->line, &x->m, x->folder, error) != PW_OK) return error->status;
  if (pw_cli_check_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  x->lock = pw_cli_lock_folder (x->folder, error);
  return x->lock < 0 ? error->status : pw_study_open_table (x, error);
}

/* Estimated number of steps of all runs. */
static double study_work (const pw_study *x) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  double steps = 0;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++) {
    pw_settings s = x->settings;
    if (r->level > 0) s.step = s.rtol = r->level;
    steps += x->type->runs * pw_method_steps (r->method, &s, d.step, x->t_end);
  }
  return steps;
}

static int study_open (pw_study *x, pw_error *error) {
  pw_specialise when;
  x->lock = -1;
  x->share = 1;
  x->cpu_end = INFINITY;
  pthread_mutex_init (&x->mutex, NULL);
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = pw_parallel_jobs (x->jobs_text, &x->jobs, error);
  if (status == PW_OK) status = x->type->plan (x, error);
  if (status == PW_OK) status = pw_cli_specialise (x->line.specialise, &when, error);
  if (status != PW_OK) return status;
  pw_cli_engine_open (&x->engine, x->m.system, when, study_work (x)); /* of all runs, since their times are compared */
  return study_open_folder (x, error);
}

/* Measures a row, then writes all rows that are done before the first one that is not: in their order. */
static int study_row (void *context, int i, pw_error *error) {
  pw_study *x = context;
  int status = x->type->measure (x, &x->row[i], error);
  if (status != PW_OK) return status;
  pw_study_part (x, &x->row[i], 1);
  pthread_mutex_lock (&x->mutex);
  x->row[i].measured = 1;
  pw_progress_end (&x->progress);
  for (; status == PW_OK && x->done < x->rows && x->row[x->done].measured; x->done++)
    status = pw_study_write_row (x, &x->row[x->done], error);
  pthread_mutex_unlock (&x->mutex);
  return status;
}

static int study_method (void *context, int line, pw_error *error) {
  const pw_study *x = context;
  int status = PW_OK;
  for (int i = 0; status == PW_OK && i < x->rows; i++)
    if (x->row[i].line == line) status = study_row (context, i, error);
  return status;
}

/* Writes the rows that are done after one that an interruption has stopped. */
static int study_write_kept (pw_study *x, pw_error *error) {
  for (const pw_row *r = x->row + x->done; r < x->row + x->rows; r++) {
    if (!r->measured) continue;
    if (pw_study_write_row (x, r, error) != PW_OK) return error->status;
    x->done++;
  }
  return PW_RETRY;
}

static int study_rows (pw_study *x, pw_error *error) {
  pw_stop_catch ();
  int status = x->type->begin (x, error);
  if (status == PW_OK && x->engine.code) puts ("all runs use code specialised for this scene where the method can\n");
  if (status == PW_OK && x->engine.code == NULL) printf ("all runs use the general engine: %s\n\n", x->engine.reason);
  pw_study_show (x, pw_file_name (x->m.file), x->type->unit, x->rows);
  if (status == PW_OK && x->type->timed)
    status = pw_study_parallel (x, x->methods, study_method, x, error);
  else if (status == PW_OK)
    status = pw_study_parallel (x, x->rows, study_row, x, error);
  if (status == PW_RETRY && pw_stop) status = study_write_kept (x, error);
  if (status == PW_OK && x->type->conclude) x->type->conclude (x);
  pw_stop_release ();
  return status;
}

/* A complete CSV file gets its final name; the figures show all of its rows. */
static int study_finish (pw_study *x, int status, pw_error *error) {
  char part[FIGURE_PATH + 16] = "";
  if (x->csv && status == PW_OK)
    status = pw_output_finish (x->csv, error);
  else if (x->csv)
    pw_cli_abandon_table (x->csv, x->done, part, sizeof part);
  if (status == PW_RETRY && pw_stop) {
    pw_cli_say ("pinwheel: interrupted; %d of %d %s are done%s%s\n", x->done, x->rows, x->type->unit,
                *part ? ", and kept in " : "", part);
    return PW_INTERRUPTED;
  }
  if (x->csv && status == PW_OK) status = x->type->figures (x, error);
  return status == PW_OK && x->drawn[0] ? pw_figure_draw (x->folder, x->drawn, error) : status;
}

/* A study in which no run has reached the end is a failure. */
static int study_verdict (const pw_study *x, pw_error *error) {
  const pw_row *failed = NULL;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++) {
    if (r->state == ROW_DONE) return PW_OK;
    if (r->state == ROW_FAILED || r->state == ROW_REFUSED) failed = r;
  }
  return failed ? pw_fail (error, PW_METHOD, "no method has reached the end; the last error: %s", failed->reason)
                : pw_fail (error, PW_METHOD, "no method has reached the end within the limit; see --limit");
}

int pw_study_command (pw_study *x, const pw_study_type *type, pw_error *error) {
  x->type = type;
  int status = study_open (x, error);
  if (status == PW_OK) status = study_rows (x, error);
  status = study_finish (x, status, error);
  if (status == PW_OK) status = study_verdict (x, error);
  if (x->lock >= 0) close (x->lock);
  type->close (x);
  for (int i = 0; i < x->rows; i++) free (x->row[i].point);
  free (x->row);
  free (x->method);
  pthread_mutex_destroy (&x->mutex);
  pw_cli_engine_close (&x->engine);
  pw_cli_close_model (&x->m);
  return status == PW_INTERRUPTED ? status : error->status;
}
