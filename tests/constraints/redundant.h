/* Scenes with redundant constraint equations, compared with the same scenes without them. */
#ifndef REDUNDANT_H
#define REDUNDANT_H

#include "pinwheel-solvers.h"

enum { REDUNDANT_COORDS = 20 };

/* Final values of the states with these names, NULL-terminated. */
void redundant_end (const pw_plugin_table *table, const char *method, double rtol, double t, const char *const *name,
                    double *end, double step);

/* The largest difference. */
double redundant_off (const double *a, const double *b, int n);

/* A scene and its twin without redundant rows have the same final state by every method: with fixed steps to
 * round-off, with adaptive ones to 10 times the twin's error, measured against fixed steps.  If other rows are
 * selected than in the twin, methods with drift agree only up to the drift, so steps must be small. */
void redundant_twins (const pw_plugin_table *table, const pw_plugin_table *twin, double t, double step,
                      const char *const *name);

/* Compares the descriptions of a run's redundant equations with these texts, NULL-terminated. */
void redundant_expect_reports (const pw_plugin_table *table, const char *const *text);

#endif
