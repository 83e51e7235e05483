/* bdf: backward differentiation formulas of orders 1 to 5 with variable steps, for stiff scenes (Curtiss & Hirschfelder
 * 1952; Gear 1971), by CVODES.  The iteration is Newton's, its matrix exact: multistep_newton.c.  With projection each
 * step is projected and so is its error (Eich 1993). */
#include <cvodes/cvodes.h>
#include "multistep.h"

static int bdf_open (pw_run *r, pw_error *error) {
  return pw_multistep_open (r, CV_BDF, error);
}

static const pw_stabilisation bdf_stabilisations[] = {
  PW_ACCELERATION_STABILISATIONS,
  { "projection", "coordinate projection onto positions and rates after each step (Lubich 1991, Eich 1993)",
    PW_PROJECTION },
  { .name = NULL },
};

static const pw_option bdf_options[] = {
  PW_BAUMGARTE_OPTIONS,
  PW_PROJECTION_OPTIONS,
  { .name = NULL },
};

const pw_method pw_method_bdf = {
  .name = "bdf",
  .about =
      "variable-order BDF on the accelerations, for stiff scenes, SUNDIALS CVODES with KLU (Hindmarsh et al. 2005)",
  .adaptive = 1,
  .stabilisations = bdf_stabilisations,
  .options = bdf_options,
  .open = bdf_open,
  .advance = pw_multistep_advance,
  .at = pw_multistep_at,
  .restart = pw_multistep_restart,
  .close = pw_multistep_close,
};
