/* What a model itself knows about its motion: by a function in C, or by expressions of a text model. */
#include <math.h>
#include "model.h"

int pw_has_truth (const pw_model *m) {
  return m->table->truth != NULL || m->truth.states > 0;
}

int pw_true_state (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error) {
  int n = pw_count_coordinates (s);
  for (int j = 0; j < n; j++) q[j] = v[j] = NAN;
  if (m->table->truth) m->table->truth (m->parameters, t, q, v);
  for (int i = 0; i < m->truth.states; i++) {
    int state = pw_find_state (s, m->truth.state[i], error);
    if (state < 0) return state;
    *(state < n ? q + state : v + state - n) = m->truth.eval (m->truth.context, i, t);
  }
  return PW_OK;
}
