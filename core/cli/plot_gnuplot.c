/* Runs gnuplot on the scripts of a folder, without a shell. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "plot.h"

extern char **environ;

enum { GNUPLOT_ABSENT = 127 }; /* exit status of a child that could not become gnuplot */

/* "cd 'FOLDER'" for gnuplot, where a quote inside quotes is written twice. */
static int gnuplot_cd (const char *folder, char *text, size_t size) {
  size_t n = 4;
  memcpy (text, "cd '", n);
  for (; *folder && n + 4 < size; folder++) {
    if (*folder == '\'') text[n++] = '\'';
    text[n++] = *folder;
  }
  memcpy (text + n, "'", 2);
  return *folder == 0;
}

/* Starts it with nothing to read and its output among our messages.  An errno value. */
static int gnuplot_start (char *const *argv, pid_t *child) {
  posix_spawn_file_actions_t actions;
  int failed = posix_spawn_file_actions_init (&actions);
  if (failed) return failed;
  failed = posix_spawn_file_actions_addopen (&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  if (!failed) failed = posix_spawn_file_actions_adddup2 (&actions, STDERR_FILENO, STDOUT_FILENO);
  if (!failed) failed = posix_spawnp (child, argv[0], &actions, NULL, argv, environ);
  posix_spawn_file_actions_destroy (&actions);
  return failed;
}

static int gnuplot_absent (const pw_plots *p) {
  fprintf (stderr,
           "pinwheel: gnuplot was not found, so no figures are drawn; data and scripts are in %s: gnuplot FILE.gp "
           "draws them there\n",
           p->folder);
  return PW_OK;
}

int pw_plot_run (const pw_plots *p, pw_error *error) {
  char cd[2 * PLOT_PATH];
  const char *const argv[] = { "gnuplot",    "-d",        "-e",           cd,  "paths.gp", "velocities.gp",
                               "angular.gp", "energy.gp", "mechanism.gp", NULL };
  pid_t child;
  int status;
  if (!gnuplot_cd (p->folder, cd, sizeof cd)) return pw_fail (error, PW_INPUT, "%s: too long a name", p->folder);
  fflush (stderr);
  int failed = gnuplot_start ((char *const *)(size_t)argv, &child);
  if (failed == ENOENT) return gnuplot_absent (p);
  if (failed) return pw_fail (error, PW_MACHINE, "cannot run gnuplot: %s", strerror (failed));
  while (waitpid (child, &status, 0) < 0)
    if (errno != EINTR) return pw_fail (error, PW_MACHINE, "lost gnuplot: %s", strerror (errno));
  if (WIFEXITED (status) && WEXITSTATUS (status) == GNUPLOT_ABSENT) return gnuplot_absent (p);
  if (WIFEXITED (status) && WEXITSTATUS (status) == 0) return PW_OK;
  if (WIFSIGNALED (status))
    return pw_fail (error, PW_MACHINE, "gnuplot was ended by signal %d; data and scripts are in %s", WTERMSIG (status),
                    p->folder);
  return pw_fail (error, PW_MACHINE,
                  "gnuplot failed with exit status %d; its message is above, data and scripts are in %s",
                  WEXITSTATUS (status), p->folder);
}
