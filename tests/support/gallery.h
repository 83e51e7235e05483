/* What the tests of the gallery share: its models opened, run and held against what each of them keeps. */
#ifndef GALLERY_H
#define GALLERY_H

#include "pinwheel-solvers.h"

#define H4 1e-12 /* h^4, the order of the method, at h = 1 ms */

/* A model by name, with parameters set: gallery_open ("chain", "n", 3., NULL). */
pw_system *gallery_open (const char *model, ...);

/* Runs with fixed steps to t. */
pw_run *gallery_run (pw_system *s, double step, double t);

void gallery_close (pw_run *r, pw_system *s);

/* What goes in is what is there; undriven, energy is kept.  The bound is h^4 times a power of the fastest rate: nothing
 * turns fast on a snakeboard, a chain whips at 10 / s, and motors settle light parts at some 30 / s. */
void gallery_energy (pw_system *s, double step, double t, double bound, int driven);

/* A point of a body in the world. */
void gallery_point (const pw_system *s, const pw_sample *x, const char *body, double along, double p[2]);

#endif
