/* Theo Jansen's leg: a crank and six links whose proportions give the foot a walking motion.
 *
 * The links have the lengths of the strandbeests: two triangles, b d e on the ground pivot B and g h i with the foot,
 * and the bars j, k, c and f.  The crank turns about O at constant speed.
 * (Jansen 2007, The Great Pretender.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double size, density, omega, load;
} leg;

static const pw_parameter parameters[] = {
  { PW_AT (leg, size), 0.01, "m", "unit of the lengths", PW_POSITIVE },
  { PW_AT (leg, density), 0.5, "kg/m", "mass per length of the bars", PW_POSITIVE },
  { PW_AT (leg, omega), -PW_PI, "rad/s", "angular velocity of the crank", PW_REAL },
  { PW_AT (leg, load), 0, "N", "upward force on the foot", PW_REAL },
  { .name = NULL },
};

/* Lengths by Jansen's letters, in units of size: a and l locate B relative to O, the others are those of links. */
static const double a = 38, b = 41.5, c = 39.3, d = 40.1, e = 55.8, f = 39.4, g = 36.7, h = 65.7, i = 49, j = 50,
                    k = 61.9, l = 7.8, crank = 15;

/* A point [size] and its velocity [size/s]. */
typedef struct {
  double x, y, vx, vy;
} point;

/* The point at distances r from P and s from Q, to the left of the line from P to Q, with its velocity. */
static point intersection (point P, double r, point Q, double s) {
  double x = Q.x - P.x, y = Q.y - P.y, square = x * x + y * y, along = (square + r * r - s * s) / (2 * square);
  double aside = sqrt (r * r / square - along * along);
  point X = { P.x + along * x - aside * y, P.y + along * y + aside * x, 0, 0 };
  double px = X.x - P.x, py = X.y - P.y, qx = X.x - Q.x, qy = X.y - Q.y, cross = px * qy - py * qx;
  double vp = px * P.vx + py * P.vy, vq = qx * Q.vx + qy * Q.vy;
  X.vx = (vp * qy - vq * py) / cross;
  X.vy = (vq * px - vp * qx) / cross;
  return X;
}

/* The angular velocity of the line from P to Q. */
static double angular_velocity (point P, point Q) {
  double x = Q.x - P.x, y = Q.y - P.y;
  return (x * (Q.vy - P.vy) - y * (Q.vx - P.vx)) / (x * x + y * y);
}

static double distance (point P, point Q) {
  return hypot (Q.x - P.x, Q.y - P.y);
}

static void add_bar (pw_model *m, const leg *p, const char *name, point P, point Q) {
  double length = distance (P, Q) * p->size, mass = p->density * length, half = p->size / 2;
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = mass * length * length / 12,
                              .start = { (P.x + Q.x) * half, (P.y + Q.y) * half, atan2 (Q.y - P.y, Q.x - P.x) },
                              .rate = { (P.vx + Q.vx) * half, (P.vy + Q.vy) * half, angular_velocity (P, Q) } });
}

static point centre (point P, point Q, point R) {
  return (point){ (P.x + Q.x + R.x) / 3, (P.y + Q.y + R.y) / 3, (P.vx + Q.vx + R.vx) / 3, (P.vy + Q.vy + R.vy) / 3 };
}

/* A uniform triangular plate with the mass of bars along its sides.  Its initial angle is 0. */
static void add_plate (pw_model *m, const leg *p, const char *name, point P, point Q, point R) {
  double q = distance (P, Q), r = distance (Q, R), s = distance (R, P), u = p->size;
  double mass = p->density * (q + r + s) * u;
  point C = centre (P, Q, R);
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = mass * (q * q + r * r + s * s) * u * u / 36,
                              .start = { C.x * u, C.y * u, 0 },
                              .rate = { C.vx * u, C.vy * u, angular_velocity (P, Q) } });
}

static void build (pw_model *m, const void *parameter) {
  const leg *p = parameter;
  double u = p->size;
  point O = { 0, 0, 0, 0 }, A = { crank, 0, 0, crank * p->omega }, B = { -a, -l, 0, 0 };
  point T = intersection (B, b, A, j), K = intersection (A, k, B, c), L = intersection (B, d, T, e),
        M = intersection (K, g, L, f), F = intersection (K, i, M, h);
  point U = centre (B, T, L), V = centre (K, M, F);
  add_bar (m, p, "crank", O, A);
  add_bar (m, p, "j", A, T);
  add_bar (m, p, "k", A, K);
  add_bar (m, p, "c", B, K);
  add_bar (m, p, "f", L, M);
  add_plate (m, p, "shoulder", B, T, L);
  add_plate (m, p, "shin", K, M, F);
#define PIN(Name, one, X1, Y1, two, X2, Y2) \
  pw_add_pin (m, &(pw_pin){ .name = Name, .body = { one, two }, .at = { { (X1)*u, (Y1)*u }, { (X2)*u, (Y2)*u } } })
  PIN ("O", "crank", -crank / 2, 0, "ground", 0, 0);
  PIN ("B1", "shoulder", B.x - U.x, B.y - U.y, "ground", B.x, B.y);
  PIN ("B2", "c", -c / 2, 0, "ground", B.x, B.y);
  PIN ("A1", "crank", crank / 2, 0, "j", -j / 2, 0);
  PIN ("A2", "crank", crank / 2, 0, "k", -k / 2, 0);
  PIN ("T", "j", j / 2, 0, "shoulder", T.x - U.x, T.y - U.y);
  PIN ("L", "f", -f / 2, 0, "shoulder", L.x - U.x, L.y - U.y);
  PIN ("K1", "k", k / 2, 0, "c", c / 2, 0);
  PIN ("K2", "c", c / 2, 0, "shin", K.x - V.x, K.y - V.y);
  PIN ("M", "f", f / 2, 0, "shin", M.x - V.x, M.y - V.y);
  pw_add_pfaffian (
      m, &(pw_pfaffian){
             .name = "motor", .body = { "crank", "ground" }, .a = { 0, 0, 1 }, .value = { .constant = p->omega } });
  pw_add_force (m, &(pw_force){ .name = "load",
                                .body = "shin",
                                .at = { (F.x - V.x) * u, (F.y - V.y) * u },
                                .fy = { .constant = p->load } });
  pw_add_marker (m, &(pw_marker){ .name = "foot", .body = "shin", .at = { (F.x - V.x) * u, (F.y - V.y) * u } });
}

PW_MODEL (.about = "Theo Jansen's walking leg, driven by a crank at constant speed", .parameters = parameters,
          .parameters_size = sizeof (leg), .run = { .t_end = 2, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
