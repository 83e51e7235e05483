/* Chains of pinned bodies in large scenes, which have their own elimination: it must find chains and their ends in
 * any description.  Results satisfy the independent verifier and do not depend on the description. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "block_ldl.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* Numbers of bars: those that are eliminated from both ends have a body in the middle, or none. */
static const int chains_bars[] = { 14, 20, 21 };

/* A zigzag of bars that hangs from the ground: in different descriptions, then with a further element. */
enum {
  CHAINS_PLAIN,
  CHAINS_TURNED,    /* order of the two bars of every third pin exchanged */
  CHAINS_BARS_BACK, /* the last bar first */
  CHAINS_PINS_BACK, /* the last pin first */
  CHAINS_SHUFFLED,  /* pins in random order */
  CHAINS_OTHERS,
  CHAINS_BRIDGE = CHAINS_OTHERS, /* the last bar pinned to the ground too */
  CHAINS_BRANCH,                 /* a second chain hangs from an inner bar */
  CHAINS_WHEEL,                  /* an inner bar has a wheel */
  CHAINS_LIGHT,                  /* an inner bar is massless */
  CHAINS_ALL
};

typedef struct {
  double variant, bars;
} chains_parameters;

static double chains_angle (int bar) {
  return bar % 2 ? 0.4 : -0.7;
}

/* Bar i of a chain from (x, y) on, half a metre to either end. */
static void chains_bar (pw_model *m, const char *chain, int i, double x, double y, int massless) {
  char name[20];
  double c = 0, s = 0;
  for (int k = 0; k <= i; k++) {
    double part = k < i ? 1 : 0.5;
    c += part * cos (chains_angle (k)), s += part * sin (chains_angle (k));
  }
  snprintf (name, sizeof name, "%s%d", chain, i);
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = massless ? 0 : 1 + 0.1 * i,
                              .inertia = massless ? 0 : 0.1 + 0.01 * i,
                              .start = { x + c, y + s, chains_angle (i) } });
}

/* The pin between bar i and the previous bar, or the ground. */
static void chains_pin (pw_model *m, const char *chain, int i, const char *from, double at, int turned) {
  char name[20], bar[20], before[20];
  snprintf (name, sizeof name, "%s-pin%d", chain, i);
  snprintf (bar, sizeof bar, "%s%d", chain, i);
  snprintf (before, sizeof before, "%s%d", chain, i - 1);
  if (i > 0) from = before, at = 0.5;
  pw_pin pin = { .name = name, .body = { from, bar }, .at = { { at, 0 }, { -0.5, 0 } } };
  if (turned) pin = (pw_pin){ .name = name, .body = { bar, from }, .at = { { -0.5, 0 }, { at, 0 } } };
  pw_add_pin (m, &pin);
}

/* The right end of bar i. */
static void chains_end (int i, double at[2]) {
  at[0] = at[1] = 0;
  for (int k = 0; k <= i; k++) at[0] += cos (chains_angle (k)), at[1] += sin (chains_angle (k));
}

static void chains_add_element (pw_model *m, int variant, int n) {
  char bar[20];
  double at[2];
  if (variant == CHAINS_BRIDGE) {
    snprintf (bar, sizeof bar, "bar%d", n - 1);
    chains_end (n - 1, at);
    pw_add_pin (m, &(pw_pin){ .name = "end", .body = { bar, "ground" }, .at = { { 0.5, 0 }, { at[0], at[1] } } });
  }
  if (variant == CHAINS_WHEEL) pw_add_wheel (m, &(pw_wheel){ .name = "wheel", .body = "bar7", .at = { 0.1, 0 } });
  if (variant != CHAINS_BRANCH) return;
  snprintf (bar, sizeof bar, "bar%d", n - 4);
  chains_end (n - 4, at);
  for (int i = 0; i < n / 2; i++) chains_bar (m, "twig", i, at[0], at[1], 0);
  for (int i = 0; i < n / 2; i++) chains_pin (m, "twig", i, bar, 0.5, 0);
}

static const pw_parameter chains_list[] = {
  { PW_AT (chains_parameters, variant), .domain = PW_NONNEGATIVE, .about = "number of the scene" },
  { PW_AT (chains_parameters, bars), .value = 14, .domain = PW_COUNT, .about = "number of bars" },
  { .name = NULL },
};

SCENE_WITH (chains_build, chains_list, chains_parameters) {
  const int variant = (int)p->variant, n = (int)p->bars;
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  for (int i = 0; i < n; i++)
    chains_bar (m, "bar", variant == CHAINS_BARS_BACK ? n - 1 - i : i, 0, 0, variant == CHAINS_LIGHT && i == 7);
  for (int i = 0; i < n; i++) {
    int pin = variant == CHAINS_PINS_BACK ? n - 1 - i : variant == CHAINS_SHUFFLED ? 11 * i % n : i;
    chains_pin (m, "bar", pin, "ground", 0, variant == CHAINS_TURNED && i % 3 == 0);
  }
  chains_add_element (m, variant, n);
}

/* ---- Tests ---- */

/* Verifies a short run; returns final states of some bars, and the force in a pin. */
static void chains_run (int variant, int bars, double end[8]) {
  static const char *const name[] = { "bar0.phi", "bar6.x", "bar6.omega", "bar7.phi", "bar13.x", "bar13.vy" };
  pw_system *s = scene_system (&chains_build_table, "variant", (double)variant, "bars", (double)bars, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01, .span = 0.2 });
  pw_sample x = runs_to (r, 0.2);
  trial_verify (s, r, &x, 1e4 * CHECK_EPS, "round-off of a projected state");
  for (int i = 0; i < 6; i++) end[i] = trial_state (s, &x, name[i]);
  end[6] = fabs (trial_reaction (s, &x, "bar-pin6.Fx"));
  end[7] = fabs (trial_reaction (s, &x, "bar-pin6.Fy"));
  pw_run_close (r);
  pw_system_free (s);
}

TEST (same) {
  double first[8], other[8];
  for (size_t k = 0; k < sizeof chains_bars / sizeof *chains_bars; k++) {
    chains_run (CHAINS_PLAIN, chains_bars[k], first);
    assert_true (fabs (first[5]) > 0.1); /* it moves */
    for (int variant = CHAINS_PLAIN + 1; variant < CHAINS_OTHERS; variant++) {
      chains_run (variant, chains_bars[k], other);
      for (int i = 0; i < 8; i++)
        check_close ("end", other[i], first[i], 1e-10 * (1 + fabs (first[i])), "1e6 eps, over 20 steps");
    }
  }
}

TEST (others) {
  double end[8];
  for (size_t k = 0; k < sizeof chains_bars / sizeof *chains_bars; k++)
    for (int variant = CHAINS_OTHERS; variant < CHAINS_ALL; variant++) chains_run (variant, chains_bars[k], end);
}

/* In an elimination from both ends, a pivot that is not a number stays the smallest: that of the first pin. */
TEST (not_a_number) {
  pw_system *s = scene_system (&chains_build_table, "variant", 0., "bars", 14., NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  const pw_chain *chain = r->saddle->block->chain;
  int row;
  assert_true (chain->includes_last);
  assert_int_equal (pw_evaluate_J_at (r->w, 0, r->q, r->v), PW_OK);
  ((double *)(uintptr_t)chain->J_first)[2] = NAN;
  assert_int_equal (pw_saddle_factor (r->saddle), PW_RETRY);
  assert_true (pw_saddle_sine (r->saddle, &row) == 0);
  assert_int_equal (row, chain->unknown);
  runs_close (r, s);
}
