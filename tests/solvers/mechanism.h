/* Random mechanisms: trees and loops of bodies with elements of all kinds, closed where they start, and the same seen
 * from elsewhere, in a mirror, or described in another order. */
#ifndef MECHANISM_H
#define MECHANISM_H

#include "pinwheel.h"

enum { MECHANISM_BODIES = 9, MECHANISM_ELEMENTS = 40 };

/* An element: its definition, under the kind whose table is given. */
typedef struct {
  const pw_kind *kind;
  union {
    pw_pin pin;
    pw_weld weld;
    pw_slider slider;
    pw_slot slot;
    pw_rod rod;
    pw_gear gear;
    pw_drive drive;
    pw_wheel wheel;
    pw_rolling_wheel rolling_wheel;
    pw_steered_wheel steered_wheel;
    pw_speed speed;
    pw_pfaffian pfaffian;
    pw_tyre tyre;
    pw_rolling_resistance rolling_resistance;
    pw_spring spring;
    pw_rotational_spring rotational_spring;
    pw_friction friction;
    pw_drag drag;
    pw_gravity gravity;
    pw_force force;
    pw_torque torque;
    pw_motor motor;
  };
} mechanism_element;

typedef struct {
  int bodies, elements;
  int free; /* coordinates less rows */
  pw_body body[MECHANISM_BODIES];
  mechanism_element element[MECHANISM_ELEMENTS];
} mechanism;

/* Where it is seen from: mirrored (y becomes -y), then turned, then moved; and the order it is described in. */
typedef struct {
  int mirror;
  double angle, x, y;
  int backwards;
} mechanism_view;

/* The mechanism of a seed, the same on every machine. */
void mechanism_make (unsigned seed, mechanism *x);

/* The same mechanism as it is seen, compiled.  NULL and the error if it cannot be. */
pw_system *mechanism_compile (const mechanism *x, const mechanism_view *view, pw_error *error);

/* A body's start and rate as they are seen. */
void mechanism_see (const mechanism_view *view, pw_body *b);

/* Runs the mechanisms of so many seeds: invariants, symmetries, another method.  Fails the test if any is violated, or if
 * more than a few are refused. */
void mechanism_try (unsigned first, unsigned count);

#endif
