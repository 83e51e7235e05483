/* Wheeled snake: n links with a wheel under the middle of each; motors bend the joints in a wave that travels
 * backwards.
 *
 * The wheels do not slip sideways, so the wave drives the snake forwards.  The kinetic energy is the work of the
 * motors.
 * (Hirose 1993, Biologically Inspired Robots: Snake-like Locomotors and Manipulators.) */
#include <math.h>
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double n, m, l, amplitude, omega, lag, stiffness, damping;
} snake;

static const pw_parameter parameters[] = {
  { PW_AT (snake, n), 8, "", "number of links", PW_COUNT },
  { PW_AT (snake, m), 0.3, "kg", "mass of a link, a uniform rod", PW_POSITIVE },
  { PW_AT (snake, l), 0.2, "m", "length of a link", PW_POSITIVE },
  { PW_AT (snake, amplitude), 0.4, "rad", "amplitude of the joints", PW_REAL },
  { PW_AT (snake, omega), PW_PI, "rad/s", "angular frequency of the wave", PW_REAL },
  { PW_AT (snake, lag), 0.8, "rad", "phase lag of each joint behind the one ahead", PW_REAL },
  { PW_AT (snake, stiffness), 5, "N m/rad", "stiffness of the motors", PW_NONNEGATIVE },
  { PW_AT (snake, damping), 0.5, "N m s/rad", "damping of the motors", PW_NONNEGATIVE },
  { .name = NULL },
};

static void motor (pw_model *m, const snake *p, int i, const char *link, const char *ahead) {
  char name[24];
  snprintf (name, sizeof name, "motor%d", i);
  double phase = -p->lag * i, speed = p->amplitude * p->omega;
  pw_signal angle = { PW_HARMONIC, .harmonic = { .amplitude = p->amplitude, .omega = p->omega, .phase = phase } };
  pw_signal rate = { PW_HARMONIC, .harmonic = { .amplitude = speed, .omega = p->omega, .phase = phase + PW_PI / 2 } };
  pw_add_motor (m, &(pw_motor){ .name = name,
                                .body = { link, ahead },
                                .stiffness = p->stiffness,
                                .damping = p->damping,
                                .angle = angle,
                                .rate = rate });
}

static void build (pw_model *m, const void *parameter) {
  const snake *p = parameter;
  double x = 0, y = 0, phi = 0; /* front end and angle of a link */
  char link[24], ahead[24] = "", name[24];
  for (int i = 0; i < (int)p->n; i++) {
    if (i > 0) phi += p->amplitude * cos (p->lag * i); /* the angle of the joint with the link ahead */
    double c = p->l * cos (phi), s = p->l * sin (phi);
    snprintf (link, sizeof link, "link%d", i + 1);
    pw_add_body (m, &(pw_body){ .name = link,
                                .mass = p->m,
                                .inertia = p->m * p->l * p->l / 12,
                                .start = { x - c / 2, y - s / 2, phi } });
    snprintf (name, sizeof name, "W%d", i + 1);
    pw_add_wheel (m, &(pw_wheel){ .name = name, .body = link });
    if (i > 0) {
      snprintf (name, sizeof name, "J%d", i);
      pw_add_pin (m, &(pw_pin){ .name = name, .body = { link, ahead }, .at = { { p->l / 2, 0 }, { -p->l / 2, 0 } } });
      motor (m, p, i, link, ahead);
    }
    x -= c, y -= s;
    snprintf (ahead, sizeof ahead, "link%d", i + 1);
  }
}

PW_MODEL (.about = "snake of n links on wheels, bent by motors in a travelling wave", .parameters = parameters,
          .parameters_size = sizeof (snake), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
