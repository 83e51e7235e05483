/* Compiles C to a shared object: runs the user's compiler without a shell, in a folder that only the user can write
 * to. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "files.h"

extern char **environ;

enum { BUILD_WORDS = 48 };

/* The command line: the words of a compiler's command, then our options. */
typedef struct {
  char *text; /* a copy of the command, split into words */
  char *word[BUILD_WORDS];
} build_command;

const char *pw_compiler (void) {
  const char *cc = getenv ("CC");
  return cc && cc[strspn (cc, " \t")] ? cc : "cc";
}

/* Splits the compiler's command into at most half of the words ("ccache gcc"), and adds our options with their final NULL. */
static int build_words (build_command *c, const char *compiler, const char *const *options) {
  char *rest = NULL;
  int words = 0;
  c->text = strdup (compiler);
  if (c->text == NULL) return PW_RESOURCE;
  for (char *w = strtok_r (c->text, " \t", &rest); w && words < BUILD_WORDS / 2; w = strtok_r (NULL, " \t", &rest))
    c->word[words++] = w;
  do memcpy (&c->word[words++], options, sizeof *options);
  while (*options++);
  return PW_OK;
}

/* Starts the compiler with its messages on standard error, or in a log, and default signal handling. */
static int build_spawn (const build_command *c, const char *log, const sigset_t *before, pid_t *child) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  sigset_t pipe;
  sigemptyset (&pipe);
  sigaddset (&pipe, SIGPIPE);
  int code = posix_spawn_file_actions_init (&files);
  if (code) return code;
  code = posix_spawnattr_init (&attributes);
  if (code == 0) {
    if (log)
      code = posix_spawn_file_actions_addopen (&files, STDERR_FILENO, log, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW,
                                               0600);
    if (code == 0) code = posix_spawn_file_actions_adddup2 (&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawnattr_setsigmask (&attributes, before);
    posix_spawnattr_setsigdefault (&attributes, &pipe);
    posix_spawnattr_setflags (&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    if (code == 0) code = posix_spawnp (child, c->word[0], &files, &attributes, c->word, environ);
    posix_spawnattr_destroy (&attributes);
  }
  posix_spawn_file_actions_destroy (&files);
  return code;
}

static int build_run (const build_command *c, const char *source, const char *log, const sigset_t *before,
                      pw_error *error) {
  pid_t child;
  int outcome = 0, code = build_spawn (c, log, before, &child);
  while (code == 0 && waitpid (child, &outcome, 0) < 0)
    if (errno != EINTR) code = errno;
  if (code != 0 && code != ENOENT && code != EACCES)
    return pw_fail (error, PW_RESOURCE, "cannot run the C compiler \"%s\": %s", c->word[0], strerror (code));
  if (code != 0 || (WIFEXITED (outcome) && WEXITSTATUS (outcome) == 127))
    return pw_fail (
        error, PW_INPUT, "cannot run the C compiler \"%s\" that %s%s needs (%s): install %s", c->word[0],
        log ? "specialised code" : "the model file ", log ? "" : source, code ? strerror (code) : "not found",
        strcmp (c->word[0], "clang") ? "one, or name another in the environment variable CC" : PW_PAGE_TOOLS);
  if ((!WIFEXITED (outcome) || WEXITSTATUS (outcome) != 0) && log)
    return pw_fail (error, PW_METHOD, "%s does not compile; the messages of %s are in %s", source, c->word[0], log);
  if (!WIFEXITED (outcome) || WEXITSTATUS (outcome) != 0)
    return pw_fail (error, PW_INPUT, "the model file %s does not compile; the messages of %s are above", source,
                    c->word[0]);
  return PW_OK;
}

char *pw_temporary_folder (pw_error *error) {
  const char *tmp = getenv ("TMPDIR");
  if (tmp == NULL || *tmp == 0) tmp = "/tmp";
  char *folder = pw_path_join (tmp, "pinwheel-XXXXXX", "");
  if (folder && mkdtemp (folder)) return folder; /* mkdtemp gives mode 0700 */
  pw_fail (error, PW_RESOURCE, "cannot make a temporary folder in %s: %s", tmp, strerror (errno));
  free (folder);
  return NULL;
}

static int build_object (const char *path, const char *compiler, const char *const *options, const char *log,
                         const sigset_t *before, pw_error *error) {
  build_command c = { .text = NULL };
  int status = build_words (&c, compiler, options);
  if (status == PW_OK)
    status = build_run (&c, path, log, before, error);
  else
    pw_fail (error, status, "out of memory");
  free (c.text);
  return status;
}

/* The folder of pinwheel.h, malloced. */
static int build_include (const char *path, char **include, pw_error *error) {
  int status = pw_search_include (include, error);
  if (status != PW_OK || *include) return status;
  return pw_fail (error, PW_INPUT,
                  "cannot compile %s: pinwheel.h is neither in \"include\" next to the program nor in "
                  "\"../include/pinwheel\"",
                  path);
}

int pw_processor_lanes (void) {
#if defined __x86_64__ && !defined __clang_analyzer__
  if (__builtin_cpu_supports ("avx512f") && __builtin_cpu_supports ("avx512dq") && __builtin_cpu_supports ("avx512vl"))
    return 8;
  if (__builtin_cpu_supports ("avx2")) return 4;
#endif
  return 1;
}

/* gcc 12.2 fuses operations when it vectorises straight code, see the Makefile. */
#define BUILD_SCENE "-std=c11", "-ffp-contract=off", "-fPIC", "-shared", "-fno-tree-slp-vectorize"
#define BUILD_LANES BUILD_SCENE, "-O3", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd"

const char *const *pw_scene_options (int lanes) {
  static const char *const one[] = { BUILD_SCENE, "-O2", NULL };
  static const char *const two[] = { BUILD_LANES, "-DPW_LANES=2", NULL };
#ifdef __x86_64__
  static const char *const one_avx2[] = { BUILD_SCENE, "-O2", "-mavx2", NULL };
  static const char *const two_avx[] = { BUILD_LANES, "-DPW_LANES=2", "-mavx", NULL };
  static const char *const four[] = { BUILD_LANES, "-DPW_LANES=4", "-mavx2", NULL };
  static const char *const eight[] = { BUILD_LANES,  "-DPW_LANES=8", "-mavx512f",
                                       "-mavx512dq", "-mavx512vl",   "-mprefer-vector-width=512",
                                       NULL };
  static const char *const eight_avx2[] = { BUILD_LANES, "-DPW_LANES=8", "-mavx2", NULL };
  if (pw_processor_lanes () >= 4)
    return lanes == 0                   ? one_avx2
           : lanes == 2                 ? two_avx
           : lanes == 4                 ? four
           : pw_processor_lanes () == 8 ? eight
                                        : eight_avx2;
#endif
  static const char *const four_any[] = { BUILD_LANES, "-DPW_LANES=4", NULL };
  static const char *const eight_any[] = { BUILD_LANES, "-DPW_LANES=8", NULL };
  return lanes == 0 ? one : lanes == 2 ? two : lanes == 4 ? four_any : eight_any;
}

/* Compiles generated code if there is a log, else a plug-in. */
static int build_shared (const char *path, const char *object, const char *log, int lanes, const sigset_t *before,
                         pw_error *error) {
  static const char *const plugin[] = { "-std=c11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", NULL };
  char *include = NULL;
  int status = build_include (path, &include, error), n = 0;
  const char *options[BUILD_WORDS / 2 + 1];
  for (const char *const *o = log ? pw_scene_options (lanes) : plugin; *o; o++) options[n++] = *o;
  const char *const rest[] = { "-I", include, "-o", object, path, "-lm", NULL };
  memcpy (options + n, rest, sizeof rest);
  if (status == PW_OK) status = build_object (path, pw_compiler (), options, log, before, error);
  free (include);
  return status;
}

static int build_page (const char *path, const char *engine, const char *object, const sigset_t *before,
                       pw_error *error) {
  char *include = NULL;
  int status = build_include (path, &include, error);
  const char *const options[] = {
    "--target=wasm32-wasi",
    "-mexec-model=reactor",
    "-std=c11",
    "-O2",
    "-ffp-contract=off",
    "-Wl,--gc-sections,--allow-undefined,--strip-all,-z,stack-size=1048576,--whole-archive",
    "-I",
    include,
    "-o",
    object,
    path,
    engine,
    "-Wl,--no-whole-archive",
    NULL
  };
  if (status == PW_OK) status = build_object (path, "clang", options, NULL, before, error);
  free (include);
  return status;
}

/* Defers Ctrl-C, which also reaches the compiler, until the caller's files are removed. */
static void build_defer (sigset_t *before) {
  sigset_t stop;
  sigemptyset (&stop);
  sigaddset (&stop, SIGINT);
  sigaddset (&stop, SIGTERM);
  sigaddset (&stop, SIGHUP);
  pthread_sigmask (SIG_BLOCK, &stop, before);
}

int pw_compile_file (const char *path, const char *engine, pw_object_user *use, void *context, pw_error *error) {
  sigset_t before;
  build_defer (&before);
  char *folder = pw_temporary_folder (error), *object = folder ? pw_path_join (folder, "model.so", "") : NULL;
  int status = !folder   ? PW_RESOURCE
               : !object ? pw_fail (error, PW_RESOURCE, "out of memory")
               : engine  ? build_page (path, engine, object, &before, error)
                         : build_shared (path, object, NULL, 0, &before, error);
  if (status == PW_OK) status = use (context, object, error);
  if (object) unlink (object);
  if (folder) rmdir (folder);
  free (object);
  free (folder);
  pthread_sigmask (SIG_SETMASK, &before, NULL);
  return status;
}

int pw_compile_scene (const char *path, const char *object, const char *log, int lanes, pw_error *error) {
  sigset_t before;
  build_defer (&before);
  int status = build_shared (path, object, log, lanes, &before, error);
  pthread_sigmask (SIG_SETMASK, &before, NULL);
  return status;
}
