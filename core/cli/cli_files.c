/* The files that a command reads and writes: checks, folders, those kept open until it ends. */
#define _GNU_SOURCE /* memmem */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"

enum { FILES_FOLDER = 4064 }; /* longest name of a folder: the paths of files in it have room in 4096 bytes */

typedef struct {
  pw_use *use;
  int count;
  pw_error *error;
} files_check;

static int files_check_table (void *context, const char *path) {
  files_check *check = context;
  check->use[0].what = "a file of the model";
  check->use[0].path = path;
  return pw_check_paths (check->use, check->count, check->error);
}

const char *const pw_cli_csv[] = { ".csv", NULL }, *const pw_cli_json[] = { ".json", NULL },
                  *const pw_cli_tables[] = { ".csv", ".npz", ".json", NULL };

/* The ending of a file's name that states its format, such as ".csv"; NULL for another ending, such as ".5". */
static const char *files_format (const char *path) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", digits[] = "0123456789";
  const char *slash = strrchr (path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr (name, '.');
  size_t n = dot && dot > name ? strspn (dot + 1, letters) : 0;
  return n > 0 && n <= 5 && strspn (dot + 1 + n, digits) == strlen (dot + 1 + n) ? dot : NULL;
}

static int files_listed (const char *ending, const char *const *list) {
  while (*list && strcasecmp (*list, ending) != 0) list++;
  return *list != NULL;
}

/* Whether the format is one of the list; so is that of "a.csv.old" if ".csv" is listed. */
static int files_written (const char *path, const char *ending, const char *const *list) {
  const char *within = NULL;
  for (const char *const *e = list; *e && within == NULL; e++) within = strstr (path, *e);
  return files_listed (ending, list) || (within && within < ending);
}

int pw_cli_names_file (const char *path) {
  static const char *const formats[] = { ".csv", ".npz", ".json", ".html", ".yaml", ".svg",
                                         ".png", ".pdf", ".xlsx", ".txt",  NULL };
  return files_format (path) && files_listed (files_format (path), formats);
}

int pw_cli_check_format (const pw_use *use, pw_error *error) {
  const char *ending = use->path ? files_format (use->path) : NULL;
  char list[80] = "";
  if (ending == NULL || use->how == PW_READS) return PW_OK;
  if (use->how == PW_WRITES_INTO) {
    if (!pw_cli_names_file (use->path) || access (use->path, F_OK) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s %.200s: expected the name of a folder, in which files are written", use->what,
                    use->path);
  }
  if (use->names == NULL || files_written (use->path, ending, use->names)) return PW_OK;
  for (const char *const *name = use->names; *name; name++)
    strcat (strcat (list, name == use->names ? "" : name[1] ? ", " : " or "), *name);
  return pw_fail (error, PW_INPUT, "%s %.200s: the format %s is not written: expected a name that ends in %s",
                  use->what, use->path, ending, list);
}

int pw_cli_check_uses (const pw_cli_line *line, pw_use *use, int count, pw_error *error) {
  const pw_file *file = line->m.file;
  files_check check = { use, count, error };
  pw_error own = { 0 };
  char *path = file ? NULL : pw_file_find (line->argument[0], &own);
  use[0].path = file ? pw_file_path (file) : path;
  int status = own.status == PW_RESOURCE ? pw_fail (error, PW_RESOURCE, "%s", own.text) : PW_OK;
  if (status == PW_OK) status = pw_check_paths (use, count, error); /* opening the model reports what else is wrong */
  if (status == PW_OK && file) status = pw_file_tables (file, files_check_table, &check);
  for (int i = 1; i < count && status == PW_OK && file; i++) status = pw_cli_check_format (&use[i], error);
  use[0].path = NULL;
  free (path);
  return status;
}

static void cells_next (pw_cells *c) {
  if (c->cells++) fputc (',', c->f);
}

void pw_cells_text (pw_cells *c, const char *text) {
  cells_next (c);
  fputs (text, c->f);
}

void pw_cells_number (pw_cells *c, double value) {
  pw_cells_text (c, isfinite (value) ? PW_DIGITS (value, 17) : "nan");
}

/* Line ends become blanks; between quotes, a quote in the text is doubled. */
static void cells_write (FILE *f, const char *text, int between_quotes) {
  for (; *text; text++) {
    if (between_quotes && *text == '"') fputc ('"', f);
    fputc (*text == '\n' || *text == '\r' ? ' ' : *text, f);
  }
}

void pw_cells_name (pw_cells *c, const char *name, const char *unit) {
  const char *quote = strchr (name, ',') ? "\"" : "";
  pw_cells_text (c, quote);
  cells_write (c->f, name, *quote != 0);
  fprintf (c->f, unit && *unit ? " [%s]%s" : "%s%s", unit && *unit ? unit : "", quote);
}

void pw_cells_quoted (pw_cells *c, const char *text) {
  pw_cells_text (c, "\"");
  cells_write (c->f, text, 1);
  fputc ('"', c->f);
}

void pw_cells_end (pw_cells *c) {
  fputc ('\n', c->f);
  c->cells = 0;
}

/* The cells of a table, line by line: their texts; one in quotes begins with a quote. */
typedef struct {
  char **cell;
  long rows; /* after the heading */
  int columns;
} table_cells;

/* Finds the cells, which end with 0 from now on.  Free them.  PW_OK or PW_RESOURCE. */
static int table_split (table_cells *t, char *csv) {
  size_t most = 0, count = 0;
  for (const char *c = csv; *c; c++) most += *c == ',' || *c == '\n';
  *t = (table_cells){ .cell = malloc ((most + 1) * sizeof *t->cell) };
  if (t->cell == NULL) return PW_RESOURCE;
  for (char *c = csv, *to, end; *c; *to = 0) {
    const int quoted = *c == '"';
    t->cell[count++] = to = c;
    for (c += quoted, to += quoted; *c && (quoted || (*c != ',' && *c != '\n')); *to++ = *c++)
      if (quoted && *c == '"' && *++c != '"') break; /* quotes inside are doubled */
    end = *c;
    c += end != 0;
    if (end == '\n' && t->columns == 0) t->columns = (int)count;
  }
  t->rows = t->columns ? (long)count / t->columns - 1 : 0;
  return PW_OK;
}

/* Cell k of a row, -1: of the heading, without quotes.  *value: the number in it, else NaN; *is_text: 1 if it is in
 * quotes, or neither a number nor empty. */
static const char *table_cell (const table_cells *t, long row, int k, double *value, int *is_text) {
  const char *cell = t->cell[(row + 1) * t->columns + k];
  const int quoted = *cell == '"';
  *value = NAN;
  *is_text = (cell[quoted] && pw_read_number (cell + quoted, value) != PW_OK) || quoted;
  return cell + quoted;
}

/* Stores the characters of a text in UTF-8. */
static void table_characters (const char *text, uint32_t *to) {
  for (const unsigned char *c = (const unsigned char *)text; *c; to++) {
    int more = *c >= 0xF0 ? 3 : *c >= 0xE0 ? 2 : *c >= 0xC0 ? 1 : 0; /* bytes of the character that follow */
    for (*to = *c++ & (more ? 0x3Fu >> more : 0xFFu); more > 0 && *c; more--) *to = *to << 6 | (*c++ & 0x3Fu);
  }
}

/* Adds column k to an archive: numbers, NaN for empty cells; or if a cell is a text, texts.  PW_OK or PW_RESOURCE. */
static int table_npz (const table_cells *t, int k, const char *name, pw_npz *z) {
  double *value = malloc (((size_t)t->rows + 1) * sizeof *value);
  size_t width = 1; /* bytes of the longest text */
  int texts = 0, is_text;
  for (long i = 0; value && i < t->rows; i++) {
    const size_t length = strlen (table_cell (t, i, k, &value[i], &is_text));
    texts |= is_text;
    if (length > width) width = length;
  }
  if (value && !texts) pw_npz_add (z, name, t->rows, -1, 1, value);
  uint32_t *text = texts ? calloc ((size_t)t->rows * width, sizeof *text) : NULL;
  for (long i = 0; text && i < t->rows; i++)
    table_characters (table_cell (t, i, k, value, &is_text), text + (size_t)i * width);
  if (text) pw_npz_add_texts (z, name, t->rows, (int)width, text);
  const int status = value && (text || !texts) ? PW_OK : PW_RESOURCE;
  free (value);
  free (text);
  return status;
}

static void table_json (const table_cells *t, FILE *f) {
  pw_json j = { .f = f, .lines = 1 };
  double value;
  int is_text;
  pw_json_open (&j, NULL, '{');
  for (int k = 0; k < t->columns; k++) {
    pw_json_open (&j, table_cell (t, -1, k, &value, &is_text), '[');
    for (long i = 0; i < t->rows; i++) {
      const char *cell = table_cell (t, i, k, &value, &is_text);
      if (is_text && *cell)
        pw_json_text (&j, NULL, cell);
      else
        pw_json_number (&j, NULL, value);
    }
    pw_json_close (&j, ']');
  }
  pw_json_close (&j, '}');
}

static int table_convert (char *csv, int is_json, FILE *f, pw_error *error) {
  table_cells t;
  pw_npz z = { .f = f };
  int status = table_split (&t, csv);
  for (int k = 0; status == PW_OK && k < t.columns && !is_json; k++) {
    char *name = t.cell[k] + (*t.cell[k] == '"'), *unit = strstr (name, " [");
    if (unit) *unit = 0;
    status = table_npz (&t, k, name, &z);
  }
  if (status == PW_OK && is_json) table_json (&t, f);
  const int ended = is_json ? PW_OK : pw_npz_end (&z, error);
  free (t.cell);
  return status == PW_OK ? ended : pw_fail (error, status, "out of memory");
}

int pw_cli_write_table (const char *path, FILE *f, const void *context,
                        void (*table) (const void *context, pw_cells *c), pw_error *error) {
  const char *ending = files_format (path);
  const int is_npz = ending && strcasecmp (ending, ".npz") == 0, is_json = ending && strcasecmp (ending, ".json") == 0;
  if (!is_npz && !is_json) {
    table (context, &(pw_cells){ .f = f });
    return ferror (f) ? pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, strerror (errno)) : PW_OK;
  }
  pw_stream text;
  FILE *memory = pw_stream_open (&text);
  if (memory) table (context, &(pw_cells){ .f = memory });
  int status = pw_stream_close (memory, &text) == PW_OK ? table_convert (text.text, is_json, f, error)
                                                        : pw_fail (error, PW_RESOURCE, "out of memory");
  free (text.text);
  return status;
}

static int folder_make (pw_folder *folder, pw_error *error) {
  char path[FILES_FOLDER + 1];
  size_t n = strlen (folder->path);
  if (n == 0 || n > FILES_FOLDER)
    return pw_fail (error, PW_INPUT, "\"%s\" cannot be the name of a folder", folder->path);
  memcpy (path, folder->path, n + 1);
  for (size_t i = 1; i <= n; i++) {
    if (path[i] != '/' && path[i] != 0) continue;
    char end = path[i];
    path[i] = 0;
    if (mkdir (path, 0777) == 0)
      folder->made = folder->made ? folder->made : i;
    else if (errno != EEXIST)
      return pw_fail (error, PW_RESOURCE, "cannot make the folder %s: %s", path, strerror (errno));
    path[i] = end;
  }
  return PW_OK;
}

int pw_folder_open (pw_folder *folder, const char *path, pw_error *error) {
  *folder = (pw_folder){ .path = path };
  if (folder_make (folder, error) == PW_OK) folder->lock = pw_lock_folder (path, error);
  folder->locked = error->status == PW_OK;
  return error->status;
}

void pw_folder_close (pw_folder *folder) {
  char path[FILES_FOLDER + 1];
  for (size_t n = folder->made ? strlen (strcpy (path, folder->path)) : 0; n && n >= folder->made; n--) {
    if (path[n] != '/' && path[n] != 0) continue;
    path[n] = 0;
    const char *slash = strrchr (path, '/'), *last = slash ? slash + 1 : path;
    if (*last == 0 || strcmp (last, ".") == 0 || strcmp (last, "..") == 0) continue; /* no folder of its own */
    if (rmdir (path) != 0 && errno != ENOENT) break; /* it has files; ENOENT: "a/../a" and "a" are the same folder */
  }
  if (folder->locked) close (folder->lock);
}

int pw_files_open (pw_cli_line *line, pw_use *use, int count, pw_error *error) {
  int status = pw_cli_check_uses (line, use, count, error);
  for (int i = 1; i < count && status == PW_OK; i++) { /* use[0] is the model */
    if (use[i].path == NULL || use[i].how == PW_READS) continue;
    if (use[i].how == PW_WRITES)
      status = (line->files.output[i] = pw_output_open (use[i].path, error)) ? PW_OK : error->status;
    else
      status = pw_folder_open (&line->files.folder, use[i].path, error);
  }
  return status;
}

FILE *pw_files_stream (const pw_cli_line *line, int i) {
  return line->files.output[i] ? pw_output_stream (line->files.output[i]) : NULL;
}

int pw_files_finish (pw_cli_line *line, pw_error *error) {
  int status = pw_output_finish_all (line->files.output, PW_FILES, error);
  memset (line->files.output, 0, sizeof line->files.output);
  return status;
}

void pw_fingerprint_line (FILE *f, const char *key, const char *name, const char *value) {
  fprintf (f, "%s%s%s = ", key, name ? " " : "", name ? name : "");
  for (; *value; value++) fputc (*value == '\n' ? ' ' : *value, f); /* an entry has one line */
  fputc ('\n', f);
}

void pw_fingerprint_number (FILE *f, const char *key, const char *name, double value) {
  pw_fingerprint_line (f, key, name, PW_DIGITS (value, 17));
}

int pw_fingerprint_file (FILE *f, const char *key, const char *name, const char *path, pw_error *error) {
  char block[4096];
  uint64_t sum = PW_CHECK;
  const char *reason;
  FILE *in = pw_open_input (path, &reason);
  if (in == NULL) return pw_fail (error, pw_open_input_status (), "cannot read %s: %s", path, reason);
  for (size_t n; (n = fread (block, 1, sizeof block, in)) > 0;) sum = pw_check_sum (sum, block, n);
  int code = ferror (in) ? errno : 0;
  fclose (in);
  if (code) return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", path, strerror (code));
  pw_fingerprint_line (f, key, NULL, PW_PRINTED (200, "%.150s, contents %016llx", name, (unsigned long long)sum));
  return PW_OK;
}

int pw_fingerprint_run (FILE *f, const char *magic, const pw_cli_line *line, uint64_t table_sum, const char *method,
                        const pw_settings *settings, pw_error *error) {
  fputs (magic, f);
  pw_fingerprint_line (f, "version", NULL, PW_VERSION);
  int status = pw_fingerprint_file (f, "model", pw_file_name (line->m.file), pw_file_path (line->m.file), error);
  for (pw_file *const *m = line->method_file; status == PW_OK && m && *m; m++)
    status = pw_fingerprint_file (f, "method-file", pw_file_name (*m), pw_file_path (*m), error);
  if (table_sum)
    pw_fingerprint_line (f, "tables", NULL, PW_PRINTED (40, "contents %016llx", (unsigned long long)table_sum));
  pw_fingerprint_line (f, "method", NULL, method);
  pw_fingerprint_number (f, "t-end", NULL, settings->span);
  pw_fingerprint_number (f, "step", NULL, settings->step);
  pw_fingerprint_number (f, "rtol", NULL, settings->rtol);
  pw_fingerprint_number (f, "atol", NULL, settings->atol);
  return status;
}

uint64_t pw_fingerprint_tables (uint64_t sum, const pw_model *m) {
  int elements;
  const pw_element *e = pw_model_elements (m, &elements);
  for (const pw_element *end = e + elements; e < end; e++)
    for (int i = 0; pw_field_at (e->kind, e->definition, PW_SIGNAL, i); i++) {
      const pw_signal *s = pw_field_at (e->kind, e->definition, PW_SIGNAL, i);
      if (s->type != PW_TABLE) continue;
      size_t bytes = (size_t)s->table.count * sizeof (double);
      sum = pw_check_sum (pw_check_sum (sum ? sum : PW_CHECK, s->table.t, bytes), s->table.value, bytes);
      const double map[2] = { s->table.scale, s->table.offset };
      if (map[0] != 0 || map[1] != 0) sum = pw_check_sum (sum, map, sizeof map);
    }
  const pw_reference_text *text = pw_model_reference_text (m);
  for (const pw_path_text *p = text->path, *end = p + text->paths; p < end; p++) {
    size_t bytes = (size_t)p->count * sizeof (double);
    sum = pw_check_sum (pw_check_sum (sum ? sum : PW_CHECK, p->x, bytes), p->y, bytes);
  }
  return sum;
}

void pw_fingerprint_initial (FILE *f, const char **starts) {
  for (; starts && *starts; starts++) {
    size_t n = strcspn (*starts, "=");
    const char **later = starts + 1;
    while (*later && strncmp (*later, *starts, n + 1) != 0) later++;
    if (*later) continue;
    pw_fingerprint_line (f, "start", PW_PART (*starts, n), *starts + n + 1);
  }
}

const char *pw_fingerprint_end (const char *magic, const char *at, const char *end) {
  static const char last[] = "\nend\n";
  size_t size = (size_t)(end - at), n = strlen (magic);
  if (size < n || memcmp (at, magic, n) != 0) return NULL;
  const char *found = memmem (at, size, last, strlen (last));
  return found ? found + strlen (last) : NULL;
}

/* The rest, of *size bytes, of the first line that begins with the `length` bytes of `front`, "KEY = ". */
static const char *fingerprint_find (const char *at, const char *end, const char *front, size_t length, size_t *size) {
  for (const char *newline; (newline = memchr (at, '\n', (size_t)(end - at))) != NULL; at = newline + 1) {
    if ((size_t)(newline - at) < length || memcmp (at, front, length) != 0) continue;
    *size = (size_t)(newline - at) - length;
    return at + length;
  }
  return NULL;
}

const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size) {
  const char *front = PW_PRINTED (100, "%s = ", key);
  return fingerprint_find (at, end, front, strlen (front), size);
}

/* Describes the first entry of `a` that `b` does not have, or has with another value; 0 if there is none. */
static int fingerprint_missing (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  enum { SHOWN = 120 }; /* characters of a value, at most */
  for (const char *line = a.begin, *end; (end = memchr (line, '\n', (size_t)(a.end - line))); line = end + 1) {
    const char *equals = memmem (line, (size_t)(end - line), " = ", 3);
    if (equals == NULL) continue; /* the first and the last line */
    size_t key = (size_t)(equals - line), own_size = (size_t)(end - equals) - 3, other_size;
    if (ignored && strlen (ignored) == key && memcmp (ignored, line, key) == 0) continue;
    const char *own = equals + 3, *other = fingerprint_find (b.begin, b.end, line, key + 3, &other_size);
    if (other && other_size == own_size && memcmp (other, own, own_size) == 0) continue;
    if (other == NULL) other = "not set", other_size = strlen (other);
    int shown = own_size < SHOWN ? (int)own_size : SHOWN, other_shown = other_size < SHOWN ? (int)other_size : SHOWN;
    snprintf (text, size, "%.*s is %.*s %s and %.*s %s", (int)key, line, shown, own, a.where, other_shown, other,
              b.where);
    return 1;
  }
  return 0;
}

int pw_fingerprint_differ (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  return fingerprint_missing (a, b, ignored, text, size) || fingerprint_missing (b, a, ignored, text, size);
}
