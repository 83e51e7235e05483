/* A tiny scene of three elements of any one kind, at random, for the self-test. */
#ifndef PW_RANDOM_SCENE_H
#define PW_RANDOM_SCENE_H

#include <stdint.h>
#include "system.h"

enum {
  PW_SCENE_BODIES = 4,
  PW_SCENE_ELEMENTS = 3,
  PW_SCENE_BATCH = 4 /* the most elements of the compiled scene: one on each body, or those described */
};

/* Random numbers, the same on every machine. */
typedef struct {
  uint64_t state; /* the seed, at first */
} pw_random;
double pw_random_between (pw_random *r, double low, double high);

/* Compiles a scene of bodies b0 to b3 and elements e0 to e2, defined at random inside the domains of the kind's field
 * table; e2 hangs on the ground with one of its bodies if it has several.  A kind that acts on every body gets one
 * element only.  NULL and the error if the kind refuses every
 * such definition, or memory is out. */
pw_system *pw_random_scene (const pw_kind *kind, pw_random *random, pw_error *error);

#endif
