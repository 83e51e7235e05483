/* Model files and compiled code: finds, compiles and loads models, collects the files of interactive pages, and
 * compiles, caches and loads specialised scenes. */
#define _GNU_SOURCE /* dladdr1 */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include "yaml.h"

#define PAGE_TOOLS "clang, lld, wasi-libc and libclang-rt-14-dev-wasm32 (make deps TOOLS=page)"

static int ends_with (const char *name, const char *ending) {
  size_t n = strlen (name), e = strlen (ending);
  return n > e && strcmp (name + n - e, ending) == 0;
}

/* ---- The search path ----
 *
 * Models are in the folders of PINWHEEL_MODELS, then in those of the running program and of this library.  Folders
 * next to the program, or one level up (tests), serve the build tree; ../lib and ../include serve an installation; the
 * folder of the library serves programs installed elsewhere.  The order of the folders decides only about headers and
 * pages, of which the first is taken: a name that two models have is refused. */

static int search_no_memory (pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "out of memory while looking for models");
}

/* Folders relative to that of the running program, then to that of this library. */
enum { SEARCH_FOLDERS = 6 };
typedef char search_places[SEARCH_FOLDERS][PW_PATH];

/* Stores these folders, which need not exist; "" if the folder that they are relative to is unknown. */
static int search_find_places (const char *const where[SEARCH_FOLDERS], search_places place, pw_error *error) {
  static const char here = 0; /* an address inside this library */
  char anchor[2][PW_PATH];
  Dl_info info;
  struct link_map *object = NULL;
  ssize_t n = readlink ("/proc/self/exe", anchor[0], PATH_MAX - 1);
  anchor[0][n > 0 ? n : 0] = 0;
  /* l_name is "" if the program contains the library */
  const char *library = dladdr1 (&here, &info, (void **)&object, RTLD_DL_LINKMAP) ? object->l_name : NULL;
  if (library && (library = realpath (library, anchor[1])) == NULL && errno == ENOMEM) return search_no_memory (error);
  if (library == NULL) *anchor[1] = 0;
  for (int i = 0; i < SEARCH_FOLDERS; i++) {
    const char *path = anchor[i / 3], *slash = strrchr (path, '/');
    *place[i] = 0;
    if (slash) pw_path (place[i], "%.*s/%s", (int)(slash - path), path, where[i]);
  }
  return PW_OK;
}

/* Stores the path of the first of the files of this name that can be read; "" if there is none. */
static int search_file (const char *const where[SEARCH_FOLDERS], const char *file, char path[PW_PATH],
                        pw_error *error) {
  search_places place;
  int status = search_find_places (where, place, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (*place[i] && access (pw_path (path, "%s/%s", place[i], file), R_OK) == 0) return PW_OK;
  *path = 0;
  return status;
}

static int search_header (char path[PW_PATH], pw_error *error) {
  static const char *const where[] = { "include", "../include", "../include/pinwheel",
                                       "include", "../include", "../include/pinwheel" };
  return search_file (where, "pinwheel.h", path, error);
}

typedef struct {
  char *name; /* "ezyroller" */
  char *path; /* of the file itself, links resolved */
} search_found;

/* All .so and .yaml files on the search path, sorted by name, then by path. */
typedef struct {
  pw_arena arena;
  search_found *found;
  int count;
  size_t room;       /* entries of `found` allocated */
  char folders[400]; /* the folders searched, links resolved, for messages: "/first:/second", as many as fit */
  char unread[160];  /* folders of PINWHEEL_MODELS that cannot be searched: "/nowhere (No such file or directory)" */
} search;

/* Adds a file of a folder, if it is a model, unless it is in the list already. */
static int search_entry (search *s, const char *folder, const char *entry, pw_error *error) {
  const char *ending = ends_with (entry, ".so") ? ".so" : ends_with (entry, ".yaml") ? ".yaml" : NULL;
  char path[PW_PATH], real[PW_PATH], name[PW_PATH];
  struct stat info;
  if (ending == NULL || entry[0] == '.' || !pw_is_line (entry)) return PW_OK;
  if (realpath (pw_path (path, "%s/%s", folder, entry), real) == NULL)
    return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  if (stat (real, &info) != 0 || !S_ISREG (info.st_mode)) return PW_OK;
  pw_path (name, "%.*s", (int)(strlen (entry) - strlen (ending)), entry);
  for (const search_found *f = s->found, *end = f + s->count; f < end; f++)
    if (strcmp (f->path, real) == 0 && strcmp (f->name, name) == 0) return PW_OK;
  if (pw_grow (&s->found, (size_t)s->count, &s->room, sizeof *s->found) != PW_OK) return search_no_memory (error);
  search_found f = { pw_arena_copy (&s->arena, name), pw_arena_copy (&s->arena, real) };
  if (f.name == NULL || f.path == NULL) return search_no_memory (error);
  s->found[s->count++] = f;
  return PW_OK;
}

/* Adds the models in a folder; skips missing and inaccessible folders, as shells do with PATH. */
static int search_folder (search *s, const char *folder, pw_error *error) {
  char real[PW_PATH];
  if (realpath (folder, real) == NULL) return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  size_t used = strlen (s->folders);
  const char *listed = PW_PRINTED (sizeof s->folders + 2, ":%s:", s->folders);
  if (used + strlen (real) + 2 <= sizeof s->folders && strstr (listed, PW_PRINTED (PW_PATH + 2, ":%s:", real)) == NULL)
    sprintf (s->folders + used, "%s%s", used ? ":" : "", real);
  DIR *dir = opendir (folder);
  if (dir == NULL && pw_open_input_status () == PW_RESOURCE)
    return pw_fail (error, PW_RESOURCE, "cannot look into the folder %s: %s", folder, strerror (errno));
  if (dir == NULL) return PW_OK;
  int status = PW_OK;
  struct dirent *entry;
  while (status == PW_OK && (entry = readdir (dir)) != NULL) status = search_entry (s, folder, entry->d_name, error);
  closedir (dir);
  return status;
}

static int search_environment (search *s, pw_error *error) {
  const char *list = getenv ("PINWHEEL_MODELS");
  if (list == NULL) return PW_OK;
  char *copy = strdup (list), *rest = copy, *folder, inside[PW_PATH];
  if (copy == NULL) return search_no_memory (error);
  int status = PW_OK;
  while (status == PW_OK && (folder = strsep (&rest, ":")) != NULL) {
    size_t used = strlen (s->unread);
    if (*folder == 0) continue;
    if (access (pw_path (inside, "%s/.", folder), R_OK | X_OK) == 0)
      status = search_folder (s, folder, error);
    else
      snprintf (s->unread + used, sizeof s->unread - used, "%s%.80s (%s)", used ? ", " : "", folder, strerror (errno));
  }
  free (copy);
  return status;
}

static int search_order (const void *a, const void *b) {
  const search_found *f = a, *g = b;
  int names = strcmp (f->name, g->name);
  return names ? names : strcmp (f->path, g->path);
}

/* Searches every folder of the search path.  Close in every case. */
static int search_open (search *s, pw_error *error) {
  static const char *const where[] = { "models", "../models", "../lib/pinwheel/models",
                                       "models", "../models", "pinwheel/models" };
  search_places place;
  *s = (search){ .count = 0 };
  int status = search_environment (s, error);
  if (status == PW_OK) status = search_find_places (where, place, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (*place[i]) status = search_folder (s, place[i], error);
  if (s->count > 1) qsort (s->found, (size_t)s->count, sizeof *s->found, search_order);
  return status;
}

static void search_close (search *s) {
  pw_arena_free (&s->arena);
  free (s->found);
}

/* ---- Compilers, which run without a shell ---- */

extern char **environ;

typedef struct {
  const char *compiler;       /* one or more words ("ccache gcc") */
  const char *const *options; /* ends with NULL, as does `last` */
  const char *last[3];        /* options and files after the name of the source */
  int for_page;               /* 1: compiles to WebAssembly */
  const char *log;            /* generated code: the file that gets its messages; NULL: a model file */
  sigset_t mask;              /* signals blocked before build_defer, and in the compiler */
} build_command;

/* The command of the C compiler: CC in the environment, else "cc". */
static const char *build_compiler (void) {
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
                    cmd->log ? "specialised code" : "the file ", cmd->log ? "" : source,
                    code ? strerror (code) : "not found",
                    cmd->for_page ? PAGE_TOOLS : "one, or name another in the environment variable CC");
  if (exit_code != 0 && cmd->log)
    return pw_fail (error, PW_METHOD, "%s does not compile; the messages of %s are in %s", source, word[0], cmd->log);
  if (exit_code != 0)
    return pw_fail (error, PW_INPUT, "%s does not compile; the messages of %s are above", source, word[0]);
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
  int words = 0, status = search_header (header, error);
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

/* Makes a new folder in TMPDIR that only the user can use. */
static int temporary_folder (char folder[PW_PATH], pw_error *error) {
  const char *tmp = getenv ("TMPDIR");
  if (tmp == NULL || *tmp == 0) tmp = "/tmp";
  if (mkdtemp (pw_path (folder, "%s/pinwheel-XXXXXX", tmp))) return PW_OK; /* mkdtemp gives mode 0700 */
  return pw_fail (error, PW_RESOURCE, "cannot make a temporary folder in %s: %s", tmp, strerror (errno));
}

/* Blocks SIGINT (Ctrl-C reaches the compiler, too), SIGTERM and SIGHUP until the caller restores the mask that is
 * stored. */
static void build_defer (sigset_t *mask) {
  sigset_t stop;
  sigemptyset (&stop);
  sigaddset (&stop, SIGINT);
  sigaddset (&stop, SIGTERM);
  sigaddset (&stop, SIGHUP);
  pthread_sigmask (SIG_BLOCK, &stop, mask);
}

/* What is done with the compiled object at a path; it is deleted afterwards. */
typedef int build_user (void *context, const char *object, pw_error *error);

/* Compiles a model in C to a shared object or, unless `engine` is NULL, to WebAssembly linked with that archive, in a
 * private temporary folder; returns what `use` returns for the result. */
static int build_file (const char *path, const char *engine, build_user *use, void *context, pw_error *error) {
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
  build_command cmd = { .compiler = engine ? "clang" : build_compiler (),
                        .options = engine ? page : plugin,
                        .last = { engine ? engine : "-lm", engine ? "-Wl,--no-whole-archive" : NULL },
                        .for_page = engine != NULL };
  build_defer (&cmd.mask);
  char folder[PW_PATH], object[PW_PATH];
  int status = temporary_folder (folder, error);
  if (status == PW_OK) {
    status = build_object (&cmd, path, pw_path (object, "%s/object", folder), error);
    if (status == PW_OK && engine) { /* without gzip the object stays as it is */
      char packed[PW_PATH], *const gzip[] = { "gzip", "-9n", object, NULL };
      if (build_run (&cmd, gzip, path, pw_path (packed, "%s.gz", object), &(pw_error){ 0 }) == PW_OK)
        rename (packed, object);
    }
    if (status == PW_OK) status = use (context, object, error);
    unlink (object);
    rmdir (folder);
  }
  pthread_sigmask (SIG_SETMASK, &cmd.mask, NULL);
  return status;
}

/* ---- Models ---- */

struct pw_file {
  char name[PW_PATH], path[PW_PATH]; /* the name without its ending; the path with links resolved */
  void *handle;                      /* of dlopen; NULL for a text model */
  pw_yaml *yaml;                     /* the text model; NULL for a plug-in */
  const pw_plugin_table *table;
};

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
    return pw_fail (error, PW_INPUT,
                    "%s is not a Pinwheel model: a model file ends with PW_MODEL (...), one of integration methods "
                    "with PW_METHOD_FILE (...)",
                    f->path);
  return pw_plugin_check (f->table, f->path, error);
}

static const char *const model_endings[] = { ".so", ".c", ".yaml" };
enum { MODEL_SO, MODEL_C, MODEL_YAML, MODEL_ENDINGS };

/* The ending of a name; MODEL_ENDINGS if it is none of these. */
static int model_ending (const char *name) {
  int i = 0;
  while (i < MODEL_ENDINGS && !ends_with (name, model_endings[i])) i++;
  return i;
}

static int model_is_cpp (const char *name) {
  return ends_with (name, ".cpp") || ends_with (name, ".cc") || ends_with (name, ".cxx") || ends_with (name, ".C");
}

/* Opens the file at f->path, which exists; messages about the contents of a text model, of at most `max_bytes` bytes,
 * begin with `shown`. */
static int model_open_path (pw_file *f, const char *shown, size_t max_bytes, pw_error *error) {
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
    f->yaml = pw_yaml_open (f->path, shown, max_bytes, error);
    if (f->yaml) f->table = &f->yaml->table;
    return f->yaml ? PW_OK : error->status;
  }
  return ending == MODEL_C ? build_file (f->path, NULL, model_load, f, error) : model_load (f, f->path, error);
}

static int model_find_path (pw_file *f, const char *path, pw_error *error) {
  struct stat info;
  if (realpath (path, f->path) == NULL)
    return pw_fail (error, errno == ENOMEM ? PW_RESOURCE : PW_INPUT, "cannot open %s: %s", path, strerror (errno));
  if (stat (f->path, &info) == 0 && !S_ISREG (info.st_mode))
    return pw_fail (error, PW_INPUT, "cannot open %s: %s", path, pw_not_regular (info.st_mode));
  return PW_OK;
}

/* Reports an unknown name; suggests a path if the current directory has such a file, else the nearest name. */
static int model_unknown (const search *s, const char *name, pw_error *error) {
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
  search s;
  int status = search_open (&s, error), first = 0;
  while (first < s.count && strcmp (s.found[first].name, name) != 0) first++;
  const search_found *found = first < s.count ? &s.found[first] : NULL;
  if (status == PW_OK && found == NULL)
    status = model_unknown (&s, name, error);
  else if (status == PW_OK && first + 1 < s.count && strcmp (found[1].name, name) == 0)
    status = pw_fail (error, PW_INPUT, "several files match \"%s\", such as %s and %s; name the model by its path",
                      name, found[0].path, found[1].path);
  else if (status == PW_OK)
    pw_path (f->path, "%s", found->path);
  search_close (&s);
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
  if (max_bytes > PW_FILE_MAX_BYTES) max_bytes = PW_FILE_MAX_BYTES;
  if (model_open_path (f, shown, max_bytes, why) == PW_OK) return f;
  pw_file_close (f);
  return NULL;
}

void pw_file_close (pw_file *f) {
  if (f == NULL) return;
  if (f->handle) dlclose (f->handle);
  pw_yaml_close (f->yaml);
  free (f);
}

pw_model *pw_file_model (const pw_file *f, pw_error *error) {
  return pw_require (f, "a model file", error) == PW_OK ? pw_model_new (f->name, f->table, error) : NULL;
}

const pw_plugin_table *pw_file_table (const pw_file *f) {
  return f ? f->table : NULL;
}

const char *pw_file_name (const pw_file *f) {
  return f ? f->name : NULL;
}

const char *pw_file_path (const pw_file *f) {
  return f ? f->path : NULL;
}

const char *pw_file_included_parameter (const pw_file *f, const char *name) {
  return f && f->yaml ? pw_yaml_included_parameter (f->yaml->root, name) : NULL;
}

int pw_file_tables (const pw_file *f, int (*each) (void *context, const char *path), void *context) {
  return f && f->yaml ? pw_yaml_tables (f->yaml, 1, each, context) : 0;
}

int pw_file_list (int (*each) (void *context, const char *name, const char *path), void *context, pw_error *error) {
  search s;
  if (each == NULL) return pw_fail (error, PW_INPUT, "a function for each model is missing");
  int status = search_open (&s, error);
  for (int i = 0; status == PW_OK && i < s.count; i++)
    if (each (context, s.found[i].name, s.found[i].path) != 0) break;
  search_close (&s);
  return status;
}

/* ---- Interactive pages: the engine, packed by gzip; for a text model also its text, tree and tables ---- */

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
  static const char *const where[] = { "page", "../page", "../lib/pinwheel/page", "page", "../page", "pinwheel/page" };
  char path[PW_PATH];
  int status = search_file (where, source ? "pinwheel-page.objects" : "pinwheel.wasm.gz", path, error);
  if (status == PW_OK && *path == 0)
    status = pw_fail (error, PW_INPUT,
                      "this Pinwheel was built without the engine of interactive pages: install %s and build it again",
                      PAGE_TOOLS);
  if (status == PW_OK)
    status = source ? build_file (source, path, page_use_engine, p, error) : page_read (p, "engine", path, error);
  return status;
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

static int page_text (pw_page *p, const pw_file *f, pw_error *error) {
  const pw_yaml *y = f->yaml;
  page_tables x = { p, (size_t)(strrchr (f->path, '/') - f->path) + 1, error };
  pw_stream tree;
  if (y->size > PAGE_MAX_BYTES)
    return pw_fail (error, PW_INPUT, "%s: a page takes a model of at most %d MB", f->path, PAGE_MAX_BYTES >> 20);
  char *source = malloc (y->size + 1); /* not of the file, which may have changed since */
  int status = page_add (p, "model", source ? memcpy (source, y->source, y->size + 1) : NULL, y->size, error);
  FILE *to = pw_stream_open (&tree);
  if (to) pw_yaml_write_tree (y, to);
  pw_stream_close (to, &tree);
  if (page_add (p, "tree", tree.text, tree.size, error) != PW_OK || status != PW_OK) return PW_RESOURCE;
  status = pw_yaml_tables (y, 0, page_table, &x);
  return status == PW_OK ? PW_OK : pw_fail (error, status, "out of memory"); /* or the reason already recorded */
}

int pw_page_open (pw_page *p, const pw_file *f, pw_error *error) {
  *p = (pw_page){ .files = 0 };
  if (pw_require (f, "a model file", error) != PW_OK) return PW_INPUT;
  if (f->yaml == NULL && !ends_with (f->path, ".c"))
    return pw_fail (error, PW_INPUT,
                    "%s: a page contains the model compiled for browsers: name its source, a .c file; "
                    "those of the gallery are installed in share/doc/pinwheel/examples",
                    f->path);
  int status = page_engine (p, f->yaml ? NULL : f->path, error);
  return status == PW_OK && f->yaml ? page_text (p, f, error) : status;
}

void pw_page_close (pw_page *p) {
  for (int i = 0; i < p->files; i++) {
    free (p->file[i].name);
    free (p->file[i].bytes);
  }
  free (p->file);
}

/* ---- Specialised scenes ---- */

int pw_processor_lanes (void) {
#if defined __x86_64__
  if (__builtin_cpu_supports ("avx512f") && __builtin_cpu_supports ("avx512dq") && __builtin_cpu_supports ("avx512vl"))
    return 8;
  if (__builtin_cpu_supports ("avx2")) return 4;
#endif
  return 1;
}

/* Without -fno-tree-slp-vectorize, gcc 12.2 would use fused multiply-add (see STRICT in the Makefile). */
#define CODE_OPTIONS                                                                                        \
  "-std=c11", "-ffp-contract=off", "-fPIC", "-shared", "-fno-tree-slp-vectorize", "-O3", "-fno-math-errno", \
      "-fno-trapping-math"
#define CODE_LANES CODE_OPTIONS, "-fopenmp-simd"

/* The compiler's options for generated code, ending with NULL: vector instructions of this processor, no fused
 * multiply-add, so that results have the same bits.  NULL: no code advances this number of runs. */
static const char *const *code_options (int lanes) {
  static const struct {
    int lanes, processor; /* processor: the least pw_processor_lanes for which the options are valid */
    const char *option[16];
  } known[] = {
    { 0, 4, { CODE_OPTIONS, "-mavx2" } },
    { 0, 1, { CODE_OPTIONS } },
    { 2, 4, { CODE_LANES, "-DPW_LANES=2", "-mavx" } }, /* not -mavx2: functions of libm on 2 numbers (batch.h) */
    { 2, 1, { CODE_LANES, "-DPW_LANES=2" } },
    { 4, 4, { CODE_LANES, "-DPW_LANES=4", "-mavx2" } },
    { 4, 1, { CODE_LANES, "-DPW_LANES=4" } },
    { 8, 8, { CODE_LANES, "-DPW_LANES=8", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512" } },
    { 8, 4, { CODE_LANES, "-DPW_LANES=8", "-mavx2" } },
    { 8, 1, { CODE_LANES, "-DPW_LANES=8" } },
  };
  int processor = pw_processor_lanes ();
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (known[i].lanes == lanes && known[i].processor <= processor) return known[i].option;
  return NULL;
}

/* ---- The cache ----
 *
 * A folder below XDG_CACHE_HOME or ~/.cache whose files may be deleted at any time.  Objects in it are executed, so it
 * is used only if nobody else can write to it. */

enum { CACHE_MAX_BYTES = 64 << 20 };

/* $XDG_CACHE_HOME or $HOME/.cache in the buffer, which is returned; NULL if neither is an absolute path. */
static char *cache_parent (char parent[PW_PATH]) {
  const char *cache = getenv ("XDG_CACHE_HOME"), *home = getenv ("HOME");
  if (cache && *cache == '/') return pw_path (parent, "%s", cache);
  return home && *home == '/' ? pw_path (parent, "%s/.cache", home) : NULL;
}

/* Why a folder cannot be used, or NULL: others can write to it or, if it is the parent, replace what it contains. */
static const char *cache_defect (const char *path, int is_parent) {
  struct stat info;
  if ((is_parent ? stat : lstat) (path, &info) != 0) return strerror (errno);
  int by_root = is_parent && info.st_uid == 0, sticky = is_parent && info.st_mode & S_ISVTX;
  if (!S_ISDIR (info.st_mode)) return "it is not a folder";
  if (info.st_uid != geteuid () && !by_root) return "it belongs to another user";
  if (info.st_mode & 022 && !sticky) return "others can write to it";
  return !is_parent && access (path, R_OK | W_OK | X_OK) != 0 ? strerror (errno) : NULL;
}

/* Stores the path of the cache's folder, which is created if it does not exist; 0 if there is none, with a notice in
 * the buffer (otherwise unchanged) if one exists but others could have written to it, or it is unusable. */
static int cache_folder (char path[PW_PATH], char *notice, size_t size) {
  char parent[PW_PATH];
  if (cache_parent (parent) == NULL) return 0;
  pw_path (path, "%s/pinwheel", parent);
  for (char *slash = strchr (path + 1, '/'); slash; slash = strchr (slash + 1, '/')) { /* the folders above it */
    *slash = 0;
    mkdir (path, 0700);
    *slash = '/';
  }
  mkdir (path, 0700);
  const char *faulty = parent, *defect = cache_defect (parent, 1);
  if (defect == NULL) defect = cache_defect (faulty = path, 0);
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

/* ---- Code of scenes ----
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

/* The specialised code to load: its source, and the paths of its files. */
typedef struct {
  const pw_system *system;
  int lanes;        /* 0: for single runs */
  pw_stream source; /* ends with comments on what else determines the object */
  char key[17];     /* checksum of the source, in hexadecimal */
  /* paths: KEY.c, KEY.log, the object while written, KEY.so */
  char folder[PW_PATH], c_file[PW_PATH], log[PW_PATH], part[PW_PATH], object[PW_PATH];
  pw_scene_code *code; /* the result */
} code_job;

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

/* Stores a text as the source, followed by version, options, compiler and checksum of pinwheel.h, and its key. */
static int code_source (code_job *x, const char *text, pw_error *error) {
  char header[PW_PATH], *bytes = NULL, *compiler = strdup (build_compiler ());
  size_t size;
  int status = search_header (header, error);
  FILE *f = pw_stream_open (&x->source);
  if (f && compiler) {
    fprintf (f, "%s\n// pinwheel " PW_VERSION "\n", text);
    for (const char *const *o = code_options (x->lanes); *o; o++) fprintf (f, "// %s\n", *o);
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
  build_command cmd = {
    .compiler = build_compiler (), .options = code_options (x->lanes), .last = { "-lm" }, .log = x->log
  };
  int status = PW_OK;
  if (dprintf (file, "%s", x->source.text) < 0)
    status = pw_fail (error, PW_RESOURCE, "cannot write %s: %s", x->c_file, strerror (errno));
  build_defer (&cmd.mask);
  if (status == PW_OK) status = build_object (&cmd, x->c_file, x->part, error);
  pthread_sigmask (SIG_SETMASK, &cmd.mask, NULL);
  int keep = status == PW_METHOD;
  if (status == PW_OK) status = code_complete (x, error);
  if (status == PW_OK && (status = code_load (x, error)) != PW_OK) unlink (x->object);
  unlink (x->part);
  if (!keep) unlink (x->c_file), unlink (x->log);
  return status;
}

/* Compiles in the folder, unless another process has done so meanwhile. */
static int code_make (code_job *x, pw_error *error) {
  const struct timespec pause = { .tv_nsec = 20000000 };
  int file, waits = 0;
  while ((file = pw_lock_file (x->c_file, PW_LOCK_NEW)) < 0 && errno == EWOULDBLOCK && waits++ < CODE_MAX_WAITS)
    nanosleep (&pause, NULL);
  if (file < 0) return pw_fail (error, PW_RESOURCE, "cannot write into %s", x->folder);
  int status = code_load_cached (x);
  if (status == PW_OK)
    unlink (x->c_file);
  else
    status = code_compile (x, file, error);
  close (file);
  return status;
}

/* Loads the object from the cache, or compiles it there.  Uses a temporary folder if there is no cache, or after a
 * failure that it may have caused, as by the deletion of KEY.c. */
static int code_open (code_job *x, pw_error *error) {
  pw_error cause = { 0 };
  if (cache_folder (x->folder, x->code->notice, sizeof x->code->notice)) {
    code_paths (x);
    if (code_load_cached (x) == PW_OK) return PW_OK;
    int status = code_make (x, &cause);
    if (status == PW_OK) { /* the least recently used files are deleted; each use sets st_mtime */
      char oldest[PW_PATH];
      while (cache_size (x->folder, oldest) > CACHE_MAX_BYTES && (unlink (oldest) == 0 || errno == ENOENT)) continue;
      return PW_OK;
    }
    if (status == PW_STOPPED || (status == PW_METHOD && access (x->c_file, F_OK) == 0))
      return pw_fail (error, status, "%s", cause.text);
  }
  if (temporary_folder (x->folder, error) != PW_OK) return PW_RESOURCE;
  code_paths (x);
  int status = code_make (x, error);
  unlink (x->object);
  rmdir (x->folder); /* unless it keeps KEY.c */
  return status;
}

pw_scene_code *pw_scene_lanes_open (const char *text, const pw_system *s, int lanes, pw_error *error) {
  if (pw_require (text, "specialised code", error) != PW_OK || pw_require (s, "a system", error) != PW_OK) return NULL;
  if (code_options (lanes) == NULL)
    return pw_fail (error, PW_INPUT, "%d runs at once: expected 2, 4 or %d", lanes, PW_LANES_MOST), NULL;
  code_job x = { .system = s, .lanes = lanes, .code = calloc (1, sizeof *x.code) };
  int status = x.code ? code_source (&x, text, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = code_open (&x, error);
  free (x.source.text);
  if (status == PW_OK) return x.code;
  free (x.code);
  return NULL;
}

int pw_scene_lanes_cached (const char *text, int lanes) {
  code_job x = { .lanes = lanes };
  char notice[PW_PATH + 600];
  int cached = text && code_options (lanes) && code_source (&x, text, NULL) == PW_OK &&
               cache_folder (x.folder, notice, sizeof notice);
  if (cached) code_paths (&x), cached = access (x.object, R_OK) == 0;
  free (x.source.text);
  return cached;
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
