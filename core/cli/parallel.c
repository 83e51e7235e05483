/* Independent tasks in several threads, for sweeps, studies and searches. */
#define _GNU_SOURCE /* sched_getaffinity, sched_setaffinity */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"

enum { PARALLEL_JOBS = 10000 }; /* at most; more threads than any machine runs at once */

int pw_parallel_jobs (const pw_cli_line *line) {
  const char *threads = getenv ("OMP_NUM_THREADS");
  long wanted = threads ? strtol (threads, NULL, 10) : 0;
  cpu_set_t set; /* the processors that this process may use */
  if (wanted <= 0 && sched_getaffinity (0, sizeof set, &set) == 0) wanted = CPU_COUNT (&set);
  if (wanted <= 0) wanted = sysconf (_SC_NPROCESSORS_ONLN);
  return (int)fmin (pw_cli_given_or (line->jobs, wanted > 0 ? (double)wanted : 1), PARALLEL_JOBS);
}

/* For timed tasks (below): cores to which threads are bound. */
typedef struct {
  cpu_set_t all;                /* processors that this process may use */
  int core[CPU_SETSIZE], count; /* one of these processors on each physical core */
} parallel_cores;

typedef struct {
  pthread_mutex_t lock;
  int next, count; /* the task to be called next; number of tasks */
  pw_task *task;
  void *context;
  int status; /* of the first task that failed */
  pw_error *error;
  int threads, bound;          /* number of threads; how many of them are bound to their cores so far */
  const parallel_cores *cores; /* NULL: threads run on any processor */
} parallel;

/* Binds the calling thread to its share of the cores; if these are several, the operating system chooses among them
 * and can avoid those that other programs use. */
static void parallel_bind (const parallel_cores *c, int thread, int threads) {
  cpu_set_t own;
  CPU_ZERO (&own);
  for (int i = thread; i < c->count; i += threads) CPU_SET ((size_t)c->core[i], &own);
  sched_setaffinity (0, sizeof own, &own);
}

static void *parallel_thread (void *argument) {
  parallel *p = argument;
  pthread_mutex_lock (&p->lock);
  if (p->cores) parallel_bind (p->cores, p->bound++, p->threads);
  while (p->next < p->count) {
    int i = p->next++;
    pw_error own = { 0 };
    pthread_mutex_unlock (&p->lock);
    int status = p->task (p->context, i, &own);
    pthread_mutex_lock (&p->lock);
    if (status == PW_OK || p->status != PW_OK) continue;
    p->status = status;
    *p->error = own;
    p->next = p->count;
  }
  pthread_mutex_unlock (&p->lock);
  return NULL;
}

/* Calls the tasks in all threads, of which the caller is one; the lock keeps them waiting until all are started. */
static int parallel_run (parallel *p) {
  if (p->threads > p->count) p->threads = p->count;
  pthread_t *thread = calloc ((size_t)p->threads + 1, sizeof *thread); /* + 1: never of no bytes */
  int started = 1, code = thread ? 0 : ENOMEM;                         /* thread[0], the caller, is unused */
  pthread_mutex_init (&p->lock, NULL);
  pthread_mutex_lock (&p->lock);
  while (code == 0 && started < p->threads && (code = pthread_create (thread + started, NULL, parallel_thread, p)) == 0)
    started++;
  if (code) {
    p->next = p->count;
    p->status = pw_fail (p->error, PW_RESOURCE, "cannot start %d runs at a time, only %d: %s; try --jobs %d",
                         p->threads, started, strerror (code), started);
  }
  pthread_mutex_unlock (&p->lock);
  parallel_thread (p);
  while (--started > 0) pthread_join (thread[started], NULL);
  pthread_mutex_destroy (&p->lock);
  free (thread);
  return p->status;
}

int pw_parallel (int jobs, int count, pw_task *task, void *context, pw_error *error) {
  parallel p = { .count = count, .task = task, .context = context, .error = error, .threads = jobs };
  return parallel_run (&p);
}

/* The first processor on the same physical core; the processor itself if that is unknown. */
static int parallel_first_sibling (int processor) {
  int first = processor;
  FILE *f = fopen (PW_PRINTED (80, "/sys/devices/system/cpu/cpu%d/topology/thread_siblings_list", processor), "r");
  if (f == NULL) return processor;
  if (fscanf (f, "%d", &first) != 1 || first < 0 || first >= CPU_SETSIZE) first = processor;
  fclose (f);
  return first;
}

int pw_parallel_timed (int jobs, int count, pw_task *task, void *context, pw_error *error) {
  parallel_cores cores = { .count = 0 }; /* none if the processors are unknown */
  unsigned char found[CPU_SETSIZE] = { 0 };
  int known = sched_getaffinity (0, sizeof cores.all, &cores.all) == 0;
  for (int i = 0; known && i < CPU_SETSIZE; i++)
    if (CPU_ISSET ((size_t)i, &cores.all) && !found[parallel_first_sibling (i)]++) cores.core[cores.count++] = i;
  parallel p = { .count = count, .task = task, .context = context, .error = error, .threads = jobs, .cores = &cores };
  if (jobs > cores.count) p.threads = cores.count;
  if (p.threads < 2 || count < 2) return pw_parallel (1, count, task, context, error);
  int status = parallel_run (&p);
  sched_setaffinity (0, sizeof cores.all, &cores.all);
  return status;
}
