/* Several runs at once in lanes have the bits of single runs, and lanes are used. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "method.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "scene.h"
#include "specialised.h"

enum { MOST = 8 };

/* Runs that begin with different velocities, each alone and in lanes. */
typedef struct {
  pw_system *s;
  pw_scene_code *code, *lanes;
  pw_run *alone[MOST], *together[MOST];
  int n;
} several;

static void several_open (several *x, pw_system *s, int lanes, int n, const char *method, double step) {
  pw_error error = { 0 };
  char *text = pw_system_source (s, NULL, &error);
  check_ok (error.status, &error);
  *x = (several){ .s = s, .n = n };
  x->code = pw_scene_code_open (text, s, &error);
  x->lanes = pw_scene_lanes_open (text, s, lanes, &error);
  check_ok (error.status, &error);
  free (text);
  for (int k = 0; k < n; k++) {
    pw_initial_value value = { s->coords, s->v0[0] + 0.02 * k };
    pw_settings set = { .step = step, .span = 1, .specialised = pw_scene_code_table (x->code) };
    set.initial = &value, set.initials = s->bodies > 3 ? 0 : 1;
    x->alone[k] = runs_open (s, method, &set), x->together[k] = runs_open (s, method, &set);
  }
}

static void several_close (several *x) {
  for (int k = 0; k < x->n; k++) pw_run_close (x->alone[k]), pw_run_close (x->together[k]);
  pw_scene_code_close (x->code);
  pw_scene_code_close (x->lanes);
  pw_system_free (x->s);
}

static long taken; /* steps in lanes */
static const pw_specialised_lanes *counted;

static void count_steps (pw_scene *const *s, pw_scene_steps *const *x, void *memory) {
  counted->steps (s, x, memory);
  for (int k = 0; k < counted->lanes; k++) taken += x[k]->done;
}

static void several_compare (const several *x, double t, double before) {
  counted = pw_scene_code_lanes (x->lanes), taken = 0;
  pw_specialised_lanes code = *counted;
  code.steps = count_steps;
  void *memory = pw_specialised_lanes_memory (counted);
  assert_non_null (memory);
  for (int k = 0; k < x->n; k++) check_ok (pw_run_advance_to (x->alone[k], t, t, NULL), NULL);
  while (pw_run_time (x->together[0]) < t) {
    int status[MOST];
    double t_end[MOST];
    pw_error error[MOST] = { { 0 } };
    for (int k = 0; k < x->n; k++) t_end[k] = t;
    pw_runs_advance (x->together, x->n, t_end, &code, memory, status, error);
    for (int k = 0; k < x->n; k++) check_ok (status[k], &error[k]);
  }
  for (int k = 0; k < x->n; k++) {
    pw_sample a, b;
    check_ok (pw_run_advance_to (x->together[k], t, t, NULL), NULL);
    check_ok (pw_run_sample (x->alone[k], before, &a, NULL), NULL);
    check_ok (pw_run_sample (x->together[k], before, &b, NULL), NULL);
    check_bits ("positions", a.q, b.q, x->s->coords);
    check_bits ("velocities", a.v, b.v, x->s->coords);
    check_bits ("accelerations", a.a, b.a, x->s->coords);
    check_bits ("multipliers", a.lambda, b.lambda, x->s->rows);
    check_bits ("work", &a.work, &b.work, 1);
    check_bits ("loss", &a.loss, &b.loss, 1);
    assert_memory_equal (&x->alone[k]->statistics, &x->together[k]->statistics, sizeof (pw_statistics));
  }
  free (memory);
}

static int has_lanes (void) {
  pw_system *s = scene_named ("chaplygin-sleigh", NULL, 0);
  char *text = pw_system_source (s, NULL, NULL);
  pw_scene_code *code = pw_scene_lanes_open (text, s, 2, NULL);
  int has = pw_scene_code_lanes (code) != NULL;
  pw_scene_code_close (code);
  pw_system_free (s);
  free (text);
  if (!has) print_message ("not with this compiler\n");
  return has;
}

/* Numbers of runs for which there is no code. */
TEST (numbers) {
  static const int lanes[] = { -1, 1, 3, PW_LANES_MOST + 1, 2 * PW_LANES_MOST };
  pw_system *s = scene_named ("chaplygin-sleigh", NULL, 0);
  char *text = pw_system_source (s, NULL, NULL);
  for (size_t i = 0; i < sizeof lanes / sizeof *lanes; i++) {
    pw_error error = { 0 };
    assert_null (pw_scene_lanes_open (text, s, lanes[i], &error));
    assert_int_equal (error.status, PW_INPUT);
  }
  pw_system_free (s);
  free (text);
}

/* The largest models of the gallery take most of the time of the compiler: see slow_lanes. */
TEST (models) {
  static const struct {
    const char *model, *method;
    double step;
  } all[] = {
    { "ezyroller", "rk4+projection", 1e-3 },
    { "ezyroller", "rk4+none", 1e-3 },
    { "snakeboard", "rk4+projection", 1e-3 },
    { "snakeboard", "erk8+projection:steps=fixed", 1e-3 },
    { "n-trailer", "rk4+projection", 1e-3 },
    { "roller-racer", "erk5:steps=fixed", 1e-3 },
    { "car-two-trailers", "erk8+projection:steps=fixed", 1e-2 }, /* its signals are not harmonic */
    { "car-tyres", "rk4+projection", 1e-3 },
    { "slider-crank", "rk4+projection", 1e-3 },
    { "chaplygin-sleigh", "rk4+projection", 1e-3 },
  };
  if (!has_lanes ()) skip ();
  for (size_t i = 0; i < sizeof all / sizeof *all; i++)
    for (int lanes = 2; lanes <= 8; lanes *= 4) {
      several x;
      several_open (&x, scene_named (all[i].model, NULL, 0), lanes, lanes, all[i].method, all[i].step);
      several_compare (&x, 150.3 * all[i].step, 150.1 * all[i].step);
      if (taken < 60 * lanes) print_error ("%s %s %d: %ld\n", all[i].model, all[i].method, lanes, taken);
      assert_true (taken >= 60 * lanes);
      several_close (&x);
    }
}

/* A run that waits for the others has the configurations of its own state, from which the potential energy follows. */
TEST (waiting) {
  if (!has_lanes ()) skip ();
  several x;
  several_open (&x, scene_named ("slider-crank", NULL, 0), 4, 4, "rk4+projection", 1e-3);
  void *memory = pw_specialised_lanes_memory (pw_scene_code_lanes (x.lanes));
  for (int k = 0; k < x.n; k++) /* then the next multiple of PW_CHECK_INTERVAL is at different distances */
    check_ok (pw_run_advance_to (x.together[k], 0.1 + 0.01 * k, 0.1 + 0.01 * k, NULL), NULL);
  int status[MOST];
  pw_error error[MOST] = { { 0 } };
  pw_runs_advance (x.together, x.n, (double[]){ 1, 1, 1, 1 }, pw_scene_code_lanes (x.lanes), memory, status, error);
  for (int k = 0; k < x.n; k++) {
    const pw_run *r = x.together[k];
    check_ok (status[k], &error[k]);
    for (int b = 0; b < x.s->bodies; b++) {
      const pw_configuration *c = &r->w->configuration[b];
      check_close ("cosine", c->cos, cos (r->q[3 * b + 2]), CHECK_EPS, "rounding of our own cosine");
      check_close ("sine", c->sin, sin (r->q[3 * b + 2]), CHECK_EPS, "rounding of our own sine");
    }
  }
  free (memory);
  several_close (&x);
}

/* A few runs leave lanes empty; one run is faster alone. */
TEST (empty_lanes) {
  if (!has_lanes ()) skip ();
  for (int n = 1; n <= 4; n++) {
    several x;
    several_open (&x, scene_named ("snakeboard", NULL, 0), 4, n, "rk4+projection", 1e-3);
    several_compare (&x, 0.2003, 0.2001);
    assert_true (n > 2 ? taken > 0 : taken == 0);
    several_close (&x);
  }
}

TEST (excluded) {
  pw_system *plain = scene_named ("ezyroller", NULL, 0), *own = scene_named ("elliptic-wire", NULL, 0);
  assert_true (pw_system_has_lanes (plain));
  assert_false (pw_system_has_lanes (own));
  pw_system_free (plain);
  pw_system_free (own);
}
