/* Specialised runs of every model of the gallery agree with those of the general engine. */
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "specialise_agree.h"

TEST (gallery) {
  static char list[20000];
  cli_good ("pinwheel list models | awk '/^  [a-z]/ { print $1 }'");
  snprintf (list, sizeof list, "%.19999s", cli_out);
  assert_true (strlen (list) > 100);
  for (char *rest, *m = strtok_r (list, "\n", &rest); m; m = strtok_r (NULL, "\n", &rest)) specialise_agree (m);
}

const check_fixture fixture = { cli_setup, cli_teardown };
