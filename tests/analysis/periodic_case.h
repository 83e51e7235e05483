/* Searches for periodic motions that must succeed, for the tests of these. */
#ifndef PERIODIC_CASE_H
#define PERIODIC_CASE_H

#include "pinwheel-analysis.h"

pw_periodic *periodic_open (const pw_system *s, const pw_periodic_settings *set);
pw_periodic_orbit periodic_solve (pw_periodic *x, int settle, double parameter);

#endif
