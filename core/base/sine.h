/* Sine and cosine of angles x, to 0.8 ulp for |x| < PW_SINE_LIMIT, in all lanes of a vector register at once.
 *
 * x = n pi/2 + y + lo, where n is an integer, |y| <= pi/4 and lo is below the round-off of y: pi/2 is the sum of three
 * parts of 33 bits, whose products with n are exact, and a tail (Cody & Waite 1980), and lo collects the tail and the
 * round-off of the differences, so that y + lo is accurate next to multiples of pi/2 too.  Sine and cosine of y + lo
 * are the polynomials of fdlibm (Sun Microsystems 1993, k_sin.c and k_cos.c).  There are no branches and, with
 * -ffp-contract=off, no fused multiply-adds, so that the bits do not depend on C library, compiler or processor. */
#ifndef PW_SINE_H
#define PW_SINE_H

#include <stdint.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "-ffast-math and -Ofast break the argument reduction"
#endif

enum { PW_SINE_LANES = 2 };
#define PW_SINE_LIMIT 1e6 /* [rad]: n has at most 20 bits, and its product with 33 bits fits into 53 */

#ifndef PW_LANES /* GNU C vectors, whose operators act on each lane */
typedef double pw_lanes __attribute__ ((vector_size (8 * PW_SINE_LANES)));
typedef uint64_t pw_lane_bits __attribute__ ((vector_size (8 * PW_SINE_LANES)));
#else /* code specialised for several runs at once: the angle of one run, in a loop that the compiler vectorises */
typedef double pw_lanes;
typedef uint64_t pw_lane_bits;
#endif

static inline pw_lane_bits pw_sine_bits (pw_lanes x) {
  pw_lane_bits bits;
  memcpy (&bits, &x, sizeof bits);
  return bits;
}

static inline pw_lanes pw_sine_value (pw_lane_bits bits) {
  pw_lanes x;
  memcpy (&x, &bits, sizeof x);
  return x;
}

static inline pw_lanes pw_sine_polynomial (pw_lanes y, pw_lanes lo) {
  pw_lanes z = y * y, y3 = z * y;
  pw_lanes r =
      8.33333333332248946124e-03 +
      z * (-1.98412698298579493134e-04 +
           z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  return y - ((z * (0.5 * lo - y3 * r) - lo) + y3 * 1.66666666666666324348e-01);
}

static inline pw_lanes pw_cosine_polynomial (pw_lanes y, pw_lanes lo) {
  pw_lanes z = y * y, half = 0.5 * z, w = 1 - half;
  pw_lanes r =
      4.16666666666666019037e-02 +
      z * (-1.38888888888741095749e-03 +
           z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 +
                                                  z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  return w + (((1 - w) - half) + (z * (z * r) - y * lo));
}

/* Reduces |x| < PW_SINE_LIMIT in all lanes to y + lo.  Returns n. */
static inline pw_lane_bits pw_sine_reduce (pw_lanes x, pw_lanes *y, pw_lanes *lo) {
  const double two_by_pi = 6.36619772367581382433e-01;
  const double half_pi_1 = 1.57079632673412561417e+00, half_pi_2 = 6.07710050630396597660e-11,
               half_pi_3 = 2.02226624871116645580e-21, half_pi_tail = 8.47842766036889956997e-32;
  const double integers = 6755399441055744.0; /* 1.5 x 2^52: adding it rounds to an integer, in the sum's last bits */
  pw_lanes shifted = x * two_by_pi + integers, n = shifted - integers;
  pw_lanes y1 = x - n * half_pi_1, part2 = n * half_pi_2, part3 = n * half_pi_3, y2 = y1 - part2;
  *y = y2 - part3;
  /* The round-off of both differences, exactly (Dekker 1971).  If the minuend is the smaller number, the difference
   * is exact and this gives 0. */
  *lo = (((y1 - y2) - part2) + ((y2 - *y) - part3)) - n * half_pi_tail;
  return pw_sine_bits (shifted);
}

/* For |x| < PW_SINE_LIMIT in all lanes. */
static inline void pw_sin_cos_lanes (pw_lanes x, pw_lanes *sine, pw_lanes *cosine) {
  pw_lanes y, lo;
  /* In odd quadrants sine and cosine are exchanged; bit 1 of n is the sign of the sine, of n + 1 that of the cosine. */
  pw_lane_bits quadrant = pw_sine_reduce (x, &y, &lo), odd = 0 - (quadrant & 1);
  pw_lane_bits sine_bits = pw_sine_bits (pw_sine_polynomial (y, lo)),
               cosine_bits = pw_sine_bits (pw_cosine_polynomial (y, lo)), swap = (sine_bits ^ cosine_bits) & odd;
  *sine = pw_sine_value (sine_bits ^ swap ^ (quadrant >> 1 << 63));
  *cosine = pw_sine_value (cosine_bits ^ swap ^ ((quadrant + 1) >> 1 << 63));
}

#ifndef PW_LANES
/* sin (x + k pi/2) for |x| < PW_SINE_LIMIT, with the bits of pw_sin_cos_lanes; one polynomial suffices. */
static inline double pw_sine_shifted (double x, uint64_t k) {
  pw_lanes y, lo;
  pw_lane_bits quadrant = pw_sine_reduce ((pw_lanes){ x }, &y, &lo) + k;
  pw_lanes value = quadrant[0] & 1 ? pw_cosine_polynomial (y, lo) : pw_sine_polynomial (y, lo);
  return pw_sine_value (pw_sine_bits (value) ^ (quadrant >> 1 << 63))[0];
}
#endif

#endif
