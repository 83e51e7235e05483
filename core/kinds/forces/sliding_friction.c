/* sliding-friction: a force opposing the motion of a point of body 1 along a line of body 2, as in a slider or slot.
 *
 *   s = e . (r1 + R(phi1) s1 - r2) - c,  E = ds/dq,  w = E . v          e: unit vector along the line
 *   f = -F E,  loss = F w >= 0                                          F(w) as in coulomb.h
 *   df/dq = -dF/dw E (H v)^T - F H,  df/dv = -dF/dw E E^T,  H = d2s/dq2
 *
 * E and H are those of line.h for the perpendicular line with normal e; s is the distance from that line. */
#include "coulomb.h"
#include "line.h"

typedef struct {
  line across; /* the perpendicular line */
  coulomb law;
} sliding;

/* An element in the current state: the line, velocities, E and w. */
typedef struct {
  const sliding *k;
  line_state s;
  double v[6], E[6], w;
} sliding_state;

static inline sliding_state sliding_at (const pw_batch *b, int e) {
  const sliding *k = (const sliding *)b->element + e;
  const pw_configuration *A = batch_body (b, e, 2, 0), *B = batch_body (b, e, 2, 1);
  sliding_state x = { k, line_of (&k->across, b, e), { A->vx, A->vy, A->omega, B->vx, B->vy, B->omega }, .w = 0 };
  line_J_one (x.s, x.E);
  for (int i = 0; i < 6; i++) x.w += x.E[i] * x.v[i];
  return x;
}

PREPARE (sliding_prepare, pw_sliding_friction, sliding) {
  k->across = line_make (d->at, d->heading - PW_PI / 2);
  return coulomb_make (d->viscous, d->limit, d->speed, &k->law, error);
}

PER_ELEMENT (sliding_force, sliding, 6) {
  double F = coulomb_force (&x.k->law, x.w);
  for (int i = 0; i < 6; i++) out[i] = -F * x.E[i];
}

PER_ELEMENT (sliding_force_q, sliding, 36) {
  double slope = coulomb_slope (&x.k->law, x.w), Hv[6];
  line_jtl_q (&x.s, -coulomb_force (&x.k->law, x.w), out);
  line_multiply_H (&x.s, 1, x.v, Hv);
  for (int i = 0; i < 36; i++) out[i] -= slope * x.E[i / 6] * Hv[i % 6];
}

PER_ELEMENT (sliding_force_v, sliding, 36) {
  double slope = coulomb_slope (&x.k->law, x.w);
  for (int i = 0; i < 36; i++) out[i] = -slope * x.E[i / 6] * x.E[i % 6];
}

PER_ELEMENT (sliding_saturation, sliding, 12) {
  double Hv[6];
  line_multiply_H (&x.s, 1, x.v, Hv);
  for (int i = 0; i < 6; i++) {
    out[i] = coulomb_saturation (&x.k->law, x.w, Hv[i]);
    out[6 + i] = coulomb_saturation (&x.k->law, x.w, x.E[i]);
  }
}

PER_ELEMENT (sliding_loss, sliding, 1) {
  *out = coulomb_force (&x.k->law, x.w) * x.w;
}

static const pw_field sliding_fields[] = {
  { PW_AT (pw_sliding_friction, body), PW_BODY, .count = 2, .required = 1,
    .about = "the sliding body and the body with the line; one may be ground" },
  { PW_AT (pw_sliding_friction, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the point, and a point of the line, in each body's frame" },
  { PW_AT (pw_sliding_friction, heading), PW_NUMBER, .unit = "rad",
    .about = "direction of the line in the second body's frame; 0: along its x" },
  { PW_AT (pw_sliding_friction, viscous), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE,
    .about = "force per speed" },
  { PW_AT (pw_sliding_friction, limit), PW_NUMBER, .unit = "N", .domain = PW_NONNEGATIVE, .about = "Coulomb force" },
  { PW_AT (pw_sliding_friction, speed), PW_NUMBER, .unit = "m/s", .domain = PW_NONNEGATIVE,
    .about = "below about this speed the Coulomb force is smoothed; required with a limit" },
  { .name = NULL },
};

const pw_kind pw_kind_sliding_friction = {
  .name = "sliding-friction",
  .about = "a viscous and a Coulomb force that oppose the motion of a point along a line of another body",
  DEFINITION (pw_sliding_friction, sliding_fields),
  ELEMENT (sliding, sliding_prepare),
  .bodies = 2,
  FORCE (sliding),
  .saturation = sliding_saturation,
  .loss = sliding_loss,
};
