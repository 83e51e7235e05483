/* Tables of samples, one line each, readable by Octave, Python and gnuplot, or as a NumPy archive.
 *
 *   t [s] | states of each body, of each internal coordinate | contact points | reactions | residuals | energies */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "files.h"

/* A table that becomes a NumPy archive. */
typedef struct {
  char (*name)[300];
  double *value; /* rows x columns */
  size_t columns, count, room;
} csv_archive;

struct pw_csv {
  pw_output *output;
  FILE *f;
  csv_archive *archive;    /* NULL: lines of text */
  int cells;               /* written in the current line */
  int failed;              /* 1: memory was exhausted */
  pw_workspace *workspace; /* for contact points; NULL if the system has none */
  int ledger;
  double (*contact)[3]; /* contact points of the system */
};

/* ---- Archives ---- */

static void archive_number (pw_csv *c, double value) {
  csv_archive *a = c->archive;
  c->failed |= pw_grow (&a->value, a->count, &a->room, sizeof *a->value) != PW_OK;
  if (!c->failed) a->value[a->count++] = value;
}

static void archive_name (pw_csv *c, const char *name) {
  csv_archive *a = c->archive;
  char (*more)[300] = c->failed ? NULL : realloc (a->name, (a->columns + 1) * sizeof *more);
  c->failed |= more == NULL;
  if (more == NULL) return;
  a->name = more;
  snprintf (a->name[a->columns++], sizeof *a->name, "%s", name);
}

static int archive_write (pw_csv *c, pw_error *error) {
  const csv_archive *a = c->archive;
  pw_npz z = { .f = c->f };
  long rows = a->columns ? (long)(a->count / a->columns) : 0;
  double *column = malloc (((size_t)rows + 1) * sizeof *column);
  c->failed |= column == NULL;
  errno = 0; /* for pw_output_check */
  for (size_t i = 0; i < a->columns && !c->failed; i++) {
    for (long row = 0; row < rows; row++) column[row] = a->value[(size_t)row * a->columns + i];
    pw_npz_add (&z, a->name[i], rows, 0, 1, column);
  }
  free (column);
  int status = pw_npz_end (&z, error);
  if (c->failed) return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  return status == PW_OK ? pw_output_check (c->output, error) : status;
}

static void archive_free (csv_archive *a) {
  if (a == NULL) return;
  free (a->name);
  free (a->value);
  free (a);
}

/* ---- Cells ---- */

static void csv_number (pw_csv *c, double value) {
  char text[32];
  if (c->archive) {
    archive_number (c, value);
    return;
  }
  if (c->cells++) fputc (',', c->f);
  fputs (isfinite (value) ? pw_format (text, value, 17) : "nan", c->f);
}

static void csv_name (pw_csv *c, const char *name, const char *unit) {
  int has_unit = unit && *unit;
  if (c->archive) {
    archive_name (c, name);
    return;
  }
  fprintf (c->f, "%s%s%s%s%s", c->cells++ ? "," : "", name, has_unit ? " [" : "", has_unit ? unit : "",
           has_unit ? "]" : "");
}

static int csv_end (pw_csv *c, pw_error *error) {
  c->cells = 0;
  if (c->failed) return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  if (c->archive) return PW_OK;
  fputc ('\n', c->f);
  return pw_output_check (c->output, error);
}

/* ---- The header ---- */

static void csv_name_states (pw_csv *c, const pw_system *s) {
  char name[300];
  int bodies = pw_system_bodies (s), n = pw_system_coordinates (s);
  for (int b = 0; b < bodies; b++)
    for (int i = 0; i < 6; i++) {
      int state = i < 3 ? 3 * b + i : n + 3 * b + i - 3;
      csv_name (c, pw_system_state_name (s, state, name, sizeof name), pw_system_state_unit (s, state));
    }
  for (int j = 3 * bodies; j < n; j++)
    for (int state = j; state < 2 * n; state += n)
      csv_name (c, pw_system_state_name (s, state, name, sizeof name), pw_system_state_unit (s, state));
}

static void csv_name_contacts (pw_csv *c, const pw_system *s) {
  char name[300];
  int elements = pw_system_elements (s);
  for (int e = 0; e < elements; e++) {
    const pw_element_info x = pw_system_element (s, e);
    for (int i = 0; x.contact >= 0 && i < 2; i++) {
      snprintf (name, sizeof name, "%s.%c", x.name, "xy"[i]);
      csv_name (c, name, "m");
    }
  }
}

static void csv_name_ledger (pw_csv *c, const pw_system *s) {
  char name[300];
  csv_name (c, "kinetic", "J");
  csv_name (c, "potential", "J");
  for (int i = 0; i < pw_system_ledger_entries (s); i++)
    csv_name (c, pw_system_ledger_name (s, i, name, sizeof name), "J");
  csv_name (c, "projection", "J");
  csv_name (c, "balance", "J");
}

static int csv_header (pw_csv *c, const pw_system *s, pw_error *error) {
  char name[300];
  errno = 0;
  csv_name (c, "t", "s");
  csv_name_states (c, s);
  csv_name_contacts (c, s);
  for (int i = 0; i < pw_system_rows (s); i++)
    csv_name (c, pw_system_reaction_name (s, i, name, sizeof name), pw_system_reaction_unit (s, i));
  csv_name (c, "residual.position", NULL);
  csv_name (c, "residual.velocity", NULL);
  if (c->ledger) csv_name_ledger (c, s);
  return csv_end (c, error);
}

static void csv_free (pw_csv *c) {
  if (c == NULL) return;
  pw_workspace_free (c->workspace);
  archive_free (c->archive);
  free (c->contact);
  free (c);
}

pw_csv *pw_csv_open (const pw_system *s, int ledger, pw_output *o, pw_error *error) {
  pw_csv *c = calloc (1, sizeof *c);
  int archive = pw_output_named (o, ".npz");
  if (archive && pw_output_continued (o)) {
    pw_fail (error, PW_INPUT, "an archive of arrays cannot be continued: write a table that ends in .csv");
    free (c);
    return NULL;
  }
  if (c) c->contact = calloc ((size_t)pw_system_contacts (s) + 1, sizeof *c->contact);
  if (c && archive) c->archive = calloc (1, sizeof *c->archive);
  if (c && c->contact && (c->archive || !archive)) {
    c->output = o, c->f = pw_output_stream (o), c->ledger = ledger;
    if (pw_system_contacts (s) > 0) c->workspace = pw_workspace_new (s, error);
    if ((c->workspace || pw_system_contacts (s) == 0) && (pw_output_continued (o) || csv_header (c, s, error) == PW_OK))
      return c;
  }
  pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  csv_free (c);
  return NULL;
}

int pw_csv_close (pw_csv *c, pw_error *error) {
  int status = c && c->archive ? archive_write (c, error) : PW_OK;
  csv_free (c);
  return status;
}

/* ---- Samples ---- */

static void csv_states (pw_csv *c, const pw_system *s, const pw_sample *x) {
  int bodies = pw_system_bodies (s), n = pw_system_coordinates (s);
  for (int b = 0; b < bodies; b++) {
    for (int i = 0; i < 3; i++) csv_number (c, x->q[3 * b + i]);
    for (int i = 0; i < 3; i++) csv_number (c, x->v[3 * b + i]);
  }
  for (int j = 3 * bodies; j < n; j++) {
    csv_number (c, x->q[j]);
    csv_number (c, x->v[j]);
  }
}

static void csv_contacts (pw_csv *c, const pw_system *s) {
  for (int i = 0; i < pw_system_contacts (s); i++) {
    csv_number (c, c->contact[i][0]);
    csv_number (c, c->contact[i][1]);
  }
}

static void csv_ledger (pw_csv *c, const pw_system *s, const pw_sample *x) {
  csv_number (c, x->kinetic);
  csv_number (c, x->potential);
  for (int i = 0; i < pw_system_ledger_entries (s); i++) csv_number (c, x->ledger ? x->ledger[i] : NAN);
  csv_number (c, x->projection);
  csv_number (c, x->balance);
}

int pw_csv_write (pw_csv *c, const pw_system *s, const pw_sample *sample, pw_error *error) {
  int status = PW_OK;
  if (c->workspace)
    status = pw_workspace_contact_points (c->workspace, sample->t, sample->q, sample->v, c->contact, error);
  if (status != PW_OK) return status;
  errno = 0;
  csv_number (c, sample->t);
  csv_states (c, s, sample);
  csv_contacts (c, s);
  for (int i = 0; i < pw_system_rows (s); i++) csv_number (c, 0 - sample->lambda[i]); /* avoids -0 */
  csv_number (c, sample->position);
  csv_number (c, sample->velocity);
  if (c->ledger) csv_ledger (c, s, sample);
  return csv_end (c, error);
}
