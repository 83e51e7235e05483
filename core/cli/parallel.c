/* Independent tasks on several processors. */
#define _GNU_SOURCE /* sched_getaffinity, sched_setaffinity */
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "parallel.h"

/* OMP_NUM_THREADS, or the processors that this process may use. */
static long parallel_processors (void) {
  const char *text = getenv ("OMP_NUM_THREADS");
  long wanted = text ? strtol (text, NULL, 10) : 0;
  if (wanted > 0) return wanted;
  cpu_set_t set;
  if (sched_getaffinity (0, sizeof set, &set) == 0) return CPU_COUNT (&set);
  long n = sysconf (_SC_NPROCESSORS_ONLN);
  return n > 0 ? n : 1;
}

int pw_parallel_jobs (const char *text, int *jobs, pw_error *error) {
  double n = (double)parallel_processors ();
  int status = pw_cli_number ("--jobs", text, PW_COUNT, &n, error);
  *jobs = n < 10000 ? (int)n : 10000;
  return status;
}

/* ---- Threads ---- */

typedef struct {
  cpu_set_t all;                /* processors that this process may use */
  int core[CPU_SETSIZE], cores; /* one of them on each physical core */
} parallel_cores;

typedef struct {
  pthread_mutex_t lock;
  int next, count; /* tasks */
  pw_task *task;
  void *context;
  int status; /* of the first task that failed */
  pw_error *error;
  int threads, begun;          /* threads; those that have begun */
  const parallel_cores *cores; /* NULL: threads run on any processor */
} parallel;

/* The cores of each thread are its own; there may be several, so that it can avoid other programs. */
static void parallel_bind (const parallel_cores *c, int thread, int threads) {
  cpu_set_t own;
  CPU_ZERO (&own);
  for (int i = thread; i < c->cores; i += threads) CPU_SET ((size_t)c->core[i], &own);
  sched_setaffinity (0, sizeof own, &own);
}

static void *parallel_thread (void *argument) {
  parallel *p = argument;
  pthread_mutex_lock (&p->lock);
  if (p->cores) parallel_bind (p->cores, p->begun++, p->threads);
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

/* Starts all threads but one, which is the caller. */
static int parallel_run (parallel *p) {
  if (p->threads > p->count) p->threads = p->count;
  pthread_t *thread = calloc ((size_t)p->threads + 1, sizeof *thread);
  int started = 1, why = thread ? 0 : ENOMEM;
  pthread_mutex_init (&p->lock, NULL);
  pthread_mutex_lock (&p->lock);
  while (why == 0 && started < p->threads && (why = pthread_create (thread + started, NULL, parallel_thread, p)) == 0)
    started++;
  if (why) {
    p->next = p->count;
    p->status = pw_fail (p->error, PW_RESOURCE, "cannot start %d runs at a time, only %d: %s; try --jobs %d",
                         p->threads, started, strerror (why), started);
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

/* ---- Timed tasks ---- */

/* The lowest processor on the same physical core; the processor itself if that is unknown. */
static int parallel_sibling (int processor) {
  char name[80];
  int first = processor;
  snprintf (name, sizeof name, "/sys/devices/system/cpu/cpu%d/topology/thread_siblings_list", processor);
  FILE *f = fopen (name, "r");
  if (f == NULL) return processor;
  if (fscanf (f, "%d", &first) != 1 || first < 0 || first >= CPU_SETSIZE) first = processor;
  fclose (f);
  return first;
}

static void parallel_find (parallel_cores *c) {
  unsigned char known[CPU_SETSIZE] = { 0 };
  c->cores = 0;
  if (sched_getaffinity (0, sizeof c->all, &c->all) != 0) return;
  for (int i = 0; i < CPU_SETSIZE; i++)
    if (CPU_ISSET ((size_t)i, &c->all) && !known[parallel_sibling (i)]++) c->core[c->cores++] = i;
}

int pw_parallel_timed (int jobs, int count, pw_task *task, void *context, pw_error *error) {
  parallel_cores c;
  parallel_find (&c);
  parallel p = { .count = count, .task = task, .context = context, .error = error, .threads = jobs, .cores = &c };
  if (jobs > c.cores) p.threads = c.cores;
  if (p.threads < 2) return pw_parallel (1, count, task, context, error);
  int status = parallel_run (&p);
  sched_setaffinity (0, sizeof c.all, &c.all);
  return status;
}
