/* Solutions of the saddle-point system for random linkages, with and without massless links. */
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

/* ---- Linkages: trees of pinned bars, with further pins that close loops ---- */

enum { LINKAGE_MOST = 40 };

typedef struct {
  double seed;
} linkage;

/* Adds a pin at the world point (x, y) between two bars at known positions, or a bar and the ground (-1). */
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

static const pw_parameter linkage_list[] = {
  { PW_AT (linkage, seed), .domain = PW_NONNEGATIVE, .about = "number of the linkage" },
  { .name = NULL },
};

/* Most bars are pinned to the end of the previous one, so that there are chains. */
SCENE_WITH (linkage_build, linkage_list, linkage) {
  unsigned random = (unsigned)p->seed * 2654435761U;
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

/* Bars with mass, connected by massless links: one with a wheel, one as a rod, or two in series. */
SCENE_WITH (linkage_build_massless, linkage_list, linkage) {
  unsigned random = (unsigned)p->seed * 2654435761U;
  double at[LINKAGE_MOST][3] = { { 0 } };
  const double (*there)[3] = (const double (*)[3])at;
  int massive = 2 + (int)(2 * fabs (saddle_number (&random))), links = 1 + (int)(5 * fabs (saddle_number (&random)));
  int bodies = massive + 2 * links, pins = 0;
  for (int i = 0; i < bodies; i++)
    for (int k = 0; k < 3; k++) at[i][k] = 3 * saddle_number (&random);
  for (int i = 0, next = massive; i < massive + links; i++) {
    double x = at[i][0] + saddle_number (&random), y = at[i][1] + saddle_number (&random),
           mass = i < massive ? 1 + i : 0;
    int a = (int)(massive * fabs (saddle_number (&random))), b = (int)(massive * fabs (saddle_number (&random)));
    int what = i < massive ? -1 : (int)(3 * fabs (saddle_number (&random))), body = i < massive ? i : next++;
    char name[12];
    for (int n = body; n <= body + (what == 2); n++) {
      snprintf (name, sizeof name, "b%d", n);
      pw_add_body (
          m,
          &(pw_body){ .name = name, .mass = mass, .inertia = 0.1 * mass, .start = { at[n][0], at[n][1], at[n][2] } });
    }
    if (what >= 0) linkage_pin (m, there, pins++, body, a, x, y);
    if (what == 0)
      pw_add_wheel (
          m, &(pw_wheel){ .name = check_text ("w%d", body), .body = name, .at = { 0.3, 0.1 * y }, .heading = x });
    if (what == 1) linkage_pin (m, there, pins++, body, b, 1 - 0.7 * y, 1.3 * x * y);
    if (what == 2) {
      linkage_pin (m, there, pins++, body, next, x + y, x - y);
      linkage_pin (m, there, pins++, next++, b, 1 - 0.7 * y, 1.3 * x * y);
    }
  }
}

static void linkage_each (const char *what, const pw_plugin_table *table, int seeds, int all) {
  for (int seed = 1; seed <= seeds; seed++) {
    double e = saddle_scene (scene_system (table, "seed", (double)seed, NULL), 0, all);
    assert_true (e >= 0);
    check_below (what, e, 1e6 * CHECK_EPS, "round-off, rows nearly dependent");
  }
}

TEST (linkages) {
  linkage_each ("a linkage", &linkage_build_table, 200, 1);
  linkage_each ("a linkage with massless links", &linkage_build_massless_table, 300, 0);
}
