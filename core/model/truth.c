/* What a model itself knows about its motion: by a function in C, or by expressions of a text model. */
#include <math.h>
#include "model.h"

int pw_has_truth (const pw_model *m) {
  return m->table->truth != NULL || pw_model_truth (m)->states > 0;
}

int pw_true_state (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error) {
  int n = pw_count_coordinates (s);
  for (int j = 0; j < n; j++) q[j] = v[j] = NAN;
  if (m->table->truth) m->table->truth (m->parameters, t, q, v);
  const pw_truth_text *text = pw_model_truth (m);
  for (int i = 0; i < text->states; i++) {
    int state = pw_find_state (s, text->state[i], error);
    if (state < 0) return state;
    *(state < n ? q + state : v + state - n) = text->eval (text->context, i, t);
  }
  return PW_OK;
}
