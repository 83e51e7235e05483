/* Methods that are set side by side. */
#ifndef PW_CONTESTANTS_H
#define PW_CONTESTANTS_H

#include "pinwheel-solvers.h"

typedef struct {
  const char *name; /* "erk8+projection" */
  int adaptive;     /* 1: follows tolerances, 0: a step */
} pw_contestant;

typedef struct {
  pw_contestant *method;
  int count;
  char *names; /* what the names point into */
} pw_contestants;

/* Reads --methods: names separated by commas, among which "all" stands for each integrator with each stabilisation.  A
 * method is taken once, however often it is named.  PW_INPUT with the nearest valid name.  Close it in every case. */
int pw_contestants_read (pw_contestants *c, const char *text, pw_error *error);
void pw_contestants_close (pw_contestants *c);

/* 1 if a method follows tolerances, 0 if it takes steps of a given size, by nature or because its options say so. */
int pw_contestant_adaptive (const pw_method *integrator, const char *name);

#endif
