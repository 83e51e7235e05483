/* A folder of figures: data files, gnuplot scripts made of templates, and gnuplot, run without a shell. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "figure.h"

/* ---- The folder ---- */

static int figure_make_folder (const char *folder, pw_error *error) {
  char path[FIGURE_PATH];
  size_t n = strlen (folder);
  if (n == 0 || n >= sizeof path - 32)
    return pw_fail (error, PW_INPUT, "the folder \"%s\" for plots: no such name can be used", folder);
  memcpy (path, folder, n + 1);
  for (size_t i = 1; i <= n; i++) {
    if (path[i] != '/' && path[i] != 0) continue;
    char end = path[i];
    path[i] = 0;
    if (mkdir (path, 0777) != 0 && errno != EEXIST)
      return pw_fail (error, PW_RESOURCE, "cannot make the folder %s: %s", path, strerror (errno));
    path[i] = end;
  }
  return PW_OK;
}

int pw_figure_folder (const char *folder, pw_error *error) {
  return figure_make_folder (folder, error) == PW_OK ? pw_lock_folder (folder, error) : -1;
}

static pw_output *figure_open (const pw_figures *f, const char *name, const char *ending, pw_error *error) {
  char path[FIGURE_PATH + 8];
  snprintf (path, sizeof path, "%s/%s%s", f->folder, name, ending);
  return pw_output_open (path, error);
}

pw_output *pw_figure_data (const pw_figures *f, const char *name, pw_error *error) {
  pw_output *o = figure_open (f, name, "", error);
  if (o && *f->incomplete) fprintf (pw_output_stream (o), "# %s\n", f->incomplete + 2);
  return o;
}

/* ---- Scripts ---- */

/* The templates NAME.gp line by line, as figure_NAME; the Makefile makes this file of them. */
#include "templates.inc"

/* What each kind of script consists of. */
static const struct {
  const char *name;
  const char *const *part[5];
} figure_template[] = {
  { "paths", { figure_look, figure_curves, figure_plane, figure_paths } },
  { "velocities", { figure_look, figure_curves, figure_velocities } },
  { "angular", { figure_look, figure_curves, figure_angular } },
  { "energy", { figure_look, figure_energy } },
  { "mechanism", { figure_look, figure_plane, figure_mechanism } },
  { "work-precision", { figure_look, figure_methods, figure_work_precision } },
  { "drift", { figure_look, figure_methods, figure_drift } },
};

pw_output *pw_figure_begin (const pw_figures *f, const char *name, pw_error *error) {
  pw_output *o = figure_open (f, name, ".gp", error);
  if (o == NULL) return NULL;
  FILE *out = pw_output_stream (o);
  fprintf (out,
           "# A figure by Pinwheel.  After changes draw it again, in this folder, by:  gnuplot %s.gp\n"
           "reset session\n",
           name);
  pw_figure_text (out, "name", name);
  pw_figure_text (out, "model", f->model);
  pw_figure_text (out, "incomplete", f->incomplete);
  return o;
}

void pw_figure_number (FILE *f, const char *variable, double value) {
  char text[32];
  fprintf (f, "%s = %s\n", variable, pw_format (text, value, 9));
}

void pw_figure_text (FILE *f, const char *variable, const char *value) {
  fprintf (f, "%s = '", variable);
  for (; *value; value++) {
    if (*value == '\'') fputc ('\'', f);
    fputc ((unsigned char)*value < ' ' ? ' ' : *value, f);
  }
  fputs ("'\n", f);
}

void pw_figure_array (FILE *f, const char *name, int count) {
  fprintf (f, "array %s[%d]\n", name, count);
}

void pw_figure_element (FILE *f, const char *name, int i, const char *value) {
  char variable[60];
  snprintf (variable, sizeof variable, "%s[%d]", name, i);
  pw_figure_text (f, variable, value);
}

void pw_figure_methods (FILE *f, int count, int spread) {
  pw_figure_number (f, "methods", count);
  pw_figure_number (f, "spread", spread);
  pw_figure_array (f, "label", count);
  pw_figure_array (f, "stabilisation", count);
}

void pw_figure_method (FILE *f, int i, const char *label, const char *method) {
  const pw_method *integrator;
  int stabilisation;
  int known = method && pw_method_parse (method, &integrator, &stabilisation, NULL) == PW_OK;
  pw_figure_element (f, "label", i, label);
  pw_figure_element (f, "stabilisation", i, known ? integrator->stabilisations[stabilisation].name : "");
}

int pw_figure_end (pw_output *o, const char *template_name, pw_error *error) {
  int k = 0;
  while (strcmp (figure_template[k].name, template_name) != 0) k++;
  for (const char *const *const *part = figure_template[k].part; *part; part++)
    for (const char *const *line = *part; *line; line++) fputs (*line, pw_output_stream (o));
  return pw_output_finish (o, error);
}

/* ---- gnuplot ---- */

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
static void gnuplot_remove_figures (const char *folder, const char *const *names) {
  static const char *const ending[] = { "svg", "png" };
  char path[2 * FIGURE_PATH];
  for (int i = 0; i < FIGURE_SCRIPTS && names[i]; i++)
    for (size_t k = 0; k < sizeof ending / sizeof *ending; k++) {
      snprintf (path, sizeof path, "%s/%s.%s", folder, names[i], ending[k]);
      remove (path);
    }
}

static int gnuplot_absent (const char *folder) {
  pw_cli_say ("pinwheel: gnuplot was not found, so no figures are drawn; data and scripts are in %s: gnuplot FILE.gp "
              "draws them there\n",
              folder);
  return PW_OK;
}

int pw_figure_draw (const char *folder, const char *const *names, pw_error *error) {
  char cd[2 * FIGURE_PATH], script[FIGURE_SCRIPTS][40], *argv[4 + FIGURE_SCRIPTS + 1] = { "gnuplot", "-d", "-e", cd };
  pid_t child;
  int status;
  for (int i = 0; i < FIGURE_SCRIPTS && names[i]; i++) {
    snprintf (script[i], sizeof script[i], "%s.gp", names[i]);
    argv[4 + i] = script[i];
  }
  if (!gnuplot_cd (folder, cd, sizeof cd)) return pw_fail (error, PW_INPUT, "%s: too long a name", folder);
  fflush (stderr);
  gnuplot_remove_figures (folder, names);
  int failed = gnuplot_start (argv, &child);
  if (failed == ENOENT) return gnuplot_absent (folder);
  if (failed) return pw_fail (error, PW_RESOURCE, "cannot run gnuplot: %s", strerror (failed));
  while (waitpid (child, &status, 0) < 0)
    if (errno != EINTR) return pw_fail (error, PW_RESOURCE, "lost gnuplot: %s", strerror (errno));
  if (WIFEXITED (status) && WEXITSTATUS (status) == GNUPLOT_ABSENT) return gnuplot_absent (folder);
  if (WIFEXITED (status) && WEXITSTATUS (status) == 0) return PW_OK;
  gnuplot_remove_figures (folder, names);
  if (WIFSIGNALED (status))
    return pw_fail (error, PW_RESOURCE, "gnuplot was ended by signal %d; data and scripts are in %s", WTERMSIG (status),
                    folder);
  return pw_fail (error, PW_RESOURCE,
                  "gnuplot failed with exit status %d; its message is above, data and scripts are in %s",
                  WEXITSTATUS (status), folder);
}
