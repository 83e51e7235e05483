/* pinwheel optimise: optima with closed forms, against a dense sweep, at bounds and constraints, with failing runs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* After 1 s a point is at (a, b). */
static const char model[] =
    "pinwheel: 1\n"
    "about: a point with a constant velocity\n"
    "run: {t_end: 1, step: 0.1}\n"
    "parameters: [{name: a, value: -1}, {name: b, value: 0.5}, {name: n, value: 2, domain: count}]\n"
    "bodies: [{name: p, mass: 1, inertia: 1, rate: {vx: a, vy: b}}]\n"
    "elements: [{force: none, body: p, at: [0, 0]}]\n";

static int optimise_setup (void) {
  if (cli_setup () != 0) return 1;
  cli_write ("point.yaml", model);
  return 0;
}

/* The value of an unknown in the summary. */
static double optimise_value (const char *json, const char *name) {
  const char *at = strstr (json, check_text ("{\"name\": \"%s\"", name));
  assert_non_null (at);
  return strtod (strstr (at, "\"value\": ") + 9, NULL);
}

/* ---- Optima ---- */

TEST (valley) {
  cli_shell (
      "pinwheel optimise @/point.yaml --minimise '100*(p.y - p.x^2)^2 + (1 - p.x)^2' --free a=-3:3 --free b=-3:3 "
      "--json @/o.json");
  const char *json = cli_file ("o.json");
  check_close ("a", optimise_value (json, "a"), 1, 1e-5,
               "last steps of 1e-7 of 6, in a valley with condition number 2500");
  check_close ("b", optimise_value (json, "b"), 1, 2e-5, "b = a^2");
  check_close ("value", cli_number (json, "value", NULL), 0, 1e-10, "square of the distance");
}

/* In a long curved valley searches from the starts end far from where those that continue do.  Some search from a start
 * has led to every result that is reported. */
TEST (long_valley) {
  static const char *const problem[] = { "--free p=-20:20 --free q=-20:20 --subject-to 'a.y<=1' --starts 1",
                                         "--free p=-20:20 --free q=-20:20 --subject-to 'a.y<=1' --starts 3",
                                         "--free p=-200:200 --free q=-200:200 --subject-to 'a.y<=1' --starts 2",
                                         "--free p=-20:20 --free q=-20:20 --subject-to 'a.y>=-1' --starts 1 --set p=-5",
                                         "--free p=-20:20 --free q=-20:20 --starts 2" };
  cli_write ("rosenbrock.yaml",
             "pinwheel: 1\nrun: {t_end: 0.01, step: 0.01, method: rk4}\n"
             "parameters: [{name: p, value: -1.2}, {name: q, value: 1}]\n"
             "bodies: [{name: a, mass: 1, inertia: 1, start: {x: (1-p)^2 + 100*(q-p^2)^2, y: q-p}}]\n");
  for (size_t i = 0; i < sizeof problem / sizeof *problem; i++) {
    int status = cli_run (check_text ("pinwheel optimise @/rosenbrock.yaml --minimise a.x %s", problem[i]));
    assert_true (status == 0 || status == 4); /* 4: not converged */
    const char *ends = strstr (cli_out, " of which end");
    assert_non_null (ends);
    while (ends[-1] != ' ') ends--;
    if (!(atoi (ends) > 0)) print_error ("%s\n%s", problem[i], cli_out);
    assert_true (atoi (ends) > 0);
  }
}

/* Three unknowns: smooth outputs have derivatives; with an extremum they have not. */
TEST (derivatives) {
  static const char *const more[] = { "", " + 0*max:p.x", "' --method 'rk4:inputs=held" };
  for (int i = 0; i < 3; i++) {
    char command[500];
    snprintf (
        command, sizeof command,
        "pinwheel optimise @/point.yaml --minimise '100*(p.y - p.x^2)^2 + (1 - p.x)^2 + 100*(p.phi - p.y^2)^2 + (1 - "
        "p.y)^2%s' --free a=-3:3 --free b=-3:3 --free p.omega=-3:3 --json @/o.json",
        more[i]);
    cli_shell (command);
    const char *json = cli_file ("o.json");
    check_close ("a", optimise_value (json, "a"), 1, i != 1 ? 1e-9 : 1e-5,
                 "quadratic convergence, or last steps of 1e-7");
    check_close ("p.omega", optimise_value (json, "p.omega"), 1, i != 1 ? 1e-9 : 1e-4, "p.omega = b^2 = a^4");
    assert_true ((cli_number (json, "derivatives", NULL) > 0) == (i != 1));
  }
}

/* The highest point of a line over a disc; b has no bounds. */
TEST (constraint) {
  cli_shell ("pinwheel optimise @/point.yaml --maximise p.x+p.y --free a=-3:3 --free b --subject-to 'p.x^2+p.y^2 <= 2' "
             "--subject-to 'max:p.x>=-5' --json @/o.json");
  const char *json = cli_file ("o.json");
  check_close ("a", optimise_value (json, "a"), 1, 2e-3, "square root of the allowance, 1e-6 of 2");
  check_close ("value", cli_number (json, "value", NULL), 2, 2e-6, "the allowance");
  assert_non_null (strstr (cli_out, "at most 2"));
  assert_non_null (strstr (cli_out, "at least -5"));
}

/* Three unknowns and two constraints, both reached: the derivatives of each of them decide. */
TEST (constraints) {
  cli_shell ("pinwheel optimise @/point.yaml --maximise p.x+p.y+p.phi --free a=-3:3 --free b=-3:3 --free p.omega=-3:3 "
             "--subject-to 'p.x^2+p.y^2 <= 2' --subject-to 'p.y+2*p.phi <= 3' --starts 1 --json @/o.json");
  const char *json = cli_file ("o.json");
  /* p.phi = (3 - p.y) / 2: the highest point of p.x + p.y / 2 + 3 / 2 over the disc */
  check_close ("a", optimise_value (json, "a"), sqrt (2 / 1.25), 1e-6, "the allowance, 1e-7 of 2");
  check_close ("b", optimise_value (json, "b"), sqrt (2 / 1.25) / 2, 1e-6, "the allowance");
  check_close ("p.omega", optimise_value (json, "p.omega"), 1.5 - sqrt (2 / 1.25) / 4, 1e-6, "the allowance");
  assert_in_range (cli_number (json, "derivatives", NULL), 1, 40);
}

TEST (bound) {
  cli_shell (
      "pinwheel optimise @/point.yaml --maximise p.x --free a=-2:0.5 --free p.vy=0:1 --json @/o.json -o @/o.yaml");
  const char *json = cli_file ("o.json");
  check_close ("a", optimise_value (json, "a"), 0.5, 0, "exactly the bound");
  assert_non_null (strstr (json, "\"bound\": \"high\""));
  assert_non_null (strstr (cli_out, "at its upper bound"));
  assert_non_null (strstr (cli_out, "--set a=0.5 --start p.vy="));
  char run[300];
  cli_expand ("# pinwheel run '@/point.yaml' --set a=0.5 --start p.vy=", run, sizeof run);
  const char *yaml = cli_file ("o.yaml");
  assert_int_equal (strncmp (yaml, run, strlen (run)), 0);
  assert_non_null (strstr (yaml, "set:\n  a: 0.5\nstart:\n  p.vy: "));
}

/* The run of a result repeats all options that have an effect on it, in words for a shell. */
TEST (command) {
  cli_shell ("pinwheel optimise pendulum --maximise bob.vx --free g=5:8 --set g=6 --set 'l=1*2' -t 0.5 -o @/o.yaml");
  static const char given[] = "# pinwheel run 'pendulum' --set 'g=6' --set 'l=1*2' --t-end '0.5' --set g=";
  assert_int_equal (strncmp (cli_file ("o.yaml"), given, sizeof given - 1), 0);
  cli_write ("a point's model.yaml", model);
  cli_shell (
      "pinwheel optimise \"@/a point's model.yaml\" --maximise p.x --free a=-2:0.5 --max-file 1 -m erk5 --rtol 1e-4 "
      "--atol 1e-5 --max-steps 1000 --specialise never --limit 100 --starts 1 -o @/o.yaml");
  char run[300];
  cli_expand ("# pinwheel run '@/a point'\\''s model.yaml' --max-file '1' --method 'erk5' --rtol '1e-4' --atol '1e-5' "
              "--max-steps '1000' --specialise 'never' --set a=0.5\n",
              run, sizeof run);
  assert_int_equal (strncmp (cli_file ("o.yaml"), run, strlen (run)), 0);
  cli_good ("eval \"$(sed -n '1s/^# //p' @/o.yaml)\"");
  /* enough steps for specialised code, but not in the run of the result alone */
  cli_shell ("pinwheel optimise pendulum --maximise bob.vx --free g=5:10 -t 0.05 --step 1e-6 --starts 1 -o @/o.yaml");
  assert_non_null (strstr (cli_file ("o.yaml"), " --step '1e-6' --specialise 'always' --set g="));
}

/* Beyond p.x = 0.3 every run fails. */
TEST (failing) {
  cli_shell ("pinwheel optimise @/point.yaml --maximise 'p.x + 0*sqrt(0.3 - p.x)' --free a=-2:2 --json @/o.json "
             "--plots @/failing");
  int drawn = 0;
  for (const char *row = cli_file ("failing/optimise.dat"); row; row = strchr (row, '\n'), row += row != NULL)
    drawn += *row && strchr ("#\n", *row) == NULL;
  const char *json = cli_file ("o.json");
  const double failed = cli_number (json, "failed", NULL);
  assert_true (drawn == cli_number (json, "runs", NULL) - failed + 1); /* the best one once more */
  check_close ("a", optimise_value (json, "a"), 0.3, 1e-5, "last steps of 1e-7 of 4, one-sided");
  assert_true (optimise_value (json, "a") <= 0.3 + 1e-12);
  assert_true (failed > 0);
  assert_non_null (
      strstr (cli_out, "runs failed and count as infeasible, the first of them: p.x + 0*sqrt(0.3 - p.x) is"));
}

/* Runs that fail are worse than others, for each of the algorithms: the optimum is near the edge. */
TEST (edge) {
  static const char *const options[] = { "", "--free b=-1:1", "--subject-to 'p.y<=1'",
                                         "--free b=-1:1 --subject-to 'p.y<=1'" };
  for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
    cli_shell (check_text (
        "pinwheel optimise @/point.yaml --minimise '(p.x - 0.25)^2 + p.y^2 + 0*sqrt(0.3 - p.x)' --free a=-2:2 %s "
        "--starts 1 --set b=0.1 --json @/o.json",
        options[i]));
    check_close ("a", optimise_value (cli_file ("o.json"), "a"), 0.25, 1e-3, "square root of 1e-6");
  }
}

/* The search begins near the edge, and its first steps fail: they must not count as good as the first run, nor as
 * nearer to what a constraint requires. */
TEST (failing_first) {
  static const char *const options[] = { "--minimise '(p.x + 1.5)^2 + 0*sqrt(0.3 - p.x)'",
                                         "--minimise '(p.x + 1.5)^2 + p.y^2 + 0*sqrt(0.3 - p.x)' --free b=-1:1",
                                         "--minimise '(p.x + 1.5)^2 + 0*sqrt(0.3 - p.x)' --subject-to 'p.x<=1'",
                                         "--minimise 'p.x^2 + 0*sqrt(0.3 - p.x)' --subject-to 'p.x<=-1.5'",
                                         ("--minimise 'p.x^2 + 0*sqrt(0.3 - p.x)' --subject-to 'p.x>=-9' "
                                          "--subject-to 'p.x<=-1.5'") };
  for (size_t i = 0; i < sizeof options / sizeof *options; i++)
    for (int k = 0; k < 2; k++) {
      cli_shell (check_text ("pinwheel optimise @/point.yaml %s --free a=-2:2 --set a=%s --starts 1 --json @/o.json",
                             options[i], k ? "0.29" : "-0.1"));
      check_close (options[i], optimise_value (cli_file ("o.json"), "a"), -1.5, 1e-4, "last steps of 1e-7 of 4");
    }
}

/* Valleys beside runs that fail.  If these count as good as the best run, or as the worst so far, the searches end
 * elsewhere. */
TEST (failing_beside) {
  static const struct {
    const char *options;
    double a;
  } all[] = { { "--minimise '(p.x - 0.2915)^2 + 30*(p.y + 0.5595405964390703*(p.x - 0.2915))^2 + (p.phi - p.y)^2 + "
                "0*sqrt(0.4915 - "
                "p.x) - 5' --set a=0.4887 --free p.omega=-1:1",
                0.2915 },
              { "--minimise '(p.x + 1.3985)^2 + 5*(p.y + 0.3*p.x)^2 + 0*sqrt(-1.0985 - p.x - 0.5*p.y)' --set a=-1.1085 "
                "--subject-to 'p.y<=1'",
                -1.3985 },
              { "--minimise '(p.x + 0.2053)^2 + 30*(p.y - 0.5614163214483201*(p.x + 0.2053))^2 + (p.phi - p.y)^2 + "
                "0*sqrt(-0.1553 "
                "- p.x)' --set a=-0.1572 --free p.omega=-1:1 --subject-to 'p.y<=1'",
                -0.2053 } };
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
    cli_shell (check_text (
        "pinwheel optimise @/point.yaml %s --free a=-2:2 --free b=-1:1 --set b=0 --starts 1 --json @/o.json",
        all[i].options));
    check_close (all[i].options, optimise_value (cli_file ("o.json"), "a"), all[i].a, 1e-4, "last steps of 1e-7 of 4");
  }
}

/* Four maxima, of which starts in all of the range find the highest. */
TEST (starts) {
  cli_shell ("pinwheel optimise @/point.yaml --maximise 'cos(9*p.x) - 0.05*(p.x - 1.4)^2' --free a=-1.5:2 --starts 12 "
             "--json @/o.json");
  check_close ("a", optimise_value (cli_file ("o.json"), "a"), 1.3963, 1e-3, "2 pi 2/9, displaced by 1e-6");
}

/* No point of a sweep is better, and the nearest ones are worse by the curvature alone. */
TEST (sweep) {
  cli_shell ("pinwheel sweep ezyroller --vary omega=2:6:161 --t-end 5 --step 5e-3 -o @/s.csv");
  char *copy = strdup (cli_file ("s.csv")), *line = strchr (copy, '\n');
  double best = -INFINITY, at = 0;
  for (; line && line[1]; line = strchr (line + 1, '\n')) {
    double omega, x;
    assert_int_equal (sscanf (line + 1, "%lf,ok,%*f,%lf", &omega, &x), 2);
    if (x > best) best = x, at = omega;
  }
  free (copy);
  cli_shell ("pinwheel optimise ezyroller --maximise frame.x --free omega=2:6 --t-end 5 --step 5e-3 --json @/o.json");
  const char *json = cli_file ("o.json");
  check_close ("omega", optimise_value (json, "omega"), at, 0.025, "step of the sweep");
  assert_true (cli_number (json, "value", NULL) >= best);
  check_close ("value", cli_number (json, "value", NULL), best, 1e-2 * best, "curvature over a step");
}

TEST (jobs) {
  char first[20000] = "";
  for (int jobs = 1; jobs <= 3; jobs++) {
    cli_shell (check_text (
        "pinwheel optimise ezyroller --maximise frame.x/max:work --free omega=2:6 --free M0=0.05:0.2 --t-end 1 "
        "--step 0.01 --starts 5 --seed 3 --jobs %d --json @/o.json",
        jobs));
    if (jobs == 1) snprintf (first, sizeof first, "%s", cli_file ("o.json"));
    assert_string_equal (cli_file ("o.json"), first);
  }
}

TEST (interrupt) {
  char command[1000];
  const char *program = getenv ("PINWHEEL");
  for (double seconds = 0.3; seconds < 200; seconds *= 4) { /* under load the first search may take longer */
    snprintf (command, sizeof command,
              "timeout --preserve-status -s INT %g '%s' optimise @/point.yaml --minimise 'p.x^2' --free a=-1:1 "
              "--starts 100000 --json @/o.json",
              seconds, program ? program : "build/pinwheel");
    assert_int_equal (cli_run (command), 130);
    if (strstr (cli_err, "this is the best result so far")) break;
  }
  assert_true (cli_says (cli_file ("o.json"), "status", "interrupted"));
  assert_non_null (strstr (cli_err, "this is the best result so far"));
}

/* ---- Wrong input ---- */

TEST (bad) {
  static const cli_wrong bad[] = {
    { "@/point.yaml --free a", "expected one of --maximise OUTPUT and --minimise OUTPUT" },
    { "@/point.yaml --free a --maximise p.x --minimise p.x",
      "expected one of --maximise OUTPUT and --minimise OUTPUT" },
    { "@/point.yaml --maximise p.x", "nothing is free: add --free NAME or --free NAME=LOW:HIGH" },
    { "@/point.yaml --free a --maximise p.z", "--maximise p.z: no column \"p.z\"; did you mean \"p.x\"?" },
    { "@/point.yaml --free a --maximise p.x --subject-to 'p.q<=1'",
      "--subject-to p.q: no column \"p.q\"; did you mean \"p.x\"?" },
    { "@/point.yaml --free a --maximise p.x --subject-to 'p.x=1'",
      "--subject-to p.x=1: expected OUTPUT<=VALUE or OUTPUT>=VALUE" },
    { "@/point.yaml --free c --maximise p.x", "model point has no parameter \"c\"; valid are a, b, n" },
    { "@/point.yaml --free n --maximise p.x", "--free n: it is a count, and only continuous parameters can be free" },
    { "@/point.yaml --free p.vz --maximise p.x", "model point has no state \"p.vz\"; did you mean \"p.vx\"?" },
    { "@/point.yaml --free a=1 --maximise p.x", "--free a=1: expected NAME=LOW:HIGH[:COUNT][:log], numbers" },
    { "@/point.yaml --free a=2:1 --maximise p.x", "--free a=2:1: expected LOW < HIGH" },
    { "@/point.yaml --free a=1:2:3 --maximise p.x", "--free a=1:2:3: a search has no COUNT; see --starts" },
    { "@/point.yaml --free a=1:2 --maximise p.x",
      "--free a: its value -1, where the search starts, is not between 1 and 2; set it by --set" },
    { "@/point.yaml --free a --free a --maximise p.x", "--free a is given twice" },
    { "@/point.yaml --free a --maximise p.x --starts 0", "--starts 0: expected a whole number >= 1" },
    { "@/point.yaml --free a --maximise p.x -o @/x.yaml --json @/x.yaml",
      "-o and --json cannot both write to @/x.yaml" },
  };
  cli_bad_each ("optimise", bad, sizeof bad / sizeof *bad);
  cli_bad ("pinwheel optimise @/point.yaml --free a=-2:-1 --maximise 'sqrt(p.x)' --starts 2", 4,
           "no run succeeded (2 runs); the first failed: sqrt(p.x) is nan");
  cli_bad ("pinwheel optimise @/point.yaml --free a=-2:0 --maximise p.x --subject-to 'p.x>=1' --starts 2", 4,
           "no run from 2 starts satisfies --subject-to; in the nearest one p.x is 0 m and must be at least 1 m");
  cli_bad (
      "pinwheel optimise @/point.yaml --free a=-2:0 --maximise p.x --subject-to 'p.x>=-1' --subject-to '3*p.y <= -6' "
      "--starts 2 --set b=0.5",
      4, "no run from 2 starts satisfies --subject-to; in the nearest one 3*p.y is 1.5 and must be at most -6");
}

/* Sobol points exist for 40 unknowns; the search from the model's values needs none. */
TEST (many_unknowns) {
  char text[3000] = "pinwheel: 1\nrun: {t_end: 1, step: 1}\nparameters: [", command[1000] = "", name[40];
  for (int i = 0; i < 41; i++) {
    snprintf (name, sizeof name, "%s{name: a%d, value: 0.5}", i ? ", " : "", i);
    strcat (text, name);
    snprintf (name, sizeof name, " --free a%d=0:1", i);
    strcat (command, name);
  }
  strcat (text, "]\nbodies: [{name: p, mass: 1, inertia: 1, rate: {vx: a0}}]\n"
                "elements: [{force: none, body: p, at: [0, 0]}]\n");
  cli_write ("many.yaml", text);
  strcat (command, " --starts 1 --json @/o.json");
  char full[1200];
  snprintf (full, sizeof full, "pinwheel optimise @/many.yaml --maximise p.x%s", command);
  cli_shell (full);
  check_close ("a0", optimise_value (cli_file ("o.json"), "a0"), 1, 1e-6, "last steps of 1e-7");
  strstr (full, "--starts 1")[9] = '2';
  cli_bad (full, 2, "at most 40 unknowns with more than one start; give --starts 1");
}

/* Outputs without a largest value: linear in an unknown without bounds. */
TEST (unbounded) {
  static const char *const without[] = { "--free a --maximise p.x", "--free a --free b=-1:1 --maximise 'p.x - p.y^2'" };
  for (int i = 0; i < 2; i++) {
    assert_int_equal (cli_run (check_text ("pinwheel optimise @/point.yaml %s --starts 2 --json @/o.json", without[i])),
                      4);
    assert_null (strstr (cli_err, " runs")); /* those of a refinement are only a part */
    assert_non_null (strstr (cli_err, "perhaps there is no optimum unless bounds are given, as in --free a=LOW:HIGH"));
    assert_true (cli_says (cli_file ("o.json"), "status", "method"));
  }
}

/* A search ends at its limit of 500 runs.  The derivatives there are 0: its refinement ends at once, with the same
 * value. */
TEST (equal_refinement) {
  cli_shell ("pinwheel optimise @/point.yaml --minimise 'floor(1e4*(100*(p.y - p.x^2)^2 + (1 - p.x)^2 + 100*(p.phi - "
             "p.y^2)^2 + (1 - p.y)^2))' --free a --free b --free p.omega --subject-to 'p.y<=9' --starts 2 --json "
             "@/o.json");
  const char *json = cli_file ("o.json");
  assert_true (cli_says (json, "status", "ok"));
  assert_non_null (strstr (json, "\"runs\": 500,"));
}

/* A pendulum at rest without gravity. */
TEST (no_effect) {
  cli_shell ("pinwheel optimise pendulum --maximise bob.y --free I=0:1 --set g=0 -t 0.1 --starts 2");
  assert_string_equal (cli_err, "pinwheel: no free value has an effect on bob.y\n");
  cli_shell ("pinwheel optimise @/point.yaml --minimise 'p.x*0' --free a=-1:1 --subject-to 'p.x<=0.5'");
  assert_string_equal (cli_err, "pinwheel: no free value has an effect on p.x*0\n");
  assert_int_equal (
      cli_run ("pinwheel optimise @/point.yaml --minimise p.x --free a=-1:1 --subject-to 'p.x>=9' --plots "
               "@/made/a/../b"),
      4);
  assert_int_equal (cli_run ("ls @/made"), 2);
  cli_shell ("pinwheel optimise @/point.yaml --maximise '100 + 0.01*(1 - (p.x - 0.37)^2)' --free a=-1:1");
  assert_null (strstr (cli_out, "without effect"));
  cli_shell ("pinwheel optimise @/point.yaml --minimise '1e4 + 0.05*p.x' --free a=-1:1 -m erk8+none");
  assert_non_null (strstr (cli_out, "at its lower bound"));
  cli_shell ("pinwheel optimise @/point.yaml --minimise p.x --free b=-3:3 --free a=-1:3 --json @/o.json");
  if (!strstr (cli_out, " 3  without effect\n") || !strstr (cli_out, " 3  at its lower bound\n"))
    fail_msg ("one without effect, one at its bound:\n%s", cli_out);
  assert_non_null (strstr (cli_file ("o.json"), "\"bound\": null"));
}

/* Where p.x is 0 it does not matter in which direction the point goes; the searches end at different b. */
TEST (no_effect_there) {
  cli_shell ("pinwheel optimise @/point.yaml --minimise '(p.x*(1 + p.y))^2 + 1' --free a=-3:3 --free b=-0.5:3");
  if (!strstr (cli_out, " 3  without effect\n") || !strstr (cli_out, ", 10 of which end at this optimum"))
    fail_msg ("b has no effect at a = 0:\n%s", cli_out);
}

/* Every run but the first fails. */
TEST (one_run) {
  assert_int_equal (cli_run ("pinwheel optimise @/point.yaml --maximise 'p.x + 0*sqrt(-1 - p.x)' --free a=-1:1e308 -o "
                             "@/o.yaml --starts 2"),
                    4);
  assert_non_null (strstr (cli_out, " largest so far "));
  assert_non_null (strstr (cli_err, "all other runs of the search failed"));
  assert_null (strstr (cli_err, "no free value"));
  assert_non_null (strstr (cli_file ("o.yaml"), "\n# perhaps not an optimum: all other runs of the search failed: "));
}

/* A constraint that is not reached, in a curved valley. */
TEST (inactive_constraint) {
  cli_shell (
      "pinwheel optimise @/point.yaml --minimise '100*(p.y - p.x^2)^2 + (1 - p.x)^2 + 100*(p.phi - p.y^2)^2 + (1 - "
      "p.y)^2' --free a=-3:3 --free b=-3:3 --free p.omega=-3:3 --subject-to 'max:p.x<=5' --json @/o.json");
  const char *json = cli_file ("o.json");
  check_close ("a", optimise_value (json, "a"), 1, 1e-5, "last steps of 1e-7");
  check_close ("p.omega", optimise_value (json, "p.omega"), 1, 1e-4, "p.omega = b^2 = a^4");
}

/* Given initial values that the best run does not have. */
TEST (changed_values) {
  assert_int_equal (
      cli_run ("pinwheel optimise ezyroller --t-end 0.1 --maximise frame.x --free frame.vx=0:1 --starts 1 "
               "--start frame.vy=0 --start frame.omega=7"),
      0);
  assert_string_equal (
      cli_err, "pinwheel: given initial values of this result were changed to satisfy the constraints, at worst "
               "frame.vy from 0 to 3.5 m/s\n");
}

const check_fixture fixture = { optimise_setup, cli_teardown };
