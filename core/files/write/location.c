/* Opens files for reading; follows links, also to files that do not exist; finds conflicts between the files that a
 * command reads and writes, under any name. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "files.h"

FILE *pw_open_input (const char *path, const char **why) {
  struct stat info;
  int file = open (path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC); /* does not block on a FIFO */
  int known = file >= 0 && fstat (file, &info) == 0, other = known && !S_ISREG (info.st_mode);
  FILE *f = known && !other ? fdopen (file, "rb") : NULL;
  if (f) return f;
  int code = other ? 0 : errno;
  *why = code ? strerror (code) : pw_not_regular (info.st_mode);
  if (file >= 0) close (file);
  errno = code; /* for pw_open_input_status */
  return NULL;
}

int pw_open_input_status (void) {
  return errno == ENOMEM || errno == EMFILE || errno == ENFILE ? PW_RESOURCE : PW_INPUT;
}

enum { LOCATION_LINKS = 40 }; /* a longer chain counts as a cycle */

const char *pw_not_regular (mode_t mode) {
  return S_ISDIR (mode)    ? "it is a directory, not a regular file"
         : S_ISFIFO (mode) ? "it is a FIFO or pipe, not a regular file"
         : S_ISCHR (mode)  ? "it is a character device, not a regular file"
         : S_ISBLK (mode)  ? "it is a block device, not a regular file"
         : S_ISSOCK (mode) ? "it is a socket, not a regular file"
                           : "it is not a regular file";
}

static const char *location_base (const char *path) {
  const char *slash = strrchr (path, '/');
  return slash ? slash + 1 : path;
}

char *pw_folder_of (char folder[PW_PATH], const char *path) {
  int n = (int)(location_base (path) - path);
  return pw_path (folder, "%.*s", n > 1 ? n - 1 : 1, n ? path : ".");
}

static int location_same (const struct stat *a, const struct stat *b) {
  return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* The descriptor of this process that a path in /dev/fd or /proc/self/fd means, or -1. */
static int location_descriptor (const char *path) {
  const char *base = location_base (path);
  char folder[PW_PATH];
  struct stat here, descriptors;
  size_t digits = strspn (base, "0123456789");
  if (digits == 0 || digits > 9 || base[digits]) return -1;
  int found = stat (pw_folder_of (folder, path), &here) == 0 && stat ("/dev/fd", &descriptors) == 0 &&
              location_same (&here, &descriptors);
  return found ? atoi (base) : -1;
}

/* Replaces the path of a link by its target.  0 or an errno value. */
static int location_follow (pw_location *p) {
  char target[PW_PATH], folder[PW_PATH];
  ssize_t n = readlink (p->path, target, sizeof target - 1);
  if (n < 0) return errno;
  target[n] = 0;
  pw_folder_of (folder, p->path);
  *target == '/' ? strcpy (p->path, target) : pw_path (p->path, "%s/%s", folder, target);
  return 0;
}

int pw_locate (pw_location *p, const char *path) {
  *p = (pw_location){ .descriptor = strcmp (path, "-") == 0 ? STDOUT_FILENO : -1 };
  pw_path (p->path, "%s", path);
  for (int links = 0, code; links < LOCATION_LINKS; links++) {
    if (p->descriptor < 0) p->descriptor = location_descriptor (p->path);
    p->exists = (p->descriptor >= 0 ? fstat (p->descriptor, &p->info) : lstat (p->path, &p->info)) == 0;
    if (!p->exists) return p->descriptor < 0 && errno == ENOENT ? 0 : errno;
    if (p->descriptor >= 0 || !S_ISLNK (p->info.st_mode)) return 0;
    if ((code = location_follow (p)) != 0) return code;
  }
  return ELOOP;
}

/* ---- Files that a command reads and writes ---- */

typedef struct {
  const pw_use *use;
  pw_location location;
  struct stat folder; /* that contains it */
  int known;          /* 1: `folder` was found */
} location_use;

/* Ignores files that cannot be located, since opening them reports it. */
static void location_use_find (location_use *u, const pw_use *use) {
  char folder[PW_PATH];
  u->use = use;
  if (use->path == NULL || pw_locate (&u->location, use->path) != 0) return;
  u->known = stat (pw_folder_of (folder, u->location.path), &u->folder) == 0;
}

/* The length of the first `size` bytes of a name without one of the endings; `size` if they have none of these. */
static size_t location_without (const char *name, size_t size, const char *const *ending) {
  for (; *ending; ending++) {
    size_t bytes = strlen (*ending);
    if (bytes <= size && memcmp (name + size - bytes, *ending, bytes) == 0) return size - bytes;
  }
  return size;
}

static int location_is_null_device (const struct stat *info) {
  struct stat null;
  return S_ISCHR (info->st_mode) && stat ("/dev/null", &null) == 0 && null.st_rdev == info->st_rdev;
}

/* Whether writing `a` affects `b`: the same file, a file written into a folder, or a temporary file of either. */
static int location_conflicts (const location_use *a, const location_use *b) {
  /* Endings of temporary files: of outputs, of sorted tables, of checkpoints. */
  static const char *const temporary[] = { ".part", ".part.old", ".sorted", ".next", NULL };
  const struct stat *info = &a->location.info;
  if (a->use->how == PW_READS || !a->known || !b->known) return 0;
  const char *name = location_base (b->location.path), *own = location_base (a->location.path);
  size_t size = strlen (name), final = location_without (name, size, temporary);
  if (a->use->how == PW_WRITES_INTO)
    return a->location.exists && location_same (info, &b->folder) &&
           (location_without (name, size, a->use->names) < size ||
            location_without (name, final, a->use->names) < final);
  if (a->location.exists && b->location.exists && location_same (info, &b->location.info))
    return !location_is_null_device (info);
  if (a->location.descriptor >= 0 || b->location.descriptor >= 0 || !location_same (&a->folder, &b->folder)) return 0;
  return strcmp (name, own) == 0 || (strlen (own) == final && memcmp (name, own, final) == 0);
}

static int location_fail (const pw_use *a, const pw_use *b, pw_error *error) {
  const char *path = strcmp (b->path, "-") == 0 ? "standard output (-)" : b->path;
  if (b->how == PW_WRITES && a->how == PW_WRITES)
    return pw_fail (error, PW_INPUT, "%s and %s cannot both write to %.300s", a->what, b->what, path);
  return pw_fail (error, PW_INPUT, "%s %.300s would overwrite %s, %.300s", a->what, a->path, b->what, path);
}

int pw_check_paths (const pw_use *use, int count, pw_error *error) {
  location_use *u = calloc ((size_t)count, sizeof *u);
  int status = u ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < count && u; i++) location_use_find (u + i, use + i);
  for (int i = 0; i < count && status == PW_OK; i++)
    for (int k = 0; k < count && status == PW_OK; k++)
      if (i != k && location_conflicts (u + i, u + k)) status = location_fail (u[i].use, u[k].use, error);
  free (u);
  return status;
}
