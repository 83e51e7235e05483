/* pinwheel new: writes a small commented model to start from. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "cli.h"

/* new-model.c.in and new-model.yaml.in line by line, as new_model_c and new_model_yaml; the Makefile makes this file of
 * them. */
#include "new.inc"

/* "folder/my_car.c" gives "my_car" and ".c"; PW_INPUT if a model could not be found under that name. */
static int new_name (const char *path, char *name, size_t size, const char **ending, pw_error *error) {
  const char *base = strrchr (path, '/');
  base = base ? base + 1 : path;
  size_t n = strspn (base, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-");
  *ending = base + n;
  if (n == 0 || n >= size || base[0] == '-' || (strcmp (*ending, ".c") != 0 && strcmp (*ending, ".yaml") != 0))
    return pw_fail (error, PW_INPUT,
                    "\"%s\": a model file's name is made of letters, digits, _ and -, and ends in .c or .yaml", path);
  snprintf (name, size, "%.*s", (int)n, base);
  return PW_OK;
}

/* Each % stands for the model's name. */
static void new_print (FILE *f, const char *name, const char *const *line) {
  for (; *line; line++)
    for (const char *c = *line; *c; c++)
      if (*c == '%')
        fputs (name, f);
      else
        fputc (*c, f);
}

static int new_write (const char *path, pw_error *error) {
  char name[100];
  const char *ending;
  if (new_name (path, name, sizeof name, &ending, error) != PW_OK) return PW_INPUT;
  FILE *f = fopen (path, "wx"); /* never over a file that is there */
  if (f == NULL && errno == EEXIST) return pw_fail (error, PW_INPUT, "%s exists already and was not changed", path);
  if (f == NULL) return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, strerror (errno));
  new_print (f, name, ending[1] == 'y' ? new_model_yaml : new_model_c);
  errno = 0;
  int bad = fflush (f) != 0 || ferror (f), why = errno;
  if (fclose (f) != 0 && !bad) bad = 1, why = errno;
  if (bad) {
    remove (path);
    return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, strerror (why));
  }
  pw_cli_print (stdout, "%s is written; now:  pinwheel run %s%s\n", path, strchr (path, '/') ? "" : "./", path);
  return PW_OK;
}

static int new_command (void *options, pw_error *error) {
  return new_write (((const pw_cli_line *)options)->argument[0], error);
}

const pw_command pw_cli_new = {
  .name = "new",
  .synopsis = "NAME.c|NAME.yaml",
  .summary = "write a small commented model to start from",
  .help = "Write a small commented model, in C or as text, to start from. Existing files are never overwritten.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_cli_line),
  .function = new_command,
  .options = (const struct poptOption[]){ POPT_TABLEEND },
};
