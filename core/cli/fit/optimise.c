/* pinwheel optimise: parameters and initial values for which an output is largest or smallest.
 *
 * Local searches begin at several starts: the model's values, and Sobol points (pw_unknowns_starts).  Each search is a
 * task of its own, so that results do not depend on the number of threads.  The best results are then refined. */
#define _POSIX_C_SOURCE 200809L
#include "optimise.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "parallel.h"

enum { OPTIMISE_REFINED = 3 }; /* results that are refined, at most */
#define OPTIMISE_RUNS 20.      /* usual number of runs of a search, to choose the engine */
#define OPTIMISE_DIVERGED 1e6  /* modulus of an unknown without bounds, in units of its scale: the search diverged */

/* ---- Starts ---- */

/* Allocates all searches, and sets the first points of those from the starts. */
static int optimise_open_searches (pw_optimise *problem, pw_error *error) {
  const size_t n = (size_t)problem->unknowns.count, width = 2 * n + (size_t)problem->outputs,
               starts = (size_t)problem->starts, all = starts + OPTIMISE_REFINED;
  double *start = pw_unknowns_starts (&problem->unknowns, problem->starts, problem->seed),
         *memory = pw_arena_alloc (&problem->arena, all * width * sizeof *memory);
  problem->search = pw_arena_alloc (&problem->arena, all * sizeof *problem->search);
  problem->without_effect = pw_arena_alloc (&problem->arena, 2 * n);
  int status = start && memory && problem->search && problem->without_effect
                   ? PW_OK
                   : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) problem->objective_same = problem->without_effect + n;
  for (size_t i = 0; status == PW_OK && i < all; i++) {
    pw_search *search = problem->search + i;
    search->from = memory + i * width, search->to = search->from + n, search->output = search->to + n;
    if (i < starts) memcpy (search->from, start + i * n, n * sizeof *start);
  }
  free (start);
  return status;
}

/* The search with the best result among the first `count` searches without those `excluded`, which may be NULL; of
 * equal ones the first that converged, or else the first.  NULL: none has a result. */
static const pw_search *optimise_best (const pw_optimise *problem, int count, const unsigned char *excluded) {
  const pw_search *best = NULL;
  for (int i = 0; i < count; i++) {
    const pw_search *search = problem->search + i;
    if (!search->feasible || (excluded && excluded[i])) continue;
    double gain = best ? problem->sign[0] * (best->output[0] - search->output[0]) : INFINITY;
    if (gain > 0 || (gain == 0 && search->converged && !best->converged)) best = search;
  }
  return best;
}

/* Refines the best of the distinct results. */
static int optimise_refine (pw_optimise *problem, pw_error *error) {
  const pw_search *best;
  unsigned char *refined = calloc ((size_t)problem->starts, 1); /* 1: its result, or the same optimum, is refined */
  if (refined == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (problem->refinements < OPTIMISE_REFINED && (best = optimise_best (problem, problem->starts, refined))) {
    pw_search *refinement = problem->search + problem->starts + problem->refinements++;
    memcpy (refinement->from, best->to, (size_t)problem->unknowns.count * sizeof *best->to);
    for (int i = 0; i < problem->starts; i++)
      refined[i] |= (unsigned char)pw_optimise_same (problem, problem->search + i, best);
  }
  free (refined);
  problem->progress.last = problem->starts + problem->refinements;
  return pw_parallel (problem->jobs, problem->refinements, pw_search_fine, problem, error);
}

/* PW_METHOD if the search with the best result did not converge, or all its runs but one failed, or it ended at a
 * very large value of an unknown without bounds. */
static int optimise_converged (const pw_optimise *problem, pw_error *error) {
  const pw_search *search = problem->best;
  const pw_unknown *farthest = NULL;
  double distance = 0; /* in units of its scale */
  for (int i = 0; i < problem->unknowns.count; i++) {
    const pw_unknown *unknown = problem->unknowns.list + i;
    if (unknown->has_bounds || !(fabs (search->to[i]) >= distance * unknown->scale)) continue;
    farthest = unknown, distance = fabs (search->to[i]) / unknown->scale;
  }
  int found = search->converged && distance < OPTIMISE_DIVERGED;
  if (found && search->failed > 0 && search->runs - search->failed == 1)
    return pw_fail (error, PW_METHOD, "all other runs of the search failed: %s", search->first_error.text);
  if (found) return PW_OK;
  if (farthest == NULL) return pw_fail (error, PW_METHOD, "the search did not converge");
  return pw_fail (error, PW_METHOD,
                  "the search %s; perhaps there is no optimum unless bounds are given, as in --free %s=LOW:HIGH",
                  search->converged ? "diverged" : "did not converge", farthest->name);
}

static int optimise_search (pw_optimise *problem, pw_error *error) {
  pw_stop_catch ();
  pthread_mutex_init (&problem->lock, NULL);
  pw_progress_start (&problem->progress, pw_file_name (problem->model.file), "searches", 0,
                     problem->starts + OPTIMISE_REFINED);
  int status = pw_parallel (problem->jobs, problem->starts, pw_search_rough, problem, error);
  if (status == PW_OK) status = optimise_refine (problem, error);
  pw_progress_end (&problem->progress);
  problem->best = optimise_best (problem, problem->starts + problem->refinements, NULL);
  if (status == PW_OK && problem->best && !pw_stop && optimise_converged (problem, &(pw_error){ 0 }) == PW_OK)
    status = pw_parallel (problem->jobs, problem->unknowns.count, pw_search_effect, problem, error);
  pthread_mutex_destroy (&problem->lock);
  pw_stop_release ();
  for (int i = 0; i < problem->starts + problem->refinements; i++) {
    const pw_search *search = problem->search + i;
    problem->runs += search->runs, problem->failed += search->failed, problem->derivatives += search->derivatives;
    if (problem->first_error == NULL && search->failed) problem->first_error = &search->first_error;
  }
  return status;
}

/* ---- Before the search ---- */

/* Adds the constraint "OUTPUT<=VALUE" or "OUTPUT>=VALUE".  text: a copy of `given`, of which OUTPUT is kept. */
static int optimise_constraint (pw_optimise *problem, char *text, const char *given, pw_error *error) {
  const int i = problem->outputs;
  char *symbol = NULL;
  for (char *c = text; *c; c++)
    if ((*c == '<' || *c == '>') && c[1] == '=') symbol = c;
  if (symbol == NULL || pw_read_expression (symbol + 2, &problem->bound[i]) != PW_OK || !isfinite (problem->bound[i]))
    return pw_fail (error, PW_INPUT, "--subject-to %.200s: expected OUTPUT<=VALUE or OUTPUT>=VALUE", given);
  problem->sign[i] = *symbol == '<' ? 1 : -1;
  *symbol = 0;
  while (symbol > text && symbol[-1] == ' ') *--symbol = 0;
  problem->output[problem->outputs++] = text;
  return PW_OK;
}

static int optimise_read_outputs (pw_optimise *problem, pw_error *error) {
  size_t count = 1;
  int status = PW_OK;
  for (const char **given = problem->subject_to; given && *given; given++) count++;
  problem->output = pw_arena_alloc (&problem->arena, (count + 1) * sizeof *problem->output); /* ended by NULL */
  problem->unit = pw_arena_alloc (&problem->arena, count * sizeof *problem->unit);
  problem->bound = pw_arena_alloc (&problem->arena, 2 * count * sizeof *problem->bound);
  if (problem->output == NULL || problem->unit == NULL || problem->bound == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  problem->sign = problem->bound + count;
  problem->output[0] = problem->maximise ? problem->maximise : problem->minimise;
  problem->sign[0] = problem->maximise ? -1 : 1;
  problem->outputs = 1;
  for (const char **given = problem->subject_to; given && *given && status == PW_OK; given++) {
    char *copy = pw_arena_copy (&problem->arena, *given);
    status = copy ? optimise_constraint (problem, copy, *given, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  }
  return status;
}

/* Checks the outputs of an option, from number `first` on, and stores their units.  Extrema are not differentiable. */
static int optimise_open_outputs (pw_optimise *problem, int first, int count, const char *option, pw_error *error) {
  pw_outcomes set;
  int status = pw_outcomes_open (&set, problem->model.system, option, problem->output + first, count, error);
  for (int i = 0; i < set.outcomes; i++) pw_outcome_unit (&set, i, problem->unit[first + i], sizeof *problem->unit);
  for (int i = 0; i < set.functionals; i++) problem->differentiable &= !pw_is_extremum (set.functional[i].type);
  pw_outcomes_close (&set);
  return status;
}

static int optimise_read (pw_optimise *problem, pw_error *error) {
  double starts = 10;
  problem->least = INFINITY, problem->seed = 1;
  if (!problem->maximise == !problem->minimise)
    return pw_fail (error, PW_INPUT, "expected one of --maximise OUTPUT and --minimise OUTPUT");
  int status = pw_cli_number ("--starts", problem->starts_text, PW_COUNT, &starts, error);
  if (status == PW_OK) status = pw_cli_number ("--seed", problem->seed_text, PW_COUNT, &problem->seed, error);
  if (status == PW_OK) status = pw_parallel_jobs (problem->jobs_text, &problem->jobs, error);
  if (status == PW_OK && starts > 1e5) status = pw_fail (error, PW_INPUT, "--starts: at most 100000");
  if (status == PW_OK)
    status = pw_cli_requires ("--width", problem->line.width, "--plots DIR", problem->plots_path != NULL, error);
  problem->starts = (int)starts;
  return status == PW_OK ? optimise_read_outputs (problem, error) : status;
}

enum { OPTIMISE_RESULT = 1, OPTIMISE_SUMMARY }; /* indices in the list of files of optimise_open */

static int optimise_open (pw_optimise *problem, pw_error *error) {
  static const char *const figures[] = { "optimise.dat", "optimise.gp",  "optimise.svg",
                                         "optimise.png", "optimise.pdf", NULL },
                           *const texts[] = { ".yaml", ".yml", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "-o", problem->path, PW_WRITES, texts },
                   { "--json", problem->json_path, PW_WRITES, pw_cli_json },
                   { "--plots", problem->plots_path, PW_WRITES_INTO, figures } };
  int status = pw_cli_open (&problem->model, &problem->line, error);
  problem->differentiable = 1;
  if (status == PW_OK)
    status = optimise_open_outputs (problem, 0, 1, problem->maximise ? "--maximise" : "--minimise", error);
  if (status == PW_OK) status = optimise_open_outputs (problem, 1, problem->outputs - 1, "--subject-to", error);
  if (status == PW_OK) status = pw_unknowns_open (&problem->unknowns, &problem->line, &problem->model, error);
  if (status == PW_OK) status = pw_unknowns_read (&problem->unknowns, problem->free, error);
  if (status == PW_OK) status = pw_unknowns_engine (&problem->unknowns, OPTIMISE_RUNS, problem->starts, error);
  if (status == PW_OK)
    status = pw_files_open (&problem->files, &problem->line, &problem->model, use, sizeof use / sizeof *use, error);
  return status == PW_OK ? optimise_open_searches (problem, error) : status;
}

/* ---- After the search ---- */

/* Outputs of the run whose largest violation is smallest; *constraint: the output that has it.  NULL: all failed. */
static const double *optimise_nearest (const pw_optimise *problem, int *constraint) {
  const double *nearest = NULL;
  double least = INFINITY;
  int n = problem->unknowns.count, width = n + problem->outputs, i = 0;
  for (const pw_search *search = problem->search; search < problem->search + problem->starts; search++)
    for (long k = 0; k < search->runs; k++) {
      const double *output = search->trials + k * width + n;
      double violation = isnan (output[0]) ? NAN : pw_search_violation (problem, output, &i);
      if (violation <= least) least = violation, nearest = output, *constraint = i;
    }
  return nearest;
}

/* The error if no run satisfies the constraints: that of the first run if every run failed. */
static int optimise_infeasible (const pw_optimise *problem, pw_error *error) {
  char unit[90] = "";
  int i = 0;
  if (problem->failed == problem->runs && problem->first_error)
    return pw_fail (error, problem->first_error->status, "no run succeeded (%s); the first failed: %s",
                    PW_COUNTED (problem->runs, "run"), problem->first_error->text);
  const double *output = optimise_nearest (problem, &i);
  if (*problem->unit[i]) snprintf (unit, sizeof unit, " %s", problem->unit[i]);
  return pw_fail (error, PW_METHOD,
                  "no run from %s satisfies --subject-to; in the nearest one %s is %s%s and must be at %s %s%s",
                  PW_COUNTED (problem->starts, "start"), problem->output[i], PW_DIGITS (output[i], 9), unit,
                  problem->sign[i] > 0 ? "most" : "least", PW_DIGITS (problem->bound[i], 9), unit);
}

static int optimise_finish (pw_optimise *problem, pw_error *error) {
  FILE *result = pw_files_stream (&problem->files, OPTIMISE_RESULT),
       *summary = pw_files_stream (&problem->files, OPTIMISE_SUMMARY);
  int stopped = pw_stop != 0;
  if (problem->best == NULL && stopped) pw_cli_say ("pinwheel: interrupted before any run satisfied the constraints\n");
  if (problem->best == NULL) return stopped ? PW_INTERRUPTED : optimise_infeasible (problem, error);
  pw_error unconverged = { 0 }, drawing = { 0 };
  int converged = optimise_converged (problem, &unconverged) == PW_OK;
  problem->incomplete = stopped ? "the search was interrupted" : converged ? NULL : unconverged.text;
  pw_optimise_print (problem);
  pw_unknowns_report (&problem->unknowns, problem->best->to);
  if (result) pw_optimise_yaml (problem, result);
  const int drawn = problem->plots_path ? pw_optimise_draw (problem, &drawing) : PW_OK;
  const char *word = pw_cli_status_word (drawn != PW_OK || converged ? drawn : PW_METHOD);
  if (summary) pw_optimise_json (problem, stopped ? "interrupted" : word, summary);
  int status = pw_figure_status (drawn, &drawing, pw_files_finish (&problem->files, error), error);
  if (stopped) pw_cli_say ("pinwheel: interrupted; this is the best result so far\n");
  if (status == PW_OK && stopped) return PW_INTERRUPTED;
  return status == PW_OK && !converged ? pw_fail (error, unconverged.status, "%s", unconverged.text) : status;
}

static int optimise_command (void *options, pw_error *error) {
  pw_optimise *problem = options;
  int status = optimise_read (problem, error);
  if (status == PW_OK) status = optimise_open (problem, error);
  if (status == PW_OK) status = optimise_search (problem, error);
  if (status == PW_OK) status = optimise_finish (problem, error);
  for (int i = 0; problem->search && i < problem->starts + OPTIMISE_REFINED; i++) free (problem->search[i].trials);
  pw_arena_free (&problem->arena);
  pw_files_close (&problem->files);
  pw_unknowns_close (&problem->unknowns);
  pw_cli_close_model (&problem->model);
  return status;
}

static const struct poptOption optimise_options[] = {
  PW_OPTION_GROUP ("Optimisation"),
  PW_TEXT_OPTION (
      pw_optimise, maximise, "maximise", 0, "OUTPUT",
      "Maximise max:COLUMN, min:, mean:, integral:, rms: or final: (default) of a column of the table of `run`, or an "
      "expression of these, such as frame.x/work"),
  PW_TEXT_OPTION (pw_optimise, minimise, "minimise", 0, "OUTPUT", "Minimise such an output"),
  PW_LIST_OPTION (pw_optimise, free, "free", 0, "NAME[=LOW:HIGH]",
                  "Vary a parameter or an initial value, such as frame.vx, between bounds; repeatable"),
  PW_LIST_OPTION (pw_optimise, subject_to, "subject-to", 0, "OUTPUT<=VALUE",
                  "Constraint, or OUTPUT>=VALUE; repeatable"),
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
  .options_size = sizeof (pw_optimise),
  .function = optimise_command,
  .options = optimise_options,
};
