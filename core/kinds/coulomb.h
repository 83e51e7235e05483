/* Viscous friction and regularised Coulomb friction, opposing a relative velocity w.
 *
 *   F = c w + L tanh (w / w0),  dF/dw = c + (L / w0) (1 - tanh^2 (w / w0)),  loss = F w >= 0
 *
 * (Andersson, Soderberg & Bjorklund 2007, Tribology International 40, 580-587, for the smoothing by tanh.)
 * The limit L (friction coefficient times normal load) is constant, since forces cannot depend on multipliers.  The
 * regularised law cannot stick: under a load M < L it creeps at w0 atanh (M / L). */
#ifndef PW_COULOMB_H
#define PW_COULOMB_H

#include <math.h>
#include "batch.h"

typedef struct {
  double viscous, limit; /* c, L */
  double inverse;        /* 1 / w0; 0 without a limit */
} coulomb;

static inline int coulomb_make (double viscous, double limit, double speed, coulomb *k, pw_error *error) {
  *k = (coulomb){ viscous, limit, limit > 0 ? 1 / speed : 0 };
  if (limit > 0 && !(speed > 0))
    return pw_fail (error, PW_INPUT, "speed = %g: expected > 0, since below it the limit is smoothed", speed);
  return PW_OK;
}

static inline double coulomb_force (const coulomb *k, double w) {
  return k->viscous * w + k->limit * tanh (w * k->inverse);
}

static inline double coulomb_slope (const coulomb *k, double w) {
  double y = tanh (w * k->inverse);
  return k->viscous + k->limit * k->inverse * (1 - y * y);
}

/* The change of a variable that reverses the force, `per` being dw/d(variable); INFINITY without a limit. */
static inline double coulomb_saturation (const coulomb *k, double w, double per) {
  return per != 0 && k->inverse > 0 ? (1 / k->inverse + fabs (w)) / fabs (per) : INFINITY;
}

#endif
