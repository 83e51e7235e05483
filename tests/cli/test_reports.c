/* Reports on unusual models: with internal coordinates, without constraints, with any signal, with
 * names and texts that JSON and YAML would take for something else; and about runs that hardly begin. */
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* The wheels' spin angles and the energies, after 0.5 s of given rates. */
TEST (roller) {
  assert_int_equal (cli_run ("pinwheel run differential-drive --t-end 0.5 --energy"), 0);
  cli_shows ("\n  left.spin             2.5  rad  left.spin_rate               5  rad/s\n");
  cli_shows ("\n  right.spin           3.75  rad  right.spin_rate            7.5  rad/s\n");
  cli_shows ("\n  energy\n  kinetic ");
  cli_shows ("\n  dissipated               0  J\n");
  assert_int_equal (cli_run ("pinwheel run differential-drive --t-end 0.5 --json @/roller.json"), 0);
  check_close ("spin", cli_number (cli_file ("roller.json"), "elements", "right", "spin", NULL), 3.75, 1e-12,
               "4096 eps");
}

/* Reactions have a reference of their own. */
TEST (reactions) {
  assert_int_equal (cli_run ("pinwheel run pendulum --t-end 0.5 -o @/truth.csv >@/log && "
                             "pinwheel run pendulum --t-end 0.5 --step 2e-3 --reference @/truth.csv"),
                    0);
  cli_shows ("\n  reactions ");
  cli_shows (" of the largest\n");
}

/* The angle is not known at the end, but at other times. */
TEST (unknown_end) {
  assert_int_equal (
      cli_run ("pinwheel run pendulum --t-end 0.5 --every 0.1 -o @/ends.csv >@/log && "
               "awk -F, -v OFS=, 'NR > 1 && $1 == 0.5 { $4 = \"nan\" } 1' @/ends.csv >@/unknown.csv && "
               "pinwheel run pendulum --t-end 0.5 --step 2e-3 --reference @/unknown.csv --json @/unknown.json"),
      0);
  const char *json = cli_file ("unknown.json");
  assert_non_null (strstr (json, "\"angle\": null"));
  assert_true (cli_number (json, "truth", "end", "length", NULL) > 0);
  assert_true (cli_number (json, "truth", "largest", "angle", NULL) > 0);
}

TEST (signals) {
  cli_good ("pinwheel show tests/models/signals.yaml");
  cli_shows ("heading {ramp: {from: 0.1, to: -0.2, start: 0.333333, duration: 0.7}} rad\n"); /* no grip */
  cli_shows ("value {table: {points: 4 from 0 to 3.14159 s}} m/s\n");
  cli_shows ("value {pulse: {height: 0.142857, start: 0.1, width: 0.2, period: 0.7, offset: -0.01}} N m\n");
  cli_shows ("fx {harmonic: {amplitude: 0.2, omega: 3, phase: 0.1}} N; fy 0.1 N\n");
  cli_shows ("rate {smooth-step: {from: 0.3, to: 0, duration: 2}} rad/s\n");
}

/* A free body whose turning is driven by its own rate, 2 1/s: it grows, and no step of RK4 is too large for that. */
TEST (unbound) {
  cli_write ("free.yaml", "pinwheel: 1\nabout: \"says \\\"so\\\", \\\\ and a\\ttab\"\nbodies:\n"
                          "  - {name: a, mass: 1, inertia: 1}\nelements:\n"
                          "  - {torque: T, body: [a, ground], value: 2*a.omega}\n");
  cli_good ("pinwheel show @/free.yaml --matrices");
  cli_shows ("\nThe model has no constraints: no J, no gamma\n");
  cli_good ("pinwheel check @/free.yaml");
  cli_shows ("  fastest eigenvalue                 2 1/s\n");
  cli_shows ("  it grows by a factor of e in       0.5 s\n");
  cli_shows ("  RK4 is stable                      with any step: no mode decays or oscillates\n");
  cli_good ("sed '/elements/,$d' @/free.yaml >@/alone.yaml && pinwheel show @/alone.yaml --yaml");
  cli_shows ("about: \"says \\\"so\\\", \\\\ and a\\x09tab\"\n");
  cli_good ("pinwheel show @/alone.yaml --yaml >@/again.yaml && pinwheel show @/again.yaml");
  cli_shows ("again: says \"so\", \\ and a\ttab\n");
}

/* Texts that are null, true or a number without their quotes. */
TEST (literals) {
  static const char *const name[] = { "null", "true", "1e3" };
  for (int i = 0; i < 3; i++) {
    cli_good (check_text (
        "cp models/linkages/pendulum.yaml @/%s.yaml && pinwheel run @/%s.yaml -t 0.01 --json @/it.json >@/log", name[i],
        name[i]));
    assert_true (cli_says (cli_file ("it.json"), "model", name[i]));
  }
}

/* A model whose signal fails at times between two. */
static void reports_write_gap (void) {
  cli_write ("gap.c",
             "#include \"pinwheel.h\"\n"
             "typedef struct { double from, to; } gap;\n"
             "static const pw_parameter list[] = {\n"
             "  { PW_AT (gap, from), 0, \"s\", \"begin\", PW_REAL },\n"
             "  { PW_AT (gap, to), 1e9, \"s\", \"end\", PW_REAL }, { .name = NULL } };\n"
             "static int eval (void *c, double t, const double *x, double *u, double *g) {\n"
             "  const gap *p = c;\n  (void)x, (void)g;\n"
             "  u[0] = u[1] = u[2] = 0;\n"
             "  return t > p->from && t < p->to;\n"
             "}\n"
             "static void build (pw_model *m, const void *p) {\n"
             "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1, .rate = { 1, 0, 0 } });\n"
             "  pw_add_torque (m, &(pw_torque){ .name = \"T\", .body = { \"a\", \"ground\" },\n"
             "    .value = { PW_FUNCTION, .function = { .eval = eval, .context = (void *)(size_t)p } } });\n"
             "}\n"
             "PW_MODEL (.about = \"fails\", .parameters = list, .parameters_size = sizeof (gap), .build = build);\n");
}

/* Every domain of a parameter has a text. */
TEST (domains) {
  cli_write ("domains.c",
             "#include \"pinwheel.h\"\n"
             "typedef struct { double r, n, p, c, f; } all;\n"
             "static const pw_parameter list[] = { { PW_AT (all, r), 1, \"m\", \"any\", PW_REAL },\n"
             "  { PW_AT (all, n), 1, \"m\", \"not below 0\", PW_NONNEGATIVE },\n"
             "  { PW_AT (all, p), 1, \"m\", \"above 0\", PW_POSITIVE },\n"
             "  { PW_AT (all, c), 1, \"\", \"number\", PW_COUNT },\n"
             "  { PW_AT (all, f), 1, \"\", \"part\", PW_FRACTION }, { .name = NULL } };\n"
             "static void build (pw_model *m, const void *p) {\n"
             "  (void)p;\n  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1 });\n}\n"
             "PW_MODEL (.about = \"domains\", .parameters = list, .parameters_size = sizeof (all), .build = build);\n");
  cli_good ("pinwheel show @/domains.c");
  cli_shows ("  r  1  m             any\n");
  cli_shows ("  n  1  m  >= 0       not below 0\n");
  cli_shows ("  p  1  m  > 0        above 0\n");
  cli_shows ("  c  1     1, 2, ...  number\n");
  cli_shows ("  f  1     0 to 1     part\n");
}

/* A run that ends before its first step has nothing to draw, and leaves nothing. */
TEST (nothing) {
  reports_write_gap ();
  assert_int_equal (cli_run ("pinwheel run @/gap.c --plots @/none --animate @/none.html"), 4);
  assert_non_null (strstr (cli_err, ": the run is too short for figures: none are drawn in "));
  assert_non_null (strstr (cli_err, "pinwheel: the run is too short for an animation: "));
  assert_null (cli_file ("none.html"));
}

/* If several things fail, each is reported; the failure of the run determines the exit status. */
TEST (failures) {
  reports_write_gap ();
  assert_int_equal (cli_run ("pinwheel run @/gap.c --json /dev/full"), 4);
  assert_non_null (strstr (cli_err, "pinwheel: cannot write /dev/full: No space left on device\n"));
  assert_non_null (strstr (cli_err, ": a signal"));
  cli_bad ("mkdir -p @/p/motion.dat.part; pinwheel run @/gap.c --set from=0.05 --plots @/p", 1,
           "cannot write @/p/motion.dat: Is a directory"); /* before anything is computed in vain */
  assert_int_equal (cli_run ("pinwheel show @/gap.c --set from=0.03 --set to=0.04 --matrices --at 0.035"), 4);
  assert_non_null (strstr (cli_err, "a signal"));
}

/* A table of a sweep that cannot be put in order: all its rows are kept, and the next start has only to sort them. */
TEST (sorted) {
  const char *sweep = "pinwheel sweep pendulum -t 0.1 --vary m=1,2 -o @/sorted.csv >@/log";
  assert_int_equal (cli_run (check_text ("mkdir @/sorted.csv.sorted; %s", sweep)), 1);
  assert_non_null (strstr (cli_err, "so the same command only has to sort them\n"));
  assert_null (cli_file ("sorted.csv"));
  assert_non_null (cli_file ("sorted.csv.part"));
  assert_int_equal (cli_run (check_text ("rmdir @/sorted.csv.sorted; %s; wc -l <@/sorted.csv", sweep)), 0);
  assert_string_equal (cli_out, "3\n");
}

/* Figures of a run that was resumed are those of one that was not. */
TEST (figures_resumed) {
  assert_int_equal (cli_run ("PATH=/none pinwheel run ezyroller -t 1 --plots @/whole --checkpoint @/whole.ck\n"
                             "PATH=/none pinwheel run ezyroller -t 1 --plots @/parts --checkpoint @/parts.ck\n"
                             "PATH=/none pinwheel run ezyroller -t 1 --plots @/parts --resume @/parts.ck\n"
                             "cmp @/whole/motion.dat @/parts/motion.dat"),
                    0);
  assert_non_null (strstr (cli_err, "pinwheel: resumed at t = 0.9 s\n"));
}

/* The error of reactions is relative also if their unit is "": one of 981, and a reference that is 1 % larger. */
TEST (reaction_without_unit) {
  cli_write ("hold.c",
             "#include \"pinwheel.h\"\n"
             "typedef struct { const char *name, *body; } hold;\n"
             "static const pw_field fields[] = {\n"
             "  { .name = \"body\", .offset = offsetof (hold, body), .type = PW_BODY, .required = 1 },\n"
             "  { .name = NULL } };\n"
             "static const pw_quantity reaction[] = { { \"R\", \"\", NULL, \"upwards\" } };\n"
             "static void g (const pw_batch *b, double *g) {\n"
             "  for (int e = 0; e < b->count; e++) g[e] = b->configuration[b->body[e]].y;\n"
             "}\n"
             "static void J (const pw_batch *b, double *J) {\n"
             "  for (int e = 0; e < b->count; e++) J[3 * e] = J[3 * e + 2] = 0, J[3 * e + 1] = 1;\n"
             "}\n"
             "static const pw_kind kind = { .name = \"hold\", .about = \"y = 0\", .definition = sizeof (hold),\n"
             "  .fields = fields, .bodies = 1, .rows = 1, .level = PW_HOLONOMIC, .reaction = reaction,\n"
             "  .g = g, .g_size = g, .J = J };\n"
             "static void build (pw_model *m, const void *p) {\n"
             "  (void)p;\n"
             "  pw_add_body (m, &(pw_body){ .name = \"ball\", .mass = 100, .inertia = 1 });\n"
             "  pw_add (m, &kind, &(hold){ .name = \"h\", .body = \"ball\" });\n"
             "  pw_add_gravity (m, &(pw_gravity){ .name = \"G\", .acceleration = { 0, -9.81 } });\n"
             "}\n"
             "PW_MODEL (.about = \"held\", .build = build);\n");
  cli_good ("pinwheel run @/hold.c -t 0.1 -o @/held.csv && sed 's/,981,/,990.81,/' @/held.csv >@/off.csv && "
            "pinwheel run @/hold.c -t 0.1 --reference @/off.csv --json @/hold.json");
  check_close ("error", cli_number (cli_file ("hold.json"), "truth", "reactions", NULL), 0.01 / 1.01, 1e-9, "980");
}

/* More rows that say the same than are listed. */
TEST (many_redundant) {
  char text[2000] = "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1}\nelements:\n";
  size_t n = strlen (text);
  for (int i = 0; i < 12; i++)
    n += (size_t)snprintf (text + n, sizeof text - n, "  - {wheel: w%d, body: a, at: [0, %d]}\n", i, i);
  snprintf (text + n, sizeof text - n,
            "  - {rod: R, body: [a, ground], at: [[0, 0], [3, 4]], length: 5}\n"
            "  - {rod: Q, body: [a, ground], at: [[0, 0], [3, 4]], length: 5}\n");
  cli_write ("wheels.yaml", text);
  assert_int_equal (cli_run ("pinwheel run @/wheels.yaml -t 0.1"), 0);
  assert_non_null (strstr (cli_err, "pinwheel: redundant: rods R and Q: the same constraint\n"));
  assert_non_null (strstr (cli_err, "  and 4 more"));
}

/* What contradicts itself has no start, and check knows nothing further. */
TEST (contradiction) {
  cli_write ("two.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1}\nelements:\n"
                         "  - {pin: P, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                         "  - {pin: Q, body: [a, ground], at: [[0, 0], [1, 0]]}\n");
  assert_int_equal (cli_run ("pinwheel check @/two.yaml --json -"), 3);
  cli_shows ("\"saddle_point\": null");
  cli_shows ("\"start\": null");
  cli_shows ("\"linearisation\": null");
}

/* A program alone, without models or headers around it. */
TEST (alone) {
  cli_good ("mkdir @/bin && cp \"${PINWHEEL:-build/pinwheel}\" ${BUILD:-build}/libpinwheel*.so.* @/bin");
  cli_good ("PINWHEEL_MODELS= @/bin/pinwheel list");
  cli_shows ("none found; folders named in the environment variable PINWHEEL_MODELS are searched\n");
  assert_int_equal (cli_run ("PINWHEEL_MODELS= @/bin/pinwheel run pendulum"), 2);
  assert_non_null (strstr (cli_err, "pinwheel: there is no model \"pendulum\", nor any other in the folders of "));
  assert_int_equal (cli_run ("pinwheel new @/own.c >@/log && @/bin/pinwheel run @/own.c"), 2);
  assert_non_null (strstr (cli_err, ": pinwheel.h is not in \"include\", \"../include\" or "));
}

/* A table of a sweep has the same columns in every row. */
TEST (columns) {
  cli_write ("some.c",
             "#include \"pinwheel.h\"\n"
             "typedef struct { double size; } some;\n"
             "static const pw_parameter list[] = {\n"
             "  { PW_AT (some, size), 1, \"m\", \"size\", PW_POSITIVE }, { .name = NULL } };\n"
             "static void build (pw_model *m, const void *parameters) {\n"
             "  const some *p = parameters;\n"
             "  pw_add_body (m, &(pw_body){ .name = p->size > 1 ? \"big\" : \"small\", .mass = 1, .inertia = 1 });\n"
             "}\n"
             "PW_MODEL (.about = \"some\", .parameters = list, .parameters_size = sizeof (some), .build = build);\n");
  assert_int_equal (cli_run ("pinwheel sweep @/some.c -t 0.1 --vary size=1,2 -o @/some.csv"), 0);
  assert_non_null (strstr (cli_err,
                           "pinwheel: 1 of 2 runs failed, the first of them: big.x has no column: not in the first or "
                           "last row, nor in the first with one count changed"));
  assert_non_null (strstr (cli_file ("some.csv"), "\n2,input,"));
}

/* Ladders that are none. */
TEST (ladder) {
  cli_bad (
      "pinwheel compare pendulum --methods rk4 --step-ladder 0.0000000000000000000000000000000000000000000000001:1", 2,
      "--step-ladder 0.0000000000000000000000000000000000000000000000001:1: expected FROM:TO");
}

/* Of elements with several limited reactions, events name the reaction. */
TEST (events) {
  cli_good ("pinwheel run drifting-car -t 2");
  assert_non_null (strstr (cli_out, " t = 1 s: rolling-wheel rear.N slides\n"));
  assert_non_null (strstr (cli_out, " s: rolling-wheel rear.B holds\n"));
  assert_non_null (strstr (cli_out, " s: steered-wheel front slides-\n"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
