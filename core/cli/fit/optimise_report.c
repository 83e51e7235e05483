/* The reports of `pinwheel optimise`. */
#include "optimise.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "print_table.h"

#define REPORT_SAME 0.01 /* largest distance of results of the same optimum, in scales of the unknowns */

enum {
  REPORT_DIGITS = 9,
  REPORT_PANELS = 6 /* of a figure, at most: one for each unknown */
};

int pw_optimise_same (const pw_optimise *problem, const pw_search *a, const pw_search *b) {
  int same = a->feasible && b->feasible;
  for (int j = 0; same && j < problem->unknowns.count; j++)
    same = problem->without_effect[j] || fabs (a->to[j] - b->to[j]) <= REPORT_SAME * problem->unknowns.list[j].scale;
  return same;
}

/* The objective of the first run, with the initial values; NaN if it failed. */
static double report_initial (const pw_optimise *problem) {
  return problem->search[0].runs > 0 ? problem->search[0].trials[problem->unknowns.count] : NAN;
}

/* 1 if no unknown has an effect on the objective. */
static int report_is_constant (const pw_optimise *problem) {
  return memchr (problem->objective_same, 0, (size_t)problem->unknowns.count) == NULL;
}

/* The bound at which the best value of unknown i is: -1 the lower one, 1 the upper one, 0 neither, or no effect.  The
 * value of an incomplete search must be exactly there. */
static int report_bound (const pw_optimise *problem, int i) {
  const pw_unknown *unknown = problem->unknowns.list + i;
  if (problem->without_effect[i]) return 0;
  double near = problem->incomplete ? 0 : 10 * PW_SEARCH_FINE * unknown->scale, value = problem->best->to[i];
  return value - unknown->low <= near ? -1 : unknown->high - value <= near;
}

static void report_unknowns (const pw_optimise *problem) {
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    static const char *const head[] = { "free", "initially", "best", "from", "to", NULL };
    pw_head (&t, -12, 12, head);
    for (int i = 0; i < problem->unknowns.count; i++) {
      const pw_unknown *u = problem->unknowns.list + i;
      pw_cell_unit (&t, -12, u->name, u->unit);
      pw_cell_number (&t, 12, u->value, REPORT_DIGITS);
      pw_cell_number (&t, 12, problem->best->to[i], REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->low) ? u->low : NAN, REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->high) ? u->high : NAN, REPORT_DIGITS);
      pw_cell (&t, -1,
               problem->without_effect[i]
                   ? "without effect"
                   : (const char *[]){ "at its lower bound", "", "at its upper bound" }[1 + report_bound (problem, i)]);
      pw_row_end (&t);
    }
  }
}

static void report_outputs (const pw_optimise *problem) {
  const double *output = problem->best->output;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < problem->outputs; i++) {
      const char *bound = PW_DIGITS (problem->bound[i], REPORT_DIGITS);
      pw_cell_unit (&t, -12, problem->output[i], problem->unit[i]);
      pw_cell_number (&t, 12, output[i], REPORT_DIGITS);
      if (i > 0) pw_cell (&t, -1, PW_PRINTED (60, "at %s %s", problem->sign[i] > 0 ? "most" : "least", bound));
      if (i == 0)
        pw_cell (
            &t, -1,
            PW_PRINTED (60, "%s%s", problem->maximise ? "largest" : "smallest", problem->incomplete ? " so far" : ""));
      if (i == 0)
        pw_cell (&t, -1, PW_PRINTED (60, "(initially %s)", PW_DIGITS (report_initial (problem), REPORT_DIGITS)));
      pw_row_end (&t);
    }
}

void pw_optimise_print (const pw_optimise *problem) {
  char options[PW_UNKNOWNS_OPTIONS];
  /* a search from a start also ends at a result that continues from there */
  const pw_search *best = problem->best, continued = { .feasible = 1, .to = best->from };
  int same = 0;
  for (int i = 0; i < problem->starts; i++)
    same += pw_optimise_same (problem, problem->search + i, best) ||
            (best - problem->search >= problem->starts && pw_optimise_same (problem, problem->search + i, &continued));
  report_unknowns (problem);
  report_outputs (problem);
  printf ("\n%s from %s, %d of which %s\n", PW_COUNTED (problem->runs, "run"), PW_COUNTED (problem->starts, "start"),
          same,
          problem->incomplete ? "end here"
          : same == 1         ? "ends at this optimum"
                              : "end at this optimum");
  if (problem->derivatives)
    printf ("with derivatives at %s of the searches that continue (SLSQP), without in the others\n",
            PW_COUNTED (problem->derivatives, "point"));
  if (problem->first_error)
    pw_cli_print (stdout, "%s failed and %s as infeasible, the first of them: %s\n",
                  PW_COUNTED (problem->failed, "run"), problem->failed == 1 ? "counts" : "count",
                  problem->first_error->text);
  if (report_is_constant (problem)) pw_cli_say ("pinwheel: no free value has an effect on %s\n", problem->output[0]);
  if (pw_unknowns_options (&problem->unknowns, problem->best->to, options)) printf ("\n%s\n", options);
}

/* ---- JSON ---- */

static void report_json_unknown (const pw_optimise *problem, pw_json *j, int i) {
  const pw_unknown *u = problem->unknowns.list + i;
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "name", u->name);
  pw_json_text (j, "unit", u->unit);
  pw_json_number (j, "initial", u->value);
  pw_json_number (j, "value", problem->best->to[i]);
  pw_json_number (j, "low", u->low);
  pw_json_number (j, "high", u->high);
  pw_json_text (j, "bound", (const char *[]){ "low", NULL, "high" }[1 + report_bound (problem, i)]);
  pw_json_close (j, '}');
}

static void report_json_search (const pw_optimise *problem, pw_json *j, const pw_search *search) {
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "value", search->feasible ? search->output[0] : NAN);
  pw_json_number (j, "runs", (double)search->runs);
  pw_json_number (j, "failed", (double)search->failed);
  pw_json_numbers (j, "from", search->from, problem->unknowns.count);
  pw_json_numbers (j, "to", search->to, search->feasible ? problem->unknowns.count : 0);
  pw_json_close (j, '}');
}

static void report_json_constraint (const pw_optimise *problem, pw_json *j, int i) {
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "output", problem->output[i]);
  pw_json_text (j, "type", problem->sign[i] > 0 ? "<=" : ">=");
  pw_json_number (j, "bound", problem->bound[i]);
  pw_json_number (j, "value", problem->best->output[i]);
  pw_json_close (j, '}');
}

void pw_optimise_json (const pw_optimise *problem, const char *status, FILE *f) {
  pw_json json = { .f = f, .lines = 2 }, *j = &json;
  char options[PW_UNKNOWNS_OPTIONS];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (problem->model.file));
  pw_json_text (j, "status", status);
  pw_json_text (j, problem->maximise ? "maximise" : "minimise", problem->output[0]);
  pw_json_number (j, "value", problem->best->output[0]);
  pw_json_number (j, "initial", report_initial (problem));
  pw_json_text (j, "options", pw_unknowns_options (&problem->unknowns, problem->best->to, options));
  pw_json_text (j, "method", problem->unknowns.method);
  pw_json_number (j, "t_end", problem->unknowns.t_end);
  pw_json_number (j, "seed", problem->seed);
  pw_json_number (j, "runs", (double)problem->runs);
  pw_json_number (j, "failed", (double)problem->failed);
  pw_json_number (j, "derivatives", (double)problem->derivatives);
  pw_json_text (j, "reason", problem->first_error ? problem->first_error->text : "");
  pw_json_open (j, "unknowns", '[');
  for (int i = 0; i < problem->unknowns.count; i++) report_json_unknown (problem, j, i);
  pw_json_close (j, ']');
  pw_json_open (j, "constraints", '[');
  for (int i = 1; i < problem->outputs; i++) report_json_constraint (problem, j, i);
  pw_json_close (j, ']');
  pw_json_open (j, "starts", '[');
  for (int i = 0; i < problem->starts + problem->refinements; i++) report_json_search (problem, j, problem->search + i);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- YAML ---- */

/* Writes the command that runs the result, as a comment: the given options that affect runs, then the values found. */
static void report_command (const pw_optimise *problem, const char *values, FILE *f) {
  const pw_cli_line *line = &problem->line;
  const struct {
    const char *option, *value;
  } given[] = {
    { "--max-file", line->max_file },   { "--method", line->method },
    { "--t-end", line->t_end },         { "--step", line->step },
    { "--rtol", line->rtol },           { "--atol", line->atol },
    { "--max-steps", line->max_steps }, { "--specialise", problem->unknowns.engine.code ? "always" : line->specialise }
  };
  fputs ("# pinwheel run ", f);
  pw_cli_word (f, line->argument[0]);
  for (const char **set = line->sets; set && *set; set++) fputs (" --set ", f), pw_cli_word (f, *set);
  for (const char **start = line->starts; start && *start; start++) fputs (" --start ", f), pw_cli_word (f, *start);
  for (size_t i = 0; i < sizeof given / sizeof *given; i++)
    if (given[i].value) fprintf (f, " %s ", given[i].option), pw_cli_word (f, given[i].value);
  fprintf (f, " %s\n", values);
}

static void report_yaml_text (FILE *f, const char *key, const char *text) {
  fprintf (f, "%s: ", key);
  pw_cli_quoted (f, text, "''");
  fputc ('\n', f);
}

void pw_optimise_yaml (const pw_optimise *problem, FILE *f) {
  char values[PW_UNKNOWNS_OPTIONS];
  const pw_search *best = problem->best;
  if (pw_unknowns_options (&problem->unknowns, best->to, values) && strpbrk (problem->line.argument[0], "\r\n") == NULL)
    report_command (problem, values, f);
  if (problem->incomplete)
    fprintf (f, "# perhaps not an optimum: %.*s\n", (int)strcspn (problem->incomplete, "\r\n"), problem->incomplete);
  report_yaml_text (f, "model", pw_file_name (problem->model.file));
  report_yaml_text (f, problem->maximise ? "maximise" : "minimise", problem->output[0]);
  fprintf (f, "value: %.17g\n", best->output[0]);
  for (int initial = 0; initial < 2; initial++)
    for (int i = 0, first = 1; i < problem->unknowns.count; i++) {
      if ((problem->unknowns.list[i].parameter == NULL) != initial) continue;
      if (first) fputs (initial ? "start:\n" : "set:\n", f);
      first = 0;
      fprintf (f, "  %s: %.17g\n", problem->unknowns.list[i].name, best->to[i]);
    }
}

/* ---- Figures ---- */

/* Writes a row per run: number of its search, unknowns, objective, 1 if it satisfies the constraints. */
static int report_data (const void *context, FILE *f, pw_error *error) {
  const pw_optimise *problem = context;
  int n = problem->unknowns.count, width = n + problem->outputs;
  (void)error;
  fputs ("# start", f);
  for (int i = 0; i < n; i++) fprintf (f, ", %s [%s]", problem->unknowns.list[i].name, problem->unknowns.list[i].unit);
  fprintf (f, ", %s, 1 if the constraints are satisfied\n", problem->output[0]);
  for (int i = 0; i < problem->starts + problem->refinements; i++)
    for (long k = 0; k < problem->search[i].runs; k++) {
      fprintf (f, "%d", i + 1);
      const double *row = problem->search[i].trials + k * width;
      for (int c = 0; c <= n; c++) fprintf (f, " %s", PW_DIGITS (row[c], 12));
      fprintf (f, " %d\n", !isnan (row[n]) && pw_search_feasible (problem, row + n));
    }
  return PW_OK;
}

static void report_variables (const void *context, FILE *f) {
  const pw_optimise *problem = context;
  int panels = problem->unknowns.count < REPORT_PANELS ? problem->unknowns.count : REPORT_PANELS;
  fprintf (f, "panels = %d\nunknowns = %d\narray label[%d]\narray best[%d]\n", panels, problem->unknowns.count, panels,
           panels);
  for (int i = 0; i < panels; i++) {
    pw_figure_label (f, "label", i + 1, problem->unknowns.list[i].name, problem->unknowns.list[i].unit);
    fprintf (f, "best[%d] = %.12g\n", i + 1, problem->best->to[i]);
  }
  pw_figure_label (f, "objective", 0, problem->output[0], problem->unit[0]);
  fprintf (f, "value = %.12g\n", problem->best->output[0]);
}

int pw_optimise_draw (const pw_optimise *problem, pw_error *error) {
  return pw_figure_write (&problem->line, &problem->model, problem->plots_path, "optimise", problem, report_data,
                          report_variables, error);
}
