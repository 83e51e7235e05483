/* The search path for models: the folders of PINWHEEL_MODELS, then those of the running program and of this library.
 *
 * Folders next to the program, or one level up (tests), serve the build tree; ../lib and ../include serve an
 * installation; the folder of the library serves programs installed elsewhere.  The order of the folders decides only
 * about headers and pages, of which the first is taken: a name that two models have is refused (model_file.c). */
#define _GNU_SOURCE /* dladdr1 */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <link.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>
#include "files.h"

int pw_ends_with (const char *name, const char *ending) {
  size_t n = strlen (name), e = strlen (ending);
  return n > e && strcmp (name + n - e, ending) == 0;
}

static int search_no_memory (pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "out of memory while looking for models");
}

/* What folders are relative to: the folder of the running program, that of this library. */
enum { SEARCH_PROGRAM, SEARCH_LIBRARY, SEARCH_ANCHORS };

typedef char search_anchor_paths[SEARCH_ANCHORS][PW_PATH];

/* Stores these folders; "" if one is unknown. */
static int search_find_anchors (search_anchor_paths anchor, pw_error *error) {
  static const char here = 0; /* an address inside this library */
  Dl_info info;
  struct link_map *object = NULL;
  ssize_t n = readlink ("/proc/self/exe", anchor[SEARCH_PROGRAM], PATH_MAX - 1);
  anchor[SEARCH_PROGRAM][n > 0 ? n : 0] = 0;
  /* l_name is "" if the program contains the library */
  const char *library = dladdr1 (&here, &info, (void **)&object, RTLD_DL_LINKMAP) ? object->l_name : NULL;
  if (library && (library = realpath (library, anchor[SEARCH_LIBRARY])) == NULL && errno == ENOMEM)
    return search_no_memory (error);
  if (library == NULL) *anchor[SEARCH_LIBRARY] = 0;
  for (int i = 0; i < SEARCH_ANCHORS; i++) {
    char *slash = strrchr (anchor[i], '/');
    if (slash) slash[slash == anchor[i]] = 0; /* "/" of the root */
  }
  return PW_OK;
}

/* Folders relative to each anchor. */
typedef const char *const search_folders[SEARCH_ANCHORS][3];
enum { SEARCH_FOLDERS = 3 * SEARCH_ANCHORS };

/* Stores the i-th of these folders, which need not exist; 0 if its anchor is unknown. */
static int search_place (search_anchor_paths anchor, search_folders where, int i, char folder[PW_PATH]) {
  pw_path (folder, "%s/%s", anchor[i / 3], where[i / 3][i % 3]);
  return *anchor[i / 3] != 0;
}

/* ---- Model files ---- */

/* Adds a model, whose name is the first `length` bytes of `name`, unless it is in the list already. */
static int search_add_file (pw_search *s, const char *name, size_t length, const char *path, pw_error *error) {
  for (int i = 0; i < s->count; i++)
    if (strcmp (s->found[i].path, path) == 0 && strncmp (s->found[i].name, name, length) == 0 &&
        s->found[i].name[length] == 0)
      return PW_OK;
  if (pw_grow (&s->found, (size_t)s->count, &s->room, sizeof *s->found) != PW_OK) return search_no_memory (error);
  pw_found *f = &s->found[s->count];
  f->path = pw_arena_copy (&s->arena, path);
  f->name = pw_arena_copy (&s->arena, name);
  if (f->path == NULL || f->name == NULL) return search_no_memory (error);
  f->name[length] = 0;
  s->count++;
  return PW_OK;
}

static int search_entry (pw_search *s, const char *folder, const char *entry, pw_error *error) {
  const char *ending = pw_ends_with (entry, ".so") ? ".so" : pw_ends_with (entry, ".yaml") ? ".yaml" : NULL;
  if (ending == NULL || entry[0] == '.' || !pw_is_line (entry)) return PW_OK;
  char path[PW_PATH], real[PW_PATH];
  struct stat info;
  if (realpath (pw_path (path, "%s/%s", folder, entry), real) == NULL)
    return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  if (stat (real, &info) != 0 || !S_ISREG (info.st_mode)) return PW_OK;
  return search_add_file (s, entry, strlen (entry) - strlen (ending), real, error);
}

/* Adds a folder to the list for messages. */
static void search_list_folder (pw_search *s, const char *real) {
  size_t used = strlen (s->folders);
  const char *listed = PW_PRINTED (sizeof s->folders + 2, ":%s:", s->folders);
  if (used + strlen (real) + 2 <= sizeof s->folders && strstr (listed, PW_PRINTED (PW_PATH + 2, ":%s:", real)) == NULL)
    sprintf (s->folders + used, "%s%s", used ? ":" : "", real);
}

/* Adds the models in a folder; skips missing and inaccessible folders, as shells do with PATH. */
static int search_folder (pw_search *s, const char *folder, pw_error *error) {
  char real[PW_PATH];
  if (realpath (folder, real) == NULL) return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  search_list_folder (s, real);
  DIR *dir = opendir (folder);
  if (dir == NULL && (errno == ENOMEM || errno == EMFILE || errno == ENFILE))
    return pw_fail (error, PW_RESOURCE, "cannot look into the folder %s: %s", folder, strerror (errno));
  if (dir == NULL) return PW_OK;
  int status = PW_OK;
  struct dirent *entry;
  while (status == PW_OK && (entry = readdir (dir)) != NULL) status = search_entry (s, folder, entry->d_name, error);
  closedir (dir);
  return status;
}

/* Whether a folder can be searched; if not, adds it to s->unread with the reason. */
static int search_is_readable (pw_search *s, const char *folder) {
  char inside[PW_PATH];
  size_t used = strlen (s->unread);
  if (access (pw_path (inside, "%s/.", folder), R_OK | X_OK) == 0) return 1;
  snprintf (s->unread + used, sizeof s->unread - used, "%s%.80s (%s)", used ? ", " : "", folder, strerror (errno));
  return 0;
}

static int search_environment (pw_search *s, pw_error *error) {
  const char *list = getenv ("PINWHEEL_MODELS");
  if (list == NULL) return PW_OK;
  char *copy = strdup (list), *rest = copy, *folder;
  if (copy == NULL) return search_no_memory (error);
  int status = PW_OK;
  while (status == PW_OK && (folder = strsep (&rest, ":")) != NULL)
    if (*folder && search_is_readable (s, folder)) status = search_folder (s, folder, error);
  free (copy);
  return status;
}

static int search_order (const void *a, const void *b) {
  const pw_found *f = a, *g = b;
  int names = strcmp (f->name, g->name);
  return names ? names : strcmp (f->path, g->path);
}

int pw_search_open (pw_search *s, pw_error *error) {
  static const search_folders where = { { "models", "../models", "../lib/pinwheel/models" },
                                        { "models", "../models", "pinwheel/models" } };
  search_anchor_paths anchor;
  char folder[PW_PATH];
  *s = (pw_search){ .count = 0 };
  int status = search_environment (s, error);
  if (status == PW_OK) status = search_find_anchors (anchor, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (search_place (anchor, where, i, folder)) status = search_folder (s, folder, error);
  if (s->count > 1) qsort (s->found, (size_t)s->count, sizeof *s->found, search_order);
  return status;
}

void pw_search_close (pw_search *s) {
  pw_arena_free (&s->arena);
  free (s->found);
}

/* ---- Other files ---- */

/* Stores the path of the first of the files of this name that can be read; "" if there is none. */
static int search_find (search_folders where, const char *file, char path[PW_PATH], pw_error *error) {
  search_anchor_paths anchor;
  char folder[PW_PATH];
  int status = search_find_anchors (anchor, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (search_place (anchor, where, i, folder) && access (pw_path (path, "%s/%s", folder, file), R_OK) == 0)
      return PW_OK;
  *path = 0;
  return status;
}

int pw_search_header (char path[PW_PATH], pw_error *error) {
  static const search_folders where = { { "include", "../include", "../include/pinwheel" },
                                        { "include", "../include", "../include/pinwheel" } };
  return search_find (where, "pinwheel.h", path, error);
}

int pw_search_page_file (const char *file, char path[PW_PATH], pw_error *error) {
  static const search_folders where = { { "page", "../page", "../lib/pinwheel/page" },
                                        { "page", "../page", "pinwheel/page" } };
  return search_find (where, file, path, error);
}

/* Opens files for reading; follows links, also to files that do not exist; finds conflicts between the files that a
 * command reads and writes, under any name. */

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

/* Files and folders that are locked while a process uses them.
 *
 * The lock counts, not the existence of the file: a lock ends with its process, so a file that one left is no lock. */

enum { LOCK_TRIES = 100 }; /* when other processes create and remove the file at the same time */

/* 0 or an errno value.  File systems without locks give no protection. */
static int lock_acquire (int file) {
  while (flock (file, LOCK_EX | LOCK_NB) != 0) {
    if (errno == ENOLCK || errno == EOPNOTSUPP || errno == ENOSYS) return 0;
    if (errno != EINTR) return errno;
  }
  return 0;
}

const char *pw_lock_reason (int code) {
  return code == EWOULDBLOCK ? "another process is writing it"
         : code == ELOOP     ? "its temporary name is a symbolic link"
         : code == ENODEV    ? "its temporary name is not that of a regular file"
                             : strerror (code);
}

/* Opens the file, never through a symbolic link, and creates it if the mode permits; *created: 1 if it is new. */
static int lock_open_file (const char *path, pw_lock_mode mode, int *created) {
  int file = mode == PW_LOCK_EXISTING ? -1 : open (path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
  *created = file >= 0;
  if (*created || (mode != PW_LOCK_EXISTING && errno != EEXIST)) return file;
  return open (path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
}

/* Locks the open file.  0 or an errno value; ESTALE if the path now names another file. */
static int lock_descriptor (int file, const char *path) {
  struct stat info, now;
  if (fstat (file, &info) != 0) return errno;
  if (!S_ISREG (info.st_mode)) return ENODEV;
  int code = lock_acquire (file);
  if (code) return code;
  return lstat (path, &now) == 0 && now.st_dev == info.st_dev && now.st_ino == info.st_ino ? 0 : ESTALE;
}

int pw_lock_file (const char *path, pw_lock_mode mode) {
  for (int tries = 0; tries < LOCK_TRIES; tries++) {
    int created, file = lock_open_file (path, mode, &created), code = file < 0 ? errno : lock_descriptor (file, path);
    if (code == 0 && (created || mode != PW_LOCK_NEW)) return file;
    if (code == 0 && unlink (path) != 0) code = errno;                                /* left by a killed process */
    if (created && code != 0 && code != ESTALE && code != EWOULDBLOCK) unlink (path); /* else it is another process's */
    if (file >= 0) close (file);
    errno = code;
    if (code != 0 && code != ESTALE && (code != ENOENT || mode == PW_LOCK_EXISTING)) return -1;
  }
  if (errno == 0 || errno == ESTALE) errno = EWOULDBLOCK; /* others create and remove it all the time */
  return -1;
}

int pw_lock_path (const char *path, pw_error *error) {
  int file = pw_lock_file (path, PW_LOCK_KEEP);
  if (file < 0) pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, pw_lock_reason (errno));
  return file;
}

int pw_lock_folder (const char *path, pw_error *error) {
  int file = open (path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  int code = file < 0 ? errno : lock_acquire (file);
  if (code == EBADF) code = 0; /* NFS locks only what is open for writing, which folders never are: no protection */
  if (code == 0) return file;
  if (file >= 0) close (file);
  pw_fail (error, PW_RESOURCE, "cannot write into %s: %s", path,
           code == EWOULDBLOCK ? "another process is writing into it" : strerror (code));
  return -1;
}
