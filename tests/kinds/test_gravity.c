/* gravity: free fall, a pendulum, a knife edge on an incline. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

/* ---- Free fall ---- */

SCENE (gravity_fall) {
  pw_add_body (m, &(pw_body){ .name = "stone", .mass = 3, .inertia = 0.1, .start = { 1, 2 }, .rate = { 4, 5, 6 } });
  pw_add_body (m, &(pw_body){ .name = "wing", .start = { 1.5, 2 } });
  pw_add_weld (m, &(pw_weld){ .name = "W", .body = { "stone", "wing" }, .at = { { 0.5, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0.5, -9.81 } });
}

/* The centre of mass moves on a parabola, which rk4 integrates exactly; the wing is massless. */
TEST (fall) {
  pw_system *s = scene_system (&gravity_fall_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01, .ledger = 1 });
  pw_sample x = runs_to (r, 2);
  double bound = 200 * 8 * CHECK_EPS, size = 20;
  check_close ("x", trial_state (s, &x, "stone.x"), 1 + 4 * 2 + 0.5 * 0.5 * 4, size * bound, "round-off of 200 steps");
  check_close ("y", trial_state (s, &x, "stone.y"), 2 + 5 * 2 - 0.5 * 9.81 * 4, size * bound, "round-off of 200 steps");
  check_close ("phi", trial_state (s, &x, "stone.phi"), 12, size * bound, "round-off of 200 steps");
  check_close ("potential", x.potential, -3 * (0.5 * x.q[0] - 9.81 * x.q[1]), 1e3 * CHECK_EPS, "-m a . r");
  check_close ("balance", x.balance, 0, 1e3 * bound, "round-off of an energy of 1 kJ");
  for (int k = 0; k < s->batches; k++)
    if (s->batch[k].kind == &pw_kind_gravity) assert_int_equal (s->batch[k].b.count, 1);
  runs_close (r, s);
}

/* ---- Knife edge on an incline: x = k sin^2 wt, y = k (wt - sin (2wt) / 2), k = g sin alpha / 2w^2 ---- */

SCENE (gravity_incline) {
  pw_add_body (m, &(pw_body){ .name = "skate", .mass = 2, .inertia = 0.3, .rate = { 0, 0, 1 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "skate" });
  pw_add_gravity (m, &(pw_gravity){ .name = "slope", .acceleration = { 9.81 * 0.5, 0 } });
}

static void gravity_skate (const char *method, double bound, const char *reason) {
  pw_system *s = scene_system (&gravity_incline_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 10, .ledger = 1 });
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    double k = 9.81 * 0.5 / 2;
    check_close ("x", x.q[0], k * sin (t) * sin (t), bound, reason);
    check_close ("y", x.q[1], k * (t - sin (2 * t) / 2), bound, reason);
    check_close ("|lambda|", fabs (x.lambda[0]), 2 * 2 * 9.81 * 0.5 * fabs (sin (t)), 20 * bound, reason);
    check_close ("balance", x.balance, 0, 20 * bound, reason);
    if (t < 10) continue;
    check_close ("x (10 s)", x.q[0], 0.7258393717013280771, bound, reason);
    check_close ("y (10 s)", x.q[1], 23.40550088629524659, bound, reason);
  }
  runs_close (r, s);
}

TEST (incline) {
  gravity_skate ("rk4+projection", 1e-10, "100 h^4 at h = 1e-3");
  gravity_skate ("ida+ggl", 1e-6, "1e4 rtol");
  gravity_skate ("ida+baumgarte", 1e-6, "1e4 rtol");
}

/* ---- A pendulum of a point mass on a massless rod, from the horizontal (IFToMM A01) ---- */

SCENE (gravity_pendulum) {
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .start = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "bob", "ground" }, .at = { { -1, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

TEST (pendulum) {
  pw_system *s = scene_system (&gravity_pendulum_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample x = runs_to (r, 10);
  check_close ("x", x.q[0], 0.2750874625761168601, 1e-9, "10 (h g/L)^4 at h = 1e-3, over 4 swings");
  check_close ("y", x.q[1], -0.9614192050991250643, 1e-9, "10 (h g/L)^4 at h = 1e-3, over 4 swings");
  check_close ("balance", x.balance, 0, 1e-9, "10 (h g/L)^4");
  runs_close (r, s);
}

/* ---- A user's element type that acts on every body: drag, f = -c v at each centre of mass ---- */

typedef struct {
  const char *name;
  double c; /* [N s/m] */
} gravity_drag;

static int gravity_drag_prepare (const void *definition, const pw_body *const *bodies, void *element,
                                 pw_internal *internal, pw_error *error) {
  *(double *)element = ((const gravity_drag *)definition)->c;
  (void)bodies, (void)internal, (void)error;
  return PW_OK;
}

static void gravity_drag_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const pw_configuration *A = &b->configuration[b->body[e]];
    double c = ((const double *)b->element)[e];
    out[0] = -c * A->vx, out[1] = -c * A->vy, out[2] = 0;
  }
}

static void gravity_drag_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9)
    for (int i = 0; i < 9; i++) out[i] = i == 0 || i == 4 ? -((const double *)b->element)[e] : 0;
}

static void gravity_drag_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    const pw_configuration *A = &b->configuration[b->body[e]];
    out[e] = ((const double *)b->element)[e] * (A->vx * A->vx + A->vy * A->vy);
  }
}

static const pw_field gravity_drag_fields[] = {
  { PW_AT (gravity_drag, c), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE, .about = "force per speed" },
  { .name = NULL },
};

static const pw_kind gravity_kind_drag = {
  .name = "drag",
  .about = "slows down every body",
  .definition = sizeof (gravity_drag),
  .element = sizeof (double),
  .fields = gravity_drag_fields,
  .bodies = 1,
  .each_body = 1,
  .level = PW_FORCE,
  .prepare = gravity_drag_prepare,
  .force = gravity_drag_force,
  .force_v = gravity_drag_force_v,
  .loss = gravity_drag_loss,
};

SCENE (gravity_rain) {
  pw_add_body (m, &(pw_body){ .name = "drop", .mass = 0.5, .inertia = 1, .rate = { 2, 3 } });
  pw_add_body (m, &(pw_body){ .name = "hail", .mass = 2, .inertia = 1 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add (m, &gravity_kind_drag, &(gravity_drag){ .name = "air", .c = 0.8 });
}

/* Each body has its own terminal velocity, v = m g / c (exp (-c t / m) - 1) from rest, and its own ledger entry. */
TEST (each_body) {
  static const double mass[] = { 0.5, 2 }, up[] = { 3, 0 };
  static const char *const entry[] = { "air.drop.loss", "air.hail.loss" };
  pw_system *s = scene_system (&gravity_rain_table, NULL);
  pw_run *r = runs_open (s, "rk4", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample x = runs_to (r, 1);
  assert_int_equal (pw_system_ledger_entries (s), 2);
  for (int i = 0; i < 2; i++) {
    char name[60];
    double end = -mass[i] * 9.81 / 0.8;
    check_close ("vy", x.v[3 * i + 1], end + (up[i] - end) * exp (-0.8 / mass[i]), 1e-11, "10 (h c / m)^4");
    assert_string_equal (pw_system_ledger_name (s, i, name, sizeof name), entry[i]);
    assert_true (x.ledger[i] > 0);
  }
  check_close ("balance", x.balance, 0, 1e-9, "1000 (h c / m)^4");
  runs_close (r, s);
}

static pw_kind gravity_kind_skid;

SCENE (gravity_skid) {
  for (int i = 0; i < 2; i++) pw_add_body (m, &(pw_body){ .name = i ? "hail" : "drop", .mass = 1, .inertia = 1 });
  pw_add (m, &gravity_kind_skid, &(gravity_drag){ .name = "air", .c = 1 });
}

/* Reactions and contact points of such a type have names of their own too. */
TEST (names) {
  gravity_kind_skid = gravity_kind_drag;
  gravity_kind_skid.rows = 1, gravity_kind_skid.level = PW_NONHOLONOMIC, gravity_kind_skid.J = pw_kind_wheel.J;
  gravity_kind_skid.reaction = pw_kind_wheel.reaction, gravity_kind_skid.contact = pw_kind_wheel.contact;
  pw_system *s = scene_system (&gravity_skid_table, NULL);
  assert_int_equal (pw_system_find_reaction (s, "air.hail.N", NULL), 1);
  assert_string_equal (PW_NAME (pw_system_contact_name, s, 3), "air.hail.y");
  pw_system_free (s);
}

TEST (methods) {
  trial (&gravity_pendulum_table, 3);
  trial (&gravity_rain_table, 1);
}
