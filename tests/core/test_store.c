/* Name tables, arenas, layouts, nearest names, domains. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "util.h"

TEST (names) {
  enum { COUNT = 1000 };
  static char text[COUNT][16];
  pw_names names;
  assert_int_equal (pw_names_open (&names, COUNT), PW_OK);
  assert_true (names.size >= 2 * COUNT && (names.size & (names.size - 1)) == 0);
  for (int i = 0; i < COUNT; i++) {
    snprintf (text[i], sizeof text[i], "body%d", i);
    assert_int_equal (pw_names_find (&names, text[i]), -1);
    assert_int_equal (pw_names_add (&names, text[i], i), -1);
  }
  for (int i = 0; i < COUNT; i++) {
    char copy[16];
    assert_int_equal (pw_names_find (&names, strcpy (copy, text[i])), i);
  }
  assert_int_equal (pw_names_add (&names, "body7", 99), 7); /* the value does not change */
  assert_int_equal (pw_names_find (&names, "body7"), 7);
  assert_int_equal (pw_names_find (&names, ""), -1);
  pw_names_close (&names);
  assert_null (names.slot);
}

TEST (names_empty) {
  pw_names names;
  assert_int_equal (pw_names_open (&names, 0), PW_OK);
  assert_int_equal (pw_names_find (&names, "x"), -1);
  pw_names_close (&names);
}

/* Pieces are zeroed, aligned and disjoint, whether they fit into a chunk or are larger than one. */
TEST (arena) {
  static const size_t size[] = { 1, 7, 16, 100, 70000, 3, 65536, 65537, 0, 5 };
  enum { PIECES = sizeof size / sizeof *size };
  pw_arena arena = { NULL };
  char *piece[PIECES];
  for (int i = 0; i < PIECES; i++) {
    piece[i] = pw_arena_alloc (&arena, size[i]);
    assert_non_null (piece[i]);
    assert_int_equal ((uintptr_t)piece[i] % sizeof (double), 0);
    for (size_t b = 0; b < size[i]; b++) assert_int_equal (piece[i][b], 0);
    memset (piece[i], i + 1, size[i]);
  }
  for (int i = 0; i < PIECES; i++)
    for (size_t b = 0; b < size[i]; b++) assert_int_equal (piece[i][b], i + 1);
  assert_string_equal (pw_arena_copy (&arena, "steer"), "steer");
  const char *first = pw_arena_copy (&arena, "B"), *second = pw_arena_copy (&arena, "");
  assert_string_equal (second, "");
  assert_ptr_equal (second, first + 2); /* texts are packed, arrays after them aligned */
  assert_int_equal ((uintptr_t)pw_arena_alloc (&arena, sizeof (double)) % 16, 0);
  assert_null (pw_arena_alloc (&arena, SIZE_MAX));
  pw_arena_free (&arena);
  assert_null (arena.chunk);
}

/* One allocation: zeros, aligned, one array after the other, also those without elements. */
TEST (arrays) {
  for (size_t count = 0; count < 3; count++) {
    double *a = NULL;
    char *b = NULL;
    int *c = NULL;
    char *memory = PW_ALLOC_ARRAYS (PW_ARRAY (a, count), PW_ARRAY (b, 15), PW_ARRAY (c, 2));
    assert_true (memory && (char *)a == memory && b >= (char *)(a + count) && (char *)c >= b + 15);
    assert_int_equal ((uintptr_t)b % 16 + (uintptr_t)c % 16, 0);
    for (size_t i = 0; i < count; i++) assert_true (a[i] == 0);
    assert_true (b[14] == 0 && c[1] == 0);
    free (memory);
  }
}

/* ---- Nearest names ---- */

static const char *store_nearest (const char *sought, const char *const *candidates) {
  pw_nearest n = { .sought = sought };
  for (; *candidates; candidates++) pw_nearest_try (&n, *candidates);
  static char best[120];
  return strcpy (best, n.best);
}

TEST (nearest) {
  static const char *const names[] = { "frame", "steer", "ground", NULL }, *const none[] = { NULL };
  assert_string_equal (store_nearest ("fraem", names), "frame");    /* two changes */
  assert_string_equal (store_nearest ("ster", names), "steer");     /* one left out */
  assert_string_equal (store_nearest ("grounds", names), "ground"); /* one too many */
  assert_string_equal (store_nearest ("Steer", names), "steer");    /* one other */
  assert_string_equal (store_nearest ("", names), "frame");         /* the first of equals */
  assert_string_equal (store_nearest ("x", none), "");
  /* the distance is relative to the length, so that short names are not preferred */
  assert_string_equal (store_nearest ("stiff", (const char *const[]){ "at", "stiffness", NULL }), "stiffness");
}

static void store_hint (const char *sought, const char *const *candidates, const char *expected) {
  pw_nearest n = { .sought = sought };
  for (; *candidates; candidates++) pw_nearest_try (&n, *candidates);
  assert_string_equal (pw_nearest_text (&n), expected);
}

/* If no name is near, all valid names are given, if they are few. */
TEST (nearest_text) {
  static const char *const names[] = { "frame", "steer", "ground", NULL };
  static const char *const many[] = { "tractor",      "locomotive", "dining-car",
                                      "sleeping-car", "couchette",  "luggage-van",
                                      "snow-plough",  "tender",     NULL };
  store_hint ("ster", names, "; did you mean \"steer\"?");
  store_hint ("st", names, "; did you mean \"steer\"?");
  store_hint ("rame.", names, "; did you mean \"frame\"?");
  store_hint ("GROUND", names, "; did you mean \"ground\"?");
  store_hint ("front", names, "; valid are frame, steer, ground");
  store_hint ("wagon", names, "; valid are frame, steer, ground");
  store_hint ("wagon", (const char *const[]){ "frame", NULL }, "; valid is frame");
  store_hint ("pinnace", many, "");
  store_hint ("ploughs", many, "");
  store_hint ("plough", many, "; did you mean \"snow-plough\"?");
  store_hint ("x", (const char *const[]){ NULL }, "");
}

/* A candidate that is too long for the table of distances is never near. */
TEST (nearest_long) {
  char longer[300];
  memset (longer, 'x', sizeof longer - 1);
  longer[sizeof longer - 1] = 0;
  const char *const names[] = { longer, "y", NULL };
  assert_string_equal (store_nearest ("xxy", names), "y");
  assert_string_equal (store_nearest (longer, (const char *const[]){ "y", "x", NULL }), "x");
}

/* ---- Errors and domains ---- */

TEST (first_error_stays) {
  pw_error error = { 0 };
  assert_int_equal (pw_fail (&error, PW_INPUT, "first %d", 1), PW_INPUT);
  assert_int_equal (pw_fail (&error, PW_RESOURCE, "second"), PW_RESOURCE);
  check_error (&error, PW_INPUT, "first 1");
  assert_int_equal (pw_fail (NULL, PW_INITIAL, "nobody listens"), PW_INITIAL);
}

TEST (long_error) {
  char longer[1000];
  memset (longer, 'x', sizeof longer - 1);
  longer[sizeof longer - 1] = 0;
  pw_error error = { 0 };
  pw_fail (&error, PW_INPUT, "%s", longer);
  assert_int_equal (strlen (error.text), sizeof error.text - 1);
}

TEST (domains) {
  static const struct {
    pw_domain domain;
    double value;
    const char *expected;
  } tries[] = {
    { PW_REAL, -1, "" },
    { PW_REAL, NAN, "a finite number" },
    { PW_POSITIVE, INFINITY, "a finite number" },
    { PW_NONNEGATIVE, 0, "" },
    { PW_NONNEGATIVE, -1e-300, "a number >= 0" },
    { PW_POSITIVE, 1e-300, "" },
    { PW_POSITIVE, 0, "a number > 0" },
    { PW_COUNT, 1, "" },
    { PW_COUNT, 0, "a whole number >= 1" },
    { PW_COUNT, 2.5, "a whole number >= 1" },
    { PW_COUNT, 1e10, "a whole number up to 1e9" },
    { PW_FRACTION, 0, "" },
    { PW_FRACTION, 1, "" },
    { PW_FRACTION, 1.001, "a number from 0 to 1" },
    { PW_FRACTION, -1, "a number from 0 to 1" },
  };
  for (size_t i = 0; i < sizeof tries / sizeof *tries; i++)
    assert_string_equal (pw_domain_check (tries[i].domain, tries[i].value), tries[i].expected);
}
