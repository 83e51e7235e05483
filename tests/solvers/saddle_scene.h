/* Residuals of solutions of the saddle-point systems of a scene. */
#ifndef SADDLE_SCENE_H
#define SADDLE_SCENE_H

#include "pinwheel-solvers.h"

/* Random numbers in [-1, 1], the same on every machine. */
double saddle_number (unsigned *random);

/* The largest error of all saddle-point systems of a scene at the initial state and during the motion (all = 0: of
 * those with mass only); -1 if no run can be opened.  Frees the system. */
double saddle_scene (pw_system *s, double t_end, int all);

#endif
