/* Viscous friction and regularised Coulomb friction, which oppose a relative velocity v.  If v is an angular velocity,
 * F is a torque.
 *
 *   F = c v + L tanh (v / v0),  dF/dv = c + (L / v0) (1 - tanh^2 (v / v0)),  loss = F v >= 0
 *
 * (Andersson, Soderberg & Bjorklund 2007, Tribology International 40, 580-587, for the smoothing by tanh.)
 * The limit L (friction coefficient times normal load) is constant, since forces cannot depend on multipliers.  The
 * regularised law cannot stick: under an applied force or torque P < L it creeps, for c = 0 at v0 atanh (P / L). */
#ifndef PW_COULOMB_H
#define PW_COULOMB_H

#include "batch.h"

typedef struct {
  double viscous, limit; /* c, L */
  double inverse;        /* 1 / v0; 0 without a limit */
} coulomb;

static inline int coulomb_make (double viscous, double limit, double speed, coulomb *law, pw_error *error) {
  *law = (coulomb){ viscous, limit, limit > 0 ? 1 / speed : 0 };
  if (limit > 0 && !(speed > 0 && isfinite (limit * law->inverse)))
    return pw_fail (error, PW_INPUT,
                    "speed = %g: expected > 0, and limit / speed finite, since the limit is smoothed below this speed",
                    speed);
  return PW_OK;
}

static inline double coulomb_force (const coulomb *law, double v) {
  return law->viscous * v + law->limit * tanh (v * law->inverse);
}

/* dF/dv */
static inline double coulomb_slope (const coulomb *law, double v) {
  double y = tanh (v * law->inverse);
  return law->viscous + law->limit * law->inverse * (1 - y * y);
}

/* The change of a coordinate or velocity x that changes v by v0 + |v|, which reverses the force; derivative: dv/dx.
 * INFINITY if the force does not saturate or x does not change v. */
static inline double coulomb_saturation (const coulomb *law, double v, double derivative) {
  return derivative != 0 && law->inverse > 0 ? (1 / law->inverse + fabs (v)) / fabs (derivative) : INFINITY;
}

/* COULOMB (friction, 6) defines friction_force, friction_force_v, friction_saturation and friction_loss for elements
 * with 6 local coordinates q and f = -F S, v = S q'.  friction_state has the members law, v, S[6], v_q[6] = dv/dq. */
#define COULOMB(type, cols)                                                                    \
  PER_ELEMENT (type##_force, type, cols) {                                                     \
    double F = coulomb_force (now.law, now.v);                                                 \
    for (int i = 0; i < cols; i++) out[i] = -F * now.S[i];                                     \
  }                                                                                            \
  PER_ELEMENT (type##_force_v, type, cols *cols) {                                             \
    double slope = coulomb_slope (now.law, now.v);                                             \
    for (int i = 0; i < cols * cols; i++) out[i] = -slope * now.S[i / cols] * now.S[i % cols]; \
  }                                                                                            \
  PER_ELEMENT (type##_saturation, type, 2 * cols) {                                            \
    for (int i = 0; i < cols; i++) {                                                           \
      out[i] = coulomb_saturation (now.law, now.v, now.v_q[i]);                                \
      out[cols + i] = coulomb_saturation (now.law, now.v, now.S[i]);                           \
    }                                                                                          \
  }                                                                                            \
  PER_ELEMENT (type##_loss, type, 1) {                                                         \
    *out = coulomb_force (now.law, now.v) * now.v;                                             \
  }

#endif
