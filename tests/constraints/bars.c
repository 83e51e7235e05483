/* See bars.h. */
#include <math.h>
#include "bars.h"
#include "trial.h"

/* Lengths of the bars [m]; g: gravity [m/s^2]. */
typedef struct {
  double a, b, c, d, g;
} bars;

static const pw_parameter bars_list[] = {
  { PW_AT (bars, a), 1, "m", "crank", PW_POSITIVE },   { PW_AT (bars, b), 1, "m", "coupler", PW_POSITIVE },
  { PW_AT (bars, c), 1, "m", "rocker", PW_POSITIVE },  { PW_AT (bars, d), 1, "m", "ground", PW_POSITIVE },
  { PW_AT (bars, g), 0, "m/s^2", "gravity", PW_REAL }, { .name = NULL },
};

/* Crank and rocker are initially parallel: the initial state is consistent if a = c and b = d. */
static void bars_build (pw_model *m, const void *parameter) {
  const bars *p = parameter;
  const double phi = 1.2, w = 4, c = cos (phi), s = sin (phi);
  pw_add_body (m, &(pw_body){ .name = "crank",
                              .mass = 1,
                              .inertia = p->a * p->a / 12,
                              .start = { p->a * c / 2, p->a * s / 2, phi },
                              .rate = { -p->a * s * w / 2, p->a * c * w / 2, w } });
  pw_add_body (m, &(pw_body){ .name = "coupler",
                              .mass = 1,
                              .inertia = p->b * p->b / 12,
                              .start = { p->a * c + p->b / 2, p->a * s, 0 },
                              .rate = { -p->a * s * w, p->a * c * w, 0 } });
  pw_add_body (m, &(pw_body){ .name = "rocker",
                              .mass = 1,
                              .inertia = p->c * p->c / 12,
                              .start = { p->d + p->c * c / 2, p->c * s / 2, phi },
                              .rate = { -p->c * s * w / 2, p->c * c * w / 2, w } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "ground", "crank" }, .at = { { 0, 0 }, { -p->a / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "crank", "coupler" }, .at = { { p->a / 2, 0 }, { -p->b / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "coupler", "rocker" }, .at = { { p->b / 2, 0 }, { p->c / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "D", .body = { "ground", "rocker" }, .at = { { p->d, 0 }, { -p->c / 2, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -p->g } });
}

const pw_plugin_table bars_table = SCENE_TABLE_WITH (bars_build, bars_list, sizeof (bars));
