/* NumPy archives: a zip file (PKWARE's APPNOTE), not compressed, with a .npy file per array (numpy.lib.format 1.0). */
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { NPZ_HEAD = 128 };   /* bytes before the data of a .npy file, a multiple of 64 */
enum { NPZ_MOST = 65535 }; /* files of an archive */

/* The first four bytes of the header of a file, of its entry in the directory, of the end record; the version 2.0. */
#define NPZ_FILE 0x04034b50
#define NPZ_ENTRY 0x02014b50
#define NPZ_END 0x06054b50
#define NPZ_VERSION 20

struct pw_npz_entry {
  char name[312];
  unsigned long check, size, offset;
};

/* CRC-32 with the polynomial 0xedb88320, as in zip files, four bits at a time, continued from `check`, at first 0. */
static unsigned long npz_crc (unsigned long check, const void *data, size_t size) {
  static const unsigned long part[16] = { 0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                          0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                          0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c };
  check ^= 0xffffffff;
  for (const unsigned char *c = data, *end = c + size; c < end; c++) {
    check ^= *c;
    for (int half = 0; half < 2; half++) check = check >> 4 ^ part[check & 15];
  }
  return check ^ 0xffffffff;
}

static void npz_bytes (pw_npz *z, const void *data, size_t size) {
  fwrite (data, 1, size, z->f);
  z->at += size;
}

/* Writes a number of `bytes` bytes, the lowest first. */
static void npz_number (pw_npz *z, unsigned long value, int bytes) {
  for (; bytes > 0; bytes--, value >>= 8) npz_bytes (z, &(unsigned char){ (unsigned char)value }, 1);
}

/* Writes what the header of a file and its entry in the directory share: version 2.0, flags (names in UTF-8), method
 * (stored), 1 January 1980, checksum, compressed and original size, lengths of the name and of extra fields. */
static void npz_describe (pw_npz *z, const struct pw_npz_entry *e) {
  npz_number (z, NPZ_VERSION, 2);
  npz_number (z, 0x0800, 4);
  npz_number (z, 0x00210000, 4);
  npz_number (z, e->check, 4);
  npz_number (z, e->size, 4);
  npz_number (z, e->size, 4);
  npz_number (z, strlen (e->name), 2);
  npz_number (z, 0, 2);
}

void pw_npz_add (pw_npz *z, const char *name, long rows, long columns, int parts, const double *value) {
  char head[NPZ_HEAD + 1] = "\x93NUMPY\x01";
  size_t size = (size_t)rows * (size_t)(columns < 0 ? 1 : columns) * (size_t)parts * sizeof *value;
  z->failed |= pw_grow (&z->entry, (size_t)z->count, &z->room, sizeof *z->entry) != PW_OK;
  if (z->failed) return;
  struct pw_npz_entry *e = z->entry + z->count++;
  const char *shape = columns < 0 ? PW_PRINTED (60, "%ld,", rows) : PW_PRINTED (60, "%ld, %ld", rows, columns);
  head[8] = NPZ_HEAD - 10; /* bytes of the header after its length, in two bytes */
  sprintf (head + 10, "{'descr': '%c%s', 'fortran_order': False, 'shape': (%s), }",
           *(const char *)&(int){ 1 } ? '<' : '>', parts == 2 ? "c16" : "f8", shape);
  memset (strchr (head + 10, 0), ' ', (size_t)(head + NPZ_HEAD - strchr (head + 10, 0)));
  head[NPZ_HEAD - 1] = '\n';
  snprintf (e->name, sizeof e->name, "%.300s.npy", name);
  e->check = npz_crc (npz_crc (0, head, NPZ_HEAD), value, size);
  e->size = NPZ_HEAD + size;
  e->offset = z->at;
  npz_number (z, NPZ_FILE, 4);
  npz_describe (z, e);
  npz_bytes (z, e->name, strlen (e->name));
  npz_bytes (z, head, NPZ_HEAD);
  npz_bytes (z, value, size);
}

/* Writes the directory, and the end record: disk 0, entries, size and offset of the directory, no comment. */
static void npz_directory (pw_npz *z) {
  unsigned long start = z->at;
  for (const struct pw_npz_entry *e = z->entry; e < z->entry + z->count; e++) {
    npz_number (z, NPZ_ENTRY, 4);
    npz_number (z, NPZ_VERSION, 2);
    npz_describe (z, e);
    npz_number (z, 0, 10); /* comment, disk, internal and external attributes */
    npz_number (z, e->offset, 4);
    npz_bytes (z, e->name, strlen (e->name));
  }
  unsigned long size = z->at - start;
  npz_number (z, NPZ_END, 4);
  npz_number (z, 0, 4);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, (unsigned long)z->count, 2);
  npz_number (z, size, 4);
  npz_number (z, start, 4);
  npz_number (z, 0, 2);
}

int pw_npz_end (pw_npz *z, pw_error *error) {
  npz_directory (z);
  free (z->entry);
  z->entry = NULL;
  if (z->failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (z->at <= 0xffffffff && z->count <= NPZ_MOST) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "an .npz archive has at most 4 GB and %d arrays; write a .csv", NPZ_MOST);
}
