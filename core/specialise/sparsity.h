/* Which entries of J and of the force of an element type are 0 or constant, found at random states of random scenes. */
#ifndef PW_SPARSITY_H
#define PW_SPARSITY_H

#include "system.h"

/* An entry: 0, 1 or -1 for every definition; constant during a motion; or variable. */
typedef enum { PW_ENTRY_ZERO, PW_ENTRY_ONE, PW_ENTRY_MINUS_ONE, PW_ENTRY_CONSTANT, PW_ENTRY_VARIABLE } pw_entry_type;

typedef struct {
  unsigned char J[PW_MAX_ROWS * PW_MAX_COLS]; /* rows x cols: pw_entry_type */
  unsigned char force[PW_MAX_COLS];           /* cols: PW_ENTRY_ZERO or PW_ENTRY_VARIABLE */
} pw_sparsity;

/* All entries of a plug-in's type count as variable: the force of a wall, for example, is 0 at most states.  So do
 * those of a type that rejects random definitions, and those of a force that is 0 at all these states.  PW_OK or
 * PW_RESOURCE. */
int pw_sparsity_find (const pw_kind *kind, pw_sparsity *out);

#endif
