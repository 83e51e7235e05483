/* Command lines: options bound to a command's structure, help, values of options. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <gsl/gsl_errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "util.h"

enum {
  COMMAND_HELP = 1000,
  COMMAND_WIDTH = 80
}; /* popt's value for --help (for other options 1, 2, ...); columns of help */

static const struct poptOption command_help_option = { "help", '?',          POPT_ARG_NONE,
                                                       NULL,   COMMAND_HELP, "Show this help and exit",
                                                       NULL };

static int command_is_end (const struct poptOption *o) {
  return o->longName == NULL && o->descrip == NULL;
}

/* The command's options, each pointing into its structure, and help. */
static int command_table (pw_cli_line *l, const struct poptOption *options) {
  size_t n = 0;
  while (!command_is_end (options + n)) n++;
  l->table = calloc (n + 2, sizeof *l->table);
  l->text = calloc (n + 2, sizeof *l->text);
  if (l->table == NULL || l->text == NULL) return PW_RESOURCE;
  n = 0;
  for (const struct poptOption *o = options; !command_is_end (o); o++) {
    if (o->longName == NULL) continue; /* a heading */
    l->table[n] = *o;
    l->table[n].arg = (char *)l + (size_t)o->arg;
    l->table[n].val = (int)n + 1;
    n++;
  }
  l->table[n] = command_help_option;
  return PW_OK;
}

/* Records the text or list that popt has allocated for an option, to release it even if the variable changes.  If an
 * option is repeated, a list grows; a text is refused, under either name of the option. */
static int command_note (const pw_command *c, pw_cli_line *l, int i, pw_error *error) {
  const struct poptOption *o = l->table + i;
  unsigned type = o->argInfo & POPT_ARG_MASK;
  int given = 0;
  for (int j = 0; l->table[j].longName; j++) given |= l->table[j].arg == o->arg && l->text[j] != NULL;
  if (type == POPT_ARG_STRING) free (l->text[i]);
  if (type == POPT_ARG_STRING || type == POPT_ARG_ARGV) l->text[i] = *(void **)o->arg;
  if (type != POPT_ARG_STRING || !given) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: option --%s is given twice", c->name, o->longName);
}

/* ---- Help ---- */

static void command_option (const struct poptOption *o) {
  enum { COLUMN = 28 };
  char left[80], letter[8] = "   ";
  int list = (o->argInfo & POPT_ARG_MASK) == POPT_ARG_ARGV;
  if (o->shortName) snprintf (letter, sizeof letter, "-%c,", o->shortName);
  snprintf (left, sizeof left, "  %s --%s%s%s", letter, o->longName, o->argDescrip ? list ? " " : "=" : "",
            o->argDescrip ? o->argDescrip : "");
  if (strlen (left) > COLUMN - 2)
    printf ("%s\n%*s", left, COLUMN, "");
  else
    printf ("%-*s", COLUMN, left);
  pw_cli_wrap (o->descrip, COLUMN, COMMAND_WIDTH);
}

static void command_help (const pw_command *c) {
  printf ("Usage: pinwheel %s %s\n", c->name, c->synopsis);
  pw_cli_wrap (c->help, 0, COMMAND_WIDTH);
  for (const struct poptOption *o = c->options; !command_is_end (o); o++)
    if (o->longName == NULL)
      printf ("\n%s:\n", o->descrip);
    else if (o->descrip)
      command_option (o);
  puts ("\nOther:");
  command_option (&command_help_option);
}

/* ---- Reading ---- */

static int command_unknown (const pw_command *c, const pw_cli_line *l, const char *bad, pw_error *error) {
  char sought[100], hint[140];
  const char *name = bad + strspn (bad, "-");
  snprintf (sought, sizeof sought, "%.*s", (int)strcspn (name, "="), name);
  pw_nearest near = { .sought = sought };
  for (const struct poptOption *o = l->table; o->longName; o++)
    if (o->descrip) pw_nearest_try (&near, o->longName);
  if (near.near)
    snprintf (hint, sizeof hint, "did you mean \"--%s\"?", near.best);
  else
    snprintf (hint, sizeof hint, "see pinwheel %s --help", c->name);
  return pw_fail (error, PW_INPUT, "%s has no option \"%.*s\"; %s", c->name, (int)strcspn (bad, "="), bad, hint);
}

static int command_bad (const pw_command *c, const pw_cli_line *l, int why, pw_error *error) {
  const char *bad = poptBadOption (l->popt, POPT_BADOPTION_NOALIAS);
  if (why == POPT_ERROR_BADOPT) return command_unknown (c, l, bad, error);
  if (why == POPT_ERROR_NOARG) return pw_fail (error, PW_INPUT, "%s: option %s needs a value", c->name, bad);
  return pw_fail (error, PW_INPUT, "%s: option %s: %s", c->name, bad, poptStrerror (why));
}

int pw_cli_at_most (const pw_command *c, const pw_cli_line *l, int most, pw_error *error) {
  if (l->arguments <= most) return PW_OK;
  return pw_fail (error, PW_INPUT, "unexpected argument \"%s\"; usage: pinwheel %s %s", l->argument[most], c->name,
                  c->synopsis);
}

/* Returns 1 if help was requested and has been printed. */
static int command_read (const pw_command *c, pw_cli_line *l, int argc, const char **argv, pw_error *error) {
  errno = 0;
  if (command_table (l, c->options) == PW_OK) l->popt = poptGetContext (argv[0], argc, argv, l->table, 0);
  if (l->popt == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int got = poptGetNextOpt (l->popt);
  for (; got > 0 && got != COMMAND_HELP; got = poptGetNextOpt (l->popt))
    if (command_note (c, l, got - 1, error) != PW_OK) return error->status;
  if (errno == ENOMEM)
    return pw_fail (error, PW_RESOURCE, "out of memory"); /* popt omits texts that it cannot allocate */
  if (got == COMMAND_HELP) {
    command_help (c);
    return 1;
  }
  if (got < -1) return command_bad (c, l, got, error);
  l->argument = poptGetArgs (l->popt);
  while (l->argument && l->argument[l->arguments]) l->arguments++;
  if (l->arguments < c->least)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel %s %s", c->name, c->synopsis);
  return c->most ? pw_cli_at_most (c, l, c->most, error) : PW_OK;
}

static void command_close (pw_cli_line *l) {
  for (size_t i = 0; l->table && l->text && l->table[i].longName; i++) {
    char **list = (l->table[i].argInfo & POPT_ARG_MASK) == POPT_ARG_ARGV ? l->text[i] : NULL;
    for (; list && *list; list++) free (*list);
    free (l->text[i]);
  }
  if (l->popt) poptFreeContext (l->popt);
  free (l->text);
  free (l->table);
  free (l);
}

int pw_cli_main (const pw_command *c, int argc, const char **argv) {
  gsl_set_error_handler_off (); /* the default handler ends the program */
  pw_error error = { 0 };
  pw_cli_line *l = calloc (1, c->size);
  int status = l ? command_read (c, l, argc, argv, &error) : pw_fail (&error, PW_RESOURCE, "out of memory");
  status = status == PW_OK ? c->function (l, &error) : 0; /* 0 after help */
  if (l) command_close (l);
  return status > 0 ? status : pw_cli_end (&error);
}

/* ---- Values ---- */

int pw_cli_only (const char *option, const char *text, const char *with, int has, pw_error *error) {
  if (text == NULL || has) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s %s: only with %s", option, text, with);
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

int pw_cli_range (const char *text, double *first, double *last) {
  const char *colon = strchr (text, ':');
  char number[100];
  if (colon == NULL || (size_t)(colon - text) >= sizeof number) return PW_INPUT;
  snprintf (number, sizeof number, "%.*s", (int)(colon - text), text);
  if (pw_read_expression (number, first) != PW_OK || pw_read_expression (colon + 1, last) != PW_OK) return PW_INPUT;
  return isfinite (*last - *first) ? PW_OK : PW_INPUT;
}

int pw_cli_settings (const pw_cli_line *l, const pw_run_defaults *model, double *t_end, pw_settings *settings,
                     pw_limit *limit, pw_error *error) {
  double most = PW_MAX_STEPS;
  *t_end = model->t_end;
  *limit = (pw_limit){ .most = INFINITY };
  *settings = (pw_settings){ .step = model->step, .rtol = model->rtol, .stop = pw_limit_over, .stop_context = limit };
  const struct {
    const char *option, *text;
    double *value;
  } number[] = { { "--t-end", l->t_end, t_end },
                 { "--step", l->step, &settings->step },
                 { "--rtol", l->rtol, &settings->rtol },
                 { "--atol", l->atol, &settings->atol },
                 { "--limit", l->limit, &limit->most } };
  for (size_t i = 0; i < sizeof number / sizeof *number; i++)
    if (pw_cli_number (number[i].option, number[i].text, PW_POSITIVE, number[i].value, error) != PW_OK) return PW_INPUT;
  int status = pw_cli_number ("--max-steps", l->max_steps, PW_COUNT, &most, error);
  settings->max_steps = most < 9e18 ? (long)most : LONG_MAX;
  settings->span = *t_end;
  return status;
}

int pw_cli_incomplete (const pw_cli_line *l, pw_error *error) {
  if (!pw_stop) return pw_fail (error, PW_METHOD, "--limit %s: stopped; results are incomplete", l->limit);
  pw_cli_say ("pinwheel: interrupted; results are incomplete\n");
  return PW_INTERRUPTED;
}

int pw_cli_adaptive (const char *method) {
  const pw_method *integrator;
  int stabilisation;
  if (pw_method_parse (method, &integrator, &stabilisation, NULL) != PW_OK) return -1;
  return pw_method_adaptive (integrator, method);
}

void pw_cli_unused (const char *method, const pw_cli_line *l) {
  int adaptive = pw_cli_adaptive (method);
  if (adaptive == 1 && l->step && !l->rtol && !l->atol)
    pw_cli_say ("pinwheel: --step has no effect: %s chooses its steps by --rtol, --atol\n", method);
  if (adaptive == 0 && l->max_steps)
    pw_cli_say ("pinwheel: --max-steps has no effect: %s takes as many steps as --step requires\n", method);
  if (adaptive == 0 && (l->rtol || l->atol) && !l->step)
    pw_cli_say ("pinwheel: --%s has no effect: %s takes steps of --step\n", l->rtol ? "rtol" : "atol", method);
}
