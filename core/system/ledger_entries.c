/* The ledger: which elements do work or dissipate energy, and their power. */
#include <stdio.h>
#include "system.h"

/* 1 if an element may do work: its type has a function `power` or eta.  A position prescribed by constants does no
 * work. */
static int ledger_has_work (const pw_element_batch *k, int element) {
  const pw_kind *kind = k->kind;
  int constants = 0;
  if (kind->power) return 1;
  if (kind->rows == 0 || kind->eta == NULL) return 0;
  for (int u = 0; u < kind->signals; u++)
    constants += k->source[element * kind->signals + u].signal.type == PW_CONSTANT;
  return kind->level != PW_HOLONOMIC || constants < kind->signals;
}

int pw_ledger_list (const pw_system *s, pw_entry *entry) {
  int count = 0;
  for (int i = 0; i < s->batches; i++) {
    const pw_element_batch *k = &s->batch[i];
    for (int loss = 0; loss < 2; loss++)
      for (int e = 0; e < k->b.count; e++)
        if (loss ? k->kind->loss != NULL : ledger_has_work (k, e))
          entry[count++] = (pw_entry){ i, e, loss ? PW_LOSS : PW_WORK };
  }
  return count;
}

char *pw_system_ledger_name (const pw_system *s, int entry, char *buffer, size_t size) {
  const pw_entry *listed = &s->entry[entry];
  return pw_member_name (s, &s->batch[listed->batch], listed->element, listed->type == PW_WORK ? "work" : "loss",
                         buffer, size);
}

void pw_evaluate_ledger (pw_workspace *w, const double *lambda, double *rate) {
  const pw_element_batch *last = NULL;
  int type = -1;
  double *eta = w->scratch;
  for (int i = 0; i < w->s->entries; i++) {
    const pw_entry *entry = &w->s->entry[i];
    pw_element_batch *k = &w->batch[entry->batch];
    int by_eta = k->kind->rows > 0 && entry->type == PW_WORK && k->kind->power == NULL; /* see the end of the loop */
    if (k != last || (int)entry->type != type) {
      k->b.lambda = lambda + k->row;
      (by_eta                   ? k->kind->eta
       : entry->type == PW_WORK ? k->kind->power
                                : k->kind->loss) (&k->b, by_eta ? eta : k->block);
      last = k;
      type = (int)entry->type;
    }
    if (!by_eta) {
      rate[i] = k->block[entry->element];
      continue;
    }
    rate[i] = 0; /* the constraint force -J^T lambda has the power -lambda . J v = -lambda . eta */
    for (int r = 0, n = k->kind->rows; r < n; r++)
      rate[i] -= k->b.lambda[entry->element * n + r] * eta[entry->element * n + r];
  }
}
