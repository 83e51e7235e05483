/* The generator of specialised code: interface between its files. */
#ifndef PW_SPECIALISE_H
#define PW_SPECIALISE_H

#include <stdio.h>
#include "elimination.h"
#include "sparsity.h"
#include "specialised.h"

enum {
  SPECIALISE_ROWS = 60,      /* most constraint equations: code without loops becomes too long */
  SPECIALISE_ELEMENTS = 120, /* most elements: compilation takes about 0.1 s for each */
  SPECIALISE_BODIES = 200,   /* most bodies: the elimination has a dense matrix */
  SPECIALISE_INLINE = 8      /* up to this number of rows all functions are inlined: common parts are computed once */
};

typedef struct {
  const pw_system *s;
  const unsigned char *independent; /* as in pw_system_source */
  FILE *out;                        /* the generated code */
  pw_workspace *w;                  /* at the initial state */
  pw_sparsity *sparsity;            /* batches */
  int J_entries;
  pw_stream prepare; /* statements of the generated function `prepare` */
  pw_emitter emitter;
} pw_generator;

/* "rolling_wheel", in the buffer, which is returned. */
char *pw_specialise_identifier (const pw_kind *kind, char *buffer, size_t size);
/* The first entry of J of element e of batch k. */
static inline int pw_specialise_J (const pw_generator *gen, int k, int e) {
  const pw_element_batch *batch = &gen->w->batch[k];
  return (int)(batch->J - gen->w->J) + e * batch->kind->rows * batch->b.cols;
}
static inline int pw_specialise_is_independent (const pw_generator *gen, int row) {
  return gen->independent == NULL || gen->independent[row];
}

/* Which forces act on coordinate j: 0, or a sum of these. */
enum { SPECIALISE_CONSTANT = 1, SPECIALISE_CHANGING = 2 };
int pw_specialise_force (const pw_generator *gen, int j);

/* Write the functions of the elements: J, g, sizes of g, right-hand sides, forces, ledger; that of the signals. */
void pw_specialise_elements (const pw_generator *gen);
void pw_specialise_signals (const pw_generator *gen);

/* #define EACH_name(X) X (0) X (1) ...: a loop without a counter, so that arrays stay in registers. */
void pw_specialise_list (FILE *out, const char *name, int n);

/* Writes the tables of the data that code for several runs copies from each; after pw_specialise_algebra, which counts
 * the constants. */
void pw_specialise_data (const pw_generator *gen);

/* Writes products with J, factorisations and solutions; fills gen->prepare.  Returns as pw_elimination_open. */
int pw_specialise_algebra (pw_generator *gen);

#endif
