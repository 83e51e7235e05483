/* What the commands share: command lines, models, errors. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"
#include "util.h"

/* ---- Command lines ---- */

enum { OPTIONS_HELP = 1000 }; /* what popt returns for help; for the others 1, 2, ... */

static int options_is_end (const struct poptOption *o) {
  return o->longName == NULL && o->shortName == 0 && o->arg == NULL;
}

static int options_has (const struct poptOption *o, const char *name) {
  while (!options_is_end (o) && (o->longName == NULL || strcmp (o->longName, name) != 0)) o++;
  return !options_is_end (o);
}

/* The command's options, what every command that opens a model has, and help. */
static int options_table (pw_cli_line *l, const struct poptOption *options) {
  const struct poptOption help = { "help", '?', POPT_ARG_NONE, NULL, OPTIONS_HELP, "Show this and stop", NULL };
  const struct poptOption size = { "max-file",   0, POPT_ARG_STRING,
                                   &l->max_file, 0, "Read model files of up to so many MB; by default 64",
                                   "MB" };
  size_t n = 0;
  while (!options_is_end (options + n)) n++;
  l->table = calloc (n + 3, sizeof *l->table);
  l->text = calloc (n + 3, sizeof *l->text);
  if (l->table == NULL || l->text == NULL) return PW_MACHINE;
  memcpy (l->table, options, n * sizeof *l->table);
  if (options_has (options, "set")) l->table[n++] = size;
  for (size_t i = 0; i < n; i++) l->table[i].val = (int)i + 1;
  l->table[n] = help;
  return PW_OK;
}

/* "show" of "pinwheel show" */
static const char *options_command (const char *title) {
  const char *space = strrchr (title, ' ');
  return space ? space + 1 : title;
}

/* popt hands out copies of texts, and lists of copies: notes that of an option just read, to be freed whatever becomes
 * of the variable.  Given once more, a text replaces the first, a list grows. */
static void options_note (pw_cli_line *l, int i) {
  unsigned type = l->table[i].argInfo & POPT_ARG_MASK;
  void **variable = l->table[i].arg;
  if (type == POPT_ARG_STRING) free (l->text[i]);
  if (type == POPT_ARG_STRING || type == POPT_ARG_ARGV) l->text[i] = *variable;
}

static int options_unknown (const pw_cli_line *l, const char *command, const char *bad, pw_error *error) {
  char sought[100], hint[120];
  const char *name = bad + strspn (bad, "-");
  snprintf (sought, sizeof sought, "%.*s", (int)strcspn (name, "="), name);
  pw_nearest near = { .sought = sought };
  for (const struct poptOption *o = l->table; !options_is_end (o); o++)
    if (o->longName) pw_nearest_try (&near, o->longName);
  if (near.near)
    snprintf (hint, sizeof hint, "did you mean \"--%s\"?", near.best);
  else
    snprintf (hint, sizeof hint, "see pinwheel %s --help", command);
  return pw_fail (error, PW_INPUT, "%s has no option \"%.*s\"; %s", command, (int)strcspn (bad, "="), bad, hint);
}

static int options_bad (const pw_cli_line *l, int why, const char *command, pw_error *error) {
  const char *bad = poptBadOption (l->popt, POPT_BADOPTION_NOALIAS);
  if (why == POPT_ERROR_BADOPT) return options_unknown (l, command, bad, error);
  if (why == POPT_ERROR_NOARG) return pw_fail (error, PW_INPUT, "%s: option %s needs a value", command, bad);
  return pw_fail (error, PW_INPUT, "%s: option %s: %s", command, bad, poptStrerror (why));
}

static int options_count (const pw_cli_line *l, const char *title, const char *synopsis, int least, int most,
                          pw_error *error) {
  if (l->arguments < least) return pw_fail (error, PW_INPUT, "something is missing; write %s %s", title, synopsis);
  if (l->arguments > most)
    return pw_fail (error, PW_INPUT, "\"%s\" is too much; write %s %s", l->argument[most], title, synopsis);
  return PW_OK;
}

/* popt leaves out what it had no memory for, and says nothing. */
static int options_complete (pw_error *error) {
  return errno == ENOMEM ? pw_fail (error, PW_MACHINE, "out of memory") : PW_OK;
}

int pw_cli_read (pw_cli_line *l, int argc, const char **argv, const struct poptOption *options, const char *synopsis,
                 int least, int most, pw_error *error) {
  *l = (pw_cli_line){ .popt = NULL };
  errno = 0;
  if (options_table (l, options) == PW_OK) l->popt = poptGetContext (argv[0], argc, argv, l->table, 0);
  if (l->popt == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  poptSetOtherOptionHelp (l->popt, synopsis);
  int got = poptGetNextOpt (l->popt);
  for (; got > 0 && got != OPTIONS_HELP; got = poptGetNextOpt (l->popt)) options_note (l, got - 1);
  if (options_complete (error) != PW_OK) return PW_MACHINE;
  if (got == OPTIONS_HELP) {
    poptPrintHelp (l->popt, stdout, 0);
    return 1;
  }
  if (got < -1) return options_bad (l, got, options_command (argv[0]), error);
  l->argument = poptGetArgs (l->popt);
  while (l->argument && l->argument[l->arguments]) l->arguments++;
  return options_count (l, argv[0], synopsis, least, most, error);
}

void pw_cli_close (pw_cli_line *l) {
  for (size_t i = 0; l->table && l->text && !options_is_end (l->table + i); i++) {
    char **list = (l->table[i].argInfo & POPT_ARG_MASK) == POPT_ARG_ARGV ? l->text[i] : NULL;
    for (; list && *list; list++) free (*list);
    free (l->text[i]);
  }
  if (l->popt) poptFreeContext (l->popt);
  free (l->text);
  free (l->table);
  *l = (pw_cli_line){ .popt = NULL };
}

int pw_cli_number (const char *option, const char *text, pw_domain domain, double *value, pw_error *error) {
  if (text == NULL) return PW_OK;
  double x;
  if (pw_read_expression (text, &x) != PW_OK)
    return pw_fail (error, PW_INPUT, "%s: \"%s\" is not a number", option, text);
  const char *expected = pw_domain_check (domain, x);
  if (*expected) return pw_fail (error, PW_INPUT, "%s %s: expected %s", option, text, expected);
  *value = x;
  return PW_OK;
}

/* ---- Models ---- */

int pw_cli_apply (pw_model *m, const char *option, const char *const *list,
                  int (*set) (pw_model *m, const char *name, double value, pw_error *error), pw_error *error) {
  for (; list && *list; list++) {
    char name[200];
    double value;
    const char *equals = strchr (*list, '=');
    if (equals == NULL || equals == *list || (size_t)(equals - *list) >= sizeof name)
      return pw_fail (error, PW_INPUT, "%s %s: expected NAME=VALUE", option, *list);
    snprintf (name, sizeof name, "%.*s", (int)(equals - *list), *list);
    if (pw_read_expression (equals + 1, &value) != PW_OK)
      return pw_fail (error, PW_INPUT, "%s %s: \"%s\" is not a number", option, *list, equals + 1);
    int status = set (m, name, value, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

pw_file *pw_cli_file (const pw_cli_line *l, pw_error *error) {
  const double most = PW_FILE_MOST >> 20;
  double size = PW_FILE_LARGEST >> 20;
  if (pw_cli_number ("--max-file", l->max_file, PW_POSITIVE, &size, error) != PW_OK) return NULL;
  if (size <= most) return pw_file_open_limited (l->argument[0], (size_t)(size * (1 << 20)), error);
  pw_fail (error, PW_INPUT, "--max-file %s: expected at most %g MB", l->max_file, most);
  return NULL;
}

int pw_cli_open (pw_cli_model *m, const pw_cli_line *l, const char *const *sets, const char *const *starts,
                 pw_error *error) {
  *m = (pw_cli_model){ .file = NULL };
  m->file = pw_cli_file (l, error);
  if (m->file) m->model = pw_file_model (m->file, error);
  if (m->model && pw_cli_apply (m->model, "--set", sets, pw_set, error) == PW_OK &&
      pw_cli_apply (m->model, "--start", starts, pw_set_start, error) == PW_OK && pw_build (m->model, error) == PW_OK)
    m->system = pw_compile (m->model, error);
  return m->system ? PW_OK : error->status;
}

void pw_cli_close_model (pw_cli_model *m) {
  pw_free (m->system);
  pw_model_free (m->model);
  pw_file_close (m->file);
  *m = (pw_cli_model){ .file = NULL };
}

const char *pw_cli_short_path (const char *path, char *buffer, size_t size) {
  size_t n = getcwd (buffer, size) ? strlen (buffer) : 0;
  return n > 1 && strncmp (path, buffer, n) == 0 && path[n] == '/' ? path + n + 1 : path;
}

pw_run_defaults pw_cli_defaults (const pw_plugin_table *table) {
  pw_run_defaults d = table->run;
  if (d.t_end == 0) d.t_end = 10;
  if (d.step == 0) d.step = 1e-3;
  if (d.method == NULL) d.method = "rk4+projection";
  return d;
}

int pw_cli_settle (const pw_cli_wishes *w, const pw_run_defaults *model, double *t_end, pw_settings *settings,
                   pw_error *error) {
  *t_end = model->t_end;
  *settings = (pw_settings){ .step = model->step, .rtol = model->rtol };
  double most = PW_MAX_STEPS;
  int status = pw_cli_number ("--t-end", w->t_end, PW_POSITIVE, t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--step", w->step, PW_POSITIVE, &settings->step, error);
  if (status == PW_OK) status = pw_cli_number ("--rtol", w->rtol, PW_POSITIVE, &settings->rtol, error);
  if (status == PW_OK) status = pw_cli_number ("--atol", w->atol, PW_POSITIVE, &settings->atol, error);
  if (status == PW_OK) status = pw_cli_number ("--max-steps", w->max_steps, PW_COUNT, &most, error);
  settings->max_steps = most < 9e18 ? (long)most : LONG_MAX;
  settings->span = *t_end;
  return status;
}

/* ---- The end ---- */

/* 1 if standard output is a pipe that nobody reads any more: `pinwheel ... | head`. */
static int options_nobody_reads (void) {
  struct pollfd out = { .fd = STDOUT_FILENO, .events = POLLOUT };
  return poll (&out, 1, 0) == 1 && out.revents & POLLERR;
}

int pw_cli_end (const pw_error *error) {
  if (error->status == PW_OK) return 0;
  if (error->status == PW_MACHINE && options_nobody_reads ()) return PW_CLOSED_PIPE; /* they know */
  fflush (stdout);
  int placed = strstr (error->text, ": error: ") != NULL; /* as compilers say it, so that editors find the place */
  pw_cli_say ("%s%s\n", placed ? "" : "pinwheel: ", error->text);
  return -error->status;
}
