/* Checksums, arrays that grow, tables of names, arenas, and arrays in one allocation. */
#include <stdlib.h>
#include <string.h>
#include "util.h"

unsigned long long pw_check_sum (unsigned long long sum, const void *bytes, size_t count) {
  for (const unsigned char *p = bytes, *end = p + count; p < end; p++) sum = (sum ^ *p) * 1099511628211u;
  return sum;
}

int pw_grow (void *array, size_t count, size_t *room, size_t size) {
  if (count < *room) return PW_OK;
  size_t more = *room ? 2 * *room : 8;
  while (more <= count) more *= 2;
  void *p;
  memcpy (&p, array, sizeof p); /* a pointer to any type */
  if ((p = realloc (p, more * size)) == NULL) return PW_RESOURCE;
  memcpy (array, &p, sizeof p);
  *room = more;
  return PW_OK;
}

int pw_names_open (pw_names *n, size_t most) {
  n->size = 16;
  while (n->size < 2 * most) n->size *= 2; /* at most half full */
  n->slot = calloc (n->size, sizeof *n->slot);
  return n->slot ? PW_OK : PW_RESOURCE;
}

static struct pw_name *store_slot (const pw_names *n, const char *name) {
  size_t i = (size_t)pw_check_sum (PW_CHECK, name, strlen (name)) & (n->size - 1);
  while (n->slot[i].name && strcmp (n->slot[i].name, name) != 0) i = (i + 1) & (n->size - 1);
  return &n->slot[i];
}

int pw_names_reserve (pw_names *n, size_t most) {
  pw_names more;
  if (n->slot && 2 * most <= n->size) return PW_OK;
  if (pw_names_open (&more, most) != PW_OK) return PW_RESOURCE;
  for (struct pw_name *s = n->slot, *end = s ? s + n->size : s; s < end; s++)
    if (s->name) *store_slot (&more, s->name) = *s;
  pw_names_close (n);
  *n = more;
  return PW_OK;
}

void pw_names_close (pw_names *n) {
  free (n->slot);
  n->slot = NULL;
}

int pw_names_add (pw_names *n, const char *name, int value) {
  struct pw_name *slot = store_slot (n, name);
  if (slot->name) return slot->value;
  slot->name = name;
  slot->value = value;
  return -1;
}

int pw_names_find (const pw_names *n, const char *name) {
  const struct pw_name *slot = store_slot (n, name);
  return slot->name ? slot->value : -1;
}

#define STORE_ALIGN 16    /* bytes: alignment of any object */
#define STORE_FIRST 2048  /* bytes of the first chunk; each has twice the size of the one before, */
#define STORE_CHUNK 65536 /* up to this, unless an allocation needs more */

struct pw_chunk {
  struct pw_chunk *next;
  size_t used, size;
  _Alignas(STORE_ALIGN) char data[];
};

static size_t store_round (size_t bytes, size_t align) {
  return (bytes + align - 1) / align * align;
}

static void *store_alloc (pw_arena *a, size_t bytes, size_t align) {
  size_t used = a->chunk ? store_round (a->chunk->used, align) : 0;
  if (bytes > PTRDIFF_MAX) return NULL; /* sizes below would overflow */
  if (a->chunk == NULL || a->chunk->size < used || a->chunk->size - used < bytes) {
    size_t size = a->chunk == NULL ? STORE_FIRST : a->chunk->size < STORE_CHUNK ? 2 * a->chunk->size : STORE_CHUNK;
    if (size < bytes) size = bytes;
    struct pw_chunk *c = calloc (1, sizeof *c + size);
    if (c == NULL) return NULL;
    c->next = a->chunk;
    c->size = size;
    a->chunk = c;
    used = 0;
  }
  a->chunk->used = used + bytes;
  return a->chunk->data + used;
}

void *pw_arena_alloc (pw_arena *a, size_t bytes) {
  return store_alloc (a, bytes, STORE_ALIGN);
}

char *pw_arena_copy (pw_arena *a, const char *text) {
  size_t n = strlen (text) + 1;
  char *copy = store_alloc (a, n, 1);
  return copy ? memcpy (copy, text, n) : NULL;
}

void pw_arena_free (pw_arena *a) {
  while (a->chunk) {
    struct pw_chunk *next = a->chunk->next;
    free (a->chunk);
    a->chunk = next;
  }
}

char *pw_alloc_arrays (pw_arena *a, const pw_array *array, size_t arrays) {
  size_t bytes = 1;
  for (size_t i = 0; i < arrays; i++) bytes += store_round (array[i].count * array[i].size, STORE_ALIGN);
  char *memory = a ? pw_arena_alloc (a, bytes) : calloc (1, bytes), *at = memory;
  for (size_t i = 0; i < arrays; i++) { /* pointers to any type */
    memcpy (array[i].at, &at, sizeof at);
    if (memory) at += store_round (array[i].count * array[i].size, STORE_ALIGN);
  }
  return memory;
}

int pw_check_memory (size_t bytes) {
  void *volatile p = malloc (bytes); /* volatile: keeps the compiler from removing the allocation */
  int status = p ? PW_OK : PW_RESOURCE;
  free (p);
  return status;
}
