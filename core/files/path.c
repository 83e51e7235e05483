/* Paths in buffers. */
#include <stdarg.h>
#include <stdio.h>
#include "files.h"

char *pw_path (char path[PW_PATH], const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (path, PW_PATH, format, arguments);
  va_end (arguments);
  return path;
}
