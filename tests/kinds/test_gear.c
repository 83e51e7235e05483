/* gear: a reduction, a planetary set, offsets, invalid gears. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

#define GEAR_CONSTANT(x) \
  { PW_CONSTANT, .constant = x }

typedef struct {
  double ratio, from, offset, held; /* from: an offset choice of pw_gear; held: see gear_list */
} gear_parameters;

static const pw_parameter gear_list[] = {
  { PW_AT (gear_parameters, ratio), -3, "", "of the speeds", PW_REAL },
  { PW_AT (gear_parameters, from), 0, "", "pw_gear.from", PW_NONNEGATIVE },
  { PW_AT (gear_parameters, offset), 0, "rad", "of the gear", PW_REAL },
  { PW_AT (gear_parameters, held), 0, "", "1: the ring is fixed, 0: the carrier", PW_NONNEGATIVE },
  { .name = NULL },
};

static const double gear_I[2] = { 0.2, 1.1 }, gear_T = 0.7;

/* Two bodies pinned to the ground, the first one driven by a torque.  The second one is a gear or the carrier. */
SCENE_WITH (gear_build, gear_list, gear_parameters) {
  pw_add_body (m, &(pw_body){ .name = "in", .mass = 1, .inertia = gear_I[0], .start = { 0, 0, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "out", .mass = 1, .inertia = gear_I[1], .start = { 2, 0, -0.3 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "in", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "Q", .body = { "out", "ground" }, .at = { { 0, 0 }, { 2, 0 } } });
  pw_add_gear (m, &(pw_gear){ .name = "gear",
                              .body = { "in", p->held > 0 ? "ground" : "out", p->held > 0 ? "out" : "ground" },
                              .ratio = p->ratio,
                              .from = (int)p->from,
                              .offset = p->offset });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "in", "ground" }, .value = GEAR_CONSTANT (gear_T) });
}

/* phi_in' = i phi_out':  (I_in + I_out / i^2) phi_in'' = T;  with a fixed ring phi_in' = (1 - i) phi_out' (Willis). */
static void gear_turn (double ratio, double held) {
  pw_system *s = scene_system (&gear_build_table, "ratio", ratio, "held", held, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-2, .ledger = 1 });
  const double bound = 1e5 * CHECK_EPS;
  const char *reason = "RK4 is exact for parabolas: round-off of 200 steps";
  double i = held > 0 ? 1 - ratio : ratio, a = gear_T / (gear_I[0] + gear_I[1] / (i * i));
  check_below ("start", pw_run_initial (r)->position, 16 * CHECK_EPS, "the offset is that of the initial angles");
  pw_sample x = runs_to (r, 2);
  check_close ("in", x.q[2], 0.4 + 2 * a, bound, reason);
  check_close ("out", x.q[5], -0.3 + 2 * a / i, bound, reason);
  check_close ("rate", x.v[5], 2 * a / i, bound, reason);
  check_close ("moment", trial_reaction (s, &x, "gear.M"), gear_I[0] * a - gear_T, bound, reason);
  check_close ("work", x.work, gear_T * 2 * a, bound, reason);
  check_close ("balance", x.balance, 0, bound, reason);
  runs_close (r, s);
}

TEST (turn) {
  gear_turn (-3, 0);
  gear_turn (2.5, 0);
  gear_turn (-3, 1);
  gear_turn (2.5, 1);
}

/* The initial angles do not have the given offset: the first one is kept. */
TEST (offset) {
  pw_system *s = scene_system (&gear_build_table, "from", (double)PW_GEAR_OFFSET, "offset", 0.25, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-2 });
  const double *q = pw_run_initial (r)->q;
  check_close ("offset", q[2] + 3 * q[5], 0.25, 100 * CHECK_EPS, "the constraint");
  assert_true (q[2] == 0.4);
  runs_close (r, s);
}

SCENE (gear_twice) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1 });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1 });
  pw_add_gear (m, &(pw_gear){ .name = "gear", .body = { "a", "b", "a" }, .ratio = 2 });
}

TEST (refused) {
  scene_refused (scene_model (&gear_build_table, "ratio", 0.0, NULL),
                 "model scene: gear gear: ratio = 0: expected another number, positive or negative");
  scene_refused (scene_model (&gear_build_table, "offset", 0.25, NULL),
                 "model scene: gear gear: offset = 0.25: has no effect without from: offset");
  scene_refused (scene_model (&gear_twice_table, NULL),
                 "model scene: gear gear: two of its bodies are \"a\": expected different ones");
}

/* ---- By all methods: a sun, a planet on a carrier, a ring, all of which can turn ---- */

SCENE (gear_planetary) {
  const double sun = 0.3, planet = 0.2, ring = sun + 2 * planet, arm = sun + planet;
  pw_add_body (m, &(pw_body){ .name = "sun", .mass = 1, .inertia = 0.1 });
  pw_add_body (m, &(pw_body){ .name = "ring", .mass = 2, .inertia = 0.6, .rate = { 0, 0, 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "carrier", .mass = 0.5, .inertia = 0.05 });
  pw_add_body (m, &(pw_body){ .name = "planet", .mass = 0.4, .inertia = 0.01, .start = { arm } });
  static const char *const name[] = { "sun", "ring", "carrier" }, *const pin[] = { "A", "B", "C" };
  for (int i = 0; i < 3; i++) pw_add_pin (m, &(pw_pin){ .name = pin[i], .body = { name[i], "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "planet", "carrier" }, .at = { { 0, 0 }, { arm, 0 } } });
  pw_add_gear (m, &(pw_gear){ .name = "inner", .body = { "sun", "planet", "carrier" }, .ratio = -planet / sun });
  pw_add_gear (m, &(pw_gear){ .name = "outer", .body = { "ring", "planet", "carrier" }, .ratio = planet / ring });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "sun", "ring" }, .value = GEAR_CONSTANT (0.3) });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

TEST (methods) {
  trial (&gear_planetary_table, 1.5);
}
