/* Complete runs by the programs of benchmarks/baseline, as ladder.run of peers: step or tolerance in, positions out. */
#ifndef BY_HAND_H
#define BY_HAND_H

#include "baseline/baseline.h"
#include "ladder.h"

enum { BY_HAND_SECONDS = 100 }; /* time of a run of the EzyRoller */

/* The EzyRoller with a massive steering assembly, from rest; `scene` is not used. */
extern const ezy_model by_hand_model;
double by_hand_minimal (void *scene, const ladder *self, double h, double *q);   /* 8th order, minimal coordinates */
double by_hand_eighth (void *scene, const ladder *self, double h, double *q);    /* 8th order and projection */
double by_hand_classical (void *scene, const ladder *self, double h, double *q); /* 4th order and projection */
double by_hand_cvode (void *scene, const ladder *self, double rtol, double *q);  /* method "adams" or "bdf" */
double by_hand_ida (void *scene, const ladder *self, double rtol, double *q);

/* A chain of *(int *)scene pendulums from the horizontal, 1 s, 8th order. */
double by_hand_chain (void *scene, const ladder *self, double h, double *q);
void by_hand_chain_step (chain *c, double h, double *q, double *v, double *const *V, double *const *A, double *lambda);

#endif
