/* A pendulum chain of as many links as asked for, the last one on a spring: small, large, and growing with a
 * parameter. */
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double links, length, g, pull;
} chain;

static const pw_parameter parameters[] = {
  { PW_AT (chain, links), 3, "", "how many", PW_COUNT },
  { PW_AT (chain, length), 0.5, "m", "of a link", PW_POSITIVE },
  { PW_AT (chain, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (chain, pull), 4, "N/m", "stiffness of the spring at the end", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const chain *p = parameter;
  int n = (int)p->links;
  double l = p->length;
  char name[20], before[20] = "ground", pin[20];
  if (p->pull < 0) {
    pw_model_refuse (m, "the spring\n\"pulls\", %g N/m does not", p->pull);
    return;
  }
  for (int i = 0; i < n; i++) {
    snprintf (name, sizeof name, "link%d", i + 1);
    snprintf (pin, sizeof pin, "P%d", i + 1);
    pw_add_body (
        m, &(pw_body){
               .name = name, .mass = 1 + 0.01 * (i % 7), .inertia = l * l / 12, .start = { l * (i + 0.5), 0, 0 } });
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { before, name }, .at = { { i ? l / 2 : 0, 0 }, { -l / 2, 0 } } });
    snprintf (before, sizeof before, "%s", name);
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "down", .acceleration = { 0, -p->g } });
  pw_add_spring (m, &(pw_spring){ .name = "tie",
                                  .body = { before, "ground" },
                                  .at = { { l / 2, 0 }, { l, 1 } },
                                  .stiffness = p->pull,
                                  .damping = 0.3,
                                  .length = 0.2 });
}

PW_MODEL (.about = "pendulum chain with a spring at its end", .parameters = parameters,
          .parameters_size = sizeof (chain), .run = { .t_end = 2, .step = 1e-3 }, .build = build);
