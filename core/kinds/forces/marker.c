/* marker: a point of a body whose path is recorded; it does not affect the motion.
 *
 *   P = r + R(phi) s          no constraint, no force
 *
 * Tables contain its position; figures and animations show its path, for example a coupler curve. */
#include "contact.h"

typedef struct {
  double at[2]; /* in the body's frame [m] */
} marker;

static int marker_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                           pw_error *error) {
  const pw_marker *d = definition;
  *(marker *)element = (marker){ { d->at[0], d->at[1] } };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void marker_contact (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const marker *k = (const marker *)b->element + e;
    contact_to_world (&b->configuration[b->body[e]], k->at, 0, out);
  }
}

static const pw_field marker_fields[] = {
  { PW_AT (pw_marker, body), PW_BODY, .required = 1, .about = "the body that carries the point" },
  { PW_AT (pw_marker, at), PW_POINT, .unit = "m", .required = 1, .about = "the point in the body's frame" },
  { .name = NULL },
};

const pw_kind pw_kind_marker = {
  .name = "marker",
  .about = "a point of a body whose place and path are shown in tables, figures and animations",
  .definition = sizeof (pw_marker),
  .element = sizeof (marker),
  .fields = marker_fields,
  .bodies = 1,
  .level = PW_FORCE,
  .prepare = marker_prepare,
  .contact = marker_contact,
};
