/* NumPy archives (.npz): a zip file without compression, of one .npy file for each array (numpy.lib.format, version 1.0;
 * PKWARE's APPNOTE). */
#ifndef PW_NPZ_H
#define PW_NPZ_H

#include <stdio.h>

enum { PW_NPZ_MOST = 8 /* arrays */ };

/* Begin with { .f = stream }, add arrays, then end.  Errors remain in the stream. */
typedef struct {
  FILE *f;
  int count;
  struct {
    char name[24];
    unsigned long check, size, offset;
  } entry[PW_NPZ_MOST];
  unsigned long at; /* bytes written */
} pw_npz;

/* Adds rows x columns numbers, by rows, each of `parts` doubles: 1, or 2 for complex ones.  The name has at most 19
 * characters. */
void pw_npz_add (pw_npz *z, const char *name, int rows, int columns, int parts, const double *value);
void pw_npz_end (pw_npz *z);

#endif
