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
