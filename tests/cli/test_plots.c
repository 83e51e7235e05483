/* Figures: contents for several models, with gnuplot and without. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* 1 if a file of the folder is there and has something in it. */
static int plots_has (const char *name) {
  const char *text = cli_file (name);
  return text && *text;
}

/* Draws all figures of a model; gnuplot has nothing to report. */
static void plots_draw (const char *model) {
  static const char *const figures[] = { "paths", "velocities", "angular", "energy", "mechanism" };
  char name[80];
  cli_good (check_text ("pinwheel run %s --plots @/drawn", model));
  assert_null (strstr (cli_err, ".gp"));
  for (size_t i = 0; i < sizeof figures / sizeof *figures; i++) {
    snprintf (name, sizeof name, "drawn/%s.svg", figures[i]);
    const char *svg = cli_file (name);
    assert_non_null (svg);
    assert_non_null (strstr (svg, "<svg"));
    snprintf (name, sizeof name, "drawn/%s.png", figures[i]);
    assert_true (plots_has (name));
    snprintf (name, sizeof name, "drawn/%s.pdf", figures[i]);
    const char *pdf = cli_file (name);
    assert_true (pdf && memcmp (pdf, "%PDF", 4) == 0);
  }
}

/* After Ctrl-C data and scripts are written; the figures of an earlier run are removed. */
TEST (interrupted) {
  const char *program = getenv ("PINWHEEL");
  char expected[400];
  cli_run ("mkdir @/stopped; touch @/stopped/paths.svg");
  cli_expand ("pinwheel: the run was interrupted, so no figures are drawn; data and scripts are in @/stopped: gnuplot "
              "FILE.gp draws them there\n",
              expected, sizeof expected);
  for (double seconds = 0.3; seconds < 20; seconds *= 4) { /* under load the run may begin later */
    assert_int_equal (
        cli_run (check_text (
            "timeout --preserve-status -s INT %g '%s' run ezyroller --t-end 300 --step 1e-5 --specialise never --plots "
            "@/stopped",
            seconds, program ? program : "build/pinwheel")),
        130);
    if (strstr (cli_err, expected)) break;
  }
  assert_non_null (strstr (cli_err, expected));
  assert_null (cli_file ("stopped/paths.svg"));
  assert_non_null (cli_file ("stopped/paths.gp"));
}

TEST (drawn) {
  plots_draw ("ezyroller --t-end 40"); /* goes far: a picture of the beginning too */
}

/* The data and scripts of a model without gnuplot. */
static void plots_write (const char *model) {
  assert_int_equal (cli_run (check_text ("PATH=/none pinwheel run %s --plots @/written >/dev/null", model)), 0);
  assert_true (plots_has ("written/mechanism.gp") && plots_has ("written/energy.gp"));
}

TEST (written) {
  plots_write ("pendulum --t-end 3");                 /* without wheels */
  plots_write ("wheeled-snake --set n=16 --t-end 1"); /* coloured by number */
  plots_write ("chain --set n=80 --t-end 0.05");
  plots_write (
      "chaplygin-sleigh --start sleigh.vx=0 --start sleigh.vy=0 --start sleigh.omega=0 --t-end 1"); /* at rest */
}

/* Figures that need a layout of their own. */
TEST (layouts) {
  cli_write ("sled.yaml", "pinwheel: 1\nabout: 'it has {braces}, a_b & 100 % ~ \\'\nbodies:\n  - {name: sled, mass: 1, "
                          "inertia: 1, rate: {vx: 20}}\n"
                          "  - {name: \"a-dog-whose-name-is-as-long-as-the-longest-may-be-\", mass: 1, "
                          "inertia: 1, start: {x: 1}, rate: {vx: 20}}\nelements:\n"
                          "  - {wheel: left, body: sled, at: [0, 0.5]}\n"
                          "  - {drag: air, body: sled, linear: 0.01}\n");
  plots_draw ("@/sled.yaml --t-end 10"); /* far and straight, losing energy */
  assert_non_null (strstr (cli_file ("drawn/paths.svg"), "whole run"));
  assert_non_null (strstr (cli_file ("drawn/paths.svg"), "the first "));
  assert_non_null (strstr (cli_file ("drawn/velocities.svg"), "a-dog-whose-name-is-as-l…<"));
  assert_non_null (strstr (cli_file ("drawn/energy.svg"), "dissipated"));
  assert_non_null (strstr (cli_file ("drawn/energy.svg"), "It has {braces}, a_b &amp; 100 % ~ \\"));
  assert_null (strstr (cli_file ("drawn/energy.svg"), "potential"));
}

/* In a picture, the label of each y axis is on the page and left of the numbers at its tics, which precede it. */
static void plots_check_labels (const char *name) {
  const double digit = 6.4, ascent = 7, descent = 2; /* of a font of 10 pixels */
  double left = 1e9;
  int labels = 0;
  for (const char *at = cli_file (name); (at = strstr (at, "translate(")) != NULL; at++) {
    const double x = strtod (at + strlen ("translate("), NULL);
    const char *end = strstr (at, "</g>"), *anchor = strstr (at, "text-anchor=\"end\""),
               *turned = strstr (at, "rotate(270");
    if (x > 150 || end == NULL || strstr (at, "<text></text>") == strstr (at, "<text>"))
      continue; /* of another panel, of a colour bar, or empty */
    if (anchor && anchor < end) {
      int characters = 0, is_tag = 0;
      for (const char *c = strstr (at, "<text>"); c < end; c++) {
        is_tag = *c == '<' || (is_tag && *c != '>');
        characters += !is_tag && *c != '>' && *c != ' ' && *c != '\n' && *c != '\t' && (*c & 0xC0) != 0x80;
      }
      if (x - digit * characters < left) left = x - digit * characters;
    } else if (turned && turned < end) {
      if (x - ascent < 0 || x + descent > left) print_error ("%s: a label at %g, numbers from %g\n", name, x, left);
      assert_true (x - ascent >= 0 && x + descent <= left);
      left = 1e9;
      labels++;
    }
  }
  assert_true (labels > 0);
}

static void plots_check (const char *model) {
  plots_draw (model);
  assert_string_equal (cli_err, "");
  static const char *const figures[] = { "paths", "velocities", "angular", "energy", "mechanism" };
  for (int i = 0; i < 5; i++) plots_check_labels (check_text ("drawn/%s.svg", figures[i]));
}

/* Motions that do not move, or little compared with their place; of very long and very short extents. */
TEST (extents) {
  static const char *const states[] = { "",
                                        "start: {x: 1e10, y: -3e8}",
                                        "start: {x: 500000, y: 5e6, phi: 3}, rate: {vx: 2, vy: 1, omega: 0.1}",
                                        "start: {x: 3}, rate: {vx: 1e-12, omega: 1e-14}",
                                        "start: {x: 3, phi: 1e-7}, rate: {vx: 1e-7, omega: -1e-7}",
                                        "start: {x: -1e-6, y: 2e-5}, rate: {vx: -1e-5, vy: 1e-6, omega: 1e-3}",
                                        "rate: {vx: -12345.6, vy: 1, omega: 0.12345}",
                                        "rate: {vx: 3e9, vy: -1e9}",
                                        "rate: {vx: 1, vy: 1e-300}" };
  for (size_t i = 0; i < 2 * sizeof states / sizeof *states; i++) {
    cli_write ("b.yaml",
               check_text (
                   "pinwheel: 1\nrun: {t_end: 1, step: 0.125, method: erk8, rtol: 1e-6}\nbodies: [{name: b, mass: 1, "
                   "inertia: 1%s%s}]\n%s",
                   *states[i / 2] ? ", " : "", states[i / 2],
                   i % 2 ? "elements: [{marker: m, body: b, at: [0, 0]}, {torque: T, body: [b, ground], value: 1e-9}]\n"
                         : ""));
    plots_check ("@/b.yaml");
    if (i == 0) assert_non_null (strstr (cli_file ("drawn/paths.svg"), "gpPt6")); /* a point */
  }
  assert_non_null (strstr (cli_file ("drawn/velocities.svg"), "10"));
  plots_check ("car-tyres -t 3");
  plots_check ("car-tyres -t 3 --width 85mm");
  plots_check ("andrews-squeezer -t 0.02");
}

/* A title of any length, with or without blanks, and any characters. */
TEST (titles) {
  static const char body[] = "bodies: [{name: b, mass: 1, inertia: 1, rate: {vx: 1}}]\n";
  char text[30000] = "pinwheel: 1\nrun: {t_end: 1, step: 0.125, method: rk4}\nabout: \"";
  const size_t head = strlen (text);
  for (int i = 0; i < 3; i++) {
    static const char *const part[] = { "d'Alembert's 'principle' ", "xyzw", "\xC3\xA4\xE6\x97\xA5" };
    text[head] = 0;
    while (strlen (text) < 20000) strcat (text, part[i]);
    strcat (strcat (text, "\"\n"), body);
    cli_write ("t.yaml", text);
    plots_check ("@/t.yaml --width 85mm");
    const char *svg = cli_file ("drawn/energy.svg");
    assert_non_null (strstr (svg, "\xE2\x80\xA6"));
    assert_non_null (strstr (svg, i == 0 ? "D'Alembert's 'principle'" : i == 1 ? "Xyzw" : part[2]));
    assert_true (strtod (strstr (svg, "height=\"") + strlen ("height=\""), NULL) < 600);
  }
}

/* Long names in the figures of analyses; results that do not change. */
TEST (analyses) {
#define LONG "the_left_front_wheel_carrier_of_the_vehicle"
  static const char *const command[] = {
    "run @/long.yaml --every 0.05 -o @/l.csv",
    "fit @/long.yaml --data @/l.csv --columns " LONG ".phi," LONG ".x --sigma " LONG ".phi=1e-5 --sigma " LONG
    ".x=1e-5 --free stiffness_of_the_torsion_spring --plots @/l",
    "optimise @/long.yaml --maximise max:" LONG
    ".omega --free stiffness_of_the_torsion_spring=1:5 --starts 2 --plots @/l",
    "sensitivity @/long.yaml --of " LONG ".omega --by stiffness_of_the_torsion_spring --by c --plots @/l",
    "periodic @/long.yaml --set c=0 --period free --guess 3 --vary stiffness_of_the_torsion_spring=4:5 -o "
    "@/l/periodic.csv --json @/l/periodic.json --plots @/l",
    "steady @/long.yaml --vary stiffness_of_the_torsion_spring=1:5 -o @/l/steady.csv --json @/l/steady.json --plots "
    "@/l",
    "run @/rest.yaml --every 0.05 -o @/l.csv",
    "fit @/rest.yaml --data @/l.csv --columns " LONG ".phi --free " LONG ".omega --plots @/l",
    "optimise @/rest.yaml --maximise " LONG ".phi --free c=0:1 --starts 1 --plots @/l",
    "sensitivity @/rest.yaml --of " LONG ".phi --by c --plots @/l",
    "periodic @/rest.yaml --set c=0 --period 1 -o @/l/periodic.csv --json @/l/periodic.json --plots @/l"
  };
  static const char *const figure[] = { NULL, "fit", "optimise", "sensitivity", "periodic", "steady",
                                        NULL, "fit", "optimise", "sensitivity", "periodic" };
  for (int rest = 0; rest < 2; rest++)
    cli_write (
        rest ? "rest.yaml" : "long.yaml",
        check_text (
            "pinwheel: 1\nrun: {t_end: 2, step: 0.05, method: rk4}\nparameters:\n"
            "  - {name: stiffness_of_the_torsion_spring, value: 4, domain: positive}\n  - {name: c, value: 0.3}\n"
            "bodies: [{name: " LONG ", mass: 1, inertia: 1, start: {phi: %s}}]\nelements:\n"
            "  - {pin: P, body: [" LONG ", ground], at: [[2e-5, 0], [0, 0]]}\n"
            "  - {torque: T, body: [" LONG ", ground], value: -stiffness_of_the_torsion_spring*" LONG ".phi - c*" LONG
            ".omega}\n",
            rest ? "0" : "0.5"));
  for (size_t i = 0; i < sizeof command / sizeof *command; i++) {
    cli_shell (check_text ("pinwheel %s", command[i]));
    assert_null (strstr (cli_err, "arning")); /* of gnuplot */
    if (figure[i]) plots_check_labels (check_text ("l/%s.svg", figure[i]));
    if (figure[i]) assert_null (strstr (cli_file (check_text ("l/%s.svg", figure[i])), LONG));
  }
}

/* A plate is its convex outline, with a line to what is attached inside; what lies on a line is one. */
TEST (outline) {
  cli_write ("plate.yaml", "pinwheel: 1\nbodies:\n  - {name: plate, mass: 1, inertia: 1, rate: {vx: 1}}\n"
                           "  - {name: bar, mass: 1, inertia: 1, start: {x: 9}}\nelements:\n"
                           "  - {marker: a, body: plate, at: [1, 1]}\n  - {marker: b, body: plate, at: [-1, -1]}\n"
                           "  - {marker: c, body: plate, at: [0.5, 0.2]}\n  - {marker: d, body: plate, at: [-1, 1]}\n"
                           "  - {marker: e, body: plate, at: [1, -1]}\n  - {marker: f, body: bar, at: [2, 1]}\n"
                           "  - {marker: g, body: bar, at: [-2, -1]}\n  - {marker: h, body: bar, at: [1, 0.5]}\n");
  plots_write ("@/plate.yaml --t-end 1 --animate @/plate.html");
  const char *data = cli_file ("written/mechanism.dat");
  const char *drawn = "nan nan nan nan\n\n-1 -1 0 1\n1 -1 0 1\n1 1 0 1\n-1 1 0 1\n-1 -1 0 1\n\n0 0 0 1\n0.5 0.2 0 1\n\n"
                      "9 0 0 2\n11 1 0 2\n\n9 0 0 2\n7 -1 0 2\n\n9 0 0 2\n10 0.5 0 2\n\n";
  assert_int_equal (strncmp (strchr (data, '\n') + 1, drawn, strlen (drawn)), 0);
  const char *page = cli_file ("plate.html");
  assert_non_null (strstr (page, "\"spokes\": [[0.5, 0.2]], \"outline\": [[-1, -1], [1, -1], [1, 1], [-1, 1]]}"));
  assert_non_null (strstr (page, "\"outline\": []}"));
}

/* Outlines of the model: points, and drawings, of which the first path counts, without definitions and comments. */
TEST (own_outlines) {
  static const char model[] = "pinwheel: 1\nbodies:\n"
                              "  - {name: a, mass: 1, inertia: 1, rate: {vx: 1}, outline: %s}\n"
                              "elements: [{marker: m, body: a, at: [0.5, 0.2]}]\n";
  static const struct {
    const char *outline, *drawing, *corners; /* as in the animation, or the beginning of a message */
  } of[] = {
    { "[[-1, -1], [1, -1], [0, 0], [1, 1]]", "", "[[-1, -1], [1, -1], [0, 0], [1, 1]]}" },
    { "{points: [[0, 0], [4, 0], [4, 2]], width: 2, at: [1, 1]}", "", "[[0, 0.5], [2, 0.5], [2, 1.5]]}" },
    { "o.svg", "<svg><polygon points='0,0 2,0 2,1-1-1'/></svg>", "[[0, 0], [2, 0], [2, -1], [-1, 1]]}" },
    { "{file: o.svg}", "<svg><path d='M1,2h2V3 l-1 1-1-1zm4 4 1 1'/></svg>",
      "[[1, -2], [3, -2], [3, -3], [2, -4], [1, -3]]}" },
    { "{file: o.svg, width: 4}",
      "<svg><!-- <path d='M0 0'/> --><defs><path d='M0 0'/></defs><g transform='translate(9)'>"
      "<path id='d' d=\"m 8 8 L10.5.5e1 1e1,9\"/></g></svg>",
      "[[-2, -1.6], [2, 3.2], [1.2, -3.2]]}" },
    { "o.svg", "<svg><path d='M0 0Q6 0 6 6T12 12'/></svg>", "[[0, 0], [0.958333333, -0.0416666667], [1.83333333, " },
    { "o.svg", "<svg><path d='M0 0C0 4 12 4 12 0S24-4 24 0'/></svg>", "[[0, 0], [0.236111111, -0.916666667], [0.8888" },
    { "o.svg", "<svg><path d='M0 0A1 1 0 0 0 2 2'/></svg>", "o.svg: it has an arc: convert arcs to curves" },
    { "o.svg", "<svg><path d='M0 0L1'/></svg>", "o.svg: a number of its path is missing" },
    { "o.svg", "<svg><rect width='1'/></svg>", "o.svg: it has no path, polygon or polyline" },
    { "o.svg", "<svg><g transform='rotate(9)'><path d='M0 0L1 1'/></g></svg>", "o.svg: it has transformations" },
    { "o.svg", "<svg><g transform='translate(9) scale(2)'><path d='M0 0L1 1'/></g></svg>", "it has transformations" },
    { "o.svg", "<svg><path d='M0 0L1 1 2 0;3 0'/></svg>", "o.svg: a number of its path is missing" },
    { "o.svg", "<svg><polygon points='0,0 2,0 2,1-1'/></svg>", "o.svg: a number of its points is missing" },
    { "o.svg", "<svg><path d='M0 0L1 1'/></svg>", "outline of body a: expected 3 corners at least, found 2" },
    { "[]", "", "outline of body a: expected 3 corners at least, found 0" },
    { "{points: [[0, 0], [0, 1], [0, 2]], width: 1}", "", "all corners have the same x" },
    { "none.svg", "", "outline of body a: cannot read \"none.svg\": No such file" },
    { "{width: 1}", "", "outline of body a: expected points or a file, .svg or .csv" },
  };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    const int wrong = *of[i].corners != '[';
    cli_write ("o.yaml", check_text (model, of[i].outline));
    cli_write ("o.svg", of[i].drawing);
    assert_int_equal (cli_run ("pinwheel run @/o.yaml --t-end 1 --animate @/o.html"), wrong ? 2 : 0);
    const char *text = wrong ? of[i].corners : check_text ("\"spokes\": [], \"outline\": %s", of[i].corners),
               *found = wrong ? cli_err : cli_file ("o.html");
    if (strstr (found, text) == NULL)
      print_error ("no %s in %.300s\n", text, wrong ? cli_err : strstr (found, "\"outline"));
    assert_non_null (strstr (found, text));
  }
  cli_write ("o.yaml", check_text (model, "[[-1, -1], [1, -1], [0.1, 0]]"));
  cli_good ("pinwheel show --yaml @/o.yaml");
  cli_shows (", outline: [[-1, -1], [1, -1], [0.1, 0]]}");
}

/* What gnuplot says when it fails is passed on, and summaries say that the command has failed. */
TEST (gnuplot_fails) {
  cli_good ("mkdir @/bin && printf '#!/bin/sh\\necho no such colour >&2; exit 3\\n' >@/bin/gnuplot && chmod +x "
            "@/bin/gnuplot");
  cli_run ("PATH=@/bin pinwheel run pendulum -t 0.1 --plots @/fails >@/log");
  assert_non_null (strstr (cli_err, "no such colour\n"));
  assert_non_null (strstr (cli_err, "pinwheel: gnuplot failed with exit status 3"));
  assert_null (cli_file ("fails/paths.svg"));
  assert_int_equal (cli_run ("PATH=@/bin pinwheel run pendulum -t 0.1 --plots @/fails --json @/run.json"), 1);
  assert_true (cli_says (cli_file ("run.json"), "status", "machine"));
  assert_non_null (strstr (cli_file ("run.json"), "\"reason\": \"gnuplot failed with exit status 3; "));
  assert_int_equal (cli_run ("PATH=@/bin pinwheel optimise pendulum --minimise bob.y --free I=0:1 --set g=0 -t 0.1 "
                             "--starts 1 --plots @/fails --json @/optimise.json"),
                    1);
  assert_true (cli_says (cli_file ("optimise.json"), "status", "machine"));
  cli_good ("pinwheel run pendulum -t 1 --every 0.1 -o @/data.csv");
  assert_int_equal (cli_run ("PATH=@/bin pinwheel fit pendulum --data @/data.csv --columns bob.phi --free g --plots "
                             "@/fails -o @/fit.csv --json @/fit.json"),
                    1);
  assert_true (cli_says (cli_file ("fit.json"), "status", "machine"));
  assert_non_null (cli_file ("fit.csv"));
}

/* Ctrl-C, which ends gnuplot, too: the other files are completed. */
TEST (gnuplot_interrupted) {
  static const char *const commands[] = {
    "optimise pendulum --minimise bob.y --free I=0:1 -t 0.1 --starts 1 --json @/stop/o.json --plots @/stop",
    "fit pendulum --data @/stop/data.csv --columns bob.phi --free g --plots @/stop --json @/stop/o.json",
    "run pendulum -t 0.1 --plots @/stop --json @/stop/o.json",
    "sensitivity pendulum --of bob.x --by g -t 0.1 -o @/stop/s.csv --json @/stop/sensitivity.json --plots @/stop",
  };
  cli_good ("mkdir -p @/stop/bin && printf '#!/bin/sh\\nkill -INT $PPID; exit 1\\n' >@/stop/bin/gnuplot && chmod +x "
            "@/stop/bin/gnuplot && pinwheel run pendulum -t 1 --every 0.1 -o @/stop/data.csv");
  for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
    assert_int_equal (cli_run (check_text ("PATH=@/stop/bin pinwheel %s", commands[i])), 130);
    assert_non_null (strstr (cli_err, "pinwheel: gnuplot was interrupted, so no figures are drawn; data and scripts"));
    if (i < 3) assert_true (cli_says (cli_file ("stop/o.json"), "status", "interrupted"));
    cli_good ("rm -f @/stop/o.json");
  }
  /* the program alone receives the signal */
  cli_good ("printf '#!/bin/sh\nkill -TERM $PPID\n' >@/stop/bin/gnuplot");
  assert_int_equal (cli_run ("PATH=@/stop/bin pinwheel run pendulum -t 0.1 --plots @/stop --json @/stop/o.json"), 130);
  assert_string_equal (cli_err, "pinwheel: interrupted; the figures are complete\n");
  assert_true (cli_says (cli_file ("stop/o.json"), "status", "interrupted"));
}

TEST (data) {
  assert_int_equal (cli_run ("PATH=/none pinwheel run ezyroller --t-end 20 --plots @/data >/dev/null"), 0);
  assert_non_null (strstr (cli_err, "gnuplot was not found, so no figures are drawn; data and scripts are in"));
  assert_true (plots_has ("data/motion.dat") && plots_has ("data/wheels.dat") && plots_has ("data/energy.dat"));
  assert_true (plots_has ("data/mechanism.dat") && plots_has ("data/mechanism.gp") && plots_has ("data/paths.gp"));
  assert_null (cli_file ("data/paths.svg"));
}

TEST (ground) {
  assert_int_equal (cli_run ("PATH=/none pinwheel run andrews-squeezer --plots @/squeezer >/dev/null"), 0);
  assert_true (plots_has ("squeezer/ground.dat"));
  assert_null (cli_file ("squeezer/wheels.dat"));
}

/* The paths of a model: a polyline by its points, a longer one and a spline by 500 points at equal distances. */
TEST (model_paths) {
  static char text[20000];
  int n = snprintf (text, sizeof text,
                    "pinwheel: 1\nbodies: [{name: car, mass: 1, inertia: 1, rate: {vx: 1}}]\npaths:\n"
                    "  - {name: triangle, closed: true, points: [[0, 0], [1, 0], [1, 2]]}\n"
                    "  - {name: ring, closed: true, interpolation: cubic, points: [[3, 0], [0, 3], [-3, 0], [0, -3]]}\n"
                    "  - name: long\n    points: [[0, 0]");
  for (int i = 1; i < 999; i++) n += snprintf (text + n, sizeof text - (size_t)n, ", [%d, 0]", i);
  snprintf (text + n, sizeof text - (size_t)n, "]\n");
  cli_write ("roads.yaml", text);
  cli_shell ("pinwheel run @/roads.yaml --t-end 1 --plots @/roads --animate @/roads.html");
  const char *data = cli_file ("roads/model-paths.dat");
  assert_non_null (data);
  assert_non_null (strstr (data, "y [m]\n0 0\n1 0\n1 2\n0 0\n\n3 0\n"));
  double x, y;
  int points = 0, last = 0;
  for (const char *p = strstr (data, "\n\n3 0\n") + 2; p && sscanf (p, "%lf %lf", &x, &y) == 2; points++) {
    if (points < 500) check_close ("radius", hypot (x, y), 3, 0.1, "a spline through four points of a circle");
    last = (int)x;
    p += strspn (p, "\n");
    p = strchr (p, '\n');
  }
  assert_int_equal (points, 1000);
  assert_int_equal (last, 998);
  assert_true (plots_has ("roads/paths.svg") && plots_has ("roads/mechanism.svg"));
  cli_shell ("grep '\"paths\": \\[' @/roads.html");
}

/* The lines of symbols in a model's last snapshot. */
static const char *plots_symbols (const char *elements) {
  cli_write (
      "symbols.yaml",
      check_text (
          "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1, rate: {omega: 1}}\n"
          "  - {name: b, mass: 1, inertia: 1, start: {x: 0.6}}\n  - {name: c, mass: 1, inertia: 1, start: {y: -1}, "
          "rate: {vx: 2}}\nelements:\n%s",
          elements));
  assert_int_equal (cli_run ("PATH=/none pinwheel run @/symbols.yaml -t 1 --plots @/symbols >/dev/null 2>&1"), 0);
  const char *data = strstr (cli_file ("symbols/mechanism.dat"), "# symbols");
  assert_non_null (data);
  return data;
}

/* Pitch circles, a rail as long as the travel, a damper only where there is damping. */
TEST (symbols) {
  const char *gear = "  - {pin: A, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                     "  - {pin: B, body: [b, ground], at: [[0, 0], [0.6, 0]]}\n"
                     "  - {gear: g, body: [a, b, ground], ratio: -0.5}\n";
  const char *data = plots_symbols (gear);
  assert_true (strstr (data, "\n0.4 0 1 0\n") && strstr (data, "\n0.8 0 1 0\n"));
  const char *rail = "  - {slider: s, body: [c, ground], at: [[0, 0], [0, -1]]}\n"
                     "  - {spring: k, body: [a, b], at: [[0, 0], [0, 0]], stiffness: 1, damping: %d}\n";
  char elements[400];
  double x0, x1, y0, y1;
  size_t length[2];
  for (int damping = 0; damping < 2; damping++) {
    snprintf (elements, sizeof elements, rail, damping);
    data = plots_symbols (elements);
    length[damping] = strlen (data);
  }
  assert_true (length[1] > length[0]);
  int found = 0;
  while ((data = strchr (data, '\n')) != NULL && !found) {
    data++;
    found = sscanf (data, "%lf %lf 1 0\n%lf %lf 1 0\n", &x0, &y0, &x1, &y1) == 4 && y0 == -1 && y1 == -1;
  }
  assert_true (found && x0 < 0 && x0 > -0.5 && x1 > 2 && x1 < 2.5);
  length[0] = strlen (plots_symbols ("  - {slot: s, body: [c, ground], at: [[0, 0], [0, -1]]}\n"));
  length[1] = strlen (plots_symbols ("  - {slot: s, body: [ground, c], at: [[0, -1], [0, 0]]}\n"));
  assert_true (2 * length[1] < length[0]); /* a rail that moves has no hatching */
}

/* The number of lines "x y t body" of data, up to the next "#", on a circle. */
static int plots_circle (const char *data, double x0, double y0, double radius, int body) {
  int n = 0;
  for (const char *stop = strchr (data + 1, '#'); (data = strchr (data, '\n')) != NULL && (!stop || data < stop);) {
    double x, y, t;
    int b;
    if (*++data == '\n' || sscanf (data, "%lf %lf %lf %d", &x, &y, &t, &b) != 4 || b != body) continue;
    n += fabs (hypot (x - x0, y - y0) - radius) < 1e-8 * radius;
  }
  return n;
}

/* Discs of contacts on a body and on the ground, each once; a line with hatching on its right; the walls of a stop. */
TEST (contacts) {
  const char *data =
      plots_symbols ("  - {contact: S, body: [a, ground], at: [[0, 0], [0, -0.3]], radius: 0.3, mu: 0.5}\n"
                     "  - {contact: D, body: [a, ground], at: [[0, 0], [3, 0]], radius: 0.3, other_radius: 0.7}\n"
                     "  - {contact: P, body: [c, b], at: [[0, 0], [0, -2]]}\n"
                     "  - {stop: X, body: [c, ground], what: x, low: 0, high: 9}\n");
  int below = 0, walls = 0;
  while ((data = strchr (data, '\n')) != NULL) {
    double x[2], y[2];
    if (*++data == '\n' || sscanf (data, "%lf %lf 1 0\n%lf %lf 1 0\n", &x[0], &y[0], &x[1], &y[1]) != 4) continue;
    if (fabs (y[0] + 0.3) < 1e-9) below += y[1] < y[0] && x[1] < x[0];
    walls += x[0] == x[1] && y[0] == -y[1] && (x[0] == 0 || x[0] == 9);
  }
  assert_in_range (below, 5, 60);
  assert_int_equal (walls, 2);
  data = strstr (cli_file ("symbols/mechanism.dat"), "# bodies, at the end");
  assert_int_equal (plots_circle (data, 0, 0, 0.3, 1), 97);
  assert_int_equal (plots_circle (data, 3, 0, 0.7, 0), 97);
}

TEST (style) {
  assert_int_equal (
      cli_run ("PATH=/none pinwheel run ezyroller -t 1 --plots @/style --width 8.5cm --colour time >/dev/null"), 0);
  assert_non_null (strstr (cli_file ("style/paths.gp"), "\nwidth = 240.94\n"));
  assert_non_null (strstr (cli_file ("style/mechanism.gp"), "\nby_time = 1\n"));
  assert_non_null (strstr (cli_file ("style/paths.gp"), "about = 'two-segment ride-on"));
  cli_bad ("pinwheel run ezyroller --plots @/style --width 85", 2, "--width 85: expected a length such as 85mm");
  cli_bad ("pinwheel run ezyroller --plots @/style --width 1mm", 2, "--width 1mm: expected 50mm to 500mm");
  cli_bad ("pinwheel run ezyroller --plots @/style --colour red", 2, "--colour red: expected body or time");
  cli_bad ("pinwheel compare ezyroller --plots @/style --width xmm", 2, "--width: \"x\" is not a number");
}

/* In a narrow figure the legend of eleven methods, whose last one is galpha+ggl, ends above the frame of the first
 * panel. */
TEST (legend) {
  static const char *const width[] = { "85mm", "120mm", "170mm" };
  char command[200];
  for (int i = 0; i < 3; i++) {
    double last = 0, frame = 0;
    snprintf (command, sizeof command,
              "pinwheel drift pendulum --t-end 1 --step 0.01 --only-methods --width %s --plots @/legend%d", width[i],
              i);
    cli_good (command);
    snprintf (command, sizeof command, "legend%d/drift.svg", i);
    for (const char *at = cli_file (command); (at = strpbrk (at + 1, "<'")) != NULL;) {
      double x, y;
      if (sscanf (at, "<g transform=\"translate(%*f,%lf)\"", &y) == 1 && y > last && strstr (at, "<text>") &&
          strncmp (strstr (at, "<text>"), "<text>galpha+ggl<", 17) == 0)
        last = y;
      if (sscanf (at, "'M%lf,%lf L", &x, &y) == 2 && strstr (at, "Z ") && strchr (at, '\n') > strstr (at, "Z ") &&
          (frame == 0 || y < frame))
        frame = y;
    }
    assert_true (last > 0 && last < frame);
  }
}

TEST (refusals) {
  cli_write ("file", "in the way");
  cli_bad ("pinwheel run ezyroller --t-end 1 --plots @/file >/dev/null", 1,
           "cannot write into @/file: Not a directory");
  cli_bad ("pinwheel run ezyroller --t-end 1 --plots ''", 2, "\"\" cannot be the name of a folder");
}

const check_fixture fixture = { cli_setup, cli_teardown };
