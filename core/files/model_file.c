/* Finds a model file by its name or path, loads and checks it. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

struct pw_file {
  char name[PW_PATH], path[PW_PATH]; /* the name without its ending; the path with links resolved */
  void *handle;                      /* of dlopen; NULL for a text model */
  pw_yaml *yaml;                     /* the text model; NULL for a plug-in */
  size_t max_bytes;                  /* limit for a text model */
  const pw_plugin_table *table;
};

/* ---- Loading ---- */

/* The last error of dlopen, without the path with which its message begins. */
static const char *model_reason (const char *object) {
  const char *reason = dlerror ();
  if (reason == NULL) return "unknown reason";
  size_t n = strlen (object);
  return strncmp (reason, object, n) == 0 && strncmp (reason + n, ": ", 2) == 0 ? reason + n + 2 : reason;
}

static int model_load (void *context, const char *object, pw_error *error) {
  pw_file *f = context;
  errno = 0;
  f->handle = dlopen (object, RTLD_NOW | RTLD_LOCAL);
  if (f->handle == NULL && errno == ENOMEM)
    return pw_fail (error, PW_RESOURCE, "cannot load %s: out of memory", f->path);
  if (f->handle == NULL) return pw_fail (error, PW_INPUT, "cannot load %s: %s", f->path, model_reason (object));
  f->table = dlsym (f->handle, "pw_plugin");
  if (f->table == NULL)
    return pw_fail (error, PW_INPUT, "%s is not a Pinwheel model: a model file ends with PW_MODEL (...)", f->path);
  return pw_plugin_check (f->table, f->path, error);
}

/* ---- Finding ---- */

static const char *const model_endings[] = { ".so", ".c", ".yaml" };
enum { MODEL_SO, MODEL_C, MODEL_YAML, MODEL_ENDINGS };

/* The ending of a name; MODEL_ENDINGS if it is none of these. */
static int model_ending (const char *name) {
  int i = 0;
  while (i < MODEL_ENDINGS && !pw_ends_with (name, model_endings[i])) i++;
  return i;
}

static int model_is_cpp (const char *name) {
  return pw_ends_with (name, ".cpp") || pw_ends_with (name, ".cc") || pw_ends_with (name, ".cxx") ||
         pw_ends_with (name, ".C");
}

/* Opens the file at f->path, which exists; messages about the contents of a text model begin with `shown`. */
static int model_open_path (pw_file *f, const char *shown, pw_error *error) {
  const char *base = strrchr (f->path, '/') + 1; /* the path is absolute */
  int ending = model_ending (base);
  if (model_is_cpp (base))
    return pw_fail (error, PW_INPUT,
                    "%s: a model is compiled as C, not as C++: write it in C, in a file that ends in .c", f->path);
  if (ending == MODEL_ENDINGS) return pw_fail (error, PW_INPUT, "%s: a model file ends in .c, .so or .yaml", f->path);
  if (!pw_is_line (base))
    return pw_fail (error, PW_INPUT, "%s: the name of a model file is UTF-8 without control characters", f->path);
  pw_path (f->name, "%.*s", (int)(strlen (base) - strlen (model_endings[ending])), base);
  if (ending == MODEL_YAML) {
    f->yaml = pw_yaml_open (f->path, shown, f->max_bytes, error);
    if (f->yaml) f->table = pw_yaml_table (f->yaml);
    return f->yaml ? PW_OK : error->status;
  }
  return ending == MODEL_C ? pw_compile_file (f->path, NULL, model_load, f, error) : model_load (f, f->path, error);
}

static int model_find_path (pw_file *f, const char *path, pw_error *error) {
  struct stat info;
  if (realpath (path, f->path) == NULL)
    return pw_fail (error, errno == ENOMEM ? PW_RESOURCE : PW_INPUT, "cannot open the model file %s: %s", path,
                    strerror (errno));
  if (stat (f->path, &info) == 0 && !S_ISREG (info.st_mode))
    return pw_fail (error, PW_INPUT, "cannot open the model file %s: %s", path, pw_not_regular (info.st_mode));
  return PW_OK;
}

/* Reports an unknown name; suggests a path if the current directory has such a file, else the nearest name. */
static int model_unknown (const pw_search *s, const char *name, pw_error *error) {
  struct stat info;
  char remark[300] = ""; /* on folders that cannot be searched */
  for (int i = 0; i < MODEL_ENDINGS; i++) {
    const char *here = PW_PRINTED (200, "%s%s", name, model_endings[i]);
    if (stat (here, &info) == 0)
      return pw_fail (error, PW_INPUT, "there is no model \"%s\" on the search path; to use the file here, write ./%s",
                      name, here);
  }
  if (*s->unread) snprintf (remark, sizeof remark, "; PINWHEEL_MODELS has %s", s->unread);
  if (s->count == 0)
    return pw_fail (error, PW_INPUT, "there is no model \"%s\", nor any other in %s%s", name,
                    *s->folders ? s->folders : "the folders of PINWHEEL_MODELS or next to the program", remark);
  pw_nearest near = { .sought = name };
  for (int i = 0; i < s->count; i++) pw_nearest_try (&near, s->found[i].name);
  const char *hint = pw_nearest_text (&near);
  if (*remark == 0) return pw_fail (error, PW_INPUT, "there is no model \"%s\"%s", name, hint);
  return pw_fail (error, PW_INPUT, "there is no model \"%s\" in %s%s%s", name, s->folders, remark, hint);
}

static int model_find_name (pw_file *f, const char *name, pw_error *error) {
  pw_search s;
  int status = pw_search_open (&s, error), first = 0;
  while (first < s.count && strcmp (s.found[first].name, name) != 0) first++;
  const pw_found *found = first < s.count ? &s.found[first] : NULL;
  if (status == PW_OK && found == NULL)
    status = model_unknown (&s, name, error);
  else if (status == PW_OK && first + 1 < s.count && strcmp (found[1].name, name) == 0)
    status = pw_fail (error, PW_INPUT, "several files match \"%s\", such as %s and %s; name the model by its path",
                      name, found[0].path, found[1].path);
  else if (status == PW_OK)
    pw_path (f->path, "%s", found->path);
  pw_search_close (&s);
  return status;
}

/* Finds a model's file, which is not opened.  *shown becomes its path for messages: as given, or as found by name. */
static pw_file *model_find (const char *model, const char **shown, pw_error *error) {
  int given = model && *model;
  pw_file *f = given ? calloc (1, sizeof *f) : NULL;
  if (f == NULL) {
    pw_fail (error, given ? PW_RESOURCE : PW_INPUT, given ? "out of memory" : "a model's name or path is missing");
    return NULL;
  }
  int by_path = strchr (model, '/') || model_ending (model) < MODEL_ENDINGS || model_is_cpp (model);
  if ((by_path ? model_find_path (f, model, error) : model_find_name (f, model, error)) == PW_OK) {
    *shown = by_path ? model : f->path;
    return f;
  }
  pw_file_close (f);
  return NULL;
}

char *pw_file_find (const char *model, pw_error *error) {
  pw_file *f = model_find (model, &(const char *){ NULL }, error);
  char *path = f ? strdup (f->path) : NULL;
  if (f && path == NULL) pw_fail (error, PW_RESOURCE, "out of memory");
  pw_file_close (f);
  return path;
}

pw_file *pw_file_open (const char *model, pw_error *error) {
  return pw_file_open_limited (model, PW_FILE_DEFAULT_BYTES, error);
}

pw_file *pw_file_open_limited (const char *model, size_t max_bytes, pw_error *error) {
  const char *shown;
  pw_error own = { 0 }, *why = error ? error : &own;
  pw_file *f = model_find (model, &shown, why);
  if (f == NULL) return NULL;
  f->max_bytes = max_bytes < PW_FILE_MAX_BYTES ? max_bytes : PW_FILE_MAX_BYTES;
  if (model_open_path (f, shown, why) == PW_OK) return f;
  pw_file_close (f);
  return NULL;
}

void pw_file_close (pw_file *f) {
  if (f == NULL) return;
  if (f->handle) dlclose (f->handle);
  pw_yaml_close (f->yaml);
  free (f);
}

/* ---- An open file ---- */

pw_model *pw_file_model (const pw_file *f, pw_error *error) {
  return pw_require (f, "a model file", error) == PW_OK ? pw_model_new (f->name, f->table, error) : NULL;
}

const pw_plugin_table *pw_file_table (const pw_file *f) {
  return f ? f->table : NULL;
}

const pw_yaml *pw_file_yaml (const pw_file *f) {
  return f ? f->yaml : NULL;
}

const char *pw_file_name (const pw_file *f) {
  return f ? f->name : NULL;
}

const char *pw_file_path (const pw_file *f) {
  return f ? f->path : NULL;
}

int pw_file_tables (const pw_file *f, int (*each) (void *context, const char *path), void *context) {
  return pw_file_yaml (f) ? pw_yaml_tables (f->yaml, each, context) : 0;
}

int pw_file_list (int (*each) (void *context, const char *name, const char *path), void *context, pw_error *error) {
  pw_search s;
  if (each == NULL) return pw_fail (error, PW_INPUT, "a function for each model is missing");
  int status = pw_search_open (&s, error);
  for (int i = 0; status == PW_OK && i < s.count; i++)
    if (each (context, s.found[i].name, s.found[i].path) != 0) break;
  pw_search_close (&s);
  return status;
}

/* The files in an interactive page: the engine as WebAssembly; for a text model also its text, tree and tables. */

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
