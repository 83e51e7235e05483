/* Batch functions and `prepare` functions of element types, written for one element; members of their tables. */
#ifndef PW_BATCH_H
#define PW_BATCH_H

#include <math.h>
#include "pinwheel.h"

/* Inlines all calls in a function, so that it computes no more of a state than it uses. */
#if defined(__GNUC__)
#define FLATTEN __attribute__ ((flatten))
#else
#define FLATTEN
#endif

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

/* PER_ELEMENT (pin_J, pin, 12) { ... } defines the batch function pin_J.  The body fills `out`, the 12 numbers of one
 * element, from `x`, a pin_state: the element in its current state, as pin_at (b, e) returns it. */
#define PER_ELEMENT(function, type, size)                                                   \
  static inline void function##_one (type##_state x, double *out);                          \
  FLATTEN static inline void function (const pw_batch *b, double *out) {                    \
    for (int e = 0; e < b->count; e++, out += size) function##_one (type##_at (b, e), out); \
  }                                                                                         \
  static inline void function##_one (type##_state x, double *out)

/* PREPARE (pin_prepare, pw_pin, pin) { ... } defines a `prepare` that cannot fail: it fills `k`, a pin, from the
 * definition `d`. */
#define PREPARE(function, definition_type, type)                                                                   \
  static inline void function##_one (const definition_type *d, type *k);                                           \
  static int function (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal, \
                       pw_error *error) {                                                                          \
    (void)bodies, (void)internal, (void)error;                                                                     \
    function##_one (definition, element);                                                                          \
    return PW_OK;                                                                                                  \
  }                                                                                                                \
  static inline void function##_one (const definition_type *d, type *k)

/* Members of a type's table. */
#define DEFINITION(type, table) .definition = sizeof (type), .fields = table
#define ELEMENT(type, function) .element = sizeof (type), .prepare = function

/* The vector w of an element; NULL where the batch has none. */
static inline const double *batch_w (const pw_batch *b, int e) {
  return b->w ? b->w + e * b->cols : NULL;
}

#endif
