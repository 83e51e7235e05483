/* Checkpoints of pinwheel run: when they are due, what run they are of, the last one read. */
#ifndef PW_CHECKPOINTS_H
#define PW_CHECKPOINTS_H

#include "cli.h"
#include "text.h"

typedef struct {
  /* as given; NULL: not */
  const char *path, *every_text, *resume;
  /* as understood */
  double every;       /* simulated time between two [s] */
  double due;         /* when the next one is to be saved [s]; INFINITY: never */
  double saved;       /* time of the last one [s]; 0: there is none */
  pw_text head;       /* of the files */
  pw_archive state;   /* of the next one */
  pw_checkpoint from; /* what is resumed */
  pw_output *lock;    /* FILE.part, empty, which keeps other processes out from the beginning to the end */
} pw_checkpoints;

/* Reads the file to be resumed, if there is one, and the options; `every` stays 0 without checkpoints. */
int pw_checkpoints_open (pw_checkpoints *c, double t_end, pw_error *error);
void pw_checkpoints_close (pw_checkpoints *c);

/* Locks the file, so that nothing is computed in vain. */
int pw_checkpoints_reserve (pw_checkpoints *c, pw_error *error);

/* Completes the head, to which the caller has added lines with all that decides what is computed, and refuses a file of
 * another run. */
int pw_checkpoints_match (pw_checkpoints *c, pw_error *error);

/* The first multiple of the interval after t is due next. */
void pw_checkpoints_pass (pw_checkpoints *c, double t);

/* Writes c->state, of time t, to the file. */
int pw_checkpoints_write (pw_checkpoints *c, double t, pw_error *error);

#endif
