/* marker: a point of a body whose path is recorded; it does not affect the motion.
 *
 *   P = r + R(phi) s          no constraint, no force
 *
 * Tables contain its position; figures and animations show its path, for example a coupler curve. */
#include "contact.h"

PREPARE (marker_prepare, pw_marker, contact) {
  *element = contact_along (definition->at, 0);
  return PW_OK;
}

static const pw_field marker_fields[] = {
  { PW_AT (pw_marker, body), PW_BODY, .required = 1, .about = "the body with the point" },
  { PW_AT (pw_marker, at), PW_POINT, .unit = "m", .required = 1, .about = "the point in the body's frame" },
  { .name = NULL },
};

const pw_kind pw_kind_marker = {
  .name = "marker",
  .about = "a point of a body whose path is shown in tables, figures and animations",
  .symbol = "o 0 0 0 .3",
  TYPE (marker, pw_marker, contact),
  .bodies = 1,
  .contact = contact_place,
};
