/* The data in the page of an animation: those of the run, and harmless whatever the names contain. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* A page written in the folder, whole; to be released. */
static char *animate_page (const char *name) {
  FILE *f = fopen (cli_path (name), "rb");
  assert_non_null (f);
  char *page = calloc (1, 4000000);
  assert_non_null (page);
  assert_in_range (fread (page, 1, 3999999, f), 1000, 3999998);
  fclose (f);
  assert_non_null (strstr (page, "</html>"));
  return page;
}

/* Where the numbers of an array of the page begin. */
static const char *animate_array (const char *page, const char *key) {
  char mark[32];
  snprintf (mark, sizeof mark, "\n  \"%s\": [", key);
  const char *at = strstr (page, mark);
  assert_non_null (at);
  return at + strlen (mark);
}

/* The first and the last of the numbers, and how many there are. */
static int animate_numbers (const char *page, const char *key, double *first, double *last) {
  const char *at = animate_array (page, key), *stop = strchr (at, ']');
  int n = 0;
  assert_non_null (stop);
  while (at < stop) {
    char *end;
    *last = strtod (at, &end);
    if (end == at) break;
    if (n++ == 0) *first = *last;
    at = end + strspn (end, ", \n");
  }
  return n;
}

/* The end of the motion is that of the summary; every sample has two bodies of six numbers. */
TEST (motion) {
  double first, last, omega;
  cli_good ("pinwheel run ezyroller --t-end 3 --animate @/run.html --json -");
  omega = cli_number (cli_out, "bodies", "steer", "omega", NULL);
  char *page = animate_page ("run.html");
  int samples = animate_numbers (page, "t", &first, &last);
  assert_true (samples > 1000 && first >= 0 && first <= 0);
  check_close ("last time", last, 3, 1e-9, "ten digits");
  assert_int_equal (animate_numbers (page, "motion", &first, &last), 12 * samples);
  check_close ("steer.omega", last, omega, 1e-8, "nine digits");
  assert_int_equal (animate_numbers (page, "contact", &first, &last), 6 * samples);
  assert_null (cli_file ("run.html.part"));
  free (page);
}

/* The pin B and the wheels A and C have points; C carries M / (c + d), here at t = 0. */
TEST (forces) {
  double first, last;
  cli_good ("pinwheel run ezyroller --t-end 1 --animate @/run.html");
  char *page = animate_page ("run.html");
  assert_non_null (strstr (page, "{\"name\": \"B\", \"force_end\": 0, \"ends\": [{\"body\": 0"));
  assert_non_null (strstr (page, "\"strokes\": [[1, [0, 0.4, 0, 0],")); /* the circle of the pin's symbol */
  assert_non_null (strstr (page, "{\"name\": \"A\", \"force_end\": 0, \"ends\": [{\"body\": 0"));
  animate_numbers (page, "force", &first, &last);
  const char *row = animate_array (page, "force");
  double f[6];
  assert_int_equal (sscanf (row + 1, "%lf, %lf, %lf, %lf, %lf, %lf", &f[0], &f[1], &f[2], &f[3], &f[4], &f[5]), 6);
  check_close ("size of C", f[5] * f[5] + f[4] * f[4], 0.4 * 0.4, 1e-5, "M0 / (c + d) = 0.1 / 0.25, six digits");
  check_close ("sum on the steering", f[1], f[5], 1e-5, "a massless body: the pin's force on the frame is the wheel's");
  free (page);
}

/* A drive without points is drawn at the joint of its bodies, whichever is the ground, with an end that exists. */
TEST (joint) {
  cli_write ("crank.yaml", "pinwheel: 1\nbodies: [{name: crank, mass: 1, inertia: 0.1, start: {x: 1}}]\nelements:\n"
                           "  - {pin: O, body: [ground, crank], at: [[0, 0], [-1, 0]]}\n"
                           "  - {drive: d, body: [ground, crank], what: angle, value: 0}\n");
  cli_good ("pinwheel run @/crank.yaml --t-end 0.1 --animate @/crank.html");
  char *page = animate_page ("crank.html");
  assert_non_null (strstr (page, "{\"name\": \"O\", \"force_end\": 1, \"ends\": [{\"body\": -1"));
  assert_non_null (strstr (page, "{\"name\": \"d\", \"force_end\": -1, \"ends\": [{\"body\": -1"));
  free (page);
}

/* A contact and its friction are one element: one force, one entry of the legend; without lines to the centres. */
TEST (contacts) {
  cli_write ("ball.yaml",
             "pinwheel: 1\nbodies: [{name: ball, mass: 1, inertia: 0.01, start: {y: 0.2}, rate: {vx: 9}}]\n"
             "elements:\n  - {gravity: g, acceleration: [0, -10]}\n"
             "  - {contact: C, body: [ball, ground], at: [[0, 0], [0, 0]], radius: 0.1, mu: 0.5}\n"
             "  - {contact: D, body: [ball, ground], at: [[0, 0], [0, -9]], radius: 0.1, other_radius: 9}\n");
  cli_good ("pinwheel run @/ball.yaml -t 0.2 --animate @/ball.html");
  char *page = animate_page ("ball.html");
  assert_non_null (strstr (page, "\"discs\": [\n    {\"body\": 0, \"at\": [0, 0], \"radius\": 0.1},\n"
                                 "    {\"body\": -1, \"at\": [0, -9], \"radius\": 9}\n"));
  const char *name = strstr (animate_array (page, "events"), "\"contact C\""), *stop = strstr (page, "\"outputs\"");
  assert_true (name && name < stop && strstr (name + 1, "\"contact C\"") == NULL);
  double force[4];
  const char *row = strchr (animate_array (page, "force"), ']') - 1;
  while (*--row != '\n') {}
  assert_int_equal (sscanf (row, "%lf, %lf, %lf, %lf", &force[0], &force[1], &force[2], &force[3]), 4);
  check_close ("friction of C", force[0], -5, 1e-5, "mu m g, six digits");
  check_close ("normal force of C", force[1], 10, 1e-5, "the same");
  free (page);
}

TEST (names) {
  cli_good ("cp tests/models/arm.yaml '@/a<b>&.yaml'");
  cli_good (
      "pinwheel run '@/a<b>&.yaml' --t-end 0.1 --animate @/odd.html 2>/dev/null"); /* a notice: its start was moved */
  char *page = animate_page ("odd.html");
  assert_non_null (strstr (page, "\"model\": \"a\\u003Cb>&\""));
  assert_null (strstr (page, "a<b"));
  free (page);
}

TEST (refusals) {
  cli_bad ("pinwheel run ezyroller --animate @/x.avi", 2, "--animate @/x.avi: expected a name that ends in .html");
  cli_bad ("pinwheel run ezyroller --t-end 1 --animate @/no/folder.html >/dev/null", 1,
           "cannot write @/no/folder.html: No such file or directory");
}

const check_fixture fixture = { cli_setup, cli_teardown };
