/* adams: Adams-Moulton formulas of orders 1 to 12 with variable steps, for scenes that are not stiff, by CVODES.  The
 * iteration is functional: it needs no matrix, and converges only where the step resolves every motion. */
#include <cvodes/cvodes.h>
#include "multistep.h"

static int adams_open (pw_run *r, pw_error *error) {
  return pw_multistep_open (r, CV_ADAMS, error);
}

static const pw_stabilisation adams_stabilisations[] = {
  PW_ACCELERATION_STABILISATIONS,
  { .name = NULL },
};

/* Measured on the EzyRoller at rtol 1e-6: with a restart after each projected step 100 times the steps.  Projecting in
 * each evaluation alone lets y drift all the same, and on a pendulum made errors 7 times larger. */
static const pw_stabilisation adams_refused[] = {
  { .name = "projection",
    .about = "CVODES projects with bdf only, and restarts behind each projection would leave order 1; "
             "take bdf+projection or erk8+projection" },
  { .name = NULL },
};

static const pw_option adams_options[] = {
  PW_BAUMGARTE_OPTIONS,
  { .name = NULL },
};

const pw_method pw_method_adams = {
  .name = "adams",
  .about = "variable-order Adams on the accelerations, where nothing is stiff, SUNDIALS CVODES (Hindmarsh et al. 2005)",
  .adaptive = 1,
  .stabilisations = adams_stabilisations,
  .options = adams_options,
  .refused = adams_refused,
  .open = adams_open,
  .advance = pw_multistep_advance,
  .at = pw_multistep_at,
  .restart = pw_multistep_restart,
  .close = pw_multistep_close,
};
