/* Viscous friction and Coulomb friction, which oppose a relative velocity v.  If v is an angular velocity, F is a
 * torque.  Coulomb friction is exact, or smoothed below a velocity v0:
 *
 *   F = c v + L tanh (v / v0),  dF/dv = c + (L / v0) (1 - tanh^2 (v / v0)),  loss = F v >= 0
 *
 * (Andersson, Soderberg & Bjorklund 2007, Tribology International 40, 580-587, for the smoothing by tanh.)
 * The limit L (friction coefficient times normal load) is constant here, that of exact friction a signal.  The
 * smoothed law cannot stick: under an applied force or torque P < L it creeps, for c = 0 at v0 atanh (P / L).
 *
 * Exact friction is the constraint equation v = 0, whose multiplier lambda is between -L and L.  Beyond them it slides:
 * lambda is the sliding limit with the sign of v, and the loss c v^2 + lambda v.  L above is 0 then. */
#ifndef PW_COULOMB_H
#define PW_COULOMB_H

#include "batch.h"

typedef struct {
  double viscous, limit; /* c, L */
  double inverse;        /* 1 / v0; 0 without a limit */
} coulomb;

static inline int coulomb_make (double viscous, double limit, double speed, coulomb *law, pw_error *error) {
  *law = (coulomb){ viscous, limit, .inverse = limit > 0 ? 1 / speed : 0 };
  if (limit > 0 && !(speed > 0 && isfinite (limit * law->inverse)))
    return pw_fail (error, PW_INPUT,
                    "speed = %g: expected > 0, and limit / speed finite, since the limit is smoothed below this speed",
                    speed);
  return PW_OK;
}

/* The same of a definition, whose limits are signals. */
static inline int coulomb_make_smooth (double viscous, const pw_signal *limit, const pw_signal *sliding, double speed,
                                       coulomb *law, pw_error *error) {
  if (limit->type != PW_CONSTANT)
    return pw_fail (error, PW_INPUT, "limit: a signal: expected a number, unless friction is exact: no speed");
  if (limit_is_nonzero (sliding))
    return pw_fail (error, PW_INPUT, "limit_sliding: expected none, unless friction is exact: a limit, no speed");
  if (limit->constant < 0) return limit_check ("limit", limit, sliding, error);
  return coulomb_make (viscous, limit->constant, speed, law, error);
}

static inline int coulomb_make_exact (double viscous, const pw_signal *limit, const pw_signal *sliding, coulomb *law,
                                      pw_error *error) {
  *law = (coulomb){ .viscous = viscous };
  return limit_check ("limit", limit, sliding, error);
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

/* EXACT_COULOMB (friction, pw_friction) defines the functions of a constraint equation with an element and a state as
 * below: friction_is_exact, friction_limits, friction_exact_J, friction_exact_loss. */
#define EXACT_COULOMB(type, definition_type)                                \
  static int type##_is_exact (const void *definition) {                     \
    const definition_type *x = definition;                                  \
    return limit_is_nonzero (&x->limit) && x->speed == 0;                   \
  }                                                                         \
  static void type##_limits (const void *definition, pw_bounds *limit) {    \
    const definition_type *x = definition;                                  \
    limit_both_sides (&x->limit, &x->limit_sliding, limit);                 \
    limit->initially_slides = 1;                                            \
  }                                                                         \
  PER_ELEMENT (type##_exact_J, type, 6) {                                   \
    for (int i = 0; i < 6; i++) out[i] = now.S[i];                          \
  }                                                                         \
  static void type##_exact_loss (const pw_batch *batch, double *out) {      \
    for (int e = 0; e < batch->count; e++) {                                \
      type##_state now = type##_at (batch, e);                              \
      out[e] = (coulomb_force (now.law, now.v) + batch->lambda[e]) * now.v; \
    }                                                                       \
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
