/* Methods that are set side by side. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "contestants.h"

int pw_contestant_adaptive (const pw_method *integrator, const char *name) {
  return integrator->adaptive && strstr (name, ":steps=fixed") == NULL;
}

static int contestants_count_all (size_t *bytes) {
  int count = 0;
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name; s++, count++)
      *bytes += strlen (pw_methods[i]->name) + strlen (s->name) + 2;
  return count;
}

static void contestants_add (pw_contestants *c, const char *name, const pw_method *integrator) {
  for (int i = 0; i < c->count; i++)
    if (strcmp (c->method[i].name, name) == 0) return;
  c->method[c->count++] = (pw_contestant){ name, pw_contestant_adaptive (integrator, name) };
}

static char *contestants_add_all (pw_contestants *c, char *at) {
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name; s++) {
      int n = sprintf (at, "%s+%s", pw_methods[i]->name, s->name);
      contestants_add (c, at, pw_methods[i]);
      at += n + 1;
    }
  return at;
}

/* One name of n bytes, copied to `at`. */
static int contestants_add_one (pw_contestants *c, char *at, const char *text, size_t n, pw_error *error) {
  const pw_method *integrator;
  int stabilisation;
  memcpy (at, text, n);
  at[n] = 0;
  int status = pw_parse_method (at, &integrator, &stabilisation, error);
  if (status == PW_OK) contestants_add (c, at, integrator);
  return status;
}

int pw_contestants_read (pw_contestants *c, const char *text, pw_error *error) {
  const char *whole = text;
  size_t bytes = strlen (text) + 1;
  int most = contestants_count_all (&bytes) + 1, status = PW_OK;
  for (const char *p = text; *p; p++) most += *p == ',';
  *c = (pw_contestants){ .names = malloc (bytes), .method = calloc ((size_t)most, sizeof *c->method) };
  if (c->names == NULL || c->method == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  char *at = c->names;
  for (int all = 0; status == PW_OK; text++) {
    size_t n = strcspn (text, ",");
    if (n == 0) return pw_fail (error, PW_INPUT, "--methods \"%.80s\": a name is missing", whole);
    if (n == 3 && strncmp (text, "all", 3) == 0) {
      if (!all) at = contestants_add_all (c, at);
      all = 1;
    } else {
      status = contestants_add_one (c, at, text, n, error);
      at += n + 1;
    }
    text += n;
    if (*text == 0) break;
  }
  return status;
}

void pw_contestants_close (pw_contestants *c) {
  free (c->method);
  free (c->names);
  *c = (pw_contestants){ .count = 0 };
}
