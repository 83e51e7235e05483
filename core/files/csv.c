/* Tables of samples: CSV with a line per sample, or NumPy archives.  The columns are
 *
 *   t [s] | states of bodies, of internal coordinates | contact points | reactions | outputs | residuals | energies
 *
 * The functions of a group of columns write their names or their values, as pw_csv.names says. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

struct pw_csv {
  const pw_system *system;
  int ledger;
  pw_workspace *workspace; /* for contact points; NULL if the system has none */
  double (*contact)[3];    /* contact points of the system */
  pw_output *output;
  FILE *f;
  int names;  /* 1: the current line has the names of the columns, else their values */
  int cells;  /* written in the current line */
  int failed; /* 1: memory was exhausted */
  char *line; /* of values */
  size_t length, line_room;
  /* of an archive, whose arrays are written when the table is closed */
  int is_archive;
  double *value;                /* line by line */
  size_t values, room, columns; /* so far; allocated; values per line */
  pw_npz npz;
};

static void csv_name (pw_csv *c, const char *name, const char *unit) {
  if (c->is_archive) {
    size_t rows = c->columns ? c->values / c->columns : 0;
    double *column = malloc ((rows + 1) * sizeof *column);
    c->failed |= column == NULL;
    for (size_t row = 0; column && row < rows; row++) column[row] = c->value[row * c->columns + (size_t)c->cells];
    if (column) pw_npz_add (&c->npz, name, (long)rows, -1, 1, column);
    free (column);
  } else {
    fprintf (c->f, "%s%s", c->cells ? "," : "", name);
    if (unit && *unit) fprintf (c->f, " [%s]", unit);
  }
  c->cells++;
}

static void csv_number (pw_csv *c, double value) {
  if (c->is_archive) {
    c->failed |= pw_grow (&c->value, c->values, &c->room, sizeof *c->value) != PW_OK;
    if (!c->failed) c->value[c->values++] = value;
  } else {
    c->failed |= pw_grow (&c->line, c->length + 33, &c->line_room, 1) != PW_OK;
    if (c->failed) return;
    char *text = c->line + c->length;
    if (c->cells) *text++ = ',';
    pw_format (text, isfinite (value) ? value : NAN, 17);
    c->length = (size_t)(strchr (text, 0) - c->line);
  }
  c->cells++;
}

/* Writes the name of the next column or its value, and evaluates only that. */
#define CSV_CELL(c, name, unit, value) ((c)->names ? csv_name (c, name, unit) : csv_number (c, value))

static void csv_state (pw_csv *c, const pw_sample *x, int state) {
  int n = pw_system_coordinates (c->system);
  if (pw_system_state_hidden (c->system, state)) return;
  CSV_CELL (c, PW_NAME (pw_system_state_name, c->system, state), pw_system_state_unit (c->system, state),
            state < n ? x->q[state] : x->v[state - n]);
}

static int csv_line (pw_csv *c, int names, const pw_sample *x, pw_error *error) {
  const pw_system *s = c->system;
  int bodies = pw_system_bodies (s), n = pw_system_coordinates (s);
  int contacts = c->workspace ? pw_system_contacts (s) : 0;
  errno = 0; /* for pw_output_check */
  c->names = names;
  c->cells = 0, c->length = 0;
  CSV_CELL (c, "t", "s", x->t);
  for (int b = 0; b < bodies; b++)
    for (int i = 0; i < 6; i++) csv_state (c, x, i < 3 ? 3 * b + i : n + 3 * b + i - 3);
  for (int i = 6 * bodies; i < 2 * n; i++) csv_state (c, x, i % 2 ? n + i / 2 : i / 2);
  for (int i = 0; i < 2 * contacts; i++)
    CSV_CELL (c, PW_NAME (pw_system_contact_name, s, i), "m", c->contact[i / 2][i % 2]);
  for (int i = 0; i < pw_system_rows (s); i++)
    CSV_CELL (c, PW_NAME (pw_system_reaction_name, s, i), pw_system_reaction_unit (s, i),
              0 - x->lambda[i]); /* avoids -0 */
  for (int i = 0; i < pw_system_outputs (s); i++)
    CSV_CELL (c, pw_system_output_name (s, i), pw_system_output_unit (s, i), x->output[i]);
  CSV_CELL (c, "residual.position", NULL, x->position);
  CSV_CELL (c, "residual.velocity", NULL, x->velocity);
  if (c->ledger) {
    CSV_CELL (c, "kinetic", "J", x->kinetic);
    CSV_CELL (c, "potential", "J", x->potential);
    for (int i = 0; i < pw_system_ledger_entries (s); i++)
      CSV_CELL (c, PW_NAME (pw_system_ledger_name, s, i), "J", x->ledger ? x->ledger[i] : NAN);
    CSV_CELL (c, "projection", "J", x->projection);
    CSV_CELL (c, "balance", "J", x->balance);
  }
  c->columns = (size_t)c->cells;
  if (c->failed) return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  if (c->is_archive) return PW_OK;
  if (c->length) fwrite (c->line, 1, c->length, c->f);
  fputc ('\n', c->f);
  return pw_output_check (c->output, error);
}

static void csv_free (pw_csv *c) {
  if (c == NULL) return;
  pw_workspace_free (c->workspace);
  free (c->value);
  free (c->line);
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
  if (complete && (is_archive || continued || csv_line (c, 1, &(pw_sample){ 0 }, error) == PW_OK)) return c;
  pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  csv_free (c);
  return NULL;
}

int pw_csv_write (pw_csv *c, const pw_system *s, const pw_sample *sample, pw_error *error) {
  int status = pw_require (c, "a table", error);
  (void)s; /* the table has that of pw_csv_open */
  if (status == PW_OK && c->workspace)
    status = pw_workspace_contact_points (c->workspace, sample->t, sample->q, sample->v, c->contact, error);
  return status == PW_OK ? csv_line (c, 0, sample, error) : status;
}

int pw_csv_close (pw_csv *c, pw_error *error) {
  int status = PW_OK;
  if (c && c->is_archive) {
    status = csv_line (c, 1, &(pw_sample){ 0 }, error);
    int end = pw_npz_end (&c->npz, error);
    if (status == PW_OK) status = end == PW_OK ? pw_output_check (c->output, error) : end;
  }
  csv_free (c);
  return status;
}

/* NumPy archives: a zip file (PKWARE's APPNOTE), not compressed, with a .npy file per array (numpy.lib.format 1.0). */

enum { NPZ_HEAD = 128 };   /* bytes before the data of a .npy file, a multiple of 64 */
enum { NPZ_MOST = 65535 }; /* files of an archive */

/* The first four bytes of the header of a file, of its entry in the directory, of the end record; the version 2.0. */
#define NPZ_FILE 0x04034b50
#define NPZ_ENTRY 0x02014b50
#define NPZ_END 0x06054b50
#define NPZ_VERSION 20

struct pw_npz_entry {
  char name[312];
  unsigned long check, size, offset;
};

/* CRC-32 with the polynomial 0xedb88320, as in zip files, continued from `check`, at first 0: eight bytes at a time.
 * part[i]: the check of a byte followed by i zeros (Kounavis and Berry 2005). */
static unsigned long npz_crc (unsigned long check, const void *data, size_t size) {
  uint32_t part[8][256], crc = ~(uint32_t)check;
  for (uint32_t b = 0; b < 256; b++) {
    part[0][b] = b;
    for (int bit = 0; bit < 8; bit++) part[0][b] = part[0][b] >> 1 ^ (part[0][b] & 1 ? 0xedb88320 : 0);
  }
  for (int i = 1; i < 8; i++)
    for (int b = 0; b < 256; b++) part[i][b] = part[i - 1][b] >> 8 ^ part[0][part[i - 1][b] & 255];
  const unsigned char *c = data, *end = c + size;
  for (; end - c >= 8; c += 8) {
    crc ^= (uint32_t)c[0] | (uint32_t)c[1] << 8 | (uint32_t)c[2] << 16 | (uint32_t)c[3] << 24;
    crc = part[7][crc & 255] ^ part[6][crc >> 8 & 255] ^ part[5][crc >> 16 & 255] ^ part[4][crc >> 24] ^ part[3][c[4]] ^
          part[2][c[5]] ^ part[1][c[6]] ^ part[0][c[7]];
  }
  for (; c < end; c++) crc = crc >> 8 ^ part[0][(crc ^ *c) & 255];
  return ~crc;
}

static void npz_bytes (pw_npz *z, const void *data, size_t size) {
  fwrite (data, 1, size, z->f);
  z->at += size;
}

/* Writes a number of `bytes` bytes, the lowest first. */
static void npz_number (pw_npz *z, unsigned long value, int bytes) {
  for (; bytes > 0; bytes--, value >>= 8) npz_bytes (z, &(unsigned char){ (unsigned char)value }, 1);
}

/* Writes what the header of a file and its entry in the directory share: version 2.0, flags (names in UTF-8), method
 * (stored), 1 January 1980, checksum, compressed and original size, lengths of the name and of extra fields. */
static void npz_describe (pw_npz *z, const struct pw_npz_entry *e) {
  npz_number (z, NPZ_VERSION, 2);
  npz_number (z, 0x0800, 4);
  npz_number (z, 0x00210000, 4);
  npz_number (z, e->check, 4);
  npz_number (z, e->size, 4);
  npz_number (z, e->size, 4);
  npz_number (z, strlen (e->name), 2);
  npz_number (z, 0, 2);
}

/* Adds an array of items of this type, "f8". */
static void npz_array (pw_npz *z, const char *name, const char *type, const char *shape, const void *item,
                       size_t size) {
  char head[NPZ_HEAD + 1] = "\x93NUMPY\x01";
  z->failed |= pw_grow (&z->entry, (size_t)z->count, &z->room, sizeof *z->entry) != PW_OK;
  if (z->failed) return;
  struct pw_npz_entry *e = z->entry + z->count++;
  head[8] = NPZ_HEAD - 10; /* bytes of the header after its length, in two bytes */
  snprintf (head + 10, NPZ_HEAD - 10, "{'descr': '%c%s', 'fortran_order': False, 'shape': (%s), }",
            *(const char *)&(int){ 1 } ? '<' : '>', type, shape);
  memset (strchr (head + 10, 0), ' ', (size_t)(head + NPZ_HEAD - strchr (head + 10, 0)));
  head[NPZ_HEAD - 1] = '\n';
  snprintf (e->name, sizeof e->name, "%.300s.npy", name);
  e->check = npz_crc (npz_crc (0, head, NPZ_HEAD), item, size);
  e->size = NPZ_HEAD + size;
  e->offset = z->at;
  npz_number (z, NPZ_FILE, 4);
  npz_describe (z, e);
  npz_bytes (z, e->name, strlen (e->name));
  npz_bytes (z, head, NPZ_HEAD);
  npz_bytes (z, item, size);
}

void pw_npz_add (pw_npz *z, const char *name, long rows, long columns, int parts, const double *value) {
  const char *shape = columns < 0 ? PW_PRINTED (60, "%ld,", rows) : PW_PRINTED (60, "%ld, %ld", rows, columns);
  npz_array (z, name, parts == 2 ? "c16" : "f8", shape, value,
             (size_t)rows * (size_t)(columns < 0 ? 1 : columns) * (size_t)parts * sizeof *value);
}

void pw_npz_add_texts (pw_npz *z, const char *name, long rows, int width, const uint32_t *character) {
  npz_array (z, name, PW_PRINTED (20, "U%d", width), PW_PRINTED (60, "%ld,", rows), character,
             (size_t)rows * (size_t)width * sizeof *character);
}

int pw_npz_end (pw_npz *z, pw_error *error) {
  unsigned long start = z->at; /* of the directory */
  for (const struct pw_npz_entry *e = z->entry; e < z->entry + z->count; e++) {
    npz_number (z, NPZ_ENTRY, 4);
    npz_number (z, NPZ_VERSION, 2);
    npz_describe (z, e);
    npz_number (z, 0, 10); /* comment, disk, internal and external attributes */
    npz_number (z, e->offset, 4);
    npz_bytes (z, e->name, strlen (e->name));
  }
  unsigned long size = z->at - start;
  npz_number (z, NPZ_END, 4); /* then disk 0, entries, size and offset of the directory, no comment */
  npz_number (z, 0, 4);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, size, 4);
  npz_number (z, start, 4);
  npz_number (z, 0, 2);
  free (z->entry);
  z->entry = NULL;
  if (z->failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (z->at <= 0xffffffff && z->count <= NPZ_MOST) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "an .npz archive has at most 4 GB and %d arrays; write a .csv", NPZ_MOST);
}
