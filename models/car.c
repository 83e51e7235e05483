/* Car: two wheels on the rear axle and two in front, steered so that all axles meet in one point.
 *
 * Two of the four wheels would do; the other two are redundant, and the reactions given are the smallest.  The car rolls
 * freely: with its steering held, the middle of the rear axle goes round a circle of radius (a + b) / tan (steer).
 * (Ackermann's steering; Pacejka 2012, Tire and Vehicle Dynamics, chapter 1.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m, I, a, b, track, steer, u0;
} car;

static const pw_parameter parameters[] = {
  { PW_AT (car, m), 1000, "kg", "mass", PW_POSITIVE },
  { PW_AT (car, I), 1500, "kg m^2", "inertia about the centre of mass", PW_POSITIVE },
  { PW_AT (car, a), 1.2, "m", "front axle ahead of the centre of mass", PW_POSITIVE },
  { PW_AT (car, b), 1.4, "m", "rear axle behind the centre of mass", PW_POSITIVE },
  { PW_AT (car, track), 1.5, "m", "between left and right wheels", PW_POSITIVE },
  { PW_AT (car, steer), 0.3, "rad", "angle of a wheel in the middle of the front axle", PW_REAL },
  { PW_AT (car, u0), 5, "m/s", "speed of the rear axle at the start", PW_REAL },
  { .name = NULL },
};

/* The angle of a front wheel at `y` to the left of the middle, so that its axle meets the rear one where it should. */
static double front (const car *p, double y) {
  double t = tan (p->steer);
  return atan (t / (1 - y * t / (p->a + p->b)));
}

static void build (pw_model *m, const void *parameter) {
  const car *p = parameter;
  double w = p->u0 * tan (p->steer) / (p->a + p->b), half = p->track / 2;
  pw_add_body (m, &(pw_body){ .name = "car", .mass = p->m, .inertia = p->I, .rate = { p->u0, p->b * w, w } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear-left", .body = "car", .at = { -p->b, half } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear-right", .body = "car", .at = { -p->b, -half } });
  pw_add_steered_wheel (
      m, &(pw_steered_wheel){
             .name = "front-left", .body = "car", .at = { p->a, half }, .heading = { .constant = front (p, half) } });
  pw_add_steered_wheel (m, &(pw_steered_wheel){ .name = "front-right",
                                                .body = "car",
                                                .at = { p->a, -half },
                                                .heading = { .constant = front (p, -half) } });
}

PW_MODEL (.about = "car with steered front wheels that do not slip, on its turning circle", .parameters = parameters,
          .parameters_size = sizeof (car), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
