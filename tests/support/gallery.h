/* Shared by the tests of the gallery: opens and runs its models, and checks their invariants. */
#ifndef GALLERY_H
#define GALLERY_H

#include "pinwheel-solvers.h"

#define H4 1e-12 /* h^4, the order of the method, at h = 1 ms */

/* A model by name, with parameters set: gallery_open ("chain", "n", 3., NULL). */
pw_system *gallery_open (const char *model, ...);

/* Runs with fixed steps to t. */
pw_run *gallery_run (pw_system *s, double step, double t);

void gallery_close (pw_run *r, pw_system *s);

/* Checks that energy is work less losses, and constant if the scene is not driven.  The bound is h^4 times a power
 * of the fastest rate of the motion: about 1/s for a snakeboard, 10/s for a chain, 30/s for light parts with motors. */
void gallery_energy (pw_system *s, double step, double t, double bound, int driven);

/* A point of a body in the world. */
void gallery_point (const pw_system *s, const pw_sample *x, const char *body, double along, double p[2]);

#endif
