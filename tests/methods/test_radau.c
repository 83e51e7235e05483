#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "check.h"
#include "ladder.h"
static void test_x (void **state) {
  (void)state;
  static const struct { const char *m; double h, t; } sc[] = { { "ezyroller", 0.2, 2 }, { "n-trailer", 0.1, 1 }, { "pendulum", 0.1, 1 }, { "n-four-bar", 0.1, 0.4 }, { "arm", 0.1, 1 }, { "tractor", 0.1, 1 }, { "snakeboard", 0.1, 1 }, { "redundant-parallelogram", 0.05, 0.5 }, {"chaplygin-sleigh",.4,4}};
  static const char *const f[] = { "radau+ggl:steps=fixed", "radau+index2:steps=fixed", "radau+index3:steps=fixed" };
  for (int k = 0; k < 3; k++)
  for (int i = 0; i < 9; i++) {
    printf ("%s %s\n", f[k], sc[i].m);
    ladder_error e[5];
    for (int j = 0; j < 5; j++) {
      e[j] = ladder_run (sc[i].m, f[k], ldexp (sc[i].h, -j), sc[i].t);
      printf ("  %8.1e %8.1e %8.1e", e[j].q, e[j].v, e[j].lambda);
      if (j) printf ("   %5.2f %5.2f %5.2f", log2 (e[j-1].q/e[j].q), log2 (e[j-1].v/e[j].v), log2 (e[j-1].lambda/e[j].lambda));
      printf ("  rhs/step %.1f pos %.1e vel %.1e bal\n", (double)e[j].cost.rhs / e[j].cost.steps, e[j].cost.position, e[j].cost.velocity);
    }
  }
}
int main (void) {
  const struct CMUnitTest tests[] = { cmocka_unit_test (test_x) };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
