/* Comparison of a step of ida+ggl on the massless EzyRoller with IDA programmed for it by hand, in runs of 100 s. */
#include <stdlib.h>
#include "by_hand.h"
#include "engine.h"

enum { IDA_SPAN = 100 }; /* [s] */

typedef struct {
  double rtol;
  pw_system *system;
  long residuals[2];
  double q[2][6];
} ida_data;

static long ida_hand (void *context, long n) {
  ida_data *d = context;
  ezy_model model = by_hand_model;
  long all_steps = 0;
  model.m2 = model.I2 = 0;
  for (long i = 0; i < n; i++) {
    long steps;
    int flag;
    ezy_ida *r = ezy_ida_open (&model, d->rtol, IDA_SPAN);
    if (r == NULL) engine_die ("ida by hand", "cannot be opened");
    while ((flag = ezy_ida_step (r)) == 0) continue;
    if (flag < 0) engine_die ("ida by hand", "fails");
    ezy_ida_result (r, &steps, &d->residuals[0], d->q[0]);
    ezy_ida_close (r);
    all_steps += steps;
  }
  return all_steps;
}

static long ida_ours (void *context, long n) {
  ida_data *d = context;
  long all_steps = 0;
  for (long i = 0; i < n; i++) {
    pw_error error = { 0 };
    pw_run *r =
        engine_open (d->system, "ida+ggl", &(pw_settings){ .span = IDA_SPAN, .rtol = d->rtol, .atol = d->rtol });
    while (pw_run_time (r) < IDA_SPAN)
      if (pw_run_advance (r, IDA_SPAN, &error) != PW_OK) engine_die ("ida+ggl", error.text);
    const pw_statistics *s = pw_run_statistics (r);
    all_steps += s->steps;
    d->residuals[1] = s->rhs;
    for (int j = 0; j < 6; j++) d->q[1][j] = r->q[j];
    pw_run_close (r);
  }
  return all_steps;
}

void engine_open_ida (engine_case *c) {
  ida_data *d = calloc (1, sizeof *d);
  if (d == NULL) engine_die (c->key, "out of memory");
  d->rtol = c->rtol;
  d->system = engine_ezyroller (1);
  c->data = d;
  c->base = (timing_work){ ida_hand, d };
  c->ours = (timing_work){ ida_ours, d };
  c->base_function = "ezy_ida_step";
  c->our_function = "pw_run_advance";
  c->base_steps = ida_hand (d, 1);
  c->our_steps = ida_ours (d, 1);
  c->base_residuals = d->residuals[0];
  c->our_residuals = d->residuals[1];
  c->difference = engine_difference (d->q[0], d->q[1], 6);
}

void engine_close_ida (engine_case *c) {
  ida_data *d = c->data;
  pw_system_free (d->system);
  free (d);
}
