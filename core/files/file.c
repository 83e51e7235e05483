/* Files: reading; names, conflicts between them, locks; outputs, which are renamed when complete; checkpoints. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/file.h>
#include <unistd.h>
#include "files.h"

const char *pw_not_regular (mode_t mode) {
  return S_ISDIR (mode)    ? "it is a directory, not a regular file"
         : S_ISFIFO (mode) ? "it is a FIFO or pipe, not a regular file"
         : S_ISCHR (mode)  ? "it is a character device, not a regular file"
         : S_ISBLK (mode)  ? "it is a block device, not a regular file"
         : S_ISSOCK (mode) ? "it is a socket, not a regular file"
                           : "it is not a regular file";
}

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

/* The location of an existing or future file, links followed. */
typedef struct {
  char path[PW_PATH]; /* of the file itself, or naming the descriptor */
  int descriptor;     /* descriptor of this process that the path names ("-", /dev/stdout, /dev/fd/3), or -1 */
  int exists;         /* 1: `info` is known */
  struct stat info;
} location;

enum { LOCATION_LINKS = 40 }; /* a longer chain counts as a cycle */

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
static int location_follow (location *p) {
  char target[PW_PATH], folder[PW_PATH];
  ssize_t n = readlink (p->path, target, sizeof target - 1);
  if (n < 0) return errno;
  target[n] = 0;
  pw_folder_of (folder, p->path);
  *target == '/' ? strcpy (p->path, target) : pw_path (p->path, "%s/%s", folder, target);
  return 0;
}

/* Finds the location that a path means, through its links.  0 or an errno value. */
static int locate (location *p, const char *path) {
  *p = (location){ .descriptor = strcmp (path, "-") == 0 ? STDOUT_FILENO : -1 };
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

typedef struct {
  const pw_use *use;
  location at;
  struct stat folder; /* that contains it */
  int known;          /* 1: `folder` was found */
} location_use;

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
  const struct stat *info = &a->at.info;
  if (a->use->how == PW_READS || !a->known || !b->known) return 0;
  const char *name = location_base (b->at.path), *own = location_base (a->at.path);
  size_t size = strlen (name), final = location_without (name, size, temporary);
  if (a->use->how == PW_WRITES_INTO)
    return a->at.exists && location_same (info, &b->folder) &&
           (location_without (name, size, a->use->names) < size ||
            location_without (name, final, a->use->names) < final);
  if (a->at.exists && b->at.exists && location_same (info, &b->at.info)) return !location_is_null_device (info);
  if (a->at.descriptor >= 0 || b->at.descriptor >= 0 || !location_same (&a->folder, &b->folder)) return 0;
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
  for (int i = 0; i < count && u; i++) {
    char folder[PW_PATH];
    u[i].use = use + i;
    if (use[i].path == NULL || locate (&u[i].at, use[i].path) != 0) continue; /* opening it reports the reason */
    u[i].known = stat (pw_folder_of (folder, u[i].at.path), &u[i].folder) == 0;
  }
  for (int i = 0; i < count && status == PW_OK; i++)
    for (int k = 0; k < count && status == PW_OK; k++)
      if (i != k && location_conflicts (u + i, u + k)) status = location_fail (u[i].use, u[k].use, error);
  free (u);
  return status;
}

/* ---- Locks of files and folders ----
 *
 * The lock counts, not the existence of the file: a lock ends with its process, so a file that one left is no lock. */

enum { LOCK_TRIES = 100 }; /* when other processes create and remove the file at the same time */

/* Locks an open file without waiting.  0, also on file systems without locks, or an errno value. */
static int lock_acquire (int file) {
  while (flock (file, LOCK_EX | LOCK_NB) != 0) {
    if (errno == ENOLCK || errno == EOPNOTSUPP || errno == ENOSYS) return 0;
    if (errno != EINTR) return errno;
  }
  return 0;
}

/* The reason for messages, from an errno value of pw_lock_file. */
static const char *lock_reason (int code) {
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
  if (file < 0) pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, lock_reason (errno));
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

/* ---- Outputs ----
 *
 * The temporary file is locked until its folder is on the disk, so that two processes never write the same output. */

struct pw_output {
  FILE *stream;       /* NULL: closed, but not renamed yet */
  char path[PW_PATH]; /* as the user knows it */
  char real[PW_PATH]; /* of the file itself, links followed */
  char part[PW_PATH]; /* its temporary name; "": written directly */
  char old[PW_PATH];  /* second name of the file that it replaces, while several are renamed */
  int file;           /* keeps the temporary file locked; -1: written directly */
  int folder;         /* that contains it; -1: written directly, or the folder is not readable */
  int code;           /* errno of the first failed write; -1: unknown; 0: none has failed */
  int continued;      /* 1: opened by pw_output_continue */
  int discard;        /* 1: the temporary file is removed if finishing fails */
};

static void output_free (pw_output *o) {
  if (o == NULL) return;
  if (o->file >= 0) close (o->file);
  if (o->folder >= 0) close (o->folder);
  free (o);
}

static const char *output_shown (const pw_output *o) {
  return strcmp (o->path, "-") == 0 ? "standard output" : o->path;
}

/* The reason for messages; code: an errno value, or -1 if it is unknown. */
static const char *output_reason (const pw_output *o, int code) {
  return code <= 0 ? "a write failed" : *o->part ? lock_reason (code) : strerror (code);
}

static int output_fail (const pw_output *o, int code, pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", output_shown (o), output_reason (o, code));
}

/* As output_fail; also names the temporary file if it remains. */
static int output_fail_with_part (const pw_output *o, int code, pw_error *error) {
  if (*o->part == 0 || o->discard) return output_fail (o, code, error);
  return pw_fail (error, PW_RESOURCE, "cannot write %.200s: %s; what was written is in %.200s", output_shown (o),
                  output_reason (o, code), o->part);
}

/* Makes a stream of a descriptor, which may be -1.  Like the functions below, returns 0 or an errno value. */
static int output_stream_of (pw_output *o, int file, const char *mode) {
  o->stream = file < 0 ? NULL : fdopen (file, mode);
  if (o->stream) return 0;
  int code = errno;
  if (file >= 0) close (file);
  return code;
}

/* Opens a descriptor of the process or a file that is not regular.  A FIFO waits for a reader or a signal. */
static int output_open_direct (pw_output *o, const location *p) {
  int flags = p->descriptor < 0 ? O_WRONLY : fcntl (p->descriptor, F_GETFL);
  if (flags < 0) return errno;
  if ((flags & O_ACCMODE) == O_RDONLY) return EBADF;
  if (p->descriptor == STDOUT_FILENO) {
    o->stream = stdout;
    return 0;
  }
  int file =
      p->descriptor < 0 ? open (p->path, O_WRONLY | O_NOCTTY | O_CLOEXEC) : fcntl (p->descriptor, F_DUPFD_CLOEXEC, 3);
  return output_stream_of (o, file, "w");
}

/* Gives the new file the owner and group of the old one, or the group alone, as permitted, and its mode.  Without the
 * owner there is no set-user-ID bit, without the group no set-group-ID bit either. */
static int output_inherit (int file, const struct stat *old) {
  struct stat now;
  if (fstat (file, &now) != 0) return errno;
  int owner = (now.st_uid == old->st_uid && now.st_gid == old->st_gid) || fchown (file, old->st_uid, old->st_gid) == 0;
  int group = owner || fchown (file, (uid_t)-1, old->st_gid) == 0;
  mode_t mode = old->st_mode & (owner ? 07777 : group ? 03777 : 0777);
  return (now.st_mode & 07777) != mode && fchmod (file, mode) != 0 ? errno : 0;
}

/* The stream has a separate descriptor, so that the lock outlives it. */
static int output_stream (pw_output *o) {
  return output_stream_of (o, fcntl (o->file, F_DUPFD_CLOEXEC, 3), "r+");
}

static int output_open_part (pw_output *o, pw_lock_mode lock_mode) {
  char folder[PW_PATH];
  o->folder = open (pw_folder_of (folder, o->real), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (o->folder < 0 && errno != EACCES) return errno; /* a folder that cannot be listed may still be writable */
  o->file = pw_lock_file (o->part, lock_mode);
  return o->file < 0 ? errno : 0;
}

/* Finds the location of a file to be written; *direct is 1 if it is written directly. */
static int output_locate (const char *path, location *p, int *direct) {
  int code = locate (p, path);
  if (code) return code;
  if (p->exists && S_ISDIR (p->info.st_mode)) return EISDIR;
  *direct = p->descriptor >= 0 || (p->exists && !S_ISREG (p->info.st_mode));
  return !*direct && p->exists && access (p->path, W_OK) != 0 ? errno : 0;
}

char *pw_output_path (const char *path, pw_error *error) {
  location p;
  int direct, code = output_locate (path, &p, &direct);
  char *copy = code || direct ? NULL : strdup (p.path);
  const char *why = code ? strerror (code) : direct ? pw_not_regular (p.info.st_mode) : "out of memory";
  if (copy == NULL) pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, why);
  return copy;
}

/* Finds the location `p`, and the other names of the file unless it is written directly. */
static int output_name (pw_output *o, location *p, const char *ending) {
  int direct, code = output_locate (o->path, p, &direct);
  if (code || direct) return code;
  pw_path (o->real, "%s", p->path);
  pw_path (o->part, "%s%s", o->real, ending);
  pw_path (o->old, "%s.old", o->part);
  return 0;
}

static int output_open_file (pw_output *o, const char *ending) {
  location p;
  int code = output_name (o, &p, ending);
  if (code) return code;
  if (*o->part == 0) return output_open_direct (o, &p);
  code = output_open_part (o, PW_LOCK_NEW);
  if (code == 0 && p.exists) code = output_inherit (o->file, &p.info);
  if (code == 0) code = output_stream (o);
  if (code && o->file >= 0) unlink (o->part);
  return code;
}

static pw_output *output_new (const char *path, pw_error *error) {
  if (pw_require (path, "the name of a file to write", error) != PW_OK) return NULL;
  pw_output *o = *path ? calloc (1, sizeof *o) : NULL;
  if (o == NULL) {
    pw_fail (error, *path ? PW_RESOURCE : PW_INPUT, *path ? "out of memory" : "the name of a file to write is empty");
    return NULL;
  }
  o->file = o->folder = -1;
  pw_path (o->path, "%s", path);
  return o;
}

pw_output *pw_output_open_as (const char *path, const char *ending, pw_error *error) {
  pw_output *o = output_new (path, error);
  if (o == NULL) return NULL;
  o->discard = strcmp (ending, ".part") != 0;
  int code = output_open_file (o, ending);
  if (code == 0) return o;
  if (code == ENOMEM) pw_fail (error, PW_RESOURCE, "cannot write %s: out of memory", path);
  output_fail (o, code, error);
  output_free (o);
  return NULL;
}

pw_output *pw_output_open (const char *path, pw_error *error) {
  return pw_output_open_as (path, ".part", error);
}

FILE *pw_output_stream (pw_output *o) {
  return o->stream;
}

int pw_output_is_file (const pw_output *o) {
  return *o->part != 0;
}

int pw_output_check (pw_output *o, pw_error *error) {
  if (!ferror (o->stream)) return PW_OK;
  if (o->code == 0) o->code = errno;
  return output_fail (o, o->code, error);
}

/* Flushes the stream and writes a regular file to the disk.  0, an errno value, or -1 for an unknown reason. */
static int output_sync (pw_output *o) {
  if (ferror (o->stream)) return o->code ? o->code : -1;
  errno = 0;
  if (fflush (o->stream) == 0 && (o->file < 0 || fsync (o->file) == 0)) return 0;
  return errno ? errno : -1;
}

/* Closes the stream, except standard output.  Returns `code` unless it is 0, else as output_sync. */
static int output_close (pw_output *o, int code) {
  FILE *f = o->stream;
  o->stream = NULL;
  errno = 0;
  if (f == NULL || f == stdout || fclose (f) == 0 || code) return code;
  return errno ? errno : -1;
}

int pw_output_ready (pw_output *o, pw_error *error) {
  if (o->stream) o->code = output_close (o, output_sync (o));
  return o->code ? output_fail_with_part (o, o->code, error) : PW_OK;
}

char *pw_output_abandon (pw_output *o, char *buffer, size_t size) {
  if (o->stream) output_close (o, fflush (o->stream));
  buffer[0] = 0;
  if (*o->part && !pw_output_named (o, ".npz")) { /* archives are complete, and have no lines */
    char c;
    off_t end = lseek (o->file, 0, SEEK_END), keep = end; /* to the last complete line */
    while (keep > 0 && pread (o->file, &c, 1, keep - 1) == 1 && c != '\n') keep--;
    if (keep < end) (void)!ftruncate (o->file, keep);
  }
  if (*o->part) snprintf (buffer, size, "%s", o->part);
  output_free (o);
  return *buffer ? buffer : NULL;
}

void pw_output_discard (pw_output *o) {
  output_close (o, 0);
  if (*o->part) unlink (o->part);
  output_free (o);
}

/* Writes the folder, with the new name, to the disk; file systems that refuse this do not need it. */
static int output_sync_folder (const pw_output *o, pw_error *error) {
  if (o->folder < 0 || fsync (o->folder) == 0 || errno == EINVAL || errno == EROFS || errno == ENOTSUP) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "%s is written, but its folder cannot be written to disk: %s", o->path,
                  strerror (errno));
}

/* Keeps the file that will be replaced under its second name, a hard link; without hard links, under that name only.
 * 0, also if there is none, or -1. */
static int output_keep_old (const pw_output *o) {
  struct stat info;
  unlink (o->old);
  if (link (o->real, o->old) == 0 || stat (o->real, &info) != 0 || !S_ISREG (info.st_mode)) return 0;
  return rename (o->real, o->old);
}

/* Renames all files or none: replaced files are kept until the last one is renamed. */
static int output_rename_all (pw_output *const *o, int count, pw_error *error) {
  int last = count - 1, failed = count, status = PW_OK; /* failed: the file that cannot be renamed */
  while (last > 0 && (o[last] == NULL || *o[last]->part == 0)) last--;
  for (int i = 0; i <= last && status == PW_OK; i++) {
    if (o[i] == NULL || *o[i]->part == 0) continue;
    if ((i == last || output_keep_old (o[i]) == 0) && rename (o[i]->part, o[i]->real) == 0) continue;
    status = output_fail_with_part (o[failed = i], errno, error);
  }
  for (int i = 0; i < last; i++) {
    if (o[i] == NULL || *o[i]->part == 0) continue;
    if (status != PW_OK && i < failed) (void)rename (o[i]->real, o[i]->part);
    if (status != PW_OK && i <= failed) (void)rename (o[i]->old, o[i]->real);
    unlink (o[i]->old);
  }
  return status;
}

int pw_output_finish_all (pw_output *const *o, int count, pw_error *error) {
  int status = PW_OK;
  for (int i = 0; i < count; i++)
    if (o[i] && status == PW_OK) status = pw_output_ready (o[i], error);
  if (status == PW_OK) status = output_rename_all (o, count, error);
  int complete = status == PW_OK;
  for (int i = 0; i < count; i++) {
    if (o[i] == NULL) continue;
    if (complete && status == PW_OK) status = output_sync_folder (o[i], error);
    if (complete)
      output_free (o[i]);
    else if (o[i]->discard)
      pw_output_discard (o[i]);
    else
      pw_output_abandon (o[i], (char[2]){ 0 }, 2);
  }
  return status;
}

int pw_output_finish (pw_output *o, pw_error *error) {
  return pw_output_finish_all (&o, 1, error);
}

/* ---- Continuation of an interrupted run ---- */

enum { OUTPUT_CHECKED = 65536 }; /* bytes */
/* Sets mark->check from the last OUTPUT_CHECKED bytes before mark->length; PW_RETRY if the file is shorter or
 * cannot be read. */
static int output_checksum (int file, pw_mark *mark) {
  char bytes[OUTPUT_CHECKED];
  size_t size = mark->length < sizeof bytes ? (size_t)mark->length : sizeof bytes;
  for (size_t left = size; left > 0;) {
    ssize_t n = pread (file, bytes + size - left, left, (off_t)(mark->length - left));
    if (n == 0 || (n < 0 && errno != EINTR)) return PW_RETRY;
    if (n > 0) left -= (size_t)n;
  }
  mark->check = pw_check_sum (PW_CHECK, bytes, size);
  return PW_OK;
}

int pw_output_named (const pw_output *o, const char *ending) {
  const size_t length = strlen (o->path), size = strlen (ending);
  return length > size && strcasecmp (o->path + length - size, ending) == 0;
}

int pw_output_continued (const pw_output *o) {
  return o->continued;
}

int pw_output_mark (pw_output *o, pw_mark *mark, pw_error *error) {
  if (*o->part == 0)
    return pw_fail (error, PW_INPUT, "%s cannot be continued: it is not a regular file", output_shown (o));
  int code = output_sync (o);
  if (code) return output_fail (o, code, error);
  mark->length = (unsigned long long)ftello (o->stream);
  if (output_checksum (o->file, mark) == PW_OK) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "cannot read %s", o->part);
}

/* 1 if the temporary file begins with the marked contents. */
static int output_is_marked (const pw_output *o, const pw_mark *mark) {
  pw_mark now = { .length = mark->length };
  return output_checksum (o->file, &now) == PW_OK && now.check == mark->check;
}

/* Takes a table under its final name, which a process killed just after completing it has left. */
static int output_restore_part (pw_output *o, const pw_mark *mark) {
  int file = pw_lock_file (o->real, PW_LOCK_EXISTING);
  if (file < 0) return errno;
  o->file = file;
  return output_is_marked (o, mark) && rename (o->real, o->part) != 0 ? errno : 0;
}

static int output_reopen (pw_output *o, const pw_mark *mark, pw_error *error) {
  location p;
  int code = output_name (o, &p, ".part");
  if (code) return output_fail (o, code, error);
  if (*o->part == 0) return pw_fail (error, PW_INPUT, "cannot continue %s: it is not a regular file", o->path);
  code = output_open_part (o, PW_LOCK_EXISTING);
  int absent = code == ENOENT;
  if (absent) code = output_restore_part (o, mark);
  if (code == ENOENT) return pw_fail (error, PW_INPUT, "cannot continue %s: there is no %s", o->path, o->part);
  if (code) return output_fail (o, code, error);
  if (!output_is_marked (o, mark))
    return pw_fail (error, PW_INPUT, "cannot continue %s: %s is not the table that the checkpoint belongs to", o->path,
                    absent ? "it" : o->part);
  code = output_stream (o);
  if (code == 0 &&
      (fseeko (o->stream, (off_t)mark->length, SEEK_SET) != 0 || ftruncate (o->file, (off_t)mark->length) != 0))
    code = errno;
  return code ? pw_fail (error, PW_RESOURCE, "cannot write %s: %s", o->part, strerror (code)) : PW_OK;
}

pw_output *pw_output_continue (const char *path, const pw_mark *mark, pw_error *error) {
  pw_output *o = output_new (path, error);
  if (o && output_reopen (o, mark, error) == PW_OK) {
    o->continued = 1;
    return o;
  }
  if (o && o->stream) fclose (o->stream);
  output_free (o);
  return NULL;
}

/* ---- Checkpoints ---- */

static unsigned long long checkpoint_sum (const char *head, size_t head_size, const void *state, size_t state_size) {
  return pw_check_sum (pw_check_sum (PW_CHECK, head, head_size), state, state_size);
}

int pw_checkpoint_put (pw_output *o, const char *head, const pw_archive *state, pw_error *error) {
  FILE *f = pw_output_stream (o);
  errno = 0; /* for pw_output_check */
  fprintf (f, "%sstate = %zu bytes, check sum %016llx\n", head, state->used,
           checkpoint_sum (head, strlen (head), state->at, state->used));
  if (state->used > 0) fwrite (state->at, 1, state->used, f);
  int status = pw_output_check (o, error);
  if (status == PW_OK) return pw_output_finish (o, error);
  pw_output_discard (o);
  return status;
}

int pw_checkpoint_write (const char *path, const char *head, const pw_archive *state, pw_error *error) {
  pw_output *o = pw_output_open_as (path, ".next", error); /* as the program names the next checkpoint of a run */
  return o ? pw_checkpoint_put (o, head, state, error) : error ? error->status : PW_RESOURCE;
}

#define CHECKPOINT_MAX_BYTES (SIZE_MAX / 4) /* no limit in practice; sums of sizes do not overflow */

static int checkpoint_version (const char *path, const char *text, pw_error *error) {
  static const char magic[] = PW_CHECKPOINT_MAGIC;
  size_t word = strcspn (magic, "0123456789");
  if (strncmp (text, magic, word) != 0) return pw_fail (error, PW_INPUT, "%s is not a checkpoint of Pinwheel", path);
  long format = strtol (text + word, NULL, 10), readable = strtol (magic + word, NULL, 10);
  if (format > 0 && format != readable)
    return pw_fail (error, PW_INPUT, "%s is a checkpoint of format %ld; this Pinwheel reads format %ld", path, format,
                    readable);
  if (strncmp (text, magic, sizeof magic - 1) == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated or damaged", path);
}

/* Finds the end of the head, and the state after it, in a file of `size` bytes. */
static int checkpoint_parse (const char *path, pw_checkpoint *c, size_t size, pw_error *error) {
  size_t state_size = 0;
  unsigned long long sum = 0;
  int n = 0; /* length of the line after the head */
  static const char last[] = "\nend\n";
  const char *end = strstr (c->text, last);
  c->head_end = end ? end + strlen (last) : NULL;
  if (end == NULL || sscanf (c->head_end, "state = %zu bytes, check sum %16llx%n", &state_size, &sum, &n) != 2 ||
      c->head_end[n] != '\n')
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated or damaged", path);
  const char *state = c->head_end + n + 1;
  size_t head_size = (size_t)(c->head_end - c->text), found = size - (size_t)(state - c->text);
  if (found < state_size)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated: found %zu bytes of %zu", path, size,
                    size - found + state_size);
  if (found > state_size || checkpoint_sum (c->text, head_size, state, state_size) != sum)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is damaged: its checksum is wrong", path);
  c->state = (pw_archive){ .at = (unsigned char *)c->text + (state - c->text), .size = state_size, .loading = 1 };
  return PW_OK;
}

int pw_checkpoint_read (const char *path, pw_checkpoint *c, pw_error *error) {
  size_t size = 0;
  *c = (pw_checkpoint){ .text = NULL };
  if (pw_require (path, "the name of a checkpoint", error) != PW_OK) return PW_INPUT;
  int status = pw_read_file ("cannot read the checkpoint", path, CHECKPOINT_MAX_BYTES, "the limit for a checkpoint",
                             &c->text, &size, error);
  if (status == PW_OK) status = checkpoint_version (path, c->text, error);
  return status == PW_OK ? checkpoint_parse (path, c, size, error) : status;
}

void pw_checkpoint_free (pw_checkpoint *c) {
  free (c->text);
  *c = (pw_checkpoint){ .text = NULL };
}
