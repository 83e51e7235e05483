/* Reads the files of benchmarks/hard/cases. */
#include <libfyaml.h>
#include <stdlib.h>
#include <string.h>
#include "hard.h"

const char *const hard_verdict_name[HARD_VERDICTS] = { "CRASH", "WRONG", "slow", "refuse", "limited", "pass" };
const char *const hard_measure_name[HARD_MEASURES] = { "error", "balance", "residual", "equations" };

/* The file and the case that are being read, for messages. */
typedef struct {
  const char *path, *name;
} read_place;

static void read_fail (const read_place *at, const char *what, const char *found) {
  fprintf (stderr, "%s: %s: %s \"%s\"\n", at->path, at->name, what, found);
  exit (2);
}

static void read_copy (const read_place *at, char *to, size_t size, const char *text) {
  if (strlen (text) >= size) read_fail (at, "text too long:", text);
  strcpy (to, text);
}

static const char *read_scalar (const read_place *at, struct fy_node *n) {
  const char *text = n ? fy_node_get_scalar0 (n) : NULL;
  if (n && text == NULL) read_fail (at, "expected a text or number, found a list or map", "");
  return text;
}

static double read_number (const read_place *at, struct fy_node *n) {
  double value = 0;
  const char *text = read_scalar (at, n);
  if (text == NULL || pw_read_number (text, &value) != PW_OK) read_fail (at, "expected a number:", text ? text : "");
  return value;
}

/* {NAME: NUMBER, ...} */
static int read_values (const read_place *at, struct fy_node *map, hard_value *value) {
  void *next = NULL;
  int count = 0;
  for (struct fy_node_pair *p; map && (p = fy_node_mapping_iterate (map, &next));) {
    if (count == HARD_VALUES) read_fail (at, "too many values", "");
    read_copy (at, value[count].name, sizeof value[count].name, read_scalar (at, fy_node_pair_key (p)));
    value[count++].value = read_number (at, fy_node_pair_value (p));
  }
  return count;
}

static void read_run (const read_place *at, struct fy_node *map, hard_case *c) {
  hard_value value[HARD_VALUES];
  const struct {
    const char *name;
    double *to;
  } field[] = { { "t_end", &c->t_end }, { "step", &c->step }, { "rtol", &c->rtol }, { "seconds", &c->seconds } };
  const size_t fields = sizeof field / sizeof *field;
  for (int i = read_values (at, map, value) - 1; i >= 0; i--) {
    size_t f = 0;
    while (f < fields && strcmp (field[f].name, value[i].name) != 0) f++;
    if (f == fields) read_fail (at, "run has no", value[i].name);
    *field[f].to = value[i].value;
  }
}

/* {MEASURE: [PASS, LIMITED], ...} */
static void read_bounds (const read_place *at, struct fy_node *map, hard_case *c) {
  void *next = NULL;
  for (struct fy_node_pair *p; map && (p = fy_node_mapping_iterate (map, &next));) {
    const char *name = read_scalar (at, fy_node_pair_key (p));
    int k = 0;
    while (k < HARD_MEASURES && strcmp (hard_measure_name[k], name) != 0) k++;
    if (k == HARD_MEASURES) read_fail (at, "there is no measure", name);
    for (int i = 0; i < 2; i++)
      c->bound[k][i] = read_number (at, fy_node_sequence_get_by_index (fy_node_pair_value (p), i));
  }
}

/* pass, limited, refuse, slow; or several with a / between them. */
static int read_verdicts (const read_place *at, const char *text) {
  int verdicts = 0;
  while (*text) {
    int k = HARD_SLOW;
    size_t n = strcspn (text, "/");
    while (k < HARD_VERDICTS && (strlen (hard_verdict_name[k]) != n || strncmp (hard_verdict_name[k], text, n) != 0))
      k++;
    if (k == HARD_VERDICTS) read_fail (at, "there is no verdict", text);
    verdicts |= 1 << k;
    text += n + (text[n] == '/');
  }
  return verdicts;
}

/* - [PATTERN, VERDICT, WHY, REASON] */
static void read_expectations (const read_place *at, struct fy_node *list, hard_case *c) {
  void *next = NULL;
  for (struct fy_node *n; list && (n = fy_node_sequence_iterate (list, &next));) {
    const char *part[4] = { "", "", "", "" };
    if (c->expectations == HARD_EXPECTATIONS) read_fail (at, "too many expectations", "");
    for (int i = 0; i < 4 && i < fy_node_sequence_item_count (n); i++)
      part[i] = read_scalar (at, fy_node_sequence_get_by_index (n, i));
    hard_expectation *e = &c->expect[c->expectations++];
    read_copy (at, e->pattern, sizeof e->pattern, part[0]);
    e->verdict = read_verdicts (at, part[1]);
    read_copy (at, e->why, sizeof e->why, part[2]);
    read_copy (at, e->reason, sizeof e->reason, part[3]);
    if (e->verdict != 1 << HARD_PASS && !*e->why) read_fail (at, "no reason for", part[1]);
    if (e->verdict >> HARD_REFUSE & 1 && !*e->reason) read_fail (at, "no message for the refusal of", part[0]);
  }
  if (c->expectations == 0) read_fail (at, "nothing is expected", "");
}

/* [MESSAGE, PASS, LIMITED] */
static void read_stop (const read_place *at, struct fy_node *list, hard_case *c) {
  if (list == NULL) return;
  read_copy (at, c->stops, sizeof c->stops, read_scalar (at, fy_node_sequence_get_by_index (list, 0)));
  for (int i = 0; i < 2; i++) c->stop_time[i] = read_number (at, fy_node_sequence_get_by_index (list, i + 1));
}

static void read_text (const read_place *at, struct fy_node *map, const char *key, char *to, size_t size) {
  const char *text = read_scalar (at, fy_node_mapping_lookup_by_string (map, key, FY_NT));
  if (text) read_copy (at, to, size, text);
}

/* A model that ends in .yaml is in the folder `models`; others are found by name. */
static void read_model (const read_place *at, struct fy_node *n, const char *models, hard_case *c) {
  char name[sizeof c->model] = "";
  read_text (at, n, "model", name, sizeof name);
  size_t length = strlen (name), room = strlen (models) + length + 2;
  if (length == 0 || room > sizeof c->model) read_fail (at, "no model, or too long a path:", name);
  if (length > 5 && strcmp (name + length - 5, ".yaml") == 0)
    snprintf (c->model, sizeof c->model, "%.150s/%.140s", models, name);
  else
    strcpy (c->model, name);
}

static void read_case (read_place *at, struct fy_node *n, struct fy_node *root, const char *models, hard_case *c) {
  *c = (hard_case){ .step = 1e-3, .rtol = 1e-8, .seconds = 20 };
  read_text (at, root, "group", c->group, sizeof c->group);
  read_text (at, root, "about", c->group_about, sizeof c->group_about);
  read_text (at, n, "name", c->name, sizeof c->name);
  at->name = c->name;
  read_text (at, n, "about", c->about, sizeof c->about);
  read_text (at, n, "source", c->source, sizeof c->source);
  read_model (at, n, models, c);
  read_run (at, fy_node_mapping_lookup_by_string (n, "run", FY_NT), c);
  c->sets = read_values (at, fy_node_mapping_lookup_by_string (n, "set", FY_NT), c->set);
  c->initials = read_values (at, fy_node_mapping_lookup_by_string (n, "initial", FY_NT), c->initial);
  c->references = read_values (at, fy_node_mapping_lookup_by_string (n, "reference", FY_NT), c->reference);
  read_bounds (at, fy_node_mapping_lookup_by_string (n, "bounds", FY_NT), c);
  read_stop (at, fy_node_mapping_lookup_by_string (n, "stops", FY_NT), c);
  read_expectations (at, fy_node_mapping_lookup_by_string (n, "expect", FY_NT), c);
}

int hard_read (const char *path, const char *models, hard_case *cases, int count) {
  read_place at = { path, "" };
  struct fy_document *d = fy_document_build_from_file (NULL, path);
  if (d == NULL) read_fail (&at, "cannot be read", "");
  struct fy_node *root = fy_document_root (d), *list = fy_node_mapping_lookup_by_string (root, "cases", FY_NT);
  void *next = NULL;
  for (struct fy_node *n; list && (n = fy_node_sequence_iterate (list, &next)); count++) {
    if (count == HARD_CASES) read_fail (&at, "too many cases", "");
    at.name = "";
    read_case (&at, n, root, models, &cases[count]);
  }
  fy_document_destroy (d);
  return count;
}
