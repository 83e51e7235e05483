/* One run of a comparison. */
#include <math.h>
#include "compare.h"

/* Takes the samples that the last step has reached. */
static int compare_visit (pw_study_visitor *v, pw_run *run, pw_error *error) {
  pw_sample sample;
  const pw_motion *m = v->motion;
  for (; v->sample < m->samples && m->t[v->sample] <= pw_run_time (run); v->sample++) {
    int status = pw_run_sample (run, m->t[v->sample], &sample, error);
    if (status != PW_OK) return status;
    pw_motion_take (v->motion, v->study->m.system, v->sample, &sample);
    v->row->balance = fmax (v->row->balance, fabs (sample.balance));
  }
  v->due = v->sample < m->samples ? m->t[v->sample] : INFINITY;
  return PW_OK;
}

int pw_compare_run (pw_compare *x, pw_row *r, pw_motion *motion, pw_error *error) {
  pw_study *s = &x->study;
  pw_study_visitor v = { .visit = compare_visit, .study = s, .row = r, .motion = motion };
  s->settings =
      (pw_settings){ .span = s->t_end, .ledger = motion != NULL, .stop = pw_limit_over, .stop_context = &s->limit };
  *(r->adaptive ? &s->settings.rtol : &s->settings.step) = r->level;
  if (motion) r->balance = 0;
  return pw_study_run (s, r, motion ? &v : NULL, error);
}
