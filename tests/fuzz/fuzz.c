#define _POSIX_C_SOURCE 200809L
#include "fuzz.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "pinwheel-files.h"

static char fuzz_path[200];

static void fuzz_remove (void) {
  if (*fuzz_path) remove (fuzz_path);
}

const char *fuzz_file (const uint8_t *data, size_t size, const char *ending) {
  const char *folder = getenv ("TMPDIR");
  if (*fuzz_path == 0) atexit (fuzz_remove);
  snprintf (fuzz_path, sizeof fuzz_path, "%s/fuzz-%ld%s", folder ? folder : "/tmp", (long)getpid (), ending);
  FILE *f = fopen (fuzz_path, "wb");
  if (f == NULL || fwrite (data, 1, size, f) != size || fclose (f) != 0) {
    perror (fuzz_path);
    exit (1);
  }
  return fuzz_path;
}

char *fuzz_text (const uint8_t *data, size_t size) {
  char *text = malloc (size + 1);
  if (text == NULL) exit (1);
  memcpy (text, data, size);
  text[size] = 0;
  return text;
}

int fuzz_lines (char *text, const char **line, int most) {
  int n = 0;
  for (char *rest = NULL, *w = strtok_r (text, "\n", &rest); w && n < most; w = strtok_r (NULL, "\n", &rest))
    line[n++] = w;
  line[n] = NULL;
  return n;
}

/* ---- Texts by a grammar ---- */

typedef struct {
  fuzz_grammar *rules;
  unsigned state;
  int depth;
  uint8_t *text;
  size_t used, most;
} grower;

/* A linear congruence; its high bits are the random ones. */
static unsigned fuzz_random (unsigned *state, unsigned below) {
  *state = *state * 1664525u + 1013904223u;
  return (*state >> 8) % below;
}

static const char *grower_alternative (grower *g, char name) {
  fuzz_grammar *r = g->rules;
  while (*r && (*r)[0] != name) r++;
  if (*r == NULL) abort ();
  const char *text = *r + 2;
  unsigned count = 1;
  for (const char *p = text; *p; p++) count += *p == '`';
  for (unsigned skip = g->depth > 0 ? fuzz_random (&g->state, count) : 0; skip > 0; skip--)
    text = strchr (text, '`') + 1;
  return text;
}

static void grower_rule (grower *g, char name) {
  g->depth--;
  for (const char *p = grower_alternative (g, name); *p && *p != '`'; p++)
    if (*p == '$')
      grower_rule (g, *++p);
    else if (g->used < g->most)
      g->text[g->used++] = (uint8_t)*p;
    else
      g->depth = 0;
  g->depth++;
}

static size_t fuzz_grow_rule (fuzz_grammar *rules, char name, unsigned seed, int depth, uint8_t *text, size_t most) {
  grower g = { rules, seed, depth, text, 0, most };
  grower_rule (&g, name);
  return g.used;
}

size_t fuzz_grow (fuzz_grammar *rules, unsigned seed, int depth, uint8_t *text, size_t most) {
  return fuzz_grow_rule (rules, (*rules)[0], seed, depth, text, most);
}

/* ---- Mutations along the grammar ---- */

enum { FUZZ_PIECE = 4096 };

/* Begin and end of the piece at a random place: a line, or a word. */
static void fuzz_piece (const uint8_t *data, size_t size, unsigned at, const char *stops, size_t *from, size_t *to) {
  *from = *to = size ? at % size : 0;
  while (*from > 0 && strchr (stops, data[*from - 1]) == NULL) --*from;
  while (*to < size && (data[*to] == 0 || strchr (stops, data[*to]) == NULL)) ++*to;
}

/* Puts `size` bytes, so many times as there is room for but at most `times`, in the place of those from `from` to
 * `to`. */
static size_t fuzz_put (uint8_t *data, size_t total, size_t most, size_t from, size_t to, const uint8_t *piece,
                        size_t size, size_t times) {
  size_t rest = total - (to - from);
  if (size == 0) times = 0;
  while (times > 0 && rest + size * times > most) times--;
  memmove (data + from + size * times, data + to, total - to);
  for (size_t i = 0; i < times; i++) memcpy (data + from + size * i, piece, size);
  return rest + size * times;
}

/* A piece by a rule, or one of the text, or nothing. */
static size_t fuzz_take (fuzz_grammar *rules, const uint8_t *data, size_t size, const char *stops, unsigned *state,
                         uint8_t *piece) {
  unsigned count = 0, way = fuzz_random (state, 4);
  size_t from, to;
  while (rules[count]) count++;
  if (way == 0) return 0;
  if (way == 1) return fuzz_grow_rule (rules, rules[fuzz_random (state, count)][0], *state, 6, piece, FUZZ_PIECE);
  fuzz_piece (data, size, fuzz_random (state, 1 << 20), stops, &from, &to);
  if (to - from > FUZZ_PIECE) to = from + FUZZ_PIECE;
  memcpy (piece, data + from, to - from);
  return to - from;
}

size_t fuzz_mutate (fuzz_grammar *rules, uint8_t *data, size_t size, size_t most, unsigned seed) {
  static uint8_t piece[FUZZ_PIECE];
  unsigned state = seed, way = fuzz_random (&state, 8);
  const char *stops = fuzz_random (&state, 2) ? "\n" : " ,:[]{}()+-*/^\n";
  size_t from, to;
  if (way == 0 || size < 4) return fuzz_grow (rules, state, 4 + (int)fuzz_random (&state, 12), data, most);
  if (way <= 2) return LLVMFuzzerMutate (data, size, most);
  size_t taken = fuzz_take (rules, data, size, stops, &state, piece);
  fuzz_piece (data, size, fuzz_random (&state, 1 << 20), stops, &from, &to);
  if (fuzz_random (&state, 2)) to = from;
  return fuzz_put (data, size, most, from, to, piece, taken, fuzz_random (&state, 16) ? 1 : 1000);
}

/* ---- A model ---- */

static pw_file *fuzz_model_file;
static pw_model *fuzz_model;
static pw_system *fuzz_system;

static void fuzz_free (void) {
  pw_system_free (fuzz_system);
  pw_model_free (fuzz_model);
  pw_file_close (fuzz_model_file);
}

struct pw_system *fuzz_pendulum (void) {
  pw_error error = { 0 };
  if (fuzz_system) return fuzz_system;
  fuzz_model_file = pw_file_open ("models/linkages/pendulum.yaml", &error);
  fuzz_model = fuzz_model_file ? pw_file_model (fuzz_model_file, &error) : NULL;
  if (fuzz_model && pw_model_build (fuzz_model, &error) == PW_OK) fuzz_system = pw_system_compile (fuzz_model, &error);
  if (fuzz_system == NULL) {
    fprintf (stderr, "%s\n", error.text);
    exit (1);
  }
  atexit (fuzz_free);
  return fuzz_system;
}
