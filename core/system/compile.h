/* Compilation of a description: counts before the allocation, filling after it.  For compile.c and compile_fill.c
 * only. */
#ifndef PW_COMPILE_H
#define PW_COMPILE_H

#include "model.h"
#include "system.h"

/* Arrays of a batch that are constant after compilation. */
typedef struct {
  char *element;
  int *body, *column;
} pw_batch_arrays;

/* Data collected before the allocation. */
typedef struct {
  const pw_model *m;
  pw_names body, element;
  const pw_kind **kind;   /* element types in use, in the order of the batches */
  int *count;             /* kinds: elements of each type */
  int *slab_of;           /* elements of the description: batch of each */
  pw_batch_arrays *array; /* kinds: arrays of each batch */
  int kinds;
  pw_system size;          /* its counts */
  size_t text;             /* total bytes of all names */
  size_t points;           /* total points of all tables */
  size_t room;             /* bytes of the largest element and the guard after it */
  unsigned char *prepared; /* room bytes: scratch in which an element is prepared */
} pw_compilation;

/* Guard bytes after an element; prepare must not change them. */
enum { PW_COMPILE_GUARD = 64, PW_COMPILE_MARK = 0xa5 };

/* The unused rest of arrays that are shared by elements. */
typedef struct {
  char *text;
  double *table;
  int *state;
} pw_pools;

/* Number of elements of the system created from an element of the description. */
int pw_compile_copies (const pw_model *m, const pw_kind *kind);

/* Fills a system that has been laid out.  Errors: PW_RESOURCE, PW_INPUT. */
int pw_compile_fill (const pw_compilation *c, pw_system *s, pw_pools *pools, pw_error *error);

#endif
