/* Compiles C to a shared object or to WebAssembly; runs the compiler without a shell. */
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

typedef struct {
  const char *compiler;       /* one or more words ("ccache gcc") */
  const char *const *options; /* ends with NULL, as does `last` */
  const char *last[3];        /* options and files after the name of the source */
  int for_page;               /* 1: compiles to WebAssembly */
  const char *log;            /* path of the file that gets the messages; NULL: standard error */
  sigset_t signals;           /* blocked before build_defer, and so in the compiler */
} build_command;

const char *pw_compiler (void) {
  const char *cc = getenv ("CC");
  return cc && cc[strspn (cc, " \t")] ? cc : "cc";
}

/* Starts the compiler, its messages on standard error or in a log, SIGPIPE not ignored.  0 or an errno value. */
static int build_spawn (const build_command *command, char *const *word, pid_t *child) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  sigset_t pipe;
  sigemptyset (&pipe);
  sigaddset (&pipe, SIGPIPE);
  int code = posix_spawn_file_actions_init (&files);
  if (code) return code;
  code = posix_spawnattr_init (&attributes);
  if (code == 0) {
    if (command->log)
      code = posix_spawn_file_actions_addopen (&files, STDERR_FILENO, command->log,
                                               O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW, 0600);
    if (code == 0) code = posix_spawn_file_actions_adddup2 (&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawnattr_setsigmask (&attributes, &command->signals);
    posix_spawnattr_setsigdefault (&attributes, &pipe);
    posix_spawnattr_setflags (&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    if (code == 0) code = posix_spawnp (child, word[0], &files, &attributes, word, environ);
    posix_spawnattr_destroy (&attributes);
  }
  posix_spawn_file_actions_destroy (&files);
  return code;
}

/* Runs the words of a command line, which compiles a source to an object that does not exist yet. */
static int build_run (const build_command *command, char *const *word, const char *source, const char *object,
                      pw_error *error) {
  pid_t child, ended = 0;
  int outcome = 0, code = build_spawn (command, word, &child);
  while (code == 0 && (ended = waitpid (child, &outcome, 0)) < 0 && errno == EINTR) continue;
  int status = WIFEXITED (outcome) ? WEXITSTATUS (outcome) : -1;
  if (ended < 0) status = access (object, F_OK) != 0; /* SIGCHLD is ignored: there is no exit status */
  if (code != 0 && code != ENOENT && code != EACCES)
    return pw_fail (error, PW_RESOURCE, "cannot run the C compiler \"%s\": %s", word[0], strerror (code));
  if (code != 0 || status == 127)
    return pw_fail (error, PW_INPUT, "cannot run the C compiler \"%s\" that %s%s needs (%s): install %s", word[0],
                    command->log ? "specialised code" : "the model file ", command->log ? "" : source,
                    code ? strerror (code) : "not found",
                    command->for_page ? PW_PAGE_TOOLS : "one, or name another in the environment variable CC");
  if (status != 0 && command->log)
    return pw_fail (error, PW_METHOD, "%s does not compile; the messages of %s are in %s", source, word[0],
                    command->log);
  if (status != 0)
    return pw_fail (error, PW_INPUT, "the model file %s does not compile; the messages of %s are above", source,
                    word[0]);
  return PW_OK;
}

enum { BUILD_COMPILER = 24, BUILD_OTHERS = 24 }; /* most words of the compiler's command; of options and files */

/* Adds words to a command line, which execv does not modify. */
static void build_add (char **word, int *count, const char *const *more) {
  for (; *more; more++) memcpy (&word[(*count)++], more, sizeof *more);
}

static int build_object (const build_command *command, const char *source, const char *object, pw_error *error) {
  char header[PW_PATH], include[PW_PATH], *compiler = strdup (command->compiler), *rest = NULL;
  char *word[BUILD_COMPILER + BUILD_OTHERS] = { NULL };
  int words = 0, status = pw_search_header (header, error);
  pw_folder_of (include, header);
  if (status == PW_OK && *header == 0)
    status = pw_fail (error, PW_INPUT,
                      "cannot compile %s: pinwheel.h is neither in \"include\" next to the program nor in "
                      "\"../include/pinwheel\"",
                      source);
  if (status == PW_OK && compiler == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) {
    char *w = strtok_r (compiler, " \t", &rest);
    for (; w && words < BUILD_COMPILER; w = strtok_r (NULL, " \t", &rest)) word[words++] = w;
    build_add (word, &words, command->options);
    build_add (word, &words, (const char *const[]){ "-I", include, "-o", object, source, NULL });
    build_add (word, &words, command->last);
    status = w ? pw_fail (error, PW_INPUT, "the C compiler's command in CC has more than %d words", BUILD_COMPILER)
               : build_run (command, word, source, object, error);
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
  static const struct {
    int lanes, processor; /* processor: the least pw_processor_lanes for which the options are valid */
    const char *option[16];
  } known[] = {
    { 0, 4, { BUILD_SCENE, "-O2", "-mavx2" } },
    { 0, 1, { BUILD_SCENE, "-O2" } },
    { 2, 4, { BUILD_LANES, "-DPW_LANES=2", "-mavx" } },
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

/* Blocks SIGINT (Ctrl-C reaches the compiler, too), SIGTERM and SIGHUP; the mask `before` restores them. */
static void build_defer (sigset_t *before) {
  sigset_t stop;
  sigemptyset (&stop);
  sigaddset (&stop, SIGINT);
  sigaddset (&stop, SIGTERM);
  sigaddset (&stop, SIGHUP);
  pthread_sigmask (SIG_BLOCK, &stop, before);
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
  build_command command = { .compiler = engine ? "clang" : pw_compiler (),
                            .options = engine ? page : plugin,
                            .last = { engine ? engine : "-lm", engine ? "-Wl,--no-whole-archive" : NULL },
                            .for_page = engine != NULL };
  build_defer (&command.signals);
  char folder[PW_PATH], object[PW_PATH];
  int status = pw_temporary_folder (folder, error);
  if (status == PW_OK) {
    status = build_object (&command, path, pw_path (object, "%s/model.so", folder), error);
    if (status == PW_OK) status = use (context, object, error);
    unlink (object);
    rmdir (folder);
  }
  pthread_sigmask (SIG_SETMASK, &command.signals, NULL);
  return status;
}

int pw_compile_scene (const char *path, const char *object, const char *log, int lanes, pw_error *error) {
  build_command command = {
    .compiler = pw_compiler (), .options = pw_scene_options (lanes), .last = { "-lm" }, .log = log
  };
  build_defer (&command.signals);
  int status = build_object (&command, path, object, error);
  pthread_sigmask (SIG_SETMASK, &command.signals, NULL);
  return status;
}
