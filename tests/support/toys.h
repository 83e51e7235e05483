/* Element types of the tests, as a plug-in would define them: they use features of pw_kind that no built-in type
 * uses. */
#ifndef TOYS_H
#define TOYS_H

#include "pinwheel.h"

/* A spring with a damper between points of two bodies: a force with energy and loss. */
typedef struct {
  const char *name;
  const char *body[2];
  double at[2][2];  /* [m] */
  double stiffness; /* [N/m] */
  double length;    /* at rest [m] */
  double damping;   /* [N s/m] */
} toy_spring;

/* The angle between two bodies follows a signal: a holonomic row that moves with time. */
typedef struct {
  const char *name;
  const char *body[2];
  pw_signal angle; /* phi1 - phi2 [rad] */
} toy_drive;

/* A wheel that rolls without slip and owns its spin angle. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];   /* contact point [m] */
  double radius;  /* [m] */
  double inertia; /* about its axle [kg m^2] */
} toy_roller;

/* A constant force on every body with mass: its mass times a vector. */
typedef struct {
  const char *name;
  double g[2]; /* [m/s^2] */
} toy_weight;

extern const pw_kind toy_kind_spring, toy_kind_drive, toy_kind_roller, toy_kind_weight;

/* All of them, ended by NULL. */
extern const pw_kind *const toy_kinds[];

#endif
