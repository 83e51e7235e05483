/* Reads whole files of limited size. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { READ_CHUNK = 1 << 16 }; /* bytes */

int pw_read_rest (FILE *f, size_t max_bytes, const char *path, const char *limit, char **text, size_t *size,
                  pw_error *error) {
  size_t room = 0;
  *text = NULL;
  *size = 0;
  for (size_t n = 1; n > 0; *size += n) {
    if (pw_grow (text, *size + READ_CHUNK, &room, 1) != PW_OK)
      return pw_fail (error, PW_RESOURCE, "%s: out of memory", path);
    n = fread (*text + *size, 1, room - *size - 1, f);
    (*text)[*size + n] = 0;
    if (*size + n > max_bytes)
      return pw_fail (error, PW_INPUT, "%s: the file has more than %g MB, %s", path, (double)(max_bytes >> 10) / 1024,
                      limit);
  }
  return ferror (f) ? pw_fail (error, PW_INPUT, "cannot read %s: %s", path, strerror (errno)) : PW_OK;
}

int pw_read_file (const char *failure, const char *path, size_t max_bytes, const char *limit, char **text, size_t *size,
                  pw_error *error) {
  const char *why;
  FILE *f = pw_open_input (path, &why);
  *text = NULL;
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "%s %s: %s", failure, path, why);
  int status = pw_read_rest (f, max_bytes, path, limit, text, size, error);
  fclose (f);
  return status;
}
