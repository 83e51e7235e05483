/* The files in an interactive page: the engine as WebAssembly; for a text model also its text, tree and tables. */
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { PAGE_MAX_BYTES = 64 << 20 };

/* Adds a file; the page owns the bytes. */
static int page_add (pw_page *p, const char *name, char *bytes, size_t size, pw_error *error) {
  pw_page_file *more = bytes ? realloc (p->file, (size_t)(p->files + 1) * sizeof *more) : NULL;
  char *copy = more ? strdup (name) : NULL;
  if (more) p->file = more;
  if (copy == NULL) {
    free (bytes);
    return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  p->file[p->files++] = (pw_page_file){ copy, bytes, size };
  return PW_OK;
}

static int page_read (pw_page *p, const char *name, const char *path, pw_error *error) {
  char *bytes;
  size_t size;
  int status =
      pw_read_file ("cannot read", path, PAGE_MAX_BYTES, "the limit for a part of a page", &bytes, &size, error);
  if (status == PW_OK) return page_add (p, name, bytes, size, error);
  free (bytes);
  return status;
}

static int page_use_engine (void *context, const char *object, pw_error *error) {
  return page_read (context, "engine", object, error);
}

/* Text models share one engine; `source`, a model in C or NULL, is compiled into an engine of its own. */
static int page_engine (pw_page *p, const char *source, pw_error *error) {
  char path[PW_PATH];
  int status = pw_search_page_file (source ? "pinwheel-page.objects" : "pinwheel.wasm", path, error);
  if (status == PW_OK && *path == 0)
    status = pw_fail (error, PW_INPUT,
                      "this Pinwheel was built without the engine of interactive pages: install %s and build it again",
                      PW_PAGE_TOOLS);
  if (status == PW_OK)
    status = source ? pw_compile_file (source, path, page_use_engine, p, error) : page_read (p, "engine", path, error);
  return status;
}

/* ---- Text models ---- */

static int page_write (pw_page *p, const char *name, void (*write) (const pw_yaml *y, FILE *f), const pw_yaml *y,
                       pw_error *error) {
  pw_stream part;
  FILE *f = pw_stream_open (&part);
  if (f) write (y, f);
  pw_stream_close (f, &part);
  return page_add (p, name, part.text, part.size, error);
}

enum { PAGE_PARTS = 3 }; /* files before the tables: engine, model, tree */

typedef struct {
  pw_page *p;
  size_t folder; /* bytes of the path of the model's folder, including the slash */
  pw_error *error;
} page_tables;

/* Adds a table once, however many signals read it. */
static int page_table (void *context, const char *path) {
  page_tables *x = context;
  const char *name = path + x->folder;
  for (int i = 0; i < x->p->files; i++)
    if (strcmp (x->p->file[i].name, name) == 0)
      return i >= PAGE_PARTS
                 ? PW_OK
                 : pw_fail (x->error, PW_INPUT, "table %s: a page has a part of this name; rename the file, to %s.csv",
                            name, name);
  return page_read (x->p, name, path, x->error);
}

static int page_text (pw_page *p, const pw_file *f, const pw_yaml *y, pw_error *error) {
  const char *path = pw_file_path (f);
  page_tables x = { p, (size_t)(strrchr (path, '/') - path) + 1, error };
  int status = page_write (p, "model", pw_yaml_write_source, y, error); /* the file may have changed since */
  if (status == PW_OK && p->file[p->files - 1].size > PAGE_MAX_BYTES)
    status = pw_fail (error, PW_INPUT, "%s: a page takes a model of at most %d MB", path, PAGE_MAX_BYTES >> 20);
  if (status == PW_OK) status = page_write (p, "tree", pw_yaml_write_tree, y, error);
  if (status == PW_OK) status = pw_file_tables (f, page_table, &x);
  return status == PW_OK ? PW_OK : pw_fail (error, status, "out of memory"); /* unless the reason is recorded */
}

int pw_page_open (pw_page *p, const pw_file *f, pw_error *error) {
  *p = (pw_page){ .files = 0 };
  if (pw_require (f, "a model file", error) != PW_OK) return PW_INPUT;
  const char *path = pw_file_path (f);
  const pw_yaml *y = pw_file_yaml (f);
  if (y == NULL && !pw_ends_with (path, ".c"))
    return pw_fail (error, PW_INPUT,
                    "%s: a page contains the model compiled for browsers: name its source, a .c file; "
                    "those of the gallery are installed in share/doc/pinwheel/examples",
                    path);
  int status = page_engine (p, y ? NULL : path, error);
  return status == PW_OK && y ? page_text (p, f, y, error) : status;
}

void pw_page_close (pw_page *p) {
  for (int i = 0; i < p->files; i++) {
    free (p->file[i].name);
    free (p->file[i].bytes);
  }
  free (p->file);
}
