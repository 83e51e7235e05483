/* The summary of a run as JSON: numbers with 17 digits, null for what is not known or not finite.
 *
 * libfyaml emits it.  Numbers and null go in as plain scalars, texts and names through json_text, which makes them
 * scalars that stay texts whatever they look like; blanks around a text are lost. */
#include <errno.h>
#include <libfyaml.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"
#include "system.h"

/* A document in the making; the first failure is remembered, so that only the end asks. */
typedef struct {
  struct fy_document *document;
  int failed; /* out of memory */
} json;

/* ---- Scalars ---- */

/* A malloced copy in which bytes that are no UTF-8 have become U+FFFD, the replacement character. */
static char *json_clean (const char *text) {
  char *clean = malloc (3 * strlen (text) + 1), *to = clean;
  if (clean == NULL) return NULL;
  while (*text) {
    int n = pw_utf8_size (text);
    memcpy (to, n ? text : "\xEF\xBF\xBD", (size_t)(n ? n : 3));
    to += n ? n : 3;
    text += n ? n : 1;
  }
  *to = 0;
  return clean;
}

static int json_literal (const char *text) {
  size_t n = strlen (text);
  return (n > 0 && strspn (text, "+-.0123456789eE") == n) || strcmp (text, "null") == 0 || strcmp (text, "true") == 0 ||
         strcmp (text, "false") == 0;
}

/* libfyaml quotes and escapes a scalar unless it reads as a number, null, true or false: such a text goes in quoted. */
static struct fy_node *json_text (json *j, const char *text) {
  char *copy = json_clean (text);
  if (copy == NULL) return NULL;
  if (!json_literal (text)) {
    struct fy_node *node = fy_node_create_scalar_copy (j->document, copy, FY_NT);
    free (copy);
    return node;
  }
  size_t size = strlen (copy) + 3;
  char *quoted = malloc (size);
  if (quoted) snprintf (quoted, size, "\"%s\"", copy);
  free (copy);
  return quoted ? fy_node_build_from_malloc_string (j->document, quoted, size - 1) : NULL; /* the document keeps it */
}

static struct fy_node *json_plain (json *j, const char *text) {
  return fy_node_create_scalar_copy (j->document, text, FY_NT);
}

/* ---- Members of an object ---- */

static void json_add (json *j, struct fy_node *object, const char *key, struct fy_node *value) {
  struct fy_node *name = json_text (j, key);
  if (object && name && value && fy_node_mapping_append (object, name, value) == 0) return;
  fy_node_free (name);
  fy_node_free (value);
  j->failed = 1;
}

static void json_add_number (json *j, struct fy_node *object, const char *key, double value) {
  char text[32];
  json_add (j, object, key, json_plain (j, isfinite (value) ? pw_format (text, value, 17) : "null"));
}

static void json_add_text (json *j, struct fy_node *object, const char *key, const char *value) {
  json_add (j, object, key, value ? json_text (j, value) : json_plain (j, "null"));
}

static void json_add_null (json *j, struct fy_node *object, const char *key) {
  json_add (j, object, key, json_plain (j, "null"));
}

static struct fy_node *json_add_object (json *j, struct fy_node *object, const char *key) {
  struct fy_node *inner = fy_node_create_mapping (j->document);
  json_add (j, object, key, inner);
  return j->failed ? NULL : inner;
}

/* ---- The parts of a summary ---- */

static void json_bodies (json *j, struct fy_node *root, const pw_system *s, const pw_sample *x) {
  static const char *const names[] = { "x", "y", "phi", "vx", "vy", "omega" };
  struct fy_node *bodies = json_add_object (j, root, "bodies");
  for (int b = 0; b < s->bodies && !j->failed; b++) {
    struct fy_node *body = json_add_object (j, bodies, s->body_name[b]);
    for (int i = 0; i < 6; i++) json_add_number (j, body, names[i], (i < 3 ? x->q : x->v - 3)[3 * b + i]);
  }
}

/* Coordinates that elements own; most scenes have none, and then nothing is written. */
static void json_elements (json *j, struct fy_node *root, const pw_system *s, const pw_sample *x) {
  if (s->coords == 3 * s->bodies) return;
  struct fy_node *elements = json_add_object (j, root, "elements");
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs; k++)
    for (int e = 0; k->kind->own > 0 && e < k->b.count && !j->failed; e++) {
      struct fy_node *element = json_add_object (j, elements, k->name[e]);
      for (int i = 0; i < k->kind->own; i++) {
        int own = k->own + e * k->kind->own + i;
        json_add_number (j, element, k->kind->coordinate[i].name, x->q[own]);
        json_add_number (j, element, k->kind->coordinate[i].rate, x->v[own]);
      }
    }
}

static void json_reactions (json *j, struct fy_node *root, const pw_system *s, const pw_sample *x) {
  char name[300];
  struct fy_node *reactions = json_add_object (j, root, "reactions");
  for (int i = 0; i < s->rows && !j->failed; i++)
    json_add_number (j, reactions, pw_reaction_name (s, i, name, sizeof name), 0 - x->lambda[i]);
}

static void json_energy (json *j, struct fy_node *root, const pw_sample *x) {
  struct fy_node *energy = json_add_object (j, root, "energy");
  json_add_number (j, energy, "kinetic", x->kinetic);
  json_add_number (j, energy, "potential", x->potential);
  json_add_number (j, energy, "work", x->work);
  json_add_number (j, energy, "loss", x->loss);
  json_add_number (j, energy, "projection", x->projection);
  json_add_number (j, energy, "balance", x->balance);
}

static void json_sample (json *j, struct fy_node *root, const pw_system *s, const pw_sample *x, int ledger) {
  if (s && x) {
    json_add_number (j, root, "t", x->t);
    json_bodies (j, root, s, x);
    json_elements (j, root, s, x);
    json_reactions (j, root, s, x);
  } else {
    json_add_null (j, root, "t");
    json_add_null (j, root, "bodies");
    json_add_null (j, root, "reactions");
  }
  if (s && x && ledger)
    json_energy (j, root, x);
  else
    json_add_null (j, root, "energy");
}

/* ---- Lists of texts, empty if there are none ---- */

static struct fy_node *json_add_list (json *j, struct fy_node *object, const char *key) {
  struct fy_node *list = fy_node_create_sequence (j->document);
  json_add (j, object, key, list);
  return j->failed ? NULL : list;
}

static void json_append (json *j, struct fy_node *list, const char *text) {
  struct fy_node *item = json_text (j, text);
  if (item && fy_node_sequence_append (list, item) == 0) return;
  fy_node_free (item);
  j->failed = 1;
}

static void json_redundant (json *j, struct fy_node *root, const char *const *text) {
  struct fy_node *list = json_add_list (j, root, "redundant");
  for (; text && *text && !j->failed; text++) json_append (j, list, *text);
}

static void json_differences (json *j, struct fy_node *root, const pw_system *s) {
  char name[300];
  struct fy_node *list = json_add_list (j, root, "differences");
  for (int i = 0, n = s ? pw_count_differences (s) : 0; i < n && !j->failed; i++)
    json_append (j, list, pw_difference_name (s, i, name, sizeof name));
}

/* ---- Errors and cost ---- */

static void json_truth_errors (json *j, struct fy_node *truth, const char *key, const double error[4]) {
  static const char *const names[] = { "length", "angle", "speed", "rate" };
  struct fy_node *object = json_add_object (j, truth, key);
  for (int i = 0; i < 4 && !j->failed; i++) json_add_number (j, object, names[i], error[i]);
}

static void json_truth (json *j, struct fy_node *root, const pw_truth_error *e) {
  if (e == NULL) {
    json_add_null (j, root, "truth");
    return;
  }
  struct fy_node *truth = json_add_object (j, root, "truth");
  json_add_text (j, truth, "source", e->source);
  json_add_number (j, truth, "samples", e->samples);
  json_add_number (j, truth, "t", e->t);
  json_truth_errors (j, truth, "end", e->end);
  json_truth_errors (j, truth, "largest", e->most);
  json_add_number (j, truth, "reactions", e->reactions);
}

static void json_statistics (json *j, struct fy_node *root, const pw_statistics *n, double cpu) {
  if (n == NULL) {
    json_add_null (j, root, "residual");
    json_add_null (j, root, "statistics");
    return;
  }
  struct fy_node *residual = json_add_object (j, root, "residual");
  json_add_number (j, residual, "position", n->position);
  json_add_number (j, residual, "velocity", n->velocity);
  struct fy_node *statistics = json_add_object (j, root, "statistics");
  json_add_number (j, statistics, "steps", (double)n->steps);
  json_add_number (j, statistics, "rejected", (double)n->rejected);
  json_add_number (j, statistics, "rhs", (double)n->rhs);
  json_add_number (j, statistics, "jacobians", (double)n->jacobians);
  json_add_number (j, statistics, "factorisations", (double)n->factorisations);
  json_add_number (j, statistics, "restarts", (double)n->restarts);
  json_add_number (j, statistics, "cpu_s", cpu);
}

/* ---- */

static int json_emit (json *j, pw_output *o, pw_error *error) {
  enum fy_emitter_cfg_flags as_json = FYECF_MODE_JSON | FYECF_WIDTH_INF | FYECF_INDENT_2;
  char *text = j->failed ? NULL : fy_emit_document_to_string (j->document, as_json);
  if (errno == ENOMEM) { /* libfyaml leaves out what it had no memory for */
    free (text);
    text = NULL;
  }
  if (text == NULL) return pw_fail (error, PW_MACHINE, "out of memory while writing the summary");
  int status = pw_output_text (o, text, strlen (text), error);
  free (text);
  return status;
}

int pw_json_write (const pw_summary *summary, const pw_system *s, const pw_sample *sample, int ledger,
                   const pw_statistics *statistics, pw_output *o, pw_error *error) {
  /* Names are unique already, and libfyaml's own check is quadratic. */
  const struct fy_parse_cfg configuration = { .flags = FYPCF_QUIET | FYPCF_ALLOW_DUPLICATE_KEYS };
  errno = 0;
  json j = { .document = fy_document_create (&configuration) };
  struct fy_node *root = j.document ? fy_node_create_mapping (j.document) : NULL;
  if (root == NULL || fy_document_set_root (j.document, root) != 0) {
    fy_document_destroy (j.document);
    return pw_fail (error, PW_MACHINE, "out of memory while writing the summary");
  }
  json_add_number (&j, root, "schema", 1);
  json_add_text (&j, root, "model", summary->model);
  json_add_text (&j, root, "method", summary->method);
  json_add_text (&j, root, "status", summary->status);
  json_add_text (&j, root, "reason", summary->reason);
  json_sample (&j, root, s, sample, ledger);
  json_add_number (&j, root, "unbalanced", summary->unbalanced);
  json_redundant (&j, root, summary->redundant);
  json_differences (&j, root, s);
  json_truth (&j, root, summary->truth);
  json_statistics (&j, root, statistics, summary->cpu);
  int status = json_emit (&j, o, error);
  fy_document_destroy (j.document);
  return status;
}
