/* pinwheel run --profile: its tables; results of the run stay the same. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* The numbers behind a name at the beginning of a line; returns how many. */
static int profile_row (const char *name, double *value, int most) {
  char head[40];
  int n = 0;
  snprintf (head, sizeof head, "\n  %s ", name);
  const char *at = strstr (cli_out, head);
  if (at == NULL) return -1;
  for (at += strlen (head); n < most;
       at = strchr (at, '%') && at[strspn (at, " ")] == '%' ? strchr (at, '%') + 1 : at) {
    char *end;
    at += strspn (at, " ");
    if (*at == '\n') break;
    value[n] = strtod (at, &end);
    if (end == at) break;
    n++;
    at = end;
  }
  return n;
}

static void profile_has (const char *name, int elements, int rows, int unknowns) {
  double value[9];
  int n = profile_row (name, value, 9);
  if (n < 5) fail_msg ("no row \"%s\" in\n%s", name, cli_out);
  assert_true (value[0] == elements && value[1] == rows && value[2] == unknowns);
  for (int i = 3; i < n; i++) assert_true (value[i] >= 0);
}

TEST (tables) {
  cli_good ("pinwheel run ezyroller --t-end 0.5 --profile");
  profile_has ("(bodies)", 2, 0, 6);
  profile_has ("pin", 1, 2, 2);
  profile_has ("wheel", 2, 2, 2);
  profile_has ("torque", 1, 0, 0);
  static const char *const stages[] = { "kinematics", "equations", "factorisation", "solution", "together" };
  double value[4], all[4];
  assert_int_equal (profile_row ("together", all, 4), 4);
  for (int i = 0; i < 5; i++) {
    assert_int_equal (profile_row (stages[i], value, 4), 4);
    assert_true (value[0] > 0 && value[2] > value[0]); /* three evaluations a step, and that after the projection */
  }
  assert_int_equal (profile_row ("projection", value, 2), 2);
  assert_true (value[0] > 0 && all[2] > all[0]);
  assert_null (strstr (cli_out, "stabilisation"));
  cli_good ("pinwheel run ezyroller --t-end 0.5 --method rk4+baumgarte --profile");
  assert_int_equal (profile_row ("stabilisation", value, 4), 4);
  assert_int_equal (profile_row ("projection", value, 4), -1);
}

/* Times of the two engines are told apart. */
TEST (engines) {
  cli_good ("pinwheel run ezyroller --t-end 0.5 --profile");
  assert_null (strstr (cli_out, "specialised code"));
  cli_good ("export XDG_CACHE_HOME=@/cache; pinwheel run ezyroller --t-end 0.5 --specialise always --profile");
  assert_non_null (strstr (cli_out, "`together` is by specialised code"));
}

/* An implicit method's steps are not made of evaluations of the accelerations. */
TEST (implicit) {
  double value[4];
  cli_good ("pinwheel run ezyroller --t-end 0.5 --method ida+ggl --profile");
  assert_int_equal (profile_row ("solution", value, 4), 2);
  assert_int_equal (profile_row ("projection", value, 4), -1);
}

#define PROFILE_OTHER "pinwheel run ezyroller -t 0.5 -m rk4+projection:metric=identity --energy --every 0.1 -o -"

/* The table of a run is the same to the bit, and alone on standard output. */
TEST (unnoticed) {
  static char table[sizeof cli_out];
  cli_good (PROFILE_OTHER);
  memcpy (table, cli_out, sizeof table);
  assert_int_equal (cli_run (PROFILE_OTHER " --profile"), 0);
  assert_string_equal (cli_out, table);
  assert_non_null (strstr (cli_err, "together"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
