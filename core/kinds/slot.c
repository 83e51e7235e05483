/* slot: a point of body 1 stays on a line of body 2.
 *
 *   g = n . (r1 + R(phi1) s1 - r2 - R(phi2) s2) = 0,  n: normal of the line, to the left of its heading  (1 holonomic row)
 *
 * Its derivatives are in line.h.  On body 1 acts the force -lambda along n, at its point; on body 2 the opposite. */
#include "line.h"

#define SLOT_PARTS                                                                \
  const line *k = (const line *)b->element + e;                                   \
  const pw_pose *A = &b->pose[b->body[2 * e]], *B = &b->pose[b->body[2 * e + 1]]; \
  const line_axes s = line_turn (k, A, B)

static int slot_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                         pw_error *error) {
  const pw_slot *d = definition;
  *(line *)element = line_make (d->at, d->heading);
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void slot_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    SLOT_PARTS;
    out[e] = line_g (k, &s);
  }
}

static void slot_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    SLOT_PARTS;
    out[e] = line_g_size (k, &s, A, B);
  }
}

static void slot_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    SLOT_PARTS;
    line_J (&s, out);
  }
}

static void slot_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    SLOT_PARTS;
    out[e] = line_gamma (&s, A, B);
  }
}

static void slot_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    SLOT_PARTS;
    line_curve (&s, 1, b->w + 6 * e, out);
  }
}

static void slot_jtl_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    SLOT_PARTS;
    line_jtl_q (&s, b->lambda[e], out);
  }
}

static void slot_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    SLOT_PARTS;
    line_gamma_q (&s, A, B, out);
  }
}

static void slot_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    SLOT_PARTS;
    line_gamma_v (&s, A, B, out);
  }
}

static const pw_field slot_fields[] = {
  { PW_AT (pw_slot, body), PW_BODY, .count = 2, .required = 1,
    .about = "the one with the point, and the one with the line; ground for one of them" },
  { PW_AT (pw_slot, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the point, and a point of the line, in each body's frame" },
  { PW_AT (pw_slot, heading), PW_NUMBER, .unit = "rad",
    .about = "direction of the line in the second body's frame; 0: along its x" },
  { .name = NULL },
};

static const pw_quantity slot_reaction[] = {
  { "N", "N", NULL, "force on the first body, to the left of the line's heading" },
};

const pw_kind pw_kind_slot = {
  .name = "slot",
  .about = "a point of one body stays on a line of another",
  .definition = sizeof (pw_slot),
  .element = sizeof (line),
  .fields = slot_fields,
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = slot_reaction,
  .prepare = slot_prepare,
  .g = slot_g,
  .g_size = slot_g_size,
  .J = slot_J,
  .gamma = slot_gamma,
  .jw_q = slot_jw_q,
  .jtl_q = slot_jtl_q,
  .gamma_q = slot_gamma_q,
  .gamma_v = slot_gamma_v,
};
