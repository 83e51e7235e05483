/* Random mechanisms.  Configurations are random; each joint is at a random world point, transformed to the frames of
 * its bodies, so that all loops are closed initially.  Velocities are random too; the initial conditions make them
 * consistent. */
#include "mechanism.h"
#include <math.h>
#include <string.h>
#include "selftest.h"

static const char *const mechanism_body[MECHANISM_BODIES] = { "b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8" };
static const char *const mechanism_name[MECHANISM_ELEMENTS] = {
  "e0",  "e1",  "e2",  "e3",  "e4",  "e5",  "e6",  "e7",  "e8",  "e9",  "e10", "e11", "e12", "e13",
  "e14", "e15", "e16", "e17", "e18", "e19", "e20", "e21", "e22", "e23", "e24", "e25", "e26", "e27",
  "e28", "e29", "e30", "e31", "e32", "e33", "e34", "e35", "e36", "e37", "e38", "e39"
};

/* A mechanism under construction. */
typedef struct {
  mechanism *x;
  pw_random random;
} make;

static double make_number (make *k, double low, double high) {
  return pw_random_between (&k->random, low, high);
}

/* 0 to n - 1 */
static int make_choice (make *k, int n) {
  int i = (int)make_number (k, 0, n);
  return i < n ? i : n - 1;
}

/* A random body with mass, other than `not`; -1: the ground, if `ground` is 1. */
static int make_partner (make *k, int below, int not, int ground) {
  for (int tries = 0; tries < 50; tries++) {
    int i = make_choice (k, below + ground) - ground;
    if (i < 0 || (i != not &&k->x->body[i].mass > 0)) return i;
  }
  return -1;
}

static const char *make_name (int body) {
  return body < 0 ? "ground" : mechanism_body[body];
}

static double make_angle (const make *k, int body) {
  return body < 0 ? 0 : k->x->body[body].start[2];
}

/* A world point in coordinates of a body's frame. */
static void make_local (const make *k, int body, const double world[2], double at[2]) {
  const double ground[3] = { 0 }, *p = body < 0 ? ground : k->x->body[body].start;
  double c = cos (p[2]), s = sin (p[2]), dx = world[0] - p[0], dy = world[1] - p[1];
  at[0] = c * dx + s * dy;
  at[1] = c * dy - s * dx;
}

/* A random world point near a body. */
static void make_near (make *k, int body, double world[2]) {
  const double *p = k->x->body[body].start;
  world[0] = p[0] + make_number (k, -0.7, 0.7);
  world[1] = p[1] + make_number (k, -0.7, 0.7);
}

/* A new element with a name; NULL if its rows would remove the last degree of freedom. */
static mechanism_element *make_element (make *k, const pw_kind *kind, int rows) {
  mechanism *x = k->x;
  if (x->elements == MECHANISM_ELEMENTS || x->free - rows < 1) return NULL;
  mechanism_element *e = &x->element[x->elements];
  memset (e, 0, sizeof *e);
  e->kind = kind;
  e->pin.name = mechanism_name[x->elements++]; /* the first member of every definition */
  x->free -= rows;
  return e;
}

static pw_signal make_signal (make *k, double size) {
  return (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = make_number (k, -size, size),
                                                 .omega = make_number (k, 1, 4),
                                                 .phase = make_number (k, -PW_PI, PW_PI),
                                                 .offset = make_number (k, -size, size) } };
}

/* ---- Joints between two bodies ---- */

/* The first members of all joints: two bodies, and a point in the frame of each. */
static void make_ends (make *k, int one, int two, const char *body[2], double at[2][2]) {
  double world[2];
  make_near (k, one, world);
  body[0] = make_name (one), body[1] = make_name (two);
  make_local (k, one, world, at[0]);
  make_local (k, two, world, at[1]);
}

static void make_pin (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_pin, 2);
  if (e) make_ends (k, one, two, e->pin.body, e->pin.at);
}

static void make_weld (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_weld, 3);
  if (e == NULL) return;
  make_ends (k, one, two, e->weld.body, e->weld.at);
  e->weld.angle = make_angle (k, two) - make_angle (k, one);
}

static void make_slider (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_slider, 2);
  if (e == NULL) return;
  make_ends (k, one, two, e->slider.body, e->slider.at);
  e->slider.heading = make_number (k, -PW_PI, PW_PI);
  e->slider.angle = make_angle (k, one) - make_angle (k, two);
}

static void make_slot (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_slot, 1);
  if (e == NULL) return;
  make_ends (k, one, two, e->slot.body, e->slot.at);
  e->slot.heading = make_number (k, -PW_PI, PW_PI);
}

static void make_rod (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_rod, 1);
  if (e == NULL) return;
  double a[2], b[2], angle = make_number (k, -PW_PI, PW_PI);
  make_near (k, one, a);
  e->rod.length = make_number (k, 0.5, 2);
  b[0] = a[0] + e->rod.length * cos (angle), b[1] = a[1] + e->rod.length * sin (angle);
  e->rod.body[0] = make_name (one), e->rod.body[1] = make_name (two);
  make_local (k, one, a, e->rod.at[0]);
  make_local (k, two, b, e->rod.at[1]);
}

static void make_gear (make *k, int one, int two) {
  mechanism_element *e = two < 0 ? NULL : make_element (k, &pw_kind_gear, 1);
  if (e == NULL) return;
  e->gear.body[0] = make_name (one), e->gear.body[1] = make_name (two), e->gear.body[2] = "ground";
  e->gear.ratio = make_number (k, 0.4, 2) * (make_choice (k, 2) ? 1 : -1);
}

/* The drive begins at the initial angle. */
static void make_drive (make *k, int one, int two) {
  mechanism_element *e = make_element (k, &pw_kind_drive, 1);
  if (e == NULL) return;
  e->drive.body[0] = make_name (one), e->drive.body[1] = make_name (two);
  e->drive.what = PW_DRIVE_ANGLE;
  e->drive.value = make_signal (k, 0.3);
  e->drive.value.harmonic.offset = make_angle (k, one) - make_angle (k, two) -
                                   e->drive.value.harmonic.amplitude * cos (e->drive.value.harmonic.phase);
}

static void make_joint (make *k, int one, int two, int dice) {
  typedef void joint (make *, int, int);
  static joint *const joints[] = { make_pin,  make_pin, make_pin, make_slider, make_slot,
                                   make_weld, make_rod, make_rod, make_gear,   make_drive };
  joints[dice](k, one, two);
}

/* ---- Wheels and nonholonomic constraints ---- */

static void make_at (make *k, double at[2]) {
  at[0] = make_number (k, -0.5, 0.5);
  at[1] = make_number (k, -0.5, 0.5);
}

static void make_wheel (make *k, int body) {
  mechanism_element *e = make_element (k, &pw_kind_wheel, 1);
  if (e == NULL) return;
  e->wheel.body = make_name (body);
  make_at (k, e->wheel.at);
  e->wheel.heading = make_number (k, -PW_PI, PW_PI);
  if (make_choice (k, 4) > 0 || k->x->elements == MECHANISM_ELEMENTS) return;
  mechanism_element *twin = &k->x->element[k->x->elements]; /* on the same axle: a redundant row */
  *twin = *e;
  twin->wheel.name = mechanism_name[k->x->elements++];
  twin->wheel.at[0] -= 0.3 * sin (e->wheel.heading);
  twin->wheel.at[1] += 0.3 * cos (e->wheel.heading);
}

static void make_rolling_wheel (make *k, int body) {
  mechanism_element *e = make_element (k, &pw_kind_rolling_wheel, 1); /* two rows, an internal coordinate */
  if (e == NULL) return;
  e->rolling_wheel.body = make_name (body);
  make_at (k, e->rolling_wheel.at);
  e->rolling_wheel.heading = make_number (k, -PW_PI, PW_PI);
  e->rolling_wheel.radius = make_number (k, 0.1, 0.4);
  e->rolling_wheel.inertia = make_number (k, 0.01, 0.05);
  e->rolling_wheel.torque = make_signal (k, 0.2);
}

static void make_steered_wheel (make *k, int body) {
  mechanism_element *e = make_element (k, &pw_kind_steered_wheel, 1);
  if (e == NULL) return;
  e->steered_wheel.body = make_name (body);
  make_at (k, e->steered_wheel.at);
  e->steered_wheel.heading = make_signal (k, 0.4);
}

static void make_speed (make *k, int body) {
  mechanism_element *e = make_element (k, &pw_kind_speed, 1);
  if (e == NULL) return;
  e->speed.body = make_name (body);
  make_at (k, e->speed.at);
  e->speed.heading = make_number (k, -PW_PI, PW_PI);
  e->speed.value = make_signal (k, 0.4);
}

static void make_pfaffian (make *k, int body) {
  int other = make_partner (k, k->x->bodies, body, 1);
  mechanism_element *e = other < 0 ? NULL : make_element (k, &pw_kind_pfaffian, 1);
  if (e == NULL) return;
  e->pfaffian.body[0] = make_name (body), e->pfaffian.body[1] = make_name (other);
  for (int i = 0; i < 3; i++) e->pfaffian.a[i] = make_number (k, -1, 1), e->pfaffian.b[i] = make_number (k, -1, 1);
}

static void make_roller (make *k, int body, int dice) {
  typedef void roller (make *, int);
  static roller *const rollers[] = { make_wheel,         make_wheel, make_rolling_wheel,
                                     make_steered_wheel, make_speed, make_pfaffian };
  rollers[dice](k, body);
}

/* ---- Forces ---- */

static void make_two (make *k, const char *body[2]) {
  int one = make_partner (k, k->x->bodies, -1, 0);
  body[0] = make_name (one), body[1] = make_name (make_partner (k, k->x->bodies, one, 1));
}

static void make_force_of_two (make *k, int dice) {
  static const pw_kind *const kinds[] = { &pw_kind_spring, &pw_kind_rotational_spring, &pw_kind_friction,
                                          &pw_kind_torque, &pw_kind_motor };
  mechanism_element *e = make_element (k, kinds[dice], 0);
  if (e == NULL) return;
  make_two (k, e->spring.body); /* the second member of all of these */
  if (dice == 0) {
    make_at (k, e->spring.at[0]), make_at (k, e->spring.at[1]);
    e->spring.stiffness = make_number (k, 1, 20), e->spring.damping = make_number (k, 0, 1), e->spring.length = 0.5;
  }
  if (dice == 1)
    e->rotational_spring.stiffness = make_number (k, 1, 10), e->rotational_spring.damping = make_number (k, 0, 1),
    e->rotational_spring.angle = make_number (k, -1, 1);
  if (dice == 2)
    e->friction.viscous = make_number (k, 0, 0.5), e->friction.limit.constant = make_number (k, 0, 0.3),
    e->friction.speed = 0.1;
  if (dice == 3) e->torque.value = make_signal (k, 1);
  if (dice == 4)
    e->motor.stiffness = make_number (k, 0, 5), e->motor.damping = make_number (k, 0.1, 1),
    e->motor.limit = make_number (k, 1, 3), e->motor.angle = make_signal (k, 0.5);
}

static void make_force_of_one (make *k, int dice) {
  static const pw_kind *const kinds[] = { &pw_kind_force, &pw_kind_drag, &pw_kind_tyre, &pw_kind_rolling_resistance };
  mechanism_element *e = make_element (k, kinds[dice], 0);
  if (e == NULL) return;
  e->force.body = make_name (make_partner (k, k->x->bodies, -1, 0)); /* the second member of all of these */
  if (dice != 1) make_at (k, e->force.at);                           /* the third of all but drag */
  if (dice == 0) {
    e->force.axes = make_choice (k, 2) ? PW_AXES_BODY : PW_AXES_WORLD;
    e->force.fx = e->force.fy = make_signal (k, 1); /* equal phases, so that the force can be rotated */
    e->force.fy.harmonic.amplitude *= 0.6, e->force.fy.harmonic.offset *= 0.6;
  }
  if (dice == 1) e->drag.linear = make_number (k, 0, 0.5), e->drag.quadratic = 0.2, e->drag.turning = 0.1;
  if (dice == 2) e->tyre.heading = make_number (k, -PW_PI, PW_PI), e->tyre.stiffness = 2, e->tyre.speed = 0.3;
  if (dice == 3) e->rolling_resistance.limit = 0.2, e->rolling_resistance.speed = 0.2;
}

/* ---- Mechanisms ---- */

static void make_body (make *k, int i) {
  pw_body *b = &k->x->body[i];
  *b = (pw_body){ .name = mechanism_body[i],
                  .mass = make_number (k, 0.3, 3),
                  .inertia = make_number (k, 0.05, 0.5),
                  .start = { make_number (k, -2, 2), make_number (k, -2, 2), make_number (k, -PW_PI, PW_PI) },
                  .rate = { make_number (k, -1, 1), make_number (k, -1, 1), make_number (k, -1, 1) } };
  k->x->bodies++;
  k->x->free += 3;
}

/* A massless body with a wheel, pinned to another body: pin and wheel determine its motion. */
static void make_steer (make *k, int i) {
  make_body (k, i);
  k->x->body[i].mass = k->x->body[i].inertia = 0;
  make_pin (k, i, make_partner (k, i, i, 0));
  mechanism_element *e = make_element (k, &pw_kind_wheel, 1);
  if (e == NULL) return;
  e->wheel.body = mechanism_body[i];
  make_at (k, e->wheel.at);
  e->wheel.heading = make_number (k, -PW_PI, PW_PI);
}

void mechanism_make (unsigned seed, mechanism *x) {
  make k = { x, { seed } };
  *x = (mechanism){ .bodies = 0 };
  int bodies = 1 + make_choice (&k, MECHANISM_BODIES - 2);
  for (int i = 0; i < bodies; i++) {
    make_body (&k, i);
    if (make_choice (&k, 6) > 0) make_joint (&k, i, make_partner (&k, i, i, 1), make_choice (&k, 8));
  }
  if (x->free >= 2 && make_choice (&k, 3) == 0) make_steer (&k, bodies);
  for (int i = make_choice (&k, 3); i > 0; i--) {
    int one = make_partner (&k, bodies, -1, 0);
    make_joint (&k, one, make_partner (&k, bodies, one, 1), make_choice (&k, 10));
  }
  for (int i = make_choice (&k, 3); i > 0; i--) make_roller (&k, make_choice (&k, bodies), make_choice (&k, 6));
  for (int i = make_choice (&k, 4); i > 0; i--) make_force_of_two (&k, make_choice (&k, 5));
  for (int i = make_choice (&k, 3); i > 0; i--) make_force_of_one (&k, make_choice (&k, 4));
  mechanism_element *e = make_choice (&k, 2) ? make_element (&k, &pw_kind_gravity, 0) : NULL;
  if (e) e->gravity.acceleration[0] = make_number (&k, -2, 2), e->gravity.acceleration[1] = make_number (&k, -5, 5);
}
