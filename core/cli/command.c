/* Command lines: reads the options of a command into its structure, prints help, and checks values. */
#include <errno.h>
#include <gsl/gsl_errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"

enum {
  COMMAND_HELP = 1000, /* number of --help, which poptGetNextOpt returns; those of other options are 1, 2, ... */
  COMMAND_WIDTH = 80   /* characters of a line of help */
};

static const struct poptOption command_help_option = { "help", '?',          POPT_ARG_NONE,
                                                       NULL,   COMMAND_HELP, "Show this help and exit",
                                                       NULL };

static int command_is_end (const struct poptOption *o) {
  return o->longName == NULL && o->descrip == NULL;
}

/* Makes popt's table: the command's options, each pointing into its structure, and --help.  PW_OK or PW_RESOURCE. */
static int command_bind (pw_cli_line *line, const struct poptOption *options) {
  size_t n = 0;
  while (!command_is_end (options + n)) n++;
  line->options = calloc (n + 2, sizeof *line->options);
  line->text = calloc (n + 2, sizeof *line->text);
  if (line->options == NULL || line->text == NULL) return PW_RESOURCE;
  n = 0;
  for (const struct poptOption *o = options; !command_is_end (o); o++) {
    if (o->longName == NULL) continue; /* a heading */
    line->options[n] = *o;
    line->options[n].arg = (char *)line + (size_t)o->arg;
    line->options[n].val = (int)n + 1;
    n++;
  }
  line->options[n] = command_help_option;
  return PW_OK;
}

/* Keeps the text or list that popt has allocated for option i, to release it even if the member of the structure
 * changes.  If an option is repeated, a list grows; a text is refused, under either name of the option. */
static int command_keep (const pw_command *command, pw_cli_line *line, int i, pw_error *error) {
  const struct poptOption *o = line->options + i;
  unsigned type = o->argInfo & POPT_ARG_MASK;
  int given = 0;
  for (int j = 0; line->options[j].longName; j++) given |= line->options[j].arg == o->arg && line->text[j] != NULL;
  if (type == POPT_ARG_STRING) free (line->text[i]);
  if (type == POPT_ARG_STRING || type == POPT_ARG_ARGV) line->text[i] = *(void **)o->arg;
  if (type != POPT_ARG_STRING || !given) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: option --%s is given twice", command->name, o->longName);
}

static void command_option_help (const struct poptOption *o) {
  enum { COLUMN = 28 };
  const char *letter = o->shortName ? PW_PRINTED (8, "-%c,", o->shortName) : "   ";
  int is_list = (o->argInfo & POPT_ARG_MASK) == POPT_ARG_ARGV;
  const char *left = PW_PRINTED (80, "  %s --%s%s%s", letter, o->longName, o->argDescrip ? is_list ? " " : "=" : "",
                                 o->argDescrip ? o->argDescrip : "");
  if (strlen (left) > COLUMN - 2)
    printf ("%s\n%*s", left, COLUMN, "");
  else
    printf ("%-*s", COLUMN, left);
  pw_cli_print_wrapped (o->descrip, COLUMN, COMMAND_WIDTH);
}

static void command_help (const pw_command *command) {
  printf ("Usage: pinwheel %s %s\n", command->name, command->synopsis);
  pw_cli_print_wrapped (command->help, 0, COMMAND_WIDTH);
  for (const struct poptOption *o = command->options; !command_is_end (o); o++)
    if (o->longName == NULL)
      printf ("\n%s:\n", o->descrip);
    else if (o->descrip)
      command_option_help (o);
  puts ("\nOther:");
  command_option_help (&command_help_option);
}

/* Writes the commands that have an option of this name, " (an option of sweep, drift)"; "" if none has. */
static const char *command_others (const pw_command *const *all, const char *name, char text[PW_HINT]) {
  int used = 0;
  *text = 0;
  for (; all && *all; all++)
    for (const struct poptOption *o = (*all)->options; !command_is_end (o); o++)
      if (o->longName && o->descrip && strcmp (o->longName, name) == 0 && used < PW_HINT)
        used += snprintf (text + used, (size_t)(PW_HINT - used), "%s%s", used ? ", " : " (an option of ", (*all)->name);
  if (used > 0 && used < PW_HINT - 1) strcat (text, ")");
  return text;
}

static int command_refuse (const pw_command *command, const pw_command *const *all, const pw_cli_line *line, int code,
                           pw_error *error) {
  const char *option = poptBadOption (line->popt, POPT_BADOPTION_NOALIAS), *name = option + strspn (option, "-");
  if (code == POPT_ERROR_NOARG) return pw_fail (error, PW_INPUT, "%s: option %s needs a value", command->name, option);
  if (code != POPT_ERROR_BADOPT)
    return pw_fail (error, PW_INPUT, "%s: option %s: %s", command->name, option, poptStrerror (code));
  pw_nearest near = { .sought = PW_PART (name, strcspn (name, "=")) };
  for (const struct poptOption *o = line->options; o->longName; o++)
    if (o->descrip) pw_nearest_try (&near, o->longName);
  const char *hint = near.near ? PW_PRINTED (140, "did you mean \"--%s\"?", near.best)
                               : PW_PRINTED (140, "see pinwheel %s --help", command->name);
  return pw_fail (error, PW_INPUT, "%s has no option \"%.*s\"%s; %s", command->name, (int)strcspn (option, "="), option,
                  command_others (all, near.sought, (char[PW_HINT]){ 0 }), hint);
}

int pw_cli_at_most_one (const pw_command *command, const pw_cli_line *line, pw_error *error) {
  if (line->arguments <= 1) return PW_OK;
  return pw_fail (error, PW_INPUT, "unexpected argument \"%s\"; usage: pinwheel %s %s", line->argument[1],
                  command->name, command->synopsis);
}

/* Reads the command line.  PW_OK; 1 if help was requested and has been printed; or a negative status. */
static int command_read (const pw_command *command, const pw_command *const *all, pw_cli_line *line, int argc,
                         const char **argv, pw_error *error) {
  errno = 0;
  if (command_bind (line, command->options) == PW_OK)
    line->popt = poptGetContext (argv[0], argc, argv, line->options, 0);
  if (line->popt == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int number = poptGetNextOpt (line->popt);
  for (; number > 0 && number != COMMAND_HELP; number = poptGetNextOpt (line->popt))
    if (command_keep (command, line, number - 1, error) != PW_OK) return error->status;
  if (errno == ENOMEM)
    return pw_fail (error, PW_RESOURCE, "out of memory"); /* popt omits texts that it cannot allocate */
  if (number == COMMAND_HELP) {
    command_help (command);
    return 1;
  }
  if (number < -1) return command_refuse (command, all, line, number, error); /* -1: no more options */
  line->argument = poptGetArgs (line->popt);
  while (line->argument && line->argument[line->arguments]) line->arguments++;
  for (const struct poptOption *o = command->options; !command_is_end (o); o++) {
    if (o->val == 0) continue; /* no number: PW_NUMBER_OPTION */
    pw_cli_given *x = (pw_cli_given *)(void *)((char *)line + (size_t)o->arg);
    const char *option = PW_PRINTED (40, "--%s", o->longName);
    if (pw_cli_number (option, x->text, (pw_domain)(o->val - 1), &x->number, error) != PW_OK) return error->status;
  }
  if (command->any_arguments) return PW_OK;
  if (line->arguments == 0)
    return pw_fail (error, PW_INPUT, "missing argument; usage: pinwheel %s %s", command->name, command->synopsis);
  return pw_cli_at_most_one (command, line, error);
}

static void command_close (pw_cli_line *line) {
  for (int i = 0; i < PW_FILES; i++) /* files that have not been completed */
    if (line->files.output[i]) pw_output_discard (line->files.output[i]);
  pw_folder_close (&line->files.folder);
  pw_arena_free (&line->arena);
  pw_cli_close_model (&line->m);
  for (pw_file **f = line->method_file; f && *f; f++) pw_file_close (*f);
  free (line->method_file);
  free (line->methods);
  for (size_t i = 0; line->options && line->text && line->options[i].longName; i++) {
    char **list = (line->options[i].argInfo & POPT_ARG_MASK) == POPT_ARG_ARGV ? line->text[i] : NULL;
    for (; list && *list; list++) free (*list);
    free (line->text[i]);
  }
  if (line->popt) poptFreeContext (line->popt);
  free (line->text);
  free (line->options);
  free (line);
}

int pw_cli_main (const pw_command *command, const pw_command *const *all, int argc, const char **argv) {
  gsl_set_error_handler_off (); /* the default handler ends the program */
  pw_stop_release ();
  pw_error error = { 0 };
  int exit_status = 0; /* that of errors follows from `error` */
  pw_cli_line *line = calloc (1, command->options_size);
  int status =
      line ? command_read (command, all, line, argc, argv, &error) : pw_fail (&error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) exit_status = command->function (line, &error);
  if (line) command_close (line);
  return exit_status > 0 ? exit_status : pw_cli_report_error (&error);
}

int pw_cli_requires (const char *option, const char *value, const char *required, int is_given, pw_error *error) {
  if (value == NULL || is_given) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s %s: only with %s", option, value, required);
}

int pw_cli_number (const char *option, const char *text, pw_domain domain, double *value, pw_error *error) {
  if (text == NULL) return PW_OK;
  double number;
  int status = pw_read_expression (text, &number);
  if (status == PW_RESOURCE) return pw_fail (error, status, "out of memory");
  if (status != PW_OK)
    return pw_fail (error, status, "%s: \"%s\" is not a number%s", option, text, PW_NUMBER_HINT (text));
  const char *expected = pw_domain_check (domain, number);
  if (*expected) return pw_fail (error, PW_INPUT, "%s %s: expected %s", option, text, expected);
  *value = number;
  return PW_OK;
}

size_t pw_cli_part (const char *text, char end) {
  size_t n = 0;
  for (int depth = 0; text[n] && (text[n] != end || depth > 0); n++) depth += (text[n] == '(') - (text[n] == ')');
  return n;
}

int pw_cli_range (const char *option, const char *text, pw_range *range, pw_error *error) {
  const char *equals = strchr (text, '='), *begin = equals ? equals + 1 : text;
  const int old = strncmp (begin, "lin:", 4) == 0 || strncmp (begin, "log:", 4) == 0;
  double number[3] = { 0 };
  char hint[PW_HINT] = "";
  int n = 0, good = 1;
  *range = (pw_range){ .logarithmic = old && begin[1] == 'o' };
  for (const char *c = begin + 4 * old; c && good;) {
    const size_t size = pw_cli_part (c, ':');
    const char *part = PW_PART (c, size);
    pw_number_hint (part, hint, sizeof hint);
    c = c[size] ? c + size + 1 : NULL;
    if (n >= 2 && c == NULL && strcmp (part, "log") == 0)
      range->logarithmic = 1;
    else
      good = n < 3 && pw_read_expression (part, &number[n]) == PW_OK && isfinite (number[n++]);
  }
  range->low = number[0], range->high = number[1];
  if (!good || n < 2 || !isfinite (range->high - range->low))
    return pw_fail (error, PW_INPUT, "%s %s: expected %sLOW:HIGH[:COUNT][:log], numbers%s", option, text,
                    equals ? "NAME=" : "", hint);
  if (n == 3 && *pw_domain_check (PW_COUNT, number[2]))
    return pw_fail (error, PW_INPUT, "%s %s: expected a count that is a whole number >= 1", option, text);
  range->count = (long)number[2];
  if (range->logarithmic && !(range->low > 0 && range->high > 0))
    return pw_fail (error, PW_INPUT, "%s %s: the ends of a logarithmic range must be > 0", option, text);
  if (old)
    pw_cli_say ("pinwheel: %s %s: an old spelling of %.*s%s%s\n", option, text, (int)(begin - text), text, begin + 4,
                range->logarithmic ? ":log" : "");
  return PW_OK;
}

static int axis_fail (const pw_axis *axis, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: %s", axis->name, axis->text, why);
}

int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error) {
  *axis = (pw_axis){ .name = pw_arena_copy (arena, text) };
  if (axis->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  char *equals = strchr (axis->name, '=');
  if (equals == NULL || equals == axis->name || equals[1] == 0)
    return pw_fail (error, PW_INPUT, "--vary %.200s: expected NAME=LOW:HIGH[:COUNT][:log] or a list NAME=V1,V2,...",
                    text);
  *equals = 0, axis->text = equals + 1;
  if (axis->text[pw_cli_part (axis->text, ':')]) {
    if (pw_cli_range ("--vary", text, &axis->range, error) != PW_OK) return error->status;
    const int one = axis->range.low == axis->range.high;
    axis->count = axis->range.count ? axis->range.count : one ? 1 : PW_AXIS_VALUES;
    if ((double)axis->count > PW_AXIS_MOST) return axis_fail (axis, "too many values: at most 1e8 rows", error);
    if (axis->count == 1 && !one)
      return axis_fail (axis, "a range with two different ends needs at least 2 values", error);
    return PW_OK;
  }
  axis->count = 1;
  for (const char *c = axis->text; c[pw_cli_part (c, ',')]; axis->count++) c += pw_cli_part (c, ',') + 1;
  axis->value = pw_arena_alloc (arena, (size_t)axis->count * sizeof *axis->value);
  if (axis->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const char *c = axis->text;
  for (long i = 0; i < axis->count; i++, c += pw_cli_part (c, ',') + 1) {
    const char *part = PW_PART (c, pw_cli_part (c, ','));
    if (pw_read_expression (part, &axis->value[i]) != PW_OK || !isfinite (axis->value[i]))
      return axis_fail (axis, PW_PRINTED (240, "\"%s\" is not a finite number%s", part, PW_NUMBER_HINT (part)), error);
  }
  return PW_OK;
}

/* The ends are exact.  Values between them are divided only once, so that they are rounded as little as possible: the
 * fourth value of 0:1:11 is 0.3. */
double pw_axis_value (const pw_axis *axis, long i) {
  if (axis->value) return axis->value[i];
  const double low = axis->range.low, high = axis->range.high, last = (double)(axis->count - 1), k = (double)i;
  if (i == 0 || low == high) return low;
  if (i == axis->count - 1) return high;
  if (axis->range.logarithmic) return pow (10, (log10 (low) * (last - k) + log10 (high) * k) / last);
  double value = (low * (last - k) + high * k) / last;
  if (isfinite (value)) return value;
  return low / last * (last - k) + high / last * k; /* the products were too large */
}

void pw_cli_settings (const pw_cli_line *line, const pw_run_defaults *defaults, pw_settings *settings,
                      pw_limit *limit) {
  *limit = (pw_limit){ .seconds = pw_cli_given_or (line->limit, INFINITY) };
  *settings =
      (pw_settings){ .span = pw_cli_given_or (line->t_end, defaults->t_end),
                     .step = pw_cli_given_or (line->step, defaults->step),
                     .rtol = pw_cli_given_or (line->rtol, defaults->rtol),
                     .atol = line->atol.number,
                     .max_steps = (long)pw_cli_given_or (line->max_steps, PW_MAX_STEPS), /* PW_COUNT: at most 1e9 */
                     .stop = pw_limit_over,
                     .stop_context = limit,
                     .methods = line->methods };
}

int pw_cli_incomplete (const pw_cli_line *line, pw_error *error) {
  if (!pw_stop) return pw_fail (error, PW_METHOD, "--limit %s: stopped; results are incomplete", line->limit.text);
  pw_cli_say ("pinwheel: interrupted; results are incomplete\n");
  return PW_INTERRUPTED;
}

int pw_cli_adaptive (const pw_method *const *own, const char *method) {
  const pw_method *integrator;
  if (pw_method_parse (method, own, &integrator, NULL, NULL) != PW_OK) return -1;
  return pw_method_adaptive (integrator, method);
}

void pw_cli_report_unused (const char *method, const pw_cli_line *line) {
  int adaptive = pw_cli_adaptive (line->methods, method);
  if (adaptive == 1 && line->step.text && !line->rtol.text && !line->atol.text)
    pw_cli_say ("pinwheel: --step has no effect: %s chooses its steps by --rtol, --atol\n", method);
  if (adaptive == 0 && line->max_steps.text)
    pw_cli_say ("pinwheel: --max-steps has no effect: %s takes as many steps as --step requires\n", method);
  if (adaptive == 0 && (line->rtol.text || line->atol.text) && !line->step.text)
    pw_cli_say ("pinwheel: --%s has no effect: %s takes steps of --step\n", line->rtol.text ? "rtol" : "atol", method);
}

/* The model of a command line: opens it with --set and --start; its parameters, changed initial values and defaults. */

int pw_cli_assignment (const char *option, const char *text, const char *form, char name[PW_ASSIGNED_NAME],
                       double *value, pw_error *error) {
  const char *equals = strchr (text, '=');
  if (equals == NULL || equals == text || equals - text >= PW_ASSIGNED_NAME)
    return pw_fail (error, PW_INPUT, "%s %s: expected %s", option, text, form);
  snprintf (name, PW_ASSIGNED_NAME, "%.*s", (int)(equals - text), text);
  int status = pw_read_expression (equals + 1, value);
  if (status == PW_RESOURCE) return pw_fail (error, status, "out of memory");
  if (status == PW_OK) return status;
  return pw_fail (error, status, "%s %s: \"%s\" is not a number%s", option, text, equals + 1,
                  PW_NUMBER_HINT (equals + 1));
}

/* The system of a model with its defaults; NULL if there is none. */
static pw_system *cli_default_system (const pw_file *file) {
  pw_model *m = pw_file_model (file, NULL);
  pw_system *s = m && pw_model_build (m, NULL) == PW_OK ? pw_system_compile (m, NULL) : NULL;
  pw_model_free (m);
  return s;
}

int pw_cli_is_state (const pw_file *file, const char *name) {
  if (strchr (name, '.')) return 1;
  pw_system *s = cli_default_system (file);
  const int found = s && pw_system_find_state (s, name, NULL) >= 0;
  pw_system_free (s);
  return found;
}

int pw_cli_no_parameter (const pw_file *file, pw_model *m, const char *name, int states, pw_error *error) {
  pw_system *s = cli_default_system (file);
  pw_nearest state = { .sought = name }, parameter = state;
  for (const pw_parameter *p = pw_model_table (m)->parameters; p && p->name; p++) pw_nearest_try (&parameter, p->name);
  for (int i = 0; s && i < 2 * pw_system_coordinates (s); i++)
    if (!pw_system_state_hidden (s, i)) pw_nearest_try (&state, PW_NAME (pw_system_state_name, s, i));
  pw_system_free (s);
  if (parameter.near || !state.near) return pw_model_set (m, name, 0, error);
  return pw_fail (error, PW_INPUT, "model %s has no parameter%s \"%s\"; did you mean %s\"%s\"?", pw_model_name (m),
                  states ? " or state" : "", name, states ? "" : "--start ", state.best);
}

static int cli_set_other (const pw_cli_line *line, pw_model *m, const char *text, const char *name, pw_error *error) {
  const char *included = pw_file_included_parameter (line->m.file, name);
  if (pw_cli_is_state (line->m.file, name))
    return pw_fail (error, PW_INPUT, "--set %s: expected a parameter; initial values of states are given by --start",
                    text);
  if (included == NULL) return pw_cli_no_parameter (line->m.file, m, name, 0, error);
  return pw_fail (
      error, PW_INPUT,
      "--set %s: %s is a parameter of an included file; the model sets it by \"set: {%s: NAME}\" in the entry "
      "of that file, from a parameter NAME of its own",
      text, included, included);
}

int pw_cli_apply (const pw_cli_line *line, pw_model *m, pw_error *error) {
  for (int starts = 0; starts < 2; starts++)
    for (const char **text = starts ? line->starts : line->sets; text && *text; text++) {
      char name[PW_ASSIGNED_NAME];
      double value;
      int status = pw_cli_assignment (starts ? "--start" : "--set", *text, "NAME=VALUE", name, &value, error);
      if (status != PW_OK) return status;
      const int is_parameter = pw_cli_parameter (m, name) != NULL;
      if (is_parameter && starts)
        return pw_fail (error, PW_INPUT, "--start %s: %s is a parameter, expected a state; use --set", *text, name);
      status = starts         ? pw_model_set_initial (m, name, value, error)
               : is_parameter ? pw_model_set (m, name, value, error)
                              : cli_set_other (line, m, *text, name, error);
      if (status != PW_OK) return status;
    }
  return PW_OK;
}

const pw_parameter *pw_cli_parameter (const pw_model *m, const char *name) {
  const pw_parameter *p = pw_model_table (m)->parameters;
  while (p && p->name && strcmp (p->name, name) != 0) p++;
  return p && p->name ? p : NULL;
}

static int cli_check_method (const pw_cli_line *line, int i, const char *path, pw_error *error) {
  static const char sign[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
  const char *name = line->methods[i]->name;
  const pw_method *found;
  if (name == NULL || *name == 0 || name[strspn (name, sign)] || strcmp (name, "all") == 0)
    return pw_fail (error, PW_INPUT, "--method-file %s: a method is called \"%s\": expected letters, digits, _ and -%s",
                    path, name ? name : "", name && strcmp (name, "all") == 0 ? ", but not all, which means each" : "");
  if (pw_method_parse (name, line->methods, &found, NULL, error) != PW_OK) return error->status;
  if (found == line->methods[i]) return PW_OK;
  return pw_fail (error, PW_INPUT, "--method-file %s: there is a method %s already; give this one another name", path,
                  name);
}

static int cli_method_files (pw_cli_line *line, pw_error *error) {
  size_t files = 0, count = 0;
  while (line->method_files && line->method_files[files]) files++;
  if (files > 0 && (line->method_file = calloc (files + 1, sizeof *line->method_file)) == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t i = 0; i < files; i++) {
    const char *path = line->method_files[i];
    pw_error why = { 0 };
    if ((line->method_file[i] = pw_file_open (path, &why)) == NULL)
      return pw_fail (error, why.status, "--method-file: %s", why.text);
    const pw_method *const *m = pw_file_table (line->method_file[i])->methods;
    size_t more = 0;
    while (m && m[more]) more++;
    if (more == 0)
      return pw_fail (error, PW_INPUT, "--method-file %s: there is no method: expected PW_METHOD_FILE (...) at its end",
                      path);
    const pw_method **list = realloc (line->methods, (count + more + 1) * sizeof *list);
    if (list == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
    line->methods = list;
    memcpy (list + count, m, (more + 1) * sizeof *list);
    for (; more-- > 0; count++)
      if (cli_check_method (line, (int)count, path, error) != PW_OK) return error->status;
  }
  return PW_OK;
}

static int cli_read_specialise (pw_cli_line *line, pw_error *error) {
  static const char *const name[] = { "auto", "always", "never", NULL };
  char hint[PW_HINT];
  int i = line->specialise ? pw_find_name (name, sizeof *name, line->specialise, hint) : PW_SPECIALISE_AUTO;
  if (i < 0)
    return pw_fail (error, PW_INPUT, "--specialise \"%.60s\": expected auto, always or never%s", line->specialise,
                    hint);
  line->when = (pw_specialise)i;
  return PW_OK;
}

int pw_cli_file (pw_cli_line *line, pw_error *error) {
  const double largest = PW_FILE_MAX_BYTES >> 20; /* [MB] */
  const double size = pw_cli_given_or (line->max_file, PW_FILE_DEFAULT_BYTES >> 20);
  if (size < 1e-3) return pw_fail (error, PW_INPUT, "--max-file %s: expected at least 0.001 MB", line->max_file.text);
  if (size > largest)
    return pw_fail (error, PW_INPUT, "--max-file %s: expected at most %g MB", line->max_file.text, largest);
  line->m.file = pw_file_open_limited (line->argument[0], (size_t)(size * (1 << 20)), error);
  if (line->m.file == NULL || cli_method_files (line, error) != PW_OK || cli_read_specialise (line, error) != PW_OK)
    return error->status;
  pw_run_defaults *d = &line->m.defaults;
  *d = pw_file_table (line->m.file)->run;
  if (d->t_end == 0) d->t_end = 10;
  if (d->step == 0) d->step = 1e-3;
  if (d->method == NULL) d->method = "rk4+projection";
  return PW_OK;
}

int pw_cli_open (pw_cli_line *line, pw_error *error) {
  pw_cli_model *m = &line->m;
  if (pw_cli_file (line, error) == PW_OK) m->model = pw_file_model (m->file, error);
  if (m->model && pw_cli_apply (line, m->model, error) == PW_OK && pw_model_build (m->model, error) == PW_OK)
    m->system = pw_system_compile (m->model, error);
  return m->system ? PW_OK : error->status;
}

void pw_cli_close_model (pw_cli_model *m) {
  pw_system_free (m->system);
  pw_model_free (m->model);
  pw_file_close (m->file);
  *m = (pw_cli_model){ .file = NULL };
}

void pw_cli_report_tables (const pw_system *s, double t_end) {
  char notice[PW_NOTICE_BYTES];
  for (int i = 0; i < pw_system_signals (s); i++)
    if (*pw_system_table_notice (s, i, t_end, notice, sizeof notice)) pw_cli_say ("pinwheel: %s\n", notice);
}

pw_state_change pw_cli_state_change (const pw_system *system, const pw_initial_report *initial, int state) {
  int n = pw_system_coordinates (system);
  pw_state_change change = { .unit = pw_system_state_unit (system, state),
                             .given = state < n ? initial->q_given[state] : initial->v_given[state - n],
                             .consistent = state < n ? initial->q[state] : initial->v[state - n] };
  pw_system_state_name (system, state, change.name, sizeof change.name);
  return change;
}

double pw_cli_largest_change (const pw_run *r, const pw_system *s, char text[PW_CHANGE_TEXT]) {
  const pw_initial_report *initial = pw_run_initial (r);
  const int n = pw_system_coordinates (s);
  double largest = 0;
  int state = -1;
  for (int i = 0; i < 2 * n; i++) {
    if (!pw_initial_given (initial, i) || !pw_initial_moved (s, initial, i)) continue;
    const double change = i < n ? initial->q[i] - initial->q_given[i] : initial->v[i - n] - initial->v_given[i - n];
    if (fabs (change) > largest) largest = fabs (change), state = i;
  }
  if (state < 0) return 0;
  const pw_state_change c = pw_cli_state_change (s, initial, state);
  pw_print (text, PW_CHANGE_TEXT, "%s from %s to %s %s", c.name, PW_DIGITS (c.given, 10), PW_DIGITS (c.consistent, 10),
            c.unit);
  return largest;
}

const char *pw_cli_short_path (const char *path) {
  char folder[4096];
  size_t n = getcwd (folder, sizeof folder) ? strlen (folder) : 0;
  return n > 1 && strncmp (path, folder, n) == 0 && path[n] == '/' ? path + n + 1 : path;
}
