/* Chain: n uniform rods pinned end to end, the first one to the ground, released from a straight line.
 *
 * With two or more links the motion is chaotic; energy is conserved. */
#include <math.h>
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double n, m, l, g, theta;
} chain;

static const pw_parameter parameters[] = {
  { PW_AT (chain, n), 10, "", "number of links", PW_COUNT },
  { PW_AT (chain, m), 0.1, "kg", "mass of a link, a uniform rod", PW_POSITIVE },
  { PW_AT (chain, l), 0.1, "m", "length of a link", PW_POSITIVE },
  { PW_AT (chain, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (chain, theta), 0, "rad", "initial angle to the horizontal", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const chain *p = parameter;
  double l = p->l, c = cos (p->theta), s = sin (p->theta);
  char link[24], before[24] = "ground", pin[24];
  for (int i = 0; i < (int)p->n; i++) {
    double along = (i + 0.5) * l;
    snprintf (link, sizeof link, "link%d", i + 1);
    snprintf (pin, sizeof pin, "P%d", i + 1);
    pw_add_body (
        m, &(pw_body){
               .name = link, .mass = p->m, .inertia = p->m * l * l / 12, .start = { along * c, along * s, p->theta } });
    pw_add_pin (m,
                &(pw_pin){ .name = pin, .body = { link, before }, .at = { { -l / 2, 0 }, { i > 0 ? l / 2 : 0, 0 } } });
    snprintf (before, sizeof before, "link%d", i + 1);
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

PW_MODEL (.about = "chain of n rods that falls from a straight line", .parameters = parameters,
          .parameters_size = sizeof (chain), .run = { .t_end = 3, .step = 2e-4, .method = "rk4+projection" },
          .build = build);
