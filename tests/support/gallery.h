/* Shared by the tests of the gallery: opens and runs its models, and checks their invariants. */
#ifndef GALLERY_H
#define GALLERY_H

#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

#define H4 1e-12 /* h^4, for methods of order 4, at h = 1 ms */

/* The system of a model by name or path, with parameters set: gallery_open ("chain", "n", 3., NULL). */
pw_system *gallery_open (const char *model, ...);

/* The same, together with its model and the file, which contains the code of its own element types and signals. */
typedef struct {
  pw_file *file;
  pw_model *model;
  pw_system *system;
} gallery_scene;
gallery_scene gallery_load (const char *model, ...);
void gallery_close (gallery_scene *x);

/* Opens a run of rk4+projection with an energy ledger, to end at t. */
pw_run *gallery_run (pw_system *s, double step, double t);

typedef enum { GALLERY_CONSERVATIVE, GALLERY_DRIVEN } gallery_source;

/* Runs to t and frees the system.  Checks that the energy balance closes, that kinetic and potential energy change by
 * the work, and that elements do work if, and only if, the scene is driven.  The bound is h^4 times a power of the
 * fastest rate of the motion: about 1/s for a snakeboard, 10/s for a chain, 30/s for light parts with motors. */
void gallery_energy (pw_system *s, double step, double t, double bound, gallery_source source);

/* The point (along, 0) of a body, in the world. */
void gallery_point (const pw_system *s, const pw_sample *x, const char *body, double along, double p[2]);

#endif
