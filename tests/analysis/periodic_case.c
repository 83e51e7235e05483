/* Searches for periodic motions that must succeed. */
#include "periodic_case.h"
#include "check.h"

pw_periodic *periodic_open (const pw_system *s, const pw_periodic_settings *set) {
  pw_error error = { 0 };
  pw_periodic *x = pw_periodic_open (s, set, &error);
  check_ok (x ? PW_OK : error.status, &error);
  return x;
}

pw_periodic_orbit periodic_solve (pw_periodic *x, int settle, double parameter) {
  pw_error error = { 0 };
  pw_periodic_orbit o;
  check_ok (pw_periodic_solve (x, settle, parameter, &o, &error), &error);
  check_below ("residual", o.residual, 1e-10, "Newton to round-off, times the growth over a period");
  return o;
}
