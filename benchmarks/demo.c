/* demo: 100 s of the EzyRoller by three methods, with their errors, residuals, energy defects and processor times.
 *
 * Errors refer to digits computed in quadruple precision (tests/reference/ezyroller.txt). */
#include <math.h>
#include "bench.h"
#include "timing.h"

enum { DEMO_STATES = 4, DEMO_SECONDS = 100, DEMO_EARLY = 10 };

/* The states that are compared, and their values after DEMO_EARLY and DEMO_SECONDS. */
static const char *const demo_state[DEMO_STATES] = { "frame.x", "frame.y", "frame.phi", "steer.phi" };
static const double demo_early[DEMO_STATES] = { 2.27902444574858284, -1.8222881760602055, -0.681288187023116242,
                                                2.55912415356338929 },
                    demo_end[DEMO_STATES] = { 90.2539368263945765, -90.2403426831977642, -0.736895723276721331,
                                              2.3821725993174651 };

typedef struct {
  const char *method;
  double step, rtol;
} demo_case;

typedef struct {
  double early[DEMO_STATES], end[DEMO_STATES]; /* states after DEMO_EARLY and DEMO_SECONDS */
  double balance;                              /* largest |energy defect| of the samples, one per second [J] */
  double cpu;                                  /* [s] */
  pw_statistics statistics;
} demo_result;

static void demo_copy (const pw_system *s, const pw_sample *sample, double state[DEMO_STATES]) {
  for (int i = 0; i < DEMO_STATES; i++) state[i] = sample->q[pw_system_find_state (s, demo_state[i], NULL)];
}

static demo_result demo_run (const demo_case *c) {
  pw_error error = { 0 };
  bench_scene scene = bench_open ("ezyroller");
  pw_settings settings = { .span = DEMO_SECONDS, .step = c->step, .rtol = c->rtol, .atol = c->rtol, .ledger = 1 };
  demo_result result = { .cpu = 0 };
  double start = timing_now ();
  pw_run *r = pw_run_open (scene.system, c->method, &settings, &error);
  for (int second = 1; r && second <= DEMO_SECONDS; second++) {
    pw_sample sample;
    if (pw_run_advance_to (r, second, DEMO_SECONDS, &error) != PW_OK ||
        pw_run_sample (r, second, &sample, &error) != PW_OK)
      break;
    result.balance = fmax (result.balance, fabs (sample.balance));
    if (second == DEMO_EARLY) demo_copy (scene.system, &sample, result.early);
    if (second == DEMO_SECONDS) demo_copy (scene.system, &sample, result.end);
  }
  result.cpu = timing_now () - start;
  if (error.status != PW_OK) bench_fail (c->method, &error);
  result.statistics = *pw_run_statistics (r);
  pw_run_close (r);
  bench_close (&scene);
  return result;
}

static double demo_distance (const double a[DEMO_STATES], const double b[DEMO_STATES]) {
  double worst = 0;
  for (int i = 0; i < DEMO_STATES; i++) worst = fmax (worst, fabs (a[i] - b[i]));
  return worst;
}

int main (void) {
  static const demo_case cases[] = { { "rk4+projection", 1e-3, 0 },
                                     { "ida+baumgarte", 0, 1e-10 },
                                     { "ida+ggl", 0, 1e-10 } };
  printf ("EzyRoller, %d s from rest, steering assembly without mass\n\n", DEMO_SECONDS);
  printf ("%-15s %-12s %8s %9s | %9s %9s | %9s %10s | %9s | %6s\n", "method", "", "steps", "rhs", "error", "error",
          "worst", "worst", "energy", "CPU");
  printf ("%-15s %-12s %8s %9s | %9s %9s | %9s %10s | %9s | %6s\n", "", "", "", "", "10 s", "100 s", "|g| [m]",
          "|Jv| [m/s]", "gap [J]", "[s]");
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    demo_result d = demo_run (&cases[i]);
    char setting[32];
    snprintf (setting, sizeof setting, cases[i].step > 0 ? "h = %.0e s" : "rtol %.0e",
              cases[i].step > 0 ? cases[i].step : cases[i].rtol);
    printf ("%-15s %-12s %8ld %9ld | %9.1e %9.1e | %9.1e %10.1e | %9.1e | %6.2f\n", cases[i].method, setting,
            d.statistics.steps, d.statistics.rhs, demo_distance (d.early, demo_early), demo_distance (d.end, demo_end),
            d.statistics.g, d.statistics.jv, d.balance, d.cpu);
  }
  printf (
      "\nError: the largest of x1, y1 [m], phi1, phi2 [rad], against digits in quadruple precision; |g|, |Jv|: over "
      "all accepted steps.\n");
  return 0;
}
