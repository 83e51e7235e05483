/* Parts of the generator of specialised code. */
#ifndef PW_SPECIALISE_H
#define PW_SPECIALISE_H

#include <stdio.h>
#include "elimination.h"
#include "sparsity.h"
#include "specialised.h"

enum {
  SPECIALISE_ROWS = 60, /* beyond, code without loops becomes too long */
  SPECIALISE_INLINE = 8 /* up to this, everything is inlined, so that common parts are computed once */
};

typedef struct {
  const pw_system *s;
  const unsigned char *independent; /* or NULL */
  FILE *out;
  pw_workspace *w;       /* at the initial state */
  pw_sparsity *sparsity; /* batches */
  int entries;           /* of J */
  pw_stream prepare;     /* prepare's statements */
  int constants;
} pw_generator;

/* "rolling_wheel", in the buffer, which is returned. */
char *pw_specialise_identifier (const pw_kind *kind, char *buffer, size_t size);
/* The first entry of J and the first signal of an element. */
static inline int pw_specialise_J (const pw_generator *scene, int k, int e) {
  const pw_element_batch *batch = &scene->w->batch[k];
  return (int)(batch->J - scene->w->J) + e * batch->kind->rows * batch->b.cols;
}
static inline int pw_specialise_u (const pw_generator *scene, int k, int e) {
  return (int)(scene->s->batch[k].source - scene->s->source) + e * scene->s->batch[k].kind->signals;
}
static inline int pw_specialise_is_independent (const pw_generator *scene, int row) {
  return scene->independent == NULL || scene->independent[row];
}

/* The forces that act on a coordinate: a sum of these. */
enum { SPECIALISE_CONSTANT = 1, SPECIALISE_CHANGING = 2 };
int pw_specialise_force (const pw_generator *scene, int j);

/* Write the functions of elements: Jacobian, right-hand sides, forces, ledger; and that of the signals. */
void pw_specialise_elements (const pw_generator *scene);
void pw_specialise_signals (const pw_generator *scene);

/* #define EACH_name(X) X (0) X (1) ...: a loop without a counter, so that arrays stay in registers. */
void pw_specialise_list (FILE *out, const char *name, int n);

/* Lists what lanes load for each run. */
void pw_specialise_data (const pw_generator *scene);

/* Writes products with J, factorisations and solutions; prepare's statements are collected.  PW_RETRY if there is no
 * fixed order of elimination; PW_RESOURCE. */
int pw_specialise_algebra (pw_generator *scene);

#endif
