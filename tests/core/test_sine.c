/* pw_sin_cos compared with known digits and the C library's long double functions: errors of at most 1 ulp for |x| <
 * 1e6, the same bits in every build. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "check.h"
#include "pinwheel.h"
#include "sine.h"

enum { SINE_RANDOM = 200000 };

/* Sines and cosines of these doubles, by bc with 90 digits: common angles, and those next to multiples of pi/2, where
 * the reduction of the angle loses digits. */
static const struct {
  double x;
  long double sine, cosine;
} sine_table[] = {
  { 1e-300, 1.00000000000000000000000000000000e-300L, 1.00000000000000000000000000000000e+0L },
  { 1e-09, 1.00000000000000006211492479111319e-9L, 9.99999999999999999500000000000000e-1L },
  { 0.1, 9.98334166468281578301968678586167e-2L, 9.95004165278025765541375198862345e-1L },
  { 0.5, 4.79425538604203000273287935215571e-1L, 8.77582561890372716116281582603830e-1L },
  { 0.785398163397448, 7.07106781186547267238074153651211e-1L, 7.07106781186547781563614570558393e-1L },
  { 0.7853981633974484, 7.07106781186547581256565890406268e-1L, 7.07106781186547467545122833803426e-1L },
  { 1.0, 8.41470984807896506652502321630299e-1L, 5.40302305868139717400936607442977e-1L },
  { 2.0, 9.09297426825681695396019865911745e-1L, -4.16146836547142386997568229500762e-1L },
  { 3.0, 1.41120008059867222100744802808110e-1L, -9.89992496600445457271572794731261e-1L },
  { -0.8126236808153919, -7.26093703218707500889665849357100e-1L, 6.87595763618525730487875626856039e-1L },
  { -216393.63055816575, -6.65809995228306014105822751669194e-1L, 7.46121337487464650464565810259803e-1L },
  { 999999.9999999999, -3.49993502280345252514117773840330e-1L, 9.36752127492400180739577777967930e-1L },
  { 123456.789, -9.98664082343224525310144150599457e-1L, 5.16725327187013826628768732674191e-2L },
  { -350000.0, -9.92179272095540712667532026683554e-1L, 1.24821039989109954976689709520220e-1L },
  { 1.5707963267948966, 9.99999999999999999999999999999998e-1L, 6.12323399573676588613032966137500e-17L },
  { 3.141592653589793, 1.22464679914735317722606593227500e-16L, -9.99999999999999999999999999999993e-1L },
  { 4.71238898038469, -9.99999999999999999999999999999983e-1L, -1.83697019872102976583909889841249e-16L },
  { 6.283185307179586, -2.44929359829470635445213186454998e-16L, 9.99999999999999999999999999999970e-1L },
  { 7.853981633974483, 9.99999999999999999999999999999953e-1L, 3.06161699786838294306516483068745e-16L },
  { 10.995574287564276, -9.99999999999999999999999999999908e-1L, -4.28626379701573612029123076296237e-16L },
  { 17.278759594743864, -9.99999999999999999999999999999392e-1L, 1.10280109986920621720347440619384e-15L },
  { 34.55751918948773, -2.20560219973841243440694881238634e-15L, -9.99999999999999999999999999997568e-1L },
  { 111.52653920243766, -9.99999999999999999999999999999518e-1L, 9.81574381227647614880897947259526e-16L },
  { 160.22122533307945, 9.79841235445200213320855759233634e-15L, -9.99999999999999999999999999951996e-1L },
  { 557.6326960121883, -9.99999999999999999999999999288424e-1L, -3.77246922394677730778629663094411e-14L },
  { 1115.2653920243765, 7.54493844789355461557259325651942e-14L, -9.99999999999999999999999997153695e-1L },
  { 1572.3671231216915, 9.99999999999999999999999999990180e-1L, -4.43163076048424067291439484059825e-15L },
  { 52173.99999449249, -9.99999999999999999999998415789387e-1L, 1.78000596250837095858506956923177e-12L },
  { 163351.82241238168, 9.99999999999999999999969069286599e-1L, 7.86520354480094608968682702655571e-12L },
  { 327261.27752077556, 9.99999999999999999999984292022756e-1L, -5.60499370982245363855170941737785e-12L },
  { 491170.7326291694, 9.99999999999999999999949713194967e-1L, 1.00286394922878502464906962484143e-11L },
  { 785399.7341937751, 9.99999999999999999999999988220752e-1L, 1.53487772148891579550734447825819e-13L },
  { 999997.2159715135, -3.89542701728671046382992314424250e-11L, -9.99999999999999999999241282417650e-1L },
  { 999998.7867678403, -9.99999999999999999999762015039322e-1L, -2.18167348921948213764406282079986e-11L },
  { 183107.7278144811, 4.52088120141626386682018442578027e-16L, -9.99999999999999999999999999999898e-1L },
  { 229174.47169039503, 9.99999999999999999999999999999950e-1L, 3.16157416209738022857211930314902e-16L },
  { 321307.9594422229, -9.99999999999999999999999999999999e-1L, -4.42960083459612952075989057886354e-17L },
};

static const char sine_bound[] = "the documented accuracy; 0.78 ulp is the largest known";

/* The error of a value in units of the last place of the exact one. */
static double sine_ulp (double value, long double exact) {
  int exponent;
  frexp ((double)exact, &exponent);
  return (double)fabsl (((long double)value - exact) / ldexpl (1, exponent - DBL_MANT_DIG));
}

/* Angles of all sizes below 1e6, the same in every build: a linear congruential generator (Knuth 1998, MMIX). */
static double sine_angle (uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  double part = (double)(*state >> 11) / 9007199254740992.0;
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (*state >> 63 ? -1e6 : 1e6) * part * (double)(*state >> 40 & 0xff) / (double)(1u << (*state >> 50 & 0x1f));
}

static void test_table (void **unused) {
  (void)unused;
  for (size_t i = 0; i < sizeof sine_table / sizeof *sine_table; i++) {
    double s, c;
    pw_sin_cos (sine_table[i].x, &s, &c);
    check_below ("ulp", sine_ulp (s, sine_table[i].sine), 1, sine_bound);
    check_below ("ulp", sine_ulp (c, sine_table[i].cosine), 1, sine_bound);
  }
}

static void test_random (void **unused) {
  (void)unused;
  uint64_t state = 1, hash = 14695981039346656037u; /* FNV-1a of all bits */
  for (int i = 0; i < SINE_RANDOM; i++) {
    double x = fmod (sine_angle (&state), 1e6), value[2];
    pw_sin_cos (x, &value[0], &value[1]);
    if (LDBL_MANT_DIG > DBL_MANT_DIG) {
      check_below ("ulp", sine_ulp (value[0], sinl (x)), 1, sine_bound);
      check_below ("ulp", sine_ulp (value[1], cosl (x)), 1, sine_bound);
    }
    for (int k = 0; k < 2; k++) {
      uint64_t bits;
      memcpy (&bits, &value[k], sizeof bits);
      hash = (hash ^ bits) * 1099511628211u;
    }
  }
  assert_true (hash == 2139304563643676396u); /* by gcc and clang, -O0 to -O3, x86-64 and x86-64-v3 */
}

/* Every lane of the vectorised function gives the bits of pw_sin_cos. */
static void test_lanes (void **unused) {
  (void)unused;
  uint64_t state = 2;
  for (int i = 0; i < 1000; i++) {
    pw_lanes x, s, c;
    for (int k = 0; k < PW_SINE_LANES; k++) x[k] = sine_angle (&state) / 256;
    pw_sin_cos_lanes (x, &s, &c);
    for (int k = 0; k < PW_SINE_LANES; k++) {
      double sine, cosine;
      pw_sin_cos (x[k], &sine, &cosine);
      assert_true (s[k] == sine && c[k] == cosine);
    }
  }
}

static void test_special (void **unused) {
  (void)unused;
  const double beyond[] = { 1e6, -1e6, 1234567.5, 1e22, 1.7e308 };
  for (size_t i = 0; i < sizeof beyond / sizeof *beyond; i++) {
    assert_true (pw_sin (beyond[i]) == sin (beyond[i]));
    assert_true (pw_cos (beyond[i]) == cos (beyond[i]));
  }
  assert_true (isnan (pw_sin (NAN)) && isnan (pw_cos (NAN)) && isnan (pw_sin (INFINITY)) && isnan (pw_cos (-INFINITY)));
  assert_true (pw_sin (0.) == 0 && !signbit (pw_sin (0.)) && signbit (pw_sin (-0.)) && pw_cos (-0.) == 1);
  assert_true (pw_sin (5e-324) == 5e-324);
}

int main (void) {
  const struct CMUnitTest tests[] = { cmocka_unit_test (test_table), cmocka_unit_test (test_random),
                                      cmocka_unit_test (test_lanes), cmocka_unit_test (test_special) };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
