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

enum { CACHE_MAX_BYTES = 64 << 20 };

/* $XDG_CACHE_HOME or $HOME/.cache in the buffer, which is returned; NULL if neither is an absolute path. */
static char *cache_parent (char parent[PW_PATH]) {
  const char *cache = getenv ("XDG_CACHE_HOME"), *home = getenv ("HOME");
  if (cache && *cache == '/') return pw_path (parent, "%s", cache);
  return home && *home == '/' ? pw_path (parent, "%s/.cache", home) : NULL;
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

typedef enum { CACHE_PARENT, CACHE_FOLDER } cache_role;

/* Why a folder cannot be used, or NULL: others can write to it or, if it is the parent, replace what it contains. */
static const char *cache_defect (const char *path, cache_role role) {
  struct stat info;
  if ((role == CACHE_FOLDER ? lstat : stat) (path, &info) != 0) return strerror (errno);
  int by_root = role == CACHE_PARENT && info.st_uid == 0, sticky = role == CACHE_PARENT && info.st_mode & S_ISVTX;
  if (!S_ISDIR (info.st_mode)) return "it is not a folder";
  if (info.st_uid != geteuid () && !by_root) return "it belongs to another user";
  if (info.st_mode & 022 && !sticky) return "others can write to it";
  return role == CACHE_FOLDER && access (path, R_OK | W_OK | X_OK) != 0 ? strerror (errno) : NULL;
}

int pw_cache_folder (char path[PW_PATH], char *notice, size_t size) {
  char parent[PW_PATH];
  if (cache_parent (parent) == NULL) return 0;
  cache_make (pw_path (path, "%s/pinwheel", parent));
  const char *faulty = parent, *defect = cache_defect (parent, CACHE_PARENT);
  if (defect == NULL) defect = cache_defect (faulty = path, CACHE_FOLDER);
  if (defect) snprintf (notice, size, "the cache %s is not used: %s", faulty, defect);
  return defect == NULL;
}

/* The size of all files [bytes]; oldest: the path of the least recently used one, or "". */
static long long cache_size (const char *folder, char oldest[PW_PATH]) {
  long long size = 0;
  struct timespec used = { 0 };
  struct dirent *e;
  DIR *dir = opendir (folder);
  *oldest = 0;
  while (dir && (e = readdir (dir)) != NULL) {
    struct stat info;
    char path[PW_PATH];
    pw_path (path, "%s/%s", folder, e->d_name);
    if (e->d_name[0] == '.' || lstat (path, &info) != 0 || !S_ISREG (info.st_mode)) continue;
    const struct timespec *t = &info.st_mtim;
    size += info.st_size;
    if (*oldest && (t->tv_sec > used.tv_sec || (t->tv_sec == used.tv_sec && t->tv_nsec >= used.tv_nsec))) continue;
    strcpy (oldest, path);
    used = *t;
  }
  if (dir) closedir (dir);
  return size;
}

void pw_cache_trim (const char *folder) {
  char oldest[PW_PATH];
  while (cache_size (folder, oldest) > CACHE_MAX_BYTES && (unlink (oldest) == 0 || errno == ENOENT)) continue;
}
