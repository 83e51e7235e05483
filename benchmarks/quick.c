/* quick: processor time of 100 s of the EzyRoller on this machine, by method; the median of repeated runs. */
#include "bench.h"
#include "timing.h"

enum { QUICK_SECONDS = 100, QUICK_REPEATS = 9 };

typedef struct {
  const char *method;
  double step; /* of rk4 [s]; 0: ida */
  double rtol; /* of ida; 0: rk4 */
  int ledger;  /* 1: integrates the energy ledger, too */
} quick_case;

/* The processor time of one run [s], and its statistics. */
static double quick_run (const quick_case *c, pw_statistics *statistics) {
  pw_error error = { 0 };
  bench_scene scene = bench_open ("ezyroller");
  pw_settings settings = {
    .span = QUICK_SECONDS, .step = c->step, .rtol = c->rtol, .atol = c->rtol, .ledger = c->ledger
  };
  double start = timing_now ();
  pw_run *r = pw_run_open (scene.system, c->method, &settings, &error);
  while (r && pw_run_time (r) < QUICK_SECONDS)
    if (pw_run_advance (r, QUICK_SECONDS, &error) != PW_OK) break;
  double cpu = timing_now () - start;
  if (error.status != PW_OK) bench_fail (c->method, &error);
  *statistics = *pw_run_statistics (r);
  pw_run_close (r);
  bench_close (&scene);
  return cpu;
}

int main (void) {
  static const quick_case cases[] = { { "rk4+projection", 1e-3, 0, 0 }, { "rk4+projection", 1e-3, 0, 1 },
                                      { "rk4+baumgarte", 1e-3, 0, 0 },  { "rk4+none", 1e-3, 0, 0 },
                                      { "ida+baumgarte", 0, 1e-10, 0 }, { "ida+ggl", 0, 1e-10, 0 } };
  printf ("EzyRoller, %d s, median of %d runs (rk4: h = 1e-3 s; ida: rtol 1e-10)\n\n", QUICK_SECONDS, QUICK_REPEATS);
  printf ("%-16s %-7s %9s %9s %9s %9s %9s %9s\n", "method", "energy", "CPU [s]", "least", "steps", "rhs", "ns/step",
          "ns/rhs");
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    pw_statistics n;
    double cpu[QUICK_REPEATS];
    for (int k = 0; k < QUICK_REPEATS; k++) cpu[k] = quick_run (&cases[i], &n);
    double median = timing_median (cpu, QUICK_REPEATS);
    printf ("%-16s %-7s %9.4f %9.4f %9ld %9ld %9.0f %9.0f\n", cases[i].method, cases[i].ledger ? "yes" : "no", median,
            cpu[0] /* sorted */, n.steps, n.rhs, 1e9 * median / (double)n.steps, 1e9 * median / (double)n.rhs);
  }
  printf ("\nns/rhs of rk4+none is the cost of one evaluation of the accelerations and of its share of the step.\n");
  return 0;
}
