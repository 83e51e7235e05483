/* Describes which equations a redundant one follows from. */
#include <stdio.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Names a row's element after what is in the buffer: "pin B" or, with its row, "pin B (B.Fx)"; the new length. */
static size_t redundancy_name_row (const pw_system *s, int row, int whole, char *buffer, size_t size, size_t n) {
  char element[120], reaction[120];
  if (n + 1 >= size) return n;
  pw_system_row_name (s, row, element, sizeof element);
  pw_system_reaction_name (s, row, reaction, sizeof reaction);
  n += (size_t)(whole ? snprintf (buffer + n, size - n, "%s (%s)", element, reaction)
                      : snprintf (buffer + n, size - n, "%s", element));
  return n < size ? n : size - 1;
}

/* The common direction of two rows with the same reaction: "lateral ", or "". */
static const char *redundancy_direction (const char *a, const char *b) {
  static const char *const word[][2] = {
    { "N", "lateral " }, { "T", "rolling " }, { "Fx", "x " }, { "Fy", "y " }, { "M", "angular " }
  };
  const char *x = strrchr (a, '.') + 1, *y = strrchr (b, '.') + 1;
  for (size_t i = 0; i < sizeof word / sizeof *word; i++)
    if (strcmp (x, word[i][0]) == 0 && strcmp (y, word[i][0]) == 0) return word[i][1];
  return "";
}

/* "wheels left and right: the same lateral constraint" */
static void redundancy_describe_pair (const pw_system *s, int one, int two, char *buffer, size_t size) {
  char a[120], b[120], x[120], y[120];
  pw_system_row_name (s, one, a, sizeof a);
  pw_system_row_name (s, two, b, sizeof b);
  const char *word = redundancy_direction (pw_system_reaction_name (s, one, x, sizeof x),
                                           pw_system_reaction_name (s, two, y, sizeof y));
  size_t kind = strcspn (a, " ");
  if (strcmp (a, b) == 0)
    snprintf (buffer, size, "%s: %s and %s are the same constraint", a, x, y);
  else if (kind == strcspn (b, " ") && strncmp (a, b, kind) == 0)
    snprintf (buffer, size, "%.*ss%s and%s: the same %sconstraint", (int)kind, a, a + kind, b + kind, word);
  else
    snprintf (buffer, size, "%s and %s: the same %sconstraint", a, b, word);
}

char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size) {
  enum { MOST = 6 };
  const pw_system *s = r->s;
  int row = r->redundant_row[i], partners = 0, last = -1, elements = 0;
  size_t n = redundancy_name_row (s, row, 1, buffer, size, 0);
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return buffer;
  pw_evaluate_J (r->w);
  if (pw_saddle_factor (r->saddle) != PW_OK) return buffer;
  pw_rank_coefficients (r, i);
  const double *c = r->coefficient + i * s->rows;
  char element[120], own[120], before[120] = "";
  pw_system_row_name (s, row, own, sizeof own);
  for (int a = 0; a < s->rows; a++) {
    if (fabs (c[a]) < 1e-8) continue;
    partners++, last = a;
    pw_system_row_name (s, a, element, sizeof element);
    if (elements > MOST || n + 1 >= size || strcmp (element, own) == 0 || strcmp (element, before) == 0) continue;
    strcpy (before, element);
    const char *glue = elements == MOST ? " and others" : elements > 0 ? ", " : " follows from ";
    n += (size_t)snprintf (buffer + n, size - n, "%s", glue);
    if (elements++ < MOST) n = redundancy_name_row (s, a, 0, buffer, size, n);
  }
  if (partners == 0 && n + 1 < size) snprintf (buffer + n, size - n, " constrains nothing here");
  if (partners == 1) redundancy_describe_pair (s, last, row, buffer, size);
  return buffer;
}
