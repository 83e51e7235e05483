/* Rows as lines of a table to read, and of a CSV. */
#include <math.h>
#include <string.h>
#include "drift.h"

static const char *const table_quantity[DRIFT_QUANTITIES] = { "position", "velocity", "balance" };
static const char *const table_group[DRIFT_GROUPS] = { "methods", "baumgarte", "projection" };

/* ---- To read ---- */

static int table_width (const pw_drift *x) {
  size_t width = 6;
  for (int i = 0; i < x->rows; i++) {
    size_t n = strlen (x->row[i].method);
    if (n > width) width = n;
  }
  return (int)width;
}

void pw_drift_head (const pw_drift *x, pw_drift_group group, FILE *f) {
  static const char *const about[DRIFT_GROUPS] = { "stabilisations side by side", "Baumgarte's alpha and beta",
                                                   "the projection's metric and frequency" };
  int w = table_width (x);
  fprintf (f, "%s%-*s  %-23s  %-23s  %-23s\n", group ? "\n" : "", w, about[group], "residual of position",
           "residual of velocity", "energy balance [J]");
  fprintf (f, "%-*s", w, "");
  for (int i = 0; i < DRIFT_QUANTITIES; i++) fprintf (f, "  %7s %8s %6s", "largest", "last", "grows");
  fprintf (f, "  %8s %9s %8s\n", "steps", "evaluat.", "factor.");
}

/* "t^2.0" */
static const char *table_growth (double power, char text[16]) {
  if (isnan (power)) return "-";
  snprintf (text, 16, "t^%.1f", power < 0.05 ? 0 : power);
  return text;
}

void pw_drift_line (const pw_drift *x, const pw_drift_row *r, FILE *f) {
  char text[16];
  fprintf (f, "%-*s", table_width (x), r->method);
  if (r->status != PW_OK) {
    fprintf (f, "  %s: %s\n", r->status == PW_INPUT ? "refused" : "failed", r->reason);
    return;
  }
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    fprintf (f, "  %7.1e %8.1e %6s", r->most[i], r->end[i], table_growth (pw_drift_growth (r, i), text));
  fprintf (f, "  %8ld %9ld %8ld\n", r->statistics.steps, r->statistics.rhs, r->statistics.factorisations);
}

/* ---- To compute with ---- */

/* Writes a line and empties it. */
int pw_drift_csv_head (const pw_drift *x, pw_error *error) {
  pw_text t = { .at = NULL };
  pw_text_cell (&t, "group,method,alpha [1/s],beta [1/s],every [steps],status,t [s]");
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    static const char *const what[] = { "largest.", "last.", "growth." };
    for (int k = 0; k < 3; k++) {
      char name[40];
      snprintf (name, sizeof name, "%s%s", what[k], table_quantity[i]);
      pw_text_name (&t, name, i == DRIFT_BALANCE && k < 2 ? "J" : NULL);
    }
  }
  pw_text_cell (&t, "steps,rejected,rhs,jacobians,factorisations,reason");
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

int pw_drift_csv_line (const pw_drift *x, const pw_drift_row *r, pw_error *error) {
  const pw_statistics *s = &r->statistics;
  const long count[] = { s->steps, s->rejected, s->rhs, s->jacobians, s->factorisations };
  pw_text t = { .at = NULL };
  pw_text_cell (&t, table_group[r->group]);
  pw_text_cell (&t, r->method);
  pw_text_number (&t, r->group == DRIFT_BAUMGARTE ? r->along : NAN);
  pw_text_number (&t, r->beta);
  pw_text_number (&t, r->group == DRIFT_PROJECTION ? r->along : NAN);
  pw_text_cell (&t, r->status == PW_OK ? "ok" : r->status == PW_INPUT ? "refused" : "failed");
  pw_text_number (&t, r->t);
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    pw_text_number (&t, r->t > 0 ? r->most[i] : NAN);
    pw_text_number (&t, r->end[i]);
    pw_text_number (&t, pw_drift_growth (r, i));
  }
  for (size_t i = 0; i < sizeof count / sizeof *count; i++) pw_text_number (&t, (double)count[i]);
  pw_text_quoted (&t, r->reason);
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

static int table_times (const pw_drift *x, FILE *f, pw_error *error) {
  int status = PW_OK;
  pw_text t = { .at = NULL };
  pw_text_cell (&t, "method,t [s],position,velocity,balance [J]");
  status = pw_text_line (&t, f, x->folder, error);
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; status == PW_OK && r->part && k < DRIFT_PARTS; k++) {
      if (isnan (r->part[k][DRIFT_VELOCITY])) continue;
      pw_text_cell (&t, r->method);
      pw_text_number (&t, x->t_end * (k + 1) / DRIFT_PARTS);
      for (int i = 0; i < DRIFT_QUANTITIES; i++) pw_text_number (&t, r->part[k][i]);
      status = pw_text_line (&t, f, x->folder, error);
    }
  return status;
}

int pw_drift_csv_time (const pw_drift *x, pw_error *error) {
  char path[4200];
  snprintf (path, sizeof path, "%s/drift-time.csv", x->folder);
  pw_output *o = pw_output_open (path, error);
  if (o == NULL) return error->status;
  return pw_text_end (o, table_times (x, pw_output_stream (o), error), error);
}
