/* Random numbers, and random scenes of elements of one type, for the self-test and specialise.c. */
#ifndef PW_SELFTEST_H_
#define PW_SELFTEST_H_
#include "system.h"
#include "pinwheel-selftest.h"

enum {
  PW_SCENE_BODIES = 4,
  PW_SCENE_ELEMENTS = 3,
  PW_SCENE_BATCH = 4, /* most elements of the compiled scene: one per body, or the described ones */
  PW_SCENE_COORDS = 3 * PW_SCENE_BODIES + PW_SCENE_BATCH * PW_MAX_INTERNAL, /* most coordinates */
  PW_SCENE_OUT = PW_SCENE_BATCH * PW_MAX_COLS * PW_MAX_COLS                 /* most numbers that a function fills */
};

/* Random numbers, the same on every machine. */
typedef struct {
  uint64_t state; /* initially the seed */
} pw_random;
/* The next one, uniformly distributed in [low, high). */
double pw_random_between (pw_random *r, double low, double high);

/* Compiles a scene of bodies b0 to b3 and elements e0 to e2, which form its only batch, with random definitions within
 * the domains of the type's fields.  If e2 has several bodies, one is the ground.  A type that acts on every body has
 * one element only.  NULL and the error if the type rejects 2000 such definitions, or if out of memory.  error: not
 * NULL; cleared first. */
pw_system *pw_random_scene (const pw_kind *kind, pw_random *random, pw_error *error);

#endif
