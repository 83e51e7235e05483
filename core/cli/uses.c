/* What a command reads and writes, with the model and its tables. */
#include <stdlib.h>
#include "cli.h"

typedef struct {
  pw_use *use;
  int count;
  pw_error *error;
} uses;

static int uses_table (void *context, const char *path) {
  uses *x = context;
  x->use[0].what = "a table of the model";
  x->use[0].path = path;
  return pw_check_uses (x->use, x->count, x->error);
}

int pw_cli_uses (const pw_cli_line *l, const pw_file *file, pw_use *use, int count, pw_error *error) {
  uses x = { use, count, error };
  pw_error own = { 0 };
  char *path = file ? NULL : pw_file_find (l->argument[0], &own);
  use[0].path = file ? pw_file_path (file) : path;
  int status = own.status == PW_MACHINE ? pw_fail (error, PW_MACHINE, "%s", own.text) : PW_OK;
  if (status == PW_OK) status = pw_check_uses (use, count, error); /* whoever opens a model says what else is wrong */
  if (status == PW_OK && file) status = pw_file_tables (file, uses_table, &x);
  use[0].path = NULL;
  free (path);
  return status;
}
