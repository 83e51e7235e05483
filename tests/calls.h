/* Calls that have to do with files and with other programs: counted, and failing on demand.
 *
 * For programs linked with --wrap for the functions of calls.c. */
#ifndef CALLS_H
#define CALLS_H

extern struct call_state {
  long count;       /* calls so far, while one is to fail */
  long fail;        /* the one that fails; 0: none */
  const char *name; /* of that */
  int reading;      /* 1: it was to read, and what cannot be read is wrong input */
  int synced;       /* 1: the file opened last has been brought to the disk */
  int unsynced;     /* checkpoints that took the place of others before they were on the disk */
} call;

#endif
