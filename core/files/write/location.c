/* Where files are: links followed, also those to a file that does not exist yet; which names stand for the same file. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "files.h"

enum { PLACE_LINKS = 40 }; /* one after the other; more are a circle */

const char *pw_not_regular (mode_t mode) {
  return S_ISDIR (mode)    ? "it is a directory, not a regular file"
         : S_ISFIFO (mode) ? "it is a FIFO or pipe, not a regular file"
         : S_ISCHR (mode)  ? "it is a character device, not a regular file"
         : S_ISBLK (mode)  ? "it is a block device, not a regular file"
         : S_ISSOCK (mode) ? "it is a socket, not a regular file"
                           : "it is not a regular file";
}

static const char *place_base (const char *path) {
  const char *slash = strrchr (path, '/');
  return slash ? slash + 1 : path;
}

char *pw_folder_of (const char *path) {
  size_t n = (size_t)(place_base (path) - path);
  if (n == 0) return strdup (".");
  return strndup (path, n > 1 ? n - 1 : 1);
}

static int place_same (const struct stat *a, const struct stat *b) {
  return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* The descriptor of this process that /dev/fd/N, /proc/self/fd/N and other names of that folder stand for; -1: none. */
static int place_descriptor (const char *path) {
  const char *base = place_base (path);
  struct stat here, own;
  size_t digits = strspn (base, "0123456789");
  if (digits == 0 || digits > 9 || base[digits]) return -1;
  char *folder = pw_folder_of (path);
  int is_own = folder && stat (folder, &here) == 0 && stat ("/dev/fd", &own) == 0 && place_same (&here, &own);
  free (folder);
  return is_own ? atoi (base) : -1;
}

/* Replaces the path of a link by where it leads; an errno value. */
static int place_follow (pw_location *p) {
  char target[4096];
  ssize_t n = readlink (p->path, target, sizeof target - 1);
  if (n < 0) return errno;
  target[n] = 0;
  char *folder = *target == '/' ? NULL : pw_folder_of (p->path);
  char *path = folder ? pw_join (folder, target, "") : strdup (target);
  free (folder);
  free (p->path);
  p->path = path;
  return path ? 0 : ENOMEM;
}

int pw_locate (pw_location *p, const char *path) {
  *p = (pw_location){ .path = strdup (path), .descriptor = strcmp (path, "-") == 0 ? STDOUT_FILENO : -1 };
  if (p->path == NULL) return ENOMEM;
  for (int links = 0, why; links < PLACE_LINKS; links++) {
    if (p->descriptor < 0) p->descriptor = place_descriptor (p->path);
    p->exists = (p->descriptor >= 0 ? fstat (p->descriptor, &p->info) : lstat (p->path, &p->info)) == 0;
    if (!p->exists) return p->descriptor < 0 && errno == ENOENT ? 0 : errno;
    if (p->descriptor >= 0 || !S_ISLNK (p->info.st_mode)) return 0;
    if ((why = place_follow (p)) != 0) return why;
  }
  return ELOOP;
}

/* ---- What a command reads and writes ---- */

typedef struct {
  const pw_use *use;
  pw_location place;
  struct stat folder; /* the one it is in */
  int known;          /* 1: that was found */
} place_use;

/* A file that cannot be found cannot be opened either; PW_RESOURCE without memory. */
static int place_use_find (place_use *u, const pw_use *use) {
  *u = (place_use){ .use = use };
  int why = use->path ? pw_locate (&u->place, use->path) : ENOENT;
  if (why) return why == ENOMEM ? PW_RESOURCE : PW_OK;
  char *folder = pw_folder_of (u->place.path);
  u->known = folder && stat (folder, &u->folder) == 0;
  free (folder);
  return folder ? PW_OK : PW_RESOURCE;
}

/* Whether a name is another one with one of some endings. */
static int place_ends (const char *name, const char *before, const char *const *ending) {
  size_t n = before ? strlen (before) : 0, m = strlen (name);
  for (; *ending; ending++) {
    size_t e = strlen (*ending);
    if (m >= e && strcmp (name + m - e, *ending) == 0 && (before == NULL || (m == n + e && !memcmp (name, before, n))))
      return 1;
  }
  return 0;
}

/* Whether what writes `a` touches `b`: the same file, its temporary name, or one of the files that a folder gets. */
static int place_touches (const place_use *a, const place_use *b) {
  static const char *const temporary[] = { ".part", ".sorted", ".next", NULL };
  struct stat null;
  if (a->use->how == PW_READS || !a->known || !b->known) return 0;
  const char *name = place_base (b->place.path);
  if (a->use->how == PW_WRITES_INTO)
    return a->place.exists && place_same (&a->place.info, &b->folder) && place_ends (name, NULL, a->use->names);
  if (a->place.exists && b->place.exists && place_same (&a->place.info, &b->place.info))
    return !(S_ISCHR (a->place.info.st_mode) && stat ("/dev/null", &null) == 0 &&
             null.st_rdev == a->place.info.st_rdev);
  if (a->place.descriptor >= 0 || b->place.descriptor >= 0 || !place_same (&a->folder, &b->folder)) return 0;
  return strcmp (name, place_base (a->place.path)) == 0 || place_ends (name, place_base (a->place.path), temporary);
}

static int place_fail (const pw_use *a, const pw_use *b, pw_error *error) {
  const char *path = strcmp (b->path, "-") == 0 ? "standard output (-)" : b->path;
  if (b->how == PW_WRITES && a->how == PW_WRITES)
    return pw_fail (error, PW_INPUT, "%s and %s cannot both write to %.300s", a->what, b->what, path);
  return pw_fail (error, PW_INPUT, "%s %.300s would overwrite %s, %.300s", a->what, a->path, b->what, path);
}

int pw_check_paths (const pw_use *use, int count, pw_error *error) {
  place_use *u = calloc ((size_t)count, sizeof *u);
  int status = u ? PW_OK : PW_RESOURCE;
  for (int i = 0; i < count && status == PW_OK; i++) status = place_use_find (u + i, use + i);
  if (status != PW_OK) pw_fail (error, status, "out of memory");
  for (int i = 0; i < count && status == PW_OK; i++)
    for (int k = 0; k < count && status == PW_OK; k++)
      if (i != k && place_touches (u + i, u + k)) status = place_fail (u[i].use, u[k].use, error);
  for (int i = 0; u && i < count; i++) free (u[i].place.path);
  free (u);
  return status;
}
