/* Rows as lines of a table to read, and of a CSV. */
#include <math.h>
#include <string.h>
#include "compare.h"
#include "sweep.h"

static const char *const table_column[MOTION_ERRORS] = { "end.length",    "end.angle",      "end.speed",
                                                         "end.rate",      "largest.length", "largest.angle",
                                                         "largest.speed", "largest.rate",   "multiplier" };
static const char *const table_unit[MOTION_ERRORS] = { "m", "rad", "m/s", "rad/s", "m", "rad", "m/s", "rad/s", NULL };

/* ---- To read ---- */

/* "1.2e-11", "<1.2e-11", "-" where nothing is known. */
static const char *table_number (double value, int below, char text[32]) {
  if (isnan (value)) return "-";
  snprintf (text, 32, "%s%.1e", below ? "<" : "", value);
  return text;
}

static int table_width (const pw_compare *x) {
  size_t width = 6;
  for (int i = 0; i < x->list.count; i++) {
    size_t n = strlen (x->list.method[i].name);
    if (n > width) width = n;
  }
  return (int)width;
}

void pw_compare_truth_line (const pw_compare *x, FILE *f) {
  const pw_truth *t = &x->truth;
  char a[32], b[32];
  if (!t->known) {
    fprintf (f, "no two methods reach the end together, so errors are not known; --truth FILE.csv would tell them\n");
    return;
  }
  pw_cli_print (f, "errors are taken against %s%s\n", t->about, x->truth_path ? ", as if it were exact" : "");
  for (int i = 0; i < t->partners; i++)
    fprintf (f, "  %s agrees with it to %s m, %s rad%s\n", t->partner[i].about,
             table_number (t->partner[i].error[MOTION_MOST + MOTION_LENGTH], 0, a),
             table_number (t->partner[i].error[MOTION_MOST + MOTION_ANGLE], 0, b),
             i == 0 ? ": below that it cannot tell" : "");
}

void pw_compare_head (const pw_compare *x, FILE *f) {
  int w = table_width (x);
  fprintf (f, "%-*s %9s  %-18s  %-18s %5s  %-17s  %-17s  %-35s  %s\n", w, "", "rtol", "error at the end",
           "largest error", "", "residual of", "error of", "", "CPU time");
  fprintf (f, "%-*s %9s  %8s  %8s  %8s  %8s %5s  %8s %8s  %8s %8s  %8s %9s %7s %8s  %8s %6s\n", w, "method", "or step",
           "m", "rad", "m", "rad", "order", "position", "velocity", "multipl.", "energy J", "steps", "evaluat.",
           "Jacob.", "factor.", "median s", "spread");
}

static void table_failure (const pw_rung *r, FILE *f) {
  char t[32];
  static const char *const what[] = { "", "failed", "refused", "stopped", "not run" };
  fprintf (f, "  %s", what[r->state]);
  if (r->state == COMPARE_FAILED && strncmp (r->reason, "t = ", 4) != 0)
    fprintf (f, " at t = %s s", pw_format (t, r->t, 4));
  fprintf (f, ": %s\n", r->reason);
}

void pw_compare_line (const pw_compare *x, const pw_rung *r, FILE *f) {
  static const int shown[] = { MOTION_END, MOTION_END + 1, MOTION_MOST, MOTION_MOST + 1 };
  char text[32], spread[32] = "-";
  fprintf (f, "%-*s %9s", table_width (x), r->method->name, pw_format (text, r->rung, 4));
  if (r->state != COMPARE_DONE) {
    table_failure (r, f);
    return;
  }
  for (int i = 0; i < 4; i++)
    fprintf (f, "  %8s", table_number (r->error[shown[i]], (int)(r->below >> shown[i] & 1), text));
  if (isnan (r->order))
    fprintf (f, " %5s", "-");
  else
    fprintf (f, " %5.1f", r->order);
  fprintf (f, "  %8s", table_number (r->statistics.position, 0, text));
  fprintf (f, " %8s", table_number (r->statistics.velocity, 0, text));
  fprintf (f, "  %8s", table_number (r->error[MOTION_LAMBDA], (int)(r->below >> MOTION_LAMBDA & 1), text));
  fprintf (f, " %8s", table_number (r->balance, 0, text));
  if (!isnan (r->spread)) snprintf (spread, sizeof spread, "%.0f %%", 100 * r->spread / r->cpu);
  fprintf (f, "  %8ld %9ld %7ld %8ld  %8.2e %6s\n", r->statistics.steps, r->statistics.rhs, r->statistics.jacobians,
           r->statistics.factorisations, r->cpu, spread);
}

/* ---- To compute with ---- */

static void table_names (pw_text *t) {
  for (int i = 0; i < MOTION_ERRORS; i++) pw_text_name (t, table_column[i], table_unit[i]);
}

int pw_compare_csv_head (const pw_compare *x, pw_error *error) {
  pw_text t = { .at = NULL };
  for (const char *const *c = (const char *const[]){ "method", "ladder", "rung", "status", NULL }; *c; c++)
    pw_text_cell (&t, *c);
  pw_text_name (&t, "t", "s");
  table_names (&t);
  pw_text_cell (&t, "below,order,residual.position,residual.velocity");
  pw_text_name (&t, "balance", "J");
  pw_text_cell (&t, "steps,rejected,rhs,jacobians,factorisations");
  pw_text_name (&t, "cpu", "s");
  pw_text_name (&t, "spread", "s");
  pw_text_cell (&t, "repeats,reason");
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

/* The errors that are no more than the truth's uncertainty, by name. */
static void table_below (pw_text *t, const pw_rung *r) {
  pw_text_cell (t, "");
  for (int i = 0, n = 0; i < MOTION_ERRORS; i++) {
    if (!(r->below >> i & 1)) continue;
    if (n++) pw_text_add (t, " ");
    pw_text_add (t, table_column[i]);
  }
}

int pw_compare_csv_line (const pw_compare *x, const pw_rung *r, pw_error *error) {
  static const char *const status[] = { "ok", "failed", "refused", "stopped", "not run" };
  const pw_statistics *s = &r->statistics;
  int run = r->state != COMPARE_SLOW;
  pw_text t = { .at = NULL };
  pw_text_cell (&t, r->method->name);
  pw_text_cell (&t, r->method->adaptive ? "rtol" : "step");
  pw_text_number (&t, r->rung);
  pw_text_cell (&t, status[r->state]);
  pw_text_number (&t, run ? r->t : NAN);
  for (int i = 0; i < MOTION_ERRORS; i++) pw_text_number (&t, r->error[i]);
  table_below (&t, r);
  const double rest[] = { r->order,
                          s->position,
                          s->velocity,
                          r->balance,
                          (double)s->steps,
                          (double)s->rejected,
                          (double)s->rhs,
                          (double)s->jacobians,
                          (double)s->factorisations,
                          r->cpu,
                          r->spread };
  for (size_t i = 0; i < sizeof rest / sizeof *rest; i++) pw_text_number (&t, run ? rest[i] : NAN);
  pw_text_number (&t, r->repeats);
  pw_text_quoted (&t, r->reason);
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

int pw_compare_csv_truth (const pw_compare *x, pw_error *error) {
  char path[4200];
  snprintf (path, sizeof path, "%s/truth.csv", x->folder);
  pw_output *o = pw_output_open (path, error);
  if (o == NULL) return error->status;
  FILE *f = pw_output_stream (o);
  pw_text t = { .at = NULL };
  pw_text_cell (&t, "truth,against");
  table_names (&t);
  int status = pw_text_line (&t, f, x->folder, error);
  for (int i = -1; status == PW_OK && x->truth.known && i < x->truth.partners; i++) {
    pw_text_quoted (&t, x->truth.about);
    pw_text_quoted (&t, i < 0 ? "uncertainty" : x->truth.partner[i].about);
    for (int k = 0; k < MOTION_ERRORS; k++)
      pw_text_number (&t, i < 0 ? x->truth.uncertainty[k] : x->truth.partner[i].error[k]);
    status = pw_text_line (&t, f, x->folder, error);
  }
  return pw_text_end (o, status, error);
}
