/* Specialised code: loads the compiled object from the cache, or compiles it.
 *
 * A file KEY.so in the cache is the object, then its text, its identity (code_job) and a checksum; it is loaded if
 * these are as expected.  KEY.c is locked while it is compiled, and deleted afterwards; if it does not compile, it is
 * kept, with the messages in KEY.log. */
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
  const char *text;
  int lanes;           /* 0: for single runs */
  char identity[2000]; /* what else determines the object: version, compiler, options, checksum of pinwheel.h */
  char key[17];        /* checksum of text and identity, in hexadecimal */
  /* paths: KEY.c, KEY.log, the object while written, KEY.so */
  char folder[PW_PATH], source[PW_PATH], log[PW_PATH], part[PW_PATH], object[PW_PATH];
  pw_scene_code *code; /* the result */
} code_job;

/* ---- Identity ---- */

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

/* Adds a line to the identity. */
static void code_add (code_job *x, const char *text) {
  size_t used = strlen (x->identity);
  snprintf (x->identity + used, sizeof x->identity - used, "%s\n", text);
}

/* Adds the words of the compiler; of programs among them ("ccache gcc") also size, date and inode. */
static int code_add_compiler (code_job *x) {
  char *copy = strdup (pw_compiler ()), *rest = NULL;
  for (char *w = copy ? strtok_r (copy, " \t", &rest) : NULL; w; w = strtok_r (NULL, " \t", &rest)) {
    struct stat info;
    code_add (x, w);
    if (!code_find_program (w, &info)) continue;
    code_add (x, PW_PRINTED (200, "%lld %lld %ld %llu", (long long)info.st_size, (long long)info.st_mtim.tv_sec,
                             (long)info.st_mtim.tv_nsec, (unsigned long long)info.st_ino));
  }
  free (copy);
  return copy && strlen (x->identity) < sizeof x->identity - 50 ? PW_OK : PW_RESOURCE; /* room for the checksum */
}

/* Reads a file.  PW_RETRY: it does not exist. */
static int code_read (const char *path, char **text, size_t *size, pw_error *error) {
  int status = pw_read_file ("cannot read", path, CODE_MAX_BYTES, "the limit for an object", text, size, error);
  return status == PW_INPUT && *text == NULL && errno == ENOENT ? PW_RETRY : status;
}

static int code_identify (code_job *x, pw_error *error) {
  char header[PW_PATH], *text = NULL, sum[40] = "";
  size_t size;
  code_add (x, "pinwheel " PW_VERSION);
  for (const char *const *o = pw_scene_options (x->lanes); *o; o++) code_add (x, *o);
  if (code_add_compiler (x) != PW_OK) return pw_fail (error, PW_RESOURCE, "out of memory, or CC is too long");
  int status = pw_search_header (header, error);
  if (*header && code_read (header, &text, &size, NULL) == PW_OK)
    snprintf (sum, sizeof sum, "%016llx", pw_check_sum (PW_CHECK, text, size));
  code_add (x, sum);
  snprintf (x->key, sizeof x->key, "%016llx",
            pw_check_sum (pw_check_sum (PW_CHECK, x->text, strlen (x->text)), x->identity, strlen (x->identity)));
  free (text);
  return status;
}

/* The object while written is named by process: the compiler of a killed one may still run. */
static void code_paths (code_job *x) {
  pw_path (x->source, "%s/%s.c", x->folder, x->key);
  pw_path (x->log, "%s/%s.log", x->folder, x->key);
  pw_path (x->part, "%s/%s.%ld.part", x->folder, x->key, (long)getpid ());
  pw_path (x->object, "%s/%s.so", x->folder, x->key);
}

/* ---- Loading ---- */

/* Checks a cached object.  PW_RETRY: missing, or of another text or identity; PW_INPUT: damaged; PW_RESOURCE. */
static int code_check (const code_job *x, pw_error *error) {
  char *bytes;
  size_t size = 0, text_size = strlen (x->text), id_size = strlen (x->identity);
  unsigned long long check = 0;
  int status = code_read (x->object, &bytes, &size, error);
  if (status == PW_OK && size >= sizeof check) memcpy (&check, bytes + (size -= sizeof check), sizeof check);
  if (status == PW_OK && pw_check_sum (PW_CHECK, bytes, size) != check)
    status = pw_fail (error, PW_INPUT, "it is damaged");
  if (status == PW_OK && (size < text_size + id_size || memcmp (bytes + size - id_size, x->identity, id_size) != 0 ||
                          memcmp (bytes + size - id_size - text_size, x->text, text_size) != 0))
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

/* Appends text, identity and checksum to an object, and renames it. */
static int code_complete (const code_job *x, pw_error *error) {
  char *bytes;
  size_t size, text_size = strlen (x->text), identity_size = strlen (x->identity);
  pw_error cause = { 0 };
  int status = code_read (x->part, &bytes, &size, &cause);
  if (status == PW_RETRY) strcpy (cause.text, "the compiler has written no object");
  if (status != PW_OK) return free (bytes), pw_fail (error, PW_RESOURCE, "%s", cause.text);
  unsigned long long check = pw_check_sum (pw_check_sum (pw_check_sum (PW_CHECK, bytes, size), x->text, text_size),
                                           x->identity, identity_size);
  free (bytes);
  FILE *f = fopen (x->part, "ab");
  if (f) fprintf (f, "%s%s", x->text, x->identity);
  if (f) fwrite (&check, sizeof check, 1, f);
  int failed = f == NULL || ferror (f);
  if (f && fclose (f) != 0) failed = 1;
  if (!failed && rename (x->part, x->object) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", x->object, strerror (errno));
}

/* Compiles KEY.c, which this process has locked. */
static int code_compile (code_job *x, FILE *source, pw_error *error) {
  int status = PW_OK;
  if (fputs (x->text, source) < 0 || fflush (source) != 0)
    status = pw_fail (error, PW_RESOURCE, "cannot write %s: %s", x->source, strerror (errno));
  if (status == PW_OK) status = pw_compile_scene (x->source, x->part, x->log, x->lanes, error);
  int keep = status == PW_METHOD;
  if (status == PW_OK) status = code_complete (x, error);
  if (status == PW_OK && (status = code_load (x, error)) != PW_OK) unlink (x->object);
  unlink (x->part);
  if (!keep) unlink (x->source), unlink (x->log);
  return status;
}

/* Creates and locks KEY.c, waiting while another process compiles it.  NULL after a minute, or if that fails. */
static FILE *code_lock (const code_job *x) {
  const struct timespec pause = { .tv_nsec = 20000000 };
  int file, waits = 0;
  while ((file = pw_lock_file (x->source, PW_LOCK_NEW)) < 0 && errno == EWOULDBLOCK && waits++ < CODE_MAX_WAITS)
    nanosleep (&pause, NULL);
  FILE *f = file >= 0 ? fdopen (file, "wb") : NULL;
  if (f == NULL && file >= 0) unlink (x->source), close (file);
  return f;
}

/* Compiles into the cache.  PW_METHOD if the text does not compile, PW_STOPPED if a signal ended the compiler, else
 * PW_RETRY: the cache may be the cause, as it is if KEY.c was deleted meanwhile. */
static int code_compile_cached (code_job *x, pw_error *error) {
  pw_error cause = { 0 };
  FILE *source = code_lock (x);
  if (source == NULL) return PW_RETRY;
  int status = code_check (x, NULL) == PW_OK ? code_load (x, NULL) : PW_RETRY; /* another process was faster */
  if (status != PW_OK)
    status = code_compile (x, source, &cause);
  else
    unlink (x->source);
  fclose (source);
  if (status == PW_OK) pw_cache_trim (x->folder);
  if (status == PW_STOPPED || (status == PW_METHOD && access (x->source, F_OK) == 0))
    return pw_fail (error, status, "%s", cause.text);
  return status == PW_OK ? PW_OK : PW_RETRY;
}

static int code_compile_temporary (code_job *x, pw_error *error) {
  if (pw_temporary_folder (x->folder, error) != PW_OK) return PW_RESOURCE;
  code_paths (x);
  FILE *source = code_lock (x);
  int status =
      source ? code_compile (x, source, error) : pw_fail (error, PW_RESOURCE, "cannot write into %s", x->folder);
  if (source) fclose (source);
  unlink (x->object);
  rmdir (x->folder); /* unless it keeps the source */
  return status;
}

static int code_open (code_job *x, pw_error *error) {
  int status = code_identify (x, error);
  if (pw_cache_folder (x->folder, x->code->notice, sizeof x->code->notice) && status == PW_OK) {
    code_paths (x);
    status = code_load_cached (x);
    if (status == PW_RETRY) status = code_compile_cached (x, error);
    if (status != PW_RETRY) return status;
  }
  return status == PW_OK || status == PW_RETRY ? code_compile_temporary (x, error) : status;
}

pw_scene_code *pw_scene_lanes_open (const char *text, const pw_system *s, int lanes, pw_error *error) {
  if (pw_require (text, "specialised code", error) != PW_OK || pw_require (s, "a system", error) != PW_OK) return NULL;
  if (pw_scene_options (lanes) == NULL)
    return pw_fail (error, PW_INPUT, "%d runs at once: expected 2, 4 or %d", lanes, PW_LANES_MOST), NULL;
  code_job x = { .system = s, .text = text, .lanes = lanes, .code = calloc (1, sizeof *x.code) };
  int status = x.code ? code_open (&x, error) : pw_fail (error, PW_RESOURCE, "out of memory");
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
