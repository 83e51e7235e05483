/* Calls that have to do with files and with other programs: counted, and failing on demand.
 *
 * For programs linked with --wrap for the functions of calls.c. */
#ifndef CALLS_H
#define CALLS_H

#include <sys/stat.h>

enum { CALL_SYNCED = 8 };

extern struct call_state {
  long count;                      /* calls so far, while one is to fail */
  long fail;                       /* the one that fails; 0: none */
  const char *name;                /* of that */
  int reading;                     /* 1: it was to read, and what cannot be read is wrong input */
  struct stat synced[CALL_SYNCED]; /* files that were brought to the disk last, as they were then */
  int next;                        /* of these */
  struct stat folder;              /* in which a file has got its name last */
  int folder_due;                  /* 1: it has not been brought to the disk since */
  int unsynced;                    /* files that got their names before they were on the disk */
  const char *moved, *away;        /* a file that is renamed before the next one is locked; NULL: none */
} call;

#endif
