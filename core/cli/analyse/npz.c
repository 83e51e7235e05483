/* Writes NumPy archives. */
#include <string.h>
#include "npz.h"

enum { NPZ_HEAD = 128 }; /* bytes before the data of a .npy file, a multiple of 64 */

/* CRC-32 of zip files, continued from `check`; begins with 0. */
static unsigned long npz_check (unsigned long check, const void *data, size_t size) {
  check ^= 0xffffffff;
  for (const unsigned char *c = data, *end = c + size; c < end; c++) {
    check ^= *c;
    for (int bit = 0; bit < 8; bit++) check = check & 1 ? check >> 1 ^ 0xedb88320 : check >> 1;
  }
  return check ^ 0xffffffff;
}

static void npz_bytes (pw_npz *z, const void *data, size_t size) {
  fwrite (data, 1, size, z->f);
  z->at += size;
}

/* A number of `bytes` bytes, the lowest first. */
static void npz_number (pw_npz *z, unsigned long value, int bytes) {
  for (; bytes > 0; bytes--, value >>= 8) npz_bytes (z, &(unsigned char){ (unsigned char)value }, 1);
}

/* What the header of a file and its entry in the directory have in common: version 2.0, no flags, stored, 1 January
 * 1980, checksum, compressed and original size, lengths of the name and of extra fields. */
static void npz_describe (pw_npz *z, int i) {
  npz_number (z, 20, 2);
  npz_number (z, 0, 4);
  npz_number (z, 0x00210000, 4);
  npz_number (z, z->entry[i].check, 4);
  npz_number (z, z->entry[i].size, 4);
  npz_number (z, z->entry[i].size, 4);
  npz_number (z, strlen (z->entry[i].name), 2);
  npz_number (z, 0, 2);
}

void pw_npz_add (pw_npz *z, const char *name, int rows, int columns, int parts, const double *value) {
  char head[NPZ_HEAD + 1] = "\x93NUMPY\x01";
  size_t size = (size_t)rows * (size_t)columns * (size_t)parts * sizeof *value;
  int i = z->count++;
  head[8] = NPZ_HEAD - 10;
  sprintf (head + 10, "{'descr': '%c%s', 'fortran_order': False, 'shape': (%d, %d), }",
           *(const char *)&(int){ 1 } ? '<' : '>', parts == 2 ? "c16" : "f8", rows, columns);
  memset (strchr (head + 10, 0), ' ', (size_t)(head + NPZ_HEAD - strchr (head + 10, 0)));
  head[NPZ_HEAD - 1] = '\n';
  snprintf (z->entry[i].name, sizeof z->entry[i].name, "%s.npy", name);
  z->entry[i].check = npz_check (npz_check (0, head, NPZ_HEAD), value, size);
  z->entry[i].size = NPZ_HEAD + size;
  z->entry[i].offset = z->at;
  npz_number (z, 0x04034b50, 4);
  npz_describe (z, i);
  npz_bytes (z, z->entry[i].name, strlen (z->entry[i].name));
  npz_bytes (z, head, NPZ_HEAD);
  npz_bytes (z, value, size);
}

/* The directory, and the end record: disk 0, entries, size and offset of the directory, no comment. */
void pw_npz_end (pw_npz *z) {
  unsigned long start = z->at;
  for (int i = 0; i < z->count; i++) {
    npz_number (z, 0x02014b50, 4);
    npz_number (z, 20, 2);
    npz_describe (z, i);
    npz_number (z, 0, 6); /* comment, disk, internal attributes */
    npz_number (z, 0, 4);
    npz_number (z, z->entry[i].offset, 4);
    npz_bytes (z, z->entry[i].name, strlen (z->entry[i].name));
  }
  unsigned long size = z->at - start;
  npz_number (z, 0x06054b50, 4);
  npz_number (z, 0, 4);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, size, 4);
  npz_number (z, start, 4);
  npz_number (z, 0, 2);
}
