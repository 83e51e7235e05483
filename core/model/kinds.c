/* The table of built-in kinds, from the list in pinwheel.h. */
#include "pinwheel.h"

const pw_kind *const pw_kinds[] = {
#define PW_KIND(k) &pw_kind_##k,
  PW_KINDS
#undef PW_KIND
      NULL
};
