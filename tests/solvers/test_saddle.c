/* Solutions of the saddle-point system satisfy it: with masses and the metric of projections as weights, with all rows
 * and holonomic rows only, with and without forces, and after configurations
 * where the factorisation fails.
 *
 *   W a + J^T lambda = f,   J a = gamma */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mechanism.h"
#include "method.h"
#include "rk.h"
#include "runs.h"
#include "saddle_scene.h"
#include "scene.h"

TEST (models) {
  static const struct {
    const char *model, *parameter;
    double value;
  } scene[] = {
    { "theo-jansen", NULL, 0 },  { "peaucellier", NULL, 0 },        { "andrews-squeezer", NULL, 0 },
    { "n-four-bar", "N", 2 },    { "n-four-bar", "N", 12 },         { "chain", "n", 30 },
    { "wheeled-snake", "n", 3 }, { "wheeled-snake", "n", 20 },      { "n-trailer", "n", 4 },
    { "ezyroller", NULL, 0 },    { "ezyroller", "m2", 0.1 },        { "car", NULL, 0 },
    { "snakeboard", NULL, 0 },   { "differential-drive", NULL, 0 }, { "redundant-parallelogram", NULL, 0 }
  };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    double e = saddle_scene (scene_named (scene[i].model, scene[i].parameter, scene[i].value), 0.02, 1);
    assert_true (e >= 0);
    check_below (scene[i].model, e, 1e7 * CHECK_EPS, "round-off, weights over a range of 1e6");
  }
}

/* ---- Rows without coordinates that can move ---- */

enum { SADDLE_LINKS = 26, SADDLE_COORDS = 3 * SADDLE_LINKS };

/* A chain with rods instead of pins. */
SCENE (saddle_rods) {
  char name[20], rod[20], before[20] = "ground";
  for (int i = 0; i < SADDLE_LINKS; i++) {
    snprintf (name, sizeof name, "body%d", i);
    snprintf (rod, sizeof rod, "rod%d", i);
    pw_add_body (m, &(pw_body){ .name = name, .mass = 1, .inertia = 0.1, .start = { 1 + i, i % 3, 0 } });
    pw_add_rod (m, &(pw_rod){ .name = rod, .body = { name, before }, .at = { { 0, 0.1 } }, .length = 1 });
    memcpy (before, name, sizeof before);
  }
}

/* The saddle-point system of a scene in a configuration without aligned bodies; `held` coordinates are prescribed,
 * beginning with those of a body. */
static pw_saddle *saddle_turned (pw_workspace *w, int body, int held) {
  const pw_system *s = w->s;
  double weight[SADDLE_COORDS], q[SADDLE_COORDS];
  pw_error error = { 0 };
  assert_true (s->coords == SADDLE_COORDS && s->rows <= 2 * SADDLE_LINKS);
  memcpy (weight, s->mass, sizeof weight);
  for (int j = 3 * body; j < 3 * body + held; j++) weight[j] = INFINITY;
  for (int j = 0; j < SADDLE_COORDS; j++) q[j] = s->q0[j] + (j % 3 == 2 ? j : 0);
  assert_int_equal (pw_update_kinematics (w, 0, q, s->v0), PW_OK);
  pw_evaluate_J (w);
  pw_saddle *k = pw_saddle_open (w, weight, s->rows, NULL, &error);
  check_ok (k ? PW_OK : error.status, &error);
  return k;
}

/* Pins between two prescribed bodies, or one and the ground, are inactive; all others are satisfied. */
TEST (prescribed_bodies) {
  for (int body = 0; body + 1 < SADDLE_LINKS;
       body += body > 0 ? 1 : 2) { /* one link between a prescribed body and the ground could not move */
    double a[SADDLE_COORDS + 3], lambda[2 * SADDLE_LINKS], Ja[2 * SADDLE_LINKS], gamma[2 * SADDLE_LINKS];
    pw_system *s = scene_named ("chain", "n", SADDLE_LINKS);
    pw_workspace *w = pw_workspace_new (s, NULL);
    pw_saddle *k = saddle_turned (w, body, 6);
    for (int i = 0; i < s->rows; i++) gamma[i] = 1 + 0.1 * i, lambda[i] = 2;
    assert_int_equal (pw_saddle_factor (k), PW_OK);
    pw_saddle_solve (k, NULL, gamma, a, lambda);
    pw_mul_J (w, a, Ja);
    for (int j = 3 * body; j < 3 * body + 6; j++) assert_true (a[j] == 0);
    for (int i = 0; i < s->rows; i++) {
      int pin = i / 2, inactive = pin == body + 1 || (pin == 0 && body == 0);
      assert_int_equal (lambda[i] == 0, inactive);
      if (!inactive) check_close ("J a", Ja[i], gamma[i], 1e4 * CHECK_EPS, "round-off of a chain");
    }
    pw_saddle_close (k);
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

/* A row without entries is singular at every place in the order: 0/0 is not a pivot. */
TEST (empty_row) {
  for (int rod = 0; rod < SADDLE_LINKS; rod++) {
    pw_system *s = scene_system (&saddle_rods_table, NULL);
    pw_workspace *w = pw_workspace_new (s, NULL);
    pw_saddle *k = saddle_turned (w, 0, 0);
    assert_int_equal (pw_saddle_factor (k), PW_OK);
    memset (w->batch[0].J + (ptrdiff_t)rod * w->batch[0].b.cols, 0, (size_t)w->batch[0].b.cols * sizeof (double));
    assert_int_equal (pw_saddle_factor (k), PW_RETRY);
    pw_saddle_close (k);
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

/* ---- Redundant rows ---- */

typedef struct {
  double angle, mass; /* angle of the first plate; mass of partners */
} bolted;

static const pw_parameter bolted_list[] = {
  { PW_AT (bolted, angle), .unit = "rad", .about = "of the first plate" },
  { PW_AT (bolted, mass), 0, "kg", "of the plates bolted to others", PW_NONNEGATIVE },
  { .name = NULL },
};

/* Pairs of plates with the same centre, connected by a pin and a weld or, if massless, by two pins; each pair is pinned
 * to the previous one. */
static void bolted_build (pw_model *m, const bolted *p, int pairs) {
  const double turn = 0.7, c = cos (turn), s = sin (turn);
  char plate[20], partner[20], before[20] = "", name[3][20];
  double x = 0.3, y = -0.2;
  for (int i = 0; i < pairs; i++) {
    double angle = p->angle + i;
    snprintf (plate, sizeof plate, "plate%d", i);
    snprintf (partner, sizeof partner, "partner%d", i);
    for (int k = 0; k < 3; k++) snprintf (name[k], sizeof name[k], "%c%d", "abp"[k], i);
    pw_add_body (m, &(pw_body){ .name = plate, .mass = 1, .inertia = 0.1, .start = { x, y, angle } });
    pw_add_body (
        m, &(pw_body){ .name = partner, .mass = p->mass, .inertia = 0.1 * p->mass, .start = { x, y, angle + turn } });
    pw_add_pin (m,
                &(pw_pin){ .name = name[0], .body = { plate, partner }, .at = { { 0.7 * c, 0.7 * s }, { 0.7, 0 } } });
    if (p->mass > 0)
      pw_add_weld (m, &(pw_weld){ .name = name[1], .body = { plate, partner }, .angle = turn });
    else
      pw_add_pin (
          m, &(pw_pin){ .name = name[1], .body = { plate, partner }, .at = { { -0.9 * s, 0.9 * c }, { 0, 0.9 } } });
    if (*before) pw_add_pin (m, &(pw_pin){ .name = name[2], .body = { before, plate }, .at = { { 0.5, 0.1 } } });
    memcpy (before, plate, sizeof before);
    x += 0.5 * cos (angle) - 0.1 * sin (angle), y += 0.5 * sin (angle) + 0.1 * cos (angle);
  }
}

SCENE_WITH (bolted_pair, bolted_list, bolted) {
  bolted_build (m, p, 1);
}

SCENE_WITH (bolted_many, bolted_list, bolted) {
  bolted_build (m, p, SADDLE_LINKS);
}

/* Round-off of a dependent row is not accepted as a pivot at any angle, with and without massless coordinates. */
TEST (dependent_rows) {
  static const pw_plugin_table *const table[] = { &bolted_pair_table, &bolted_many_table };
  for (int i = 0; i < 60; i++)
    for (int which = 0; which < 4; which++) {
      pw_error error = { 0 };
      pw_system *s = scene_system (table[which / 2], "angle", 0.1 * i, "mass", (double)(which % 2), NULL);
      pw_workspace *w = pw_workspace_new (s, NULL);
      assert_int_equal (pw_update_kinematics (w, 0, s->q0, s->v0), PW_OK);
      pw_evaluate_J (w);
      pw_saddle *k = pw_saddle_open (w, s->mass, s->rows, NULL, &error);
      check_ok (k ? PW_OK : error.status, &error);
      assert_int_equal (pw_saddle_factor (k), PW_RETRY);
      pw_saddle_close (k);
      pw_workspace_free (w);
      pw_system_free (s);
    }
}

/* Independent pairs of bars, pinned to each other. */
static void pairs_build (pw_model *m, double angle, int pairs) {
  char a[20], b[20], pin[20];
  for (int i = 0; i < pairs; i++) {
    snprintf (a, sizeof a, "a%d", i);
    snprintf (b, sizeof b, "b%d", i);
    snprintf (pin, sizeof pin, "pin%d", i);
    pw_add_body (m, &(pw_body){ .name = a, .mass = 1, .inertia = 0.01, .start = { 0, 0, angle } });
    pw_add_body (m, &(pw_body){ .name = b, .mass = 2, .inertia = 0.02, .start = { 0, 0, angle } });
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { a, b }, .at = { { 1, 0.2 }, { 1, 0.2 } } });
  }
}

SCENE_WITH (pairs_one, bolted_list, bolted) {
  pairs_build (m, p->angle, 1);
}

SCENE_WITH (pairs_many, bolted_list, bolted) {
  pairs_build (m, p->angle, SADDLE_LINKS);
}

static double pairs_sine (const pw_plugin_table *table, double angle) {
  int row;
  pw_error error = { 0 };
  pw_system *s = scene_system (table, "angle", angle, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  assert_int_equal (pw_update_kinematics (w, 0, s->q0, s->v0), PW_OK);
  pw_evaluate_J (w);
  pw_saddle *k = pw_saddle_open (w, s->mass, s->rows, NULL, &error);
  check_ok (k ? PW_OK : error.status, &error);
  assert_int_equal (pw_saddle_factor (k), PW_OK);
  double sine = pw_saddle_sine (k, &row);
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
  return sine;
}

/* The sine between the rows of a pin does not depend on how many other pins there are. */
TEST (sine) {
  for (int i = 0; i < 16; i++) {
    double sine = pairs_sine (&pairs_one_table, 0.1 * i);
    assert_true (sine > 0.1 && sine < 1);
    check_close ("sine", pairs_sine (&pairs_many_table, 0.1 * i), sine, 1e3 * CHECK_EPS,
                 "round-off, over a sine above 0.1");
  }
}

TEST (random) {
  int tried = 0;
  double worst = 0;
  for (unsigned seed = 1; seed <= 200; seed++) {
    mechanism x;
    pw_error error = { 0 };
    mechanism_make (seed, &x);
    pw_system *s = mechanism_compile (&x, &(mechanism_view){ 0 }, &error);
    if (s == NULL) continue;
    double e = saddle_scene (s, 0, 1);
    worst = fmax (worst, e);
    tried += e >= 0;
  }
  assert_true (tried > 150);
  check_below ("random mechanisms", worst, 1e9 * CHECK_EPS,
               "round-off, weights over a range of 1e6, rows nearly dependent");
}

/* Norms are NaN if any entry is NaN. */
TEST (not_a_number) {
  pw_error error = { 0 };
  pw_system *s = scene_named ("theo-jansen", NULL, 0);
  pw_run *r = pw_run_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, &error);
  check_ok (r ? PW_OK : error.status, &error);
  double q[60] = { 0 }, v[60] = { 0 };
  assert_in_range (s->coords, 1, 60);
  for (int j = 0; j < s->coords; j++) {
    double a = r->a[j];
    r->a[j] = NAN;
    assert_true (isnan (pw_run_acceleration_norm (r)));
    r->a[j] = a;
    q[j] = NAN;
    assert_true (isnan (pw_rk_distance (r, q, v)));
    q[j] = 0, v[j] = NAN;
    assert_true (isnan (pw_rk_distance (r, q, v)));
    v[j] = 0;
  }
  assert_true (isfinite (pw_run_acceleration_norm (r)) && isfinite (pw_rk_distance (r, q, v)));
  pw_run_close (r);
  pw_system_free (s);
}
