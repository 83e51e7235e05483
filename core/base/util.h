/* Utilities: nearest names, texts, a table of names, arenas, layouts. */
#ifndef PW_UTIL_H
#define PW_UTIL_H

#include <stddef.h>
#include "pinwheel.h"

/* Refuses NULL in the place of "a system", left by an earlier call whose error the caller need not have looked at. */
static inline int pw_require (const void *object, const char *what, pw_error *error) {
  return object ? PW_OK : pw_fail (error, PW_INPUT, "%s is missing", what);
}

/* Keeps the valid name nearest to one that was not found, as a share of the longer one's length; start with
 * { .sought = name }. */
typedef struct {
  const char *sought;
  const char *best;
  size_t distance, length; /* of the best from the name sought, and of the longer of the two */
  int near;                /* 1: near enough to suggest it */
  int crowded;             /* 1: there are more than all holds */
  char all[88];            /* the valid names, while there is room for them */
} pw_nearest;
void pw_nearest_try (pw_nearest *n, const char *candidate);
/* "; did you mean \"steer\"?", "; valid are x, y, z" if none of a few is near, "" if none of many is, written to the buffer,
 * which is returned. */
char *pw_nearest_text (const pw_nearest *n, char *buffer, size_t size);

/* ---- Texts (characters.c); they end with a 0 ---- */

/* The bytes of the UTF-8 character that a text begins with; 0 if it begins with none. */
int pw_utf8_size (const char *text);
/* The code of the control character that a text begins with, line ends and tabs excepted; 0 if it begins with none. */
int pw_control (const char *text);
/* 1 if a text is UTF-8 without control characters. */
int pw_is_text (const char *text);
/* Makes it so: what is not becomes question marks. */
void pw_make_text (char *text);

/* Open-addressing table from names to numbers >= 0; it keeps the pointers, not copies. */
typedef struct {
  size_t size; /* a power of two */
  struct pw_name {
    const char *name;
    int value;
  } * slot;
} pw_names;
int pw_names_open (pw_names *n, size_t entries); /* PW_OK or PW_RESOURCE */
void pw_names_close (pw_names *n);
int pw_names_add (pw_names *n, const char *name, int value); /* -1, or the value the name already has */
int pw_names_find (const pw_names *n, const char *name);     /* -1 if absent */

/* A growing store that is released as a whole. */
typedef struct {
  struct pw_chunk *chunk;
} pw_arena;
void *pw_arena_take (pw_arena *a, size_t bytes); /* zeroed, or NULL */
char *pw_arena_text (pw_arena *a, const char *text);
void pw_arena_free (pw_arena *a);

/* Lays out one allocation: run the same takes twice, first with base NULL to learn the size. */
typedef struct {
  char *base;
  size_t used;
} pw_layout;
void *pw_take (pw_layout *l, size_t count, size_t size);

/* An array of numbers: where its address goes, and how many. */
typedef struct {
  double **at;
  size_t count;
} pw_array;
/* Lays out arrays in one allocation, which is zeroed and returned; NULL if there is no memory. */
char *pw_take_arrays (const pw_array *array, size_t arrays);

/* PW_OK if `bytes` can be allocated now, else PW_RESOURCE.  Used before calls of libraries that crash when an allocation
 * fails. */
int pw_reserve (size_t bytes);

/* "" if a value lies in the domain, else what was expected (">= 0"). */
const char *pw_domain_check (pw_domain domain, double value);

#endif
