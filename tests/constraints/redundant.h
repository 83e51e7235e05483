/* Scenes with redundant constraint equations, compared with the same scenes without them. */
#ifndef REDUNDANT_H
#define REDUNDANT_H

#include "trial.h"

enum { REDUNDANT_COORDS = 20 };

/* Defines a scene, built by statements that fill the model m, and its table, NAME_table. */
#define REDUNDANT_SCENE(name, build)                      \
  static void name (pw_model *m, const void *parameter) { \
    (void)parameter;                                      \
    build;                                                \
  }                                                       \
  static const pw_plugin_table name##_table = SCENE_TABLE (name)

/* Runs a scene to t, with a fixed step or with rtol, and stores the final values of the states with these names, which
 * end with NULL. */
void redundant_end (const pw_plugin_table *table, const char *method, double rtol, double t, const char *const *name,
                    double *end, double step);

/* The largest difference of n numbers. */
double redundant_distance (const double *a, const double *b, int n);

/* Checks that a scene and its twin without redundant rows have the same final state by every method: with fixed steps
 * to round-off, with adaptive ones to 10 times the error of the twin, relative to rk4+projection.  If the selected rows
 * are not those of the twin, methods with drift agree only up to the drift: steps must be small. */
void redundant_twins (const pw_plugin_table *table, const pw_plugin_table *twin, double t, double step,
                      const char *const *name);

/* Checks that a run's descriptions of its redundant equations are these texts, which end with NULL. */
void redundant_expect_reports (const pw_plugin_table *table, const char *const *text);

#endif
