/* The summary of a run as JSON. */
#include <errno.h>
#include <string.h>
#include "files.h"

/* ---- The final state ---- */

static void json_bodies (pw_json *j, const pw_system *s, const pw_sample *x) {
  static const char *const names[] = { "x", "y", "phi", "vx", "vy", "omega" };
  pw_json_open (j, "bodies", '{');
  for (int b = 0; b < pw_system_bodies (s); b++) {
    pw_json_open (j, pw_system_body_name (s, b), '{');
    for (int i = 0; i < 6; i++) pw_json_number (j, names[i], (i < 3 ? x->q : x->v - 3)[3 * b + i]);
    pw_json_close (j, '}');
  }
  pw_json_close (j, '}');
}

/* Internal coordinates "ELEMENT.NAME" and their velocities, one object per element. */
static void json_elements (pw_json *j, const pw_system *s, const pw_sample *x) {
  char name[300], element[300] = "";
  int n = pw_system_coordinates (s), first = 3 * pw_system_bodies (s);
  if (n == first) return;
  pw_json_open (j, "elements", '{');
  for (int i = first; i < n; i++) {
    char *dot = strrchr (pw_system_state_name (s, i, name, sizeof name), '.');
    *dot = 0;
    if (strcmp (element, name) != 0) {
      if (*element) pw_json_close (j, '}');
      strcpy (element, name);
      pw_json_open (j, element, '{');
    }
    pw_json_number (j, dot + 1, x->q[i]);
    pw_json_number (j, strrchr (pw_system_state_name (s, n + i, name, sizeof name), '.') + 1, x->v[i]);
  }
  pw_json_close (j, '}');
  pw_json_close (j, '}');
}

static void json_reactions (pw_json *j, const pw_system *s, const pw_sample *x) {
  char name[300];
  pw_json_open (j, "reactions", '{');
  for (int i = 0; i < pw_system_rows (s); i++)
    pw_json_number (j, pw_system_reaction_name (s, i, name, sizeof name), 0 - x->lambda[i]);
  pw_json_close (j, '}');
}

/* An object of numbers. */
static void json_numbers (pw_json *j, const char *key, const char *const *name, const double *value, int count) {
  pw_json_open (j, key, '{');
  for (int i = 0; i < count; i++) pw_json_number (j, name[i], value[i]);
  pw_json_close (j, '}');
}

static void json_sample (pw_json *j, const pw_system *s, const pw_sample *x, int ledger) {
  static const char *const names[] = { "kinetic", "potential", "work", "loss", "projection", "balance" };
  if (s == NULL || x == NULL) {
    for (const char *const *key = (const char *const[]){ "t", "bodies", "reactions", "energy", NULL }; *key; key++)
      pw_json_text (j, *key, NULL);
    return;
  }
  pw_json_number (j, "t", x->t);
  json_bodies (j, s, x);
  json_elements (j, s, x);
  json_reactions (j, s, x);
  const double energy[] = { x->kinetic, x->potential, x->work, x->loss, x->projection, x->balance };
  if (ledger)
    json_numbers (j, "energy", names, energy, 6);
  else
    pw_json_text (j, "energy", NULL);
}

/* ---- The run ---- */

static void json_lists (pw_json *j, const char *const *redundant, const pw_system *s) {
  char name[300];
  pw_json_open (j, "redundant", '[');
  for (; redundant && *redundant; redundant++) pw_json_text (j, NULL, *redundant);
  pw_json_close (j, ']');
  pw_json_open (j, "differences", '[');
  for (int i = 0, n = s ? pw_system_differences (s) : 0; i < n; i++)
    pw_json_text (j, NULL, pw_system_difference_name (s, i, name, sizeof name));
  pw_json_close (j, ']');
}

static void json_reference (pw_json *j, const pw_reference_error *e) {
  static const char *const names[] = { "length", "angle", "speed", "rate" };
  if (e == NULL) {
    pw_json_text (j, "truth", NULL);
    return;
  }
  pw_json_open (j, "truth", '{');
  pw_json_text (j, "source", e->source);
  pw_json_number (j, "samples", e->samples);
  pw_json_number (j, "t", e->t);
  json_numbers (j, "end", names, e->end, 4);
  json_numbers (j, "largest", names, e->most, 4);
  pw_json_number (j, "reactions", e->reactions);
  pw_json_close (j, '}');
}

static void json_statistics (pw_json *j, const pw_statistics *n, double cpu) {
  static const char *const residuals[] = { "position", "velocity" }, *const names[] = {
    "steps", "rejected", "rhs", "jacobians", "factorisations", "restarts", "cpu_s"
  };
  if (n == NULL) {
    pw_json_text (j, "residual", NULL);
    pw_json_text (j, "statistics", NULL);
    return;
  }
  json_numbers (j, "residual", residuals, (const double[]){ n->position, n->velocity }, 2);
  const double value[] = { (double)n->steps,
                           (double)n->rejected,
                           (double)n->rhs,
                           (double)n->jacobians,
                           (double)n->factorisations,
                           (double)n->restarts,
                           cpu };
  json_numbers (j, "statistics", names, value, 7);
}

int pw_json_write (const pw_summary *summary, const pw_system *s, const pw_sample *sample, int ledger,
                   const pw_statistics *statistics, pw_output *o, pw_error *error) {
  pw_json j = { .f = pw_output_stream (o), .lines = 99 };
  errno = 0;
  pw_json_open (&j, NULL, '{');
  pw_json_number (&j, "schema", 1);
  pw_json_text (&j, "model", summary->model);
  pw_json_text (&j, "method", summary->method);
  pw_json_text (&j, "status", summary->status);
  pw_json_text (&j, "reason", summary->reason);
  json_sample (&j, s, sample, ledger);
  pw_json_number (&j, "unbalanced", summary->energy_defect);
  json_lists (&j, summary->redundant, s);
  json_reference (&j, summary->reference);
  json_statistics (&j, statistics, summary->cpu);
  pw_json_close (&j, '}');
  return pw_output_check (o, error);
}
