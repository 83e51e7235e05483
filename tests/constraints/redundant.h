/* Scenes with redundant constraint equations, compared with the same scenes without them. */
#ifndef REDUNDANT_H
#define REDUNDANT_H

#include "pinwheel-solvers.h"

enum { REDUNDANT_COORDS = 20 };

/* How a scene ends: the states of these names, NULL-terminated. */
void redundant_end (const pw_plugin_table *table, const char *method, double rtol, double t, const char *const *name,
                    double *end, double step);

/* The largest difference. */
double redundant_off (const double *a, const double *b, int n);

/* A scene and its twin without redundant rows end alike, by every method: fixed steps to round-off, adaptive ones to 10
 * times the twin's own error, which is what it differs from fixed steps.  Where other rows than the twin's are kept,
 * methods that let them drift agree to that drift only: steps must be so small that it is below round-off. */
void redundant_twins (const pw_plugin_table *table, const pw_plugin_table *twin, double t, double step,
                      const char *const *name);

/* Compares the descriptions of a run's redundant equations with these, NULL-terminated. */
void redundant_expect_reports (const pw_plugin_table *table, const char *const *text);

#endif
