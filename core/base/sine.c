/* Sine and cosine of one angle [rad]; from PW_SINE_LIMIT on, and for infinity and NaN, those of the C library. */
#include <math.h>
#include "pinwheel.h"
#include "sine.h"

void pw_sin_cos (double x, double *sine, double *cosine) {
  if (fabs (x) < PW_SINE_LIMIT) {
    pw_lanes s, c;
    pw_sin_cos_lanes ((pw_lanes){ x }, &s, &c);
    *sine = s[0];
    *cosine = c[0];
  } else {
    *sine = sin (x);
    *cosine = cos (x);
  }
}

double pw_sin (double x) {
  double s, c;
  pw_sin_cos (x, &s, &c);
  return s;
}

double pw_cos (double x) {
  double s, c;
  pw_sin_cos (x, &s, &c);
  return c;
}
