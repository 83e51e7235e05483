/* The matrix of verdicts, for a terminal and as a page. */
#include <math.h>
#include <string.h>
#include "hard.h"

static const char matrix_letter[HARD_VERDICTS] = { 'C', 'W', 's', 'R', 'l', 'P' };

static const hard_result *matrix_at (const hard_matrix *m, int i, int k) {
  const hard_result *r = &m->result[i * m->methods + k];
  return (int)r->verdict < 0 ? NULL : r;
}

/* How often each verdict occurs with a method; with all of them for method -1. */
static void matrix_count (const hard_matrix *m, int method, int count[HARD_VERDICTS]) {
  memset (count, 0, HARD_VERDICTS * sizeof *count);
  for (int i = 0; i < m->count; i++)
    for (int k = 0; k < m->methods; k++) {
      const hard_result *r = matrix_at (m, i, k);
      if (r && (method < 0 || method == k)) count[r->verdict]++;
    }
}

/* ---- For a terminal ---- */

void hard_print (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS];
  fprintf (out, "\n%-22s", "");
  for (int k = 0; k < m->methods; k++) fprintf (out, " %2d", k + 1);
  for (int i = 0; i < m->count; i++) {
    fprintf (out, "\n%-22s", m->cases[i].name);
    for (int k = 0; k < m->methods; k++) {
      const hard_result *r = matrix_at (m, i, k);
      fprintf (out, "  %c", r ? matrix_letter[r->verdict] : '-');
    }
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
      "Made by `make hard` from the cases in `benchmarks/hard/cases`: %d cases, each by all %d methods at the same\n"
      "step (methods of fixed step) or relative tolerance (all others).\n\n"
      "| | verdict | means | cells |\n|---|---|---|---|\n"
      "| P | pass | all that is measured lies within the case's first bounds; where the truth is that no motion "
      "exists: stopped for that reason | %d of %d |\n"
      "| l | limited | bounded and stable, less accurate: within the second bounds; measured values below | %d |\n"
      "| R | refused | stopped, with its reason and the time reached | %d |\n"
      "| s | slow | stopped by the limit of processor time | %d |\n",
      m->count, m->methods, count[HARD_PASS], all, count[HARD_LIMITED], count[HARD_REFUSE], count[HARD_SLOW]);
  if (count[HARD_WRONG] + count[HARD_CRASH])
    fprintf (out, "| **W C** | **wrong, crash** | never allowed | %d |\n", count[HARD_WRONG] + count[HARD_CRASH]);
  fprintf (
      out,
      "\nMeasured are: *error*, of the states at the end against a truth, relative to its size or to the scene's "
      "unit;\n"
      "*balance*, of the energy, the worst of the run relative to the largest energy, work or loss in it; *residual*,\n"
      "scaled, of the constraints, the worst of all accepted steps; *equations*, scaled, of accelerations and\n"
      "multipliers at the end, by the independent verifier.\n");
}

/* One line per method: its number, and its counts. */
static void matrix_page_methods (const hard_matrix *m, FILE *out) {
  int count[HARD_VERDICTS];
  fputs ("\n## Methods\n\n| | method | pass | limited | refused | slow |\n|---|---|---|---|---|---|\n", out);
  for (int k = 0; k < m->methods; k++) {
    matrix_count (m, k, count);
    fprintf (out, "| %d | `%s` | %d | %d | %d | %d |\n", k + 1, m->method[k], count[HARD_PASS], count[HARD_LIMITED],
             count[HARD_REFUSE], count[HARD_SLOW]);
  }
}

static void matrix_page_table (const hard_matrix *m, FILE *out) {
  const char *group = "";
  fputs ("\n## The matrix\n\nColumns are the methods by their numbers.\n\n| case |", out);
  for (int k = 0; k < m->methods; k++) fprintf (out, " %d |", k + 1);
  fputs ("\n|---|", out);
  for (int k = 0; k < m->methods; k++) fputs ("---|", out);
  fputc ('\n', out);
  for (int i = 0; i < m->count; i++) {
    const hard_case *c = &m->cases[i];
    if (strcmp (group, c->group) != 0) {
      group = c->group;
      fprintf (out, "| **%s** |", group);
      for (int k = 0; k < m->methods; k++) fputs (" |", out);
      fputc ('\n', out);
    }
    fprintf (out, "| [%s](#%s) |", c->name, c->name);
    for (int k = 0; k < m->methods; k++) {
      const hard_result *r = matrix_at (m, i, k);
      fprintf (out, " %c |", r ? matrix_letter[r->verdict] : '-');
    }
    fputc ('\n', out);
  }
}

/* "error 3e-05, balance 2e-07": what is judged, two digits. */
static void matrix_page_measures (const hard_case *c, const hard_result *r, FILE *out) {
  const char *glue = "";
  for (int k = 0; k < HARD_MEASURES; k++) {
    if (c->bound[k][1] == 0 || r->measure[k] <= c->bound[k][0]) continue;
    fprintf (out, "%s%s %.1e", glue, hard_measure_name[k], r->measure[k]);
    glue = ", ";
  }
}

static void matrix_page_cell (const hard_matrix *m, int i, int k, FILE *out) {
  const hard_result *r = matrix_at (m, i, k);
  if (r == NULL || r->verdict == HARD_PASS) return;
  fprintf (out, "| `%s` | %s | ", m->method[k], hard_verdict_name[r->verdict]);
  if (r->verdict == HARD_LIMITED || r->verdict == HARD_WRONG) matrix_page_measures (&m->cases[i], r, out);
  if (r->status != PW_OK) fputs (r->reason, out);
  fprintf (out, " | %s |\n", hard_expected (&m->cases[i], m->method[k])->why);
}

static void matrix_page_case (const hard_matrix *m, int i, FILE *out) {
  const hard_case *c = &m->cases[i];
  const char *model = strrchr (c->model, '/') ? strrchr (c->model, '/') + 1 : c->model;
  int failing = 0;
  fprintf (out, "\n### %s\n\n%s. Model `%s`", c->name, c->about, model);
  for (int k = 0; k < c->sets; k++) fprintf (out, ", %s = %g", c->set[k].name, c->set[k].value);
  for (int k = 0; k < c->starts; k++) fprintf (out, ", start %s = %g", c->start[k].name, c->start[k].value);
  fprintf (out, "; %g s, step %g s, rtol %g.", c->t_end, c->step, c->rtol);
  if (*c->source) fprintf (out, " Truth: %s.", c->source);
  fputs (" Bounds:", out);
  if (*c->stops)
    fprintf (out, " it must stop and name \"%s\", by %g / %g s", c->stops, c->stop_time[0], c->stop_time[1]);
  for (int k = 0; k < HARD_MEASURES; k++)
    if (c->bound[k][1] > 0) fprintf (out, " %s %g / %g", hard_measure_name[k], c->bound[k][0], c->bound[k][1]);
  fputs (".\n", out);
  for (int k = 0; k < m->methods; k++) failing += matrix_at (m, i, k) && matrix_at (m, i, k)->verdict < HARD_PASS;
  if (failing == 0) return;
  fputs ("\n| method | verdict | measured, or said | reason |\n|---|---|---|---|\n", out);
  for (int k = 0; k < m->methods; k++) matrix_page_cell (m, i, k, out);
}

void hard_page (const hard_matrix *m, FILE *out) {
  matrix_page_head (m, out);
  matrix_page_methods (m, out);
  matrix_page_table (m, out);
  fputs ("\n## The cases\n", out);
  for (int i = 0; i < m->count; i++) matrix_page_case (m, i, out);
}
