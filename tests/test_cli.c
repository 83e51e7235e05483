/* The program from outside: what it writes, what it says, and with which status it ends.
 *
 * PINWHEEL in the environment names the program, build/pinwheel otherwise; run from the top folder. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "check.h"
#include "runs.h"

/* ---- Running the program ---- */

static char cli_folder[] = "/tmp/pinwheel-cli-XXXXXX"; /* for whatever a test writes; @ in a command stands for it */
static char cli_out[200000], cli_err[20000];           /* what the last command wrote */

static int cli_slurp (const char *path, char *text, size_t size) {
  FILE *f = fopen (path, "r");
  if (f == NULL) return 0;
  size_t n = fread (text, 1, size - 1, f);
  text[n] = 0;
  fclose (f);
  return 1;
}

/* A file in the folder; NULL if there is none. */
static const char *cli_file (const char *name) {
  static char text[200000];
  char path[300];
  snprintf (path, sizeof path, "%s/%s", cli_folder, name);
  return cli_slurp (path, text, sizeof text) ? text : NULL;
}

/* Replaces every @ by the folder. */
static void cli_expand (const char *from, char *to, size_t size) {
  size_t n = 0;
  for (; *from && n + sizeof cli_folder < size; from++)
    if (*from == '@')
      n += (size_t)snprintf (to + n, size - n, "%s", cli_folder);
    else
      to[n++] = *from;
  to[n] = 0;
}

/* Runs a shell command in which `pinwheel` is the program and @ the folder; returns its exit status. */
static int cli_run (const char *command) {
  char expanded[2000], whole[3000], path[300];
  const char *program = getenv ("PINWHEEL");
  cli_expand (command, expanded, sizeof expanded);
  snprintf (whole, sizeof whole, "pinwheel () { '%s' \"$@\"; }\n{ %s\n} >%s/out 2>%s/err </dev/null",
            program ? program : "build/pinwheel", expanded, cli_folder, cli_folder);
  int status = system (whole);
  snprintf (path, sizeof path, "%s/out", cli_folder);
  assert_true (cli_slurp (path, cli_out, sizeof cli_out));
  snprintf (path, sizeof path, "%s/err", cli_folder);
  assert_true (cli_slurp (path, cli_err, sizeof cli_err));
  return WIFEXITED (status) ? WEXITSTATUS (status) : -1;
}

/* Runs a command that should succeed and say nothing on standard error. */
static void cli_good (const char *command) {
  int status = cli_run (command);
  if (status != 0 || cli_err[0]) print_error ("%s\nends with %d:\n%s", command, status, cli_err);
  assert_int_equal (status, 0);
  assert_string_equal (cli_err, "");
}

/* Runs a command that should end with a status and one line on standard error. */
static void cli_bad (const char *command, int status, const char *message) {
  char text[1000], expanded[900];
  cli_expand (message, expanded, sizeof expanded);
  snprintf (text, sizeof text, "pinwheel: %s\n", expanded);
  int got = cli_run (command);
  if (got != status || strcmp (cli_err, text) != 0)
    print_error ("%s\nends with %d:\n%sexpected %d:\n%s", command, got, cli_err, status, text);
  assert_int_equal (got, status);
  assert_string_equal (cli_err, text);
}

static void cli_write (const char *name, const char *text) {
  char path[300];
  snprintf (path, sizeof path, "%s/%s", cli_folder, name);
  FILE *f = fopen (path, "w");
  assert_non_null (f);
  fputs (text, f);
  assert_int_equal (fclose (f), 0);
}

/* ---- Reading summaries ---- */

/* The number after the keys, in order: cli_number (json, "bodies", "frame", "x", NULL). */
static double cli_number (const char *json, ...) {
  va_list keys;
  va_start (keys, json);
  for (const char *key = va_arg (keys, const char *); key; key = va_arg (keys, const char *)) {
    char quoted[60];
    snprintf (quoted, sizeof quoted, "\"%s\"", key);
    json = strstr (json, quoted);
    if (json == NULL) print_error ("no key %s\n", quoted);
    assert_non_null (json);
    json += strlen (quoted);
    json += strspn (json, " \n:");
  }
  va_end (keys);
  return strtod (json, NULL);
}

static int cli_says (const char *json, const char *key, const char *value) {
  char quoted[300];
  snprintf (quoted, sizeof quoted, "\"%s\"", key);
  json = strstr (json, quoted);
  if (json == NULL) return 0;
  json += strlen (quoted);
  json += strspn (json, " \n:");
  snprintf (quoted, sizeof quoted, "\"%s\"", value);
  return strncmp (json, quoted, strlen (quoted)) == 0;
}

/* ---- Runs ---- */

static void test_summary (void **state) {
  (void)state;
  double table[4 * 6];
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", 4, 6, table), 4);
  const double *x = table + 18;
  cli_good ("pinwheel run ezyroller --method rk4+projection --step 1e-3 --t-end 10 --energy --json -");
  const char *why = "(h omega)^4 / 10 at h = 1e-3";
  assert_true (cli_number (cli_out, "schema", NULL) == 1);
  assert_true (cli_says (cli_out, "model", "ezyroller") && cli_says (cli_out, "method", "rk4+projection"));
  assert_true (cli_says (cli_out, "status", "ok") && cli_says (cli_out, "reason", ""));
  assert_true (cli_number (cli_out, "t", NULL) == 10);
  check_close ("x1", cli_number (cli_out, "bodies", "frame", "x", NULL), x[1], 1e-11, why);
  check_close ("y1", cli_number (cli_out, "bodies", "frame", "y", NULL), x[2], 1e-11, why);
  check_close ("phi1", cli_number (cli_out, "bodies", "frame", "phi", NULL), x[3], 1e-11, why);
  check_close ("phi2", cli_number (cli_out, "bodies", "steer", "phi", NULL), x[4], 1e-11, why);
  double kinetic = cli_number (cli_out, "energy", "kinetic", NULL);
  check_close ("kinetic", kinetic, x[5], 1e-11, why);
  check_close ("work", cli_number (cli_out, "energy", "work", NULL), kinetic, 1e-12,
               "work of the torque = kinetic energy");
  check_close ("balance", cli_number (cli_out, "energy", "balance", NULL), 0, 1e-12, "the same");
  check_below ("position", cli_number (cli_out, "residual", "position", NULL), 16 * CHECK_EPS, "round-off");
  check_below ("velocity", cli_number (cli_out, "residual", "velocity", NULL), 16 * CHECK_EPS, "round-off");
  assert_true (cli_number (cli_out, "statistics", "steps", NULL) == 10000);
  assert_true (cli_number (cli_out, "statistics", "cpu_s", NULL) >= 0);
  check_close ("C.N", fabs (cli_number (cli_out, "reactions", "C.N", NULL)), 0.4, 64 * CHECK_EPS,
               "M / (c + d) at t = 10 s");
}

static void test_no_energy (void **state) {
  (void)state;
  cli_good ("pinwheel run ezyroller --t-end 0.1 --json @/summary.json");
  const char *json = cli_file ("summary.json");
  assert_non_null (json);
  json = strstr (json, "\"energy\"");
  assert_non_null (json);
  assert_int_equal (strncmp (json + 8 + strspn (json + 8, " \n:"), "null", 4), 0);
  assert_null (cli_file ("summary.json.part"));
}

static void test_defaults (void **state) {
  (void)state;
  cli_good (
      "pinwheel run ezyroller --set a=0.6 --start frame.phi=0.25 --t-end 0.001 --json - 2>/dev/null"); /* a notice: it was moved */
  check_close ("phi", cli_number (cli_out, "bodies", "frame", "phi", NULL), 0.25, 1e-6, "half of 1 rad/s^2 x 1e-6 s^2");
  assert_true (cli_says (cli_out, "method", "rk4+projection")); /* the model's own */
}

/* ---- Tables ---- */

static int cli_lines (const char *text) {
  int lines = 0;
  for (; *text; text++) lines += *text == '\n';
  return lines;
}

static void test_table (void **state) {
  (void)state;
  cli_good ("pinwheel run ezyroller --t-end 1 --every 0.1 --energy -o @/run.csv");
  const char *csv = cli_file ("run.csv");
  assert_non_null (csv);
  assert_int_equal (cli_lines (csv), 12);
  static const char *const columns[] = { "t [s],",  "frame.x [m],",    "frame.phi [rad],", "steer.omega [rad/s],",
                                         "A.x [m]", "A.y [m]", "B.Fx [N]",         "C.N [N]",
                                         "[J]" };
  const char *end = strchr (csv, '\n');
  for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
    const char *at = strstr (csv, columns[i]);
    if (at == NULL || at > end) print_error ("no column %s\n", columns[i]);
    assert_true (at && at < end);
  }
  assert_int_equal (strncmp (csv, "t [s],", 6), 0);
  int columns_there = 1;
  for (const char *c = csv; c < end; c++) columns_there += *c == ',';
  for (const char *line = end + 1; *line; line = strchr (line, '\n') + 1) {
    int n = 1;
    for (const char *c = line; *c != '\n'; c++) n += *c == ',';
    assert_int_equal (n, columns_there);
  }
  assert_null (cli_file ("run.csv.part"));
}

/* With -o - the table alone is on standard output, the same to the byte; everything else is on standard error. */
static void test_table_on_stdout (void **state) {
  (void)state;
  cli_good ("pinwheel run ezyroller --t-end 0.5 --every 0.05 -o @/a.csv");
  cli_good ("pinwheel run ezyroller --t-end 0.5 --every 0.05 -o -");
  assert_string_equal (cli_out, cli_file ("a.csv"));
  assert_int_equal (cli_lines (cli_out), 12);
}

/* Sampling alters no step: common rows are the same to the byte, however many there are between them. */
static void test_every (void **state) {
  (void)state;
  cli_good ("pinwheel run ezyroller --method ida+ggl --t-end 2 --every 0.5 -o @/few.csv\n"
            "pinwheel run ezyroller --method ida+ggl --t-end 2 --every 0.0625 -o @/many.csv\n"
            "grep -cxFf @/few.csv @/many.csv");
  assert_int_equal (atoi (cli_out), 6); /* the header and t = 0, 0.5, ... 2 */
}

/* A locale with a decimal comma changes nothing. */
static void test_locale (void **state) {
  (void)state;
  cli_good ("LC_ALL=C pinwheel run ezyroller --t-end 0.1 --every 0.05 -o @/c.csv");
  cli_good ("LC_ALL=de_DE.UTF-8 LC_NUMERIC=de_DE.UTF-8 pinwheel run ezyroller --t-end 0.1 --every 0.05 -o "
            "@/de.csv\ncmp @/c.csv @/de.csv");
}

/* ---- Other commands ---- */

static void test_list (void **state) {
  (void)state;
  cli_good ("pinwheel list");
  static const char *const expected[] = { "ezyroller", "rk4", "ida",   "projection", "ggl",    "baumgarte",
                                          "metric",    "pin", "wheel", "torque",     "heading" };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) assert_non_null (strstr (cli_out, expected[i]));
  cli_good ("pinwheel list models");
  assert_non_null (strstr (cli_out, "ezyroller"));
  assert_null (strstr (cli_out, "baumgarte"));
  cli_good ("pinwheel list methods");
  assert_null (strstr (cli_out, "ezyroller"));
  cli_good ("pinwheel list kinds");
  assert_non_null (strstr (cli_out, "a knife edge"));
}

static void test_show (void **state) {
  (void)state;
  cli_good ("pinwheel show ezyroller --set a=0.75");
  static const char *const expected[] = { "frame",        "steer", "pin B", "wheel A", "wheel C",
                                          "torque rider", "omega", "rad/s", "0.75",    "N m" };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) assert_non_null (strstr (cli_out, expected[i]));
  cli_good ("pinwheel show ezyroller --matrices");
  static const char *const named[] = { "frame.x", "steer.phi", "B.Fx", "B.Fy", "A.N", "C.N", "gamma" };
  for (size_t i = 0; i < sizeof named / sizeof *named; i++) assert_non_null (strstr (cli_out, named[i]));
  cli_good ("pinwheel show ezyroller --matrices --at 0.5");
  assert_non_null (strstr (cli_out, "0.5"));
}

static void test_help (void **state) {
  static const char *const command[] = { "list", "show", "run", "new" };
  (void)state;
  cli_good ("pinwheel");
  cli_good ("pinwheel --help");
  cli_good ("pinwheel --version");
  assert_int_equal (strncmp (cli_out, "pinwheel ", 9), 0);
  for (int i = 0; i < 4; i++) {
    char line[60];
    snprintf (line, sizeof line, "pinwheel %s --help", command[i]);
    cli_good (line);
    assert_non_null (strstr (cli_out, "--help"));
  }
}

/* `new` writes a model that runs as it is, and never over a file. */
static void test_new (void **state) {
  (void)state;
  cli_good ("pinwheel new @/mine.c");
  cli_good ("pinwheel show @/mine.c");
  cli_good ("pinwheel run @/mine.c --t-end 1 --json -");
  assert_true (cli_says (cli_out, "status", "ok") && cli_says (cli_out, "model", "mine"));
  cli_bad ("pinwheel new @/mine.c", 2, "@/mine.c is there already; it has been left as it is");
}

/* ---- Command lines that are wrong ---- */

static void test_bad_lines (void **state) {
  static const struct {
    const char *line, *message;
  } bad[] = {
    { "frob", "there is no command \"frob\"; did you mean \"show\"?" },
    { "--verbose", "there is no option \"--verbose\"; did you mean \"--version\"?" },
    { "run", "something is missing; write pinwheel run MODEL [OPTION...]" },
    { "run a b", "\"b\" is too much; write pinwheel run MODEL [OPTION...]" },
    { "run ezyroler", "there is no model \"ezyroler\"; did you mean \"ezyroller\"?" },
    { "run ezyroller --metod rk4", "run has no option \"--metod\"; did you mean \"--method\"?" },
    { "run ezyroller --method", "run: option --method needs a value" },
    { "run ezyroller --method rk5", "there is no integrator \"rk5\"; did you mean \"rk4\"?" },
    { "run ezyroller --method rk4+projecton",
      "integrator rk4 has no stabilisation \"projecton\"; did you mean \"projection\"?" },
    { "run ezyroller --method rk4+projection:metrik=mass",
      "method rk4+projection has no option \"metrik\"; did you mean \"metric\"?" },
    { "run ezyroller --step 0", "--step 0: expected a number > 0" },
    { "run ezyroller --step nan", "--step nan: expected a finite number" },
    { "run ezyroller --step 1,5", "--step: \"1,5\" is not a number" },
    { "run ezyroller --t-end -1", "--t-end -1: expected a number > 0" },
    { "run ezyroller --rtol 0", "--rtol 0: expected a number > 0" },
    { "run ezyroller --atol -1", "--atol -1: expected a number > 0" },
    { "run ezyroller --every 0", "--every 0: expected a number > 0" },
    { "run ezyroller --set aa=1", "model ezyroller has no parameter \"aa\"; did you mean \"a\"?" },
    { "run ezyroller --set m1=-1", "model ezyroller: parameter m1 = -1: expected a number > 0" },
    { "run ezyroller --set m1=nan", "model ezyroller: parameter m1 = nan: expected a finite number" },
    { "run ezyroller --set m1", "--set m1: expected NAME=VALUE" },
    { "run ezyroller --set m1=", "--set m1=: \"\" is not a number" },
    { "run ezyroller --set =1", "--set =1: expected NAME=VALUE" },
    { "run ezyroller --start frame.z=1", "model ezyroller has no state \"frame.z\"; did you mean \"frame.x\"?" },
    { "run ezyroller --start fram.x=1", "model ezyroller has no state \"fram.x\"; did you mean \"frame.x\"?" },
    { "run ezyroller --start frame.x=inf", "model ezyroller: start frame.x = inf: expected a finite number" },
    { "run ezyroller -o - --json -", "-o and --json cannot both write to standard output (-)" },
    { "run ezyroller -o ''", "the name of a file to write is empty" },
    { "run @/nothere.c", "cannot open the model file @/nothere.c: No such file or directory" },
    { "run @/", "@/ is not a file" },
    { "show", "something is missing; write pinwheel show MODEL [OPTION...]" },
    { "show ezyroler", "there is no model \"ezyroler\"; did you mean \"ezyroller\"?" },
    { "show ezyroller --at -1", "--at -1: expected a number >= 0" },
    { "list foo", "there is no list of \"foo\"; did you mean \"models\"?" },
    { "list a b", "\"b\" is too much; write pinwheel list [models|methods|kinds]" },
    { "new", "something is missing; write pinwheel new NAME.c" },
    { "new foo.x", "\"foo.x\": a model file's name is made of letters, digits, _ and -, and ends in .c" },
    { "new 'a b.c'", "\"a b.c\": a model file's name is made of letters, digits, _ and -, and ends in .c" },
  };
  (void)state;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    char line[200];
    snprintf (line, sizeof line, "pinwheel %s", bad[i].line);
    cli_bad (line, 2, bad[i].message);
    assert_string_equal (cli_out, "");
  }
}

/* Whatever cannot be written is said before the run starts. */
static void test_unwritable (void **state) {
  (void)state;
  cli_bad ("pinwheel run ezyroller --t-end 1e9 -o @/no/x.csv", 1, "cannot write @/no/x.csv: No such file or directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 -o @", 1, "cannot write @: Is a directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 --json @/no/x.json", 1,
           "cannot write @/no/x.json: No such file or directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 --plots @/out/plots", 1,
           "cannot make the folder @/out/plots: Not a directory");
  cli_bad ("pinwheel new @/no/mine.c", 1, "cannot write @/no/mine.c: No such file or directory");
}

static void test_full_disk (void **state) {
  (void)state;
  if (access ("/dev/full", W_OK) != 0) skip ();
  cli_bad ("pinwheel run ezyroller --t-end 10 -o /dev/full", 1, "cannot write /dev/full: No space left on device");
  cli_bad ("pinwheel list >/dev/full", 1, "cannot write to standard output: No space left on device");
}

/* ---- Models that are wrong ---- */

#define CLI_MODEL(body)                                                                          \
  "#include \"pinwheel.h\"\nstatic void build (pw_model *m, const void *p) {\n  (void)p;\n" body \
  "}\nPW_MODEL (.about = \"wrong\", .build = build);\n"

static void test_bad_models (void **state) {
  (void)state;
  cli_write (
      "torn.c",
      CLI_MODEL ("  pw_add_body (m, &(pw_body){ .name = \"rod\", .mass = 1, .inertia = 1, .start = { 1.5, 0, 0 } });\n"
                 "  pw_add_pin (m, &(pw_pin){ .name = \"left\", .body = { \"rod\", \"ground\" }, .at = { { -0.5, 0 }, "
                 "{ 0, 0 } } });\n"
                 "  pw_add_pin (m, &(pw_pin){ .name = \"right\", .body = { \"rod\", \"ground\" }, .at = { { 0.5, 0 }, "
                 "{ 3, 0 } } });\n"));
  cli_bad ("pinwheel run @/torn.c --json @/torn.json", 3,
           "model torn: the start cannot be made consistent: pin left is open by 1 m (or rad)");
  assert_true (cli_says (cli_file ("torn.json"), "status", "start"));

  cli_write ("lost.c", CLI_MODEL ("  pw_add_wheel (m, &(pw_wheel){ .name = \"A\", .body = \"frame\" });\n  pw_add_body "
                                  "(m, &(pw_body){ .name = \"fram\" });\n"));
  cli_bad ("pinwheel run @/lost.c", 2, "model lost: wheel A: there is no body \"frame\"; did you mean \"fram\"?");

  cli_write ("none.c", "int nothing;\n");
  assert_int_equal (cli_run ("pinwheel run @/none.c"), 2);
  assert_non_null (strstr (cli_err, "is no Pinwheel model: a model file ends with PW_MODEL (...)"));

  cli_write ("broken.c", "#include \"pinwheel.h\"\nnonsense;;\n");
  assert_int_equal (cli_run ("pinwheel run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, "broken.c:2:")); /* the compiler's own words */
  assert_non_null (strstr (cli_err, "pinwheel: "));

  cli_write ("text.so", "this is no shared object\n");
  assert_int_equal (cli_run ("pinwheel run @/text.so"), 2);
  assert_int_equal (strncmp (cli_err, "pinwheel: cannot load ", 22), 0);
}

/* A name that two files could answer is refused with both paths. */
static void test_found_twice (void **state) {
  (void)state;
  assert_int_equal (cli_run ("mkdir -p @/one @/two && cp ${BUILD:-build}/models/ezyroller.so @/one/twin.so && cp "
                             "@/one/twin.so @/two/twin.so"),
                    0);
  assert_int_equal (cli_run ("PINWHEEL_MODELS=@/one:@/two pinwheel run twin"), 2);
  char one[300], two[300];
  cli_expand ("@/one/twin.so", one, sizeof one);
  cli_expand ("@/two/twin.so", two, sizeof two);
  assert_non_null (strstr (cli_err, one));
  assert_non_null (strstr (cli_err, two));
  cli_good ("PINWHEEL_MODELS=@/one pinwheel run twin --t-end 0.1 --json -");
  assert_true (cli_says (cli_out, "model", "twin"));
}

/* ---- Runs that end early ---- */

/* A step with which the method fails: the time reached and the reason, the rows so far in NAME.part, status 4. */
static void test_failing_step (void **state) {
  (void)state;
  assert_int_equal (cli_run ("pinwheel run ezyroller --step 0.5 --set M0=1e9 -o @/fail.csv --json @/fail.json"), 4);
  assert_int_equal (strncmp (cli_err, "pinwheel: t = ", 14), 0);
  assert_non_null (strstr (cli_err, "the step of 0.5 s is too large"));
  assert_non_null (strstr (cli_err, "fail.csv.part"));
  assert_null (cli_file ("fail.csv"));
  const char *part = cli_file ("fail.csv.part");
  assert_non_null (part);
  assert_true (strncmp (part, "t [s],", 6) == 0 && part[strlen (part) - 1] == '\n');
  const char *json = cli_file ("fail.json");
  assert_true (cli_says (json, "status", "method"));
}

static void test_interrupted (void **state) {
  (void)state;
  if (cli_run ("timeout --preserve-status 5 true") != 0) skip ();
  const char *program = getenv ("PINWHEEL");
  char command[1000];
  snprintf (
      command, sizeof command,
      "timeout --preserve-status -s INT 0.3 '%s' run ezyroller --t-end 1e9 --every 1 -o @/stop.csv --json @/stop.json",
      program ? program : "build/pinwheel");
  assert_int_equal (cli_run (command), 130);
  assert_non_null (strstr (cli_err, "interrupted at t = "));
  assert_non_null (strstr (cli_err, "stop.csv.part"));
  assert_null (cli_file ("stop.csv"));
  assert_true (cli_says (cli_file ("stop.json"), "status", "interrupted"));
  const char *part = cli_file ("stop.csv.part");
  assert_true (part && part[strlen (part) - 1] == '\n');
}

/* A start that had to move says what moved, on standard error, and goes on. */
static void test_moved (void **state) {
  (void)state;
  assert_int_equal (cli_run ("pinwheel run ezyroller --start frame.phi=0.3 --t-end 0.01 --json -"), 0);
  assert_non_null (strstr (cli_err, "steer.x from "));
  assert_null (strstr (cli_err, "frame.phi"));
  assert_true (cli_says (cli_out, "status", "ok"));
}

/* ---- */

static int cli_setup (void **state) {
  (void)state;
  return mkdtemp (cli_folder) ? 0 : -1;
}

static int cli_teardown (void **state) {
  char command[200];
  (void)state;
  snprintf (command, sizeof command, "rm -rf '%s'", cli_folder);
  return system (command);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_summary),
    cmocka_unit_test (test_no_energy),
    cmocka_unit_test (test_defaults),
    cmocka_unit_test (test_table),
    cmocka_unit_test (test_table_on_stdout),
    cmocka_unit_test (test_every),
    cmocka_unit_test (test_locale),
    cmocka_unit_test (test_list),
    cmocka_unit_test (test_show),
    cmocka_unit_test (test_help),
    cmocka_unit_test (test_new),
    cmocka_unit_test (test_bad_lines),
    cmocka_unit_test (test_unwritable),
    cmocka_unit_test (test_full_disk),
    cmocka_unit_test (test_bad_models),
    cmocka_unit_test (test_found_twice),
    cmocka_unit_test (test_failing_step),
    cmocka_unit_test (test_interrupted),
    cmocka_unit_test (test_moved),
  };
  return cmocka_run_group_tests (tests, cli_setup, cli_teardown);
}
