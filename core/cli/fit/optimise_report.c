/* The reports of `pinwheel optimise`. */
#include "optimise.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "print_table.h"
#include "states.h"

#define OPTIMISE_SAME 0.01 /* distance of results of the same optimum, relative to the scales of the unknowns */

int pw_optimise_same (const pw_optimise *x, const pw_search_start *a, const pw_search_start *b) {
  int same = a->found && b->found;
  for (int j = 0; same && j < x->unknowns.count; j++)
    same = fabs (a->best[j] - b->best[j]) <= OPTIMISE_SAME * x->unknowns.list[j].scale;
  return same;
}

enum { REPORT_DIGITS = 9, REPORT_PANELS = 6, REPORT_OPTIONS = 4000 };

/* The output of the first run, with the initial values; NaN if it failed. */
static double report_initial (const pw_optimise *x) {
  return x->start[0].runs > 0 ? x->start[0].trial[x->unknowns.count] : NAN;
}

/* 1 if the objective is the same in all runs that did not fail. */
static int report_constant (const pw_optimise *x) {
  double least = INFINITY, most = -INFINITY;
  int columns = x->unknowns.count + x->outputs;
  for (int i = 0; i < x->starts + x->polished; i++)
    for (long k = 0; k < x->start[i].runs; k++) {
      double value = x->start[i].trial[k * columns + x->unknowns.count];
      least = fmin (least, value), most = fmax (most, value);
    }
  return most - least <= 1e-14 * fabs (most);
}

/* 1 if outputs are the same in all runs that differ from the first one of their search in unknown i alone. */
static int report_inert (const pw_optimise *x, int i) {
  int n = x->unknowns.count, columns = n + x->outputs, pairs = 0;
  for (const pw_search_start *s = x->start; s < x->start + x->starts + x->polished; s++)
    for (long k = 1; k < s->runs; k++) {
      const double *a = s->trial, *b = a + k * columns;
      int others = a[i] == b[i];
      for (int j = 0; j < n; j++) others |= j != i && a[j] != b[j];
      for (int j = n; j < columns && !others; j++)
        if (!(fabs (a[j] - b[j]) <= 1e-14 * fabs (a[j]))) return 0;
      pairs += !others;
    }
  return pairs > 0;
}

/* Whether the best value of unknown i, if that has an effect, is at its lower (-1) or upper bound. */
static int report_side (const pw_optimise *x, int i) {
  const pw_unknown *u = x->unknowns.list + i;
  if (report_inert (x, i)) return 0;
  double near = 10 * PW_SEARCH_FINE * u->scale, value = x->start[x->best].best[i];
  return value - u->low <= near ? -1 : u->high - value <= near;
}

static void report_unknowns (const pw_optimise *x) {
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    static const char *const head[] = { "free", "initially", "best", "from", "to", NULL };
    for (int i = 0; head[i]; i++) pw_cell (&t, i ? 12 : -12, head[i]);
    pw_row_end (&t);
    for (int i = 0; i < x->unknowns.count; i++) {
      const pw_unknown *u = x->unknowns.list + i;
      pw_cell_unit (&t, -12, u->name, u->unit);
      pw_cell_number (&t, 12, u->value, REPORT_DIGITS);
      pw_cell_number (&t, 12, x->start[x->best].best[i], REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->low) ? u->low : NAN, REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->high) ? u->high : NAN, REPORT_DIGITS);
      pw_cell (&t, -1,
               report_inert (x, i)
                   ? "without effect"
                   : (const char *[]){ "at its lower bound", "", "at its upper bound" }[1 + report_side (x, i)]);
      pw_row_end (&t);
    }
  }
}

static void report_outputs (const pw_optimise *x) {
  const pw_search_start *s = x->start + x->best;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < x->outputs; i++) {
      char text[120], number[32];
      snprintf (text, sizeof text,
                i == 0           ? (x->maximise ? "largest" : "smallest")
                : x->sign[i] > 0 ? "at most %s"
                                 : "at least %s",
                pw_format (number, x->bound[i], REPORT_DIGITS));
      pw_cell_unit (&t, -12, x->text[i], x->unit[i]);
      pw_cell_number (&t, 12, s->value[i], REPORT_DIGITS);
      pw_cell (&t, -1, text);
      if (i == 0) snprintf (text, sizeof text, "(initially %s)", pw_format (number, report_initial (x), REPORT_DIGITS));
      if (i == 0) pw_cell (&t, -1, text);
      pw_row_end (&t);
    }
}

void pw_optimise_print (const pw_optimise *x) {
  char options[REPORT_OPTIONS];
  int same = 0;
  for (int i = 0; i < x->starts; i++) same += pw_optimise_same (x, x->start + i, x->start + x->best);
  report_unknowns (x);
  report_outputs (x);
  printf ("\n%ld runs from %d starts, %d of which end at this optimum\n", x->runs, x->starts, same);
  if (x->derivatives)
    printf ("with derivatives at %ld points of the searches that continue (SLSQP), without in the others\n",
            x->derivatives);
  if (x->why)
    pw_cli_print (stdout, "%ld runs failed and count as infeasible, the first of them: %s\n", x->failed, x->why->text);
  if (report_constant (x))
    pw_cli_say ("pinwheel: %s is the same in all runs: no free value has an effect on it\n", x->text[0]);
  if (pw_unknowns_options (&x->unknowns, x->start[x->best].best, options, sizeof options)) printf ("\n%s\n", options);
}

/* ---- JSON ---- */

static void report_json_unknown (const pw_optimise *x, pw_json *j, int i) {
  const pw_unknown *u = x->unknowns.list + i;
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "name", u->name);
  pw_json_text (j, "unit", u->unit);
  pw_json_number (j, "initial", u->value);
  pw_json_number (j, "value", x->start[x->best].best[i]);
  pw_json_number (j, "low", u->low);
  pw_json_number (j, "high", u->high);
  pw_json_text (j, "bound", (const char *[]){ "low", NULL, "high" }[1 + report_side (x, i)]);
  pw_json_close (j, '}');
}

static void report_json_start (const pw_optimise *x, pw_json *j, const pw_search_start *s) {
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "value", s->found ? s->value[0] : NAN);
  pw_json_number (j, "runs", (double)s->runs);
  pw_json_number (j, "failed", (double)s->failed);
  pw_numbers_json (j, "from", s->first, x->unknowns.count);
  pw_numbers_json (j, "to", s->best, s->found ? x->unknowns.count : 0);
  pw_json_close (j, '}');
}

static void report_json_constraint (const pw_optimise *x, pw_json *j, int i) {
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "output", x->text[i]);
  pw_json_text (j, "type", x->sign[i] > 0 ? "<=" : ">=");
  pw_json_number (j, "bound", x->bound[i]);
  pw_json_number (j, "value", x->start[x->best].value[i]);
  pw_json_close (j, '}');
}

void pw_optimise_json (const pw_optimise *x, const char *status, FILE *f) {
  pw_json json = { .f = f, .lines = 2 }, *j = &json;
  char options[REPORT_OPTIONS];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "status", status);
  pw_json_text (j, x->maximise ? "maximise" : "minimise", x->objective);
  pw_json_number (j, "value", x->start[x->best].value[0]);
  pw_json_number (j, "initial", report_initial (x));
  pw_json_text (j, "options",
                pw_unknowns_options (&x->unknowns, x->start[x->best].best, options, sizeof options) ? options : NULL);
  pw_json_text (j, "method", x->unknowns.method);
  pw_json_number (j, "t_end", x->unknowns.t_end);
  pw_json_number (j, "seed", x->seed);
  pw_json_number (j, "runs", (double)x->runs);
  pw_json_number (j, "failed", (double)x->failed);
  pw_json_number (j, "derivatives", (double)x->derivatives);
  pw_json_text (j, "reason", x->why ? x->why->text : "");
  pw_json_open (j, "unknowns", '[');
  for (int i = 0; i < x->unknowns.count; i++) report_json_unknown (x, j, i);
  pw_json_close (j, ']');
  pw_json_open (j, "constraints", '[');
  for (int i = 1; i < x->outputs; i++) report_json_constraint (x, j, i);
  pw_json_close (j, ']');
  pw_json_open (j, "starts", '[');
  for (int i = 0; i < x->starts + x->polished; i++) report_json_start (x, j, x->start + i);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- YAML ---- */

/* A text between single quotes. */
static void report_quoted (FILE *f, const char *key, const char *text) {
  fprintf (f, "%s: '", key);
  for (; *text; text++) fprintf (f, *text == '\'' ? "''" : "%c", *text);
  fputs ("'\n", f);
}

/* An option of the command line with its value in quotes, on one line; nothing if it is not given. */
static void report_given (FILE *f, const char *option, const char *value) {
  if (value == NULL) return;
  fprintf (f, " %s '", option);
  for (; *value; value++) fputc ((unsigned char)*value < ' ' ? ' ' : *value, f);
  fputc ('\'', f);
}

/* The run of the result, as a comment: with the options given, then with the values found. */
static void report_run (const pw_optimise *x, const char *options, FILE *f) {
  const pw_cli_line *l = &x->line;
  fprintf (f, "# pinwheel run %s", l->argument[0]);
  for (const char **set = l->sets; set && *set; set++) report_given (f, "--set", *set);
  for (const char **start = l->starts; start && *start; start++) report_given (f, "--start", *start);
  report_given (f, "--method", l->method);
  report_given (f, "--t-end", l->t_end);
  report_given (f, "--step", l->step);
  report_given (f, "--rtol", l->rtol);
  report_given (f, "--atol", l->atol);
  fprintf (f, " %s\n", options);
}

void pw_optimise_yaml (const pw_optimise *x, FILE *f) {
  char options[REPORT_OPTIONS];
  const pw_search_start *s = x->start + x->best;
  if (pw_unknowns_options (&x->unknowns, s->best, options, sizeof options) &&
      strpbrk (x->line.argument[0], "\r\n") == NULL)
    report_run (x, options, f);
  report_quoted (f, "model", pw_file_name (x->m.file));
  report_quoted (f, x->maximise ? "maximise" : "minimise", x->objective);
  fprintf (f, "value: %.17g\n", s->value[0]);
  for (int initial = 0; initial < 2; initial++)
    for (int i = 0, first = 1; i < x->unknowns.count; i++) {
      if ((x->unknowns.list[i].parameter == NULL) != initial) continue;
      if (first) fputs (initial ? "start:\n" : "set:\n", f);
      first = 0;
      fprintf (f, "  %s: %.17g\n", x->unknowns.list[i].name, s->best[i]);
    }
}

/* ---- Figures ---- */

/* A row per run: number of the start, unknowns, output, whether it satisfies the constraints. */
static int report_data (const void *context, FILE *f, pw_error *error) {
  const pw_optimise *x = context;
  int n = x->unknowns.count, width = n + x->outputs;
  char number[32];
  (void)error;
  fputs ("# start", f);
  for (int i = 0; i < n; i++) fprintf (f, ", %s [%s]", x->unknowns.list[i].name, x->unknowns.list[i].unit);
  fprintf (f, ", %s, 1 if the constraints are satisfied\n", x->objective);
  for (int i = 0; i < x->starts + x->polished; i++)
    for (long k = 0; k < x->start[i].runs; k++) {
      fprintf (f, "%d", i + 1);
      const double *row = x->start[i].trial + k * width;
      for (int c = 0; c <= n; c++) fprintf (f, " %s", pw_format (number, row[c], 12));
      fprintf (f, " %d\n", pw_search_feasible (x, row + n));
    }
  return PW_OK;
}

static void report_variables (const void *context, FILE *f) {
  const pw_optimise *x = context;
  int panels = x->unknowns.count < REPORT_PANELS ? x->unknowns.count : REPORT_PANELS;
  fprintf (f, "constraints = %d\npanels = %d\nunknowns = %d\narray label[%d]\narray best[%d]\n", x->outputs - 1, panels,
           x->unknowns.count, panels, panels);
  for (int i = 0; i < panels; i++) {
    pw_figure_label (f, "label", i + 1, x->unknowns.list[i].name, x->unknowns.list[i].unit);
    fprintf (f, "best[%d] = %.12g\n", i + 1, x->start[x->best].best[i]);
  }
  pw_figure_label (f, "objective", 0, x->objective, x->unit[0]);
  fprintf (f, "value = %.12g\n", x->start[x->best].value[0]);
}

int pw_optimise_draw (const pw_optimise *x, pw_error *error) {
  return pw_figure_write (&x->line, &x->m, x->plots_path, "optimise", x, report_data, report_variables, error);
}
