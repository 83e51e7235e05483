/* Tells which second-order blocks of a scene are differenced because their kind has no formula for them. */
#include <stdio.h>
#include "system.h"

static const char *const differences_name[PW_BLOCKS] = {
  [PW_JW_Q] = "jw_q",       [PW_JTL_Q] = "jtl_q",     [PW_ETA_Q] = "eta_q",     [PW_GAMMA_Q] = "gamma_q",
  [PW_GAMMA_V] = "gamma_v", [PW_FORCE_Q] = "force_q", [PW_FORCE_V] = "force_v",
};

/* The slab and block of the i-th one; NULL if there are no more, and then *count how many there are. */
static const pw_slab *differences_find (const pw_system *s, int i, pw_block *block, int *count) {
  *count = 0;
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs; k++)
    for (int b = 0; b < PW_BLOCKS; b++) {
      if (pw_block_sweep (k->kind, (pw_block)b) != pw_by_differences || (*count)++ != i) continue;
      *block = (pw_block)b;
      return k;
    }
  return NULL;
}

int pw_count_differences (const pw_system *s) {
  pw_block block;
  int count;
  differences_find (s, -1, &block, &count);
  return count;
}

char *pw_difference_name (const pw_system *s, int i, char *buffer, size_t size) {
  pw_block block;
  int count;
  const pw_slab *k = differences_find (s, i, &block, &count);
  if (k)
    snprintf (buffer, size, "%s of kind %s", differences_name[block], k->kind->name);
  else
    snprintf (buffer, size, "%s", "");
  return buffer;
}
