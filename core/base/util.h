/* Utilities of all parts of Pinwheel: suggestions of names, numbers, checks of texts, streams into memory, tables,
 * memory. */
#ifndef PW_UTIL_H
#define PW_UTIL_H

#include <stdint.h>
#include <stdio.h>
#include "pinwheel.h"

/* Replaces `static` of a function that is compiled once per set of constant arguments, such as a size. */
#define PW_INLINE static inline __attribute__ ((always_inline))

/* The same of a function that few scenes call: inlined, it would add to the cost of its caller. */
#define PW_SELDOM static __attribute__ ((noinline))

/* Before a loop whose length, at most 10, is constant after inlining.  Clang unrolls it without a pragma. */
#ifndef __clang__
#define PW_UNROLL _Pragma ("GCC unroll 10")
#else
#define PW_UNROLL
#endif

/* PW_INPUT if object is NULL, the result of an earlier call that failed; type: "a system". */
static inline int pw_require (const void *object, const char *type, pw_error *error) {
  return object ? PW_OK : pw_fail (error, PW_INPUT, "%s is missing", type);
}

/* Members of pw_statistics, as checkpoints and JSON contain them. */
#define PW_STATISTICS_COUNTS(X) \
  X (steps)                     \
  X (rejected) X (rhs) X (jacobians) X (factorisations) X (restarts) X (specialised) X (conditions) X (unresolved)
#define PW_STATISTICS_RESIDUALS(X) X (position) X (velocity) X (g) X (jv)

enum { PW_HINT = 140 }; /* "; did you mean \"...\"?" with the longest name */

/* Collects valid names, each once, and the one nearest to an unknown name: least distance over the length of the
 * longer name.  Start with { .sought = name }. */
typedef struct {
  const char *sought;
  char best[120];          /* "" before the first candidate */
  size_t distance, length; /* distance of best from sought; length of the longer of the two */
  int near;                /* 1: best is near enough to suggest */
  int overflow;            /* 1: the valid names do not fit into `all` */
  char all[88];            /* the valid names, separated by commas */
  char hint[PW_HINT];
} pw_nearest;
void pw_nearest_try (pw_nearest *n, const char *candidate);
/* The hint: "; did you mean \"steer\"?"; "; valid are x, y, z" if no name is near and all fit; else "". */
const char *pw_nearest_text (pw_nearest *n);

/* The index of a name in a table whose entries, of `entry_size` bytes, begin with a name and whose last name is NULL;
 * -1, with the hint of pw_nearest_text, if the name is not there.  A table that is NULL has no entries. */
int pw_find_name (const void *table, size_t entry_size, const char *name, char hint[PW_HINT]);
extern const char *const pw_domain_names[]; /* "real", ..., NULL; as text models and pages write them */
/* "", ">= 0", "> 0", "1, 2, ...", "0 to 1" */
const char *pw_domain_text (pw_domain domain);
/* "" if a value lies in the domain, else the expected one ("a number >= 0"). */
const char *pw_domain_check (pw_domain domain, double value);

/* The next 64 random bits: SplitMix64 (Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators). */
static inline uint64_t pw_random_bits (uint64_t *state) {
  uint64_t z = *state += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

/* A value within a range, at which no parameter is likely to vanish. */
static inline double pw_value_within (double first, double last) {
  return first + 0.382 * (last - first);
}

/* Bytes of the UTF-8 character at the beginning of a text; 0 if invalid. */
int pw_utf8_size (const char *text);
/* Code of the control character at the beginning of a text; 0 if there is none, or if it is a
 * line end (\n only) or a tab. */
int pw_control (const char *text);
/* 1 if a text is UTF-8 without control characters other than line ends and tabs. */
int pw_is_text (const char *text);
/* 1 if a text is one line of UTF-8 without control characters, as names and units are. */
int pw_is_line (const char *text);
/* Replaces invalid bytes, and control characters other than line ends and tabs, by question marks. */
void pw_text_sanitise (char *text);
/* Prints into a buffer, which is returned; what does not fit is cut off. */
char *pw_print (char *buffer, size_t size, const char *format, ...) PW_PRINTF (3, 4);
/* The first n bytes of a text, in the same way. */
char *pw_print_part (char *buffer, size_t size, const char *text, size_t n);
/* Joins texts, of which NULL is the last, in the same way; ten times faster, since there is no format. */
char *pw_join (char *buffer, size_t size, const char *first, ...);
/* pw_print, pw_print_part, and pw_join without the NULL, into a buffer that lives as long as the block around it. */
#define PW_PRINTED(size, ...) pw_print ((char[size]){ 0 }, size, __VA_ARGS__)
enum { PW_PART_MOST = 200 }; /* bytes, with the terminating zero */
#define PW_PART(text, n) pw_print_part ((char[PW_PART_MOST]){ 0 }, PW_PART_MOST, text, n)
#define PW_JOINED(size, ...) pw_join ((char[size]){ 0 }, size, __VA_ARGS__, NULL)
/* The result of pw_system_state_name, or a function like it, in such a buffer. */
#define PW_NAME(function, s, i) function (s, i, (char[PW_NAME_BYTES]){ 0 }, PW_NAME_BYTES)

typedef struct {
  char *text;        /* zero-terminated; up to date after fflush */
  size_t size, room; /* bytes of the text; allocated */
} pw_stream;
FILE *pw_stream_open (pw_stream *t); /* NULL if out of memory; close it even then */
/* Closes f.  PW_RESOURCE, and t->text is NULL, if f is NULL or any part of the text is missing.  Free t->text. */
int pw_stream_close (FILE *f, pw_stream *t);

/* Continues the FNV-1a hash (Fowler, Noll, Vo) with more bytes; begin with PW_CHECK. */
#define PW_CHECK 14695981039346656037u
unsigned long long pw_check_sum (unsigned long long sum, const void *bytes, size_t count);

/* Open-addressing table from names to numbers >= 0; it stores pointers to the names, not copies. */
typedef struct {
  size_t size; /* a power of two */
  struct pw_name {
    const char *name;
    int value;
  } * slot;
} pw_names;
int pw_names_open (pw_names *n, size_t most);    /* with room for `most` names; PW_OK or PW_RESOURCE */
int pw_names_reserve (pw_names *n, size_t most); /* the same later, or as the first call; the names so far stay */
void pw_names_close (pw_names *n);
/* Adds a new name and returns -1; if the name exists, returns its value, which does not change. */
int pw_names_add (pw_names *n, const char *name, int value);
int pw_names_find (const pw_names *n, const char *name); /* -1 if absent */

/* Makes room for more than `count` entries of `size` bytes in an array that has room for *room.  `array` is the address
 * of the pointer to it, which is NULL at first.  PW_OK or PW_RESOURCE. */
int pw_grow (void *array, size_t count, size_t *room, size_t size);

/* The root of member i of a union-find structure, in which a root is its own parent; halves the path. */
static inline int pw_root (int *parent, int i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/* Memory that grows and is released as a whole. */
typedef struct {
  struct pw_chunk *chunk;
} pw_arena;
void *pw_arena_alloc (pw_arena *a, size_t bytes);    /* zeroed, or NULL */
char *pw_arena_copy (pw_arena *a, const char *text); /* or NULL */
void pw_arena_free (pw_arena *a);

/* An array: where its address is stored, number and size of its entries. */
typedef struct {
  void *at;
  size_t count, size;
} pw_array;
#define PW_ARRAY(pointer, count) \
  { &(pointer), (size_t)(count), sizeof *(pointer) }
#define PW_ARRAYS(...) (const pw_array[]){ __VA_ARGS__ }, sizeof ((const pw_array[]){ __VA_ARGS__ }) / sizeof (pw_array)
/* Lays out arrays in one zeroed allocation, in an arena or, if that is NULL, for the caller to free, and returns it; if
 * out of memory, NULL, and so are all pointers. */
char *pw_alloc_arrays (pw_arena *a, const pw_array *array, size_t arrays);
#define PW_ALLOC_ARRAYS(...) pw_alloc_arrays (NULL, PW_ARRAYS (__VA_ARGS__))
#define PW_ARENA_ARRAYS(arena, ...) pw_alloc_arrays (arena, PW_ARRAYS (__VA_ARGS__))

/* Gauss's rule of 8 points on [-1, 1] (Abramowitz & Stegun 1964, table 25.4): the positive nodes, ascending, and their
 * weights. */
extern const double pw_gauss_node[4], pw_gauss_weight[4];

/* PW_OK if `bytes` could be allocated now, else PW_RESOURCE.  For libraries that crash if an allocation fails. */
int pw_check_memory (size_t bytes);

#endif
