/* leapfrog: order 2, the way back, energy in long runs, residuals, samples, and what stops it. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "ladder.h"
#include "scene.h"

static const struct {
  const char *model;
  double h, t;
} leapfrog_scene[] = { { "ezyroller", 0.01, 2 },  { "n-trailer", 0.01, 1 },
                       { "pendulum", 0.01, 1 },   { "n-four-bar", 0.01, 0.4 },
                       { "arm", 0.004, 1 },       { "snakeboard", 0.01, 1 },
                       { "chain", 0.0025, 0.1 },    { "redundant-parallelogram", 0.01, 0.5 },
                       { "car-tyres", 0.002, 1 } };
enum { LEAPFROG_SCENES = sizeof leapfrog_scene / sizeof *leapfrog_scene, LEAPFROG_COORDS = 60 };

static void test_order (void **state) {
  (void)state;
  for (int i = 0; i < LEAPFROG_SCENES; i++)
    ladder_expect (leapfrog_scene[i].model, "leapfrog", leapfrog_scene[i].h, leapfrog_scene[i].t, 2, 0.25, LADDER_LAMBDA);
  ladder_expect ("tractor", "leapfrog", 0.01, 1, 2, 0.2, LADDER_Q); /* its motion is prescribed */
}

static void test_residuals (void **state) {
  (void)state;
  for (int i = 0; i < LEAPFROG_SCENES; i++) {
    double h = leapfrog_scene[i].h;
    pw_statistics cost = ladder_run (leapfrog_scene[i].model, "leapfrog", h, 20 * h).cost;
    check_below (leapfrog_scene[i].model, cost.position, 64 * CHECK_EPS, "round-off");
    check_below (leapfrog_scene[i].model, cost.velocity, 64 * CHECK_EPS, "round-off");
    check_below ("evaluations of a step", (double)cost.rhs / (double)cost.steps, 20, "the iteration converges");
  }
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_order),
    cmocka_unit_test (test_residuals),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
