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
  const char *path, *part_text, *jobs_text, *lanes_text;
  const char **ranges;
  int merge, cpu;
  /* as understood */
  pw_plan plan;
  pw_journal journal;
  int jobs;
} sweep;

/* ---- Before the sweep ---- */

static int sweep_read (const sweep *x, pw_error *error) {
  if (x->line.arguments == 0)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel sweep %s",
                    x->merge ? "--merge PART... -o FILE.csv" : pw_cli_sweep.synopsis);
  if (x->path == NULL || *x->path == 0) return pw_fail (error, PW_INPUT, "nowhere to write the table: add -o FILE.csv");
  if (strcmp (x->path, "-") == 0)
    return pw_fail (error, PW_INPUT, "-o -: a sweep needs a file, next to which it keeps what it has done");
  if (pw_cli_check_csv (x->path, error) != PW_OK) return PW_INPUT;
  if (!x->merge && x->ranges == NULL)
    return pw_fail (error, PW_INPUT, "nothing is varied: add --vary NAME=lin:FIRST:LAST:COUNT, log:..., or V1,V2,...");
  return x->merge ? PW_OK : pw_cli_at_most (&pw_cli_sweep, &x->line, 1, error);
}

/* The first option given that cannot be combined with --merge; NULL if there is none. */
static const char *sweep_not_for_merge (const sweep *x) {
  for (const struct poptOption *o = pw_cli_sweep.options; o->longName || o->descrip; o++) {
    if (o->longName == NULL || strcmp (o->longName, "output") == 0 || strcmp (o->longName, "merge") == 0) continue;
    const void *value = (const char *)x + (size_t)o->arg;
    if (o->argInfo == POPT_ARG_NONE ? *(const int *)value : *(const void *const *)value != NULL) return o->longName;
  }
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
  p->line = &x->line;
  p->method = x->line.method ? x->line.method : d.method;
  p->cpu = x->cpu;
  int status = pw_cli_settings (&x->line, &d, &p->t_end, &p->settings, &p->limit, error);
  if (status == PW_OK) pw_cli_report_unused (p->method, &x->line);
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
  if (status == PW_OK) status = pw_cli_check_uses (&x->line, x->plan.file, use, sizeof use / sizeof *use, error);
  if (status == PW_OK) status = pw_journal_open (&x->journal, &x->plan, x->path, error);
  if (status != PW_OK) return status;
  if (x->journal.done > 0)
    pw_cli_say ("pinwheel: continuing with %s: %ld of %ld runs are done\n", x->journal.part, x->journal.done,
                x->journal.rows);
  return PW_OK;
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
    return pw_fail (error, PW_INPUT, "--%s cannot be combined with --merge: the parts define the sweep", option);
  int status = pw_sweep_merge (x->line.argument, x->line.arguments, x->path, &tally, error);
  return status == PW_OK ? sweep_verdict (&tally, 0, error) : status;
}

static int sweep_finish (sweep *x, pw_error *error) {
  pw_tally tally;
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
  pw_journal_close (&x->journal);
  pw_plan_close (&x->plan);
  pw_file_close (x->plan.file);
}

static int sweep_command (void *options, pw_error *error) {
  sweep *x = options;
  x->journal.file = -1;
  int status = sweep_read (x, error);
  if (status == PW_OK && x->merge)
    status = sweep_merge (x, error);
  else if (status == PW_OK) {
    status = sweep_open (x, error);
    if (status == PW_OK) status = pw_sweep_rows (&x->plan, &x->journal, x->jobs, error);
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
  .options_size = sizeof (sweep),
  .function = sweep_command,
  .options = sweep_options,
};
