/* A four-bar linkage with bars of given lengths a, b, c, d. */
#ifndef BARS_H
#define BARS_H

#include "pinwheel.h"

extern const pw_plugin_table bars_table;

#endif
