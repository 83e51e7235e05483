#define _XOPEN_SOURCE 700
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include "calls.h"
#include "check.h"

struct call_state call;

static int call_fails (const char *name, int reading) {
  if (call.fail == 0 || ++call.count != call.fail) return 0;
  call.name = name;
  call.reading = reading;
  return 1;
}

#define CALL(failed, why, type, name, parameters, arguments)                                 \
  type __real_##name parameters;                                                             \
  type __wrap_##name parameters;                                                             \
  type __wrap_##name parameters {                                                            \
    return call_fails (#name, why == EIO) ? (errno = why, failed) : __real_##name arguments; \
  }

CALL (-1, ENOSPC, int, ftruncate, (int fd, off_t size), (fd, size))
CALL (-1, ENOSPC, ssize_t, pwrite, (int fd, const void *p, size_t size, off_t at), (fd, p, size, at))
CALL (-1, EROFS, int, mkdir, (const char *path, mode_t mode), (path, mode))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_init, (posix_spawn_file_actions_t * a), (a))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_addchdir_np, (posix_spawn_file_actions_t * a, const char *path),
      (a, path))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_addopen,
      (posix_spawn_file_actions_t * a, int fd, const char *path, int flags, mode_t mode), (a, fd, path, flags, mode))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_adddup2, (posix_spawn_file_actions_t * a, int from, int to),
      (a, from, to))
CALL (EAGAIN, EAGAIN, int, posix_spawnp,
      (pid_t * child, const char *file, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *with,
       char *const argv[], char *const environment[]),
      (child, file, actions, with, argv, environment))
CALL (NULL, ENOMEM, char *, realpath, (const char *path, char *where), (path, where))
CALL (NULL, EMFILE, DIR *, opendir, (const char *path), (path))
CALL (-1, EROFS, int, fchmod, (int fd, mode_t mode), (fd, mode))
/* Reads that are as short as they may be. */
CALL (-1, EIO, ssize_t, pread, (int fd, void *p, size_t size, off_t at), (fd, p, size < 100 ? size : 100, at))
CALL (-1, EIO, int, fseek, (FILE * f, long at, int from), (f, at, from))
CALL (-1, EIO, long, ftell, (FILE * f), (f))
CALL (-1, EIO, int, fseeko, (FILE * f, off_t at, int from), (f, at, from))

static int call_is (FILE *f, int mode) {
  return (fcntl (fileno (f), F_GETFL) & O_ACCMODE) == mode;
}

/* A file with something in it: closing an empty one brings nothing to the disk. */
static int call_is_written (FILE *f) {
  return f != stdout && f != stderr && !call_is (f, O_RDONLY) && ftello (f) > 0;
}

FILE *__real_fopen (const char *path, const char *mode);
FILE *__wrap_fopen (const char *path, const char *mode);
FILE *__wrap_fopen (const char *path, const char *mode) {
  if (!call_fails ("fopen", *mode == 'r')) return __real_fopen (path, mode);
  errno = EMFILE;
  return NULL;
}

int __real_fclose (FILE *f);
int __wrap_fclose (FILE *f);
int __wrap_fclose (FILE *f) {
  int fails = call_is_written (f) && call_fails ("fclose", 0), status = __real_fclose (f);
  if (fails) errno = EDQUOT;
  return fails ? EOF : status;
}

int __real_fflush (FILE *f);
int __wrap_fflush (FILE *f);
int __wrap_fflush (FILE *f) {
  if (f == NULL || !call_is_written (f) || !call_fails ("fflush", 0)) return __real_fflush (f);
  errno = ENOSPC;
  return EOF;
}

int __real_open (const char *path, int flags, ...);

/* From here on the disk is full. */
size_t __real_fwrite (const void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fwrite (const void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fwrite (const void *p, size_t size, size_t count, FILE *f) {
  const int is_memory = fileno (f) < 0; /* pw_stream_open: its allocations fail */
  if (f == stdout || f == stderr || is_memory || !call_fails ("fwrite", 0)) return __real_fwrite (p, size, count, f);
  int full = __real_open ("/dev/full", O_WRONLY);
  assert_true (full >= 0 && dup2 (full, fileno (f)) >= 0);
  close (full);
  __real_fwrite (p, size, count, f);
  __real_fflush (f);
  errno = ENOSPC;
  return 0;
}

/* A stream that is only read remembers the failure if it is written to. */
static void call_spoil (FILE *f) {
  if (call_is (f, O_RDONLY)) fputc (' ', f);
  errno = EIO;
}

size_t __real_fread (void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fread (void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fread (void *p, size_t size, size_t count, FILE *f) {
  if (!call_fails ("fread", 1)) return __real_fread (p, size, count, f);
  call_spoil (f);
  return 0;
}

char *__real_fgets (char *line, int room, FILE *f);
char *__wrap_fgets (char *line, int room, FILE *f);
char *__wrap_fgets (char *line, int room, FILE *f) {
  if (!call_fails ("fgets", 1)) return __real_fgets (line, room, f);
  call_spoil (f);
  return NULL;
}

/* ---- What is on the disk ---- */

static int call_same (const struct stat *a, const struct stat *b) {
  return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

static int call_is_synced (const struct stat *info) {
  int synced = 0;
  for (int i = 0; i < CALL_SYNCED; i++)
    synced |= call_same (&call.synced[i], info) && call.synced[i].st_size == info->st_size;
  return synced;
}

/* A checkpoint counts on its table, which is "a.csv.part" beside it. */
static void call_check_table (const char *checkpoint) {
  struct stat info;
  char table[600];
  const char *end = strstr (checkpoint, "a.ck.");
  if (end == NULL) return;
  snprintf (table, sizeof table, "%.*sa.csv.part", (int)(end - checkpoint), checkpoint);
  if (lstat (table, &info) == 0 && !call_is_synced (&info)) call.unsynced++;
}

/* A file is on the disk, as it is, before it takes the place of another; its folder must follow. */
int __real_rename (const char *from, const char *to);
int __wrap_rename (const char *from, const char *to);
int __wrap_rename (const char *from, const char *to) {
  struct stat info;
  char folder[600];
  if (call_fails ("rename", 0)) {
    errno = EROFS;
    return -1;
  }
  assert_int_equal (lstat (from, &info), 0);
  if (!call_is_synced (&info)) call.unsynced++;
  call_check_table (from);
  snprintf (folder, sizeof folder, "%.*s", strrchr (to, '/') ? (int)(strrchr (to, '/') - to) : 1,
            strrchr (to, '/') ? to : ".");
  assert_int_equal (stat (folder, &call.folder), 0);
  call.folder_due = 1;
  return __real_rename (from, to);
}

int __real_fsync (int fd);
int __wrap_fsync (int fd);
int __wrap_fsync (int fd) {
  struct stat info;
  if (call_fails ("fsync", 0)) {
    errno = EIO;
    return -1;
  }
  assert_int_equal (fstat (fd, &info), 0);
  if (!S_ISDIR (info.st_mode))
    call.synced[call.next++ % CALL_SYNCED] = info;
  else if (call.folder_due && call_same (&info, &call.folder))
    call.folder_due = 0;
  return __real_fsync (fd);
}

int __wrap_open (const char *path, int flags, ...);
int __wrap_open (const char *path, int flags, ...) {
  va_list arguments;
  va_start (arguments, flags);
  mode_t mode = flags & O_CREAT ? va_arg (arguments, mode_t) : 0;
  va_end (arguments);
  if (!call_fails ("open", (flags & O_ACCMODE) == O_RDONLY && !(flags & O_DIRECTORY)))
    return __real_open (path, flags, mode);
  errno = EMFILE;
  return -1;
}

int __real_flock (int fd, int how);
int __wrap_flock (int fd, int how);
int __wrap_flock (int fd, int how) {
  if (call.moved) { /* another process was faster */
    assert_int_equal (__real_rename (call.moved, call.away), 0);
    call.moved = NULL;
  }
  if (!call_fails ("flock", 0)) return __real_flock (fd, how);
  errno = EIO;
  return -1;
}

FILE *__real_fdopen (int fd, const char *mode);
FILE *__wrap_fdopen (int fd, const char *mode);
FILE *__wrap_fdopen (int fd, const char *mode) {
  if (!call_fails ("fdopen", strcmp (mode, "rb") == 0)) return __real_fdopen (fd, mode);
  errno = EMFILE;
  return NULL;
}
