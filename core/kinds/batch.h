/* Batch functions and `prepare` functions of element types, written for one element; members of their tables.
 *
 * Notation in the files of element types: ' = d/dt; r = (x, y), phi, omega = phi': centre of mass, angle and angular
 * velocity of a body; R(phi): its rotation matrix; s: a point in its frame; indices 1, 2: of body 1, 2.  q, v = q':
 * local coordinates and velocities of an element; f: its generalised force; G, S: its rows of J, of position and
 * velocity constraints; u: its signal; V: its potential energy. */
#ifndef PW_BATCH_H
#define PW_BATCH_H

#include <float.h>
#include <math.h>
#include "pinwheel.h"

/* Inlines all calls in a function, so that it computes no part of a state that it does not use. */
#define FLATTEN __attribute__ ((flatten))
#define MAYBE_UNUSED __attribute__ ((unused))

/* WHERE (condition, x): x where the condition holds, else an arbitrary number.  Code for several runs at once
 * (PW_LANES) has no branches; functions of libm are called for one run after the other, by the names that the x86-64
 * vector function ABI gives to their forms for vector registers. */
#ifndef PW_LANES
#define WHERE(condition, x) ((condition) ? (x) : 0)
#else
#define WHERE(condition, x) (x)
#if defined __AVX512F__
enum { LIBM_LANES = 8 };
#define LIBM_NAME "_ZGVeN8v"
#elif defined __AVX2__
enum { LIBM_LANES = 4 };
#define LIBM_NAME "_ZGVdN4v"
#else
enum { LIBM_LANES = 2 };
#define LIBM_NAME "_ZGVbN2v"
#endif
typedef double libm_lanes __attribute__ ((vector_size (8 * LIBM_LANES)));
#define LIBM(...) static __attribute__ ((used)) libm_lanes __VA_ARGS__
#pragma omp declare simd notinbranch
extern double tanh (double x);
#pragma omp declare simd notinbranch
extern double hypot (double x, double y);
LIBM (libm_tanh (libm_lanes x) __asm__(LIBM_NAME "_tanh"));
LIBM (libm_hypot (libm_lanes x, libm_lanes y) __asm__(LIBM_NAME "v_hypot"));
/* Not inlined: the compiler would turn the loops over lanes into calls of the very functions that they define. */
__attribute__ ((noinline)) static double one_tanh (double x) {
  return tanh (x);
}
__attribute__ ((noinline)) static double one_hypot (double x, double y) {
  return hypot (x, y);
}
LIBM (libm_tanh (libm_lanes x)) {
  for (int i = 0; i < LIBM_LANES; i++) x[i] = one_tanh (x[i]);
  return x;
}
LIBM (libm_hypot (libm_lanes x, libm_lanes y)) {
  for (int i = 0; i < LIBM_LANES; i++) x[i] = one_hypot (x[i], y[i]);
  return x;
}
#endif

/* PER_ELEMENT (rod_J, rod, 6) { ... } defines the batch function rod_J, and rod_J_one, the same for one element.  The
 * braces contain the body of the latter: it fills `out`, the 6 numbers of the element, from `now`, a rod_state: the
 * element in the current state of the scene, as rod_at (batch, e) returns it. */
#define PER_ELEMENT(function, type, size)                                                           \
  static inline void function##_one (type##_state now, double *out);                                \
  FLATTEN static inline void function (const pw_batch *batch, double *out) {                        \
    for (int e = 0; e < batch->count; e++, out += size) function##_one (type##_at (batch, e), out); \
  }                                                                                                 \
  static inline void function##_one (type##_state now, double *out)

/* J_GAMMA (rod, 6, 1) defines rod_J_gamma from rod_J and rod_gamma, which fill 6 numbers and 1. */
#define J_GAMMA(type, size_J, size_gamma)                                                       \
  FLATTEN static inline void type##_J_gamma (const pw_batch *batch, double *J, double *gamma) { \
    for (int e = 0; e < batch->count; e++, J += size_J, gamma += size_gamma) {                  \
      const type##_state now = type##_at (batch, e);                                            \
      type##_J_one (now, J);                                                                    \
      type##_gamma_one (now, gamma);                                                            \
    }                                                                                           \
  }

/* PREPARE (gear_prepare, pw_gear, gear) { ... } defines a `prepare`: it fills `element`, a gear, from `definition`, a
 * pw_gear, may use its other parameters `bodies`, `internal` and `error`, and returns a status.  All members of a gear
 * are doubles, even a flag: specialised code for several runs copies the elements as arrays of doubles. */
#define PREPARE(function, definition_type, type)                                                                    \
  static inline int function##_one (const definition_type *definition, const pw_body *const *bodies, type *element, \
                                    pw_internal *internal, pw_error *error);                                        \
  static int function (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,  \
                       pw_error *error) {                                                                           \
    return function##_one (definition, bodies, element, internal, error);                                           \
  }                                                                                                                 \
  static inline int function##_one (const definition_type *definition, MAYBE_UNUSED const pw_body *const *bodies,   \
                                    type *element, MAYBE_UNUSED pw_internal *internal, MAYBE_UNUSED pw_error *error)

/* pw_internal.specified, of a definition with `start`, `rate` and `specified`. */
#define INITIAL_SPECIFIED(definition)                              \
  {                                                                \
    (definition)->specified[0] != 0 || (definition)->start != 0,   \
        (definition)->specified[1] != 0 || (definition)->rate != 0 \
  }

/* Groups of members of a type's table: TYPE (weld, ...) sets .fields = weld_fields, .prepare = weld_prepare, ... */
#define TYPE(type, definition_type, element_type)                                                    \
  .definition = sizeof (definition_type), .fields = type##_fields, .element = sizeof (element_type), \
  .prepare = type##_prepare
#define POSITION(type) .g = type##_g, .g_size = type##_g_size
#define DERIVATIVES(type) .jw_q = type##_jw_q, .gamma_q = type##_gamma_q, .gamma_v = type##_gamma_v
#define CONSTRAINT(type) .J = type##_J, .gamma = type##_gamma, DERIVATIVES (type)
#define EACH_DERIVATIVE(X) X (jw_q) X (gamma_q) X (gamma_v) /* X: a macro that defines the function of one */
#define FORCE(type) .force = type##_force, .force_q = type##_force_q, .force_v = type##_force_v

/* The two bodies of a definition. */
#define BODIES_FIELD(type) \
  { PW_AT (type, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" }

/* The only reaction of a type: its name, unit and meaning. */
#define REACTION(name, unit, about)  \
  .reaction = &(const pw_quantity) { \
    name, unit, NULL, about          \
  }

/* 1 if a limit is a signal other than 0. */
static inline int limit_is_nonzero (const pw_signal *limit) {
  return limit->type != PW_CONSTANT || limit->constant != 0;
}

/* 1 if a limit is specified, be it 0. */
static inline int limit_given (const pw_signal *limit) {
  return limit->specified || limit_is_nonzero (limit);
}

/* Checks the limit of a multiplier while its equation holds, and that at which it does not (default: the same), as far
 * as they are constants.  field: the name of the former. */
static inline int limit_check (const char *field, const pw_signal *most, const pw_signal *sliding, pw_error *error) {
  const double largest = most->type == PW_CONSTANT ? most->constant : INFINITY;
  if (largest < 0) return pw_fail (error, PW_INPUT, "%s = %g: expected a number >= 0", field, largest);
  if (!limit_given (most) && limit_is_nonzero (sliding))
    return pw_fail (error, PW_INPUT, "%s_sliding without %s", field, field);
  if (sliding->type == PW_CONSTANT && sliding->constant < 0)
    return pw_fail (error, PW_INPUT, "%s_sliding = %g: expected a number >= 0", field, sliding->constant);
  if (sliding->type == PW_CONSTANT && sliding->constant > largest)
    return pw_fail (error, PW_INPUT, "%s_sliding = %g: expected at most the %s, %g", field, sliding->constant, field,
                    largest);
  return PW_OK;
}

/* pw_kind.limits of a multiplier between opposite limits, if they are given. */
static inline void limit_both_sides (const pw_signal *most, const pw_signal *sliding, pw_bounds *limit) {
  if (!limit_given (most)) return; /* constant 0 is a limit, with which the equation never holds */
  if (!limit_given (sliding)) sliding = most;
  *limit = (pw_bounds){ -most->constant, most->constant, { -sliding->constant, sliding->constant }, .circle = 0 };
  if (most->type != PW_CONSTANT) limit->least = -DBL_MAX, limit->most = DBL_MAX, limit->signal[0] = most;
  if (sliding->type != PW_CONSTANT) limit->signal[1] = sliding;
}

/* The vector w of an element; NULL where the batch has none. */
static inline const double *batch_w (const pw_batch *batch, int e) {
  return batch->w ? batch->w + e * batch->cols : NULL;
}

/* Body i of the batch in its current state: body n (from 0) of element e is i = e x bodies of an element + n. */
static inline const pw_configuration *batch_body (const pw_batch *batch, int i) {
  return &batch->configuration[batch->body[i]];
}

/* The element's only signal: eta of a velocity constraint equation, or the force on a first-order state. */
static inline void batch_signal (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) out[e] = batch->u[3 * e];
}

/* Its derivative with respect to the signal. */
static inline void batch_signal_u (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) out[e] = 1;
}

/* A vector given in a body's frame, in world axes. */
static inline void to_world (const pw_configuration *body, const double s[2], double out[2]) {
  out[0] = body->cos * s[0] - body->sin * s[1];
  out[1] = body->sin * s[0] + body->cos * s[1];
}

/* The velocities of two bodies, in the order of local coordinates. */
static inline void velocities_of (const pw_configuration *body1, const pw_configuration *body2, double v[6]) {
  v[0] = body1->vx, v[1] = body1->vy, v[2] = body1->omega, v[3] = body2->vx, v[4] = body2->vy, v[5] = body2->omega;
}

/* F limited smoothly to L tanh (F / L); F itself if L = 0.  *slope: derivative with respect to F. */
static inline double limited_force (double F, double L, double *slope) {
  double y = WHERE (L > 0, tanh (F / L));
  *slope = L > 0 ? 1 - y * y : 1;
  return L > 0 ? L * y : F;
}

/* The generalised force of a torque T on body 1 and -T on body 2. */
static inline void opposite_moments (double T, double *out) {
  out[0] = out[1] = out[3] = out[4] = 0, out[2] = T, out[5] = -T;
}

/* Its derivative with respect to q or v, 6 x 6, for T = -slope (phi1 - phi2) or T = -slope (omega1 - omega2). */
static inline void opposite_moments_block (double slope, double *out) {
  for (int i = 0; i < 36; i++) out[i] = 0;
  out[14] = out[35] = -slope, out[17] = out[32] = slope;
}

#endif
