/* Limits on the command line: --max-steps, --limit, signals that come while rows are written, progress without a
 * terminal; threads without tasks. */
#define _XOPEN_SOURCE 700
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "cli/cli.h"
#include "cli/cli.h"

/* What there is so far is kept, the exit status is 4, and the limit is named. */
TEST (max_steps) {
  assert_int_equal (cli_run ("pinwheel run ezyroller --method erk5 --max-steps 50 -o @/m.csv --json @/m.json"), 4);
  assert_non_null (strstr (cli_err, "s: the limit max-steps is reached: 50 attempted steps"));
  assert_non_null (strstr (cli_err, "the table so far is kept in "));
  assert_true (cli_says (cli_file ("m.json"), "status", "method"));
  double steps = cli_number (cli_file ("m.json"), "statistics", "steps", NULL);
  assert_int_equal (cli_run ("wc -l <@/m.csv.part"), 0);
  int lines;
  assert_true (sscanf (cli_out, "%d", &lines) == 1 && lines == (int)steps + 2); /* header, start, steps */
  assert_int_equal (cli_run ("pinwheel run ezyroller --max-steps 5 --t-end 0.1 --json -"), 0);
  assert_non_null (strstr (cli_err, "--max-steps has no effect: rk4+projection takes "));
  /* a run that fails by itself fails again when it is resumed */
  assert_int_equal (cli_run ("pinwheel run n-four-bar -m rk4+none --step 0.01 --max-steps 10 -t 9 --checkpoint @/m.ck"),
                    4);
  assert_non_null (strstr (cli_err, "s: the step of 0.01 s is too large"));
  assert_null (strstr (cli_err, "--resume"));
}

TEST (limit) {
  static const char *const method[] = { "rk4", "erk8", "bdf", "ida+ggl", "galpha", "leapfrog" };
  for (int i = 0; i < 6; i++) {
    assert_int_equal (
        cli_run (check_text (
            "pinwheel run ezyroller --method %s --t-end 1e9 --limit 0.02 --max-steps 1e9 --every 1 -o @/l.csv",
            method[i])),
        4);
    assert_non_null (strstr (cli_err, "s: the limit of 0.02 s of processor time is reached (--limit)"));
    assert_non_null (strstr (cli_err, "the table so far is kept in "));
  }
  assert_int_equal (cli_run ("pinwheel run ezyroller --t-end 1e9 --specialise never --limit 0.1 --checkpoint @/l.ck "
                             "--checkpoint-every 0.1"),
                    4);
  assert_non_null (strstr (cli_err, "l.ck continues from t = "));
}

/* A platform on struts, most of them redundant: independent equations are sought for half a minute. */
static void limits_write_struts (const char *file) {
  enum { STRUTS = 400, LINE = 400 };
  char *text = malloc ((3 * STRUTS + 8) * LINE), *end = text;
  assert_non_null (text);
  end += sprintf (end, "pinwheel: 1\nparameters: [{name: m, value: 1, unit: kg}]\nbodies:\n"
                       "  - {name: A, mass: m, inertia: 1}\n");
  for (int part = 0; part < 2; part++, end += sprintf (end, part == 1 ? "elements:\n" : ""))
    for (int i = 0; i < STRUTS; i++) {
      double angle = 0.1 + 0.0125 * i, x = cos (angle), y = sin (angle);
      if (part == 0)
        end += sprintf (end, "  - {name: s%d, mass: 0.01, inertia: 0.01, start: {x: %.17g, y: %.17g, phi: %.17g}}\n", i,
                        1.5 * x, 1.5 * y, angle);
      else
        end += sprintf (end,
                        "  - {pin: a%d, body: [A, s%d], at: [[%.17g, %.17g], [-0.5, 0]]}\n"
                        "  - {pin: b%d, body: [s%d, ground], at: [[0.5, 0], [%.17g, %.17g]]}\n",
                        i, i, x, y, i, i, 2 * x, 2 * y);
    }
  cli_write (file, text);
  free (text);
}

/* The limit contains the opening of a run: each command ends with its name, a sweep has a row for each run. */
TEST (limit_opening) {
  static const char *const command[] = { "run @/struts.yaml -o @/o.csv --json @/o.json",
                                         "run @/struts.yaml --t-end 1e4", "show @/struts.yaml --at 1",
                                         "sensitivity @/struts.yaml --by m --of kinetic",
                                         "optimise @/struts.yaml --free m=1:2 --maximise kinetic --starts 1" };
  limits_write_struts ("struts.yaml");
  for (size_t i = 0; i < sizeof command / sizeof *command; i++) {
    assert_int_equal (cli_run (check_text ("pinwheel %s --limit 0.1", command[i])), 4);
    assert_non_null (strstr (cli_err, "the limit of 0.1 s of processor time is reached before the first "
                                      "step (--limit)"));
  }
  assert_null (cli_file ("o.csv"));
  assert_true (cli_says (cli_file ("o.json"), "status", "method"));
  assert_int_equal (cli_run ("pinwheel sweep @/struts.yaml --vary m=1,2 --limit 0.1 -o @/o.csv"), 4);
  const char *table = cli_file ("o.csv");
  assert_non_null (table);
  table = strstr (table, "before the first step");
  assert_true (table && strstr (table + 1, "before the first step"));
  assert_int_equal (cli_run ("pinwheel compare @/struts.yaml --methods rk4 --repeats 1 --limit 0.1 --step-ladder 1e-3"),
                    4);
  assert_non_null (strstr (cli_err, "no method has reached the end within the limit"));
}

/* Runs of a sweep and of a drift end each by itself, as rows with the reason. */
TEST (rows) {
  assert_int_equal (cli_run ("pinwheel sweep ezyroller --vary M0=0.05,0.1 --t-end 1e9 --limit 0.02 -o @/s.csv"), 4);
  assert_non_null (strstr (cli_err, "all 2 runs failed, the first one: t = "));
  const char *table = cli_file ("s.csv");
  assert_true (table && strstr (table, ",method,") && strstr (table, "the limit of 0.02 s of processor time"));
  cli_shell ("pinwheel sweep ezyroller --vary M0=1e-9,0.1 --method erk8 --t-end 10 --max-steps 20 -o @/n.csv");
  assert_non_null (strstr (cli_err, "1 of 2 runs failed, the first of them: "));
  assert_non_null (strstr (cli_err, "max-steps"));
  cli_shell (
      "pinwheel drift ezyroller --methods rk4,erk8 --only-methods --t-end 100 --step 1e-4 --limit 0.1 --plots @/d");
  assert_non_null (strstr (cli_out, "\nerk8 "));
  assert_non_null (strstr (cli_out, "the limit of 0.1 s of processor time is reached (--limit)"));
}

/* A checkpoint from before the limit goes on, under a larger one, to the same bytes. */
TEST (resume) {
  static const char *const method[] = { "erk8+projection", "bdf+projection" };
  char command[800];
  for (int i = 0; i < 2; i++) {
    snprintf (
        command, sizeof command,
        "pinwheel run ezyroller --method %s --t-end 100 --every 0.5 -o @/a.csv --checkpoint @/a.ck "
        "--checkpoint-every 20 && { "
        "pinwheel run ezyroller --method %s --t-end 100 --every 0.5 -o @/b.csv --checkpoint @/b.ck "
        "--checkpoint-every 20 --max-steps %d; test $? = 4; } && "
        "pinwheel run ezyroller --method %s --t-end 100 --every 0.5 -o @/b.csv --resume @/b.ck && cmp @/a.csv @/b.csv",
        method[i], method[i], i ? 800 : 120, method[i]);
    cli_shell (command);
    assert_non_null (strstr (cli_err, "b.ck continues from t = "));
  }
}

/* A resumed run that ends before its first checkpoint names the one from which it began, whatever it saves to. */
TEST (resume_again) {
  static const char *const saved[] = { "--checkpoint @/c.ck --checkpoint-every 20", "--resume @/c.ck",
                                       "--resume @/c.ck --checkpoint @/d.ck" };
  for (int i = 0; i < 3; i++) {
    assert_int_equal (
        cli_run (check_text ("pinwheel run ezyroller -m erk8+projection --t-end 100 --max-steps 120 %s", saved[i])), 4);
    assert_non_null (strstr (cli_err, "c.ck continues from t = 40.08"));
  }
}

TEST (bad) {
  static const cli_wrong wrong[] = {
    { "ezyroller --limit 0", "--limit 0: expected a number > 0" },
    { "ezyroller --limit soon", "--limit: \"soon\" is not a number" },
    { "ezyroller --max-steps 0", "--max-steps 0: expected a whole number >= 1" },
    { "ezyroller --max-steps 1.5", "--max-steps 1.5: expected a whole number >= 1" },
  };
  cli_bad_each ("run", wrong, sizeof wrong / sizeof *wrong);
}

/* A signal that comes while one step is written as a thousand million rows. */
TEST (rows_of_a_step) {
  static const char *const method[] = { "rk4", "erk8", "bdf", "galpha" };
  for (int i = 0; i < 4; i++) {
    assert_int_equal (
        cli_run (check_text (
            "\"${PINWHEEL:-build/pinwheel}\" run ezyroller --method %s --every 1e-12 -o @/e.csv & p=$!; "
            "while kill -0 $! 2>/dev/null && [ ! -s @/e.csv.part ]; do sleep 0.01; done; kill -TERM $p; wait $p; "
            "s=$?; rm -f @/e.csv.part; exit $s",
            method[i])),
        130);
    assert_non_null (strstr (cli_err, "interrupted at t = "));
  }
}

/* Standard error as a file: no bar, and a line only when a minute has passed. */
TEST (lines) {
  char text[400];
  pw_progress p;
  int before = dup (STDERR_FILENO), file = open (cli_path ("lines"), O_RDWR | O_CREAT | O_TRUNC, 0600);
  assert_true (before >= 0 && file >= 0);
  dup2 (file, STDERR_FILENO);
  pw_progress_start (&p, "ezyroller", "s", 0, 10);
  p.no_bar = 1;
  pw_progress_at (&p, 1);
  double due = p.next - p.start;
  p.start -= 60, p.next -= 60;
  pw_progress_at (&p, 2.5);
  pw_progress_at (&p, 3);
  double again = p.next - p.start;
  pw_progress_end (&p);
  dup2 (before, STDERR_FILENO);
  close (before);
  ssize_t n = pread (file, text, sizeof text - 1, 0);
  close (file);
  assert_true (n > 0 && fabs (due - 60) < 1e-6 && again > 120 - 1e-6); /* times of the clock are rounded */
  text[n] = 0;
  assert_string_equal (text, "pinwheel: ezyroller: 25 %  t = 2.5 of 10 s  3:00 to go\n");
}

/* Whatever is reported, no count is above the one that it is "of", and the remaining time is not negative and never
 * rises: not if the final count was an estimate, the work slows down, or nothing is done for a while. */
TEST (remaining) {
  static const double reached[][12] = { { 1, 2, 5, 10, 19, 20, 21, 30, 40 }, /* of 20 */
                                        { 1, 1, 1, 1, 2, 2, 2, 3, 3, 20 },
                                        { 10, 12, 12.5, 12.6, 12.61, 12.62, 19, 20 },
                                        { 0.5, 0.5, 19, 18, 17, 21, 3, 22 } };
  for (int k = 0; k < 8; k++) {
    char text[4000] = "";
    pw_progress p;
    int before = dup (STDERR_FILENO), file = open (cli_path ("lines"), O_RDWR | O_CREAT | O_TRUNC, 0600), lines = 0;
    assert_true (before >= 0 && file >= 0);
    dup2 (file, STDERR_FILENO);
    pw_progress_start (&p, "model", k % 2 ? "s" : "iterations", 0, 20);
    p.lines = 1;
    for (int i = 0; i < 12 && reached[k / 2][i] > 0; i++) {
      p.start -= 100, p.next = 0;
      pw_progress_at (&p, reached[k / 2][i]);
    }
    pw_progress_end (&p);
    dup2 (before, STDERR_FILENO);
    close (before);
    assert_true (pread (file, text, sizeof text - 1, 0) > 0);
    close (file);
    double least = INFINITY;
    for (char *line = strtok (text, "\n"); line; line = strtok (NULL, "\n"), lines++) {
      double count, of, hours = 0, minutes, seconds;
      const char *time = strstr (line, " to go"), *counted = strstr (line, "%  ") + 3;
      if (sscanf (counted, k % 2 ? "t = %lf of %lf s" : "%lf of %lf", &count, &of) == 2) assert_true (count <= of);
      assert_non_null (time);
      while (time > line && time[-1] != ' ') time--;
      if (strncmp (time, "- to go", 7) == 0) continue; /* not known */
      if (sscanf (time, "%lf:%lf:%lf", &hours, &minutes, &seconds) != 3)
        assert_int_equal (sscanf (time, "%lf:%lf", &minutes, &seconds) + (int)(hours = 0), 2);
      seconds += 60 * (minutes + 60 * hours);
      if (!(seconds >= 0 && seconds <= least && minutes >= 0)) print_error ("%s\n", line);
      assert_true (seconds >= 0 && seconds <= least && minutes >= 0);
      least = seconds;
    }
    assert_true (lines >= 8 && isfinite (least));
  }
}

/* A torque that nothing opposes: the number of steps grows like the square of the time. */
TEST (growth) {
  cli_write ("spin.yaml", "pinwheel: 1\nabout: a rotor\n"
                          "bodies: [{name: rotor, mass: 1, inertia: 1, start: {x: 0.5}}]\n"
                          "elements:\n  - {pin: P, body: [rotor, ground], at: [[-0.5, 0], [0, 0]]}\n"
                          "  - {torque: M, body: [rotor, ground], value: 1}\n");
  assert_int_equal (
      cli_run ("pinwheel run @/spin.yaml --method erk8+projection --rtol 1e-4 --t-end 1e6 --max-steps 4e5"), 4);
  assert_non_null (strstr (cli_err, "max-steps is reached: 400000 attempted steps, "));
}

/* A signal during the last step interrupts nothing. */
TEST (last_step) {
  cli_write ("raise.c", "#include <signal.h>\n#include \"pinwheel.h\"\n"
                        "static int value (void *c, double t, const double *x, double *u, double *g) {\n"
                        "  (void)c, (void)x, (void)g;\n  u[0] = u[1] = u[2] = 0;\n"
                        "  if (t >= 1) raise (SIGTERM);\n  return 0;\n}\n"
                        "static void build (pw_model *m, const void *p) {\n  (void)p;\n"
                        "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1 });\n"
                        "  pw_add_torque (m, &(pw_torque){ .name = \"T\", .body = { \"a\", \"ground\" },\n"
                        "    .value = { PW_FUNCTION, .function = { .eval = value } } });\n}\n"
                        "PW_MODEL (.about = \"raises a signal\", .build = build);\n");
  assert_int_equal (cli_run ("pinwheel run @/raise.c --t-end 1 --step 0.1 -o @/raise.csv && wc -l <@/raise.csv"), 0);
  assert_string_equal (cli_out, "12\n");
}

/* The third signal ends the program, whatever has set pw_stop before, and however many came in an earlier part. */
TEST (two_signals) {
  for (int part = 0; part < 2; part++) {
    pw_stop = 1;
    pw_stop_catch ();
    errno = ERANGE;
    raise (SIGINT);
    raise (SIGTERM);
    assert_int_equal (errno, ERANGE);
    assert_int_equal (pw_stop_release (), 2);
    assert_int_equal (pw_stop, 1);
  }
  pw_stop_catch ();
  assert_int_equal (pw_stop_release (), 0);
  pw_stop = 0;
  signal (SIGINT, SIG_DFL);
  signal (SIGTERM, SIG_DFL);
}

static int limits_no_task (void *context, int i, pw_error *error) {
  (void)i;
  return pw_fail (error, PW_METHOD, "%s", (const char *)context);
}

/* Without tasks the threads, timed or not, end at once. */
TEST (no_tasks) {
  pw_error error = { 0 };
  char text[] = "a task was called";
  assert_int_equal (pw_parallel (2, 0, limits_no_task, text, &error), PW_OK);
  assert_int_equal (pw_parallel_timed (2, 0, limits_no_task, text, &error), PW_OK);
}

const check_fixture fixture = { cli_setup, cli_teardown };
