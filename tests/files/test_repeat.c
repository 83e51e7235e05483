/* Repeated entries, included files, points of the world and bars of text models, against models written out. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"

/* Writes two models and compares the tables of their runs, byte for byte. */
static void repeat_same (const char *model, const char *written_out) {
  cli_write ("model.yaml", model);
  cli_write ("out.yaml", written_out);
  cli_good ("pinwheel run @/model.yaml -t 0.5 --step 1e-2 -o @/model.csv >/dev/null 2>&1 && "
            "pinwheel run @/out.yaml -t 0.5 --step 1e-2 -o @/out.csv >/dev/null 2>&1 && cmp @/model.csv @/out.csv");
}

/* The command is refused with a message that contains the text. */
static void repeat_bad (const char *command, const char *text) {
  int status = cli_run (command);
  if (status != 2 || strstr (cli_err, text) == NULL)
    fail_msg ("%s ends with %d: %s; expected: %s", command, status, cli_err, text);
}

/* Braces in names and texts, the counter in numbers and signals, also where conditions change, in all lists. */
TEST (copies) {
  static const char model[] =
      "pinwheel: 1\n"
      "parameters: [{name: n, value: 3, domain: count}]\n"
      "let:\n"
      "  - {m0: 1}\n"
      "  - {repeat: {i: n}, \"m{i}\": \"m{i - 1} + i/4\"}\n"
      "bodies:\n"
      "  - {repeat: {i: n}, name: \"b{i}\", mass: \"m{i}\", inertia: \"i > 2 ? 5 : 1\", start: {x: -2*i}}\n"
      "  - {repeat: {i: 0}, name: none}\n"
      "elements:\n"
      "  - repeat: {k: n - 1}\n"
      "    list:\n"
      "      - {spring: \"s{k}\", body: [\"b{k}\", \"b{k + 1}\"], at: [[0, k], [0, 0]], stiffness: 3*k}\n"
      "      - {torque: \"t{k}\", body: [\"b{k}\", ground], value: \"sin (k*t) - k*b{k + 1}.omega - z{k}\"}\n"
      "states:\n"
      "  - {repeat: {i: n}, name: \"z{i}\", rate: \"b{i}.omega - i*z{i}\", start: i >= 2}\n"
      "truth:\n"
      "  - repeat: {i: n}\n"
      "    b{i}.x: -2*i + 0*t\n";
  repeat_same (model, "pinwheel: 1\n"
                      "bodies:\n"
                      "  - {name: b1, mass: 1.25, inertia: 1, start: {x: -2}}\n"
                      "  - {name: b2, mass: 1.75, inertia: 1, start: {x: -4}}\n"
                      "  - {name: b3, mass: 2.5, inertia: 5, start: {x: -6}}\n"
                      "elements:\n"
                      "  - {spring: s1, body: [b1, b2], at: [[0, 1], [0, 0]], stiffness: 3}\n"
                      "  - {torque: t1, body: [b1, ground], value: \"sin (t) - b2.omega - z1\"}\n"
                      "  - {spring: s2, body: [b2, b3], at: [[0, 2], [0, 0]], stiffness: 6}\n"
                      "  - {torque: t2, body: [b2, ground], value: \"sin (2*t) - 2*b3.omega - z2\"}\n"
                      "states:\n"
                      "  - {name: z1, rate: \"b1.omega - z1\", start: 0}\n"
                      "  - {name: z2, rate: \"b2.omega - 2*z2\", start: 1}\n"
                      "  - {name: z3, rate: \"b3.omega - 3*z3\", start: 1}\n"
                      "truth: {b1.x: -2 + 0*t, b2.x: -4 + 0*t, b3.x: -6 + 0*t}\n");
  cli_good ("pinwheel show --yaml @/model.yaml >@/shown.yaml && pinwheel run @/shown.yaml -t 0.5 --step 1e-2 "
            "-o @/shown.csv >/dev/null && cmp @/model.csv @/shown.csv");
}

/* The number of copies is a parameter like others. */
TEST (counts) {
  cli_good ("pinwheel sweep n-trailer --vary n=1,2,3,4,5 --set R=4 -t 0.1 -o @/counts.csv >/dev/null 2>&1 && "
            "test $(grep -c '^[1-5],.*ok' @/counts.csv) = 5");
  cli_good ("pinwheel show tests/models/arms.yaml --set n=3 | grep -q 'state z3: rate .*; start 0$'");
  cli_good ("pinwheel show chain --set n=1 | grep -q '3 coordinates' && "
            "pinwheel show chain --set n=12 | grep -q '36 coordinates'");
}

/* ---- Included files ---- */

static const char arm[] =
    "pinwheel: 1\n"
    "about: used alone, it runs\n"
    "run: {t_end: 1}\n"
    "parameters: [{name: m, value: 1, domain: positive}, {name: k, value: 4}]\n"
    "let: {I: m/10, c: -k/2}\n"
    "bodies:\n"
    "  - {name: arm, mass: m, inertia: I, start: {x: 0.5, y: 0, phi: 0}, rate: {vx: 0, vy: 0, omega: 0}}\n"
    "elements:\n"
    "  - {pin: P, body: [arm, ground], at: [[-0.5, 0], [0, 0]]}\n"
    "  - {rolling-wheel: W, body: arm, at: [0.2, 0], radius: 0.1, inertia: 0.01}\n"
    "  - {torque: T, body: [arm, ground], value: \"c*(arm.omega + 0.1*W.spin_rate) + lag\"}\n"
    "states:\n"
    "  - {name: lag, rate: \"(sin (k*t) - lag)/0.2\", start: m}\n"
    "truth: {arm.phi: 0}\n";

/* Names, parameters, states and a shift; names of the including file with other values; states across files. */
TEST (include) {
  cli_write ("arm.yaml", arm);
  repeat_same (
      "pinwheel: 1\n"
      "let: {k: 7, m: 3}\n"
      "include:\n"
      "  - {repeat: {i: 2}, file: arm.yaml, prefix: \"a{i}_\", set: {m: m*i}, at: [2*i, -1]}\n"
      "bodies: [{name: car, mass: 1, inertia: 1}]\n"
      "elements:\n"
      "  - {torque: T, body: [car, a2_arm], value: \"k*a1_lag + a2_W.spin\"}\n"
      "  - {torque: U, body: [car, ground], value: R.spin}\n"
      "  - {rolling-wheel: R, body: car, at: [0, 0], radius: 1, inertia: 1}\n",
      "pinwheel: 1\n"
      "bodies:\n"
      "  - {name: a1_arm, mass: 3, inertia: 0.3, start: {x: 2.5, y: -1, phi: 0}, rate: {vx: 0, vy: 0, omega: 0}}\n"
      "  - {name: a2_arm, mass: 6, inertia: 0.6, start: {x: 4.5, y: -1, phi: 0}, rate: {vx: 0, vy: 0, omega: 0}}\n"
      "  - {name: car, mass: 1, inertia: 1}\n"
      "elements:\n"
      "  - {pin: a1_P, body: [a1_arm, ground], at: [[-0.5, 0], [2, -1]]}\n"
      "  - {rolling-wheel: a1_W, body: a1_arm, at: [0.2, 0], radius: 0.1, inertia: 0.01}\n"
      "  - {torque: a1_T, body: [a1_arm, ground], value: \"-2*(a1_arm.omega + 0.1*a1_W.spin_rate) + a1_lag\"}\n"
      "  - {pin: a2_P, body: [a2_arm, ground], at: [[-0.5, 0], [4, -1]]}\n"
      "  - {rolling-wheel: a2_W, body: a2_arm, at: [0.2, 0], radius: 0.1, inertia: 0.01}\n"
      "  - {torque: a2_T, body: [a2_arm, ground], value: \"-2*(a2_arm.omega + 0.1*a2_W.spin_rate) + a2_lag\"}\n"
      "  - {torque: T, body: [car, a2_arm], value: \"7*a1_lag + a2_W.spin\"}\n"
      "  - {torque: U, body: [car, ground], value: R.spin}\n"
      "  - {rolling-wheel: R, body: car, at: [0, 0], radius: 1, inertia: 1}\n"
      "states:\n"
      "  - {name: a1_lag, rate: \"(sin (4*t) - a1_lag)/0.2\", start: 3}\n"
      "  - {name: a2_lag, rate: \"(sin (4*t) - a2_lag)/0.2\", start: 6}\n");
  cli_good ("pinwheel show --yaml @/model.yaml >@/shown.yaml && pinwheel run @/shown.yaml -t 0.5 --step 1e-2 "
            "-o @/shown.csv >/dev/null && cmp @/model.csv @/shown.csv");
}

/* Outputs of included files, also in signals, and copies of outputs, which read each other in any order. */
TEST (outputs) {
  cli_write ("unit.yaml", "pinwheel: 1\n"
                          "parameters: [{name: k, value: 0.5}]\n"
                          "bodies: [{name: car, mass: 2, inertia: 0.5, start: {x: 0.4, y: 1, phi: 0}, rate: {vx: 1}}]\n"
                          "elements:\n"
                          "  - {wheel: R, body: car, at: [-0.4, 0]}\n"
                          "  - {steered-wheel: F, body: car, at: [0.6, 0], heading: delta}\n"
                          "outputs:\n"
                          "  - {name: wanted, value: -atan (k*offset) - car.phi}\n"
                          "  - {name: offset, value: R.y}\n"
                          "states: [{name: delta, rate: (wanted - delta)/0.2}]\n");
  repeat_same ("pinwheel: 1\n"
               "include:\n"
               "  - {file: unit.yaml, prefix: a_}\n"
               "  - {file: unit.yaml, prefix: b_, set: {k: 1}}\n"
               "outputs:\n"
               "  - {repeat: {i: 2}, name: \"more{i}\", value: i*gap}\n"
               "  - {name: gap, value: b_offset - a_offset, unit: m}\n"
               "  - {name: force, value: a_R.N + b_F.N}\n",
               "pinwheel: 1\n"
               "bodies:\n"
               "  - {name: a_car, mass: 2, inertia: 0.5, start: {x: 0.4, y: 1, phi: 0}, rate: {vx: 1}}\n"
               "  - {name: b_car, mass: 2, inertia: 0.5, start: {x: 0.4, y: 1, phi: 0}, rate: {vx: 1}}\n"
               "elements:\n"
               "  - {wheel: a_R, body: a_car, at: [-0.4, 0]}\n"
               "  - {steered-wheel: a_F, body: a_car, at: [0.6, 0], heading: a_delta}\n"
               "  - {wheel: b_R, body: b_car, at: [-0.4, 0]}\n"
               "  - {steered-wheel: b_F, body: b_car, at: [0.6, 0], heading: b_delta}\n"
               "outputs:\n"
               "  - {name: a_wanted, value: -atan (0.5*a_R.y) - a_car.phi}\n"
               "  - {name: a_offset, value: a_R.y}\n"
               "  - {name: b_wanted, value: -atan (1*b_R.y) - b_car.phi}\n"
               "  - {name: b_offset, value: b_R.y}\n"
               "  - {name: more1, value: b_R.y - a_R.y}\n"
               "  - {name: more2, value: 2*(b_R.y - a_R.y)}\n"
               "  - {name: gap, value: b_R.y - a_R.y, unit: m}\n"
               "  - {name: force, value: a_R.N + b_F.N}\n"
               "states:\n"
               "  - {name: a_delta, rate: (a_wanted - a_delta)/0.2}\n"
               "  - {name: b_delta, rate: (b_wanted - b_delta)/0.2}\n");
  cli_write ("cycle.yaml", "pinwheel: 1\ninclude: [{file: unit.yaml, prefix: a_}]\n"
                           "outputs: [{name: one, value: c_offset}]\n");
  repeat_bad ("pinwheel check @/cycle.yaml", "output one: there is no \"c_offset\"; did you mean \"a_offset\"?");
  cli_write ("cycle.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 1}]\n"
                           "outputs: [{repeat: {i: 2}, name: \"o{i}\", value: \"o{3 - i}\"}]\n");
  repeat_bad ("pinwheel check @/cycle.yaml", "output o1 is a function of itself, through o2");
}

/* Without gravity a mechanism moves in the same way wherever it is placed, also by files in files. */
TEST (place) {
  static const char swing[] =
      "pinwheel: 1\n"
      "bodies:\n"
      "  - {name: a, mass: 1, inertia: 0.1, start: {x: 0.5, y: 0, phi: 0}, rate: {vx: 0, vy: 1, omega: 2}}\n"
      "  - {name: b, mass: 2, inertia: 0.3, start: {x: 1.5, y: 0, phi: 0}, rate: {vx: 0, vy: 2, omega: 0}}\n"
      "elements:\n"
      "  - {pin: O, body: [a, ground], at: {world: [0, 0]}}\n"
      "  - {pin: Q, body: [a, b], at: {world: [1, 0]}}\n"
      "  - {spring: S, body: [ground, b], at: [[0, 2], [0.1, 0.2]], stiffness: 5, length: 1}\n";
  cli_write ("swing.yaml", swing);
  cli_write ("middle.yaml", "pinwheel: 1\nparameters: [{name: turn, value: 0}]\n"
                            "include: [{file: swing.yaml, prefix: s_, at: [1, 0], phi: turn}]\n");
  cli_write ("outer.yaml",
             "pinwheel: 1\ninclude: [{file: middle.yaml, prefix: m_, set: {turn: 0.3}, at: [2, 3], phi: pi/2}]\n");
  cli_shell ("pinwheel run @/swing.yaml -t 1 --json @/swing.json >/dev/null && "
             "pinwheel run @/outer.yaml -t 1 --json @/outer.json >/dev/null");
  const double angle = PW_PI / 2 + 0.3;
  double q[3], p[3];
  char inner[10000], outer[10000];
  snprintf (inner, sizeof inner, "%.9999s", cli_file ("swing.json"));
  snprintf (outer, sizeof outer, "%.9999s", cli_file ("outer.json"));
  for (int i = 0; i < 2; i++) {
    static const char *const name[] = { "x", "y", "phi" };
    for (int k = 0; k < 3; k++) {
      q[k] = cli_number (inner, "bodies", i ? "b" : "a", name[k], NULL);
      p[k] = cli_number (outer, "bodies", i ? "m_s_b" : "m_s_a", name[k], NULL);
    }
    /* the frame of swing.yaml is at (2, 3) + (0, 1) */
    check_close ("x", p[0], 2 + cos (angle) * q[0] - sin (angle) * q[1], 1e-11, "round-off");
    check_close ("y", p[1], 4 + sin (angle) * q[0] + cos (angle) * q[1], 1e-11, "round-off");
    check_close ("phi", p[2], angle + q[2], 1e-11, "round-off");
    assert_true (fabs (q[2]) > 0.1);
  }
}

/* What an angle of a file would not turn is refused, and half of a position that it would. */
TEST (place_refused) {
  static const struct {
    const char *file, *message;
  } wrong[] = {
    { "bodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n  - {slider: S, body: [a, ground], at: [[0, 0], [0, 0]]}\n",
      "slider S: its \"heading\" refers to the ground, which does not turn with a file placed at an angle" },
    { "bodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n  - {gravity: g, acceleration: [0, -9.81]}\n",
      "gravity g: its \"acceleration\" refers to the ground" },
    { "bodies: [{name: a, mass: 1, inertia: 1, start: {x: 1}}]\n",
      "body a: in a file placed at an angle, x and y are given both or neither" },
    { "bodies: [{name: a, mass: 1, inertia: 1, rate: {vy: 1}}]\n", "vx and vy are given both or neither" },
  };
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    cli_write ("part.yaml", check_text ("pinwheel: 1\n%s", wrong[i].file));
    cli_write ("model.yaml", "pinwheel: 1\ninclude: [{file: part.yaml, phi: 0.1}]\n");
    repeat_bad ("pinwheel show @/model.yaml", wrong[i].message);
    cli_write ("model.yaml", "pinwheel: 1\ninclude: [{file: part.yaml, at: [1, 2]}]\n");
    cli_good ("pinwheel show @/model.yaml >/dev/null");
  }
}

/* Positions of errors, tables, and files that a run would overwrite are those of the included file. */
TEST (files) {
  cli_good ("mkdir -p @/parts/more");
  cli_write ("parts/more/torque.csv", "t,M\n0,1\n1,2\n");
  cli_write ("parts/more/leaf.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n"
                                     "  - {torque: T, body: [a, ground], value: {table: {file: torque.csv}}}\n");
  cli_write ("parts/part.yaml", "pinwheel: 1\ninclude: [{file: more/leaf.yaml, prefix: x_}]\n");
  cli_write ("model.yaml", "pinwheel: 1\ninclude: [{file: parts/part.yaml}, {file: parts/part.yaml, prefix: y_}]\n");
  cli_good ("pinwheel run @/model.yaml -t 1 -o @/out.csv >/dev/null && grep -q y_x_a @/out.csv");
  repeat_bad ("pinwheel run @/model.yaml -t 1 -o @/parts/more/torque.csv", "would overwrite a file of the model");
  repeat_bad ("pinwheel run @/model.yaml -t 1 --json @/parts/more/../part.yaml", "would overwrite a file of the model");
  cli_write ("parts/more/leaf.yaml", "pinwheel: 1\n\nbodies: [{name: a, mas: 1}]\n");
  repeat_bad ("pinwheel show @/model.yaml", "/parts/more/leaf.yaml:3:20: error: a body has no \"mas\"");
  cli_write ("parts/more/leaf.yaml", "pinwheel: 1\ninclude: [{file: more/leaf.yaml}]\n");
  repeat_bad ("pinwheel show @/model.yaml", "cannot read \"more/leaf.yaml\": No such file");
  cli_write ("parts/part.yaml", "pinwheel: 1\ninclude: [{file: ./other.yaml}]\n");
  cli_write ("parts/other.yaml", "pinwheel: 1\ninclude: [{file: part.yaml}]\n");
  repeat_bad ("pinwheel show @/model.yaml", "other.yaml:2:18: error: file: \"part.yaml\" includes itself");
  cli_write ("state.yaml", "pinwheel: 1\nstates: [{name: z, rate: 1}]\n");
  cli_write ("default.yaml", "pinwheel: 1\nparameters: [{name: p, value: k}]\n");
  cli_write ("model.yaml", "pinwheel: 1\nlet: {k: 1}\ninclude: [{file: default.yaml}]\n");
  repeat_bad ("pinwheel show @/model.yaml", "default.yaml:2:31: error: parameter p: there is no \"k\"");
  cli_good ("mkdir -p @/in @/in2 && cp @/state.yaml @/in2 && ln -s ../in2/state.yaml @/in/state.yaml");
  cli_write ("in/model.yaml", "pinwheel: 1\ninclude: [{file: state.yaml}]\n");
  repeat_bad ("pinwheel show @/in/model.yaml", "it is a link that leads out of the model's folder");
  cli_write ("model.yaml",
             "pinwheel: 1\nparameters: [{name: x_z, value: 1}]\ninclude: [{file: state.yaml, prefix: x_}]\n");
  repeat_bad ("pinwheel show @/model.yaml", "include: a state of a file has the name \"x_z\" of a parameter");
}

/* A page has the text of all files, and their tables. */
TEST (page) {
  pw_error error = { 0 };
  pw_page page;
  int tables = 0, texts = 0;
  cli_good ("mkdir -p @/in");
  cli_write ("in/t.csv", "0,1\n1,2\n");
  cli_write ("in/part.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                             "elements: [{force: F, body: a, fx: {table: {file: t.csv}}}]\n");
  cli_write ("model.yaml", "pinwheel: 1\ninclude: [{file: in/part.yaml}]\n");
  pw_file *f = pw_file_open (cli_path ("model.yaml"), &error);
  check_ok (f ? PW_OK : error.status, &error);
  int status = pw_page_open (&page, f, &error);
  for (int i = 0; i < page.files; i++) {
    tables += strcmp (page.file[i].name, "in/t.csv") == 0;
    texts += strcmp (page.file[i].name, "model") == 0 && strstr (page.file[i].bytes, "file: t.csv") != NULL;
  }
  pw_page_close (&page);
  pw_file_close (f);
  if (status != PW_OK && strstr (error.text, "without the engine")) skip ();
  check_ok (status, &error);
  assert_true (tables == 1 && texts == 1);
}

/* ---- A linkage as in a drawing ---- */

TEST (drawing) {
  repeat_same ("pinwheel: 1\n"
               "bodies:\n"
               "  - {bar: crank, from: [0, 0], to: [0, 1], mass: 3, rate: {omega: 1}}\n"
               "  - {bar: coupler, from: [0, 1], to: [2, 1], mass: 6}\n"
               "  - {bar: rocker, mass: 3, from: [2, 0], to: [2, 1]}\n"
               "elements:\n"
               "  - {pin: A, body: [crank, ground], at: {world: [0, 0]}}\n"
               "  - {pin: B, body: [crank, coupler], at: {world: [0, 1]}}\n"
               "  - {pin: C, body: [rocker, coupler], at: [{world: [2, 1]}, [1, 0]]}\n"
               "  - {pin: D, body: [ground, rocker], at: {world: [2, 0]}}\n"
               "  - {marker: M, body: coupler, at: {world: [1, 2]}}\n",
               "pinwheel: 1\n"
               "bodies:\n"
               "  - {name: crank, mass: 3, inertia: 0.25, start: {x: 0, y: 0.5, phi: pi/2}, rate: {omega: 1}}\n"
               "  - {name: coupler, mass: 6, inertia: 2, start: {x: 1, y: 1, phi: 0}}\n"
               "  - {name: rocker, mass: 3, inertia: 0.25, start: {x: 2, y: 0.5, phi: pi/2}}\n"
               "let: {d: 0.5*cos (pi/2)}\n" /* round-off of the turn */
               "elements:\n"
               "  - {pin: A, body: [crank, ground], at: [[-0.5, -d], [0, 0]]}\n"
               "  - {pin: B, body: [crank, coupler], at: [[0.5, d], [-1, 0]]}\n"
               "  - {pin: C, body: [rocker, coupler], at: [[0.5, d], [1, 0]]}\n"
               "  - {pin: D, body: [ground, rocker], at: [[2, 0], [-0.5, -d]]}\n"
               "  - {marker: M, body: coupler, at: [0, 1]}\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
