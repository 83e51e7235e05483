/* A four-bar linkage; parameters: lengths of the crank a, the coupler b, the rocker c and the ground d [m], all 1 by
 * default, and gravity g, 0 by default. */
#ifndef BARS_H
#define BARS_H

#include "pinwheel.h"

extern const pw_plugin_table bars_table;

#endif
