/* Compiles C to a shared object or to WebAssembly; runs the compiler without a shell. */
#define _XOPEN_SOURCE 700 /* S_ISVTX */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include "files.h"

extern char **environ;

typedef struct {
  const char *compiler;       /* one or more words ("ccache gcc") */
  const char *const *options; /* ends with NULL, as does `last` */
  const char *last[3];        /* options and files after the name of the source */
  int for_page;               /* 1: compiles to WebAssembly */
  const char *log;            /* generated code: the file that gets its messages; NULL: a model file */
  sigset_t mask;              /* signals blocked before build_defer, and in the compiler */
} build_command;

const char *pw_compiler (void) {
  const char *cc = getenv ("CC");
  return cc && cc[strspn (cc, " \t")] ? cc : "cc";
}

/* Starts the compiler, its messages into the file `log`, SIGPIPE not ignored.  0 or an errno value. */
static int build_spawn (const build_command *cmd, char *const *word, int log, pid_t *child) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  sigset_t pipe;
  sigemptyset (&pipe);
  sigaddset (&pipe, SIGPIPE);
  int code = posix_spawn_file_actions_init (&files);
  if (code) return code;
  code = posix_spawnattr_init (&attributes);
  if (code == 0) {
    code = posix_spawn_file_actions_adddup2 (&files, log, STDERR_FILENO);
    if (code == 0) code = posix_spawn_file_actions_adddup2 (&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawnattr_setsigmask (&attributes, &cmd->mask);
    posix_spawnattr_setsigdefault (&attributes, &pipe);
    posix_spawnattr_setflags (&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    if (code == 0) code = posix_spawnp (child, word[0], &files, &attributes, word, environ);
    posix_spawnattr_destroy (&attributes);
  }
  posix_spawn_file_actions_destroy (&files);
  return code;
}

/* Runs a compiler's command line; `source` and `object` are the file that it compiles and the one that it makes, which
 * does not exist yet. */
static int build_run (const build_command *cmd, char *const *word, const char *source, const char *object,
                      pw_error *error) {
  pid_t child, ended = 0;
  int log = cmd->log ? open (cmd->log, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0600) : STDERR_FILENO;
  if (log < 0) return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", cmd->log, strerror (errno));
  int outcome = 0, code = build_spawn (cmd, word, log, &child);
  if (cmd->log) close (log);
  while (code == 0 && (ended = waitpid (child, &outcome, 0)) < 0 && errno == EINTR) continue;
  int exit_code = WEXITSTATUS (outcome);
  if (ended < 0) exit_code = access (object, F_OK) != 0; /* SIGCHLD is ignored: there is no exit status */
  if (code != 0 && code != ENOENT && code != EACCES)
    return pw_fail (error, PW_RESOURCE, "cannot run the C compiler \"%s\": %s", word[0], strerror (code));
  if (code == 0 && WIFSIGNALED (outcome)) /* Ctrl-C, or too little memory */
    return pw_fail (error, cmd->log ? PW_STOPPED : PW_RESOURCE, "the C compiler \"%s\" was ended by a signal: %s",
                    word[0], strsignal (WTERMSIG (outcome)));
  if (code != 0 || exit_code == 127)
    return pw_fail (error, PW_INPUT, "cannot run the C compiler \"%s\" that %s%s needs (%s): install %s", word[0],
                    cmd->log ? "specialised code" : "the model file ", cmd->log ? "" : source,
                    code ? strerror (code) : "not found",
                    cmd->for_page ? PW_PAGE_TOOLS : "one, or name another in the environment variable CC");
  if (exit_code != 0 && cmd->log)
    return pw_fail (error, PW_METHOD, "%s does not compile; the messages of %s are in %s", source, word[0], cmd->log);
  if (exit_code != 0)
    return pw_fail (error, PW_INPUT, "the model file %s does not compile; the messages of %s are above", source,
                    word[0]);
  return PW_OK;
}

/* Largest numbers of words: of CC; of options and files. */
enum { BUILD_COMPILER_WORDS = 24, BUILD_OTHER_WORDS = 24 };

/* Adds words to a command line.  Copying their addresses drops `const`: posix_spawnp does not modify the words. */
static void build_add (char **word, int *count, const char *const *more) {
  for (; *more; more++) memcpy (&word[(*count)++], more, sizeof *more);
}

static int build_object (const build_command *cmd, const char *source, const char *object, pw_error *error) {
  char header[PW_PATH], include[PW_PATH], *compiler = strdup (cmd->compiler), *rest = NULL;
  char *word[BUILD_COMPILER_WORDS + BUILD_OTHER_WORDS] = { NULL };
  int words = 0, status = pw_search_header (header, error);
  pw_folder_of (include, header);
  if (status == PW_OK && *header == 0)
    status = pw_fail (error, PW_INPUT,
                      "cannot compile %s: pinwheel.h is not in \"include\", \"../include\" or \"../include/pinwheel\", "
                      "seen from the folder of the program or of its library",
                      source);
  if (status == PW_OK && compiler == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) {
    char *w = strtok_r (compiler, " \t", &rest);
    for (; w && words < BUILD_COMPILER_WORDS; w = strtok_r (NULL, " \t", &rest)) word[words++] = w;
    build_add (word, &words, cmd->options);
    build_add (word, &words, (const char *const[]){ "-I", include, "-o", object, source, NULL });
    build_add (word, &words, cmd->last);
    status =
        w ? pw_fail (error, PW_INPUT, "the C compiler's command in CC has more than %d words", BUILD_COMPILER_WORDS)
          : build_run (cmd, word, source, object, error);
  }
  free (compiler);
  return status;
}

int pw_temporary_folder (char folder[PW_PATH], pw_error *error) {
  const char *tmp = getenv ("TMPDIR");
  if (tmp == NULL || *tmp == 0) tmp = "/tmp";
  if (mkdtemp (pw_path (folder, "%s/pinwheel-XXXXXX", tmp))) return PW_OK; /* mkdtemp gives mode 0700 */
  return pw_fail (error, PW_RESOURCE, "cannot make a temporary folder in %s: %s", tmp, strerror (errno));
}

int pw_processor_lanes (void) {
#if defined __x86_64__
  if (__builtin_cpu_supports ("avx512f") && __builtin_cpu_supports ("avx512dq") && __builtin_cpu_supports ("avx512vl"))
    return 8;
  if (__builtin_cpu_supports ("avx2")) return 4;
#endif
  return 1;
}

/* Without -fno-tree-slp-vectorize, gcc 12.2 would use fused multiply-add (see STRICT in the Makefile). */
#define BUILD_SCENE "-std=c11", "-ffp-contract=off", "-fPIC", "-shared", "-fno-tree-slp-vectorize"
#define BUILD_LANES BUILD_SCENE, "-O3", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd"

const char *const *pw_scene_options (int lanes) {
  static const struct {
    int lanes, processor; /* processor: the least pw_processor_lanes for which the options are valid */
    const char *option[16];
  } known[] = {
    { 0, 4, { BUILD_SCENE, "-O2", "-mavx2" } },
    { 0, 1, { BUILD_SCENE, "-O2" } },
    { 2, 4, { BUILD_LANES, "-DPW_LANES=2", "-mavx" } }, /* not -mavx2: functions of libm on 2 numbers (batch.h) */
    { 2, 1, { BUILD_LANES, "-DPW_LANES=2" } },
    { 4, 4, { BUILD_LANES, "-DPW_LANES=4", "-mavx2" } },
    { 4, 1, { BUILD_LANES, "-DPW_LANES=4" } },
    { 8, 8, { BUILD_LANES, "-DPW_LANES=8", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512" } },
    { 8, 4, { BUILD_LANES, "-DPW_LANES=8", "-mavx2" } },
    { 8, 1, { BUILD_LANES, "-DPW_LANES=8" } },
  };
  int processor = pw_processor_lanes ();
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (known[i].lanes == lanes && known[i].processor <= processor) return known[i].option;
  return NULL;
}

/* Blocks SIGINT (Ctrl-C reaches the compiler, too), SIGTERM and SIGHUP until the caller restores the mask that is
 * stored: pw_compile_file after deleting its temporary files, pw_compile_scene before its caller deletes them. */
static void build_defer (sigset_t *mask) {
  sigset_t stop;
  sigemptyset (&stop);
  sigaddset (&stop, SIGINT);
  sigaddset (&stop, SIGTERM);
  sigaddset (&stop, SIGHUP);
  pthread_sigmask (SIG_BLOCK, &stop, mask);
}

int pw_compile_file (const char *path, const char *engine, pw_object_user *use, void *context, pw_error *error) {
  static const char *const plugin[] = { "-std=c11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", NULL };
  static const char *const page[] = {
    "--target=wasm32-wasi",
    "-mexec-model=reactor",
    "-std=c11",
    "-O2",
    "-ffp-contract=off",
    "-Wl,--gc-sections,--allow-undefined,--strip-all,-z,stack-size=1048576,--whole-archive",
    NULL
  };
  build_command cmd = { .compiler = engine ? "clang" : pw_compiler (),
                        .options = engine ? page : plugin,
                        .last = { engine ? engine : "-lm", engine ? "-Wl,--no-whole-archive" : NULL },
                        .for_page = engine != NULL };
  build_defer (&cmd.mask);
  char folder[PW_PATH], object[PW_PATH];
  int status = pw_temporary_folder (folder, error);
  if (status == PW_OK) {
    status = build_object (&cmd, path, pw_path (object, "%s/object", folder), error);
    if (status == PW_OK) status = use (context, object, error);
    unlink (object);
    rmdir (folder);
  }
  pthread_sigmask (SIG_SETMASK, &cmd.mask, NULL);
  return status;
}

int pw_compile_scene (const char *path, const char *object, const char *log, int lanes, pw_error *error) {
  build_command cmd = {
    .compiler = pw_compiler (), .options = pw_scene_options (lanes), .last = { "-lm" }, .log = log
  };
  build_defer (&cmd.mask);
  int status = build_object (&cmd, path, object, error);
  pthread_sigmask (SIG_SETMASK, &cmd.mask, NULL);
  return status;
}

/* The cache: a folder below XDG_CACHE_HOME or ~/.cache whose files may be deleted at any time.
 *
 * Objects in it are executed, so it is used only if nobody else can write to it. */

enum { CACHE_MAX_BYTES = 64 << 20 };

/* $XDG_CACHE_HOME or $HOME/.cache in the buffer, which is returned; NULL if neither is an absolute path. */
static char *cache_parent (char parent[PW_PATH]) {
  const char *cache = getenv ("XDG_CACHE_HOME"), *home = getenv ("HOME");
  if (cache && *cache == '/') return pw_path (parent, "%s", cache);
  return home && *home == '/' ? pw_path (parent, "%s/.cache", home) : NULL;
}

/* Makes a folder and those above it. */
static void cache_make (char *path) {
  for (char *slash = strchr (path + 1, '/'); slash; slash = strchr (slash + 1, '/')) {
    *slash = 0;
    mkdir (path, 0700);
    *slash = '/';
  }
  mkdir (path, 0700);
}

typedef enum { CACHE_PARENT, CACHE_FOLDER } cache_role;

/* Why a folder cannot be used, or NULL: others can write to it or, if it is the parent, replace what it contains. */
static const char *cache_defect (const char *path, cache_role role) {
  struct stat info;
  if ((role == CACHE_FOLDER ? lstat : stat) (path, &info) != 0) return strerror (errno);
  int by_root = role == CACHE_PARENT && info.st_uid == 0, sticky = role == CACHE_PARENT && info.st_mode & S_ISVTX;
  if (!S_ISDIR (info.st_mode)) return "it is not a folder";
  if (info.st_uid != geteuid () && !by_root) return "it belongs to another user";
  if (info.st_mode & 022 && !sticky) return "others can write to it";
  return role == CACHE_FOLDER && access (path, R_OK | W_OK | X_OK) != 0 ? strerror (errno) : NULL;
}

int pw_cache_folder (char path[PW_PATH], char *notice, size_t size) {
  char parent[PW_PATH];
  if (cache_parent (parent) == NULL) return 0;
  cache_make (pw_path (path, "%s/pinwheel", parent));
  const char *faulty = parent, *defect = cache_defect (parent, CACHE_PARENT);
  if (defect == NULL) defect = cache_defect (faulty = path, CACHE_FOLDER);
  if (defect) snprintf (notice, size, "the cache %s is not used: %s", faulty, defect);
  return defect == NULL;
}

/* The size of all files [bytes]; oldest: the path of the least recently used one, or "". */
static long long cache_size (const char *folder, char oldest[PW_PATH]) {
  long long size = 0;
  struct timespec used = { 0 };
  struct dirent *e;
  DIR *dir = opendir (folder);
  *oldest = 0;
  while (dir && (e = readdir (dir)) != NULL) {
    struct stat info;
    char path[PW_PATH];
    pw_path (path, "%s/%s", folder, e->d_name);
    if (e->d_name[0] == '.' || lstat (path, &info) != 0 || !S_ISREG (info.st_mode)) continue;
    const struct timespec *t = &info.st_mtim;
    size += info.st_size;
    if (*oldest && (t->tv_sec > used.tv_sec || (t->tv_sec == used.tv_sec && t->tv_nsec >= used.tv_nsec))) continue;
    strcpy (oldest, path);
    used = *t;
  }
  if (dir) closedir (dir);
  return size;
}

void pw_cache_trim (const char *folder) {
  char oldest[PW_PATH];
  while (cache_size (folder, oldest) > CACHE_MAX_BYTES && (unlink (oldest) == 0 || errno == ENOENT)) continue;
}

/* Specialised code: loads the compiled object from the cache, or compiles it.
 *
 * A file KEY.so in the cache is the object, then its source and a checksum; it is loaded if these are as expected.
 * KEY.c is locked while it is compiled, and deleted afterwards; if it does not compile, it is kept, with the messages
 * in KEY.log. */

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
