/* Files and folders that are locked while a process uses them.
 *
 * The lock counts, not the existence of the file: a lock ends with its process, so a file that one left is no lock. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>
#include "files.h"

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
