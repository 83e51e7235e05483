/* The fingerprint of a sweep: lines "KEY = VALUE" with all that decides what its rows are.  A journal and the parts of a
 * sweep begin with it, so that rows of different sweeps are never mixed. */
#include <math.h>
#include <string.h>
#include "sweep.h"

void pw_fingerprint_tables (pw_plan *p, const pw_model *m) {
  p->tables = pw_check_tables (p->tables, m);
}

/* Parameters that are not varied, as they are after --set. */
static void print_parameters (pw_plan *p, const pw_model *m) {
  for (const pw_parameter *q = pw_model_table (m)->parameters; q && q->name; q++) {
    int varied = 0;
    for (int i = 0; i < p->grid.axes; i++) varied |= p->grid.axis[i].parameter == q;
    if (!varied) pw_print_number (&p->fingerprint, "parameter", q->name, pw_model_parameter (m, q));
  }
}

static void print_grid (pw_plan *p) {
  pw_print_starts (&p->fingerprint, p->starts);
  pw_text order = { .at = NULL };
  for (int i = 0; i < p->grid.axes; i++) {
    pw_print_line (&p->fingerprint, "vary", p->grid.axis[i].name, p->grid.axis[i].range);
    pw_text_cell (&order, p->grid.axis[i].name);
  }
  p->fingerprint.failed |= order.failed;
  pw_print_line (&p->fingerprint, "order", NULL, order.at ? order.at : "");
  pw_text_free (&order);
}

int pw_fingerprint_make (pw_plan *p, const pw_model *m, pw_error *error) {
  char part[60];
  pw_text_add (&p->fingerprint, PW_SWEEP_MAGIC);
  pw_print_line (&p->fingerprint, "version", NULL, PW_VERSION);
  if (pw_print_model (&p->fingerprint, p->file, p->tables, error) != PW_OK) return error->status;
  pw_print_line (&p->fingerprint, "method", NULL, p->method);
  pw_print_number (&p->fingerprint, "t-end", NULL, p->t_end);
  pw_print_number (&p->fingerprint, "step", NULL, p->settings.step);
  pw_print_number (&p->fingerprint, "rtol", NULL, p->settings.rtol);
  pw_print_number (&p->fingerprint, "atol", NULL, p->settings.atol);
  if (p->settings.max_steps != PW_MAX_STEPS)
    pw_print_number (&p->fingerprint, "max-steps", NULL, (double)p->settings.max_steps);
  if (isfinite (p->limit)) pw_print_number (&p->fingerprint, "limit", NULL, p->limit);
  print_parameters (p, m);
  print_grid (p);
  pw_print_number (&p->fingerprint, "rows", NULL, (double)p->grid.rows);
  pw_print_line (&p->fingerprint, "columns", NULL, p->head.at ? p->head.at : "");
  snprintf (part, sizeof part, "%d/%d", p->part, p->parts);
  pw_print_line (&p->fingerprint, "part", NULL, part);
  pw_text_add (&p->fingerprint, "end\n");
  if (p->fingerprint.failed || p->head.failed) return pw_fail (error, PW_MACHINE, "out of memory");
  return PW_OK;
}
