/* Bodies with many elements: a carousel's hub, a table on many legs, a platform on casters.  In large scenes such a
 * body is not condensed.  Results satisfy the independent verifier, and do not depend on the index of that body. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

enum { HUB_ARMS = 14 };

typedef struct {
  double place; /* number of arms before the hub */
} hub_parameters;

static const pw_parameter hub_list[] = {
  { PW_AT (hub_parameters, place), .domain = PW_NONNEGATIVE, .about = "arms before the hub" },
  { .name = NULL },
};

static void hub_body (pw_model *m) {
  pw_add_body (m, &(pw_body){ .name = "hub", .mass = 3, .inertia = 0.7, .rate = { 0.2, 0.1, 0.5 } });
}

/* Adds the arms by `add`, and the hub before the arm with index `place`. */
static void hub_build (pw_model *m, const hub_parameters *p,
                       void (*add) (pw_model *m, const char *arm, double x, double y, double angle)) {
  for (int i = 0; i < HUB_ARMS; i++) {
    char name[20];
    double angle = 2 * PW_PI * i / HUB_ARMS;
    snprintf (name, sizeof name, "arm%d", i);
    if (i == (int)p->place) hub_body (m);
    add (m, name, cos (angle), sin (angle), angle);
  }
  if ((int)p->place == HUB_ARMS) hub_body (m);
}

/* ---- The scenes ---- */

static void hub_seat (pw_model *m, const char *arm, double x, double y, double angle) {
  char joint[40];
  snprintf (joint, sizeof joint, "%s-joint", arm);
  pw_add_body (m,
               &(pw_body){ .name = arm, .mass = 0.4 + 0.1 * x, .inertia = 0.05, .start = { 1.3 * x, 1.3 * y, angle } });
  pw_add_pin (m, &(pw_pin){ .name = joint, .body = { "hub", arm }, .at = { { x, y }, { -0.3, 0 } } });
}

/* Seats that swing freely about a hub that turns and drifts. */
SCENE_WITH (hub_carousel, hub_list, hub_parameters) {
  hub_build (m, p, hub_seat);
  pw_add_force (m, &(pw_force){ .name = "push", .body = "hub", .at = { 0.1, 0 }, .fx = { .constant = 2 } });
}

static void hub_leg (pw_model *m, const char *arm, double x, double y, double angle) {
  char foot[40], knee[40];
  (void)y, (void)angle;
  snprintf (foot, sizeof foot, "%s-foot", arm);
  snprintf (knee, sizeof knee, "%s-knee", arm);
  pw_add_body (m, &(pw_body){ .name = arm, .mass = 0.3, .inertia = 0.02, .start = { x, -0.5, 0.1 * x } });
  pw_add_pin (m, &(pw_pin){ .name = knee, .body = { arm, "hub" }, .at = { { 0, 0.5 }, { x, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = foot, .body = { arm, "ground" }, .at = { { 0, -0.5 }, { x, -1 } } });
}

/* Parallel legs: each leg beyond two adds a redundant row. */
SCENE_WITH (hub_table, hub_list, hub_parameters) {
  hub_build (m, p, hub_leg);
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

/* The same at an angle of 0.1 place: rows are redundant up to round-off. */
SCENE_WITH (hub_leaning, hub_list, hub_parameters) {
  const double angle = 0.1 * p->place, c = cos (angle), s = sin (angle);
  for (int i = 0; i < HUB_ARMS; i++) {
    char leg[20], foot[20], knee[20];
    double x = cos (i);
    snprintf (leg, sizeof leg, "leg%d", i);
    snprintf (foot, sizeof foot, "foot%d", i);
    snprintf (knee, sizeof knee, "knee%d", i);
    pw_add_body (m, &(pw_body){ .name = leg, .mass = 0.3, .inertia = 0.02, .start = { x + 0.5 * s, -0.5 * c, angle } });
    pw_add_pin (m, &(pw_pin){ .name = knee, .body = { leg, "hub" }, .at = { { 0, 0.5 }, { x, 0 } } });
    pw_add_pin (m, &(pw_pin){ .name = foot, .body = { leg, "ground" }, .at = { { 0, -0.5 }, { x + s, -c } } });
  }
  pw_add_body (m, &(pw_body){ .name = "hub", .mass = 3, .inertia = 0.7 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

static void hub_caster (pw_model *m, const char *arm, double x, double y, double angle) {
  char wheel[40], joint[40];
  snprintf (wheel, sizeof wheel, "%s-wheel", arm);
  snprintf (joint, sizeof joint, "%s-joint", arm);
  pw_add_body (m, &(pw_body){ .name = arm, .mass = 0.2, .inertia = 0.01, .start = { x, y, 0.5 + 0.2 * angle } });
  pw_add_pin (m, &(pw_pin){ .name = joint, .body = { arm, "hub" }, .at = { { 0, 0 }, { x, y } } });
  pw_add_wheel (m, &(pw_wheel){ .name = wheel, .body = arm, .at = { -0.2, 0 } });
}

SCENE_WITH (hub_platform, hub_list, hub_parameters) {
  hub_build (m, p, hub_caster);
  pw_add_force (m, &(pw_force){ .name = "push", .body = "hub", .at = { 0.1, 0.4 }, .fx = { .constant = 2 } });
}

/* Attachment points of a joint at a world point, for bodies at angle 0. */
static void hub_join (double at[2][2], const double *one, const double *two, double x, double y) {
  at[0][0] = x - one[0], at[0][1] = y - one[1];
  at[1][0] = x - two[0], at[1][1] = y - two[1];
}

/* A frame whose parts are joined to it and to each other.  For a prescribed frame, which is what their elimination
 * before the frame amounts to, several of their rows are dependent. */
SCENE_WITH (hub_frame, hub_list, hub_parameters) {
  const double hub[] = { 1.33, 0.32 }, rail[] = { 1.07, 1.8 }, bar[] = { 1.99, 1.23 }, tail[] = { 0.87, -0.78 };
  const double side[] = { 0.57, 1.86 }, world[] = { 0, 0 };
  pw_add_body (m, &(pw_body){ .name = "side", .mass = 0.7, .inertia = 0.21, .start = { side[0], side[1] } });
  pw_add_body (m, &(pw_body){ .name = "hub", .mass = 2, .inertia = 0.44, .start = { hub[0], hub[1] } });
  pw_add_body (m, &(pw_body){ .name = "rail", .mass = 2.2, .inertia = 0.5, .start = { rail[0], rail[1] } });
  pw_add_body (m, &(pw_body){ .name = "bar", .mass = 2.3, .inertia = 0.26, .start = { bar[0], bar[1] } });
  pw_add_body (m, &(pw_body){ .name = "point", .mass = 0.5, .start = { hub[0], hub[1] } });
  pw_add_body (m, &(pw_body){ .name = "tail", .mass = 2, .inertia = 0.49, .start = { tail[0], tail[1] } });
  pw_slider slider = { .name = "slider", .body = { "rail", "bar" }, .heading = 1.37 };
  hub_join (slider.at, rail, bar, 1.15, 1.25);
  pw_add_slider (m, &slider);
  pw_rod rod = { .name = "rod", .body = { "hub", "ground" }, .length = hypot (0.37, 1.37) };
  hub_join (rod.at, hub, world, 1.7, 0.87);
  rod.at[1][0] += 0.37, rod.at[1][1] += 1.37;
  pw_add_rod (m, &rod);
  pw_pin joint[] = { { .name = "joint1", .body = { "bar", "point" } },
                     { .name = "joint2", .body = { "side", "hub" } } };
  hub_join (joint[0].at, bar, hub, 2.07, 1.87);
  hub_join (joint[1].at, side, hub, 0.65, 1.83);
  pw_weld weld[] = { { .name = "weld1", .body = { "hub", "point" } }, { .name = "weld2", .body = { "side", "bar" } } };
  hub_join (weld[0].at, hub, hub, 1.2, 0.2);
  hub_join (weld[1].at, side, bar, 0.34, 1.56);
  for (int i = 0; i < 2; i++) pw_add_pin (m, &joint[i]), pw_add_weld (m, &weld[i]);
  pw_add_gear (m, &(pw_gear){ .name = "gear", .body = { "point", "hub", "ground" }, .ratio = 1 });
  pw_slot slot = { .name = "slot", .body = { "tail", "point" }, .heading = 2.5 };
  hub_join (slot.at, tail, hub, 0.74, -0.31);
  pw_add_slot (m, &slot);
  pw_add_rolling_wheel (
      m, &(pw_rolling_wheel){
             .name = "wheel", .body = "bar", .at = { 0.1, -0.17 }, .heading = 2, .radius = 0.2, .inertia = 0.04 });
  pw_add_pfaffian (
      m, &(pw_pfaffian){
             .name = "link", .body = { "bar", "hub" }, .a = { -0.35, -0.67, 0.26 }, .b = { -0.47, 0.63, 0.41 } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 1.6, -4.1 } });
}

/* ---- Tests ---- */

/* Verifies a short run with the hub at index `place`; returns the hub's final state. */
static void hub_run (const pw_plugin_table *table, double place, double hub[6]) {
  static const char *const name[] = { "hub.x", "hub.y", "hub.phi", "hub.vx", "hub.vy", "hub.omega" };
  pw_system *s = scene_system (table, "place", place, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01, .span = 0.2 });
  pw_sample x = runs_to (r, 0.2);
  trial_verify (s, r, &x, 1e4 * CHECK_EPS, "round-off of a projected state");
  for (int i = 0; i < 6; i++) hub[i] = trial_state (s, &x, name[i]);
  pw_run_close (r);
  pw_system_free (s);
}

static void hub_everywhere (const pw_plugin_table *table) {
  double first[6], other[6];
  hub_run (table, 0, first);
  for (int i = 0; i < 2; i++) {
    hub_run (table, i ? HUB_ARMS : HUB_ARMS / 2, other);
    for (int k = 0; k < 6; k++) check_close ("the hub's motion", other[k], first[k], 1e-10, "1e6 eps, over 20 steps");
  }
  assert_true (hypot (first[0], first[1]) > 1e-3); /* it has moved */
}

TEST (carousel) {
  hub_everywhere (&hub_carousel_table);
}

TEST (table) {
  hub_everywhere (&hub_table_table);
}

/* Redundant rows are found at every angle, whatever the round-off. */
TEST (leaning) {
  double hub[6];
  for (int place = 1; place <= 12; place++) hub_run (&hub_leaning_table, place, hub);
}

TEST (platform) {
  hub_everywhere (&hub_platform_table);
}

TEST (frame) {
  double hub[6];
  hub_run (&hub_frame_table, 0, hub);
}
