/* Compares specialised runs of a model with those of the general engine; see specialise_agree.h. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "specialise_agree.h"

/* Compares the states of two tables, the columns before forces; *most is the largest difference relative to 1 +
 * |value|. */
static int agree_compare (const char *a, const char *b, double *most) {
  char x[200000], *line = x, *rest, *other;
  const char *text = cli_file (a);
  int columns = 0, rows = 0;
  *most = 0;
  if (text == NULL || strlen (text) >= sizeof x) return 0;
  snprintf (x, sizeof x, "%s", text);
  const char *y = cli_file (b), *force = strstr (x, " [N");
  for (const char *c = x; *c && *c != '\n' && (force == NULL || c < force); c++) columns += *c == ',';
  while (y && (line = strchr (line, '\n')) != NULL && (y = strchr (y, '\n')) != NULL && line[1]) {
    rows++;
    for (int i = 0; i < columns; i++, line = rest, y = other) {
      double u = strtod (line + 1, &rest), w = strtod (y + 1, &other);
      if (rest == line + 1 || other == y + 1) return 0;
      *most = fmax (*most, fabs (u - w) / (1 + fabs (u)));
    }
  }
  return columns > 6 && rows > 1 && y != NULL && y[1] == 0;
}

/* 1 if the runs were compared, 0 if both failed alike. */
static int agree_by (const char *model, const char *method, double bound) {
  char command[900];
  double most;
  const char *t = strcmp (model, "andrews-squeezer") == 0 ? "0.02" : "0.5";
  snprintf (command, sizeof command,
            "rm -f @/?.csv; pinwheel run %s -m %s -t %s --every 0.01 -o @/a.csv --specialise always >/dev/null; a=$?\n"
            "pinwheel run %s -m %s -t %s --every 0.01 -o @/b.csv --specialise never >/dev/null; b=$?\n"
            "[ $a = $b ] && echo $a",
            model, method, t, model, method, t);
  if (cli_run (command) != 0) print_error ("%s, %s: other exit status\n%s", model, method, cli_err);
  assert_true (*cli_out);
  if (strcmp (cli_out, "0\n") != 0) return 0;
  const int complete = agree_compare ("a.csv", "b.csv", &most);
  if (!complete || !(most <= bound)) print_error ("%s, %s: %g\n", model, method, most);
  assert_true (complete && most <= bound);
  return 1;
}

/* A short time, in which round-off does not grow to the bound.  Steps of adaptive methods amplify it up to the errors
 * they allow, those of multistep methods to about 1000 tolerances. */
void specialise_agree (const char *model) {
  static const struct {
    const char *name;
    double bound;
  } method[] = { { "rk4+projection", 1e-10 },
                 { "rk4", 1e-10 },
                 { "rk4+baumgarte", 1e-10 },
                 { "rk4+nullspace", 1e-10 },
                 { "erk8+projection --rtol 1e-11", 1e-10 },
                 { "erk5+projection --rtol 1e-11", 1e-10 },
                 { "bdf+projection --rtol 1e-9", 1e-6 },
                 { "ida+ggl --rtol 1e-9", 1e-6 },
                 { "galpha", 1e-10 },
                 { "leapfrog", 1e-10 } };
  int compared = 0;
  for (size_t i = 0; i < sizeof method / sizeof *method; i++)
    compared += agree_by (model, method[i].name, method[i].bound);
  assert_true (compared >= 4);
}
