/* The program itself: all commands with any options in any environment, in a folder that is emptied after each.  Words
 * that lead out of it, and models in C, are left out; what would take longer than a second of processor time is
 * interrupted. */
#define _GNU_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <locale.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>
int command_main (int argc, char **argv);
#define main command_main
#include "main.c"
#undef main
#include "fuzz.h"

enum { COMMAND_WORDS = 24 };

static char command_folder[100], command_models[1000];
static int command_home = -1;

static const char *const command_environment[] = { "POSIXLY_CORRECT",
                                                   "LC_ALL",
                                                   "LANG",
                                                   "COLUMNS",
                                                   "LINES",
                                                   "TMPDIR",
                                                   "OMP_NUM_THREADS",
                                                   "PINWHEEL_MODELS",
                                                   "CC",
                                                   "HOME",
                                                   "TERM",
                                                   "NO_COLOR",
                                                   "XDG_CACHE_HOME",
                                                   "PATH",
                                                   NULL };

static void command_stop (int number) {
  (void)number;
  pw_stop = 1;
}

static void command_empty (const char *folder, int depth) {
  DIR *d = opendir (folder);
  for (struct dirent *e; d && (e = readdir (d)) != NULL;) {
    char path[400];
    if (strcmp (e->d_name, ".") == 0 || strcmp (e->d_name, "..") == 0) continue;
    if (snprintf (path, sizeof path, "%s/%s", folder, e->d_name) >= (int)sizeof path) continue;
    if (unlink (path) != 0 && depth < 4) command_empty (path, depth + 1), rmdir (path);
  }
  if (d) closedir (d);
}

static void command_leave (void) {
  command_empty (command_folder, 0);
  rmdir (command_folder);
}

/* A folder of its own, and the models of the top folder. */
static void command_open (void) {
  if (command_home >= 0) return;
  const char *folder = getenv ("TMPDIR");
  snprintf (command_folder, sizeof command_folder, "%s/fuzz-command-%ld", folder ? folder : "/tmp", (long)getpid ());
  command_home = open (".", O_RDONLY | O_DIRECTORY);
  if (command_home < 0 || mkdir (command_folder, 0700) != 0 || getcwd (command_models, 900) == NULL) exit (1);
  strcat (command_models, "/models");
  if (freopen ("/dev/null", "w", stdout) == NULL) exit (1);
  signal (SIGVTALRM, command_stop);
  atexit (command_leave);
}

static int command_ends (const char *word, const char *end) {
  size_t n = strlen (word), m = strlen (end);
  return n >= m && strcmp (word + n - m, end) == 0;
}

/* Whether a word stays in the folder and needs no compiler. */
static int command_harmless (const char *word) {
  if (strcmp (word, "-o/dev/null") == 0 || command_ends (word, "=/dev/null") || strcmp (word, "/dev/null") == 0)
    return 1;
  return strchr (word, '/') == NULL && !command_ends (word, ".c") && !command_ends (word, ".so") &&
         !command_ends (word, "..") && !command_ends (word, ".cpp") && !command_ends (word, ".cc");
}

/* Sets "NAME=VALUE" in the environment if that is one of those above; the next input sets all of them anew. */
static int command_set (char *word) {
  char *equals = strchr (word, '=');
  for (const char *const *n = command_environment; equals && *n; n++)
    if (strncmp (word, *n, (size_t)(equals - word)) == 0 && (*n)[equals - word] == 0)
      return setenv (*n, equals + 1, 1) == 0;
  return 0;
}

static void command_run (int argc, const char **argv) {
  const struct itimerval second = { .it_value = { .tv_sec = 1 } }, none = { .it_value = { .tv_sec = 0 } };
  int here = open (".", O_RDONLY | O_DIRECTORY);
  if (chdir (command_folder) != 0) exit (1);
  pw_stop = 0;
  setitimer (ITIMER_VIRTUAL, &second, NULL);
  int status = command_main (argc, (char **)(size_t)argv);
  setitimer (ITIMER_VIRTUAL, &none, NULL);
  if (fchdir (here) != 0) exit (1);
  close (here);
  clearerr (stdout);
  command_empty (command_folder, 0);
  if ((status < 0 || status > 4) && status != PW_INTERRUPTED && status != PW_CLOSED_PIPE) abort ();
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  const char *line[COMMAND_WORDS + 1], *argv[COMMAND_WORDS + 6] = { "pinwheel" };
  int argc = 1, harmless = 1;
  const char *folder = getenv ("TMPDIR");
  char before[200] = "";
  command_open ();
  if (folder) snprintf (before, sizeof before, "%s", folder);
  char *text = fuzz_text (data, size);
  int count = fuzz_lines (text, line, COMMAND_WORDS);
  for (const char *const *n = command_environment; *n; n++)
    if (strcmp (*n, "PATH") != 0) unsetenv (*n);
  setenv ("PATH", "/nowhere", 1);
  setenv ("PINWHEEL_MODELS", command_models, 1);
  for (int i = 0; i < count; i++) {
    harmless &= command_harmless (line[i]);
    if (argc > 1 || !harmless || !command_set ((char *)(size_t)line[i])) argv[argc++] = line[i];
  }
  argv[argc] = NULL;
  if (harmless) command_run (argc, argv);
  if (*before) setenv ("TMPDIR", before, 1);
  free (text);
  return 0;
}

static fuzz_grammar command_rules[] = {
  "c:$xlist\n$w\n`$xrun\n$m\n$r$s$s$o`$xrun\n$m\n$t$s$o$o$o`$xshow\n$m\n$h$o`$xcheck\n$m\n$k$o"
  "`$xsweep\n$m\n$v$s$t$o`$xsweep\n$m\n$v$v-j\n2\n$t$o$o`$xcompare\n$m\n-m\n$i,$i\n--repeats=1\n--limit=0.01\n$o$t"
  "`$xdrift\n$m\n-m\n$i,$i\n$t$o$o`$xnew\n$f\n`$x$z\n$o$o`help\n$z\n`$xrun\n$r$t$s$o--\n$m\n",
  "x:`POSIXLY_CORRECT=1\n`LC_ALL=$l\n`TMPDIR=$q\n`OMP_NUM_THREADS=$n\n`COLUMNS=$n\n`PINWHEEL_MODELS=$q\n`TERM=$l\n`$x$x"
  "`LANG=$l\nNO_COLOR=1\n",
  "l:C`de_DE.UTF-8`tr_TR`xx`",
  "q:`.`nowhere`:`.:.`::nowhere",
  "w:models`methods`kinds`signals`methods\n$i`kinds\nwheel",
  "m:pendulum`car`hatchet-planimeter`differential-drive`chaplygin-sleigh`m.yaml`nothing`roller-racer`car-tyres",
  "r:-t\n0.01\n`-t$n\n`--t-end=0.02\n",
  "t:-t\n0.01\n--max-steps=100\n--limit=0.1\n`--t-end=0.05\n--limit=$n\n--max-steps=$n\n",
  "s:--method=$i\n`-m\n$i\n`--step=$n\n`--rtol=$n\n`--atol=$n\n`--every=$n\n`--max-steps=$n\n`--limit=$n\n",
  "h:--yaml\n`--matrices\n`--at=0.01\n`--matrices\n--at=0.02\n`",
  "k:--json=-\n`--json=j.json\n`",
  "v:--vary\n$p=lin:$n:$n:2\n`-v$p=$n,$n\n`--vary=$p=log:$n:$n:3\n",
  "f:m.yaml`x.c`x`m.yaml.yaml",
  "o:--set\n$p=$n\n`--start\n$p=$n\n`--energy\n`-o\n$u\n`--json=$u\n`--plots=p\n`--animate=a.html\n`--reference=$u\n"
  "`--checkpoint=$u\n`--checkpoint-every=$n\n`--resume=$u\n`--max-file=$n\n`--cpu\n`--part=1:2\n`--part=2/2\n`--merge\n"
  "`--only-methods\n`--help\n`-?\n`--version\n`--rtol-ladder=1e-3:1e-4\n`--step-ladder=$n:$n\n`$z\n`$s`$h`$k`$r`$t`$"
  "u\n",
  "u:o.csv`-`/dev/null`.`d.csv`o.csv.csv`p",
  "p:m`l`g`theta`bob.x`bob.omega`frame.vx`nothing`omega`M0`every`alpha",
  "i:rk4+projection`rk4+none`erk8+projection`ida+ggl`ida`bdf+projection`adams+none`galpha+ggl`leapfrog+rattle"
  "`rk4+baumgarte:alpha=$n`rk4+projection:every=$n`erk5+nullspace`galpha+ggl:rho=$n`all`nothing`rk4+projection:metric="
  "mass",
  "n:1`0`2`0.01`-1`1e-3`1e308`nan`inf`1e-320`2*pi`1/0`x`",
  "z:list`run`show`check`sweep`compare`drift`new`help`--help`--version`nothing",
  NULL
};

size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed) {
  return fuzz_mutate (command_rules, data, size, most, seed);
}
