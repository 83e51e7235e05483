/* on-curve: a point of a body stays on a curve (X(s), Y(s)) of the world; its parameter s is an internal coordinate.
 *
 *   g     = r + R(phi) p - (X, Y) = 0                             p: the point P in the body        (2 holonomic)
 *   G     = [ 1 0 -Py -X_s ]        (Px, Py) = R(phi) p, the arm in world axes; X_s = dX/ds, ...
 *           [ 0 1  Px -Y_s ]
 *   gamma = (Px, Py) omega^2 + (X_ss, Y_ss) s'^2
 *
 * s has no mass: its row of G^T lambda = 0 says that the force is normal to the curve.  The curve may cross itself or
 * be closed, since s tells the branch, but must have a direction: (X_s, Y_s) is not 0.  X and Y are signals of s in
 * place of the time, with two derivatives; the third one, in gamma_q, is computed by differences.
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3: point-follower joint.)
 * The force on the body at the point is -lambda. */
#include "batch.h"

typedef struct {
  double at[2]; /* the point in the body's frame [m] */
} curve;

/* An element in the current state. */
typedef struct {
  const pw_configuration *body;
  double arm[2];
  const double *X, *Y; /* value, first and second derivative by s */
  double s, rate;      /* s, s' */
  const double *w;
} curve_state;

static inline curve_state curve_at (const pw_batch *batch, int e) {
  const curve *element = (const curve *)batch->element + e;
  const double *u = batch->u + 6 * e;
  curve_state now = { batch_body (batch, e), { 0 }, u, u + 3, batch->q[e], batch->v[e], batch_w (batch, e) };
  to_world (now.body, element->at, now.arm);
  return now;
}

PREPARE (curve_prepare, pw_on_curve, curve) {
  *element = (curve){ { definition->at[0], definition->at[1] } };
  internal[0] = (pw_internal){ 0, definition->start, definition->rate, INITIAL_SPECIFIED (definition) };
  return PW_OK;
}

PER_ELEMENT (curve_g, curve, 2) {
  out[0] = now.body->x + now.arm[0] - now.X[0];
  out[1] = now.body->y + now.arm[1] - now.Y[0];
}

/* s X_s: the round-off of s changes X by eps s X_s, after many laps more than eps X. */
PER_ELEMENT (curve_g_size, curve, 2) {
  out[0] = fabs (now.body->x) + fabs (now.arm[0]) + fabs (now.X[0]) + fabs (now.s * now.X[1]);
  out[1] = fabs (now.body->y) + fabs (now.arm[1]) + fabs (now.Y[0]) + fabs (now.s * now.Y[1]);
}

PER_ELEMENT (curve_J, curve, 8) {
  out[0] = 1, out[1] = 0, out[2] = -now.arm[1], out[3] = -now.X[1];
  out[4] = 0, out[5] = 1, out[6] = now.arm[0], out[7] = -now.Y[1];
}

PER_ELEMENT (curve_gamma, curve, 2) {
  double turn = now.body->omega * now.body->omega, along = now.rate * now.rate;
  out[0] = now.arm[0] * turn + now.X[2] * along;
  out[1] = now.arm[1] * turn + now.Y[2] * along;
}

/* Columns of the angle and of s; the others are 0. */
static inline void curve_columns (double *out, double x_phi, double x_s, double y_phi, double y_s) {
  out[0] = out[1] = out[4] = out[5] = 0;
  out[2] = x_phi, out[3] = x_s, out[6] = y_phi, out[7] = y_s;
}

PER_ELEMENT (curve_jw_q, curve, 8) {
  curve_columns (out, -now.arm[0] * now.w[2], -now.X[2] * now.w[3], -now.arm[1] * now.w[2], -now.Y[2] * now.w[3]);
}

PER_ELEMENT (curve_gamma_v, curve, 8) {
  double omega = now.body->omega;
  curve_columns (out, 2 * now.arm[0] * omega, 2 * now.X[2] * now.rate, 2 * now.arm[1] * omega, 2 * now.Y[2] * now.rate);
}

static const pw_field curve_fields[] = {
  { PW_AT (pw_on_curve, body), PW_BODY, .required = 1, .about = "the body with the point" },
  { PW_AT (pw_on_curve, at), PW_POINT, .unit = "m", .about = "the point in the body's frame" },
  { PW_AT (pw_on_curve, x), PW_SIGNAL, .unit = "m", .required = 1,
    .about = "x of the curve in the world, as a function of its parameter s, with two derivatives" },
  { PW_AT (pw_on_curve, y), PW_SIGNAL, .unit = "m", .required = 1, .about = "y of the curve, a function of s" },
  { PW_AT (pw_on_curve, start), PW_NUMBER, .given = offsetof (pw_on_curve, specified[0]),
    .about = "initial s; left out: it follows from the body's position" },
  { PW_AT (pw_on_curve, rate), PW_NUMBER, .unit = "1/s", .given = offsetof (pw_on_curve, specified[1]),
    .about = "initial velocity of s; left out: it follows from the body's velocity" },
  { .name = NULL },
};

static const pw_quantity curve_reaction[] = {
  { "Fx", "N", NULL, "force of the curve on the body at its point, along x" },
  { "Fy", "N", NULL, "force of the curve on the body at its point, along y" },
};

static const pw_quantity curve_coordinate[] = {
  { "s", "", "s_rate", "parameter of the curve, in the unit that x and y imply" },
};

const pw_kind pw_kind_on_curve = {
  .name = "on-curve",
  .about = "a point of a body stays on a curve that is given by functions of a parameter",
  .symbol = "o 0 0 0 .4; 0 -.4 0 0 .4 0",
  TYPE (curve, pw_on_curve, curve),
  .bodies = 1,
  .internal = 1,
  .rows = 2,
  .signals = 2,
  .level = PW_HOLONOMIC,
  .of_coordinate = 1,
  .reaction = curve_reaction,
  .coordinate = curve_coordinate,
  POSITION (curve),
  .J = curve_J,
  .gamma = curve_gamma,
  .jw_q = curve_jw_q,
  .gamma_q = PW_BY_DIFFERENCES,
  .gamma_v = curve_gamma_v,
};
