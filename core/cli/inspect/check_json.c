/* What `pinwheel check` found, as JSON: numbers with 17 digits, null for what is not known or not finite. */
#include <math.h>
#include "check.h"
#include "util.h"

/* Bytes that are no UTF-8 become U+FFFD, the replacement character. */
static void json_text (FILE *f, const char *text) {
  fputc ('"', f);
  for (int n; *text; text += n ? n : 1) {
    n = pw_utf8_size (text);
    if (*text == '"' || *text == '\\')
      fprintf (f, "\\%c", *text);
    else if ((unsigned char)*text < ' ')
      fprintf (f, "\\u%04x", (unsigned)*text);
    else
      fwrite (n ? text : "\xEF\xBF\xBD", 1, (size_t)(n ? n : 3), f);
  }
  fputc ('"', f);
}

static void json_number (FILE *f, double value) {
  char text[32];
  fputs (isfinite (value) ? pw_format (text, value, 17) : "null", f);
}

static void json_key (FILE *f, const char *key) {
  fprintf (f, ", \"%s\": ", key);
}

static void json_member (FILE *f, const char *key, double value) {
  json_key (f, key);
  json_number (f, value);
}

/* ---- The parts ---- */

static void json_list (FILE *f, const pw_check_list *l) {
  fputc ('[', f);
  for (int i = 0; i < pw_check_listed (l); i++) {
    if (i > 0) fputs (", ", f);
    json_text (f, l->text[i]);
  }
  fputc (']', f);
}

static void json_texts (FILE *f, const char *const *text) {
  fputc ('[', f);
  for (const char *const *t = text; t && *t; t++) {
    if (t > text) fputs (", ", f);
    json_text (f, *t);
  }
  fputc (']', f);
}

static void json_mobility (FILE *f, const pw_check *x) {
  const pw_system *s = x->m.system;
  fprintf (f, ",\n  \"mobility\": {\"bodies\": %d, \"coordinates\": %d, \"rows\": %d, \"holonomic_rows\": %d",
           pw_count_bodies (s), pw_count_coordinates (s), pw_count_rows (s), pw_count_holonomic (s));
  json_member (f, "configuration", x->r ? (double)x->linear.positions : NAN);
  json_member (f, "velocity", x->r ? (double)x->linear.velocities : NAN);
  json_member (f, "rank", x->r ? (double)x->linear.rank : NAN);
  json_member (f, "least_singular_value", x->r ? x->linear.least : NAN);
  json_member (f, "length_scale", x->r ? pw_run_scale (x->r)->length : NAN);
  fputs ("},\n  \"redundant\": ", f);
  json_texts (f, x->redundant);
}

static void json_mass (FILE *f, const pw_check *x) {
  const pw_system *s = x->m.system;
  int listed = 0;
  fputs (",\n  \"massless\": [", f);
  for (int b = 0; b < pw_count_bodies (s); b++) {
    const double *M = pw_system_mass (s) + 3 * b;
    if (M[0] != 0 && M[2] != 0) continue;
    if (listed++) fputs (", ", f);
    json_text (f, pw_system_body_name (s, b));
  }
  fputs ("],\n  \"saddle_point\": ", f);
  if (x->r == NULL && x->start.status != PW_INPUT)
    fputs ("null", f);
  else
    json_text (f, x->r ? "regular" : "singular");
}

static void json_start (FILE *f, const pw_check *x) {
  char name[300];
  int listed = 0;
  fputs (",\n  \"start\": ", f);
  if (x->r == NULL) {
    fputs ("null", f);
    return;
  }
  const pw_start_report *start = pw_run_start (x->r);
  fprintf (f, "{\"moved\": %d, \"freed\": %s, \"changes\": [", start->moved, start->freed ? "true" : "false");
  for (int i = 0; i < 2 * pw_count_coordinates (x->m.system); i++) {
    double from, to;
    if (!pw_start_moved (x->m.system, start, i)) continue;
    pw_check_state (x, i, name, sizeof name, &from, &to);
    fprintf (f, "%s{\"state\": ", listed++ ? ", " : "");
    json_text (f, name);
    json_member (f, "from", from);
    json_member (f, "to", to);
    fputc ('}', f);
  }
  fputs ("]}", f);
}

static void json_failures (FILE *f, const pw_selftest_report *r, const char *where, int *listed) {
  for (int i = 0; i < r->checks; i++) {
    const pw_selftest_check *c = &r->check[i];
    if (!c->failed) continue;
    fprintf (f, "%s{\"check\": ", (*listed)++ ? ", " : "");
    json_text (f, c->name);
    json_key (f, "in");
    json_text (f, where);
    json_key (f, "expected");
    json_text (f, c->about);
    json_member (f, "error", c->error);
    json_member (f, "bound", c->bound);
    json_key (f, "where");
    json_text (f, c->where);
    fputc ('}', f);
  }
}

static void json_kinds (FILE *f, const pw_check *x) {
  fputs (",\n  \"kinds\": [", f);
  for (const pw_checked_kind *k = x->kind; k < x->kind + x->kinds; k++) {
    int listed = 0;
    fprintf (f, "%s\n    {\"kind\": ", k > x->kind ? "," : "");
    json_text (f, k->kind->name);
    fprintf (f, ", \"elements\": %d, \"checks\": %d, \"failed\": [", k->count, k->alone.checks + k->inside.checks);
    json_failures (f, &k->alone, "random scenes", &listed);
    json_failures (f, &k->inside, "this model", &listed);
    fputs ("]}", f);
  }
  fputs ("]", f);
}

static void json_linear (FILE *f, const pw_check *x) {
  static const char *const steady[] = { "steady", "accelerated", "changing" };
  const pw_linear *l = &x->linear;
  fputs (",\n  \"linearisation\": ", f);
  if (l->A == NULL) {
    fputs ("null", f);
    return;
  }
  double re = x->fastest < 0 ? 0 : l->re[x->fastest], im = x->fastest < 0 ? 0 : l->im[x->fastest];
  fprintf (f, "{\"unknowns\": %d, \"motion\": \"%s\"", l->unknowns, steady[l->steady]);
  json_member (f, "acceleration", l->acceleration);
  json_member (f, "turn_rate", l->twist[2]);
  json_member (f, "symmetries", l->symmetries);
  json_member (f, "doubling_time", pw_check_doubling (x));
  json_member (f, "frequency_hz", fabs (im) / (2 * PW_PI));
  json_member (f, "damping", x->fastest < 0 ? NAN : re != 0 ? -re / hypot (re, im) : 0);
  json_member (f, "rk4_step", x->limit);
  fputs (",\n    \"eigenvalues\": [", f);
  for (int i = 0; i < l->unknowns; i++) {
    fputs (i ? ", [" : "[", f);
    json_number (f, l->re[i]);
    fputs (", ", f);
    json_number (f, l->im[i]);
    fputc (']', f);
  }
  fputs ("]}", f);
}

int pw_check_json (const pw_check *x, pw_output *o, pw_error *error) {
  FILE *f = pw_output_stream (o);
  fputs ("{\"schema\": 1, \"model\": ", f);
  json_text (f, pw_file_name (x->m.file));
  fprintf (f, ", \"status\": \"%s\",\n  \"problems\": ", x->problem.count ? "failed" : "ok");
  json_list (f, &x->problem);
  fputs (",\n  \"findings\": ", f);
  json_list (f, &x->finding);
  json_mobility (f, x);
  json_mass (f, x);
  json_start (f, x);
  json_kinds (f, x);
  json_linear (f, x);
  fputs ("\n}\n", f);
  return pw_output_finish (o, error);
}
