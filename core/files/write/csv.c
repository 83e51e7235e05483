/* Tables of samples: CSV with a line per sample, or NumPy archives.  The columns are
 *
 *   t [s] | states of each body, of each internal coordinate | contact points | reactions | residuals | energies
 *
 * The functions of a group of columns write their names or their values, as pw_csv.content says. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "files.h"

typedef enum { CSV_NAMES, CSV_VALUES } csv_content;

struct pw_csv {
  const pw_system *system;
  int ledger;
  pw_workspace *workspace; /* for contact points; NULL if the system has none */
  double (*contact)[3];    /* contact points of the system */
  pw_output *output;
  FILE *f;
  csv_content content; /* of the current line */
  int cells;           /* written in the current line */
  int failed;          /* 1: memory was exhausted */
  /* of an archive, whose arrays are written when the table is closed */
  int is_archive;
  double *value;                /* line by line */
  size_t values, room, columns; /* so far; allocated; values per line */
  pw_npz npz;
};

/* ---- Cells ---- */

/* Adds the next column to the archive. */
static void csv_array (pw_csv *c, const char *name) {
  size_t rows = c->columns ? c->values / c->columns : 0;
  double *column = malloc ((rows + 1) * sizeof *column);
  c->failed |= column == NULL;
  for (size_t row = 0; column && row < rows; row++) column[row] = c->value[row * c->columns + (size_t)c->cells];
  if (column) pw_npz_add (&c->npz, name, (long)rows, -1, 1, column);
  free (column);
}

static void csv_name (pw_csv *c, const char *name, const char *unit) {
  if (c->is_archive) {
    csv_array (c, name);
  } else {
    fprintf (c->f, "%s%s", c->cells ? "," : "", name);
    if (unit && *unit) fprintf (c->f, " [%s]", unit);
  }
  c->cells++;
}

static void csv_number (pw_csv *c, double value) {
  char text[32];
  if (c->is_archive) {
    c->failed |= pw_grow (&c->value, c->values, &c->room, sizeof *c->value) != PW_OK;
    if (!c->failed) c->value[c->values++] = value;
  } else {
    if (c->cells) fputc (',', c->f);
    fputs (isfinite (value) ? pw_format (text, value, 17) : "nan", c->f);
  }
  c->cells++;
}

/* Writes the name of the next column or its value, and evaluates only that. */
#define CSV_CELL(c, name, unit, value) ((c)->content == CSV_NAMES ? csv_name (c, name, unit) : csv_number (c, value))

/* ---- Lines ---- */

static void csv_state (pw_csv *c, const pw_sample *x, int state) {
  int n = pw_system_coordinates (c->system);
  CSV_CELL (c, PW_NAME (pw_system_state_name, c->system, state), pw_system_state_unit (c->system, state),
            state < n ? x->q[state] : x->v[state - n]);
}

static void csv_states (pw_csv *c, const pw_sample *x) {
  int bodies = pw_system_bodies (c->system), n = pw_system_coordinates (c->system);
  for (int b = 0; b < bodies; b++)
    for (int i = 0; i < 6; i++) csv_state (c, x, i < 3 ? 3 * b + i : n + 3 * b + i - 3);
  for (int state = 3 * bodies; state < n; state++) {
    csv_state (c, x, state);
    csv_state (c, x, n + state);
  }
}

static void csv_contacts (pw_csv *c) {
  for (int i = 0; c->workspace && i < 2 * pw_system_contacts (c->system); i++)
    CSV_CELL (c, PW_NAME (pw_system_contact_name, c->system, i), "m", c->contact[i / 2][i % 2]);
}

static void csv_reactions (pw_csv *c, const pw_sample *x) {
  for (int i = 0; i < pw_system_rows (c->system); i++)
    CSV_CELL (c, PW_NAME (pw_system_reaction_name, c->system, i), pw_system_reaction_unit (c->system, i),
              0 - x->lambda[i]); /* avoids -0 */
}

static void csv_ledger (pw_csv *c, const pw_sample *x) {
  CSV_CELL (c, "kinetic", "J", x->kinetic);
  CSV_CELL (c, "potential", "J", x->potential);
  for (int i = 0; i < pw_system_ledger_entries (c->system); i++)
    CSV_CELL (c, PW_NAME (pw_system_ledger_name, c->system, i), "J", x->ledger ? x->ledger[i] : NAN);
  CSV_CELL (c, "projection", "J", x->projection);
  CSV_CELL (c, "balance", "J", x->balance);
}

static int csv_line (pw_csv *c, csv_content content, const pw_sample *x, pw_error *error) {
  errno = 0; /* for pw_output_check */
  c->content = content;
  c->cells = 0;
  CSV_CELL (c, "t", "s", x->t);
  csv_states (c, x);
  csv_contacts (c);
  csv_reactions (c, x);
  CSV_CELL (c, "residual.position", NULL, x->position);
  CSV_CELL (c, "residual.velocity", NULL, x->velocity);
  if (c->ledger) csv_ledger (c, x);
  c->columns = (size_t)c->cells;
  if (c->failed) return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  if (c->is_archive) return PW_OK;
  fputc ('\n', c->f);
  return pw_output_check (c->output, error);
}

/* ---- The table ---- */

static void csv_free (pw_csv *c) {
  if (c == NULL) return;
  pw_workspace_free (c->workspace);
  free (c->value);
  free (c->contact);
  free (c);
}

pw_csv *pw_csv_open (const pw_system *s, int ledger, pw_output *o, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (o, "an output", error) != PW_OK) return NULL;
  int contacts = pw_system_contacts (s), is_archive = pw_output_named (o, ".npz"), continued = pw_output_continued (o);
  if (is_archive && continued) {
    pw_fail (error, PW_INPUT, "an archive of arrays cannot be continued: write a table that ends in .csv");
    return NULL;
  }
  pw_csv *c = calloc (1, sizeof *c);
  if (c) {
    *c = (pw_csv){ .system = s, .ledger = ledger, .output = o, .f = pw_output_stream (o), .is_archive = is_archive };
    c->npz.f = c->f;
    c->contact = calloc ((size_t)contacts + 1, sizeof *c->contact);
    c->workspace = contacts > 0 ? pw_workspace_new (s, error) : NULL;
  }
  int complete = c && c->contact && (c->workspace || contacts == 0);
  if (complete && (is_archive || continued || csv_line (c, CSV_NAMES, &(pw_sample){ 0 }, error) == PW_OK)) return c;
  pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  csv_free (c);
  return NULL;
}

int pw_csv_write (pw_csv *c, const pw_system *s, const pw_sample *sample, pw_error *error) {
  int status = pw_require (c, "a table", error);
  (void)s; /* the table has that of pw_csv_open */
  if (status == PW_OK && c->workspace)
    status = pw_workspace_contact_points (c->workspace, sample->t, sample->q, sample->v, c->contact, error);
  return status == PW_OK ? csv_line (c, CSV_VALUES, sample, error) : status;
}

int pw_csv_close (pw_csv *c, pw_error *error) {
  int status = PW_OK;
  if (c && c->is_archive) {
    status = csv_line (c, CSV_NAMES, &(pw_sample){ 0 }, error);
    int end = pw_npz_end (&c->npz, error);
    if (status == PW_OK) status = end == PW_OK ? pw_output_check (c->output, error) : end;
  }
  csv_free (c);
  return status;
}
