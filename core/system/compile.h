/* From the description to the compiled system: what pw_system_compile counts before the allocation, and what it fills behind
 * it.  For compile.c and compile_fill.c only. */
#ifndef PW_COMPILE_H
#define PW_COMPILE_H

#include "model.h"
#include "system.h"

/* Arrays of a batch, which only the compiler modifies. */
typedef struct {
  char *element;
  int *body, *column;
} pw_batch_arrays;

/* What is known before the allocation. */
typedef struct {
  const pw_model *m;
  pw_names body, element;
  const pw_kind **kind;   /* kinds in use, in the order of the batches */
  int *count;             /* elements of each */
  int *slab_of;           /* batch of each element */
  pw_batch_arrays *array; /* of each batch */
  int kinds;
  pw_system size;          /* its counts */
  size_t text;             /* bytes of all names */
  size_t points;           /* of tables, in all */
  size_t room;             /* bytes of the largest element, and the guard behind it */
  unsigned char *prepared; /* room bytes: where an element is prepared */
} pw_compilation;

/* Bytes behind an element that prepare must leave alone. */
enum { PW_COMPILE_GUARD = 64, PW_COMPILE_MARK = 0xa5 };

/* Arrays that the elements share: where each goes on. */
typedef struct {
  char *text;
  double *table;
  int *state;
} pw_pools;

/* How many elements of the system an element of the description stands for. */
int pw_compile_copies (const pw_model *m, const pw_kind *kind);

/* Fills a system that has been laid out.  Errors: PW_RESOURCE, PW_INPUT. */
int pw_compile_fill (const pw_compilation *c, pw_system *s, pw_pools *pools, pw_error *error);

#endif
