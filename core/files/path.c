/* Paths. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

char *pw_path_join (const char *folder, const char *name, const char *ending) {
  size_t size = strlen (folder) + strlen (name) + strlen (ending) + 2;
  char *path = malloc (size);
  if (path) snprintf (path, size, "%s/%s%s", folder, name, ending);
  return path;
}
