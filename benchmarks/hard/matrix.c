/* Writes the matrix of verdicts: as text for a terminal, as a page, as a table. */
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
      "`make hard` runs %d cases by all %d methods at the same step (fixed-step methods) or relative tolerance\n"
      "(adaptive methods), and writes this page and [hard-cases.csv](hard-cases.csv): one line per case and\n"
      "method with settings, measured values, message, and the reason where a method does not pass. The cases with\n"
      "their reference solutions and bounds are in `benchmarks/hard/cases`.\n\n"
      "| | verdict | meaning | cells |\n|---|---|---|---|\n"
      "| P | pass | every measure is within its first bound; if no motion exists: stopped for that reason | %d of "
      "%d |\n"
      "| l | limited | bounded and stable, but less accurate: within the second bound | %d |\n"
      "| R | refused | stopped with a reason and the time reached | %d |\n"
      "| s | slow | stopped at the limit of processor time | %d |\n",
      m->count, m->methods, count[HARD_PASS], all, count[HARD_LIMITED], count[HARD_REFUSE], count[HARD_SLOW]);
  if (count[HARD_WRONG] + count[HARD_CRASH])
    fprintf (out, "| **W C** | **wrong, crash** | never allowed | %d |\n", count[HARD_WRONG] + count[HARD_CRASH]);
  fputs ("\nThe measures are:\n\n"
         "- *error*: of the states that the reference solution contains, at the end, relative to it or, if larger, to "
         "their\n"
         "  [scale](theory.md#residuals-and-scales),\n"
         "- *balance*: the largest [energy defect](theory.md#energy-ledger), relative to the largest kinetic energy,\n"
         "  work or dissipation,\n"
         "- *residual*: the largest scaled residual of the constraints after an accepted step,\n"
         "- *equations*: the scaled residual of the equations of motion at the end, by the\n"
         "  [verifier](design.md#verification).\n",
         out);
}

static void matrix_page_methods (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS];
  fputs ("\n## Methods\n\n| | method | pass | limited | refused | slow |\n|---|---|---|---|---|---|\n", out);
  for (int k = 0; k < m->methods; k++) {
    matrix_count (m, k, count);
    fprintf (out, "| %d | `%s` | %d | %d | %d | %d |\n", k + 1, m->method[k], count[HARD_PASS], count[HARD_LIMITED],
             count[HARD_REFUSE], count[HARD_SLOW]);
  }
}

static void matrix_page_group (const hard_matrix *m, const hard_case *c, FILE *out) {
  fprintf (out, "\n### %s\n\n%s\n\n| case |", c->group, c->group_about);
  for (int k = 0; k < m->methods; k++) fprintf (out, " %d |", k + 1);
  fputs ("\n|---|", out);
  for (int k = 0; k < m->methods; k++) fputs ("---|", out);
  fputc ('\n', out);
}

void hard_page (const hard_matrix *m, FILE *out) {
  matrix_page_head (m, out);
  matrix_page_methods (m, out);
  fputs ("\n## The matrix\n\nColumns are the methods by number.\n", out);
  for (int i = 0; i < m->count; i++) {
    if (i == 0 || strcmp (m->cases[i - 1].group, m->cases[i].group) != 0) matrix_page_group (m, &m->cases[i], out);
    fprintf (out, "| %s |", m->cases[i].name);
    for (int k = 0; k < m->methods; k++) fprintf (out, " %c |", matrix_letter[m->result[i * m->methods + k].verdict]);
    fputc ('\n', out);
  }
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
