/* The benchmark suite: its stiff scenes are as stiff as stated, and its scripts are valid. */
#include <stdio.h>
#include "check.h"
#include "cli.h"

/* Evaluations of a run of a stiff scene to the end.  At a loose tolerance what tyres lose is not resolved where
 * stability decides on the steps, and the run says so. */
static double bench_evaluations (const char *scene, const char *method, const char *rtol) {
  cli_shell (check_text ("pinwheel run ./benchmarks/scenes/stiff-%s.yaml --method %s --rtol %s --t-end 1 --json -",
                         scene, method, rtol));
  return cli_number (cli_out, "statistics", "rhs", NULL);
}

/* Stability decides on an explicit method's steps, whatever the tolerance; an implicit one takes far fewer. */
TEST (stiff) {
  static const char *const scene[] = { "tyres", "steering", "bushings" };
  for (int i = 0; i < 3; i++) {
    double loose = bench_evaluations (scene[i], "erk5+projection", "1e-3"),
           tight = bench_evaluations (scene[i], "erk5+projection", "1e-5"),
           implicit = bench_evaluations (scene[i], "ida+ggl", "1e-5");
    check_below ("evaluations at 1e-5 over 1e-3", tight / loose, 1.2, "accuracy alone would ask for 2.5 times as many");
    check_below ("implicit over explicit", implicit / tight, 0.02, "ten times less time, at five times the cost each");
  }
}

TEST (scripts) {
  cli_good ("for f in benchmarks/*.sh benchmarks/*/*.sh; do sh -n $f || exit 1; done");
}

const check_fixture fixture = { cli_setup, cli_teardown };
