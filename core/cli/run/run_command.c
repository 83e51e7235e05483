/* pinwheel run: integrates a model and writes the results.
 *
 * Steps are taken in batches that end where a sample is due, so that between samples only the method runs, and only its
 * time is measured. */
#include <float.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include "motion.h"
#include "outcome.h"
#include "pinwheel-analysis.h"
#include "plot.h"

typedef struct {
  /* as given, or NULL; without --checkpoint, `path` is that of --resume */
  const char *path, *resume_path;
  pw_cli_given interval_given;
  /* as understood */
  double interval;       /* simulated time between two checkpoints [s]; 0: there are none */
  double next_time;      /* of the next checkpoint [s]; INFINITY: never */
  const char *last_path; /* of the last one, resumed or saved; NULL: none */
  double last_time;      /* its time [s] */
  pw_stream fingerprint; /* of this run: the head of its checkpoints */
  pw_archive state;      /* of the next checkpoint */
  pw_checkpoint resumed; /* the checkpoint from which the run continues */
  pw_output *lock;       /* FILE.part, empty, which locks out other processes during the whole run */
} pw_checkpoints;

/* `--error`: the repetition of the run, in a thread of its own. */
typedef struct {
  double t[MOTION_SAMPLES]; /* at which the runs are compared [s] */
  int taken;                /* rows of the run stored so far */
  int width;                /* numbers of a row */
  double *rows, *end;       /* those of the run; the errors at the end, and the largest ones, after them */
  pw_repetition *repetition;
  pw_settings settings;
  pw_limit limit;       /* of the repetition */
  atomic_int cancelled; /* 1: the run has ended early */
  pthread_t thread;
  int started; /* 1: the thread has not been joined */
  int status;  /* of the repetition */
  pw_error failure;
  int known; /* 1: `result` is */
  char unknown[40 + sizeof (pw_error)];
  pw_stated_error result;
} pw_error_run;

/* A run and a reference solution. */
typedef struct {
  pw_motion reference, motion; /* at the same times; `motion` is that of the run; without a reference, no times */
  pw_reference_error errors;
  char gaps[MOTION_GAPS]; /* pw_motion_gaps of the reference in any sample */
} pw_comparison;

enum { PW_RUN_TABLE, PW_RUN_PAGE, PW_RUN_SUMMARY, PW_RUN_OUTPUTS };

typedef struct pw_run_cli {
  /* as given */
  pw_cli_line line;
  pw_cli_given every;
  const char *table_path, *summary_path, *plots_path, *page_path, *reference_path, *colour;
  const char **of;               /* ended by NULL; or NULL */
  int with_energies, with_error; /* 1: --energy, --error */
  pw_checkpoints checkpoints;
  /* as understood */
  pw_cli_engine engine;
  const char *method;
  pw_settings settings;
  pw_limit limit;
  double row_interval; /* of the table [s]; 0: each accepted step is a row */
  /* open */
  pw_output *output[PW_RUN_OUTPUTS]; /* NULL: not written */
  pw_csv *table;
  pw_plots *plots;
  pw_comparison comparison;
  pw_error_run stated;
  pw_outcomes outcomes; /* --of and --until; its system is NULL without them */
  pw_run *run;
  const char **redundant; /* a description of each redundant constraint equation; NULL: there are none */
  pw_progress progress;
  /* in progress */
  int has_outputs;             /* 1: the run is complete, and the values of --of are known */
  long rows;                   /* written to the table */
  int limited;                 /* 1: --limit, --max-steps or a signal during a step has stopped the run */
  int loaded;                  /* 1: the state of the checkpoint has been loaded */
  long batch;                  /* calls of pw_run_advance_towards between updates of the progress, at most */
  double cpu;                  /* processor time of the method [s] */
  double stepping, counted[2]; /* time in steps since, and real and processor time when `cpu` was counted [s] */
  int write_failed;            /* 1: the table or the summary could not be written */
  char kept_path[PW_RUN_OUTPUTS][4200]; /* of incomplete files that are kept, PATH_MAX and an ending, or "" */
} pw_run_cli;

/* The time at which the results end: that of --until, or that reached. */
static double run_end_time (const pw_run_cli *command) {
  return command->outcomes.ended ? command->outcomes.t : pw_run_time (command->run);
}

/* ---- The comparison with a reference solution ---- */

/* Opens the reference of a run up to t_end: the table at `path` or, if that is NULL, the model's reference solution
 * unless --start changes the initial values.  Close it in every case.  Errors: PW_INPUT, PW_RESOURCE. */
static int comparison_open (pw_comparison *comparison, const pw_cli_line *line, const char *path, double t_end,
                            pw_error *error) {
  *comparison = (pw_comparison){ .errors = { .source = path ? path : "the model" } };
  if (path == NULL && !pw_model_has_reference (line->m.model)) return PW_OK;
  if (path == NULL && line->starts) {
    pw_cli_say (
        "pinwheel: the model's reference solution holds for its own initial values: with --start errors are not "
        "computed\n");
    return PW_OK;
  }
  int status = pw_motion_open_reference (&comparison->reference, &line->m, path, &t_end, error);
  if (status != PW_OK) return status;
  pw_motion_gaps (line->m.system, &comparison->reference, 1, comparison->gaps);
  return pw_motion_open (&comparison->motion, line->m.system, &comparison->reference, 0, 0, error);
}

static void comparison_close (pw_comparison *comparison) {
  pw_motion_close (&comparison->reference);
  pw_motion_close (&comparison->motion);
}

/* Saves the samples taken in a checkpoint, or loads them from one. */
static void comparison_serialise (pw_comparison *comparison, pw_archive *archive) {
  pw_motion *motion = &comparison->motion;
  int taken = motion->taken;
  if (motion->times == 0) return;
  pw_archive_bytes (archive, &taken, sizeof taken);
  if (taken < 0 || taken > motion->times) archive->failed = 1;
  if (archive->failed) return;
  motion->taken = taken;
  pw_archive_bytes (archive, motion->value, (size_t)taken * (size_t)motion->width * sizeof *motion->value);
}

/* The errors of the samples taken, after the run; NULL if there are none. */
static const pw_reference_error *comparison_errors (pw_comparison *comparison, const pw_system *system) {
  double error[MOTION_ERRORS];
  pw_motion *motion = &comparison->motion;
  pw_reference_error *errors = &comparison->errors;
  if (motion->taken == 0) return NULL;
  pw_motion_errors (system, &comparison->reference, motion, error);
  errors->samples = motion->taken;
  errors->t = motion->t[motion->taken - 1];
  memcpy (errors->end, error + MOTION_END, sizeof errors->end);
  memcpy (errors->most, error + MOTION_LARGEST, sizeof errors->most);
  errors->reactions = error[MOTION_MULTIPLIERS];
  return errors;
}

/* ---- The repetition of --error, and the errors that follow from it ---- */

enum { ERROR_BODIES = 20, ERROR_COLUMNS = 24, ERROR_WIDTH = 12, ERROR_DIGITS = 2 };

static int error_stop (void *context) {
  pw_error_run *e = context;
  return e->cancelled || pw_limit_over (&e->limit);
}

static void *error_repeat (void *argument) {
  pw_error_run *e = argument;
  pw_limit_start (&e->limit);
  e->status = pw_repetition_run (e->repetition, 0, &e->failure);
  if (e->status == PW_STOPPED) pw_fail (&e->failure, PW_STOPPED, "stopped by %s", pw_stop ? "a signal" : "--limit");
  return NULL;
}

/* Starts the repetition, if there is --error; the run is open. */
static int error_start (pw_run_cli *command, pw_error *error) {
  pw_error_run *e = &command->stated;
  if (!command->with_error) return PW_OK;
  if (command->checkpoints.resume_path)
    return pw_fail (error, PW_INPUT,
                    "--error compares the run from its beginning on: it cannot be combined with --resume");
  pw_equal_times (command->settings.span, MOTION_SAMPLES, e->t);
  e->settings = command->settings, e->limit = command->limit;
  e->settings.stop = error_stop, e->settings.stop_context = e;
  e->width = pw_run_record_width (command->run);
  e->repetition =
      pw_repetition_open (command->line.m.system, command->method, &e->settings, e->t, MOTION_SAMPLES, error);
  if (e->repetition == NULL) return error->status;
  e->rows = calloc ((MOTION_SAMPLES + 2) * (size_t)e->width, sizeof *e->rows);
  if (e->rows == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  e->result = (pw_stated_error){ .columns = e->width, .name = pw_system_record_name };
  e->end = e->rows + MOTION_SAMPLES * e->width;
  e->result.end = e->end, e->result.largest = e->end + e->width;
  e->started = pthread_create (&e->thread, NULL, error_repeat, e) == 0;
  return e->started ? PW_OK : pw_fail (error, PW_RESOURCE, "a thread for --error cannot be started");
}

/* The time of the next sample; INFINITY: there is none. */
static double error_next (const pw_error_run *e) {
  return e->started && e->taken < MOTION_SAMPLES ? e->t[e->taken] : INFINITY;
}

/* Stores the next sample of the run, whose last step contains its time. */
static int error_add (pw_error_run *e, pw_run *run, pw_error *error) {
  long recorded;
  const int k = e->taken++;
  return pw_run_record (run, e->t[k], e->t + k, 1, 0, e->rows + k * e->width, &recorded, error);
}

/* Ends the repetition, and states the error if the run is complete.  PW_RESOURCE. */
static int error_finish (pw_error_run *e, int complete, pw_error *error) {
  if (!e->started) return PW_OK;
  e->cancelled = !complete;
  pthread_join (e->thread, NULL);
  e->started = 0;
  if (!complete) return PW_OK;
  pw_error reason = e->failure;
  int status = e->status, repeated = status == PW_OK;
  if (repeated) status = pw_repetition_error (e->repetition, e->rows, e->taken, e->end, e->end + e->width, &reason);
  if (status == PW_RESOURCE) return pw_fail (error, PW_RESOURCE, "%s", reason.text);
  e->result.t = e->t[e->taken - 1];
  e->result.repeated = pw_repetition_text (e->repetition);
  e->known = 1;
  if (status == PW_OK) return PW_OK;
  snprintf (e->unknown, sizeof e->unknown, "%s%s", repeated ? "" : "the repetition failed: ",
            status == PW_STOPPED && repeated ? "a second repetition was stopped" : reason.text);
  e->result.unknown = e->unknown;
  return PW_OK;
}

static void error_close (pw_error_run *e) {
  error_finish (e, 0, &(pw_error){ 0 });
  pw_repetition_close (e->repetition);
  free (e->rows);
}

/* Stated errors of the bodies at the end; those of x and y are the error of a length. */
static void error_bodies (const pw_stated_error *e, const pw_system *s, FILE *f) {
  static const char *const head[] = { "body", "position [m]", "phi [rad]", "velocity [m/s]", "omega [rad/s]", NULL };
  const int bodies = pw_system_bodies (s), n = pw_system_coordinates (s);
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    pw_head (&table, -5, ERROR_WIDTH, head);
    for (int b = 0; b < bodies && b < ERROR_BODIES; b++) {
      const double *q = e->end + PW_RECORD_STATES + 3 * b, *v = q + n;
      pw_cell (&table, -5, pw_system_body_name (s, b));
      for (int i = 0; i < 4; i++)
        pw_cell_number (&table, ERROR_WIDTH,
                        i % 2 ? (i < 2 ? q : v)[2] : hypot ((i < 2 ? q : v)[0], (i < 2 ? q : v)[1]), ERROR_DIGITS);
      pw_row_end (&table);
    }
  }
  pw_report_more (f, bodies - ERROR_BODIES, ": --json FILE has them all");
}

/* The largest errors of the other columns of the table: energies, contact points, reactions, ledger. */
static void error_columns (const pw_stated_error *e, const pw_system *s, int energies, FILE *f) {
  const int n = pw_system_coordinates (s), first = PW_RECORD_STATES, end = first + 3 * n;
  int shown = 0, all = 0;
  fprintf (f, "  largest error of a column\n");
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    shown = all = 0;
    for (int i = 0; i < e->columns; i++) {
      const int is_state = i >= first + n && pw_system_state_hidden (s, i - first - n);
      if (isnan (e->largest[i]) || (first <= i && i < end && !is_state) || (i < first && !energies)) continue;
      if (++all > ERROR_COLUMNS) continue;
      shown++;
      pw_cell (&table, -8, PW_NAME (pw_system_record_name, s, i));
      pw_cell_number (&table, ERROR_WIDTH, e->largest[i], ERROR_DIGITS);
      pw_cell (&table, -1, pw_system_record_unit (s, i));
      pw_row_end (&table);
    }
  }
  pw_report_more (f, all - shown, ": --json FILE has them all");
}

/* The stated errors: of the bodies at the end, the largest of the other columns; or why they are unknown. */
static void report_stated (const pw_run_cli *command, FILE *f) {
  const pw_stated_error *e = &command->stated.result;
  if (!command->stated.known) return;
  if (e->unknown) {
    pw_cli_print (f, "\n  the error is unknown: %s\n", e->unknown);
    return;
  }
  pw_cli_print (f, "\n  stated error at %s s, from a repetition with %s\n", PW_DIGITS (e->t, 6), e->repeated);
  error_bodies (e, command->line.m.system, f);
  error_columns (e, command->line.m.system, command->with_energies, f);
}

/* ---- Warnings and results ---- */

enum {
  REPORT_ROWS = 24,   /* reactions, or internal coordinates, that are printed at most */
  REPORT_EVENTS = 10, /* listed */
  REPORT_WIDTH = 13,  /* of a column of numbers */
  REPORT_DIGITS = 8
};
#define REPORT_DEFECT 0.01 /* relative energy defect above which a warning is printed */

/* Options without effect, tables that do not cover the run, long fixed steps, an absolute tolerance within which a
 * force saturates. */
static void report_settings (pw_run *run, const pw_system *system, const char *method, const pw_cli_line *line,
                             const pw_settings *settings) {
  double step = fmin (settings->step, settings->span), time_scale = pw_run_scale (run)->time;
  pw_cli_report_unused (method, line);
  pw_cli_report_tables (system, settings->span);
  const int adaptive = pw_cli_adaptive (line->methods, method) == 1;
  char element[PW_NAME_BYTES];
  double saturation;
  int state = adaptive && settings->atol > 0 ? pw_run_saturation (run, &saturation, element, sizeof element) : -1;
  if (state >= 0 && settings->atol > saturation)
    pw_cli_say ("pinwheel: --atol %s is above %s %s, within which the force of %s reverses: methods with Newton's "
                "iteration reduce the tolerance of the states that the force depends on, others may be wrong\n",
                PW_DIGITS (settings->atol, 3), PW_DIGITS (saturation, 3), pw_system_state_unit (system, state),
                element);
  if (!adaptive && step > time_scale)
    pw_cli_say (
        "pinwheel: a step of %s s is long for a motion that changes within %s s, and nothing controls its error: "
        "compare with shorter ones\n",
        PW_DIGITS (step, 3), PW_DIGITS (time_scale, 2));
}

static void report_value (pw_table *table, int width, const char *name, double value, const char *unit) {
  pw_cell (table, width, name);
  pw_cell_number (table, REPORT_WIDTH, value, REPORT_DIGITS);
  pw_cell (table, -1, unit);
}

static void report_internal (const pw_system *system, const pw_sample *last) {
  int first = 3 * pw_system_bodies (system), n = pw_system_coordinates (system);
  int end = n - first > REPORT_ROWS ? first + REPORT_ROWS : n;
  for (pw_table table = { 0 }; pw_table_pass (&table);)
    for (int j = first; j < end; j++) {
      for (int state = pw_system_state_hidden (system, j) ? j + n : j; state < 2 * n; state += n)
        report_value (&table, -1, PW_NAME (pw_system_state_name, system, state), state < n ? last->q[j] : last->v[j],
                      pw_system_state_unit (system, state));
      pw_row_end (&table);
    }
  pw_report_more (stdout, n - end, "");
}

/* Reactions, which are -lambda (0 - lambda is never -0); or outputs. */
static void report_list (const pw_system *s, const pw_sample *last, int outputs) {
  const int count = outputs ? pw_system_outputs (s) : pw_system_rows (s);
  if (count > 0) puts (outputs ? "\n  output" : "\n  reaction");
  for (pw_table table = { 0 }; pw_table_pass (&table);)
    for (int i = 0; i < count && i < REPORT_ROWS; i++) {
      report_value (&table, -8, outputs ? pw_system_output_name (s, i) : PW_NAME (pw_system_reaction_name, s, i),
                    outputs ? last->output[i] : 0 - last->lambda[i],
                    outputs ? pw_system_output_unit (s, i) : pw_system_reaction_unit (s, i));
      pw_row_end (&table);
    }
  pw_report_more (stdout, count - REPORT_ROWS, ": -o FILE.csv writes them all");
}

static void report_energy (const pw_sample *last) {
  const struct {
    const char *name;
    double value;
  } row[] = { { "kinetic", last->kinetic }, { "potential", last->potential },   { "work", last->work },
              { "dissipated", last->loss }, { "projection", last->projection }, { "balance", last->balance } };
  printf ("\n  energy\n");
  for (pw_table table = { 0 }; pw_table_pass (&table);)
    for (int i = 0; i < 6; i++) {
      report_value (&table, -10, row[i].name, row[i].value, "J");
      pw_row_end (&table);
    }
}

/* A row of errors, unless both are unknown. */
static void report_error (pw_table *table, const char *name, double end, double largest, const char *unit) {
  if (isnan (end) && isnan (largest)) return;
  pw_cell (table, -10, name);
  pw_cell_number (table, REPORT_WIDTH, end, 3);
  pw_cell_number (table, REPORT_WIDTH, largest, 3);
  pw_cell (table, -1, unit);
  pw_row_end (table);
}

/* The errors of a run, NULL without a reference, and what this does not contain (pw_motion_gaps); states: number of
 * first-order states, whose errors count as those of speeds. */
static void report_errors (const pw_reference_error *errors, const char *gaps, int states) {
  const char *const name[] = { "length", "angle", states ? "speed, state" : "speed", "rate" };
  const char *const unit[] = { "m", "rad", states ? "" : "m/s", "rad/s" };
  if (errors == NULL) return;
  int known = !isnan (errors->reactions);
  for (int i = 0; i < 4; i++) known |= !isnan (errors->most[i]);
  if (!known) {
    pw_cli_print (stdout,
                  "\n  errors are unknown: the reference solution of %s contains no value at the times compared\n",
                  errors->source);
    return;
  }
  const char *at = PW_PRINTED (40, "at %s s", PW_DIGITS (errors->t, 6));
  pw_cli_print (stdout, "\n  error against the reference solution of %s, at %s\n", errors->source,
                PW_COUNTED (errors->samples, "time"));
  for (pw_table table = { 0 }; pw_table_pass (&table);) {
    pw_head (&table, -10, REPORT_WIDTH, (const char *const[]){ "", at, "largest", NULL });
    for (int i = 0; i < 4; i++) report_error (&table, name[i], errors->end[i], errors->most[i], unit[i]);
    report_error (&table, "reactions", NAN, errors->reactions, "of the largest");
  }
  if (*gaps) pw_cli_print (stdout, "  the reference solution contains %s\n", gaps);
}

/* The element of a constraint equation; of an element with several, the reaction: "rolling-wheel rear.B". */
static char *report_equation (const pw_system *system, int row, char *buffer, size_t size) {
  const pw_element_info element = pw_system_element (system, pw_system_row_element (system, row));
  if (element.kind->rows == 1) return pw_system_row_name (system, row, buffer, size);
  return pw_print (buffer, size, "%s %s", element.kind->name, PW_NAME (pw_system_reaction_name, system, row));
}

/* The last events; of a scene without limits nothing. */
static void report_events (const pw_system *system, const pw_summary *summary) {
  const int first = summary->events > REPORT_EVENTS ? summary->events - REPORT_EVENTS : 0;
  const pw_method *method;
  if (pw_system_limited (system) == 0) return;
  if (pw_method_parse (summary->method, NULL, &method, NULL, NULL) == PW_OK && method->locates_no_events) {
    pw_cli_print (stdout, "  %s locates no events: reactions with limits are means over steps\n", method->name);
    return;
  }
  pw_cli_print (stdout, "  %s%s\n", PW_COUNTED (summary->events, "event"), first > 0 ? "; the last ones:" : "");
  for (const pw_event *e = summary->event + first; e < summary->event + summary->events; e++)
    pw_cli_print (stdout, "    t = %s s: %s %s%s\n", PW_DIGITS (e->t, 15), PW_NAME (report_equation, system, e->row),
                  pw_system_mode_name (system, e->row, e->to),
                  e->impact ? PW_PRINTED (60, ", impulse %s", PW_DIGITS (e->impulse, 8)) : "");
}

/* Why the general engine was used; "": it was not. */
static const char *report_general_reason (const pw_run_cli *command) {
  if (command->engine.code == NULL) return command->engine.reason;
  if (pw_run_statistics (command->run)->specialised) return "";
  return "the method, its options or redundant drives do not permit specialised code";
}

enum { PW_RUN_REASON = 80 };
/* The summary of a run that ended with this error, if any; last: the last sample, or NULL; `reason` receives the text
 * of an interruption. */
static pw_summary run_summary (pw_run_cli *command, const pw_sample *last, const pw_error *error,
                               char reason[PW_RUN_REASON]) {
  const pw_file *file = command->line.m.file;
  const pw_run *run = command->run;
  pw_summary summary = { .model = file ? pw_file_name (file) : command->line.argument[0],
                         .method = command->method,
                         .status = pw_cli_status_word (error->status),
                         .reason = error->text,
                         .cpu = command->cpu,
                         .until = command->outcomes.system ? command->line.until : NULL,
                         .stop_time = command->outcomes.ended ? command->outcomes.t : NAN,
                         .of = command->of,
                         .energy_defect = last ? pw_run_energy_defect (run, last) : NAN,
                         .redundant = command->redundant,
                         .general = run ? report_general_reason (command) : NULL,
                         .reference = run ? comparison_errors (&command->comparison, command->line.m.system) : NULL,
                         .stated = command->stated.known ? &command->stated.result : NULL };
  for (int i = 0; i < command->outcomes.outcomes; i++)
    command->outcomes.value[i] = command->has_outputs ? pw_outcome_value (&command->outcomes, i) : NAN;
  summary.of_value = command->outcomes.value;
  if (run) summary.event = pw_run_events (run, &summary.events);
  if (error->status == PW_OK && pw_stop) {
    snprintf (reason, PW_RUN_REASON, "interrupted at t = %s s", PW_DIGITS (pw_run_time (run), 6));
    summary.status = "interrupted";
    summary.reason = reason;
  }
  return summary;
}

/* After the run: a relative energy defect of more than 1 % (NaN: not known), steps that did not resolve a
 * change. */
static void report_warnings (const pw_run *run, double defect) {
  const pw_statistics *stats = pw_run_statistics (run);
  if (defect > REPORT_DEFECT)
    pw_cli_say ("pinwheel: the energy does not balance: %s %% of it is unaccounted for; %s\n",
                PW_DIGITS (100 * defect, 2), pw_run_energy_advice (run, defect));
  if (stats->unresolved > 0)
    pw_cli_say ("pinwheel: %ld of %s did not resolve %s, which changes more within a step than the step sees: take "
                "shorter steps, or a method with adaptive ones\n",
                stats->unresolved, PW_COUNTED (stats->steps, "step"),
                pw_run_unresolved (run, (char[PW_NAME_BYTES]){ 0 }, PW_NAME_BYTES));
}

/* Prints the outputs of --of of a complete run, if any. */
static void report_outputs (const pw_run_cli *command, FILE *f) {
  char unit[60];
  if (!command->has_outputs) return;
  fputs ("\n  outputs\n", f);
  for (pw_table table = { .f = f }; pw_table_pass (&table);)
    for (int i = 0; i < command->outcomes.outcomes; i++) {
      report_value (&table, -10, command->of[i], pw_outcome_value (&command->outcomes, i),
                    pw_outcome_unit (&command->outcomes, i, unit, sizeof unit));
      pw_row_end (&table);
    }
}

/* Prints the last state, reactions, energies if they are asked for, errors, residuals and cost. */
static void report_end (const pw_run_cli *command, const pw_summary *summary, const pw_sample *last) {
  const pw_system *system = command->line.m.system;
  const pw_statistics *stats = pw_run_statistics (command->run);
  printf ("%s, %s, at t = %s s\n\n", summary->model, summary->method, PW_DIGITS (last->t, 8));
  pw_print_bodies (system, last->q, last->v, "body", -5, REPORT_WIDTH, REPORT_DIGITS, 0);
  pw_report_more (stdout, pw_system_bodies (system) - PW_BODIES_PRINTED, ": -o FILE.csv writes them all");
  report_internal (system, last);
  for (int outputs = 0; outputs < 2; outputs++) report_list (system, last, outputs);
  if (command->with_energies) report_energy (last);
  report_errors (summary->reference, command->comparison.gaps, pw_system_states (command->line.m.system));
  printf ("\n  worst scaled residuals: position %s, velocity %s\n", PW_DIGITS (stats->position, 2),
          PW_DIGITS (stats->velocity, 2));
  printf ("  %s, %ld rejected, %s, %s, %s, %s s of processor time\n", PW_COUNTED (stats->steps, "step"),
          stats->rejected, PW_COUNTED (stats->rhs, "right-hand side"), PW_COUNTED (stats->jacobians, "Jacobian"),
          PW_COUNTED (stats->factorisations, "factorisation"), PW_DIGITS (summary->cpu, 3));
  if (*summary->general)
    pw_cli_print (stdout, "  general engine: %s\n", summary->general);
  else
    printf ("  code specialised for this scene: %ld evaluations\n", stats->specialised);
  report_events (system, summary);
  if (stats->restarts > 0) printf ("  restarted at %s\n", PW_COUNTED (stats->restarts, "checkpoint"));
  if (summary->until && isnan (summary->stop_time))
    pw_cli_print (stdout, "  %s did not become true\n", summary->until);
  else if (summary->until)
    pw_cli_print (stdout, "  stopped: %s at t = %s s\n", summary->until, PW_DIGITS (summary->stop_time, 15));
  if (*summary->reason) printf ("  ended early: %s\n", summary->reason);
}

/* ---- Checkpoints: their contents, when they are due, and how a run continues from one ----
 *
 * A checkpoint is saved after the step that reaches a multiple of the interval, once that step's rows have been
 * written.  The table is flushed to the disk first, so that a resumed run finds at least the rows that the checkpoint
 * counts. */

/* keys of the fingerprint that are also read */
static const char checkpoints_interval_key[] = "checkpoint-every", checkpoints_engine_key[] = "engine";

/* The value of a key of the checkpoint that is resumed, up to the end of its line; NULL if there is none. */
static const char *checkpoints_value (const pw_checkpoints *checkpoints, const char *key) {
  size_t size;
  return pw_fingerprint_value (checkpoints->resumed.text, checkpoints->resumed.head_end, key, &size);
}

/* Reads the options and the checkpoint that is resumed, whose engine is used if *specialise is
 * PW_SPECIALISE_AUTO. */
static int checkpoints_open (pw_run_cli *command, pw_specialise *specialise, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  checkpoints->next_time = INFINITY;
  if (checkpoints->path == NULL) checkpoints->path = checkpoints->resume_path;
  if (checkpoints->path == NULL && checkpoints->interval_given.text == NULL) return PW_OK;
  if (checkpoints->path == NULL)
    return pw_fail (error, PW_INPUT, "--checkpoint-every %s: --checkpoint FILE is needed to save to",
                    checkpoints->interval_given.text);
  checkpoints->interval = command->settings.span / 10;
  if (checkpoints->resume_path) {
    if (pw_checkpoint_read (checkpoints->resume_path, &checkpoints->resumed, error) != PW_OK) return error->status;
    const char *interval = checkpoints_value (checkpoints, checkpoints_interval_key);
    const char *engine = checkpoints_value (checkpoints, checkpoints_engine_key);
    if (interval) checkpoints->interval = fmax (strtod (interval, NULL), 0);
    if (*specialise == PW_SPECIALISE_AUTO) *specialise = engine ? PW_SPECIALISE_ALWAYS : PW_SPECIALISE_NEVER;
  }
  checkpoints->interval = pw_cli_given_or (checkpoints->interval_given, checkpoints->interval);
  return PW_OK;
}

/* Writes everything that determines the results. */
static int checkpoints_write_fingerprint (const pw_run_cli *command, FILE *f, pw_error *error) {
  const unsigned short order = 1;
  const pw_model *model = command->line.m.model;
  if (pw_fingerprint_run (f, PW_CHECKPOINT_MAGIC, &command->line, pw_fingerprint_tables (0, model), command->method,
                          &command->settings, error) != PW_OK)
    return error->status;
  if (command->engine.code) pw_fingerprint_line (f, checkpoints_engine_key, NULL, "specialised");
  for (const pw_parameter *parameter = pw_model_table (model)->parameters; parameter && parameter->name; parameter++)
    pw_fingerprint_number (f, "parameter", parameter->name, pw_model_parameter (model, parameter));
  pw_fingerprint_initial (f, command->line.starts);
  pw_fingerprint_line (f, "table", NULL, command->table_path ? "written" : "not written");
  pw_fingerprint_number (f, "every", NULL, command->row_interval);
  pw_fingerprint_line (f, "energy", NULL, command->with_energies ? "kept" : "not kept");
  pw_fingerprint_line (f, "plots", NULL, command->plots_path ? "drawn" : "not drawn");
  pw_fingerprint_line (f, "animation", NULL, command->page_path ? "written" : "not written");
  if (command->reference_path == NULL)
    pw_fingerprint_line (f, "reference", NULL, "the model's");
  else if (pw_fingerprint_file (f, "reference", command->reference_path, command->reference_path, error) != PW_OK)
    return error->status;
  pw_fingerprint_number (f, checkpoints_interval_key, NULL, command->checkpoints.interval);
  const char *numbers =
      PW_PRINTED (60, "%s endian, %zu bytes", *(const unsigned char *)&order ? "little" : "big", sizeof (long));
  pw_fingerprint_line (f, "numbers", NULL, numbers);
  fputs ("end\n", f);
  return PW_OK;
}

static int checkpoints_fingerprint (pw_run_cli *command, pw_error *error) {
  pw_stream *text = &command->checkpoints.fingerprint;
  FILE *f = pw_stream_open (text);
  const int status = f ? checkpoints_write_fingerprint (command, f, error) : PW_OK;
  return pw_stream_close (f, text) == PW_OK ? status : pw_fail (error, PW_RESOURCE, "out of memory");
}

/* Before anything is written: locks the checkpoint file, verifies that a resumed checkpoint belongs to this run and
 * opens its table; without --resume, refuses a table that could not be continued. */
static int checkpoints_prepare (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  if (checkpoints->path == NULL) return PW_OK;
  if (command->table_path && strcmp (command->table_path, "-") == 0)
    return pw_fail (error, PW_INPUT,
                    "--checkpoint: a table on standard output cannot be continued; write it to a file");
  checkpoints->lock = pw_output_open (checkpoints->path, error);
  if (checkpoints->lock == NULL) return error->status;
  if (!pw_output_is_file (checkpoints->lock))
    return pw_fail (error, PW_INPUT, "%s: a checkpoint needs a regular file, which can be read again and replaced",
                    checkpoints->path);
  if (checkpoints_fingerprint (command, error) != PW_OK) return error->status;
  const pw_stream *own = &checkpoints->fingerprint;
  const pw_fingerprint there = { checkpoints->resumed.text, checkpoints->resumed.head_end, "there" };
  const pw_fingerprint here = { own->text, own->text + own->size, "here" };
  char difference[300];
  if (checkpoints->resume_path && pw_fingerprint_differ (there, here, NULL, difference, sizeof difference))
    return pw_fail (error, PW_INPUT, "the checkpoint %.100s belongs to another run: %.300s", checkpoints->resume_path,
                    difference);
  if (command->table_path == NULL) return PW_OK;
  pw_output **table = &command->output[PW_RUN_TABLE];
  pw_mark mark = { 0 };
  if (checkpoints->resume_path == NULL)
    return pw_output_mark (*table, &mark, error); /* fails for a table that cannot be continued */
  pw_archive_bytes (&checkpoints->resumed.state, &mark, sizeof mark);
  *table = pw_output_continue (command->table_path, &mark, error);
  return *table ? PW_OK : error->status;
}

/* The next checkpoint is due at the first multiple of the interval after t; after every step if t has 2^53 intervals,
 * since then n + 1 is n in double precision. */
static void checkpoints_schedule (pw_checkpoints *checkpoints, double t) {
  if (checkpoints->interval == 0) return;
  double n = fmin (floor (t / checkpoints->interval), 0x1p53);
  while (n * checkpoints->interval <= t && n < 0x1p53) n++;
  checkpoints->next_time = n * checkpoints->interval;
}

/* Saves or loads the state of the command besides that of the run. */
static void checkpoints_serialise (pw_run_cli *command, pw_archive *archive) {
  pw_archive_bytes (archive, &command->rows, sizeof command->rows);
  pw_archive_bytes (archive, &command->cpu, sizeof command->cpu);
  pw_archive_bytes (archive, command->engine.reason, sizeof command->engine.reason);
  command->engine.reason[sizeof command->engine.reason - 1] = 0;
  if (command->plots) pw_plots_serialise (command->plots, archive);
  comparison_serialise (&command->comparison, archive);
}

/* After everything is open: loads the state of the checkpoint that is resumed, if any; schedules the next one. */
static int checkpoints_resume (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  if (checkpoints->resume_path) {
    checkpoints_serialise (command, &checkpoints->resumed.state);
    if (pw_run_load (command->run, &checkpoints->resumed.state, error) != PW_OK) return error->status;
    const double t = pw_run_time (command->run), rows = (double)command->rows, cpu = command->cpu;
    const double expected = command->table && command->row_interval > 0 ? floor (t / command->row_interval) + 1 : rows;
    if (!(t <= command->settings.span && rows >= 0 && fabs (rows - expected) <= 1 && isfinite (cpu) && cpu >= 0))
      return pw_fail (error, PW_INPUT,
                      "the checkpoint %s is not that of a run: its time, number of rows or processor time "
                      "is impossible",
                      checkpoints->resume_path);
    command->loaded = 1;
    checkpoints->last_path = checkpoints->resume_path, checkpoints->last_time = pw_run_time (command->run);
    pw_cli_say ("pinwheel: resumed at t = %s s\n", PW_DIGITS (pw_run_time (command->run), 6));
  }
  checkpoints_schedule (checkpoints, pw_run_time (command->run));
  return PW_OK;
}

/* Saves a checkpoint that is due; near a singular configuration it is postponed. */
static int checkpoints_save (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  pw_output *table = command->output[PW_RUN_TABLE];
  double t = pw_run_time (command->run);
  pw_mark mark = { 0 };
  if (t >= command->settings.span) return PW_OK;
  if (table && pw_output_mark (table, &mark, error) != PW_OK) return error->status;
  pw_archive_clear (&checkpoints->state);
  if (table) pw_archive_bytes (&checkpoints->state, &mark, sizeof mark);
  checkpoints_serialise (command, &checkpoints->state);
  int status = pw_run_save (command->run, &checkpoints->state, error); /* reopens the method, as resuming does */
  if (status > 0) return PW_OK; /* near a singular configuration: still due, so the next batch tries again */
  if (status != PW_OK) return status;
  checkpoints_schedule (checkpoints, t);
  if (checkpoints->state.failed) return pw_fail (error, PW_RESOURCE, "out of memory while saving a checkpoint");
  pw_output *output = pw_output_open_as (checkpoints->path, ".next", error);
  status =
      output ? pw_checkpoint_put (output, checkpoints->fingerprint.text, &checkpoints->state, error) : error->status;
  if (status == PW_OK) checkpoints->last_path = checkpoints->path, checkpoints->last_time = t;
  return status;
}

/* ---- Before the run ---- */

/* Refuses files used twice.  Called before the model is open, and again after that, for the tables that it reads. */
static int run_check_paths (pw_run_cli *command, pw_error *error) {
  const pw_checkpoints *checkpoints = &command->checkpoints;
  const char *resume_path = checkpoints->resume_path;
  if (resume_path && checkpoints->path && strcmp (resume_path, checkpoints->path) == 0) resume_path = NULL;
  static const char *const tables[] = { ".csv", ".npz", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--reference", command->reference_path, PW_READS, NULL },
                   { "--resume", resume_path, checkpoints->path ? PW_READS : PW_WRITES, NULL },
                   { "--checkpoint", checkpoints->path, PW_WRITES, NULL },
                   { "-o", command->table_path, PW_WRITES, tables },
                   { "--json", command->summary_path, PW_WRITES, pw_cli_json },
                   { "--animate", command->page_path, PW_WRITES, NULL },
                   { "--plots", command->plots_path, PW_WRITES_INTO, pw_figure_endings } };
  return pw_cli_check_uses (&command->line, use, sizeof use / sizeof *use, error);
}

/* Opens an output file; a path of standard output becomes "-". */
static int run_open_output (pw_run_cli *command, int which, const char **path, pw_error *error) {
  if (*path == NULL) return PW_OK;
  command->output[which] = pw_output_open (*path, error);
  if (command->output[which] && pw_output_stream (command->output[which]) == stdout) *path = "-";
  return command->output[which] ? PW_OK : error->status;
}

/* Opens the output files before anything is computed.  A table that is continued is opened once the checkpoint is
 * verified. */
static int run_open_outputs (pw_run_cli *command, pw_error *error) {
  const char *ending = command->table_path ? strrchr (command->table_path, '.') : NULL;
  if (ending && strcasecmp (ending, ".npz") == 0 && (command->checkpoints.path || command->checkpoints.resume_path))
    return pw_fail (error, PW_INPUT, "-o %s: an .npz archive cannot be continued after a checkpoint: write a .csv",
                    command->table_path);
  int has_plots = command->plots_path != NULL;
  int status = pw_cli_requires ("--every", command->every.text, "-o FILE", command->table_path != NULL, error);
  if (status == PW_OK) status = pw_cli_requires ("--width", command->line.width, "--plots DIR", has_plots, error);
  if (status == PW_OK) status = pw_cli_requires ("--colour", command->colour, "--plots DIR", has_plots, error);
  if (status == PW_OK && command->page_path) status = pw_animation_check ("--animate", command->page_path, error);
  if (status == PW_OK) status = run_check_paths (command, error);
  if (status == PW_OK) status = run_open_output (command, PW_RUN_SUMMARY, &command->summary_path, error);
  if (status == PW_OK) status = run_open_output (command, PW_RUN_PAGE, &command->page_path, error);
  if (status != PW_OK || command->checkpoints.resume_path) return status;
  return run_open_output (command, PW_RUN_TABLE, &command->table_path, error);
}

static void run_discard (pw_run_cli *command, int which) {
  if (command->output[which]) pw_output_discard (command->output[which]);
  command->output[which] = NULL;
}

/* Reads the settings, of which the engine is a part: a resumed run uses the same one. */
static int run_read_settings (pw_run_cli *command, pw_error *error) {
  const pw_run_defaults *defaults = &command->line.m.defaults;
  const pw_method *method;
  pw_specialise when = command->line.when;
  pw_error reason = { 0 };
  pw_cli_settings (&command->line, defaults, &command->settings, &command->limit);
  command->row_interval = command->every.number;
  command->method = command->line.method ? command->line.method : defaults->method;
  if (command->line.method == NULL &&
      pw_method_parse (command->method, command->line.methods, &method, NULL, &reason) != PW_OK)
    return pw_fail (error, reason.status, "model %s: its default method: %s", pw_file_name (command->line.m.file),
                    reason.text);
  command->settings.ledger = command->with_energies || command->plots_path || command->page_path;
  if (checkpoints_open (command, &when, error) != PW_OK) return error->status;
  pw_cli_engine_open (&command->engine, command->line.m.system, when,
                      pw_method_steps (command->method, &command->settings, defaults->step, command->settings.span));
  command->settings.specialised = pw_scene_code_table (command->engine.code);
  return PW_OK;
}

static int run_open (pw_run_cli *command, pw_error *error) {
  int status = run_open_outputs (command, error);
  if (status == PW_OK) {
    status = pw_cli_open (&command->line, error);
    /* a summary is written of every run, but not over a table that the model reads */
    if (command->line.m.file && run_check_paths (command, status == PW_OK ? error : &(pw_error){ 0 }) != PW_OK)
      run_discard (command, PW_RUN_SUMMARY), status = error->status;
  }
  if (status == PW_OK) status = run_read_settings (command, error);
  if (status == PW_OK) status = checkpoints_prepare (command, error);
  if (status != PW_OK) return status;
  const pw_system *system = command->line.m.system;
  if (command->plots_path || command->page_path) {
    command->plots = pw_plots_open (command->plots_path, command->page_path != NULL, command->line.m.model, system,
                                    command->settings.span, error);
    if (command->plots == NULL || pw_plots_style (command->plots, command->line.width, command->colour, error) != PW_OK)
      return error->status;
  }
  status =
      comparison_open (&command->comparison, &command->line, command->reference_path, command->settings.span, error);
  if (status != PW_OK) return status;
  const char *follows = command->of ? "of" : command->line.until ? "until" : NULL;
  if (follows && command->with_error)
    return pw_fail (error, PW_INPUT, "--error compares complete runs: it cannot be given together with --%s", follows);
  if (follows && command->checkpoints.path)
    return pw_fail (error, PW_INPUT, "--checkpoint cannot be given together with --%s", follows);
  int outputs = 0;
  while (command->of && command->of[outputs]) outputs++;
  if (follows)
    status = pw_outcomes_open (&command->outcomes, system, "--of", command->of, outputs, command->line.until, error);
  if (status != PW_OK) return status;
  if (follows) pw_outcomes_report (&command->outcomes);
  if (follows) pw_outcomes_settings (&command->outcomes, &command->settings);
  command->run = pw_limit_open (system, command->method, &command->settings, error);
  if (command->run == NULL) return error->status;
  command->redundant = pw_report_redundancies (command->run);
  pw_report_model (&command->line.m);
  report_settings (command->run, system, command->method, &command->line, &command->settings);
  pw_report_initialisation (command->run, system, command->redundant);
  pw_output *table = command->output[PW_RUN_TABLE];
  if (table && (command->table = pw_csv_open (system, command->with_energies, table, error)) == NULL)
    return error->status;
  status = error_start (command, error);
  return status == PW_OK ? checkpoints_resume (command, error) : status;
}

/* ---- The run ---- */

/* The time of the next row [s]: a multiple of the interval, or the end if the two differ by round-off only; 0 if every
 * step has a row; INFINITY without a table. */
static double run_next_row_time (const pw_run_cli *command) {
  if (command->table == NULL) return INFINITY;
  if (command->row_interval == 0) return 0;
  double t = (double)command->rows * command->row_interval;
  double round_off = fmax (1e-9 * command->row_interval, 4 * DBL_EPSILON * command->settings.span);
  return t > 0 && fabs (t - command->settings.span) <= round_off ? command->settings.span : t;
}

/* Writes the row of a time in the last step. */
static int run_write_row (pw_run_cli *command, double t, pw_error *error) {
  pw_sample sample;
  int status = pw_run_sample (command->run, t, &sample, error);
  if (status == PW_OK) status = pw_csv_write (command->table, command->line.m.system, &sample, error);
  command->rows += status == PW_OK;
  pw_progress_at (&command->progress, t);
  return status;
}

/* Writes rows and stores samples up to the time reached, or that at which --until ends the run, which has a row. */
static int run_store_samples (pw_run_cli *command, pw_error *error) {
  pw_motion *motion = &command->comparison.motion;
  pw_run *run = command->run;
  double now = run_end_time (command);
  pw_sample sample;
  int status = PW_OK;
  if (command->table && command->row_interval == 0) status = run_write_row (command, now, error);
  while (status == PW_OK && command->row_interval > 0 && run_next_row_time (command) <= now)
    status = run_write_row (command, run_next_row_time (command), error);
  if (status == PW_OK && command->table && command->row_interval > 0 && command->outcomes.ended &&
      (double)(command->rows - 1) * command->row_interval < now) /* the last row is not a multiple of the interval */
    status = run_write_row (command, now, error);
  while (status == PW_OK && command->plots && pw_plots_next (command->plots) <= now) {
    status = pw_run_sample (run, pw_plots_next (command->plots), &sample, error);
    if (status == PW_OK) pw_plots_add (command->plots, &sample);
  }
  if (status == PW_OK && command->plots && command->outcomes.ended) {
    status = pw_run_sample (run, now, &sample, error);
    if (status == PW_OK) pw_plots_last (command->plots, &sample);
  }
  while (status == PW_OK && pw_motion_next_time (motion) <= now) {
    status = pw_run_sample (run, pw_motion_next_time (motion), &sample, error);
    if (status == PW_OK) pw_motion_add (motion, command->line.m.system, &sample);
  }
  while (status == PW_OK && error_next (&command->stated) <= now) status = error_add (&command->stated, run, error);
  return status;
}

static int run_batch (pw_run_cli *command, pw_error *error) {
  double due = fmin (command->checkpoints.next_time, command->settings.span);
  due = fmin (due, run_next_row_time (command));
  due = fmin (due, pw_motion_next_time (&command->comparison.motion));
  due = fmin (due, error_next (&command->stated));
  if (command->plots) due = fmin (due, pw_plots_next (command->plots));
  double start = pw_seconds (CLOCK_MONOTONIC); /* read without a system call, unlike processor time */
  int status;
  long steps = 0;
  do {
    status = command->outcomes.system
                 ? pw_outcomes_advance (&command->outcomes, command->run, due, command->settings.span, error)
                 : pw_run_advance_towards (command->run, due, command->settings.span, error);
    if (command->outcomes.ended) break;
  } while (status == PW_OK && ++steps < command->batch && pw_run_time (command->run) < due && !pw_stop);
  double seconds = pw_seconds (CLOCK_MONOTONIC) - start;
  command->stepping += seconds;
  pw_batch_adapt (&command->batch, steps, seconds);
  return status;
}

/* Adds the share of steps in the processor time since the last call. */
static void run_count_cpu (pw_run_cli *command) {
  double *before = command->counted, now = pw_seconds (CLOCK_MONOTONIC), cpu = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
  if (command->stepping > 0) command->cpu += command->stepping * fmin (1, (cpu - before[1]) / (now - before[0]));
  command->stepping = 0, before[0] = now, before[1] = cpu;
}

static int run_steps (pw_run_cli *command, pw_error *error) {
  run_count_cpu (command);
  /* a checkpoint has the samples up to its time */
  pw_outcomes *outcomes = command->outcomes.system ? &command->outcomes : NULL;
  int status = outcomes ? pw_outcomes_begin (outcomes, command->run, command->settings.span, error) : PW_OK;
  if (status == PW_OK && !command->checkpoints.resume_path) status = run_store_samples (command, error);
  while (status == PW_OK && !command->outcomes.ended && pw_run_time (command->run) < command->settings.span &&
         !pw_stop) {
    status = run_batch (command, error);
    if (status == PW_OK) status = run_store_samples (command, error);
    if (status == PW_OK && pw_run_time (command->run) >= command->checkpoints.next_time) {
      run_count_cpu (command);
      status = checkpoints_save (command, error);
      run_count_cpu (command); /* without the time of writing */
    }
    pw_progress_at (&command->progress, pw_run_time (command->run));
  }
  run_count_cpu (command);
  return status;
}

static int run_is_stdout (const char *path) {
  return path && strcmp (path, "-") == 0;
}

static int run_integrate (pw_run_cli *command, pw_error *error) {
  command->batch = 1;
  pw_stop_catch ();
  pw_progress_start (&command->progress, pw_file_name (command->line.m.file), "s", pw_run_time (command->run),
                     command->settings.span);
  command->progress.no_bar = run_is_stdout (command->table_path);
  int status = run_steps (command, error);
  pw_progress_end (&command->progress);
  int complete = status == PW_OK && (command->outcomes.ended || pw_run_time (command->run) >= command->settings.span);
  int stated = error_finish (&command->stated, complete, error);
  pw_stop_release ();
  if (complete && command->of) {
    stated = pw_outcomes_end (&command->outcomes, command->run, error);
    command->has_outputs = stated == PW_OK;
  }
  if (complete) {
    pw_stop = 0; /* too late: the run is complete */
    status = stated;
  }
  const pw_statistics *statistics = pw_run_statistics (command->run);
  int too_many_steps = status == PW_METHOD && pw_cli_adaptive (command->line.methods, command->method) == 1 &&
                       statistics->steps + statistics->rejected >= command->settings.max_steps;
  command->limited = status == PW_STOPPED || too_many_steps;
  if (status == PW_STOPPED) status = pw_limit_status (&command->limit, pw_run_time (command->run), error);
  return status;
}

/* ---- After the run ---- */

/* Writes the table to the disk for run_name_files, or keeps its rows as NAME.part; without rows it leaves no file. */
static void run_close_table (pw_run_cli *command, int complete, pw_error *error) {
  char *kept_path = command->kept_path[PW_RUN_TABLE];
  pw_output **output = &command->output[PW_RUN_TABLE];
  pw_error close_error = { 0 };
  complete &= pw_csv_close (command->table, complete ? error : &close_error) == PW_OK;
  int is_file = *output ? pw_output_is_file (*output) : command->table_path != NULL;
  if (*output && complete && pw_output_ready (*output, error) == PW_OK) return;
  command->write_failed = is_file && error->status == PW_RESOURCE;
  int has_rows = command->rows > 0 || command->checkpoints.resume_path != NULL; /* a table that is continued has rows */
  if (*output) pw_cli_abandon_table (*output, has_rows, kept_path, sizeof *command->kept_path);
  if (complete) *kept_path = 0; /* the error names it */
  *output = NULL;
}

/* The first error decides the exit status; later ones are only printed. */
static void run_add_error (pw_error *error, const pw_error *later) {
  if (error->status == PW_OK)
    *error = *later;
  else if (later->status != PW_OK)
    pw_cli_say ("pinwheel: %s\n", later->text);
}

/* Writes the JSON summary however the run has ended, except that a failed resumption does not replace the previous
 * summary. */
static void run_write_json (pw_run_cli *command, const pw_summary *summary, const pw_sample *sample, pw_error *error) {
  pw_error write_error = { 0 };
  if (command->checkpoints.resume_path && !command->loaded) run_discard (command, PW_RUN_SUMMARY);
  pw_output *output = command->output[PW_RUN_SUMMARY];
  if (output == NULL) return;
  const pw_statistics *statistics = command->run ? pw_run_statistics (command->run) : NULL;
  if (pw_json_write (summary, command->line.m.system, sample, command->with_energies, statistics, output,
                     &write_error) != PW_OK)
    command->write_failed |= pw_output_is_file (output);
  run_add_error (error, &write_error);
}

/* Gives table, summary and page their final names together; after a failure to write all keep their temporary ones.
 * The incomplete table of a run that ended early has been closed already; the summary has the reason. */
static void run_name_files (pw_run_cli *command, pw_error *error) {
  pw_error finish_error = { 0 };
  for (int i = 0; command->write_failed && i < PW_RUN_OUTPUTS; i++) {
    if (command->output[i] == NULL || !pw_output_is_file (command->output[i])) continue;
    pw_output_abandon (command->output[i], command->kept_path[i], sizeof command->kept_path[i]);
    command->output[i] = NULL;
  }
  pw_output_finish_all (command->output, PW_RUN_OUTPUTS, &finish_error);
  run_add_error (error, &finish_error);
}

/* Completes figures and animation; after an interrupt gnuplot is not run.  1 if a signal has ended it. */
static int run_finish_figures (pw_run_cli *command, const char *reason, pw_error *error) {
  pw_error draw_error = { 0 };
  int status = PW_OK, animated = 0;
  if (command->plots && command->run) pw_plots_events (command->plots, command->run);
  if (command->plots && command->run) status = pw_plots_finish (command->plots, !pw_stop, &draw_error);
  if (command->plots && command->run && command->output[PW_RUN_PAGE])
    animated = pw_animate (command->plots, command->page_path, command->output[PW_RUN_PAGE], command->method, reason);
  if (!animated) run_discard (command, PW_RUN_PAGE);
  run_add_error (error, &draw_error);
  return status == PW_INTERRUPTED;
}

/* Everything after the last step, however that came about: table, summary, figures, messages.  Returns an exit
 * status. */
static int run_finish (pw_run_cli *command, pw_error *error) {
  pw_run *run = command->run;
  static const char *const output_name[PW_RUN_OUTPUTS] = { "the table so far", "the page", "the summary" };
  char reason[PW_RUN_REASON] = "";
  int interrupted = error->status == PW_OK && pw_stop;
  pw_sample sample, *last = NULL;
  if (run && pw_run_sample (run, run_end_time (command), &sample, NULL) == PW_OK) last = &sample;
  run_close_table (command, error->status == PW_OK && !interrupted, error);
  pw_summary summary = run_summary (command, last, error, reason);
  if (last && command->table_path == NULL && command->summary_path == NULL) report_end (command, &summary, last);
  FILE *text = run_is_stdout (command->table_path) || run_is_stdout (command->summary_path) ? stderr : stdout;
  report_outputs (command, text);
  report_stated (command, text);
  if (error->status == PW_OK) report_warnings (run, summary.energy_defect);
  int undrawn = run_finish_figures (command, summary.reason, error);
  if (!interrupted) summary.status = pw_cli_status_word (error->status); /* summary.reason is the text of the error */
  if (undrawn && error->status == PW_OK) summary.status = "interrupted", summary.reason = "gnuplot was interrupted";
  run_write_json (command, &summary, last, error);
  run_name_files (command, error);
  if (interrupted) pw_cli_say ("pinwheel: %s\n", reason);
  int status = pw_cli_report_error (error);
  error->status = PW_OK;
  for (int i = 0; i < PW_RUN_OUTPUTS; i++)
    if (*command->kept_path[i]) pw_cli_say ("pinwheel: %s is kept in %s\n", output_name[i], command->kept_path[i]);
  if (command->checkpoints.last_path && (interrupted || command->limited || status == -PW_RESOURCE))
    pw_cli_say ("pinwheel: --resume %s continues from t = %s s\n", command->checkpoints.last_path,
                PW_DIGITS (command->checkpoints.last_time, 6));
  return (interrupted || undrawn) && status == 0 ? PW_INTERRUPTED : status;
}

static int run_command (void *options, pw_error *error) {
  pw_run_cli *command = options;
  if (run_open (command, error) == PW_OK) run_integrate (command, error);
  int status = run_finish (command, error);
  pw_checkpoints *checkpoints = &command->checkpoints;
  if (checkpoints->lock) pw_output_discard (checkpoints->lock);
  free (checkpoints->fingerprint.text);
  pw_archive_free (&checkpoints->state);
  pw_checkpoint_free (&checkpoints->resumed);
  pw_plots_close (command->plots);
  comparison_close (&command->comparison);
  error_close (&command->stated);
  pw_run_close (command->run);
  pw_outcomes_close (&command->outcomes);
  free (command->redundant);
  pw_cli_engine_close (&command->engine);
  return status;
}

static const struct poptOption run_options[] = {
  PW_METHOD_OPTIONS,
  PW_OPTION_GROUP ("Output"),
  PW_TEXT_OPTION (pw_run_cli, table_path, "output", 'o', "FILE.csv",
                  "Write a table of samples, FILE.npz for NumPy; - is standard output"),
  PW_NUMBER_OPTION (pw_run_cli, every, "every", 0, "DT", PW_POSITIVE,
                    "Time between rows of the table [s] (default: a row per step)"),
  PW_TEXT_OPTION (pw_run_cli, summary_path, "json", 0, "FILE", "Write a summary as JSON; - is standard output"),
  PW_TEXT_OPTION (pw_run_cli, plots_path, "plots", 0, "DIR", "Draw figures into a folder"),
  PW_WIDTH_OPTION,
  PW_TEXT_OPTION (pw_run_cli, colour, "colour", 0, "WHAT",
                  "What the colours of snapshots show: body (default) or time"),
  PW_TEXT_OPTION (pw_run_cli, page_path, "animate", 0, "FILE.html", "Write an animation as a page for web browsers"),
  PW_FLAG_OPTION (pw_run_cli, with_energies, "energy", "Show energies, work and losses"),
  PW_LIST_OPTION (pw_run_cli, of, "of", 0, "OUTPUT", "Print " PW_OUTPUT_HELP "; repeatable"),
  PW_UNTIL_OPTION,
  PW_FLAG_OPTION (pw_run_cli, with_error, "error",
                  "State the error, from a repetition with a tenth of the tolerance or half the step"),
  PW_TEXT_OPTION (pw_run_cli, reference_path, "reference", 0, "FILE.csv",
                  "Measure errors against this table, with columns as in -o, instead of the model's exact solution"),
  PW_ALIAS_OPTION (pw_run_cli, reference_path, "truth"),
  PW_OPTION_GROUP ("Checkpoints"),
  PW_TEXT_OPTION (pw_run_cli, checkpoints.path, "checkpoint", 0, "FILE",
                  "Save the state regularly, so that the run can be resumed"),
  PW_NUMBER_OPTION (pw_run_cli, checkpoints.interval_given, "checkpoint-every", 0, "T", PW_POSITIVE,
                    "Simulated time between checkpoints [s] (default: a tenth of the run)"),
  PW_TEXT_OPTION (pw_run_cli, checkpoints.resume_path, "resume", 0, "FILE",
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
  .options_size = sizeof (pw_run_cli),
  .function = run_command,
  .options = run_options,
};
