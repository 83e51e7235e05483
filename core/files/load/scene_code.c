/* Specialised code: loads the compiled object from the cache, or compiles it.
 *
 * A file KEY.so in the cache is the object, then its source and a checksum; it is loaded if these are as expected.
 * KEY.c is locked while it is compiled, and deleted afterwards; if it does not compile, it is kept, with the messages
 * in KEY.log. */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "files.h"

enum { CODE_MAX_BYTES = 64 << 20, CODE_MAX_WAITS = 3000 }; /* waits of 20 ms: a minute */

struct pw_scene_code {
  void *handle;
  const pw_specialised *table;
  const pw_specialised_lanes *lanes_table;
  char notice[PW_PATH + 600];
};

/* The object to load. */
typedef struct {
  const pw_system *system;
  int lanes;        /* 0: for single runs */
  pw_stream source; /* ends with comments on what else determines the object */
  char key[17];     /* checksum of the source, in hexadecimal */
  /* paths: KEY.c, KEY.log, the object while written, KEY.so */
  char folder[PW_PATH], c_file[PW_PATH], log[PW_PATH], part[PW_PATH], object[PW_PATH];
  pw_scene_code *code; /* the result */
} code_job;

/* ---- Source ---- */

/* Finds a command, on PATH unless it has a slash; an empty entry of PATH is the current folder.  0 if there is none. */
static int code_find_program (const char *word, struct stat *info) {
  if (strchr (word, '/')) return stat (word, info) == 0;
  for (const char *entry = getenv ("PATH"), *end; entry; entry = *end ? end + 1 : NULL) {
    char path[PW_PATH];
    end = entry + strcspn (entry, ":");
    pw_path (path, "%.*s%s%s", (int)(end - entry), entry, end > entry ? "/" : "", word);
    if (stat (path, info) == 0 && S_ISREG (info->st_mode) && access (path, X_OK) == 0) return 1;
  }
  return 0;
}

/* Writes the words of a compiler, which are modified; of programs among them ("ccache gcc") also size, date, inode. */
static void code_write_compiler (FILE *f, char *words) {
  char *rest = NULL;
  for (char *w = strtok_r (words, " \t", &rest); w; w = strtok_r (NULL, " \t", &rest)) {
    struct stat info;
    fprintf (f, "// %s\n", w);
    if (!code_find_program (w, &info)) continue;
    fprintf (f, "// %lld %lld %ld %llu\n", (long long)info.st_size, (long long)info.st_mtim.tv_sec,
             (long)info.st_mtim.tv_nsec, (unsigned long long)info.st_ino);
  }
}

/* Reads a file.  PW_RETRY: it does not exist. */
static int code_read (const char *path, char **text, size_t *size, pw_error *error) {
  int status = pw_read_file ("cannot read", path, CODE_MAX_BYTES, "the limit for an object", text, size, error);
  return status == PW_INPUT && *text == NULL && errno == ENOENT ? PW_RETRY : status;
}

/* Stores a text as the source, followed by version, options, compiler and checksum of pinwheel.h. */
static int code_source (code_job *x, const char *text, pw_error *error) {
  char header[PW_PATH], *bytes = NULL, *compiler = strdup (pw_compiler ());
  size_t size;
  int status = pw_search_header (header, error);
  FILE *f = pw_stream_open (&x->source);
  if (f && compiler) {
    fprintf (f, "%s\n// pinwheel " PW_VERSION "\n", text);
    for (const char *const *o = pw_scene_options (x->lanes); *o; o++) fprintf (f, "// %s\n", *o);
    code_write_compiler (f, compiler);
    if (*header && code_read (header, &bytes, &size, NULL) == PW_OK)
      fprintf (f, "// %016llx\n", pw_check_sum (PW_CHECK, bytes, size));
  }
  free (bytes);
  free (compiler);
  if (pw_stream_close (f, &x->source) != PW_OK || compiler == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  snprintf (x->key, sizeof x->key, "%016llx", pw_check_sum (PW_CHECK, x->source.text, x->source.size));
  return status;
}

/* The object while written is named by process: the compiler of a killed one may still run. */
static void code_paths (code_job *x) {
  pw_path (x->c_file, "%s/%s.c", x->folder, x->key);
  pw_path (x->log, "%s/%s.log", x->folder, x->key);
  pw_path (x->part, "%s/%s.%ld.part", x->folder, x->key, (long)getpid ());
  pw_path (x->object, "%s/%s.so", x->folder, x->key);
}

/* ---- Loading ---- */

/* Checks a cached object.  PW_RETRY: missing, or of another source; PW_INPUT: damaged; PW_RESOURCE. */
static int code_check (const code_job *x, pw_error *error) {
  char *bytes;
  size_t size = 0, source_size = x->source.size;
  unsigned long long check = 0;
  int status = code_read (x->object, &bytes, &size, error);
  if (status == PW_OK && size >= sizeof check) memcpy (&check, bytes + (size -= sizeof check), sizeof check);
  if (status == PW_OK && pw_check_sum (PW_CHECK, bytes, size) != check)
    status = pw_fail (error, PW_INPUT, "it is damaged");
  if (status == PW_OK && (size < source_size || memcmp (bytes + size - source_size, x->source.text, source_size) != 0))
    status = PW_RETRY;
  free (bytes);
  return status;
}

/* Loads the object, unless it is that of another scene. */
static int code_load (code_job *x, pw_error *error) {
  void *handle = dlopen (x->object, RTLD_NOW | RTLD_LOCAL);
  if (handle == NULL) return pw_fail (error, PW_RESOURCE, "it cannot be loaded: %s", dlerror ());
  const pw_specialised *table = dlsym (handle, "pw_specialised_scene");
  const pw_specialised_lanes *lanes_table = dlsym (handle, "pw_specialised_scene_lanes");
  if (x->lanes ? lanes_table && pw_specialised_lanes_fit (lanes_table, x->system)
               : table && pw_specialised_fits (table, x->system)) {
    x->code->handle = handle;
    x->code->table = table, x->code->lanes_table = lanes_table;
    return PW_OK;
  }
  dlclose (handle);
  return pw_fail (error, PW_RESOURCE, "it belongs to another scene or version");
}

/* Loads the object from the cache.  PW_RETRY: it must be compiled. */
static int code_load_cached (code_job *x) {
  pw_error cause = { 0 };
  int status = code_check (x, &cause);
  if (status == PW_OK) status = code_load (x, &cause);
  if (status == PW_OK) utimensat (AT_FDCWD, x->object, NULL, 0); /* the oldest are deleted first */
  if (status != PW_OK && status != PW_RETRY)
    snprintf (x->code->notice, sizeof x->code->notice, "the cached object %s is replaced: %s", x->object, cause.text);
  return status == PW_OK ? PW_OK : PW_RETRY;
}

/* ---- Compiling ---- */

/* Appends source and checksum to an object, and renames it. */
static int code_complete (const code_job *x, pw_error *error) {
  char *bytes;
  size_t size;
  pw_error cause = { 0 };
  int status = code_read (x->part, &bytes, &size, &cause);
  if (status == PW_RETRY) strcpy (cause.text, "the compiler has written no object");
  if (status != PW_OK) return free (bytes), pw_fail (error, PW_RESOURCE, "%s", cause.text);
  unsigned long long check = pw_check_sum (pw_check_sum (PW_CHECK, bytes, size), x->source.text, x->source.size);
  free (bytes);
  FILE *f = fopen (x->part, "ab");
  if (f) fwrite (x->source.text, 1, x->source.size, f);
  if (f) fwrite (&check, sizeof check, 1, f);
  int failed = f == NULL || ferror (f);
  if (f && fclose (f) != 0) failed = 1;
  if (!failed && rename (x->part, x->object) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", x->object, strerror (errno));
}

/* Compiles KEY.c, which this process has locked. */
static int code_compile (code_job *x, int file, pw_error *error) {
  int status = PW_OK;
  if (dprintf (file, "%s", x->source.text) < 0)
    status = pw_fail (error, PW_RESOURCE, "cannot write %s: %s", x->c_file, strerror (errno));
  if (status == PW_OK) status = pw_compile_scene (x->c_file, x->part, x->log, x->lanes, error);
  int keep = status == PW_METHOD;
  if (status == PW_OK) status = code_complete (x, error);
  if (status == PW_OK && (status = code_load (x, error)) != PW_OK) unlink (x->object);
  unlink (x->part);
  if (!keep) unlink (x->c_file), unlink (x->log);
  return status;
}

/* Creates and locks KEY.c, waiting while another process compiles it.  -1 after a minute, or if that fails. */
static int code_lock (const code_job *x) {
  const struct timespec pause = { .tv_nsec = 20000000 };
  int file, waits = 0;
  while ((file = pw_lock_file (x->c_file, PW_LOCK_NEW)) < 0 && errno == EWOULDBLOCK && waits++ < CODE_MAX_WAITS)
    nanosleep (&pause, NULL);
  return file;
}

/* Compiles in the folder, unless another process has done so meanwhile. */
static int code_make (code_job *x, pw_error *error) {
  int file = code_lock (x);
  if (file < 0) return pw_fail (error, PW_RESOURCE, "cannot write into %s", x->folder);
  int status = code_load_cached (x);
  if (status == PW_OK)
    unlink (x->c_file);
  else
    status = code_compile (x, file, error);
  close (file);
  return status;
}

/* Uses a temporary folder after failures that the cache may have caused, as by the deletion of KEY.c. */
static int code_open (code_job *x, pw_error *error) {
  pw_error cause = { 0 };
  if (pw_cache_folder (x->folder, x->code->notice, sizeof x->code->notice)) {
    code_paths (x);
    if (code_load_cached (x) == PW_OK) return PW_OK;
    int status = code_make (x, &cause);
    if (status == PW_OK) return pw_cache_trim (x->folder), PW_OK;
    if (status == PW_STOPPED || (status == PW_METHOD && access (x->c_file, F_OK) == 0))
      return pw_fail (error, status, "%s", cause.text);
  }
  if (pw_temporary_folder (x->folder, error) != PW_OK) return PW_RESOURCE;
  code_paths (x);
  int status = code_make (x, error);
  unlink (x->object);
  rmdir (x->folder); /* unless it keeps KEY.c */
  return status;
}

pw_scene_code *pw_scene_lanes_open (const char *text, const pw_system *s, int lanes, pw_error *error) {
  if (pw_require (text, "specialised code", error) != PW_OK || pw_require (s, "a system", error) != PW_OK) return NULL;
  if (pw_scene_options (lanes) == NULL)
    return pw_fail (error, PW_INPUT, "%d runs at once: expected 2, 4 or %d", lanes, PW_LANES_MOST), NULL;
  code_job x = { .system = s, .lanes = lanes, .code = calloc (1, sizeof *x.code) };
  int status = x.code ? code_source (&x, text, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = code_open (&x, error);
  free (x.source.text);
  if (status == PW_OK) return x.code;
  free (x.code);
  return NULL;
}

pw_scene_code *pw_scene_code_open (const char *text, const pw_system *s, pw_error *error) {
  return pw_scene_lanes_open (text, s, 0, error);
}

const pw_specialised_lanes *pw_scene_code_lanes (const pw_scene_code *c) {
  return c && c->lanes_table && pw_specialised_lanes_count (c->lanes_table) > 0 ? c->lanes_table : NULL;
}

const pw_specialised *pw_scene_code_table (const pw_scene_code *c) {
  return c ? c->table : NULL;
}

const char *pw_scene_code_notice (const pw_scene_code *c) {
  return c ? c->notice : "";
}

void pw_scene_code_close (pw_scene_code *c) {
  if (c) dlclose (c->handle);
  free (c);
}
