#define _XOPEN_SOURCE 700
#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "faults.h"
#include "pinwheel-files.h"
#include "cli/cli.h"

/* ---- Files ---- */

enum { FAULTS_FILE = 1 << 21 /* more than the bytes of a page */ };

static size_t faults_slurp (const char *folder, const char *name, char *text, size_t room) {
  FILE *f = fopen (check_text ("%s/%s", folder, name), "rb");
  if (f == NULL) return room; /* as no file has it */
  size_t size = fread (text, 1, room - 1, f);
  text[size] = 0;
  fclose (f);
  return size;
}

static int faults_ends (const char *text, const char *end) {
  size_t n = strlen (text), m = strlen (end);
  return n >= m && strcmp (text + n - m, end) == 0;
}

static int faults_lines (const char *text) {
  int n = 0;
  while ((text = strchr (text, '\n')) != NULL) text++, n++;
  return n;
}

static int faults_whole (const char *o, const char *whole, const char *name) {
  static char text[FAULTS_FILE], same[FAULTS_FILE];
  pw_checkpoint c;
  size_t size = faults_slurp (o, name, text, sizeof text);
  if (faults_ends (name, ".part")) return 1;
  if (faults_ends (name, ".json")) return faults_ends (text, "\n}\n");
  if (faults_ends (name, ".html")) return faults_ends (text, "</html>\n");
  if (faults_ends (name, ".dat") && strncmp (text, "# incomplete: ", 14) == 0) return 1;
  if (faults_ends (name, ".npz"))
    return faults_slurp (whole, name, same, sizeof same) == size && memcmp (text, same, size) == 0;
  if (!faults_ends (name, ".ck"))
    return faults_slurp (whole, name, same, sizeof same) > 0 && faults_lines (text) == faults_lines (same) &&
           text[size - 1] == '\n';
  int status = pw_checkpoint_read (check_text ("%s/%s", o, name), &c, &(pw_error){ 0 });
  pw_checkpoint_free (&c);
  return status == PW_OK;
}

const char *faults_broken (void) {
  static char name[300];
  const char *broken = NULL, *o = cli_path ("o"), *whole = cli_path ("whole");
  DIR *d = opendir (o);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.' || broken) continue;
    if (faults_whole (o, whole, e->d_name)) continue;
    snprintf (name, sizeof name, "%s", e->d_name);
    broken = name;
  }
  if (d) closedir (d);
  return broken;
}

static void faults_empty (const char *folder) {
  char path[600];
  DIR *d = opendir (folder);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.') continue;
    snprintf (path, sizeof path, "%s/%s", folder, e->d_name);
    remove (path);
  }
  if (d) closedir (d);
}

void faults_prepare (void) {
  static char text[FAULTS_FILE];
  char path[600];
  const char *o = cli_path ("o"), *start = cli_path ("start");
  faults_empty (o);
  DIR *d = opendir (start);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.') continue;
    size_t size = faults_slurp (start, e->d_name, text, sizeof text);
    snprintf (path, sizeof path, "%s/%s", o, e->d_name);
    FILE *f = fopen (path, "wb");
    assert_true (f && fwrite (text, 1, size, f) == size && fclose (f) == 0 && chmod (path, 0644) == 0);
  }
  if (d) closedir (d);
}

/* ---- Commands ---- */

static const pw_command *faults_command (const char *name) {
#define FAULTS_ENTRY(command) &pw_cli_##command,
  static const pw_command *const each[] = { PW_COMMANDS (FAULTS_ENTRY) NULL };
  const pw_command *const *c = each;
  while (*c && strcmp (name, (*c)->name) != 0) c++;
  return *c;
}

/* Sends what goes to a descriptor into a file of the folder; returns another one for where it went before. */
static int faults_redirect (int fd, const char *name) {
  int before = dup (fd), file = creat (cli_path (name), 0666);
  dup2 (file, fd);
  close (file);
  return before;
}

static void faults_restore (int before, int fd) {
  dup2 (before, fd);
  close (before);
}

int faults_run (const char *command) {
  char text[1000], *rest;
  const char *argv[40];
  int argc = 0;
  cli_expand (command, text, sizeof text);
  for (char *w = strtok_r (text, " ", &rest); w; w = strtok_r (NULL, " ", &rest)) argv[argc++] = w;
  argv[argc] = NULL;
  fflush (NULL);
  int out = faults_redirect (1, "printed"), err = faults_redirect (2, "log");
  pw_stop = 0;
  int status = pw_cli_main (faults_command (argv[0]), NULL, argc, argv);
  fflush (NULL);
  faults_restore (out, 1);
  faults_restore (err, 2);
  return status;
}

void faults_begin (const char *start, const char *command) {
  cli_good (check_text ("rm -rf @/o @/start; mkdir -p @/o @/start; %s; rm -rf @/whole", start));
  faults_prepare ();
  int status = faults_run (command);
  if (status != 0) print_error ("%s: %s", command, cli_file ("log"));
  assert_int_equal (status, 0);
  cli_good ("cp -r @/o @/whole");
}

int faults_setup (void) {
  static const char gnuplot[] = "#!/bin/sh\n",
                    compiler[] = "#!/bin/sh\nwhile [ \"$1\" != -o ]; do shift; done\n/bin/cp \"$MODEL\" \"$2\"\n";
  const char *build = getenv ("BUILD");
  if (cli_setup () != 0) return -1;
  cli_write ("gnuplot", gnuplot);
  cli_write ("cc", compiler);
  cli_run ("chmod +x @/gnuplot @/cc");
  setenv ("CC", cli_path ("cc"), 1);
  setenv ("MODEL", check_text ("%s/models/ezyroller.so", build ? build : "build"), 1);
  const char *path = getenv ("PATH");
  size_t size = strlen (cli_folder) + strlen (path ? path : "") + 2;
  char *longer = malloc (size);
  if (longer == NULL) return -1;
  snprintf (longer, size, "%s:%s", cli_folder, path ? path : "");
  int status = setenv ("PATH", longer, 1);
  free (longer);
  return status;
}
