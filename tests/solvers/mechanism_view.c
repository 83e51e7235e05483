/* Transformed mechanisms.  Mirroring changes the sign of y of points on bodies, of angles and of torques; attachments
 * to the ground are rotated and displaced with the bodies. */
#include <math.h>
#include <string.h>
#include "mechanism.h"
#include "scene.h"

static int view_ground (const char *body) {
  return strcmp (body, "ground") == 0;
}

static void view_vector (const mechanism_view *w, double x[2]) {
  double c = cos (w->angle), s = sin (w->angle), y = w->mirror ? -x[1] : x[1];
  double turned[2] = { c * x[0] - s * y, s * x[0] + c * y };
  memcpy (x, turned, sizeof turned);
}

static void view_point (const mechanism_view *w, const char *body, double x[2]) {
  if (!view_ground (body)) {
    if (w->mirror) x[1] = -x[1];
    return;
  }
  view_vector (w, x);
  x[0] += w->x, x[1] += w->y;
}

/* An angle in a body's frame. */
static double view_angle (const mechanism_view *w, const char *body, double angle) {
  return (w->mirror ? -angle : angle) + (view_ground (body) ? w->angle : 0);
}

/* The angle between two bodies; that of the ground does not change. */
static double view_between (const mechanism_view *w, const char *one, const char *two, double angle) {
  return (w->mirror ? -angle : angle) + (view_ground (two) ? w->angle : 0) - (view_ground (one) ? w->angle : 0);
}

static void view_signal (const mechanism_view *w, pw_signal *signal, double plus) {
  if (w->mirror) signal->harmonic.amplitude *= -1, signal->harmonic.offset *= -1;
  signal->harmonic.offset += plus;
}

static void view_force (const mechanism_view *w, pw_force *f) {
  double amplitude[2] = { f->fx.harmonic.amplitude, f->fy.harmonic.amplitude };
  double offset[2] = { f->fx.harmonic.offset, f->fy.harmonic.offset };
  mechanism_view own = { .mirror = w->mirror, .angle = f->axes == PW_AXES_BODY ? 0 : w->angle };
  view_point (w, f->body, f->at);
  view_vector (&own, amplitude), view_vector (&own, offset);
  f->fx.harmonic.amplitude = amplitude[0], f->fy.harmonic.amplitude = amplitude[1];
  f->fx.harmonic.offset = offset[0], f->fy.harmonic.offset = offset[1];
}

static void view_pfaffian (const mechanism_view *w, pw_pfaffian *p) {
  for (int i = 1; i < 3 && w->mirror; i++) p->a[i] = -p->a[i], p->b[i] = -p->b[i];
}

/* Joints and forces between two bodies. */
static void view_two_bodies (const mechanism_view *w, mechanism_element *e) {
  const pw_kind *k = e->kind;
  const char *one = e->pin.body[0], *two = e->pin.body[1];
  if (k == &pw_kind_pin || k == &pw_kind_weld || k == &pw_kind_slider || k == &pw_kind_slot || k == &pw_kind_rod ||
      k == &pw_kind_spring) {
    view_point (w, one, e->pin.at[0]);
    view_point (w, two, e->pin.at[1]);
  }
  double turned = view_between (w, one, two, 0);
  if (k == &pw_kind_weld) e->weld.angle = view_between (w, two, one, e->weld.angle);
  if (k == &pw_kind_slider) {
    e->slider.angle = view_between (w, one, two, e->slider.angle);
    e->slider.heading = view_angle (w, two, e->slider.heading);
  }
  if (k == &pw_kind_slot) e->slot.heading = view_angle (w, two, e->slot.heading);
  if (k == &pw_kind_drive) view_signal (w, &e->drive.value, turned);
  if (k == &pw_kind_pfaffian) view_pfaffian (w, &e->pfaffian);
  if (k == &pw_kind_rotational_spring)
    e->rotational_spring.angle = view_between (w, one, two, e->rotational_spring.angle);
  if (k == &pw_kind_torque) view_signal (w, &e->torque.value, 0);
  if (k == &pw_kind_motor) view_signal (w, &e->motor.angle, turned);
}

/* Elements at one body. */
static void view_one_body (const mechanism_view *w, mechanism_element *e) {
  const pw_kind *k = e->kind;
  double *heading = k == &pw_kind_wheel                ? &e->wheel.heading
                    : k == &pw_kind_rolling_wheel      ? &e->rolling_wheel.heading
                    : k == &pw_kind_speed              ? &e->speed.heading
                    : k == &pw_kind_tyre               ? &e->tyre.heading
                    : k == &pw_kind_rolling_resistance ? &e->rolling_resistance.heading
                                                       : NULL;
  if (heading || k == &pw_kind_steered_wheel) view_point (w, e->wheel.body, e->wheel.at);
  if (heading) *heading = view_angle (w, e->wheel.body, *heading);
  if (k == &pw_kind_steered_wheel) view_signal (w, &e->steered_wheel.heading, 0);
  if (k == &pw_kind_force) view_force (w, &e->force);
}

static void view_element (const mechanism_view *w, mechanism_element *e) {
  if (e->kind == &pw_kind_gravity)
    view_vector (w, e->gravity.acceleration);
  else if (e->kind->bodies == 1)
    view_one_body (w, e);
  else if (e->kind->bodies == 2)
    view_two_bodies (w, e);
}

void mechanism_transform (const mechanism_view *w, pw_body *b) {
  view_point (w, "ground", b->start);
  b->start[2] = view_angle (w, "ground", b->start[2]);
  view_vector (w, b->rate);
  if (w->mirror) b->rate[2] = -b->rate[2];
}

/* ---- Compilation ---- */

static const mechanism *view_of; /* arguments of view_build */
static const mechanism_view *view_from;

SCENE (view_build) {
  for (int i = 0; i < view_of->bodies; i++) {
    pw_body b = view_of->body[view_from->backwards ? view_of->bodies - 1 - i : i];
    mechanism_transform (view_from, &b);
    pw_add_body (m, &b);
  }
  for (int i = 0; i < view_of->elements; i++) {
    mechanism_element e = view_of->element[view_from->backwards ? view_of->elements - 1 - i : i];
    view_element (view_from, &e);
    pw_add (m, e.kind, &e.pin);
  }
}

pw_system *mechanism_compile (const mechanism *x, const mechanism_view *view, pw_error *error) {
  view_of = x, view_from = view;
  pw_model *m = pw_model_new ("mechanism", &view_build_table, error);
  pw_system *s = m && pw_model_build (m, error) == PW_OK ? pw_system_compile (m, error) : NULL;
  pw_model_free (m);
  return s;
}
