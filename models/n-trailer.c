/* n-trailer: a tractor on one axle pulls n trailers, each hitched to the axle ahead of it, in a steady turn.
 *
 * Axle i runs on a circle of radius R_i, R_i^2 = R_(i-1)^2 - L_i^2; all bodies have the angular velocity w.  As each
 * centre of mass is on its axle, the reactions are zero in the hinges and m_i w^2 R_i in wheel i.
 * (The vehicle: Laumond 1993, Controllability of a multibody mobile robot.) */
#include <math.h>
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double n, R, w, m0, I0, L, longer, m, ratio, rho;
} trailers;

static const pw_parameter parameters[] = {
  { PW_AT (trailers, n), 2, "", "number of trailers", PW_COUNT },
  { PW_AT (trailers, R), 2, "m", "turning radius of the tractor", PW_POSITIVE },
  { PW_AT (trailers, w), 1, "rad/s", "angular velocity of the turn", PW_REAL },
  { PW_AT (trailers, m0), 1, "kg", "mass of the tractor", PW_POSITIVE },
  { PW_AT (trailers, I0), 0.1, "kg m^2", "inertia of the tractor", PW_POSITIVE },
  { PW_AT (trailers, L), 0.6, "m", "length of the first trailer, from hitch to axle", PW_POSITIVE },
  { PW_AT (trailers, longer), 0.2, "m", "length of each further trailer minus that of the one ahead", PW_NONNEGATIVE },
  { PW_AT (trailers, m), 2, "kg", "mass of the first trailer", PW_POSITIVE },
  { PW_AT (trailers, ratio), 0.25, "", "mass of each further trailer divided by that of the previous one",
    PW_POSITIVE },
  { PW_AT (trailers, rho), 0.2, "m", "radius of gyration of the trailers", PW_POSITIVE },
  { .name = NULL },
};

/* A vehicle whose centre of mass is on its axle, at `angle` on the circle of radius R about (0, p->R), heading along
 * it. */
static void add_vehicle (pw_model *m, const trailers *p, const char *name, const char *axle, double R, double angle,
                         double mass, double inertia) {
  double c = cos (angle), s = sin (angle);
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = inertia,
                              .start = { R * c, p->R + R * s, angle + PW_PI / 2 },
                              .rate = { -p->w * R * s, p->w * R * c, p->w } });
  pw_add_wheel (m, &(pw_wheel){ .name = axle, .body = name });
}

static void build (pw_model *m, const void *parameter) {
  const trailers *p = parameter;
  double R = p->R, angle = -PW_PI / 2, L = p->L, mass = p->m;
  char name[24], axle[24], hitch[24], before[24] = "tractor";
  add_vehicle (m, p, "tractor", "A0", R, angle, p->m0, p->I0);
  for (int i = 1; i <= (int)p->n; i++, L += p->longer, mass *= p->ratio) {
    if (L >= R) {
      pw_model_refuse (m, "R = %g: trailer %d is too long to turn on this radius", p->R, i);
      return;
    }
    R = sqrt (R * R - L * L);
    angle -= atan2 (L, R);
    snprintf (name, sizeof name, "trailer%d", i);
    snprintf (axle, sizeof axle, "A%d", i);
    snprintf (hitch, sizeof hitch, "H%d", i);
    add_vehicle (m, p, name, axle, R, angle, mass, mass * p->rho * p->rho);
    pw_add_pin (m, &(pw_pin){ .name = hitch, .body = { name, before }, .at = { { L, 0 } } });
    snprintf (before, sizeof before, "trailer%d", i);
  }
}

/* Circular motion about (0, R). */
static void reference (const void *parameter, double t, double *q, double *v) {
  const trailers *p = parameter;
  double R = p->R, angle = -PW_PI / 2, L = p->L;
  for (int i = 0; i <= (int)p->n; i++, q += 3, v += 3) {
    if (i > 0) {
      R = sqrt (R * R - L * L);
      angle -= atan2 (L, R);
      L += p->longer;
    }
    double now = angle + p->w * t;
    q[0] = R * cos (now), q[1] = p->R + R * sin (now), q[2] = now + PW_PI / 2;
    v[0] = -p->w * R * sin (now), v[1] = p->w * R * cos (now), v[2] = p->w;
  }
}

PW_MODEL (.about = "tractor with n trailers in a steady turn", .parameters = parameters,
          .parameters_size = sizeof (trailers), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build, .reference = reference);
