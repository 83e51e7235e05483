/* Reference solutions of models, in C, as text, in tables; their use by run, compare, show and check. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* A damped oscillator, in text; `TRUTH` is put at its end. */
static const char truth_text[] = "pinwheel: 1\nrun: {t_end: 5, step: 0.01}\n"
                                 "parameters:\n  - {name: k, value: 60}\n  - {name: c, value: 2.4}\n"
                                 "  - {name: a, value: 0.3}\n"
                                 "let:\n  d: c/3\n  w: sqrt(k/1.5 - d^2)\n"
                                 "bodies:\n  - {name: block, mass: 1.5, inertia: 0.1, start: {x: 0.8 + a}}\n"
                                 "elements:\n  - {slider: rail, body: [block, ground], at: [[0, 0], [0, 0]]}\n"
                                 "  - {spring: s, body: [block, ground], at: [[0, 0], [0, 0]], stiffness: k, "
                                 "damping: c, length: 0.8}\n"
                                 "truth:\n  block.x: 0.8 + a*exp(-d*t)*(cos(w*t) + d/w*sin(w*t))\n";

/* The same free particle twice: the second one's rate is not known. */
static const char truth_c[] =
    "#include \"pinwheel.h\"\n"
    "typedef struct { double u; } particle;\n"
    "static const pw_parameter parameters[] = { { PW_AT (particle, u), 2, \"m/s\", \"speed\", PW_REAL },\n"
    "  { .name = NULL } };\n"
    "static void build (pw_model *m, const void *parameter) {\n"
    "  const particle *p = parameter;\n"
    "  pw_add_body (m, &(pw_body){ .name = \"one\", .mass = 1, .inertia = 1, .rate = { p->u, 0, 1 } });\n"
    "  pw_add_body (m, &(pw_body){ .name = \"two\", .mass = 1, .inertia = 1, .rate = { p->u } });\n"
    "}\n"
    "static void truth (const void *parameter, double t, double *q, double *v) {\n"
    "  const particle *p = parameter;\n"
    "  q[0] = p->u * t, q[2] = t, v[0] = p->u;\n"
    "  q[3] = p->u * t + OFF;\n"
    "}\n"
    "PW_MODEL (.about = \"particles\", .parameters = parameters, .parameters_size = sizeof (particle),\n"
    "          .run = { .t_end = 1, .step = 0.1 }, .build = build, .reference = truth);\n";

static void truth_write_c (const char *off) {
  const char *at = strstr (truth_c, "OFF");
  cli_write ("particles.c", check_text ("%.*s%s%s", (int)(at - truth_c), truth_c, off, at + 3));
}

static double truth_error (const char *when, const char *what) {
  return cli_number (cli_out, "truth", when, what, NULL);
}

/* Order 4: ten times smaller steps, ten thousand times smaller errors; parameters are followed. */
TEST (text) {
  double coarse;
  cli_write ("block.yaml", truth_text);
  cli_good ("pinwheel run @/block.yaml --set a=0.5 --set k=45 --json -");
  assert_true (cli_says (cli_out, "source", "the model"));
  check_close ("samples", cli_number (cli_out, "truth", "samples", NULL), 100, 0, "as in compare");
  coarse = truth_error ("largest", "length");
  check_below ("coarse", coarse, 1e-6, "(h w)^4");
  assert_true (coarse > 1e-9 && truth_error ("end", "length") < coarse);
  assert_non_null (strstr (strstr (cli_out, "\"largest\""), "\"speed\": null"));
  cli_good ("pinwheel run @/block.yaml --set a=0.5 --set k=45 --step 0.001 --json -");
  check_close ("order", log10 (coarse / truth_error ("largest", "length")), 4, 0.1, "order 4 in h");
  cli_good ("pinwheel run @/block.yaml");
  cli_shows ("error against the reference solution of the model, at 100 times\n");
  cli_shows ("  length ");
  cli_good ("pinwheel show @/block.yaml");
  cli_shows ("\nReference solution: block.x\n");
}

/* Errors do not change the run: table and end are the same to the bit. */
TEST (does_no_harm) {
  cli_write ("block.yaml", truth_text);
  cli_good ("grep -v -e truth: -e 'block.x:' @/block.yaml >@/plain.yaml && "
            "pinwheel run @/block.yaml --step 0.007 -o @/a.csv && pinwheel run @/plain.yaml --step 0.007 -o @/b.csv && "
            "cmp @/a.csv @/b.csv");
  cli_good ("pinwheel run @/plain.yaml --json -");
  cli_shows ("\"truth\": null");
}

/* A resumed run knows the samples before its checkpoint. */
TEST (resume) {
  cli_write ("block.yaml", truth_text);
  assert_int_equal (cli_run ("pinwheel run @/block.yaml --checkpoint @/a.ck --checkpoint-every 2 --json @/a.json && "
                             "pinwheel run @/block.yaml --resume @/a.ck --checkpoint-every 2 --json @/b.json && "
                             "grep -v cpu_s @/a.json >@/a && grep -v cpu_s @/b.json >@/b && cmp @/a @/b && cat @/b"),
                    0);
  check_close ("samples", cli_number (cli_out, "truth", "samples", NULL), 100, 0, "all of them");
}

TEST (compare) {
  cli_write ("block.yaml", check_text ("%s  block.y: 0\n  block.phi: 0\n"
                                       "  block.vx: -a*(w + d^2/w)*exp(-d*t)*sin(w*t)\n",
                                       truth_text));
  cli_good ("pinwheel compare @/block.yaml --methods rk4,erk5 --repeats 1 --step-ladder 0.1:0.02 --rtol-ladder "
            "1e-4:1e-5 --plots @/whole");
  cli_shows ("errors are measured against the exact solution of the model\n");
  assert_null (strstr (cli_out, "contains"));
  cli_good ("tail -n +2 @/whole/compare.csv | cut -d, -f8,12 | sort -u");
  assert_string_equal (cli_out, "nan,nan\n"); /* speeds: only one of the three velocities is given */
  cli_good ("pinwheel compare @/block.yaml --methods rk4 --step-ladder 0.1:0.05 --start block.x=1.2 --t-end 1");
  assert_null (strstr (cli_out, "the exact solution of the model"));
}

/* A part of the coordinates is not the motion: `compare` computes a reference if it is the model that gives a part, and
 * names the part if it is a table; `run` names it. */
TEST (partial) {
#define PARTIAL " --methods rk4+projection --repeats 1 --step-ladder 0.1:0.05"
  cli_good ("pinwheel compare car-two-trailers -t 2 --plots @/part" PARTIAL);
  cli_shows (
      "the model's own reference solution contains at all times only car.phi of 9 coordinates: a computed one is used\n"
      "errors are measured against erk8+projection, rtol 3e-14\n");
  cli_shows (" m (lengths), ");
  cli_good ("tail -n +2 @/part/compare.csv | cut -d, -f6-14"); /* the errors */
  assert_null (strstr (cli_out, "nan"));
  cli_good ("pinwheel compare hatchet-planimeter --set r=0.4 -t 2" PARTIAL);
  cli_shows (
      "the model's own reference solution contains at all times none of 3 coordinates: a computed one is used\n");
  cli_shows ("cheapest ");
  /* the angle is known up to 0.5 s only */
  cli_write ("block.yaml", check_text ("%s  block.y: 0\n  block.phi: 0*sqrt(0.5 - t)\n", truth_text));
  cli_good ("pinwheel compare @/block.yaml -t 1" PARTIAL);
  cli_shows ("solution contains at all times only block.x, block.y of 3 coordinates: a computed one is used\n");
  cli_write ("few.csv", "t,K1.x,K1.y,K1.phi,K2.x,K2.y\n0.01,0,0,0,0,nan\n0.02,0,0,0,nan,nan\n");
  cli_good ("pinwheel compare andrews-squeezer --reference @/few.csv --methods rk4+projection --repeats 1 "
            "--step-ladder 1e-4:5e-5");
  cli_shows ("few.csv, as if it were exact\n"
             "  it contains only K1.x, K1.y, K1.phi and 1 more of 21 coordinates\n");
  cli_good ("pinwheel run car-two-trailers -t 1");
  cli_shows ("\n  the reference solution contains only car.phi of 9 coordinates\n");
  cli_good ("pinwheel run hatchet-planimeter --set r=0.4 -t 1");
  cli_shows ("\n  errors are unknown: the reference solution of the model contains no value at the times compared\n");
  assert_null (strstr (cli_out, "error against"));
}

TEST (round_trip) {
  cli_write ("block.yaml", truth_text);
  cli_good ("pinwheel show @/block.yaml --set a=0.5 --yaml >@/again.yaml && "
            "pinwheel run @/block.yaml --set a=0.5 --json @/a.json && pinwheel run @/again.yaml --json @/b.json && "
            "sed -n '/\"truth\"/,/reactions/p' @/a.json >@/a && sed -n '/\"truth\"/,/reactions/p' @/b.json >@/b && "
            "grep -q largest @/a && cmp @/a @/b");
  truth_write_c ("0");
  cli_good ("pinwheel show @/particles.c --yaml");
  cli_shows ("# The reference solution of the model is a function in C, which cannot be written as text.\n");
}

TEST (function) {
  truth_write_c ("0");
  cli_good ("pinwheel run @/particles.c --set u=3 --json - && pinwheel show @/particles.c");
  check_below ("length", truth_error ("largest", "length"), 1e-14, "round-off");
  check_below ("angle", truth_error ("largest", "angle"), 1e-14, "round-off");
  cli_shows ("Reference solution: one.x, one.phi, two.x, one.vx\n");
  cli_good ("pinwheel check @/particles.c");
  cli_shows ("  compared with the reference solution of the model in 4 states\n");
  truth_write_c ("0.25");
  cli_good ("pinwheel run @/particles.c --json -");
  check_close ("a wrong truth", truth_error ("end", "length"), 0.25, 1e-12, "round-off");
  cli_bad ("pinwheel check @/particles.c", 2,
           "the model's reference solution does not hold initially: two.x is 0, not 0.25");
}

TEST (started_elsewhere) {
  truth_write_c ("0");
  assert_int_equal (cli_run ("pinwheel run @/particles.c --start one.x=5 --json -"), 0);
  cli_shows ("\"truth\": null");
  assert_non_null (strstr (cli_err, "with --start errors are not computed"));
}

/* A table: its times are the samples, those after the end are left out, columns it does not have are not compared. */
TEST (table) {
  truth_write_c ("0");
  cli_write ("table.csv", "t [s],one.x [m],two.phi [rad],nothing\n0,0,0,0\n0.25,0.5,0,0\n0.5,1.125,0,0\n0.75,1.5,0,0\n"
                          "3,6,0,0\n");
  cli_good ("pinwheel run @/particles.c --reference @/table.csv --json -");
  check_close ("samples", cli_number (cli_out, "truth", "samples", NULL), 3, 0, "exact");
  check_close ("last", cli_number (cli_out, "truth", "t", NULL), 0.75, 0, "exact");
  check_close ("largest", truth_error ("largest", "length"), 0.125, 1e-14, "round-off");
  check_close ("end", truth_error ("end", "length"), 0, 1e-14, "round-off");
  check_close ("angle", truth_error ("largest", "angle"), 0, 0, "exact");
  cli_good ("pinwheel run @/particles.c --reference @/table.csv");
  cli_shows ("table.csv, at 3 times\n");
  cli_write ("units.csv", "t [ms],one.x [mm],two.phi[deg]\n250,500,0\n500,1125,0\n750,1500,0\n");
  cli_good ("pinwheel run @/particles.c --reference @/units.csv --json -");
  check_close ("last", cli_number (cli_out, "truth", "t", NULL), 0.75, 0, "exact");
  check_close ("largest", truth_error ("largest", "length"), 0.125, 1e-14, "round-off");
  cli_write ("unit.csv", "t [s],one.x [deg]\n1,0\n");
  cli_bad ("pinwheel run @/particles.c --reference @/unit.csv", 2,
           "@/unit.csv:1: column \"one.x [deg]\": the unit \"deg\" does not measure what m does, which is "
           "expected");
  cli_write ("unit.csv", "t [s],one.x [cubit]\n1,0\n");
  cli_bad ("pinwheel compare @/particles.c --methods rk4 --reference @/unit.csv", 2,
           "@/unit.csv:1: column \"one.x [cubit]\": the unit \"cubit\" is not known; expected m, or one that "
           "converts to it");
  cli_write ("unit.csv", "t [m],one.x\n1,0\n");
  cli_bad ("pinwheel run @/particles.c --reference @/unit.csv", 2,
           "@/unit.csv:1: column \"t [m]\": the unit \"m\" does not measure what s does, which is expected");
  cli_write ("late.csv", "t,one.x\n3,6\n");
  cli_bad ("pinwheel run @/particles.c --reference @/late.csv", 2,
           "@/late.csv: no row between 0 and the final time, t = 1 s");
  cli_bad ("pinwheel run @/particles.c --reference @/none.csv", 2,
           "@/none.csv: cannot be read: No such file or directory");
}

/* Models of the gallery, with parameters of their own as well: what they know is what they do, to the method's
 * order. */
TEST (gallery) {
  static const struct {
    const char *model;
    double bound;
    const char *reason;
  } trial[] = {
    { "chaplygin-sleigh", 1e-10, "100 h^4" },
    { "chaplygin-sleigh --set a=-0.3 --set w0=-1.1 --set u0=0.2 --set m=2 --set I=0.7", 1e-10, "100 h^4" },
    { "knife-edge-incline --set w=1.7 --set alpha=0.4", 1e-10, "100 h^4" },
    { "pendulum --set theta=-0.3 --set I=0.2 --set l=0.8 --set m=1.5", 1e-9, "1000 h^4: 4 rad/s" },
    { "pendulum --set theta=3", 1e-9, "1000 h^4: released beyond the highest point, 6 rad/s" },
    { "pendulum --set theta=-4", 1e-9, "1000 h^4: 5 rad/s" },
    { "pendulum --set theta=6", 1e-9, "1000 h^4: 5 rad/s" },
    { "differential-drive --set ahead=0.1 --set right=0.2 --set track=0.4 --set radius=0.1", 1e-10, "100 h^4" },
    { "car --set steer=-0.2 --set b=1.1 --set u0=3", 1e-10, "100 h^4" },
    { "n-trailer --set n=4 --set R=3 --set w=-0.8 --set longer=0.1", 1e-10, "100 h^4" },
    { "n-four-bar --set speed=2 --set N=3 --set l=1.2", 1e-8, "1e4 h^4: 6 rad/s, singular configurations" },
    { "redundant-parallelogram --set theta=0.4 --set mc=1 --set l=0.7", 1e-9, "1000 h^4: 6 rad/s" },
    { "peaucellier --set swing=0.7 --set omega=2 --set a=0.35", 1e-12, "prescribed: round-off" },
    { "peaucellier --set swing=1.7", 1e-12, "prescribed: round-off; the crank turns by more than pi" },
    { "peaucellier --set swing=2.4 --set a=0.74", 1e-12, "prescribed: round-off; so do bars of the rhombus" },
  };
  for (size_t i = 0; i < sizeof trial / sizeof *trial; i++) {
    cli_good (check_text ("pinwheel check %s >@/check && pinwheel run %s -t 2 --json - 2>@/said", trial[i].model,
                          trial[i].model));
    double length = truth_error ("largest", "length"), angle = truth_error ("largest", "angle");
    check_below (trial[i].model, fmax (length, angle), trial[i].bound, trial[i].reason);
    check_close ("samples", cli_number (cli_out, "truth", "samples", NULL), 100, 0, "all of them");
  }
}

/* Jacobi's functions: am' = dn, digits of K (1/2) (Abramowitz & Stegun 1964, table 17.1), limits. */
TEST (elliptic) {
  check_close ("K (0)", pw_elliptic_K (0), PW_PI / 2, 4 * CHECK_EPS, "round-off");
  check_close ("K (1/2)", pw_elliptic_K (0.5), 1.854074677301371918, 4 * CHECK_EPS, "round-off");
  assert_true (isinf (pw_elliptic_K (1)) && isnan (pw_elliptic_K (1.5)) && isnan (pw_jacobi_am (1, 1.5)));
  for (double m = -1.5; m < 1; m += 0.4) {
    double K = pw_elliptic_K (m), u = 0.7, h = 1e-5;
    check_close ("am (K)", pw_jacobi_am (K, m), PW_PI / 2, 64 * CHECK_EPS, "round-off");
    check_close ("am (5 K)", pw_jacobi_am (5 * K, m), 5 * PW_PI / 2, 64 * CHECK_EPS, "round-off");
    double s = sin (pw_jacobi_am (u, m)), slope = (pw_jacobi_am (u + h, m) - pw_jacobi_am (u - h, m)) / (2 * h);
    check_close ("am'", slope, sqrt (1 - m * s * s), 1e-9, "differences: h^2");
  }
  check_close ("m = 1", pw_jacobi_am (0.7, 1), pw_jacobi_am (0.7, 1 - 1e-12), 1e-11, "continuous");
}

/* Digits at one time: Andrews' squeezer against the table in tests/reference (Hairer & Wanner 1996, section VII.7). */
TEST (digits) {
  cli_good ("pinwheel run andrews-squeezer --reference tests/reference/andrews-squeezer.csv --json -");
  check_close ("samples", cli_number (cli_out, "truth", "samples", NULL), 1, 0, "one row");
  check_below ("angles", truth_error ("end", "angle"), 1e-6, "100 (h w)^4 at h = 10 us and w = 1000 rad/s");
}

/* A crank that turns all the way around, and one that is too long. */
TEST (peaucellier) {
  cli_bad ("pinwheel run peaucellier --set swing=-12.5", 2,
           "model peaucellier: swing = -12.5: arms and rhombus do not reach the crank there");
  cli_bad ("pinwheel run peaucellier --set L=0.5 --set swing=3.5", 2,
           "model peaucellier: swing = 3.5: arms and rhombus do not reach the crank there");
  cli_bad ("pinwheel run peaucellier --set a=0.8 --set swing=0.1", 2,
           "model peaucellier: a = 0.8: arms and rhombus do not reach the crank at the angle 0");
}

/* Quantities without a column in the reference have no error. */
TEST (not_compared) {
  cli_write ("speed.csv", "t,frame.vx\n1,0\n2,0\n");
  cli_good ("pinwheel run ezyroller -t 2 --reference @/speed.csv --json -");
  assert_true (truth_error ("end", "speed") > 0.1);
  cli_shows ("\"end\": {\n      \"length\": null,\n      \"angle\": null,\n");
  cli_shows ("\"largest\": {\n      \"length\": null,\n      \"angle\": null,\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
