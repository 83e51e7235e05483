/* hard: runs every method on every hard case, and compares the matrix of verdicts with the expected one.
 *
 *     hard [-j CELLS] [-c CASE] [-m METHOD] [-s] [-v] [-o PAGE] FOLDER
 *
 * FOLDER has the folders cases and models.  CELLS: runs at a time; CASE and METHOD: patterns of names; -s: with
 * specialised code; -v: prints every cell; -o: writes PAGE.md and PAGE.csv.  A cell is one method on one case; each
 * runs in its own process with a limit of processor time, so that a crash or an endless run becomes a verdict.  Exit
 * status: 0 if all verdicts are as expected, 1 if not, 2 for a mistake in the cases. */
#define _XOPEN_SOURCE 700
#include <dirent.h>
#include <fnmatch.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include "hard/hard.h"

enum {
  HARD_SLOTS = 64,  /* most runs at a time */
  HARD_ELAPSED = 10 /* limit of the elapsed time, relative to that of the processor time */
};

typedef struct {
  const char *folder, *only_case, *only_method, *page;
  int slots; /* number of runs at a time */
  int verbose, specialised;
  hard_case *cases;
  int count, methods, done; /* cases, methods, finished cells */
  char method[HARD_METHODS][HARD_NAME];
  hard_result *result; /* of each cell, whose index is case * methods + method */
} hard;

/* A running cell. */
typedef struct {
  pid_t pid; /* 0: none */
  int from;  /* pipe of its result */
  int cell;
} hard_child;

/* ---- Cases and methods ---- */

static int hard_by_name (const struct dirent **a, const struct dirent **b) {
  return strcmp ((*a)->d_name, (*b)->d_name);
}

static int hard_is_case (const struct dirent *d) {
  return fnmatch ("*.yaml", d->d_name, 0) == 0;
}

static void hard_read_all (hard *x) {
  char folder[1000], models[150], path[1300];
  struct dirent **entry;
  snprintf (folder, sizeof folder, "%s/cases", x->folder);
  if ((size_t)snprintf (models, sizeof models, "%s/models", x->folder) >= sizeof models) models[0] = 0;
  int files = scandir (folder, &entry, hard_is_case, hard_by_name);
  for (int i = 0; i < files; i++) {
    snprintf (path, sizeof path, "%s/%s", folder, entry[i]->d_name);
    x->count = hard_read (path, models, x->cases, x->count);
    free (entry[i]);
  }
  if (files > 0) free (entry);
  int kept = 0;
  for (int i = 0; i < x->count; i++)
    if (!x->only_case || fnmatch (x->only_case, x->cases[i].name, 0) == 0) x->cases[kept++] = x->cases[i];
  x->count = kept;
}

static void hard_list_methods (hard *x) {
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name && x->methods < HARD_METHODS; s++) {
      char *name = x->method[x->methods];
      snprintf (name, sizeof x->method[0], "%s+%s", pw_methods[i]->name, s->name);
      x->methods += !x->only_method || fnmatch (x->only_method, name, 0) == 0;
    }
}

/* ---- Cells ---- */

/* The child process: sets the limits, runs the cell, writes the result to the pipe `to`. */
static void hard_cell (const hard_case *c, const char *method, int specialised, int to) {
  hard_result r;
  struct rlimit limit = { (rlim_t)c->seconds, (rlim_t)c->seconds + 5 }, none = { 0, 0 };
  setrlimit (RLIMIT_CPU, &limit);
  setrlimit (RLIMIT_CORE, &none);
  alarm ((unsigned)(HARD_ELAPSED * c->seconds));
  hard_run (c, method, specialised, &r);
  _exit (write (to, &r, sizeof r) == (ssize_t)sizeof r ? 0 : 1);
}

static void hard_start (hard *x, hard_child *child, int cell) {
  int end[2]; /* of the pipe: to read from, to write to */
  fflush (NULL);
  if (pipe (end) != 0) {
    perror ("pipe");
    exit (2);
  }
  child->cell = cell;
  child->from = end[0];
  child->pid = fork ();
  if (child->pid == 0) hard_cell (&x->cases[cell / x->methods], x->method[cell % x->methods], x->specialised, end[1]);
  close (end[1]);
  if (child->pid > 0) return;
  perror ("fork");
  exit (2);
}

/* Prints a line about a cell whose result is not as expected, with -v about every cell. */
static void hard_report (const hard *x, int cell) {
  const hard_case *c = &x->cases[cell / x->methods];
  const hard_result *r = &x->result[cell];
  const hard_expectation *e = hard_expected (c, x->method[cell % x->methods]);
  int expected = hard_as_expected (e, r);
  if (expected && !x->verbose) return;
  printf ("%-20s %-18s %-7s %6.2f s", c->name, x->method[cell % x->methods], hard_verdict_name[r->verdict], r->cpu);
  for (int k = 0; k < HARD_MEASURES && r->status == PW_OK && r->verdict > HARD_CRASH && r->verdict != HARD_SLOW; k++)
    printf (" %s %.1e", hard_measure_name[k], r->measure[k]);
  if (r->status != PW_OK) printf (" \"%s\"", r->reason);
  if (!expected) printf (" - expected %s %s%s", e->pattern, *e->reason ? "refused: " : "otherwise", e->reason);
  putchar ('\n');
}

/* Reads the result of a child process that has ended with this status of `wait`. */
static void hard_finish (hard *x, hard_child *child, int status) {
  hard_result *r = &x->result[child->cell];
  const hard_case *c = &x->cases[child->cell / x->methods];
  int signal = WIFSIGNALED (status) ? WTERMSIG (status) : 0;
  if (signal == SIGXCPU || signal == SIGALRM || signal == SIGKILL) {
    *r = (hard_result){ .verdict = HARD_SLOW, .cpu = c->seconds };
  } else if (status != 0 || read (child->from, r, sizeof *r) != (ssize_t)sizeof *r)
    *r = (hard_result){ .verdict = HARD_CRASH };
  else
    r->verdict = hard_verdict_of (c, r);
  close (child->from);
  child->pid = 0;
  if (isatty (STDERR_FILENO)) fprintf (stderr, "\r%d of %d\r", ++x->done, x->count * x->methods);
  hard_report (x, child->cell);
}

static void hard_all (hard *x) {
  hard_child child[HARD_SLOTS] = { { .pid = 0 } };
  int cells = x->count * x->methods, next = 0, running = 0, status;
  while (next < cells || running > 0) {
    for (int i = 0; i < x->slots && next < cells; i++)
      if (child[i].pid == 0) hard_start (x, &child[i], next++), running++;
    pid_t pid = wait (&status);
    for (int i = 0; i < x->slots; i++)
      if (pid > 0 && child[i].pid == pid) hard_finish (x, &child[i], status), running--;
  }
}

/* ---- The program ---- */

static int hard_count_deviations (const hard *x) {
  int deviations = 0;
  for (int cell = 0; cell < x->count * x->methods; cell++)
    deviations += !hard_as_expected (hard_expected (&x->cases[cell / x->methods], x->method[cell % x->methods]),
                                     &x->result[cell]);
  return deviations;
}

static void hard_write (const hard *x, const char *suffix, const hard_matrix *m,
                        void write (const hard_matrix *, FILE *)) {
  char path[1000];
  snprintf (path, sizeof path, "%s%s", x->page, suffix);
  FILE *f = fopen (path, "w");
  if (f) write (m, f);
  if (f && !ferror (f) && fclose (f) == 0) return;
  perror (path);
  exit (2);
}

static int hard_usage (void) {
  fputs ("hard [-j CELLS] [-c CASE] [-m METHOD] [-s] [-v] [-o PAGE] FOLDER\n", stderr);
  return 2;
}

int main (int argc, char **argv) {
  hard x = { .slots = 2 };
  for (int option; (option = getopt (argc, argv, "j:c:m:o:sv")) != -1;) switch (option) {
    case 'j':
      x.slots = atoi (optarg);
      break;
    case 'c':
      x.only_case = optarg;
      break;
    case 'm':
      x.only_method = optarg;
      break;
    case 'o':
      x.page = optarg;
      break;
    case 's':
      x.specialised = 1;
      break;
    case 'v':
      x.verbose = 1;
      break;
    default:
      return hard_usage ();
    }
  if (optind + 1 != argc || x.slots < 1 || x.slots > HARD_SLOTS) return hard_usage ();
  x.folder = argv[optind];
  x.cases = calloc (HARD_CASES, sizeof *x.cases);
  if (x.cases == NULL) return 2;
  hard_read_all (&x);
  hard_list_methods (&x);
  x.result = calloc ((size_t)(x.count * x.methods) + 1, sizeof *x.result);
  if (x.result == NULL || x.count * x.methods == 0) return hard_usage ();
  hard_all (&x);
  const hard_matrix m = { x.cases, x.count, x.methods, (const char (*)[HARD_NAME])x.method, x.result };
  hard_print (&m, stdout);
  if (x.page) {
    hard_write (&x, ".md", &m, hard_page);
    hard_write (&x, ".csv", &m, hard_table);
  }
  int deviations = hard_count_deviations (&x);
  printf ("\n%d cells, %d unexpected\n", x.count * x.methods, deviations);
  free (x.result);
  free (x.cases);
  return deviations > 0;
}
