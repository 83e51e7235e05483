/* Random mechanisms: trees and loops of bodies with elements of all types, consistent initially; displaced, rotated,
 * mirrored, or described in another order. */
#ifndef MECHANISM_H
#define MECHANISM_H

#include "pinwheel.h"

enum { MECHANISM_BODIES = 9, MECHANISM_ELEMENTS = 40 };

/* An element: its type and its definition. */
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
  int free; /* coordinates minus rows */
  pw_body body[MECHANISM_BODIES];
  mechanism_element element[MECHANISM_ELEMENTS];
} mechanism;

/* A transformation: mirrored (y becomes -y), then rotated, then displaced; 1: reversed order of bodies and elements. */
typedef struct {
  int mirror;
  double angle, x, y;
  int backwards;
} mechanism_view;

/* The mechanism with this seed, the same on every machine. */
void mechanism_make (unsigned seed, mechanism *x);

/* Compiles the transformed mechanism; NULL and an error if that fails. */
pw_system *mechanism_compile (const mechanism *x, const mechanism_view *view, pw_error *error);

/* Transforms the initial values of a body. */
void mechanism_transform (const mechanism_view *view, pw_body *b);

/* Runs the mechanisms of `count` seeds and checks invariants, symmetries, another method.  Fails if one is violated, or
 * if more than 5 % of the runs are refused. */
void mechanism_test (unsigned first, unsigned count);

#endif
