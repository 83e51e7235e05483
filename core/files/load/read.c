/* Reads regular files up to a limit. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "files.h"

FILE *pw_open_input (const char *path, const char **why) {
  struct stat info = { .st_mode = S_IFREG };
  int file = open (path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC); /* does not block on a FIFO */
  FILE *f = file >= 0 && fstat (file, &info) == 0 && S_ISREG (info.st_mode) ? fdopen (file, "rb") : NULL;
  if (f) return f;
  int number = S_ISREG (info.st_mode) ? errno : 0;
  *why = number ? strerror (number) : pw_not_regular (info.st_mode);
  if (file >= 0) close (file);
  errno = number;
  return NULL;
}

int pw_read_rest (FILE *f, size_t max_bytes, const char *path, const char *what, char **text, size_t *size,
                  pw_error *error) {
  size_t capacity = 1 << 16;
  *size = 0;
  *text = malloc (capacity + 1);
  for (size_t n = 1; *text && n > 0; *size += n) {
    if (*size == capacity) {
      char *more = realloc (*text, (capacity *= 2) + 1);
      if (more == NULL) return pw_fail (error, PW_RESOURCE, "%s: out of memory", path);
      *text = more;
    }
    n = fread (*text + *size, 1, capacity - *size, f);
    (*text)[*size + n] = 0;
    if (*size + n > max_bytes)
      return pw_fail (error, PW_INPUT, "%s: the file has more than %g MB, %s", path, (double)(max_bytes >> 10) / 1024,
                      what);
  }
  if (*text == NULL) return pw_fail (error, PW_RESOURCE, "%s: out of memory", path);
  return ferror (f) ? pw_fail (error, PW_INPUT, "cannot read %s: %s", path, strerror (errno)) : PW_OK;
}
