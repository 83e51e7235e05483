/* Gives a target every file it is told, in the place of a fuzzer: files, or folders of them. */
#define _POSIX_C_SOURCE 200809L
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "fuzz.h"

/* Targets with a mutator of their own ask for it. */
size_t LLVMFuzzerMutate (uint8_t *data, size_t size, size_t most) {
  (void)data;
  return size < most ? size : most;
}

static int replay_file (const char *path) {
  static uint8_t data[1 << 20];
  FILE *f = fopen (path, "rb");
  if (f == NULL) {
    perror (path);
    return 0;
  }
  size_t size = fread (data, 1, sizeof data, f);
  fclose (f);
  uint8_t *copy = malloc (size + 1); /* so that a byte read beyond the end is noticed */
  if (copy == NULL) return 0;
  copy = realloc (copy, size ? size : 1);
  memcpy (copy, data, size);
  fprintf (stderr, "%s\n", path);
  LLVMFuzzerTestOneInput (copy, size);
  free (copy);
  return 1;
}

static int replay_folder (const char *folder) {
  int files = 0;
  DIR *d = opendir (folder);
  for (struct dirent *e; d && (e = readdir (d)) != NULL;) {
    char path[4096];
    snprintf (path, sizeof path, "%s/%s", folder, e->d_name);
    if (*e->d_name != '.') files += replay_file (path);
  }
  if (d) closedir (d);
  return files;
}

int main (int argc, char **argv) {
  int files = 0;
  struct stat info;
  for (int i = 1; i < argc; i++)
    files += stat (argv[i], &info) == 0 && S_ISDIR (info.st_mode) ? replay_folder (argv[i]) : replay_file (argv[i]);
  printf ("%d files\n", files);
  return files == 0;
}
