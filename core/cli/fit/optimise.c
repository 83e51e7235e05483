/* pinwheel optimise: parameters and initial values for which an output is largest or smallest.
 *
 * Local searches (NLopt) from several starts: the initial values, and Sobol points of the bounds,
 * displaced by the seed.  Each start is a task of its own, so that results do not depend on the number of threads.  The
 * best results continue with a tighter tolerance.  A run that fails gets a value that is worse than all before it. */
#define _POSIX_C_SOURCE 200809L
#include "optimise.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "parallel.h"

enum { OPTIMISE_POLISHED = 3 };         /* results that continue */
static const double OPTIMISE_FAR = 1e6; /* in units of its scale: an unknown without bounds has no optimum */

/* ---- Starts ---- */

static int optimise_open_starts (pw_optimise *x, pw_error *error) {
  const size_t n = (size_t)x->unknowns.count, width = 2 * n + (size_t)x->outputs, starts = (size_t)x->starts,
               all = starts + OPTIMISE_POLISHED;
  double *point = pw_unknowns_starts (&x->unknowns, x->starts, x->seed),
         *memory = pw_arena_alloc (&x->arena, all * width * sizeof *memory);
  x->start = pw_arena_alloc (&x->arena, all * sizeof *x->start);
  int status = point && memory && x->start ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t i = 0; status == PW_OK && i < all; i++) {
    pw_search_start *s = x->start + i;
    s->first = memory + i * width, s->best = s->first + n, s->value = s->best + n;
    if (i < starts) memcpy (s->first, point + i * n, n * sizeof *point);
  }
  free (point);
  return status;
}

/* The best of the first `count` starts, which are not `used`; the first one of equal ones.  -1: there is none. */
static int optimise_best (const pw_optimise *x, int count, const unsigned char *used) {
  int best = -1;
  for (int i = 0; i < count; i++)
    if (x->start[i].found && !(used && used[i]) &&
        (best < 0 || x->sign[0] * x->start[i].value[0] < x->sign[0] * x->start[best].value[0]))
      best = i;
  return best;
}

/* Different optima continue, the best ones first. */
static int optimise_continue (pw_optimise *x, pw_error *error) {
  unsigned char *used = calloc ((size_t)x->starts, 1);
  if (used == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int best; x->polished < OPTIMISE_POLISHED && (best = optimise_best (x, x->starts, used)) >= 0;) {
    pw_search_start *s = x->start + x->starts + x->polished++;
    memcpy (s->first, x->start[best].best, (size_t)x->unknowns.count * sizeof *s->first);
    for (int i = 0; i < x->starts; i++) used[i] |= (unsigned char)pw_optimise_same (x, x->start + i, x->start + best);
  }
  free (used);
  return pw_parallel (x->jobs, x->polished, pw_search_fine, x, error);
}

static void optimise_count (pw_optimise *x) {
  for (const pw_search_start *s = x->start; s < x->start + x->starts + x->polished; s++) {
    x->runs += s->runs, x->failed += s->failed, x->derivatives += s->derivatives;
    if (x->why == NULL && s->failed) x->why = &s->error;
  }
}

static int optimise_search (pw_optimise *x, pw_error *error) {
  pw_stop_catch ();
  pthread_mutex_init (&x->lock, NULL);
  pw_progress_count (&x->progress, pw_file_name (x->m.file), "starts", 0, x->starts + OPTIMISE_POLISHED);
  int status = pw_parallel (x->jobs, x->starts, pw_search_rough, x, error);
  if (status == PW_OK) status = optimise_continue (x, error);
  pw_progress_end (&x->progress);
  pthread_mutex_destroy (&x->lock);
  pw_stop_release ();
  x->best = optimise_best (x, x->starts + x->polished, NULL);
  optimise_count (x);
  return x->error.status != PW_OK ? pw_fail (error, x->error.status, "%s", x->error.text) : status;
}

/* ---- Before the search ---- */

/* "OUTPUT<=VALUE" or "OUTPUT>=VALUE", split in place. */
static int optimise_constraint (pw_optimise *x, char *text, const char *given, pw_error *error) {
  char *at = NULL;
  for (char *c = text; *c; c++)
    if ((*c == '<' || *c == '>') && c[1] == '=') at = c;
  if (at == NULL || pw_read_expression (at + 2, &x->bound[x->outputs]) != PW_OK || !isfinite (x->bound[x->outputs]))
    return pw_fail (error, PW_INPUT, "--subject-to %.200s: expected OUTPUT<=VALUE or OUTPUT>=VALUE", given);
  x->sign[x->outputs] = *at == '<' ? 1 : -1;
  *at = 0;
  while (at > text && at[-1] == ' ') *--at = 0;
  x->text[x->outputs++] = text;
  return PW_OK;
}

static int optimise_texts (pw_optimise *x, pw_error *error) {
  size_t count = 1;
  int status = PW_OK;
  for (const char **c = x->subject; c && *c; c++) count++;
  x->text = pw_arena_alloc (&x->arena, (count + 1) * sizeof *x->text);
  x->unit = pw_arena_alloc (&x->arena, count * sizeof *x->unit);
  x->bound = pw_arena_alloc (&x->arena, 2 * count * sizeof *x->bound);
  if (x->text == NULL || x->unit == NULL || x->bound == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  x->sign = x->bound + count;
  x->text[0] = x->objective;
  x->sign[0] = x->maximise ? -1 : 1;
  x->outputs = 1;
  for (const char **c = x->subject; c && *c && status == PW_OK; c++) {
    char *copy = pw_arena_copy (&x->arena, *c);
    status = copy ? optimise_constraint (x, copy, *c, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  }
  return status;
}

/* Reads outputs as every run will; extrema have kinks. */
static int optimise_outputs (pw_optimise *x, int from, int count, const char *option, pw_error *error) {
  pw_outcomes o;
  int status = pw_outcomes_open (&o, x->m.system, option, x->text + from, count, error);
  for (int i = 0; i < o.outcomes; i++) pw_outcome_unit (&o, i, x->unit[from + i], sizeof *x->unit);
  for (int i = 0; i < o.functionals; i++) x->smooth &= !pw_is_extremum (o.functional[i].type);
  pw_outcomes_close (&o);
  return status;
}

static int optimise_read (pw_optimise *x, pw_error *error) {
  double starts = 10;
  x->objective = x->maximise ? x->maximise : x->minimise;
  x->best = -1;
  x->leading = INFINITY;
  x->seed = 1;
  if (x->objective == NULL || (x->maximise && x->minimise))
    return pw_fail (error, PW_INPUT, "expected one of --maximise OUTPUT and --minimise OUTPUT");
  int status = pw_cli_number ("--starts", x->starts_text, PW_COUNT, &starts, error);
  if (status == PW_OK) status = pw_cli_number ("--seed", x->seed_text, PW_COUNT, &x->seed, error);
  if (status == PW_OK) status = pw_parallel_jobs (x->jobs_text, &x->jobs, error);
  if (status == PW_OK && starts > 1e5) status = pw_fail (error, PW_INPUT, "--starts: at most 100000");
  if (status == PW_OK) status = pw_cli_requires ("--width", x->line.width, "--plots DIR", x->plots_path != NULL, error);
  x->starts = (int)starts;
  return status == PW_OK ? optimise_texts (x, error) : status;
}

enum { OPTIMISE_RESULT = 1, OPTIMISE_SUMMARY }; /* in the list of files */

static int optimise_open (pw_optimise *x, pw_error *error) {
  static const char *const figures[] = { "optimise.dat", "optimise.gp",  "optimise.svg",
                                         "optimise.png", "optimise.pdf", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "-o", x->path, PW_WRITES, NULL },
                   { "--json", x->json_path, PW_WRITES, NULL },
                   { "--plots", x->plots_path, PW_WRITES_INTO, figures } };
  int status = pw_cli_open (&x->m, &x->line, error);
  x->smooth = 1;
  if (status == PW_OK) status = optimise_outputs (x, 0, 1, x->maximise ? "--maximise" : "--minimise", error);
  if (status == PW_OK) status = optimise_outputs (x, 1, x->outputs - 1, "--subject-to", error);
  if (status == PW_OK) status = pw_unknowns_open (&x->unknowns, &x->line, &x->m, error);
  if (status == PW_OK) status = pw_unknowns_read (&x->unknowns, x->free, error);
  if (status == PW_OK) pw_unknowns_engine (&x->unknowns, 20. * x->starts);
  if (status == PW_OK && x->unknowns.count > PW_UNKNOWNS_STARTED)
    status = pw_fail (error, PW_INPUT, "--free: at most %d unknowns", PW_UNKNOWNS_STARTED);
  if (status == PW_OK) status = pw_files_open (&x->files, &x->line, &x->m, use, sizeof use / sizeof *use, error);
  return status == PW_OK ? optimise_open_starts (x, error) : status;
}

/* ---- After the search ---- */

/* No run satisfied the constraints: the first error, if there was one. */
static int optimise_nothing (const pw_optimise *x, pw_error *error) {
  if (x->failed == x->runs && x->why)
    return pw_fail (error, x->why->status, "none of %ld runs succeeded, the first one: %s", x->runs, x->why->text);
  return pw_fail (error, PW_METHOD, "no run from %d starts satisfies --subject-to", x->starts);
}

/* PW_METHOD if the search that found the best result did not converge: it ended at its limit of runs, or far away. */
static int optimise_converged (const pw_optimise *x, pw_error *error) {
  const pw_search_start *s = x->start + x->best;
  const pw_unknown *far = NULL;
  double most = 0;
  for (int i = 0; i < x->unknowns.count; i++) {
    const pw_unknown *k = x->unknowns.list + i;
    if (!k->has_bounds && fabs (s->best[i]) >= most * k->scale) far = k, most = fabs (s->best[i]) / k->scale;
  }
  if (s->converged && most < OPTIMISE_FAR) return PW_OK;
  if (far == NULL) return pw_fail (error, PW_METHOD, "the search did not converge in %ld runs", s->runs);
  return pw_fail (error, PW_METHOD,
                  "the search did not converge in %ld runs; perhaps there is no optimum without bounds, "
                  "such as --free %s=LOW:HIGH",
                  s->runs, far->name);
}

static int optimise_finish (pw_optimise *x, pw_error *error) {
  FILE *result = pw_files_stream (&x->files, OPTIMISE_RESULT), *summary = pw_files_stream (&x->files, OPTIMISE_SUMMARY);
  int interrupted = pw_stop != 0;
  if (x->best < 0 && interrupted) fputs ("pinwheel: interrupted before the first run was done\n", stderr);
  if (x->best < 0) return interrupted ? PW_INTERRUPTED : optimise_nothing (x, error);
  pw_error why = { 0 };
  int converged = optimise_converged (x, &why) == PW_OK;
  pw_optimise_print (x);
  pw_unknowns_report (&x->unknowns, x->start[x->best].best);
  if (result) pw_optimise_yaml (x, result);
  if (summary) pw_optimise_json (x, interrupted ? "interrupted" : converged ? "ok" : "method", summary);
  int status = pw_files_finish (&x->files, error);
  if (status == PW_OK && x->plots_path) status = pw_optimise_draw (x, error);
  if (interrupted) pw_cli_say ("pinwheel: interrupted; this is the best result so far\n");
  if (status == PW_OK && interrupted) return PW_INTERRUPTED;
  return status == PW_OK && !converged ? pw_fail (error, why.status, "%s", why.text) : status;
}

static void optimise_close (pw_optimise *x) {
  for (int i = 0; x->start && i < x->starts + OPTIMISE_POLISHED; i++) free (x->start[i].trial);
  pw_arena_free (&x->arena);
  pw_files_close (&x->files);
  pw_unknowns_close (&x->unknowns);
  pw_cli_close_model (&x->m);
}

static int optimise_command (void *options, pw_error *error) {
  pw_optimise *x = options;
  int status = optimise_read (x, error);
  if (status == PW_OK) status = optimise_open (x, error);
  if (status == PW_OK) status = optimise_search (x, error);
  if (status == PW_OK) status = optimise_finish (x, error);
  optimise_close (x);
  return status;
}

static const struct poptOption optimise_options[] = {
  PW_OPTION_GROUP ("Optimisation"),
  PW_TEXT_OPTION (
      pw_optimise, maximise, "maximise", 0, "OUTPUT",
      "Find the largest value of a column of the table of `run`, of max:COLUMN, min:, mean:, integral:, rms: or "
      "final: (default), or of an expression of these, such as frame.x/work"),
  PW_TEXT_OPTION (pw_optimise, minimise, "minimise", 0, "OUTPUT", "Find the smallest value"),
  PW_LIST_OPTION (pw_optimise, free, "free", 0, "NAME[=LOW:HIGH]",
                  "Vary a parameter or an initial value, such as frame.vx, between bounds; repeatable"),
  PW_LIST_OPTION (pw_optimise, subject, "subject-to", 0, "OUTPUT<=VALUE", "Constraint, or OUTPUT>=VALUE; repeatable"),
  PW_TEXT_OPTION (pw_optimise, starts_text, "starts", 0, "N", "Number of searches from different points (default 10)"),
  PW_TEXT_OPTION (pw_optimise, seed_text, "seed", 0, "N", "Seed of these points (default 1)"),
  PW_TEXT_OPTION (pw_optimise, jobs_text, "jobs", 'j', "N", "Number of concurrent runs (default: one per processor)"),
  PW_TEXT_OPTION (pw_optimise, path, "output", 'o', "FILE.yaml", "Write the result to this file"),
  PW_TEXT_OPTION (pw_optimise, json_path, "json", 0, "FILE.json", "Write a summary"),
  PW_TEXT_OPTION (pw_optimise, plots_path, "plots", 0, "DIR", "Write figures of all runs into a folder"),
  PW_WIDTH_OPTION,
  PW_METHOD_OPTIONS,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_optimise = {
  .name = "optimise",
  .synopsis = "MODEL --maximise|--minimise OUTPUT --free NAME[=LOW:HIGH]... [OPTION...]",
  .summary = "find the parameters for which an output is largest or smallest",
  .help = "Vary parameters and initial values of a model until an output of its runs is largest or smallest, by local "
          "searches from several starts. Runs that fail count as infeasible.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_optimise),
  .function = optimise_command,
  .options = optimise_options,
};
