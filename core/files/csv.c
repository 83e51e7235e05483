/* Tables of samples: CSV with a line per sample, or NumPy archives.  The columns are
 *
 *   t [s] | states of bodies, of internal coordinates | contact points | reactions | outputs | residuals | energies
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

struct pw_csv {
  const pw_system *system;
  pw_workspace *workspace;
  pw_column *column; /* columns: of the table */
  size_t columns;
  pw_output *output;
  FILE *f;
  char *line; /* columns x 33 */
  int failed; /* 1: memory was exhausted */
  /* of an archive, whose arrays are written when the table is closed */
  int is_archive;
  double *value;       /* line by line */
  size_t values, room; /* so far; allocated */
  pw_npz npz;
};

/* Lists the columns; with `column` NULL, only counts them. */
static size_t csv_columns (const pw_system *s, int ledger, pw_column *column) {
  static const pw_column_type after_states[] = { PW_COLUMN_CONTACT,   PW_COLUMN_REACTION, PW_COLUMN_OUTPUT,
                                                 PW_COLUMN_POSITION,  PW_COLUMN_VELOCITY, PW_COLUMN_KINETIC,
                                                 PW_COLUMN_POTENTIAL, PW_COLUMN_LEDGER,   PW_COLUMN_PROJECTION,
                                                 PW_COLUMN_BALANCE };
  const int bodies = pw_system_bodies (s), n = pw_system_coordinates (s), types = ledger ? 10 : 5;
  size_t count = 0;
#define CSV_ADD(type, index) (column ? (void)(column[count] = (pw_column){ type, index }) : (void)0, count++)
  CSV_ADD (PW_COLUMN_TIME, 0);
  for (int i = 0; i < 2 * n; i++) { /* positions and velocities of each body, then of each internal coordinate */
    const int k = i % 6, state = i >= 6 * bodies ? i / 2 + (i % 2) * n : 3 * (i / 6) + (k < 3 ? k : n + k - 3);
    if (!pw_system_state_hidden (s, state)) CSV_ADD (PW_COLUMN_STATE, state);
  }
  for (int k = 0; k < types; k++)
    for (int i = 0; i < pw_system_columns (s, after_states[k]); i++) CSV_ADD (after_states[k], i);
  return count;
}

/* The line of names or, of an archive, all arrays. */
static int csv_names (pw_csv *c, pw_error *error) {
  const size_t rows = c->values / c->columns;
  double *value = c->is_archive ? malloc ((rows + 1) * sizeof *value) : NULL;
  c->failed |= c->is_archive && value == NULL;
  errno = 0; /* for pw_output_check */
  for (size_t i = 0; i < c->columns && !c->failed; i++) {
    const char *name = PW_NAME (pw_system_column_name, c->system, c->column[i]),
               *unit = pw_system_column_unit (c->system, c->column[i]);
    for (size_t row = 0; value && row < rows; row++) value[row] = c->value[row * c->columns + i];
    if (value)
      pw_npz_add (&c->npz, name, (long)rows, -1, 1, value);
    else
      fprintf (c->f, *unit ? "%s%s [%s]" : "%s%s", i ? "," : "", name, unit);
  }
  free (value);
  if (c->failed) return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  if (!c->is_archive) fputc ('\n', c->f);
  return pw_output_check (c->output, error);
}

static void csv_free (pw_csv *c) {
  if (c == NULL) return;
  pw_workspace_free (c->workspace);
  free (c->column);
  free (c->line);
  free (c->value);
  free (c);
}

pw_csv *pw_csv_open (const pw_system *s, int ledger, pw_output *o, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (o, "an output", error) != PW_OK) return NULL;
  const int is_archive = pw_output_named (o, ".npz"), continued = pw_output_continued (o);
  if (is_archive && continued) {
    pw_fail (error, PW_INPUT, "an archive of arrays cannot be continued: write a table that ends in .csv");
    return NULL;
  }
  pw_csv *c = calloc (1, sizeof *c);
  if (c) {
    *c = (pw_csv){ .system = s, .output = o, .f = pw_output_stream (o), .is_archive = is_archive };
    c->npz.f = c->f, c->columns = csv_columns (s, ledger, NULL);
    c->column = malloc (c->columns * sizeof *c->column), c->line = malloc (c->columns * 33);
    c->workspace = pw_workspace_new (s, error);
    if (c->column) csv_columns (s, ledger, c->column);
    c->failed = pw_grow (&c->value, c->columns, &c->room, sizeof *c->value) != PW_OK;
  }
  const int complete = c && c->column && c->line && c->workspace && !c->failed;
  if (complete && (is_archive || continued || csv_names (c, error) == PW_OK)) return c;
  pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  csv_free (c);
  return NULL;
}

int pw_csv_write (pw_csv *c, const pw_system *s, const pw_sample *sample, pw_error *error) {
  int status = pw_require (c, "a table", error);
  (void)s; /* the table has that of pw_csv_open */
  if (status != PW_OK) return status;
  if (c->is_archive && pw_grow (&c->value, c->values + c->columns, &c->room, sizeof *c->value) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory while writing a table");
  double *value = c->value + c->values;
  status = pw_workspace_columns (c->workspace, sample, c->column, (int)c->columns, value, error);
  if (status != PW_OK) return status;
  if (c->is_archive) return c->values += c->columns, PW_OK;
  errno = 0; /* for pw_output_check */
  char *end = c->line;
  for (size_t i = 0; i < c->columns; i++) {
    pw_format (end, isfinite (value[i]) ? value[i] : NAN, 17);
    end = strchr (end, 0);
    *end++ = i + 1 < c->columns ? ',' : '\n';
  }
  fwrite (c->line, 1, (size_t)(end - c->line), c->f);
  return pw_output_check (c->output, error);
}

int pw_csv_close (pw_csv *c, pw_error *error) {
  int status = PW_OK;
  if (c && c->is_archive) {
    status = csv_names (c, error);
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
