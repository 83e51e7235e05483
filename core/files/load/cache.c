/* The cache: a folder below XDG_CACHE_HOME or ~/.cache whose files may be deleted at any time.
 *
 * Objects in it are executed, so it is used only if nobody else can write to it. */
#define _XOPEN_SOURCE 700 /* S_ISVTX */
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "files.h"

enum { CACHE_MAX_BYTES = 64 << 20, CACHE_MAX_FILES = 4096 };

/* $XDG_CACHE_HOME or $HOME/.cache, malloced; NULL if neither is an absolute path. */
static char *cache_parent (void) {
  const char *cache = getenv ("XDG_CACHE_HOME"), *home = getenv ("HOME");
  if (cache && *cache == '/') return strdup (cache);
  return home && *home == '/' ? pw_path_join (home, ".cache", "") : NULL;
}

/* Makes a folder and those above it. */
static void cache_make (char *path) {
  for (char *slash = strchr (path + 1, '/'); slash; slash = strchr (slash + 1, '/')) {
    *slash = 0;
    mkdir (path, 0700);
    *slash = '/';
  }
  mkdir (path, 0700);
}

/* NULL if only the user, or the system, can replace the folder's entries; else what is wrong with it. */
static const char *cache_defect (const char *path, int is_cache) {
  struct stat info;
  if ((is_cache ? lstat : stat) (path, &info) != 0) return strerror (errno);
  if (!S_ISDIR (info.st_mode)) return "it is not a folder";
  if (info.st_uid != geteuid () && (is_cache || info.st_uid != 0)) return "it belongs to another user";
  if (info.st_mode & 022 && (is_cache || !(info.st_mode & S_ISVTX))) return "others can write to it";
  return is_cache && access (path, R_OK | W_OK | X_OK) != 0 ? strerror (errno) : NULL;
}

char *pw_cache_folder (char *notice, size_t size) {
  char *parent = cache_parent (), *path = parent ? pw_path_join (parent, "pinwheel", "") : NULL;
  const char *shown = parent, *defect = NULL;
  if (path) {
    cache_make (path);
    defect = cache_defect (parent, 0);
    if (defect == NULL) defect = cache_defect (shown = path, 1);
    if (defect) snprintf (notice, size, "the cache %s is not used: %s", shown, defect);
    if (defect) free (path), path = NULL;
  }
  free (parent);
  return path;
}

/* ---- Size ---- */

typedef struct {
  char name[80];
  struct timespec used;
  long long size;
} cache_file;

static int cache_order (const void *a, const void *b) {
  const struct timespec *t = &((const cache_file *)a)->used, *u = &((const cache_file *)b)->used;
  if (t->tv_sec != u->tv_sec) return t->tv_sec < u->tv_sec ? -1 : 1;
  return (t->tv_nsec > u->tv_nsec) - (t->tv_nsec < u->tv_nsec);
}

static int cache_list (const char *folder, cache_file *file) {
  int count = 0;
  DIR *dir = opendir (folder);
  for (struct dirent *e; dir && count < CACHE_MAX_FILES && (e = readdir (dir)) != NULL;) {
    struct stat info;
    char *path =
        e->d_name[0] == '.' || strlen (e->d_name) >= sizeof file->name ? NULL : pw_path_join (folder, e->d_name, "");
    if (path && lstat (path, &info) == 0 && S_ISREG (info.st_mode)) {
      file[count] = (cache_file){ .used = info.st_mtim, .size = info.st_size };
      strcpy (file[count++].name, e->d_name);
    }
    free (path);
  }
  if (dir) closedir (dir);
  return count;
}

void pw_cache_trim (const char *folder) {
  cache_file *file = malloc (CACHE_MAX_FILES * sizeof *file);
  long long sum = 0;
  int count = file ? cache_list (folder, file) : 0, over = count == CACHE_MAX_FILES;
  if (count) qsort (file, (size_t)count, sizeof *file, cache_order);
  for (int i = 0; i < count; i++) sum += file[i].size;
  for (int i = 0; i < count && (sum > CACHE_MAX_BYTES || (over && i < CACHE_MAX_FILES / 2)); i++) {
    char *path = pw_path_join (folder, file[i].name, "");
    if (path) unlink (path);
    sum -= file[i].size;
    free (path);
  }
  free (file);
}
