/* pinwheel sweep: a table of runs, for all combinations of varied parameters and initial values.
 *
 * Every run depends only on its row of the grid.  A journal keeps the rows in the order of completion; at the end they
 * are sorted into the order of the grid.  So the table does not depend on the number of threads or on interruptions of
 * the sweep. */
#include <string.h>
#include "parallel.h"
#include "sweep_journal.h"

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *path, *part_text, *jobs_text, *lanes_text; /* path: -o */
  const char **ranges;                                   /* --vary */
  int merge;                                             /* 1: --merge */
  /* as understood */
  pw_plan plan;
  pw_journal journal;
  int jobs;
} pw_sweep;

/* ---- Before the sweep ---- */

/* Refuses missing or unsuitable options and arguments. */
static int sweep_check_options (const pw_sweep *sweep, pw_error *error) {
  if (sweep->line.arguments == 0)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel sweep %s",
                    sweep->merge ? "--merge PART... -o FILE.csv" : pw_cli_sweep.synopsis);
  if (sweep->path == NULL || *sweep->path == 0)
    return pw_fail (error, PW_INPUT, "nowhere to write the table: add -o FILE.csv");
  if (strcmp (sweep->path, "-") == 0)
    return pw_fail (error, PW_INPUT, "-o -: a sweep needs a file, next to which it keeps what it has done");
  if (pw_cli_check_csv (sweep->path, error) != PW_OK) return PW_INPUT;
  if (!sweep->merge && sweep->ranges == NULL)
    return pw_fail (error, PW_INPUT, "nothing is varied: add --vary NAME=lin:FIRST:LAST:COUNT, log:..., or V1,V2,...");
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

/* --part I/N; without it the sweep is its only part. */
static int sweep_read_part (pw_sweep *sweep, pw_error *error) {
  pw_plan *plan = &sweep->plan;
  char rest;
  plan->part = plan->parts = 1;
  if (sweep->part_text == NULL || (sscanf (sweep->part_text, "%7d/%7d%c", &plan->part, &plan->parts, &rest) == 2 &&
                                   1 <= plan->part && plan->part <= plan->parts && plan->parts <= 1000000))
    return PW_OK;
  return pw_fail (error, PW_INPUT, "--part %.60s: expected I/N, whole numbers with 1 <= I <= N <= 1000000",
                  sweep->part_text);
}

#define SWEEP_LANES "1, 2, 4 or 8" /* the powers of 2 up to PW_LANES_MOST */
_Static_assert(PW_LANES_MOST == 8, "SWEEP_LANES, and numbers of one digit");

static int sweep_read_lanes (pw_sweep *sweep, pw_error *error) {
  const char *text = sweep->lanes_text;
  int lanes = sweep->plan.lanes = text ? *text - '0' : 0;
  if (text && (lanes < 1 || lanes > PW_LANES_MOST || (lanes & (lanes - 1)) != 0 || text[1]))
    return pw_fail (error, PW_INPUT, "--lanes %.60s: expected " SWEEP_LANES, text);
  return PW_OK;
}

static int sweep_read_settings (pw_sweep *sweep, pw_error *error) {
  pw_plan *plan = &sweep->plan;
  pw_run_defaults defaults = pw_cli_defaults (pw_file_table (plan->file));
  plan->line = &sweep->line;
  plan->method = sweep->line.method ? sweep->line.method : defaults.method;
  int status = pw_cli_settings (&sweep->line, &defaults, &plan->t_end, &plan->settings, &plan->limit, error);
  if (status == PW_OK) pw_cli_report_unused (plan->method, &sweep->line);
  if (status == PW_OK) status = pw_cli_read_specialise (sweep->line.specialise, &plan->specialise, error);
  if (status == PW_OK) status = sweep_read_lanes (sweep, error);
  if (status == PW_OK) status = pw_parallel_jobs (sweep->jobs_text, &sweep->jobs, error);
  return status == PW_OK ? sweep_read_part (sweep, error) : status;
}

static int sweep_open (pw_sweep *sweep, pw_error *error) {
  pw_use use[] = { PW_CLI_MODEL_USE, { "-o", sweep->path, PW_WRITES, pw_cli_csv } };
  sweep->plan.file = pw_cli_file (&sweep->line, error);
  if (sweep->plan.file == NULL) return error->status;
  int status = sweep_read_settings (sweep, error);
  if (status == PW_OK)
    status = pw_cli_check_uses (&sweep->line, sweep->plan.file, use, sizeof use / sizeof *use, error);
  if (status == PW_OK) status = pw_plan_open (&sweep->plan, sweep->ranges, error);
  if (status == PW_OK && sweep->plan.parts > sweep->plan.grid.rows)
    status = pw_fail (error, PW_INPUT, "--part %s: more parts than the %ld rows of the grid", sweep->part_text,
                      sweep->plan.grid.rows);
  if (status == PW_OK) status = pw_journal_open (&sweep->journal, &sweep->plan, sweep->path, error);
  if (status != PW_OK) return status;
  if (sweep->journal.done > 0)
    pw_cli_say ("pinwheel: continuing with %s: %ld of %ld runs are done\n", sweep->journal.path, sweep->journal.done,
                sweep->journal.rows);
  return PW_OK;
}

/* ---- The end ---- */

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

static int sweep_merge (pw_sweep *sweep, pw_error *error) {
  pw_tally tally;
  const char *option = sweep_not_for_merge (sweep);
  if (option)
    return pw_fail (error, PW_INPUT, "--%s cannot be combined with --merge: the parts define the sweep", option);
  int status = pw_sweep_merge (sweep->line.argument, sweep->line.arguments, sweep->path, &tally, error);
  return status == PW_OK ? sweep_conclude (&tally, error) : status;
}

static int sweep_finish (pw_sweep *sweep, pw_error *error) {
  pw_tally tally;
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
  if (sweep->plan.parts == 1) return sweep_conclude (&tally, error);
  sweep_report_failures (&tally); /* whether all have failed is known after the merge */
  return PW_OK;
}

static void sweep_close (pw_sweep *sweep) {
  pw_journal_close (&sweep->journal);
  pw_plan_close (&sweep->plan);
  pw_file_close (sweep->plan.file);
}

static int sweep_command (void *options, pw_error *error) {
  pw_sweep *sweep = options;
  sweep->journal.descriptor = -1;
  int status = sweep_check_options (sweep, error);
  if (status == PW_OK && sweep->merge)
    status = sweep_merge (sweep, error);
  else if (status == PW_OK) {
    status = sweep_open (sweep, error);
    if (status == PW_OK) status = pw_sweep_rows (&sweep->plan, &sweep->journal, sweep->jobs, error);
    if (status == PW_OK) status = sweep_finish (sweep, error);
  }
  sweep_close (sweep);
  return status;
}

static const struct poptOption sweep_options[] = {
  PW_OPTION_GROUP ("Sweep"),
  PW_LIST_OPTION (pw_sweep, ranges, "vary", 'v', "NAME=RANGE",
                  "Vary a parameter or an initial value such as frame.vx; repeatable, the last one varies fastest. "
                  "RANGE: lin:FIRST:LAST:COUNT, log:FIRST:LAST:COUNT, or a list V1,V2,..."),
  PW_TEXT_OPTION (pw_sweep, path, "output", 'o', "FILE.csv", "Write the table to this file"),
  PW_TEXT_OPTION (pw_sweep, jobs_text, "jobs", 'j', "N", "Number of threads (default: one per processor)"),
  PW_TEXT_OPTION (pw_sweep, lanes_text, "lanes", 0, "N",
                  "Runs that a thread advances at once, " SWEEP_LANES ", with steps of fixed size and specialised code "
                  "(default: as many as are worthwhile)"),
  PW_TEXT_OPTION (pw_sweep, part_text, "part", 0, "I/N",
                  "Compute every N-th row, from the I-th on, for a later --merge"),
  PW_FLAG_OPTION (pw_sweep, merge, "merge", "Merge the parts of a sweep: the arguments are their files"),
  PW_FLAG_OPTION (pw_sweep, plan.with_cpu, "cpu",
                  "Add a column with the processor time of each run, which is never reproducible"),
  PW_METHOD_OPTIONS,
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
