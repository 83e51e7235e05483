#include "alloc.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>

void *__real_malloc (size_t size);
void *__real_calloc (size_t count, size_t size);
void *__real_realloc (void *old, size_t size);
char *__real_strdup (const char *text);
void __real_free (void *p);
void *__wrap_malloc (size_t size);
void *__wrap_calloc (size_t count, size_t size);
void *__wrap_realloc (void *old, size_t size);
char *__wrap_strdup (const char *text);
void __wrap_free (void *p);

struct alloc_state alloc;

static void **alloc_find (const void *p, const void *value) {
  for (size_t i = (size_t)p / 16 % ALLOC_SLOTS, n = 0; n < ALLOC_SLOTS; n++, i = (i + 1) % ALLOC_SLOTS)
    if (alloc.slot[i] == value) return &alloc.slot[i];
  return NULL;
}

static void *alloc_keep (void *p) {
  void **slot = alloc_find (p, NULL);
  if (p == NULL || slot == NULL) return p;
  *slot = p;
  alloc.live++;
  return p;
}

static void alloc_drop (void *p) {
  void **slot = p ? alloc_find (p, p) : NULL;
  if (slot == NULL) return; /* not ours: from a library */
  *slot = NULL;
  alloc.live--;
}

static int alloc_fails (void) {
  if (++alloc.count != alloc.fail) return 0;
  errno = ENOMEM;
  return 1;
}

void *__wrap_malloc (size_t size) {
  return alloc_fails () ? NULL : alloc_keep (__real_malloc (size));
}

void *__wrap_calloc (size_t count, size_t size) {
  return alloc_fails () ? NULL : alloc_keep (__real_calloc (count, size));
}

void *__wrap_realloc (void *old, size_t size) {
  if (alloc_fails ()) return NULL;
  alloc_drop (old);
  return alloc_keep (__real_realloc (old, size));
}

char *__wrap_strdup (const char *text) {
  return alloc_fails () ? NULL : alloc_keep (__real_strdup (text));
}

void __wrap_free (void *p) {
  alloc_drop (p);
  __real_free (p);
}
