/* demo: the EzyRoller for its 100 s by three methods, and what the accuracy of each costs.
 *
 * The error after 10 s is against digits computed in quadruple precision, the one after 100 s against rk4+projection
 * with a step that is five times smaller. */
#include <math.h>
#include "bench.h"

enum { DEMO_STATES = 4, DEMO_SECONDS = 100, DEMO_PUBLISHED = 10 };

/* x1, y1, phi1, phi2 and the kinetic energy after 10 s. */
static const char *const demo_state[DEMO_STATES] = { "frame.x", "frame.y", "frame.phi", "steer.phi" };
static const double demo_published[DEMO_STATES] = { 2.27902444574858284, -1.8222881760602055, -0.681288187023116242,
                                                    2.55912415356338929 };

typedef struct {
  const char *method;
  double step, rtol;
} demo_case;

typedef struct {
  double state[2][DEMO_STATES]; /* after 10 s, and at the end */
  double balance;               /* worst |energy balance|, looked at once a second [J] */
  double cpu;                   /* [s] */
  pw_statistics statistics;
} demo_result;

static void demo_keep (const pw_system *s, const pw_sample *sample, double state[DEMO_STATES]) {
  for (int i = 0; i < DEMO_STATES; i++) state[i] = sample->q[pw_system_find_state (s, demo_state[i], NULL)];
}

static demo_result demo_run (const demo_case *c) {
  pw_error error = { 0 };
  bench_scene scene = bench_open ("ezyroller");
  pw_settings settings = { .span = DEMO_SECONDS, .step = c->step, .rtol = c->rtol, .atol = c->rtol, .ledger = 1 };
  demo_result result = { .cpu = 0 };
  double start = bench_clock ();
  pw_run *r = pw_run_open (scene.system, c->method, &settings, &error);
  for (int second = 1; r && second <= DEMO_SECONDS; second++) {
    pw_sample sample;
    if (pw_run_advance_to (r, second, DEMO_SECONDS, &error) != PW_OK ||
        pw_run_sample (r, second, &sample, &error) != PW_OK)
      break;
    result.balance = fmax (result.balance, fabs (sample.balance));
    if (second == DEMO_PUBLISHED) demo_keep (scene.system, &sample, result.state[0]);
    if (second == DEMO_SECONDS) demo_keep (scene.system, &sample, result.state[1]);
  }
  result.cpu = bench_clock () - start;
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
  demo_result reference = demo_run (&(demo_case){ "rk4+projection", 2e-4, 0 });
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    demo_result d = demo_run (&cases[i]);
    char how[32];
    snprintf (how, sizeof how, cases[i].step > 0 ? "h = %.0e s" : "rtol %.0e",
              cases[i].step > 0 ? cases[i].step : cases[i].rtol);
    printf ("%-15s %-12s %8ld %9ld | %9.1e %9.1e | %9.1e %10.1e | %9.1e | %6.2f\n", cases[i].method, how,
            d.statistics.steps, d.statistics.rhs, demo_distance (d.state[0], demo_published),
            demo_distance (d.state[1], reference.state[1]), d.statistics.g, d.statistics.jv, d.balance, d.cpu);
  }
  printf ("\nError: the largest of x1, y1 [m], phi1, phi2 [rad]; |g|, |Jv|: over all accepted steps.\n");
  return 0;
}
