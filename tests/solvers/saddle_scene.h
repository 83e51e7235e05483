/* Solutions of the saddle-point systems of a scene, inserted into their equations. */
#ifndef SADDLE_SCENE_H
#define SADDLE_SCENE_H

#include "pinwheel-solvers.h"

/* Numbers in [-1, 1], the same on every machine. */
double saddle_number (unsigned *random);

/* The largest error of all saddle-point systems of a scene at its initial state, and some way into the motion (all = 0:
 * of those with mass); -1 if no run can begin.  Frees the system. */
double saddle_scene (pw_system *s, double t_end, int all);

#endif
