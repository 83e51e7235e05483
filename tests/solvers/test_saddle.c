/* Solutions of the saddle-point system obey it, whatever path they take: with mass and with the metric of projections, all
 * rows and those on positions alone, factorised apart or at once, with forces and without, and behind configurations where they
 * cannot be factorised.
 *
 *   W a + J^T lambda = f,   J a = gamma */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mechanism.h"
#include "method.h"
#include "rk_state.h"
#include "runs.h"
#include "scene.h"

typedef struct {
  pw_run *run;
  const double *weight;
  int rows;
  unsigned random;
} trial;

/* Numbers in [-1, 1], the same on every machine. */
static double saddle_number (unsigned *random) {
  *random = *random * 1664525U + 1013904223U;
  return (double)(*random >> 8) / 8388608.0 - 1;
}

/* The error of the second equation relative to what its terms are, that of the first likewise. */
static double saddle_error (const trial *x, const double *f, const double *gamma, const double *a,
                            const double *lambda) {
  const pw_system *s = x->run->s;
  double most = 0, size = 0, *left = calloc ((size_t)(s->coords + 3 + s->rows), sizeof *left);
  double *Ja = left + s->coords + 3;
  pw_add_JT (x->run->w, lambda, left);
  for (int j = 0; j < s->coords; j++) size = fmax (size, fabs (left[j]) + fabs (x->weight[j] * a[j]));
  for (int j = 0; j < s->coords; j++)
    most = fmax (most, fabs (left[j] + x->weight[j] * a[j] - (f ? f[j] : 0)) / (1 + size));
  pw_mul_J (x->run->w, a, Ja);
  size = 0;
  for (int i = 0; i < x->rows; i++) size = fmax (size, fabs (gamma[i]));
  for (int j = 0; j < s->coords; j++) size = fmax (size, fabs (a[j]));
  for (int i = 0; i < x->rows; i++)
    if (x->run->active == NULL || x->run->active[i]) most = fmax (most, fabs (Ja[i] - gamma[i]) / size);
  free (left);
  return most;
}

/* Factorises at a configuration of which some angles are no numbers, as a step that is far too large leaves it, and comes back. */
static void saddle_spoil (trial *x, pw_saddle *k, unsigned *random) {
  pw_run *r = x->run;
  size_t coords = (size_t)r->s->coords;
  double *q = malloc (coords * sizeof *q);
  for (size_t j = 0; j < coords; j++) q[j] = r->q[j] + saddle_number (random);
  for (size_t j = 2; j < 3 * (size_t)r->s->bodies; j += 3)
    if (saddle_number (random) > 0.3) q[j] = NAN;
  assert_int_equal (pw_update_kinematics (r->w, r->t, q, r->v), PW_OK);
  pw_evaluate_J (r->w);
  pw_saddle_factor (k);
  assert_int_equal (pw_update_kinematics (r->w, r->t, r->q, r->v), PW_OK);
  pw_evaluate_J (r->w);
  free (q);
}

/* Solves in each way; the rows that take no part get no multiplier. */
static double saddle_solve (trial *x) {
  const pw_system *s = x->run->s;
  size_t coords = (size_t)s->coords + 3, rows = (size_t)s->rows;
  double *f = calloc (3 * coords + 3 * rows + 1, sizeof *f), *a = f + coords, *gamma = a + coords;
  double *lambda = gamma + rows, worst = 0;
  pw_error error = { 0 };
  pw_saddle *k = pw_saddle_open (x->run->w, x->weight, x->rows, x->run->active, &error);
  check_ok (k ? PW_OK : error.status, &error);
  for (int way = 0; way < 4; way++) {
    const double *force = way & 1 ? f : NULL;
    if (way > 0) saddle_spoil (x, k, &x->random);
    for (int j = 0; j < s->coords; j++) f[j] = saddle_number (&x->random);
    for (int i = 0; i < s->rows; i++) gamma[i] = saddle_number (&x->random), lambda[i] = 0;
    if (way & 2) {
      assert_int_equal (pw_saddle_factor (k), PW_OK);
      pw_saddle_solve (k, force, gamma, a, lambda);
    } else
      assert_int_equal (pw_saddle_factor_solve (k, force, gamma, a, lambda), PW_OK);
    worst = fmax (worst, saddle_error (x, force, gamma, a, lambda));
  }
  pw_saddle_close (k);
  free (f);
  return worst;
}

/* All saddle-point systems of a scene at its start, and some way into the motion; or those with mass alone.  -1 if it
 * cannot start. */
static double saddle_scene (pw_system *s, double t_end, int all) {
  pw_error error = { 0 };
  pw_run *r = pw_run_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, &error);
  double worst = r ? 0 : -1;
  for (int moment = 0; r && moment < 2; moment++) {
    if (moment > 0) check_ok (pw_run_advance_to (r, t_end, t_end, &error), &error);
    assert_int_equal (pw_update_kinematics (r->w, r->t, r->q, r->v), PW_OK);
    pw_evaluate_J (r->w);
    for (int which = 0; which < 4; which += all ? 1 : 2) {
      trial x = { .run = r, .weight = which & 1 ? s->metric : s->mass, .random = (unsigned)(7 * which + moment) };
      x.rows = which & 2 ? s->holonomic : s->rows;
      int massless = 0;
      for (int j = 0; j < s->coords; j++) massless |= x.weight[j] == 0;
      if (massless && x.rows < s->rows) continue; /* not determined by these rows */
      worst = fmax (worst, saddle_solve (&x));
    }
  }
  if (r) pw_run_close (r);
  pw_system_free (s);
  return worst;
}

static void test_models (void **state) {
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
  (void)state;
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    double e = saddle_scene (scene_named (scene[i].model, scene[i].parameter, scene[i].value), 0.02, 1);
    assert_true (e >= 0);
    check_below (scene[i].model, e, 1e7 * CHECK_EPS, "round-off, weights over a range of 1e6");
  }
}

/* ---- Linkages: trees of pinned bars, some of them closed to loops, some on the ground ---- */

enum { LINKAGE_MOST = 40 };

typedef struct {
  double seed;
} linkage;

/* A pin at a point of the world between two bars that have been placed, or a bar and the ground (-1). */
static void linkage_pin (pw_model *m, const double (*at)[3], int number, int a, int b, double x, double y) {
  char name[3][16];
  pw_pin pin = { .name = name[2], .body = { name[0], name[1] } };
  snprintf (name[2], sizeof name[2], "p%d", number);
  for (int side = 0; side < 2; side++) {
    int i = side ? b : a;
    snprintf (name[side], sizeof name[side], i < 0 ? "ground" : "b%d", i);
    double dx = i < 0 ? x : x - at[i][0], dy = i < 0 ? y : y - at[i][1];
    double c = i < 0 ? 1 : cos (at[i][2]), n = i < 0 ? 0 : sin (at[i][2]);
    pin.at[side][0] = c * dx + n * dy, pin.at[side][1] = c * dy - n * dx;
  }
  pw_add_pin (m, &pin);
}

/* Most bars hang from the end of the one before, so that there are chains. */
static void linkage_build (pw_model *m, const void *parameters) {
  unsigned random = (unsigned)((const linkage *)parameters)->seed * 2654435761U;
  double at[LINKAGE_MOST][3] = { { 0 } };
  int n = 6 + (int)((LINKAGE_MOST - 6) * fabs (saddle_number (&random))), loops = n / 5;
  for (int i = 0; i < n; i++) {
    int from = saddle_number (&random) < 0.6 ? i - 1 : (int)(i * fabs (saddle_number (&random)));
    double x = 0, y = 0;
    if (i > 0) x = at[from][0] + 0.5 * cos (at[from][2]), y = at[from][1] + 0.5 * sin (at[from][2]);
    at[i][2] = 3 * saddle_number (&random);
    at[i][0] = x + 0.5 * cos (at[i][2]), at[i][1] = y + 0.5 * sin (at[i][2]);
    char name[12];
    snprintf (name, sizeof name, "b%d", i);
    pw_add_body (
        m, &(pw_body){ .name = name, .mass = 1 + 0.1 * i, .inertia = 0.1, .start = { at[i][0], at[i][1], at[i][2] } });
    linkage_pin (m, (const double (*)[3])at, i, i > 0 ? from : -1, i, x, y);
  }
  while (loops-- > 0) {
    int a = (int)(n * fabs (saddle_number (&random))), b = (int)(n * fabs (saddle_number (&random)));
    double x = 2 * saddle_number (&random), y = 2 * saddle_number (&random);
    if (a == b) b = -1;
    linkage_pin (m, (const double (*)[3])at, n + loops, a, b, x, y);
  }
}

/* Bars with mass, and between them links without: one with a wheel, one that is a rod, or two in a row. */
static void linkage_build_light (pw_model *m, const void *parameters) {
  unsigned random = (unsigned)((const linkage *)parameters)->seed * 2654435761U;
  double at[LINKAGE_MOST][3] = { { 0 } };
  const double (*there)[3] = (const double (*)[3])at;
  int heavy = 2 + (int)(2 * fabs (saddle_number (&random))), links = 1 + (int)(5 * fabs (saddle_number (&random)));
  int bodies = heavy + 2 * links, pins = 0;
  for (int i = 0; i < bodies; i++)
    for (int k = 0; k < 3; k++) at[i][k] = 3 * saddle_number (&random);
  for (int i = 0, next = heavy; i < heavy + links; i++) {
    double x = at[i][0] + saddle_number (&random), y = at[i][1] + saddle_number (&random), mass = i < heavy ? 1 + i : 0;
    int a = (int)(heavy * fabs (saddle_number (&random))), b = (int)(heavy * fabs (saddle_number (&random)));
    int what = i < heavy ? -1 : (int)(3 * fabs (saddle_number (&random))), body = i < heavy ? i : next++;
    char name[12], wheel[12];
    for (int n = body; n <= body + (what == 2); n++) {
      snprintf (name, sizeof name, "b%d", n);
      pw_add_body (
          m,
          &(pw_body){ .name = name, .mass = mass, .inertia = 0.1 * mass, .start = { at[n][0], at[n][1], at[n][2] } });
    }
    if (what >= 0) linkage_pin (m, there, pins++, body, a, x, y);
    snprintf (wheel, sizeof wheel, "w%d", body);
    if (what == 0) pw_add_wheel (m, &(pw_wheel){ .name = wheel, .body = name, .at = { 0.3, 0.1 * y }, .heading = x });
    if (what == 1) linkage_pin (m, there, pins++, body, b, 1 - 0.7 * y, 1.3 * x * y);
    if (what == 2) {
      linkage_pin (m, there, pins++, body, next, x + y, x - y);
      linkage_pin (m, there, pins++, next++, b, 1 - 0.7 * y, 1.3 * x * y);
    }
  }
}

static const pw_parameter linkage_list[] = {
  { PW_AT (linkage, seed), .domain = PW_NONNEGATIVE, .about = "which one" },
  { .name = NULL },
};

static const pw_plugin_table linkage_table = { .abi = PW_ABI,
                                               .size = sizeof (pw_plugin_table),
                                               .parameters = linkage_list,
                                               .parameters_size = sizeof (linkage),
                                               .build = linkage_build };

static const pw_plugin_table linkage_light_table = { .abi = PW_ABI,
                                                     .size = sizeof (pw_plugin_table),
                                                     .parameters = linkage_list,
                                                     .parameters_size = sizeof (linkage),
                                                     .build = linkage_build_light };

static void linkage_each (const char *what, const pw_plugin_table *table, int seeds, int all) {
  for (int seed = 1; seed <= seeds; seed++) {
    double e = saddle_scene (scene_system (table, "seed", (double)seed, NULL), 0, all);
    assert_true (e >= 0);
    check_below (what, e, 1e6 * CHECK_EPS, "round-off, rows nearly dependent");
  }
}

static void test_linkages (void **state) {
  (void)state;
  linkage_each ("a linkage", &linkage_table, 200, 1);
  linkage_each ("a linkage with massless links", &linkage_light_table, 300, 0);
}

/* ---- Rows without anything to give way ---- */

enum { SADDLE_LINKS = 26, SADDLE_COORDS = 3 * SADDLE_LINKS };

/* Rods instead of the chain's pins. */
static void saddle_rods (pw_model *m, const void *parameters) {
  char name[20], rod[20], before[20] = "ground";
  (void)parameters;
  for (int i = 0; i < SADDLE_LINKS; i++) {
    snprintf (name, sizeof name, "body%d", i);
    snprintf (rod, sizeof rod, "rod%d", i);
    pw_add_body (m, &(pw_body){ .name = name, .mass = 1, .inertia = 0.1, .start = { 1 + i, i % 3, 0 } });
    pw_add_rod (m, &(pw_rod){ .name = rod, .body = { name, before }, .at = { { 0, 0.1 } }, .length = 1 });
    memcpy (before, name, sizeof before);
  }
}

static const pw_plugin_table saddle_rods_table = { .abi = PW_ABI,
                                                   .size = sizeof (pw_plugin_table),
                                                   .build = saddle_rods };

/* The saddle of a scene whose bodies are turned so that nothing is in line, with so many coordinates held from those of a
 * body on. */
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

/* A pin between two bodies that are both held, or between one and the ground, says nothing of the others, which obey
 * theirs. */
static void test_held (void **state) {
  (void)state;
  for (int body = 0; body + 1 < SADDLE_LINKS; body += body > 0 ? 1 : 2) { /* fewer than two links cannot give way */
    double a[SADDLE_COORDS + 3], lambda[2 * SADDLE_LINKS], Ja[2 * SADDLE_LINKS], gamma[2 * SADDLE_LINKS];
    pw_system *s = scene_named ("chain", "n", SADDLE_LINKS);
    pw_workspace *w = pw_workspace_new (s, NULL);
    pw_saddle *k = saddle_turned (w, body, 6);
    for (int i = 0; i < s->rows; i++) gamma[i] = 1 + 0.1 * i, lambda[i] = 2;
    assert_int_equal (pw_saddle_factor_solve (k, NULL, gamma, a, lambda), PW_OK);
    pw_mul_J (w, a, Ja);
    for (int j = 3 * body; j < 3 * body + 6; j++) assert_true (a[j] == 0);
    for (int i = 0; i < s->rows; i++) {
      int pin = i / 2, idle = pin == body + 1 || (pin == 0 && body == 0);
      assert_int_equal (lambda[i] == 0, idle);
      if (!idle) check_close ("J a", Ja[i], gamma[i], 1e4 * CHECK_EPS, "round-off of a chain");
    }
    pw_saddle_close (k);
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

/* A row without entries is singular, wherever it is in the order: 0 out of 0 is no pivot. */
static void test_empty (void **state) {
  (void)state;
  for (int rod = 0; rod < SADDLE_LINKS; rod++) {
    double a[SADDLE_COORDS + 3], lambda[2 * SADDLE_LINKS], gamma[2 * SADDLE_LINKS] = { 1 };
    pw_system *s = scene_system (&saddle_rods_table, NULL);
    pw_workspace *w = pw_workspace_new (s, NULL);
    pw_saddle *k = saddle_turned (w, 0, 0);
    assert_int_equal (pw_saddle_factor (k), PW_OK);
    memset (w->batch[0].J + (ptrdiff_t)rod * w->batch[0].b.cols, 0, (size_t)w->batch[0].b.cols * sizeof (double));
    assert_int_equal (pw_saddle_factor (k), PW_RETRY);
    assert_int_equal (pw_saddle_factor_solve (k, NULL, gamma, a, lambda), PW_RETRY);
    pw_saddle_close (k);
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

/* ---- Rows that follow from others ---- */

typedef struct {
  double angle, mass; /* of the first plate; of its partner */
} bolted;

static const pw_parameter bolted_list[] = {
  { PW_AT (bolted, angle), .unit = "rad", .about = "of the first plate" },
  { PW_AT (bolted, mass), 0, "kg", "of the plates bolted to others", PW_NONNEGATIVE },
  { .name = NULL },
};

/* Pairs of plates about the same centre, bolted to each other, and welded or, without mass, bolted again; each pair is pinned to
 * the one before. */
static void bolted_build (pw_model *m, const bolted *p, int pairs) {
  const double turn = 0.7, c = cos (turn), s = sin (turn);
  char heavy[20], light[20], before[20] = "", name[3][20];
  double x = 0.3, y = -0.2;
  for (int i = 0; i < pairs; i++) {
    double angle = p->angle + i;
    snprintf (heavy, sizeof heavy, "heavy%d", i);
    snprintf (light, sizeof light, "light%d", i);
    for (int k = 0; k < 3; k++) snprintf (name[k], sizeof name[k], "%c%d", "abp"[k], i);
    pw_add_body (m, &(pw_body){ .name = heavy, .mass = 1, .inertia = 0.1, .start = { x, y, angle } });
    pw_add_body (
        m, &(pw_body){ .name = light, .mass = p->mass, .inertia = 0.1 * p->mass, .start = { x, y, angle + turn } });
    pw_add_pin (m, &(pw_pin){ .name = name[0], .body = { heavy, light }, .at = { { 0.7 * c, 0.7 * s }, { 0.7, 0 } } });
    if (p->mass > 0)
      pw_add_weld (m, &(pw_weld){ .name = name[1], .body = { heavy, light }, .angle = turn });
    else
      pw_add_pin (m,
                  &(pw_pin){ .name = name[1], .body = { heavy, light }, .at = { { -0.9 * s, 0.9 * c }, { 0, 0.9 } } });
    if (*before) pw_add_pin (m, &(pw_pin){ .name = name[2], .body = { before, heavy }, .at = { { 0.5, 0.1 } } });
    memcpy (before, heavy, sizeof before);
    x += 0.5 * cos (angle) - 0.1 * sin (angle), y += 0.5 * sin (angle) + 0.1 * cos (angle);
  }
}

static void bolted_pair (pw_model *m, const void *parameters) {
  bolted_build (m, parameters, 1);
}

static void bolted_many (pw_model *m, const void *parameters) {
  bolted_build (m, parameters, SADDLE_LINKS);
}

#define BOLTED_TABLE(f)                                                                                             \
  {                                                                                                                 \
    .abi = PW_ABI, .size = sizeof (pw_plugin_table), .parameters = bolted_list, .parameters_size = sizeof (bolted), \
    .build = f                                                                                                      \
  }

/* What round-off leaves of them is no pivot, whatever the angle; of rows on coordinates without mass alike. */
static void test_dependent (void **state) {
  static const pw_plugin_table table[] = { BOLTED_TABLE (bolted_pair), BOLTED_TABLE (bolted_many) };
  (void)state;
  for (int i = 0; i < 60; i++)
    for (int which = 0; which < 4; which++) {
      pw_error error = { 0 };
      pw_system *s = scene_system (&table[which / 2], "angle", 0.1 * i, "mass", (double)(which % 2), NULL);
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

/* Bars pinned to each other in pairs, of which one does not know of the others. */
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

static void pairs_one (pw_model *m, const void *parameters) {
  pairs_build (m, ((const bolted *)parameters)->angle, 1);
}

static void pairs_many (pw_model *m, const void *parameters) {
  pairs_build (m, ((const bolted *)parameters)->angle, SADDLE_LINKS);
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
  double sine = pw_saddle_pivot (k, &row);
  pw_saddle_close (k);
  pw_workspace_free (w);
  pw_system_free (s);
  return sine;
}

/* The sine between the rows of a pin does not depend on how many other pins there are. */
static void test_sine (void **state) {
  static const pw_plugin_table one = BOLTED_TABLE (pairs_one), many = BOLTED_TABLE (pairs_many);
  (void)state;
  for (int i = 0; i < 16; i++) {
    double sine = pairs_sine (&one, 0.1 * i);
    assert_true (sine > 0.1 && sine < 1);
    check_close ("sine", pairs_sine (&many, 0.1 * i), sine, 1e3 * CHECK_EPS, "round-off, over a sine above 0.1");
  }
}

static void test_random (void **state) {
  int tried = 0;
  double worst = 0;
  (void)state;
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

/* A size that is not a number is not forgotten over those behind it. */
static void test_not_a_number (void **state) {
  (void)state;
  pw_error error = { 0 };
  pw_system *s = scene_named ("theo-jansen", NULL, 0);
  pw_run *r = pw_run_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, &error);
  check_ok (r ? PW_OK : error.status, &error);
  for (int j = 0; j < s->coords; j++) {
    double a = r->a[j];
    r->a[j] = NAN;
    assert_true (isnan (pw_run_acceleration_norm (r)));
    r->a[j] = a;
    r->data->q[j] = NAN;
    assert_true (isnan (pw_rk_distance (r)));
    r->data->q[j] = 0, r->data->v[j] = NAN;
    assert_true (isnan (pw_rk_distance (r)));
    r->data->v[j] = 0;
  }
  assert_true (isfinite (pw_run_acceleration_norm (r)) && isfinite (pw_rk_distance (r)));
  pw_run_close (r);
  pw_system_free (s);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_models), cmocka_unit_test (test_linkages),     cmocka_unit_test (test_held),
    cmocka_unit_test (test_empty),  cmocka_unit_test (test_dependent),    cmocka_unit_test (test_sine),
    cmocka_unit_test (test_random), cmocka_unit_test (test_not_a_number),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
