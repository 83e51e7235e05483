/* Command lines with errors: messages and exit statuses. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"

/* ---- Command lines that are wrong ---- */

TEST (bad_lines) {
  static const cli_wrong bad[] = {
    { "shew", "there is no command \"shew\"; did you mean \"show\"?" },
    { "rnu", "there is no command \"rnu\"; did you mean \"run\"?" },
    { "xyzzy", "there is no command \"xyzzy\"; see pinwheel --help" },
    { "--verbose", "there is no option \"--verbose\"; did you mean \"--version\"?" },
    { "./car.yaml", "\"./car.yaml\" is not a command; to run a model write pinwheel run ./car.yaml" },
    { "run", "missing argument; usage: pinwheel run MODEL [OPTION...]" },
    { "run a b", "unexpected argument \"b\"; usage: pinwheel run MODEL [OPTION...]" },
    { "run ezyroler", "there is no model \"ezyroler\"; did you mean \"ezyroller\"?" },
    { "run ezyroller --metod rk4", "run has no option \"--metod\"; did you mean \"--method\"?" },
    { "page pendulum --atol 1e-9 -o @/p.html",
      "page has no option \"--atol\" (an option of run, sensitivity, sweep, fit, optimise); did you mean \"--rtol\"?" },
    { "run ezyroller --quiet", "run has no option \"--quiet\"; see pinwheel run --help" },
    { "run ezyroller --method", "run: option --method needs a value" },
    { "run ezyroller --step 1e-3 --method rk4 --step 1e-4", "run: option --step is given twice" },
    { "run ezyroller -o @/a.csv --output @/b.csv", "run: option --output is given twice" },
    { "run ezyroller --reference @/a.csv --truth @/b.csv", "run: option --truth is given twice" },
    { "run ezyroller --method rk5", "there is no integrator \"rk5\"; did you mean \"erk5\"?" },
    { "run ezyroller --method rk4+projecton",
      "integrator rk4 has no stabilisation \"projecton\"; did you mean \"projection\"?" },
    { "run ezyroller --method rk4+projection:metrik=mass",
      "method rk4+projection has no option \"metrik\"; did you mean \"metric\"?" },
    { "run ezyroller --method rk4+projection:every=2:every=3", "method option every is given twice" },
    { "run ezyroller --method erk8+projection --rtol 2", "setting rtol = 2: expected a number less than 1" },
    { "run ezyroller --step 0", "--step 0: expected a number > 0" },
    { "run ezyroller --step nan", "--step nan: expected a finite number" },
    { "run ezyroller --step 1,5", "--step: \"1,5\" is not a number" },
    { "run ezyroller --t-end -1", "--t-end -1: expected a number > 0" },
    { "run ezyroller --rtol 0", "--rtol 0: expected a number > 0" },
    { "run ezyroller --atol -1", "--atol -1: expected a number > 0" },
    { "run ezyroller --every 0 -o @/a.csv", "--every 0: expected a number > 0" },
    { "run ezyroller --step 1e-300", "setting step = 1e-300: expected at least 1e-13 for a run to t = 100" },
    { "run ezyroller --method erk8:steps=fixed --t-end 1e14 --step 1e-2",
      "setting step = 0.01: expected at least 0.1 for a run to t = 1e+14" },
    { "page ezyroller -o @/x.pdf", "-o @/x.pdf: expected a name that ends in .html" },
    { "sweep", "missing argument; usage: pinwheel sweep MODEL --vary NAME=RANGE... -o FILE.csv [OPTION...]" },
    { "sweep --merge -o @/a.csv", "missing argument; usage: pinwheel sweep --merge PART... -o FILE.csv" },
    { "run ezyroller --every 0.1", "--every 0.1: only with -o FILE" },
    { "run ezyroller --every 0.1 --json @/a.json", "--every 0.1: only with -o FILE" },
    { "run ezyroller --width 85mm", "--width 85mm: only with --plots DIR" },
    { "run ezyroller --colour time", "--colour time: only with --plots DIR" },
    { "optimise ezyroller --maximise frame.x --free a --width 85mm", "--width 85mm: only with --plots DIR" },
    { "compare ezyroller --width 85mm", "--width 85mm: only with --plots DIR" },
    { "steady pendulum --width 85mm", "--width 85mm: only with --plots DIR" },
    { "sensitivity pendulum --of bob.x --by l --every 1", "--every 1: only with -o FILE" },
    { "run ezyroller --set aa=1", "model ezyroller has no parameter \"aa\"; did you mean \"a\"?" },
    { "run ezyroller --set frame.vx=1",
      "--set frame.vx=1: expected a parameter; initial values of states are given by --start" },
    { "run pure-pursuit --set steer=0.1",
      "--set steer=0.1: expected a parameter; initial values of states are given by --start" },
    { "run tests/models/arms.yaml --set a_A=1", "--set a_A=1: A is a parameter of an included file; the model sets "
                                                "it by \"set: {A: NAME}\" in the entry of that "
                                                "file, from a parameter NAME of its own" },
    { "run ezyroller --until 'frame.x > 2 m'",
      "--until frame.x > 2 m: \"m\" after a number: write it without a unit, in SI units, angles in rad or as 90*deg" },
    { "sweep n-trailer --vary n=1,2 --of trailer2.x -t 1 -o @/n.csv",
      "--of trailer2.x: no column \"trailer2.x\"; did you mean \"trailer1.x\"? (in the run with n = 1)" },
    { "run ezyroller --of frame.q", "--of frame.q: no column \"frame.q\"; did you mean \"frame.x\"?" },
    { "run ezyroller --of frame.x --error", "--error compares complete runs: it cannot be given together with --of" },
    { "sweep ezyroller --vary M0=1:2 --vary omega=1:2 --vary m1=1:2 --plots @/three -o @/n.csv",
      "--plots: figures show one or two varied quantities, not 3" },
    { "steady pendulum -o a.png",
      "-o a.png: the format .png is not written: expected a name that ends in .csv, .npz or .json" },
    { "run ezyroller --start m1=1", "--start m1=1: m1 is a parameter, expected a state; use --set" },
    { "run ezyroller --set m1=-1", "model ezyroller: parameter m1 = -1: expected a number > 0" },
    { "run ezyroller --set m1=nan", "model ezyroller: parameter m1 = nan: expected a finite number" },
    { "run ezyroller --set omega=30deg", "--set omega=30deg: \"30deg\" is not a number; write 30*deg" },
    { "run ezyroller --start frame.phi=-1.5e1°",
      "--start frame.phi=-1.5e1°: \"-1.5e1°\" is not a number; write -1.5e1*deg" },
    { "run ezyroller --t-end 10s", "--t-end: \"10s\" is not a number; write 10: numbers are in SI units" },
    { "run ezyroller --step '2 ms'", "--step: \"2 ms\" is not a number; write 2*1e-3: numbers are in SI units" },
    { "run ezyroller --set m1=2furlong", "--set m1=2furlong: \"2furlong\" is not a number" },
    { "sweep ezyroller --vary omega=0:90deg:3 -o @/x.csv",
      "--vary omega=0:90deg:3: expected NAME=LOW:HIGH[:COUNT][:log], numbers; write 90*deg" },
    { "sweep ezyroller --vary omega=1,2pi -o @/x.csv",
      "--vary omega=1,2pi: \"2pi\" is not a finite number; write 2*pi" },
    { "optimise ezyroller --maximise frame.x --free omega --subject-to 'frame.phi<=90deg'",
      "--subject-to frame.phi<=90deg: expected OUTPUT<=VALUE or OUTPUT>=VALUE; write 90*deg" },
    { "sweep ezyroller --vary y=0:1:3 -o @/x.csv",
      "model ezyroller has no parameter or state \"y\"; did you mean \"frame.y\"?" },
    { "run ezyroller --set vx=1", "model ezyroller has no parameter \"vx\"; did you mean --start \"frame.vx\"?" },
    { "run ezyroller --set omga=1", "model ezyroller has no parameter \"omga\"; did you mean \"omega\"?" },
    { "sensitivity ezyroller --of frame.x --by y",
      "model ezyroller has no parameter or state \"y\"; did you mean \"frame.y\"?" },
    { "steady ezyroller --vary speed=0:1", "model ezyroller has no state \"speed\"; did you mean \"frame.speed\"?" },
    { "run ezyroller --set m1", "--set m1: expected NAME=VALUE" },
    { "run ezyroller --set m1=", "--set m1=: \"\" is not a number" },
    { "run ezyroller --set =1", "--set =1: expected NAME=VALUE" },
    { "run ezyroller --start frame.z=1",
      "model ezyroller has no state \"frame.z\"; valid are x, y, phi, vx, vy, omega" },
    { "run ezyroller --start fram.x=1", "model ezyroller has no state \"fram.x\"; did you mean \"frame.x\"?" },
    { "run ezyroller --start frame.x=inf", "model ezyroller: start frame.x = inf: expected a finite number" },
    { "run ezyroller -o - --json -", "-o and --json cannot both write to standard output (-)" },
    { "run ezyroller -o ''", "the name of a file to write is empty" },
    { "run @/nothere.c", "cannot open @/nothere.c: No such file or directory" },
    { "run @/", "cannot open @/: it is a directory, not a regular file" },
    { "run pendulum --method-file @/nothere.c", "--method-file: cannot open @/nothere.c: No such file or directory" },
    { "show", "missing argument; usage: pinwheel show MODEL [OPTION...]" },
    { "show ezyroler", "there is no model \"ezyroler\"; did you mean \"ezyroller\"?" },
    { "show ezyroller --at -1", "--at -1: expected a number >= 0" },
    { "show ezyroller --yaml --c", "expected one of --matrices, --yaml and --c" },
    { "show ezyroller --yaml --at 1", "expected one of --at T, --yaml and --c" },
    { "list foo", "there is no list of \"foo\"; valid are models, methods, kinds, signals" },
    { "list models b", "unexpected argument \"b\"; usage: pinwheel list models" },
    { "list methods rk5", "there is no integrator \"rk5\"; did you mean \"erk5\"?" },
    { "list kinds pinn", "there is no element type \"pinn\"; did you mean \"pin\"?" },
    { "new", "missing argument; usage: pinwheel new NAME.c|NAME.yaml" },
    { "new foo.x", "\"foo.x\": a model file's name has at most 99 letters, digits, _ and -, does not begin with -, and "
                   "ends in .c or .yaml" },
    { "new 'a b.c'", "\"a b.c\": a model file's name has at most 99 letters, digits, _ and -, does not begin with -, "
                     "and ends in .c or .yaml" },
  };
  cli_bad_each ("", bad, sizeof bad / sizeof *bad);
}

/* A rod that is too short: the error names the expression without a value.  Perpendicular, it is too fast. */
TEST (too_short) {
  assert_int_equal (cli_run ("pinwheel run slider-crank --set l1=2 --set theta=1"), 2);
  assert_non_null (strstr (cli_err, "slider-crank.yaml:24:11: error: let beta = nan: expected a finite number\n"));
  assert_int_equal (cli_run ("pinwheel run slider-crank --set l1=2 --set theta=0.5235987755982988"), 4);
  assert_non_null (strstr (cli_err, "t = 0.001 s: the step of 0.001 s is too large: "));
}

/* A folder of the search path that is not there is named if a model is missing, and only then. */
TEST (search_path) {
  assert_int_equal (cli_run ("PINWHEEL_MODELS=@/nowhere pinwheel run pendulu"), 2);
  char expected[300];
  cli_expand ("; PINWHEEL_MODELS has @/nowhere (No such file or directory); did you mean \"pendulum\"?\n", expected,
              sizeof expected);
  assert_non_null (strstr (cli_err, "pinwheel: there is no model \"pendulu\" in /"));
  assert_non_null (strstr (cli_err, expected));
  cli_good ("PINWHEEL_MODELS=@/nowhere pinwheel run pendulum --t-end 0.1");
}

/* A tolerance that the method does not follow, a step it does not take; if both are given there is no message. */
TEST (useless_options) {
  static const char step[] = "pinwheel: --step has no effect: erk5+projection chooses its steps by --rtol, --atol\n",
                    rtol[] = "pinwheel: --rtol has no effect: rk4+none takes steps of --step\n",
                    atol[] = "pinwheel: --atol has no effect: erk8+none:steps=fixed takes steps of --step\n";
  assert_int_equal (cli_run ("pinwheel run pendulum --t-end 0.1 --method erk5+projection --step 0.1"), 0);
  assert_string_equal (cli_err, step);
  assert_int_equal (cli_run ("pinwheel run pendulum --t-end 0.1 --method rk4+none --rtol 1e-9"), 0);
  assert_string_equal (cli_err, rtol);
  assert_int_equal (cli_run ("pinwheel run pendulum --t-end 0.1 --method erk8+none:steps=fixed --atol 1e-9"), 0);
  assert_string_equal (cli_err, atol);
  assert_int_equal (cli_run ("pinwheel sweep pendulum --t-end 0.1 --method erk5+projection --step 0.1 --vary l=1,2 "
                             "-o @/sweep.csv"),
                    0);
  assert_string_equal (cli_err, step);
  cli_good ("pinwheel run pendulum --t-end 0.1 --method rk4+none --rtol 1e-9 --step 0.01");
  cli_good ("pinwheel run pendulum --t-end 0.1 --method ida+ggl --rtol 1e-6 --step 0.01");
}

/* Whatever cannot be written is said before the run starts. */
TEST (unwritable) {
  cli_bad ("pinwheel run ezyroller --t-end 1e9 -o @/no/x.csv", 1, "cannot write @/no/x.csv: No such file or directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 -o @", 1, "cannot write @: Is a directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 --json @/no/x.json", 1,
           "cannot write @/no/x.json: No such file or directory");
  cli_bad ("pinwheel run ezyroller --t-end 1e9 --plots @/out/plots", 1,
           "cannot make the folder @/out/plots: Not a directory");
  cli_bad ("pinwheel new @/no/mine.c", 1, "cannot write @/no/mine.c: No such file or directory");
}

/* A command that is refused leaves no folder behind, but those that were there. */
TEST (no_folder) {
  cli_good ("mkdir @/kept");
  assert_int_equal (cli_run ("pinwheel steady ezyroller -o @/kept/new/inner/"), 2);
  assert_int_equal (cli_run ("pinwheel run ezyroller --plots @/kept/plots -m rk4:step=1"), 2);
  assert_int_equal (cli_run ("pinwheel compare ezyroller --reference @/none.csv -o @/kept/study"), 2);
  cli_good ("ls @/kept");
  assert_string_equal (cli_out, "");
  assert_int_equal (cli_run ("pinwheel steady ezyroller -o @/kept/steady.csv --json @/kept/steady.json --plots @/kept"),
                    2);
  cli_good ("rmdir @/kept");
}

TEST (full_disk) {
  if (access ("/dev/full", W_OK) != 0) skip ();
  cli_bad ("pinwheel run ezyroller --t-end 10 -o /dev/full", 1, "cannot write /dev/full: No space left on device");
  cli_bad ("pinwheel list >/dev/full", 1, "cannot write to standard output: No space left on device");
}

/* ---- Models that are wrong ---- */

#define CLI_MODEL(body)                                                                          \
  "#include \"pinwheel.h\"\nstatic void build (pw_model *m, const void *p) {\n  (void)p;\n" body \
  "}\nPW_MODEL (.about = \"wrong\", .build = build);\n"

TEST (bad_models) {
  cli_write (
      "torn.c",
      CLI_MODEL ("  pw_add_body (m, &(pw_body){ .name = \"rod\", .mass = 1, .inertia = 1, .start = { 1.5, 0, 0 } });\n"
                 "  pw_add_pin (m, &(pw_pin){ .name = \"left\", .body = { \"rod\", \"ground\" }, .at = { { -0.5, 0 }, "
                 "{ 0, 0 } } });\n"
                 "  pw_add_pin (m, &(pw_pin){ .name = \"right\", .body = { \"rod\", \"ground\" }, .at = { { 0.5, 0 }, "
                 "{ 3, 0 } } });\n"));
  cli_bad ("pinwheel run @/torn.c --json @/torn.json", 3,
           "model torn: the initial state cannot be made consistent: pin left is open by 1 m; if it can close, begin "
           "nearer to "
           "where it does");
  assert_true (cli_says (cli_file ("torn.json"), "status", "start"));

  cli_write ("lost.c", CLI_MODEL ("  pw_add_wheel (m, &(pw_wheel){ .name = \"A\", .body = \"frame\" });\n  pw_add_body "
                                  "(m, &(pw_body){ .name = \"fram\" });\n"));
  cli_write ("wish.yaml", "pinwheel: 1\nrun: {method: rk4+projektion}\nbodies:\n  - {name: a, mass: 1, inertia: 1}\n");
  cli_bad ("pinwheel run @/wish.yaml", 2,
           "model wish: its default method: integrator rk4 has no stabilisation \"projektion\"; did you mean "
           "\"projection\"?");
  cli_bad ("pinwheel run @/lost.c", 2, "model lost: wheel A: there is no body \"frame\"; did you mean \"fram\"?");

  cli_write ("none.c", "int nothing;\n");
  assert_int_equal (cli_run ("pinwheel run @/none.c"), 2);
  assert_non_null (strstr (cli_err, "is not a Pinwheel model: a model file ends with PW_MODEL (...)"));

  cli_write ("broken.c", "#include \"pinwheel.h\"\nnonsense (;\n");
  assert_int_equal (cli_run ("pinwheel run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, "broken.c:2:")); /* the compiler's own words */
  assert_non_null (strstr (cli_err, "pinwheel: "));

  cli_write ("text.so", "this is no shared object\n");
  assert_int_equal (cli_run ("pinwheel run @/text.so"), 2);
  assert_int_equal (strncmp (cli_err, "pinwheel: cannot load ", 22), 0);
}

/* Tables that do not hold together are refused before they are used. */
TEST (bad_tables) {
  static const char model[] = "#include \"pinwheel.h\"\n"
                              "typedef struct { double a; } numbers;\n"
                              "static const pw_parameter list[] = { { PW_AT (numbers, a), VALUE, \"m\", \"a\", "
                              "PW_POSITIVE }, { .name = NULL } };\n"
                              "static void build (pw_model *m, const void *p) { (void)p; pw_add_body (m, &(pw_body){ "
                              ".name = \"b\", .mass = 1, .inertia = 1 }); }\n"
                              "static void (*const unused) (pw_model *, const void *) = build;\n"
                              "const pw_plugin_table pw_plugin = { .abi = ABI, .size = sizeof (pw_plugin_table), "
                              ".parameters = list, .parameters_size = SIZE, .build = BUILD };\n"
                              "const void *pw_used (void);\nconst void *pw_used (void) { return &unused; }\n";
  static const struct {
    const char *defines, *message;
  } bad[] = {
    { "#define ABI 77\n#define VALUE 1\n#define SIZE sizeof (numbers)\n#define BUILD build\n",
      "was compiled for another Pinwheel (ABI 77, this one has " },
    { "#define ABI PW_ABI\n#define VALUE 1\n#define SIZE 4\n#define BUILD build\n",
      ": parameter a lies outside the model's structure: set .parameters_size to its sizeof" },
    { "#define ABI PW_ABI\n#define VALUE 0\n#define SIZE sizeof (numbers)\n#define BUILD build\n",
      ": parameter a has the default 0: expected a number > 0" },
    { "#define ABI PW_ABI\n#define VALUE 1\n#define SIZE sizeof (numbers)\n#define BUILD NULL\n",
      " has no build function: PW_MODEL (...) at its end must set .build" },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    cli_write ("table.c", check_text ("%s%s", bad[i].defines, model));
    assert_int_equal (cli_run ("pinwheel run @/table.c"), 2);
    if (strstr (cli_err, bad[i].message) == NULL) print_error ("%s", cli_err);
    assert_non_null (strstr (cli_err, bad[i].message));
  }
}

/* Files that are no models, and compilers that are none. */
TEST (bad_files) {
  cli_write ("notes.txt", "nothing\n");
  cli_bad ("pinwheel run @/notes.txt", 2, "@/notes.txt: a model file ends in .c, .so or .yaml");
  cli_bad ("pinwheel run ''", 2, "a model's name or path is missing");
  cli_write ("here.c", "nothing\n");
  assert_int_equal (cli_run ("p=$(realpath ${PINWHEEL:-build/pinwheel}) && cd @ && $p run here"), 2);
  assert_string_equal (
      cli_err, "pinwheel: there is no model \"here\" on the search path; to use the file here, write ./here.c\n");
  cli_write ("broken.c", "#include \"pinwheel.h\"\nnonsense (;\n");
  assert_int_equal (cli_run ("CC=\"cc $(printf -- '-DA%d ' $(seq 24))\" pinwheel run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, "the C compiler's command in CC has more than 24 words"));
  cli_good (
      "cp models/vehicles/ezyroller.c @/e.c; env --ignore-signal=CHLD \"${PINWHEEL:-build/pinwheel}\" show @/e.c");
  assert_int_equal (cli_run ("CC=/no/compiler pinwheel run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, "cannot run the C compiler \"/no/compiler\""));
  assert_int_equal (cli_run ("CC=clang PATH=/nonexistent ${PINWHEEL:-build/pinwheel} run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, "install one, or name another in the environment variable CC"));
  assert_int_equal (cli_run ("pinwheel run @/broken.c"), 2);
  assert_non_null (strstr (cli_err, " does not compile; the messages of "));
  assert_int_equal (cli_run ("TMPDIR=@/notes.txt pinwheel run @/broken.c"), 1);
  assert_non_null (strstr (cli_err, "cannot make a temporary folder in "));
}

/* Files of methods: none in it, names that are taken or no names, incomplete tables, code that does not compile. */
TEST (bad_methods) {
  static const struct {
    const char *change, *message;
  } bad[] = {
    { "s/\"kutta3\"/\"rk4\"/", "--method-file @/m.c: there is a method rk4 already; give this one another name\n" },
    { "s/\"kutta3\"/\"a+b\"/", "m.c: a method is called \"a+b\": expected letters, digits, _ and -\n" },
    { "s/\"kutta3\"/\"all\"/", "m.c: a method is called \"all\": expected letters, digits, _ and -, but not all" },
    { "s/.open = kutta3_open,//", "integrator kutta3: its table needs open, advance, at, restart and close\n" },
    { "s/{ &kutta3, /{ /", "--method-file @/m.c: there is no method: expected PW_METHOD_FILE (...) at its end\n" },
    { "/^PW_METHOD_FILE/d", "m.c is not a Pinwheel model: a model file ends with PW_MODEL (...), one of integration " },
    { "s/^PW_METHOD_FILE/const pw_plugin_table pw_plugin = { .abi = 77 }; void used/",
      "m.c was compiled for another Pinwheel (ABI 77, this one has " },
    { "s/kutta3_open (pw_run/kutta3 (pw_run/", "m.c does not compile; the messages of " },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    char message[300];
    cli_expand (bad[i].message, message, sizeof message);
    assert_int_equal (cli_run (check_text ("sed '%s' docs/method.c >@/m.c; pinwheel run pendulum --method-file @/m.c",
                                           bad[i].change)),
                      2);
    if (strstr (cli_err, message) == NULL) print_error ("%s\n%s", bad[i].change, cli_err);
    assert_non_null (strstr (cli_err, message));
  }
  assert_int_equal (cli_run ("pinwheel run docs/method.c"), 2);
  assert_non_null (strstr (cli_err, "model method contains integration methods, but no build function"));
}

/* A name that two files could answer is refused with both paths. */
TEST (found_twice) {
  assert_int_equal (cli_run ("mkdir -p @/one @/two && cp ${BUILD:-build}/models/ezyroller.so @/one/twin.so && cp "
                             "@/one/twin.so @/two/twin.so"),
                    0);
  assert_int_equal (cli_run ("PINWHEEL_MODELS=@/one:@/two pinwheel run twin"), 2);
  assert_non_null (strstr (cli_err, cli_path ("one/twin.so")));
  assert_non_null (strstr (cli_err, cli_path ("two/twin.so")));
  assert_non_null (strstr (cli_err, "several files match \"twin\", such as "));
  cli_good ("mkdir @/three && cp @/one/twin.so @/three/twin.so");
  assert_int_equal (cli_run ("PINWHEEL_MODELS=@/one:@/two:@/three pinwheel run twin"), 2);
  assert_non_null (strstr (cli_err, "several files match \"twin\", such as "));
  cli_good ("PINWHEEL_MODELS=@/one pinwheel run twin --t-end 0.1 --json -");
  assert_true (cli_says (cli_out, "model", "twin"));
}

/* A folder is searched although its path begins that of another one, which does not fit into the list for messages
 * (399 bytes). */
TEST (long_search_path) {
  cli_good ("d=$(cd @ && pwd -P); m=$d/m; long=$d/$(printf %0200d 0)/; rest=$((398 - ${#m} - ${#long}))\n"
            "long=$long$(printf %0${rest}d 0); mkdir -p $long ${m}m $m\n"
            "cp ${BUILD:-build}/models/ezyroller.so $m/other.so\n"
            "PINWHEEL_MODELS=$long:${m}m:$m pinwheel run other --t-end 0.1");
}

/* ---- Runs that end early ---- */

/* A row inside a step at which the force overflows, but not at the stages of the step: the time is its beginning. */
TEST (failing_sample) {
  cli_write ("burst.yaml", "pinwheel: 1\nabout: a burst\nrun: {t_end: 2, step: 1}\n"
                           "bodies: [{name: p, mass: 1e-3, inertia: 1}]\n"
                           "elements: [{force: f, body: p, at: [0, 0], fx: \"1e307*exp(-4e4*(t - 0.25)^2)\"}]\n");
  assert_int_equal (cli_run ("pinwheel run @/burst.yaml --method rk4 --every 0.25 -o @/burst.csv"), 4);
  assert_non_null (strstr (cli_err, "t = 0 s: the step of 0.25 s is too large: the state is no longer finite"));
}

/* A step with which the method fails: the time reached and the reason, the rows so far in NAME.part, status 4. */
TEST (failing_step) {
  assert_int_equal (cli_run ("pinwheel run ezyroller --step 0.5 --set M0=1e9 -o @/fail.csv --json @/fail.json"), 4);
  assert_non_null (strstr (cli_err, "\npinwheel: t = "));
  assert_non_null (strstr (cli_err, "the step of 0.5 s is too large"));
  assert_non_null (strstr (cli_err, "fail.csv.part"));
  assert_null (cli_file ("fail.csv"));
  const char *part = cli_file ("fail.csv.part");
  assert_non_null (part);
  assert_true (strncmp (part, "t [s],", 6) == 0 && part[strlen (part) - 1] == '\n');
  const char *json = cli_file ("fail.json");
  assert_true (cli_says (json, "status", "method"));
  /* an archive is complete: it ends with the record of 22 bytes that ends its directory */
  assert_int_equal (cli_run ("pinwheel run ezyroller --step 0.5 --set M0=1e9 -o @/fail.npz"), 4);
  cli_good ("tail -c 22 @/fail.npz.part | head -c 2");
  assert_string_equal (cli_out, "PK");
}

TEST (interrupted) {
  if (cli_run ("timeout --preserve-status 5 true") != 0) skip ();
  const char *program = getenv ("PINWHEEL");
  char command[1000];
  snprintf (
      command, sizeof command,
      "timeout --preserve-status -s INT 0.3 '%s' run ezyroller --t-end 1e9 --every 10 -o @/stop.csv --json @/stop.json",
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
TEST (moved) {
  assert_int_equal (cli_run ("pinwheel run ezyroller --start frame.phi=0.3 --t-end 0.01 --json -"), 0);
  assert_non_null (strstr (cli_err, "steer.x from "));
  assert_null (strstr (cli_err, "frame.phi"));
  assert_true (cli_says (cli_out, "status", "ok"));
}

/* What the integrators say when they give up is in our message, not beside it. */
TEST (one_voice) {
  static const char *const method[] = { "ida+ggl", "bdf+projection", "adams+baumgarte" };
  cli_write ("root.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                          "elements:\n  - {torque: m, body: [a, ground], value: sqrt(0.1-t)}\n");
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    assert_int_equal (cli_run (check_text ("pinwheel run @/root.yaml -t 1 -m %s", method[i])), 4);
    assert_true (strncmp (cli_err, "pinwheel: t = 0.", 16) == 0);
    assert_true (strchr (cli_err, '\n')[1] == 0);
  }
}

/* Nothing stays of what was compiled, whether that works, fails or is interrupted: Ctrl-C waits until the folder is
 * gone. */
TEST (compiled) {
  cli_good (
      "mkdir @/tmp && TMPDIR=@/tmp pinwheel run models/vehicles/ezyroller.c -t 0.1 --json @/compiled.json && ls @/tmp");
  assert_string_equal (cli_out, "");
  cli_write ("wrong.c", "int x = ;\n");
  assert_int_equal (cli_run ("TMPDIR=@/tmp pinwheel run @/wrong.c; ls @/tmp"), 0);
  assert_string_equal (cli_out, "");
  cli_write ("interrupting", "#!/bin/sh\nkill -TERM $PPID\nsleep 0.2\nexec cc \"$@\"\n");
  cli_run ("chmod +x @/interrupting; (TMPDIR=@/tmp CC=@/interrupting "
           "\"${PINWHEEL:-build/pinwheel}\" run models/vehicles/ezyroller.c -t 0.1); echo $?; sleep 0.4; ls @/tmp");
  assert_string_equal (cli_out, "130\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
