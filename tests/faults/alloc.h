/* Allocations that are counted, remembered, and fail on demand.
 *
 * For programs linked with --wrap for malloc, calloc, realloc, strdup and free: what Pinwheel allocates goes through
 * here, what the libraries below it allocate does not. */
#ifndef ALLOC_H
#define ALLOC_H

enum { ALLOC_SLOTS = 1 << 14 };

extern struct alloc_state {
  long count;              /* allocations so far */
  long fail;               /* the one that fails; 0: none */
  int live;                /* not yet released */
  void *slot[ALLOC_SLOTS]; /* where they are */
} alloc;

#endif
