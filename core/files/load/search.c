/* The search path for models: the folders of PINWHEEL_MODELS, then those of the running program and of this library.
 *
 * Folders next to the program, or one level up (tests), serve the build tree; ../lib and ../include serve an
 * installation; the folder of the library serves programs installed elsewhere.  The order of the folders decides only
 * about headers and pages, of which the first is taken: a name that two models have is refused (model_file.c). */
#define _GNU_SOURCE /* dladdr1 */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <link.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "files.h"

int pw_ends_with (const char *name, const char *ending) {
  size_t n = strlen (name), e = strlen (ending);
  return n > e && strcmp (name + n - e, ending) == 0;
}

static int search_no_memory (pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "out of memory while looking for models");
}

/* What folders are relative to: the folder of the running program, that of this library. */
enum { SEARCH_PROGRAM, SEARCH_LIBRARY, SEARCH_ANCHORS };

typedef char search_anchor_paths[SEARCH_ANCHORS][PW_PATH];

/* Stores these folders; "" if one is unknown. */
static int search_find_anchors (search_anchor_paths anchor, pw_error *error) {
  static const char here = 0; /* an address inside this library */
  Dl_info info;
  struct link_map *object = NULL;
  ssize_t n = readlink ("/proc/self/exe", anchor[SEARCH_PROGRAM], PATH_MAX - 1);
  anchor[SEARCH_PROGRAM][n > 0 ? n : 0] = 0;
  /* l_name is "" if the program contains the library */
  const char *library = dladdr1 (&here, &info, (void **)&object, RTLD_DL_LINKMAP) ? object->l_name : NULL;
  if (library && (library = realpath (library, anchor[SEARCH_LIBRARY])) == NULL && errno == ENOMEM)
    return search_no_memory (error);
  if (library == NULL) *anchor[SEARCH_LIBRARY] = 0;
  for (int i = 0; i < SEARCH_ANCHORS; i++) {
    char *slash = strrchr (anchor[i], '/');
    if (slash) slash[slash == anchor[i]] = 0; /* "/" of the root */
  }
  return PW_OK;
}

/* Folders relative to each anchor. */
typedef const char *const search_folders[SEARCH_ANCHORS][3];
enum { SEARCH_FOLDERS = 3 * SEARCH_ANCHORS };

/* Stores the i-th of these folders, which need not exist; 0 if its anchor is unknown. */
static int search_place (search_anchor_paths anchor, search_folders where, int i, char folder[PW_PATH]) {
  pw_path (folder, "%s/%s", anchor[i / 3], where[i / 3][i % 3]);
  return *anchor[i / 3] != 0;
}

/* ---- Model files ---- */

/* Adds a model, whose name is the first `length` bytes of `name`, unless it is in the list already. */
static int search_add_file (pw_search *s, const char *name, size_t length, const char *path, pw_error *error) {
  for (int i = 0; i < s->count; i++)
    if (strcmp (s->found[i].path, path) == 0 && strncmp (s->found[i].name, name, length) == 0 &&
        s->found[i].name[length] == 0)
      return PW_OK;
  if (pw_grow (&s->found, (size_t)s->count, &s->room, sizeof *s->found) != PW_OK) return search_no_memory (error);
  pw_found *f = &s->found[s->count];
  f->path = pw_arena_copy (&s->arena, path);
  f->name = pw_arena_copy (&s->arena, name);
  if (f->path == NULL || f->name == NULL) return search_no_memory (error);
  f->name[length] = 0;
  s->count++;
  return PW_OK;
}

static int search_entry (pw_search *s, const char *folder, const char *entry, pw_error *error) {
  const char *ending = pw_ends_with (entry, ".so") ? ".so" : pw_ends_with (entry, ".yaml") ? ".yaml" : NULL;
  if (ending == NULL || entry[0] == '.' || !pw_is_line (entry)) return PW_OK;
  char path[PW_PATH], real[PW_PATH];
  struct stat info;
  if (realpath (pw_path (path, "%s/%s", folder, entry), real) == NULL)
    return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  if (stat (real, &info) != 0 || !S_ISREG (info.st_mode)) return PW_OK;
  return search_add_file (s, entry, strlen (entry) - strlen (ending), real, error);
}

/* Adds a folder to the list for messages. */
static void search_list_folder (pw_search *s, const char *real) {
  size_t used = strlen (s->folders);
  const char *listed = PW_PRINTED (sizeof s->folders + 2, ":%s:", s->folders);
  if (used + strlen (real) + 2 <= sizeof s->folders && strstr (listed, PW_PRINTED (PW_PATH + 2, ":%s:", real)) == NULL)
    sprintf (s->folders + used, "%s%s", used ? ":" : "", real);
}

/* Adds the models in a folder; skips missing and inaccessible folders, as shells do with PATH. */
static int search_folder (pw_search *s, const char *folder, pw_error *error) {
  char real[PW_PATH];
  if (realpath (folder, real) == NULL) return errno == ENOMEM ? search_no_memory (error) : PW_OK;
  search_list_folder (s, real);
  DIR *dir = opendir (folder);
  if (dir == NULL && (errno == ENOMEM || errno == EMFILE || errno == ENFILE))
    return pw_fail (error, PW_RESOURCE, "cannot look into the folder %s: %s", folder, strerror (errno));
  if (dir == NULL) return PW_OK;
  int status = PW_OK;
  struct dirent *entry;
  while (status == PW_OK && (entry = readdir (dir)) != NULL) status = search_entry (s, folder, entry->d_name, error);
  closedir (dir);
  return status;
}

/* Whether a folder can be searched; if not, adds it to s->unread with the reason. */
static int search_is_readable (pw_search *s, const char *folder) {
  char inside[PW_PATH];
  size_t used = strlen (s->unread);
  if (access (pw_path (inside, "%s/.", folder), R_OK | X_OK) == 0) return 1;
  snprintf (s->unread + used, sizeof s->unread - used, "%s%.80s (%s)", used ? ", " : "", folder, strerror (errno));
  return 0;
}

static int search_environment (pw_search *s, pw_error *error) {
  const char *list = getenv ("PINWHEEL_MODELS");
  if (list == NULL) return PW_OK;
  char *copy = strdup (list), *rest = copy, *folder;
  if (copy == NULL) return search_no_memory (error);
  int status = PW_OK;
  while (status == PW_OK && (folder = strsep (&rest, ":")) != NULL)
    if (*folder && search_is_readable (s, folder)) status = search_folder (s, folder, error);
  free (copy);
  return status;
}

static int search_order (const void *a, const void *b) {
  const pw_found *f = a, *g = b;
  int names = strcmp (f->name, g->name);
  return names ? names : strcmp (f->path, g->path);
}

int pw_search_open (pw_search *s, pw_error *error) {
  static const search_folders where = { { "models", "../models", "../lib/pinwheel/models" },
                                        { "models", "../models", "pinwheel/models" } };
  search_anchor_paths anchor;
  char folder[PW_PATH];
  *s = (pw_search){ .count = 0 };
  int status = search_environment (s, error);
  if (status == PW_OK) status = search_find_anchors (anchor, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (search_place (anchor, where, i, folder)) status = search_folder (s, folder, error);
  if (s->count > 1) qsort (s->found, (size_t)s->count, sizeof *s->found, search_order);
  return status;
}

void pw_search_close (pw_search *s) {
  pw_arena_free (&s->arena);
  free (s->found);
}

/* ---- Other files ---- */

/* Stores the path of the first of the files of this name that can be read; "" if there is none. */
static int search_find (search_folders where, const char *file, char path[PW_PATH], pw_error *error) {
  search_anchor_paths anchor;
  char folder[PW_PATH];
  int status = search_find_anchors (anchor, error);
  for (int i = 0; i < SEARCH_FOLDERS && status == PW_OK; i++)
    if (search_place (anchor, where, i, folder) && access (pw_path (path, "%s/%s", folder, file), R_OK) == 0)
      return PW_OK;
  *path = 0;
  return status;
}

int pw_search_header (char path[PW_PATH], pw_error *error) {
  static const search_folders where = { { "include", "../include", "../include/pinwheel" },
                                        { "include", "../include", "../include/pinwheel" } };
  return search_find (where, "pinwheel.h", path, error);
}

int pw_search_page_file (const char *file, char path[PW_PATH], pw_error *error) {
  static const search_folders where = { { "page", "../page", "../lib/pinwheel/page" },
                                        { "page", "../page", "pinwheel/page" } };
  return search_find (where, file, path, error);
}
