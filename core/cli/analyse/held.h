/* What is held in a steady motion, as options. */
#ifndef PW_HELD_H
#define PW_HELD_H

#include "cli.h"
#include "pinwheel-analysis.h"

enum { PW_HOLDS = 40 };

#define PW_HOLD_OPTION(type, member)                      \
  PW_LIST_OPTION (type, member, "hold", 0, "STATE=VALUE", \
                  "Seek motions with this value of a state, or of BODY.speed, .radius or .curvature; repeatable")

/* Adds "NAME=VALUE" to the list, which has room for PW_HOLDS; `option` is for messages.  PW_INPUT. */
int pw_hold_read (const pw_system *s, const char *option, const char *text, pw_initial_value *hold, int *holds,
                  pw_error *error);

#endif
