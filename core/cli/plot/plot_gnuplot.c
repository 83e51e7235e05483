/* Runs gnuplot on the scripts of a folder, without a shell. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdlib.h>
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

/* The environment, but in a locale that has all characters the scripts use.  A malloced list, or NULL. */
static char **gnuplot_environment (void) {
  static char locale[] = "LC_ALL=C.UTF-8";
  size_t n = 0, kept = 0;
  while (environ[n]) n++;
  char **list = malloc ((n + 2) * sizeof *list);
  for (size_t i = 0; list && i < n; i++)
    if (strncmp (environ[i], "LC_ALL=", 7) != 0) list[kept++] = environ[i];
  if (list) list[kept] = locale, list[kept + 1] = NULL;
  return list;
}

/* Starts it with nothing to read and its output among our messages.  An errno value. */
static int gnuplot_start (char *const *argv, pid_t *child) {
  posix_spawn_file_actions_t actions;
  char **environment = gnuplot_environment ();
  int failed = environment ? posix_spawn_file_actions_init (&actions) : ENOMEM;
  if (failed) {
    free (environment);
    return failed;
  }
  failed = posix_spawn_file_actions_addopen (&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  if (!failed) failed = posix_spawn_file_actions_adddup2 (&actions, STDERR_FILENO, STDOUT_FILENO);
  if (!failed) failed = posix_spawnp (child, argv[0], &actions, NULL, argv, environment);
  posix_spawn_file_actions_destroy (&actions);
  free (environment);
  return failed;
}

/* No figure of an earlier run, nor half of one, is left beside the data. */
static void gnuplot_remove_figures (const char *folder, const char *const *scripts) {
  static const char *const ending[] = { "svg", "png" };
  char path[2 * PLOT_PATH];
  for (int i = 0; i < PLOT_SCRIPTS && scripts[i]; i++)
    for (size_t k = 0; k < sizeof ending / sizeof *ending; k++) {
      snprintf (path, sizeof path, "%s/%.*s.%s", folder, (int)strcspn (scripts[i], "."), scripts[i], ending[k]);
      remove (path);
    }
}

static int gnuplot_absent (const char *folder) {
  pw_cli_say ("pinwheel: gnuplot was not found, so no figures are drawn; data and scripts are in %s: gnuplot FILE.gp "
              "draws them there\n",
              folder);
  return PW_OK;
}

int pw_plot_gnuplot (const char *folder, const char *const *scripts, pw_error *error) {
  char cd[2 * PLOT_PATH];
  const char *argv[4 + PLOT_SCRIPTS + 1] = { "gnuplot", "-d", "-e", cd };
  pid_t child;
  int status;
  for (int i = 0; i < PLOT_SCRIPTS && scripts[i]; i++) argv[4 + i] = scripts[i];
  if (!gnuplot_cd (folder, cd, sizeof cd)) return pw_fail (error, PW_INPUT, "%s: too long a name", folder);
  fflush (stderr);
  gnuplot_remove_figures (folder, scripts);
  int failed = gnuplot_start ((char *const *)(size_t)argv, &child);
  if (failed == ENOENT) return gnuplot_absent (folder);
  if (failed) return pw_fail (error, PW_MACHINE, "cannot run gnuplot: %s", strerror (failed));
  while (waitpid (child, &status, 0) < 0)
    if (errno != EINTR) return pw_fail (error, PW_MACHINE, "lost gnuplot: %s", strerror (errno));
  if (WIFEXITED (status) && WEXITSTATUS (status) == GNUPLOT_ABSENT) return gnuplot_absent (folder);
  if (WIFEXITED (status) && WEXITSTATUS (status) == 0) return PW_OK;
  gnuplot_remove_figures (folder, scripts);
  if (WIFSIGNALED (status))
    return pw_fail (error, PW_MACHINE, "gnuplot was ended by signal %d; data and scripts are in %s", WTERMSIG (status),
                    folder);
  return pw_fail (error, PW_MACHINE,
                  "gnuplot failed with exit status %d; its message is above, data and scripts are in %s",
                  WEXITSTATUS (status), folder);
}

int pw_plot_run (const pw_plots *p, pw_error *error) {
  static const char *const scripts[] = { "paths.gp", "velocities.gp", "angular.gp", "energy.gp", "mechanism.gp", NULL };
  return pw_plot_gnuplot (p->folder, scripts, error);
}
