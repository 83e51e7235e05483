/* Prints messages and results of a run: warnings on standard error, results as tables on standard output. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "report.h"
#include "run_command.h"

enum {
  REPORT_MESSAGES = 8, /* messages of one kind, or changed states, that are printed at most */
  REPORT_ROWS = 24,    /* reactions, or internal coordinates, that are printed at most */
  REPORT_EVENTS = 10,  /* listed */
  REPORT_TEXT = 400,   /* longest description of a redundant equation, end included */
  REPORT_WIDTH = 13,   /* of a column of numbers */
  REPORT_DIGITS = 8
};
#define REPORT_DEFECT 0.01 /* relative energy defect above which a warning is printed */

/* The end of a list of which `more` entries are not printed. */
static void report_more (FILE *f, int more, const char *hint) {
  if (more > 0) fprintf (f, "  and %d more%s\n", more, hint);
}

void pw_report_settings (pw_run *run, const pw_system *system, const char *method, const pw_cli_line *line,
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

/* Angles of more than a turn that are multiples of 0.5: most likely they are degrees, not those of a long run. */
static void report_angle (const char *kind, const char *name, const char *field, double angle) {
  if (!(fabs (angle) > 2 * PW_PI) || fmod (angle, 0.5) != 0) return;
  pw_cli_say ("pinwheel: %s %s: %s = %s rad is more than a turn and ends at %s degrees; if degrees are meant, write "
              "\"*deg\" after the number\n",
              kind, name, field, PW_DIGITS (angle, 6), PW_DIGITS (fmod (angle * 180 / PW_PI, 360), 4));
}

/* A heading that is probably in degrees; expressions that may jump when states change: steps do not end there. */
static void report_field (const pw_element *element, const pw_field *field) {
  const void *value = (const char *)element->definition + field->offset;
  const char *kind = element->kind->name, *name = pw_element_name (element);
  const pw_signal *signal = field->type == PW_SIGNAL ? value : NULL;
  const double *number = signal && signal->type == PW_CONSTANT ? &signal->constant : NULL;
  if (field->type == PW_NUMBER) number = value;
  if (number && strcmp (field->name, "heading") == 0) report_angle (kind, name, field->name, *number);
  for (const pw_signal *s = signal; s && s < signal + pw_field_count (field); s++)
    if (s->type == PW_FUNCTION && s->function.text && s->function.text->jump)
      pw_cli_say (
          "pinwheel: %s %s: %s: \"%.80s\" may jump as states change; steps do not end there, which costs accuracy\n",
          kind, name, field->name, s->function.text->jump);
}

void pw_report_model (const pw_cli_model *m) {
  int elements;
  const pw_system *s = m->system;
  const pw_element *element = pw_model_elements (m->model, &elements);
  for (int i = 0; i < pw_system_bodies (s); i++)
    report_angle ("body", pw_system_body_name (s, i), "initial phi", pw_system_initial_q (s)[3 * i + 2]);
  for (int i = 0; i < elements; i++)
    for (const pw_field *field = element[i].kind->fields; field->name; field++) report_field (&element[i], field);
}

/* States that the consistent initialisation has changed: values that were specified, and those that were left out. */
static void report_initial (pw_run *run, const pw_system *system) {
  const pw_initial_report *initial = pw_run_initial (run);
  int n = pw_system_coordinates (system), changed = 0, listed = 0;
  char rounded[80] = "", reason[300];
  if (initial->moved == 0) return;
  for (int state = 0; state < 2 * n; state++)
    changed += pw_initial_moved (system, initial, state) && pw_initial_specified (initial, state);
  const char *left = PW_COUNTED (initial->moved - changed, "initial value");
  if (initial->rounded)
    snprintf (rounded, sizeof rounded, " (%d by less than 1e-2 of its unit, as if rounded)", initial->rounded);
  if (changed)
    pw_cli_say ("pinwheel: the initial values do not satisfy the constraints: %d %s changed%s%s%s:\n", changed,
                changed == 1 ? "was" : "were", initial->released ? ", including given ones" : "", rounded,
                changed < initial->moved ? PW_PRINTED (80, "; %s left out follow%s from them", left,
                                                       initial->moved - changed == 1 ? "s" : "")
                                         : "");
  else
    pw_cli_say ("pinwheel: %s left out follow%s from the constraints:\n", left, initial->moved == 1 ? "s" : "");
  for (int specified = 1; specified >= 0; specified--)
    for (int state = 0; state < 2 * n && listed < REPORT_MESSAGES; state++) {
      if (!pw_initial_moved (system, initial, state) || pw_initial_specified (initial, state) != specified) continue;
      const pw_state_change c = pw_cli_state_change (system, initial, state);
      const char *origin = pw_initial_given (initial, state) ? "given" : "specified";
      if (specified) pw_run_initial_reason (run, state, reason, sizeof reason);
      pw_cli_say (specified ? "  %s from %s to" : "  %s =", c.name, PW_DIGITS (c.given, 10));
      pw_cli_say (" %s%s%s", PW_DIGITS (c.consistent, 10), *c.unit ? " " : "", c.unit);
      if (specified) pw_cli_say (" (%s%s%s)", origin, *reason ? "; otherwise " : "", reason);
      pw_cli_say ("\n");
      listed++;
    }
  report_more (stderr, initial->moved - listed, "");
}

int pw_report_initial_state (const pw_cli_model *m, double limit, pw_error *error) {
  pw_error own = { 0 };
  pw_limit seconds = { .seconds = limit };
  const pw_settings settings = { .stop = pw_limit_over, .stop_context = &seconds };
  pw_limit_start (&seconds);
  pw_run *run = pw_run_open (m->system, "rk4+none", &settings, &own); /* makes no step: any method will do */
  if (run) report_initial (run, m->system);
  pw_run_close (run);
  return own.status == PW_RESOURCE ? pw_fail (error, own.status, "%s", own.text) : PW_OK;
}

void pw_report_initialisation (pw_run *run, const pw_system *system, const char *const *redundant) {
  int differences = pw_system_differences (system), count = 0;
  for (int i = 0; i < differences && i < REPORT_MESSAGES; i++)
    pw_cli_say ("pinwheel: derivatives by differences: %s\n", PW_NAME (pw_system_difference_name, system, i));
  report_more (stderr, differences - REPORT_MESSAGES, "");
  report_initial (run, system);
  for (; redundant && redundant[count]; count++)
    if (count < REPORT_MESSAGES) pw_cli_say ("pinwheel: redundant: %s\n", redundant[count]);
  report_more (stderr, count - REPORT_MESSAGES, "");
  if (count > 0)
    pw_cli_say ("pinwheel: reactions of redundant constraints are not unique: those of least norm are given\n");
}

const char **pw_report_redundancies (pw_run *run) {
  size_t count = (size_t)pw_run_redundant (run);
  const char **text = count > 0 ? malloc ((count + 1) * sizeof *text + count * REPORT_TEXT) : NULL;
  if (text == NULL) return NULL;
  char *buffer = (char *)(text + count + 1);
  for (size_t i = 0; i < count; i++) text[i] = pw_run_redundancy (run, (int)i, buffer + i * REPORT_TEXT, REPORT_TEXT);
  text[count] = NULL;
  return text;
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
  report_more (stdout, n - end, "");
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
  report_more (stdout, count - REPORT_ROWS, ": -o FILE.csv writes them all");
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

pw_summary pw_run_summary (pw_run_cli *command, const pw_sample *last, const pw_error *error,
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
                         .reference = run ? pw_comparison_errors (&command->comparison, command->line.m.system) : NULL,
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

void pw_report_warnings (const pw_run *run, double defect) {
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

void pw_report_outputs (const pw_run_cli *command, FILE *f) {
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

void pw_report_end (const pw_run_cli *command, const pw_summary *summary, const pw_sample *last) {
  const pw_system *system = command->line.m.system;
  const pw_statistics *stats = pw_run_statistics (command->run);
  printf ("%s, %s, at t = %s s\n\n", summary->model, summary->method, PW_DIGITS (last->t, 8));
  pw_print_bodies (system, last->q, last->v, "body", -5, REPORT_WIDTH, REPORT_DIGITS, 0);
  report_more (stdout, pw_system_bodies (system) - PW_BODIES_PRINTED, ": -o FILE.csv writes them all");
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
