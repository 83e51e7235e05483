/* The program with text models: tables are those of models in C, byte by byte; every model survives being written as
 * text and read again. */
#include <string.h>
#include "check.h"
#include "cli.h"

#define TEXT "tests/models/ezyroller.yaml"

TEST (same_tables) {
  cli_good ("pinwheel run ezyroller -t 10 --energy -o @/c.csv >/dev/null && pinwheel run " TEXT
            " -t 10 --energy -o @/text.csv >/dev/null && cmp @/c.csv @/text.csv");
  assert_int_equal (cli_run ("pinwheel run ezyroller -t 5 -m ida+ggl --set a=0.4 --start frame.vx=1 -o @/c.csv && "
                             "pinwheel run " TEXT " -t 5 -m ida+ggl --set a=0.4 --start frame.vx=1 -o @/text.csv && "
                             "cmp @/c.csv @/text.csv"),
                    0);
}

/* Each row builds the model anew, in threads. */
TEST (same_sweeps) {
  cli_good (
      "pinwheel sweep ezyroller -t 1 --vary a=0.3:0.7:9 --jobs 2 -o @/c.csv >/dev/null 2>&1 && pinwheel sweep " TEXT
      " -t 1 --vary a=0.3:0.7:9 --jobs 2 -o @/text.csv >/dev/null 2>&1 && cmp @/c.csv @/text.csv");
}

/* Every model on the search path: as text, and its run compared; what text cannot say is
 * refused by name. */
TEST (round_trip) {
  cli_good ("pinwheel list models >/dev/null");
  assert_int_equal (
      cli_run (
          "for m in ${BUILD:-build}/models/*.so ${BUILD:-build}/models/*.yaml " TEXT "; do\n"
          "  [ -f \"$m\" ] || continue\n"
          "  if pinwheel show \"$m\" --yaml >@/again.yaml 2>@/why; then\n"
          "    pinwheel run \"$m\" -t 0.2 -o @/once.csv >/dev/null 2>&1 || { echo \"bad: $m\"; exit 1; }\n"
          "    pinwheel run @/again.yaml -t 0.2 -o @/again.csv >/dev/null 2>&1 || { echo \"bad: $m again\"; exit 1; }\n"
          "    cmp @/once.csv @/again.csv || { echo \"bad: $m differs\"; exit 1; }\n"
          "    echo \"same: $m\"\n"
          "  else\n"
          "    grep -e 'is a function$' -e 'of the model.s own$' @/why || { cat @/why; exit 1; }\n"
          "  fi\n"
          "done"),
      0);
  if (strstr (cli_out, "bad:")) print_error ("%s", cli_out);
  assert_null (strstr (cli_out, "bad:"));
  assert_non_null (strstr (cli_out, "same: "));
}

/* Every signal, tables from a file among them, by a fixed and an adaptive method. */
TEST (round_trip_signals) {
  cli_good (
      "pinwheel show tests/models/signals.yaml --yaml >@/signals.yaml && ! grep file: @/signals.yaml && "
      "for m in rk4+projection ida+ggl; do pinwheel run tests/models/signals.yaml -m $m -o @/once.csv >/dev/null 2>&1 "
      "&& "
      "pinwheel run @/signals.yaml -m $m -o @/again.csv >/dev/null 2>&1 && cmp @/once.csv @/again.csv || exit 1; done");
}

static const char cli_function[] =
    "#include \"pinwheel.h\"\n"
    "static int f (void *c, double t, const double *x, double u[3], double *g) {\n"
    "  (void)c, (void)x, (void)g;\n"
    "  u[0] = t;\n"
    "  return 0;\n"
    "}\n"
    "static void build (pw_model *m, const void *p) {\n"
    "  (void)p;\n"
    "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1 });\n"
    "  pw_add_torque (m, &(pw_torque){ .name = \"T\", .body = { \"a\", \"ground\" },\n"
    "                                  .value = { PW_FUNCTION, .function = { .eval = f } } });\n"
    "}\n"
    "PW_MODEL (.build = build);\n";

/* Expressions are shown and written as they are; their names stand under let. */
static const char cli_expressions[] =
    "pinwheel: 1\nparameters: [{name: A, value: 0.3}]\nlet: {w: 2*A}\n"
    "bodies: [{name: a, mass: 1, inertia: 1}, {name: b, mass: 1, inertia: 1, start: {x: 1}}]\n"
    "elements:\n  - {torque: T, body: [a, ground], value: \"t > 0.05 ? A*sin(w*t) : -b.omega\"}\n"
    "  - {drive: D, body: [b, ground], what: angle, value: {expression: A*t^2, rate: 2*A*t}}\n"
    "  - {torque: U, body: [a, ground], value: \"-A*atan2(a.omega - 1, -1)\"}\n";

TEST (expressions) {
  cli_write ("e.yaml", cli_expressions);
  cli_good ("pinwheel show @/e.yaml");
  assert_non_null (
      strstr (cli_out, "torque T: body [a, ground]; value {expression: \"t > 0.05 ? A*sin(w*t) : -b.omega\"} N m\n"));
  assert_non_null (strstr (cli_out, "value {expression: \"A*t^2\", rate: \"2*A*t\"} m or rad\n"));
  assert_int_equal (
      cli_run ("pinwheel show @/e.yaml --yaml >@/again.yaml && pinwheel run @/e.yaml -t 0.2 -o @/e.csv >/dev/null && "
               "pinwheel run @/again.yaml -t 0.2 -o @/again.csv >/dev/null && cmp @/e.csv @/again.csv"),
      0);
  assert_non_null (strstr (cli_err, "torque U: value: \"atan2(a.omega - 1, -1)\" may jump as states change"));
  assert_null (strstr (cli_err, "torque T"));
  assert_int_equal (cli_run ("pinwheel check @/e.yaml"), 0);
  assert_non_null (strstr (cli_err, "torque U: value: \"atan2(a.omega - 1, -1)\" may jump as states change"));
}

/* Only operations are named whose arguments can reach a jump, unless it is located, as those of conditions are. */
TEST (jumps) {
  static const struct {
    const char *expression;
    int jumps;
  } of[] = { { "atan2(a.vx, 1)", 0 },
             { "atan2(a.vx, 2 + cos(a.phi))", 0 },
             { "atan2(1 + a.vy^2, a.vx)", 0 },
             { "sign(a.vx^2 + 1)", 0 },
             { "round(0.3*sin(a.phi))", 0 },
             { "mod(0.5 + 0.1*tanh(a.vx), 1)", 0 },
             { "cos(a.phi) < 2 ? a.vx : 1", 0 },
             { "atan2(a.vx, -1)", 1 },
             { "atan2(a.vx, cos(a.phi))", 1 },
             { "sign(a.vx^2 - 1)", 0 },
             { "floor(3*sin(a.phi))", 0 },
             { "mod(a.phi, 2*pi)", 0 },
             { "t + atan2(a.vx, 1 - t)", 1 },
             { "floor(a.phi) + atan2(a.vx, -1)", 1 },
             { "cos(a.phi) < 0.5 ? a.vx : 1", 0 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    cli_write ("j.yaml", check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n"
                                     "  - {torque: T, body: [a, ground], value: \"%s\"}\n",
                                     of[i].expression));
    assert_int_equal (cli_run ("pinwheel run @/j.yaml -t 1e-3"), 0);
    if ((strstr (cli_err, "may jump as states change") != NULL) != of[i].jumps)
      fail_msg ("%s: %s", of[i].expression, cli_err);
  }
}

TEST (no_text) {
  cli_write ("f.c", cli_function);
  cli_bad ("pinwheel show @/f.c --yaml", 2,
           "model f cannot be written as text: the signal \"value\" of torque T is a function");
  cli_bad ("pinwheel show ezyroller --yaml --start frame.vx=1", 2,
           "--yaml: initial values of --start have no place in a text model; give them to run");
  cli_good ("pinwheel show @/f.c");
  assert_non_null (strstr (cli_out, "torque T: body [a, ground]; value f (t) N m"));
}

/* A text model specifies what it contains; a model in C may contain values that it does not specify. */
TEST (unspecified) {
  cli_write ("guess.c", "#include \"pinwheel.h\"\n"
                        "static void build (pw_model *m, const void *p) {\n"
                        "  (void)p;\n"
                        "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .start = { 1, 2 }, .rate = { 3 },\n"
                        "                              .specified = PW_SPECIFIES_Y | PW_SPECIFIES_OMEGA });\n"
                        "  pw_add_body (m, &(pw_body){ .name = \"b\", .mass = 1, .start = { 1, -0.0 } });\n"
                        "  pw_add_body (m, &(pw_body){ .name = \"c\", .mass = 1, .start = { 1 } });\n"
                        "}\n"
                        "PW_MODEL (.build = build);\n");
  cli_good ("pinwheel show @/guess.c --yaml");
  assert_non_null (strstr (cli_out, "  - {name: a, mass: 1, start: {x: 1, y: 2}, rate: {vx: 3, omega: 0}}"
                                    "  # the model does not specify x, vx\n"));
  assert_non_null (strstr (cli_out, "start: {x: 1, y: -0}}  # the model does not specify y\n"));
  assert_non_null (strstr (cli_out, "  - {name: c, mass: 1, start: {x: 1}}\n"));
  cli_good ("pinwheel show @/guess.c --yaml >@/guess.yaml && pinwheel show @/guess.yaml");
}

TEST (max_file) {
  cli_good ("{ cat " TEXT "; yes '# nothing' | head -c 300000; } >@/long.yaml");
  cli_bad ("pinwheel show @/long.yaml --max-file 0.25", 2,
           "@/long.yaml: the file has more than 0.25 MB, the limit for a model unless --max-file raises it");
  cli_good ("pinwheel show @/long.yaml --max-file 0.5 >/dev/null");
  cli_bad ("pinwheel show @/long.yaml --max-file 1e-308", 2, "--max-file 1e-308: expected at least 0.001 MB");
  cli_bad ("pinwheel run @/long.yaml --max-file 1e4", 2, "--max-file 1e4: expected at most 2000 MB");
  cli_bad ("pinwheel sweep @/long.yaml --max-file x --vary a=1,2 -o @/x.csv", 2, "--max-file: \"x\" is not a number");
}

TEST (names) {
  cli_good ("mkdir @/models && cp " TEXT " @/models/roller.yaml && "
            "PINWHEEL_MODELS=@/models pinwheel run roller -t 0.1 >/dev/null");
  assert_int_equal (cli_run ("cp ${BUILD:-build}/models/ezyroller.so @/models/roller.so && "
                             "PINWHEEL_MODELS=@/models pinwheel show roller"),
                    2);
  assert_non_null (strstr (cli_err, "several files match \"roller\", such as "));
  assert_non_null (strstr (cli_err, "/models/roller.so and "));
  assert_non_null (strstr (cli_err, "/models/roller.yaml; name the model by its path\n"));
}

/* Nothing but Pinwheel's own message is printed, as compilers do. */
TEST (message) {
  char expected[500];
  cli_write ("bad.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1/(k - k)}\n");
  assert_int_equal (cli_run ("pinwheel run @/bad.yaml"), 2);
  cli_expand ("@/bad.yaml:3:24: error: body a: mass: there is no \"k\"\n"
              "    - {name: a, mass: 1/(k - k)}\n"
              "                         ^\n",
              expected, sizeof expected);
  assert_string_equal (cli_err, expected);
  cli_write ("bad.yaml", "pinwheel: 1\nabout: [1, 2\n");
  assert_int_equal (cli_run ("pinwheel show @/bad.yaml"), 2);
  cli_expand ("@/bad.yaml:2:8: error: flow sequence without a closing bracket\n"
              "  about: [1, 2\n"
              "         ^\n",
              expected, sizeof expected);
  assert_string_equal (cli_err, expected);
  assert_string_equal (cli_out, "");
}

/* `new` writes the same model both ways. */
TEST (new) {
  cli_good ("pinwheel new @/mine.yaml");
  cli_good ("pinwheel new @/mine.c");
  cli_bad ("pinwheel new @/mine.yaml", 2, "@/mine.yaml exists already and was not changed");
  cli_good ("pinwheel run @/mine.yaml --every 0.5 --set torque=0.5 -o @/text.csv >/dev/null && "
            "pinwheel run @/mine.c --every 0.5 --set torque=0.5 -o @/c.csv >/dev/null && cmp @/c.csv @/text.csv");
}

/* Rows between rates that are all held are no way to begin: what is held is let go, the scene starts and runs. */
TEST (held) {
  assert_int_equal (cli_run ("pinwheel run tests/scenes/held-welds.yaml -t 0.5 --json @/held.json"), 0);
  const char *json = cli_file ("held.json");
  assert_true (cli_says (json, "status", "ok"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
