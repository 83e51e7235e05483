/* Writes the matrix of verdicts: as text for a terminal, in short as a page, in full as a table. */
#include <math.h>
#include <string.h>
#include "hard.h"

static const char matrix_letter[HARD_VERDICTS] = { 'C', 'W', 's', 'R', 'l', 'P' };

/* Cells per verdict of one method, or of all for method -1. */
static void matrix_count (const hard_matrix *m, int method, int count[HARD_VERDICTS]) {
  memset (count, 0, HARD_VERDICTS * sizeof *count);
  for (int i = 0; i < m->count; i++)
    for (int k = 0; k < m->methods; k++)
      if (method < 0 || method == k) count[m->result[i * m->methods + k].verdict]++;
}

/* ---- For a terminal ---- */

void hard_print (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS];
  fprintf (out, "\n%-22s", "");
  for (int k = 0; k < m->methods; k++) fprintf (out, " %2d", k + 1);
  for (int i = 0; i < m->count; i++) {
    fprintf (out, "\n%-22s", m->cases[i].name);
    for (int k = 0; k < m->methods; k++) fprintf (out, "  %c", matrix_letter[m->result[i * m->methods + k].verdict]);
  }
  fprintf (out, "\n\nP pass, l limited, R refused, s slow, W wrong, C crash\n\n%22s", "");
  for (int v = HARD_VERDICTS - 1; v >= 0; v--) fprintf (out, " %8s", hard_verdict_name[v]);
  for (int k = -1; k < m->methods; k++) {
    matrix_count (m, k, count);
    if (k < 0)
      fprintf (out, "\n%22s", "all");
    else
      fprintf (out, "\n%2d %19s", k + 1, m->method[k]);
    for (int v = HARD_VERDICTS - 1; v >= 0; v--) fprintf (out, " %8d", count[v]);
  }
  fputc ('\n', out);
}

/* ---- As a page ---- */

static void matrix_page_head (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS], all = m->count * m->methods;
  matrix_count (m, -1, count);
  fprintf (
      out,
      "# Hard cases\n\n"
      "`make hard` runs %d cases by all %d methods, at the same step (fixed-step methods) or relative tolerance\n"
      "(adaptive methods), and writes this page and [hard-cases.csv](hard-cases.csv): one line per case and method,\n"
      "with settings, verdict, measured values, message, and the reason where it is not a pass. Reference solutions\n"
      "and bounds are in `benchmarks/hard/cases`.\n\n"
      "|verdict|meaning|cells|\n|---|---|---|\n"
      "|pass|every measure is within its first bound; if no motion exists: stopped for that reason|%d of %d|\n"
      "|limited|stable, but less accurate: within the second bound|%d|\n"
      "|refuse|stopped with a reason and the time reached|%d|\n"
      "|slow|stopped at the limit of processor time|%d|\n",
      m->count, m->methods, count[HARD_PASS], all, count[HARD_LIMITED], count[HARD_REFUSE], count[HARD_SLOW]);
  if (count[HARD_WRONG] + count[HARD_CRASH])
    fprintf (out, "|**WRONG, CRASH**|never allowed|%d|\n", count[HARD_WRONG] + count[HARD_CRASH]);
  fputs (
      "\nMeasures: *error* of the states in the reference solution, at the end, relative to it or, if larger, to "
      "their\n"
      "[scale](theory.md#residuals-and-scales); *balance*, the largest [energy defect](theory.md#energy-ledger) "
      "relative\n"
      "to the largest kinetic energy, work or dissipation; *residual*, the largest of the constraints after a step,\n"
      "scaled; *equations*, that of the equations of motion at the end, by the [verifier](design.md#verification).\n",
      out);
}

static void matrix_page_cases (const hard_matrix *m, FILE *out) {
  fputs ("\n## Cases\n\n|group|cases|\n|---|---|\n", out);
  for (int i = 0; i < m->count; i++) {
    int first = i == 0 || strcmp (m->cases[i - 1].group, m->cases[i].group) != 0;
    int last = i + 1 == m->count || strcmp (m->cases[i].group, m->cases[i + 1].group) != 0;
    if (first) fprintf (out, "|**%s.** %s|", m->cases[i].group, m->cases[i].group_about);
    fprintf (out, "%s%s", m->cases[i].name, last ? "|\n" : " ");
  }
}

static void matrix_page_methods (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS];
  fputs ("\n## Methods\n\n||method|pass|limited|refuse|slow|\n|---|---|---|---|---|---|\n", out);
  for (int k = 0; k < m->methods; k++) {
    matrix_count (m, k, count);
    fprintf (out, "|%d|`%s`|%d|%d|%d|%d|\n", k + 1, m->method[k], count[HARD_PASS], count[HARD_LIMITED],
             count[HARD_REFUSE], count[HARD_SLOW]);
  }
}

/* The reason for which a cell has no result, without the remark that it depends on round-off.  Returns its length, 0 if
 * there is a result. */
static size_t matrix_reason (const hard_matrix *m, int cell, const char **reason) {
  hard_verdict verdict = m->result[cell].verdict;
  if (verdict >= HARD_LIMITED) return 0;
  *reason = hard_expected (&m->cases[cell / m->methods], m->method[cell % m->methods])->why;
  if (verdict <= HARD_WRONG) *reason = "**WRONG, CRASH**";
  if (**reason == 0) *reason = "**not expected**";
  const char *end = strstr (*reason, "; depends on round-off");
  return end ? (size_t)(end - *reason) : strlen (*reason);
}

static int matrix_same_reason (const hard_matrix *m, int a, int b) {
  const char *reason[2];
  size_t length = matrix_reason (m, a, &reason[0]);
  return length > 0 && length == matrix_reason (m, b, &reason[1]) && memcmp (reason[0], reason[1], length) == 0;
}

/* The methods that have no result in a case for the reason of a cell: " 1-4 28". */
static void matrix_page_numbers (const hard_matrix *m, int i, int cell, FILE *out) {
  for (int k = 0, n; k < m->methods; k += n + 1) {
    for (n = 0; k + n < m->methods && matrix_same_reason (m, cell, i * m->methods + k + n); n++)
      ;
    if (n > 0) fprintf (out, " %d", k + 1);
    if (n > 1) fprintf (out, "-%d", k + n);
  }
}

/* A line for each reason, with its cases and methods. */
static void matrix_page_reasons (const hard_matrix *m, FILE *out) {
  fputs ("\n## Refused or slow\n\nMethods are given by number. In some cells round-off decides, and with it compiler "
         "and machine."
         "\n\n|reason|cases: methods|\n|---|---|\n",
         out);
  for (int cell = 0; cell < m->count * m->methods; cell++) {
    const char *reason, *separator = "";
    int length = (int)matrix_reason (m, cell, &reason), before = 0;
    while (before < cell && !matrix_same_reason (m, before, cell)) before++;
    if (length == 0 || before < cell) continue;
    fprintf (out, "|%.*s|", length, reason);
    for (int i = 0; i < m->count; i++) {
      int k = 0;
      while (k < m->methods && !matrix_same_reason (m, cell, i * m->methods + k)) k++;
      if (k == m->methods) continue;
      fprintf (out, "%s%s:", separator, m->cases[i].name);
      matrix_page_numbers (m, i, cell, out);
      separator = "; ";
    }
    fputs ("|\n", out);
  }
}

void hard_page (const hard_matrix *m, FILE *out) {
  matrix_page_head (m, out);
  matrix_page_cases (m, out);
  matrix_page_methods (m, out);
  matrix_page_reasons (m, out);
}

/* ---- As a table ---- */

/* A field in double quotes. */
static void matrix_quote (const char *text, FILE *out) {
  fputs (",\"", out);
  for (; *text; text++) {
    if (*text == '"') fputc ('"', out);
    fputc (*text, out);
  }
  fputc ('"', out);
}

/* The parameters and initial values that a case sets: "omega = 100, M0 = 1000". */
static void matrix_settings (const hard_case *c, FILE *out) {
  const char *separator = "";
  fputs (",\"", out);
  for (int k = 0; k < c->sets; k++, separator = ", ")
    fprintf (out, "%s%s = %g", separator, c->set[k].name, c->set[k].value);
  for (int k = 0; k < c->initials; k++, separator = ", ")
    fprintf (out, "%s%s = %g", separator, c->initial[k].name, c->initial[k].value);
  fputc ('"', out);
}

static void matrix_table_cell (const hard_matrix *m, int i, int k, FILE *out) {
  const hard_case *c = &m->cases[i];
  const hard_result *r = &m->result[i * m->methods + k];
  const char *model = strrchr (c->model, '/') ? strrchr (c->model, '/') + 1 : c->model;
  fprintf (out, "%s,%s,%s,%g,%g,%g,%s", c->name, m->method[k], model, c->t_end, c->step, c->rtol,
           hard_verdict_name[r->verdict]);
  for (int j = 0; j < HARD_MEASURES; j++)
    if (c->bound[j][1] > 0 && isfinite (r->measure[j]) && r->status == PW_OK)
      fprintf (out, ",%.1e", r->measure[j]);
    else
      fputc (',', out);
  matrix_quote (r->status != PW_OK ? r->reason : "", out);
  matrix_quote (r->verdict == HARD_PASS ? "" : hard_expected (c, m->method[k])->why, out);
  matrix_settings (c, out);
  matrix_quote (c->about, out);
  matrix_quote (c->source, out);
  fputc ('\n', out);
}

void hard_table (const hard_matrix *m, FILE *out) {
  fputs ("case,method,model,t_end,step,rtol,verdict", out);
  for (int j = 0; j < HARD_MEASURES; j++) fprintf (out, ",%s", hard_measure_name[j]);
  fputs (",message,why,settings,about,reference\n", out);
  for (int i = 0; i < m->count; i++)
    for (int k = 0; k < m->methods; k++) matrix_table_cell (m, i, k, out);
}
