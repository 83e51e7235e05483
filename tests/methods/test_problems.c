/* Problems of benchmarks/scenes that favour no method: states by methods of each family, compared with digits computed
 * from minimal equations (tests/reference/problems.py). */
#include <math.h>
#include "check.h"
#include "pinwheel-files.h"
#include "scene.h"
#include "trial.h"

typedef struct {
  const char *name;
  double value;
} named;

/* Errors may be `growth` times the tolerance; NULL ends parameters and states. */
typedef struct {
  const char *model;
  double t, growth;
  named parameter[6], state[9];
} problem;

/* The growth of errors: 1000 for some hundred steps; ten times that for the car axis, of which 20 oscillations take
 * most steps of all, and for the caster, which is unstable; bdf doubles it. */
static const problem problems[] = {
  { "benchmarks/scenes/knife-edge-drift.yaml",
    10,
    1e3,
    { { NULL, 0 } },
    { { "skate.x", -0.458006600448017133 }, { "skate.y", 25.0553039577320513 } } },
  { "benchmarks/scenes/transmission.c",
    10,
    1e3,
    { { NULL, 0 } },
    { { "carriage.x", -0.586685782595564843 },
      { "first.phi", 0.381978939476553724 },
      { "second.phi", 0.537876930532501747 } } },
  { "benchmarks/scenes/transmission.c",
    10,
    1e3,
    { { "a1", 1 }, { "b1", 0.3 }, { "a2", 1 }, { "b2", -0.3 } },
    { { "carriage.x", -0.580745772087163378 },
      { "first.phi", 0.70408603492040454 },
      { "second.phi", 0.480065796083828882 } } },
  { "benchmarks/scenes/transmission.c", /* the discs at rest: the carriage oscillates, x = 12 cos t */
    3,
    1e3,
    { { "x", 12 }, { "rate", 0 }, { "beta", 0 }, { "k1", 0 }, { "g", 0 } },
    { { "carriage.x", -11.8799099592053455 } } },
  { "benchmarks/scenes/sleigh-friction.yaml",
    5,
    1e3,
    { { NULL, 0 } },
    { { "sleigh.x", -1.05547996124516325 },
      { "sleigh.y", -2.11498895190982858 },
      { "sleigh.phi", 5.20366326778807304 },
      { "sleigh.omega", 0.273316046884593709 } } },
  { "benchmarks/scenes/car-axis.yaml",
    3,
    2e4,
    { { NULL, 0 } },
    { { "left.x", 0.0493455784275240921 },
      { "left.y", 0.496989460230008107 },
      { "right.x", 1.04174252488542612 },
      { "right.y", 0.373911027265365819 },
      { "left.vx", -0.0770583684035920843 },
      { "left.vy", 0.00744686659206841649 },
      { "right.vx", 0.0175568157535417366 },
      { "right.vy", 0.770341043779601063 } } },
  { "benchmarks/scenes/caster-shimmy.yaml",
    2,
    2e4,
    { { NULL, 0 } },
    { { "pivot.y", 0.0322800836520201482 },
      { "caster.phi", 0.234329568242956271 },
      { "pivot.vy", 1.73270950855921293 },
      { "caster.omega", 14.6004046809461649 } } },
  { "slider-crank", 1, 2e3, { { "l2", 1.001 } }, { { "crank.phi", 4.02672577394052552 } } },
};

static const struct {
  const char *method;
  double rtol;
} problem_methods[] = { { "erk8+projection", 1e-11 }, { "erk5+nullspace", 1e-10 }, { "radau+ggl", 1e-10 },
                        { "bdf+projection", 1e-9 },   { "ida+ggl", 1e-9 },         { "adams+baumgarte", 1e-10 } };

enum { PROBLEM_METHODS = sizeof problem_methods / sizeof *problem_methods };

/* Compares the states at the end by one method. */
static void problem_run (const problem *p, pw_system *s, int method) {
  double rtol = problem_methods[method].rtol;
  pw_run *r = runs_open (s, problem_methods[method].method, &(pw_settings){ .rtol = rtol, .span = p->t });
  pw_sample x = runs_to (r, p->t);
  print_message ("%s by %s\n", p->model, problem_methods[method].method);
  for (const named *k = p->state; k->name; k++)
    check_close (k->name, trial_state (s, &x, k->name), k->value, p->growth * rtol, "growth of errors, in tolerances");
  pw_run_close (r);
}

TEST (eccentricity) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open ("benchmarks/scenes/transmission.c", &error);
  pw_model *m = pw_file_model (f, &error);
  check_ok (pw_model_set (m, "off", -2, &error), &error);
  pw_model_build (m, &error);
  check_error (&error, PW_INPUT, "model transmission: off = -2: expected a number from -1 to 1");
  pw_model_free (m);
  pw_file_close (f);
}

TEST (problems) {
  for (const problem *p = problems; p < problems + sizeof problems / sizeof *problems; p++) {
    pw_error error = { 0 };
    pw_file *f = pw_file_open (p->model, &error);
    check_ok (f ? PW_OK : error.status, &error);
    pw_model *m = pw_file_model (f, &error);
    for (const named *k = p->parameter; k->name; k++) check_ok (pw_model_set (m, k->name, k->value, &error), &error);
    check_ok (pw_model_build (m, &error), &error);
    pw_system *s = scene_compile (m);
    for (int k = 0; k < PROBLEM_METHODS; k++) problem_run (p, s, k);
    pw_system_free (s);
    pw_file_close (f);
  }
}
