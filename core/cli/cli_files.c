/* The files that a command reads and writes. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"

enum { FILES_PATH = 4096 }; /* longest name of a folder, its end included */

/* ---- Checks ---- */

typedef struct {
  pw_use *use;
  int count;
  pw_error *error;
} files_uses;

static int files_table (void *context, const char *path) {
  files_uses *x = context;
  x->use[0].what = "a table of the model";
  x->use[0].path = path;
  return pw_check_paths (x->use, x->count, x->error);
}

int pw_cli_uses (const pw_cli_line *l, const pw_file *file, pw_use *use, int count, pw_error *error) {
  files_uses x = { use, count, error };
  pw_error own = { 0 };
  char *path = file ? NULL : pw_file_find (l->argument[0], &own);
  use[0].path = file ? pw_file_path (file) : path;
  int status = own.status == PW_RESOURCE ? pw_fail (error, PW_RESOURCE, "%s", own.text) : PW_OK;
  if (status == PW_OK) status = pw_check_paths (use, count, error); /* opening the model reports what else is wrong */
  if (status == PW_OK && file) status = pw_file_tables (file, files_table, &x);
  use[0].path = NULL;
  free (path);
  return status;
}

int pw_cli_csv (const char *path, pw_error *error) {
  const char *ending = path ? strrchr (path, '.') : NULL;
  if (ending == NULL || strcmp (ending, ".npz") != 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "-o %s: this command writes no NumPy archives: expected a name that ends in .csv",
                  path);
}

/* ---- Folders ---- */

static int files_make_folder (const char *folder, pw_error *error) {
  char path[FILES_PATH];
  size_t n = strlen (folder);
  if (n == 0 || n >= sizeof path - 32)
    return pw_fail (error, PW_INPUT, "\"%s\" cannot be the name of a folder", folder);
  memcpy (path, folder, n + 1);
  for (size_t i = 1; i <= n; i++) {
    if (path[i] != '/' && path[i] != 0) continue;
    char end = path[i];
    path[i] = 0;
    if (mkdir (path, 0777) != 0 && errno != EEXIST)
      return pw_fail (error, PW_RESOURCE, "cannot make the folder %s: %s", path, strerror (errno));
    path[i] = end;
  }
  return PW_OK;
}

int pw_cli_folder (const char *folder, pw_error *error) {
  return files_make_folder (folder, error) == PW_OK ? pw_lock_folder (folder, error) : -1;
}

/* ---- The files that a command writes ---- */

int pw_files_open (pw_files *x, const pw_cli_line *l, const pw_cli_model *m, pw_use *use, int count, pw_error *error) {
  int status = pw_cli_uses (l, m->file, use, count, error);
  for (int i = 1; i < count && status == PW_OK; i++) {
    if (use[i].path == NULL || use[i].how == PW_READS) continue;
    if (use[i].how == PW_WRITES)
      status = (x->file[i] = pw_output_open (use[i].path, error)) ? PW_OK : error->status;
    else
      status = (x->lock = pw_cli_folder (use[i].path, error)) >= 0 ? PW_OK : error->status;
    x->locked |= use[i].how == PW_WRITES_INTO && status == PW_OK;
  }
  return status;
}

FILE *pw_files_stream (const pw_files *x, int i) {
  return x->file[i] ? pw_output_stream (x->file[i]) : NULL;
}

int pw_files_finish (pw_files *x, pw_error *error) {
  int status = pw_output_finish_all (x->file, PW_FILES, error);
  memset (x->file, 0, sizeof x->file);
  return status;
}

void pw_files_close (pw_files *x) {
  for (int i = 0; i < PW_FILES; i++)
    if (x->file[i]) pw_output_discard (x->file[i]);
  if (x->locked) close (x->lock);
}
