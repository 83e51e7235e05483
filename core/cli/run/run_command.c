/* pinwheel run: integrates a model and writes the results.
 *
 * Steps are taken in batches that end where a sample is due, so that between samples only the method runs, and only its
 * time is measured. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "run_command.h"
#include "figure.h"
#include "report.h"

#define RUN_SHORT 0.01 /* processor time of a batch [s] below which the next one is longer */
#define RUN_LONG 0.04  /* above which it is shorter: Ctrl-C and the progress bar wait for its end */
enum { RUN_BATCH = 4096 };

typedef pw_run_command run;

/* ---- Before the run ---- */

/* Refuses files used twice: called before the model is open, and then with the tables that it reads. */
static int run_uses (run *x, pw_error *error) {
  const pw_checkpoints *c = &x->check;
  int alike = c->resume && c->path && strcmp (c->resume, c->path) == 0;
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--reference", x->reference_path, PW_READS, NULL },
                   { "--resume", alike ? NULL : c->resume, c->path ? PW_READS : PW_WRITES, NULL },
                   { "--checkpoint", c->path, PW_WRITES, NULL },
                   { "-o", x->csv_path, PW_WRITES, NULL },
                   { "--json", x->json_path, PW_WRITES, NULL },
                   { "--animate", x->animate_path, PW_WRITES, NULL },
                   { "--plots", x->plots_path, PW_WRITES_INTO, pw_figure_endings } };
  return pw_cli_check_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error);
}

/* Opens an output file; a path of standard output becomes "-". */
static int run_open_output (run *x, int which, const char **path, pw_error *error) {
  if (*path == NULL) return PW_OK;
  x->output[which] = pw_output_open (*path, error);
  if (x->output[which] && pw_output_stream (x->output[which]) == stdout) *path = "-";
  return x->output[which] ? PW_OK : error->status;
}

/* Opens the output files before anything is computed.  A table that is continued is opened once the checkpoint is
 * verified. */
static int run_open_outputs (run *x, pw_error *error) {
  const char *ending = x->csv_path ? strrchr (x->csv_path, '.') : NULL;
  if (ending && strcmp (ending, ".npz") == 0 && (x->check.path || x->check.resume))
    return pw_fail (error, PW_INPUT, "-o %s: an .npz archive cannot be continued after a checkpoint: write a .csv",
                    x->csv_path);
  int status = pw_cli_requires ("--every", x->every_text, "-o FILE", x->csv_path != NULL, error);
  if (status == PW_OK) status = pw_cli_requires ("--width", x->line.width, "--plots DIR", x->plots_path != NULL, error);
  if (status == PW_OK) status = pw_cli_requires ("--colour", x->colour, "--plots DIR", x->plots_path != NULL, error);
  if (status == PW_OK && x->animate_path) status = pw_animation_check ("--animate", x->animate_path, error);
  if (status == PW_OK) status = run_uses (x, error);
  if (status == PW_OK) status = run_open_output (x, PW_RUN_SUMMARY, &x->json_path, error);
  if (status == PW_OK) status = run_open_output (x, PW_RUN_PAGE, &x->animate_path, error);
  if (status != PW_OK || x->check.resume) return status;
  return run_open_output (x, PW_RUN_TABLE, &x->csv_path, error);
}

static void run_discard (run *x, int which) {
  if (x->output[which]) pw_output_discard (x->output[which]);
  x->output[which] = NULL;
}

/* A summary is written of every run, but not over a table that the model reads. */
static int run_open_model (run *x, pw_error *error) {
  int status = pw_cli_open (&x->m, &x->line, error);
  if (x->m.file == NULL || run_uses (x, status == PW_OK ? error : &(pw_error){ 0 }) == PW_OK) return status;
  run_discard (x, PW_RUN_SUMMARY);
  return error->status;
}

/* An error in the method that the model selects names the model. */
static int run_own_method (const run *x, pw_error *error) {
  const pw_method *method;
  int stabilisation;
  pw_error why = { 0 };
  int status = pw_method_parse (x->method, &method, &stabilisation, &why);
  if (status == PW_OK) return PW_OK;
  return pw_fail (error, status, "model %s: its default method: %s", pw_file_name (x->m.file), why.text);
}

static int run_settings (run *x, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  int status = pw_cli_settings (&x->line, &d, &x->t_end, &x->settings, &x->limit, error);
  if (status == PW_OK) status = pw_cli_number ("--every", x->every_text, PW_POSITIVE, &x->every, error);
  x->method = x->line.method ? x->line.method : d.method;
  if (status == PW_OK && x->line.method == NULL) status = run_own_method (x, error);
  x->settings.ledger = x->energy || x->plots_path || x->animate_path;
  return status;
}

/* The engine is part of the settings: a resumed run uses the same one. */
static int run_engine (run *x, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  pw_specialise when;
  int status = pw_cli_specialise (x->line.specialise, &when, error);
  if (status == PW_OK) status = pw_checkpoints_open (x, &when, error);
  if (status != PW_OK) return status;
  int general = x->profile && when == PW_SPECIALISE_AUTO; /* the stages of --profile are those of the general engine */
  pw_cli_engine_open (&x->engine, x->m.system, general ? PW_SPECIALISE_NEVER : when,
                      pw_method_steps (x->method, &x->settings, d.step, x->t_end));
  if (general) strcpy (x->engine.reason, "--profile");
  x->settings.specialised = pw_scene_code_table (x->engine.code);
  return PW_OK;
}

/* Reports why a run does not use the compiled code. */
static const char *run_unspecialised (const run *x) {
  if (x->engine.code == NULL) return x->engine.reason;
  return pw_run_statistics (x->r)->specialised
             ? ""
             : "the method, its options or redundant drives do not permit specialised code";
}

static int run_open (run *x, pw_error *error) {
  int status = run_open_outputs (x, error);
  if (status == PW_OK) status = run_open_model (x, error);
  if (status == PW_OK) status = run_settings (x, error);
  if (status == PW_OK) status = run_engine (x, error);
  if (status == PW_OK) status = pw_checkpoints_prepare (x, error);
  if (status != PW_OK) return status;
  if (x->plots_path || x->animate_path) {
    x->plots = pw_plots_open (x->plots_path, x->animate_path != NULL, x->m.model, x->m.system, x->t_end, error);
    if (x->plots == NULL || pw_plots_style (x->plots, x->line.width, x->colour, error) != PW_OK) return error->status;
  }
  status = pw_comparison_open (&x->comparison, &x->m, x->reference_path, x->line.starts != NULL, x->t_end, error);
  if (status != PW_OK) return status;
  pw_limit_start (&x->limit);
  x->r = pw_run_open (x->m.system, x->method, &x->settings, error);
  if (x->r == NULL) return error->status;
  x->redundant = pw_report_redundancies (x->r);
  pw_report_model (x->m.model);
  pw_report_settings (x->r, x->m.system, x->method, &x->line, &x->settings);
  pw_report_initialisation (x->r, x->m.system, x->redundant);
  if (x->output[PW_RUN_TABLE]) x->csv = pw_csv_open (x->m.system, x->energy, x->output[PW_RUN_TABLE], error);
  return x->output[PW_RUN_TABLE] && x->csv == NULL ? error->status : pw_checkpoints_resume (x, error);
}

/* ---- The run ---- */

/* The time of the next row: computed as a multiple, not accumulated; one that differs from the end by round-off only is the end.
 * 0: a row is due after every step. */
static double run_next_row (const run *x) {
  if (x->csv == NULL) return INFINITY;
  if (x->every == 0) return 0;
  double t = (double)x->row * x->every;
  return fabs (t - x->t_end) <= fmax (1e-9 * x->every, 4 * DBL_EPSILON * x->t_end) ? x->t_end : t;
}

/* Writes rows and stores samples up to the time reached. */
static int run_take_samples (run *x, pw_error *error) {
  double now = pw_run_time (x->r);
  pw_sample sample;
  int status = PW_OK;
  while (status == PW_OK && run_next_row (x) <= now) {
    status = pw_run_sample (x->r, x->every > 0 ? run_next_row (x) : now, &sample, error);
    if (status == PW_OK) status = pw_csv_write (x->csv, x->m.system, &sample, error);
    if (status != PW_OK) break;
    x->row++;
    pw_progress_at (&x->progress, sample.t);
    if (x->every == 0) break;
  }
  while (status == PW_OK && x->plots && pw_plots_next (x->plots) <= now) {
    status = pw_run_sample (x->r, pw_plots_next (x->plots), &sample, error);
    if (status == PW_OK) pw_plots_add (x->plots, &sample);
  }
  while (status == PW_OK && pw_motion_next (&x->comparison.motion) <= now) {
    status = pw_run_sample (x->r, pw_motion_next (&x->comparison.motion), &sample, error);
    if (status == PW_OK) pw_motion_take (&x->comparison.motion, x->m.system, &sample);
  }
  return status;
}

/* Advances to the next sample, the end of the batch, or a request to stop. */
static int run_batch (run *x, pw_error *error) {
  double due =
      fmin (fmin (run_next_row (x), x->plots ? pw_plots_next (x->plots) : INFINITY), fmin (x->check.due, x->t_end));
  due = fmin (due, pw_motion_next (&x->comparison.motion));
  double start = pw_seconds (CLOCK_PROCESS_CPUTIME_ID);
  int status;
  long n = 0;
  do {
    status = pw_run_advance_towards (x->r, due, x->t_end, error);
  } while (status == PW_OK && ++n < x->batch && pw_run_time (x->r) < due && !pw_stop);
  double used = pw_seconds (CLOCK_PROCESS_CPUTIME_ID) - start;
  x->cpu += used;
  if (used < RUN_SHORT && n == x->batch && x->batch < RUN_BATCH) x->batch *= 2;
  if (used > RUN_LONG && x->batch > 1) x->batch /= 2;
  return status;
}

static int run_steps (run *x, pw_error *error) {
  int status = x->check.resume ? PW_OK : run_take_samples (x, error); /* a checkpoint has its samples */
  while (status == PW_OK && pw_run_time (x->r) < x->t_end && !pw_stop) {
    status = run_batch (x, error);
    if (status == PW_OK) status = run_take_samples (x, error);
    if (status == PW_OK && pw_run_time (x->r) >= x->check.due) status = pw_checkpoints_save (x, error);
    pw_progress_at (&x->progress, pw_run_time (x->r));
  }
  return status;
}

static int run_integrate (run *x, pw_error *error) {
  int table_on_screen = x->csv_path && strcmp (x->csv_path, "-") == 0;
  x->batch = 1;
  pw_stop_catch ();
  pw_progress_start (&x->progress, pw_file_name (x->m.file), x->t_end);
  x->progress.no_bar = table_on_screen;
  x->progress.first = pw_run_time (x->r);
  int status = run_steps (x, error);
  pw_progress_end (&x->progress);
  pw_stop_release ();
  const pw_statistics *s = pw_run_statistics (x->r);
  x->limited = status == PW_STOPPED || (status == PW_METHOD && s->steps + s->rejected >= x->settings.max_steps);
  if (status == PW_STOPPED) status = pw_limit_status (&x->limit, pw_run_time (x->r), error);
  return status;
}

/* ---- After the run ---- */

/* Completes the table, or keeps its rows as NAME.part; a run without steps leaves no file. */
static void run_close_table (run *x, int good, pw_error *error) {
  pw_output **o = &x->output[PW_RUN_TABLE];
  pw_error own = { 0 };
  good &= pw_csv_close (x->csv, good ? error : &own) == PW_OK;
  int is_file = *o ? pw_output_is_file (*o) : x->csv_path != NULL;
  if (*o && good && pw_output_ready (*o, error) == PW_OK) return;
  x->lost = is_file && error->status == PW_RESOURCE;
  if (*o) pw_cli_abandon_table (*o, x->check.resume ? 1 : x->row, x->part[PW_RUN_TABLE], sizeof *x->part);
  if (good) *x->part[PW_RUN_TABLE] = 0; /* the error names it */
  *o = NULL;
}

/* The first error decides the exit status; later ones are only printed. */
static void run_add_error (pw_error *error, const pw_error *later) {
  if (error->status == PW_OK)
    *error = *later;
  else if (later->status != PW_OK)
    pw_cli_say ("pinwheel: %s\n", later->text);
}

/* The JSON summary, written however the run has ended, except that a failed resumption does not replace the previous
 * summary. */
static void run_write_json (run *x, const pw_summary *summary, const pw_sample *sample, pw_error *error) {
  pw_error own = { 0 };
  if (x->check.resume && !x->resumed) run_discard (x, PW_RUN_SUMMARY);
  pw_output *o = x->output[PW_RUN_SUMMARY];
  if (o == NULL) return;
  if (pw_json_write (summary, x->m.system, sample, x->energy, x->r ? pw_run_statistics (x->r) : NULL, o, &own) != PW_OK)
    x->lost |= pw_output_is_file (o);
  run_add_error (error, &own);
}

/* Table, summary and page get their final names together, or keep their temporary ones.  The summary of a failed run
 * reports that the table is incomplete. */
static void run_complete (run *x, pw_error *error) {
  pw_error own = { 0 };
  for (int i = 0; x->lost && i < PW_RUN_OUTPUTS; i++) {
    if (x->output[i] == NULL || !pw_output_is_file (x->output[i])) continue;
    pw_output_abandon (x->output[i], x->part[i], sizeof x->part[i]);
    x->output[i] = NULL;
  }
  pw_output_finish_all (x->output, PW_RUN_OUTPUTS, &own);
  run_add_error (error, &own);
}

static pw_summary run_summary (const run *x, const pw_error *error, char *reason, size_t size) {
  static const char *const status[] = { "ok", "machine", "input", "start", "method" };
  pw_summary summary = { .model = x->m.file ? pw_file_name (x->m.file) : x->line.argument[0],
                         .method = x->method,
                         .status = status[-error->status],
                         .reason = error->text,
                         .cpu = x->cpu,
                         .energy_defect = NAN,
                         .redundant = x->redundant };
  if (error->status == PW_OK && pw_stop) {
    char t[32];
    snprintf (reason, size, "interrupted at t = %s s", pw_format (t, pw_run_time (x->r), 6));
    summary.status = "interrupted";
    summary.reason = reason;
  }
  return summary;
}

/* Figures and animation; after an interrupt gnuplot is not run. */
static void run_draw (run *x, const char *reason, pw_error *error) {
  pw_error own = { 0 };
  int drawn = 0;
  if (x->plots && x->r) pw_plots_finish (x->plots, !pw_stop, &own);
  if (x->plots && x->r && x->output[PW_RUN_PAGE])
    drawn = pw_animate (x->plots, x->animate_path, x->output[PW_RUN_PAGE], x->method, reason);
  if (!drawn) run_discard (x, PW_RUN_PAGE);
  run_add_error (error, &own);
}

/* 1 if an output file is standard output. */
static int run_prints_file (const run *x) {
  return (x->csv_path && strcmp (x->csv_path, "-") == 0) || (x->json_path && strcmp (x->json_path, "-") == 0);
}

/* Everything after the last step: table, summary, figures, final message. */
static int run_finish (run *x, pw_error *error) {
  static const char *const what[PW_RUN_OUTPUTS] = { "the table so far", "the page", "the summary" };
  char reason[80] = "", t[32];
  int interrupted = error->status == PW_OK && pw_stop;
  pw_sample sample, *last = NULL;
  if (x->r && pw_run_sample (x->r, pw_run_time (x->r), &sample, NULL) == PW_OK) last = &sample;
  run_close_table (x, error->status == PW_OK && !interrupted, error);
  pw_summary summary = run_summary (x, error, reason, sizeof reason);
  if (x->r) summary.general = run_unspecialised (x);
  if (x->r) summary.reference = pw_comparison_errors (&x->comparison, x->m.system);
  if (last) summary.energy_defect = pw_run_energy_defect (x->r, last);
  if (last && x->csv_path == NULL && x->json_path == NULL)
    pw_report_end (&summary, x->m.system, last, x->energy, pw_run_statistics (x->r));
  if (error->status == PW_OK) pw_report_warnings (x->r, x->m.system, summary.energy_defect);
  run_write_json (x, &summary, last, error);
  run_draw (x, summary.reason, error);
  run_complete (x, error);
  if (x->profile && last && error->status == PW_OK && !interrupted)
    pw_print_profile (x->m.system, x->r, x->cpu, run_prints_file (x) ? stderr : stdout, error);
  if (interrupted) pw_cli_say ("pinwheel: %s\n", reason);
  int status = pw_cli_report_error (error);
  error->status = PW_OK;
  for (int i = 0; i < PW_RUN_OUTPUTS; i++)
    if (*x->part[i]) pw_cli_say ("pinwheel: %s is kept in %s\n", what[i], x->part[i]);
  if (x->check.saved > 0 && (interrupted || x->limited || status == -PW_RESOURCE))
    pw_cli_say ("pinwheel: --resume %s continues from t = %s s\n", x->check.path, pw_format (t, x->check.saved, 6));
  return interrupted && status == 0 ? PW_INTERRUPTED : status;
}

static void run_close (run *x) {
  pw_checkpoints_close (&x->check);
  pw_plots_close (x->plots);
  pw_comparison_close (&x->comparison);
  if (x->r) pw_run_close (x->r);
  free (x->redundant);
  pw_cli_engine_close (&x->engine);
  pw_cli_close_model (&x->m);
}

static int run_command (void *options, pw_error *error) {
  run *x = options;
  if (run_open (x, error) == PW_OK) run_integrate (x, error);
  int status = run_finish (x, error);
  run_close (x);
  return status;
}

static const struct poptOption run_options[] = {
  PW_METHOD_OPTIONS,
  PW_OPTION_GROUP ("Output"),
  PW_TEXT_OPTION (run, csv_path, "output", 'o', "FILE.csv",
                  "Write a table of samples, FILE.npz for NumPy; - is standard output"),
  PW_TEXT_OPTION (run, every_text, "every", 0, "DT", "Time between rows of the table [s] (default: a row per step)"),
  PW_TEXT_OPTION (run, json_path, "json", 0, "FILE", "Write a summary as JSON; - is standard output"),
  PW_TEXT_OPTION (run, plots_path, "plots", 0, "DIR", "Draw figures into a folder"),
  PW_WIDTH_OPTION,
  PW_TEXT_OPTION (run, colour, "colour", 0, "WHAT", "What the colours of snapshots show: body (default) or time"),
  PW_TEXT_OPTION (run, animate_path, "animate", 0, "FILE.html", "Write an animation as a page for web browsers"),
  PW_FLAG_OPTION (run, energy, "energy", "Show energies, work and losses"),
  PW_TEXT_OPTION (run, reference_path, "reference", 0, "FILE.csv",
                  "Measure errors against this table, with columns as in -o, instead of the model's exact solution"),
  PW_ALIAS_OPTION (run, reference_path, "truth"),
  PW_FLAG_OPTION (run, profile, "profile", "Measure the cost of each element type and each stage after the run"),
  PW_OPTION_GROUP ("Checkpoints"),
  PW_TEXT_OPTION (run, check.path, "checkpoint", 0, "FILE", "Save the state regularly, so that the run can be resumed"),
  PW_TEXT_OPTION (run, check.every_text, "checkpoint-every", 0, "T",
                  "Simulated time between checkpoints [s] (default: a tenth of the run)"),
  PW_TEXT_OPTION (run, check.resume, "resume", 0, "FILE",
                  "Continue from a checkpoint of the same command, and save further ones to it"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_run = {
  .name = "run",
  .synopsis = "MODEL [OPTION...]",
  .summary = "integrate a model; write a table, a summary, figures, an animation",
  .help = "Integrate the equations of motion of a model and show the final state, reactions and constraint residuals. "
          "Options that are not given have the model's own defaults, see `pinwheel show MODEL`.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (run),
  .function = run_command,
  .options = run_options,
};
