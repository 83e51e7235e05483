/* The files that a command reads and writes: checks, folders, those kept open until it ends. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"

enum { FILES_FOLDER = 4064 }; /* longest name of a folder: the paths of files in it have room in 4096 bytes */

/* ---- Checks ---- */

typedef struct {
  pw_use *use;
  int count;
  pw_error *error;
} files_check;

static int files_check_table (void *context, const char *path) {
  files_check *check = context;
  check->use[0].what = "a table of the model";
  check->use[0].path = path;
  return pw_check_paths (check->use, check->count, check->error);
}

const char *const pw_cli_csv[] = { ".csv", NULL }, *const pw_cli_json[] = { ".json", NULL };

/* The ending of a file's name that states its format, such as ".csv"; NULL for another ending, such as ".5". */
static const char *files_format (const char *path) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", digits[] = "0123456789";
  const char *slash = strrchr (path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr (name, '.');
  size_t n = dot && dot > name ? strspn (dot + 1, letters) : 0;
  return n > 0 && n <= 5 && strspn (dot + 1 + n, digits) == strlen (dot + 1 + n) ? dot : NULL;
}

static int files_listed (const char *ending, const char *const *list) {
  while (*list && strcasecmp (*list, ending) != 0) list++;
  return *list != NULL;
}

/* Whether the format is one of the list; so is that of "a.csv.old" if ".csv" is listed. */
static int files_written (const char *path, const char *ending, const char *const *list) {
  const char *within = NULL;
  for (const char *const *e = list; *e && within == NULL; e++) within = strstr (path, *e);
  return files_listed (ending, list) || (within && within < ending);
}

int pw_cli_names_file (const char *path) {
  static const char *const formats[] = { ".csv", ".npz", ".json", ".html", ".yaml", ".svg",
                                         ".png", ".pdf", ".xlsx", ".txt",  NULL };
  return files_format (path) && files_listed (files_format (path), formats);
}

int pw_cli_check_format (const pw_use *use, pw_error *error) {
  const char *ending = use->path ? files_format (use->path) : NULL;
  char list[80] = "";
  if (ending == NULL || use->how == PW_READS) return PW_OK;
  if (use->how == PW_WRITES_INTO) {
    if (!pw_cli_names_file (use->path) || access (use->path, F_OK) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s %.200s: expected the name of a folder, in which files are written", use->what,
                    use->path);
  }
  if (use->names == NULL || files_written (use->path, ending, use->names)) return PW_OK;
  for (const char *const *name = use->names; *name; name++)
    strcat (strcat (list, name == use->names ? "" : name[1] ? ", " : " or "), *name);
  return pw_fail (error, PW_INPUT, "%s %.200s: the format %s is not written: expected a name that ends in %s",
                  use->what, use->path, ending, list);
}

int pw_cli_check_uses (const pw_cli_line *line, const pw_file *file, pw_use *use, int count, pw_error *error) {
  files_check check = { use, count, error };
  pw_error own = { 0 };
  char *path = file ? NULL : pw_file_find (line->argument[0], &own);
  use[0].path = file ? pw_file_path (file) : path;
  int status = own.status == PW_RESOURCE ? pw_fail (error, PW_RESOURCE, "%s", own.text) : PW_OK;
  if (status == PW_OK) status = pw_check_paths (use, count, error); /* opening the model reports what else is wrong */
  if (status == PW_OK && file) status = pw_file_tables (file, files_check_table, &check);
  for (int i = 1; i < count && status == PW_OK && file; i++) status = pw_cli_check_format (&use[i], error);
  use[0].path = NULL;
  free (path);
  return status;
}

int pw_cli_check_csv (const char *path, pw_error *error) {
  const char *ending = path ? strrchr (path, '.') : NULL;
  if (ending == NULL || strcasecmp (ending, ".npz") != 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "-o %s: this command writes no NumPy archives: expected a name that ends in .csv",
                  path);
}

/* ---- Folders ---- */

static int folder_make (pw_folder *folder, pw_error *error) {
  char path[FILES_FOLDER + 1];
  size_t n = strlen (folder->path);
  if (n == 0 || n > FILES_FOLDER)
    return pw_fail (error, PW_INPUT, "\"%s\" cannot be the name of a folder", folder->path);
  memcpy (path, folder->path, n + 1);
  for (size_t i = 1; i <= n; i++) {
    if (path[i] != '/' && path[i] != 0) continue;
    char end = path[i];
    path[i] = 0;
    if (mkdir (path, 0777) == 0)
      folder->made = folder->made ? folder->made : i;
    else if (errno != EEXIST)
      return pw_fail (error, PW_RESOURCE, "cannot make the folder %s: %s", path, strerror (errno));
    path[i] = end;
  }
  return PW_OK;
}

int pw_folder_open (pw_folder *folder, const char *path, pw_error *error) {
  *folder = (pw_folder){ .path = path };
  if (folder_make (folder, error) == PW_OK) folder->lock = pw_lock_folder (path, error);
  folder->locked = error->status == PW_OK;
  return error->status;
}

void pw_folder_close (pw_folder *folder) {
  char path[FILES_FOLDER + 1];
  for (size_t n = folder->made ? strlen (strcpy (path, folder->path)) : 0; n && n >= folder->made; n--) {
    if (path[n] != '/' && path[n] != 0) continue;
    path[n] = 0;
    const char *slash = strrchr (path, '/'), *last = slash ? slash + 1 : path;
    if (*last == 0 || strcmp (last, ".") == 0 || strcmp (last, "..") == 0) continue; /* no folder of its own */
    if (rmdir (path) != 0 && errno != ENOENT) break; /* it has files; ENOENT: "a/../a" and "a" are the same folder */
  }
  if (folder->locked) close (folder->lock);
}

/* ---- The files that a command writes ---- */

int pw_files_open (pw_files *files, const pw_cli_line *line, const pw_cli_model *m, pw_use *use, int count,
                   pw_error *error) {
  int status = pw_cli_check_uses (line, m->file, use, count, error);
  for (int i = 1; i < count && status == PW_OK; i++) { /* use[0] is the model */
    if (use[i].path == NULL || use[i].how == PW_READS) continue;
    if (use[i].how == PW_WRITES)
      status = (files->output[i] = pw_output_open (use[i].path, error)) ? PW_OK : error->status;
    else
      status = pw_folder_open (&files->folder, use[i].path, error);
  }
  return status;
}

FILE *pw_files_stream (const pw_files *files, int i) {
  return files->output[i] ? pw_output_stream (files->output[i]) : NULL;
}

int pw_files_finish (pw_files *files, pw_error *error) {
  int status = pw_output_finish_all (files->output, PW_FILES, error);
  memset (files->output, 0, sizeof files->output);
  return status;
}

void pw_files_close (pw_files *files) {
  for (int i = 0; i < PW_FILES; i++)
    if (files->output[i]) pw_output_discard (files->output[i]);
  pw_folder_close (&files->folder);
}
