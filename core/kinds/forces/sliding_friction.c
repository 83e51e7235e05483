/* sliding-friction: a force opposing the motion of a point of body 1 along a line of body 2, as in a slider or slot.
 *
 *   g = e . (r1 + R(phi1) s1 - r2) - c,  S = dg/dq,  v = S q'          e: unit vector along the line
 *   f = -F S,  loss = F v >= 0                                          F(v) as in coulomb.h
 *   df/dq = -dF/dv S (H q')^T - F H,  df/dq' = -dF/dv S S^T,  H = d2g/dq2
 *
 * g is the position along the line: that of line.h for the perpendicular line with normal e; S and H: G and H there.
 * Exact friction is the nonholonomic equation S q' = 0 and the viscous force. */
#include "coulomb.h"
#include "line.h"

typedef struct {
  line across; /* the perpendicular line */
  coulomb law;
} sliding;

/* An element in the current state; v_q = dv/dq = H q'. */
typedef struct {
  const coulomb *law;
  line_state across;
  double v, S[6], v_q[6];
} sliding_state;

static inline sliding_state sliding_at (const pw_batch *batch, int e) {
  const sliding *element = (const sliding *)batch->element + e;
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  const double rate[6] = { body1->vx, body1->vy, body1->omega, body2->vx, body2->vy, body2->omega };
  sliding_state now = { &element->law, line_of (&element->across, batch, e), .v = 0 };
  line_J_one (now.across, now.S);
  for (int i = 0; i < 6; i++) now.v += now.S[i] * rate[i];
  line_multiply_H (&now.across, 1, rate, now.v_q);
  return now;
}

PREPARE (sliding_prepare, pw_sliding_friction, sliding) {
  element->across = line_make (definition->at, definition->heading - PW_PI / 2);
  return coulomb_make_smooth (definition->viscous, &definition->limit, &definition->limit_sliding, definition->speed,
                              &element->law, error);
}

PREPARE (sliding_prepare_exact, pw_sliding_friction, sliding) {
  element->across = line_make (definition->at, definition->heading - PW_PI / 2);
  return coulomb_make_exact (definition->viscous, &definition->limit, &definition->limit_sliding, &element->law, error);
}

PER_ELEMENT (sliding_force_q, sliding, 36) {
  double slope = coulomb_slope (now.law, now.v);
  line_scaled_H (&now.across, -coulomb_force (now.law, now.v), out);
  for (int i = 0; i < 36; i++) out[i] -= slope * now.S[i / 6] * now.v_q[i % 6];
}

COULOMB (sliding, 6)
EXACT_COULOMB (sliding, pw_sliding_friction)

#define SLIDING_EXACT(function, size)                     \
  PER_ELEMENT (sliding_exact_##function, sliding, size) { \
    line_##function##_one (now.across, out);              \
  }
SLIDING_EXACT (gamma, 1)
SLIDING_EXACT (jw_q, 6)
SLIDING_EXACT (gamma_q, 6)
SLIDING_EXACT (gamma_v, 6)

static const pw_field sliding_fields[] = {
  { PW_AT (pw_sliding_friction, body), PW_BODY, .count = 2, .required = 1,
    .about = "the sliding body and the body with the line; one may be ground" },
  LINE_FIELDS (pw_sliding_friction),
  { PW_AT (pw_sliding_friction, viscous), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE,
    .about = "force per speed" },
  { PW_AT (pw_sliding_friction, speed), PW_NUMBER, .unit = "m/s", .domain = PW_NONNEGATIVE,
    .about = "below about this speed the Coulomb force is smoothed; left out: it is exact, and holds" },
  { PW_AT (pw_sliding_friction, limit), PW_SIGNAL, .limit = 1, .unit = "N", .about = "Coulomb force" },
  { PW_AT (pw_sliding_friction, limit_sliding), PW_SIGNAL, .limit = 1, .unit = "N",
    .about = "exact Coulomb force while sliding, at most the limit; left out: the limit" },
  { .name = NULL },
};

const pw_kind pw_kind_sliding_friction = {
  .name = "sliding-friction",
  .about = "a viscous and a Coulomb force that oppose the motion of a point along a line of another body",
  TYPE (sliding, pw_sliding_friction, sliding),
  .bodies = 2,
  FORCE (sliding),
  .saturation = sliding_saturation,
  .loss = sliding_loss,
  .exact = &pw_kind_dry_sliding_friction,
  .is_exact = sliding_is_exact,
};

const pw_kind pw_kind_dry_sliding_friction = {
  .name = "sliding-friction",
  .about = "a viscous force, and a Coulomb force that holds a point on a line of another body up to a limit",
  .definition = sizeof (pw_sliding_friction),
  .fields = sliding_fields,
  .element = sizeof (sliding),
  .prepare = sliding_prepare_exact,
  .bodies = 2,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("F", "N", "Coulomb force on the first body, along the line"),
  CONSTRAINT (sliding_exact),
  .limits = sliding_limits,
  FORCE (sliding),
  .loss = sliding_exact_loss,
};
