/* Independent tasks on several processors. */
#define _GNU_SOURCE /* sched_getaffinity */
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "parallel.h"

/* OMP_NUM_THREADS, or the processors that this process may use. */
static long parallel_processors (void) {
  const char *text = getenv ("OMP_NUM_THREADS");
  long wanted = text ? strtol (text, NULL, 10) : 0;
  if (wanted > 0) return wanted;
#ifdef CPU_COUNT
  cpu_set_t set;
  if (sched_getaffinity (0, sizeof set, &set) == 0) return CPU_COUNT (&set);
#endif
  long n = sysconf (_SC_NPROCESSORS_ONLN);
  return n > 0 ? n : 1;
}

int pw_parallel_jobs (const char *text, int *jobs, pw_error *error) {
  double n = (double)parallel_processors ();
  int status = pw_cli_number ("--jobs", text, PW_COUNT, &n, error);
  *jobs = n < 10000 ? (int)n : 10000;
  return status;
}

typedef struct {
  pthread_mutex_t lock;
  int next, count;
  void (*task) (void *context, int i);
  void *context;
} parallel;

static void *parallel_thread (void *argument) {
  parallel *p = argument;
  for (;;) {
    pthread_mutex_lock (&p->lock);
    int i = p->next < p->count ? p->next++ : -1;
    pthread_mutex_unlock (&p->lock);
    if (i < 0) return NULL;
    p->task (p->context, i);
  }
}

int pw_parallel (int jobs, int count, void (*task) (void *context, int i), void *context, pw_error *error) {
  parallel p = { .count = count, .task = task, .context = context };
  if (jobs > count) jobs = count;
  pthread_t *thread = calloc ((size_t)jobs + 1, sizeof *thread);
  int started = 1, why = thread ? 0 : ENOMEM;
  pthread_mutex_init (&p.lock, NULL);
  pthread_mutex_lock (&p.lock);
  while (why == 0 && started < jobs && (why = pthread_create (thread + started, NULL, parallel_thread, &p)) == 0)
    started++;
  if (why) p.next = count;
  if (why)
    pw_fail (error, PW_RESOURCE, "cannot start %d runs at a time, only %d: %s; try --jobs %d", jobs, started,
             strerror (why), started);
  pthread_mutex_unlock (&p.lock);
  parallel_thread (&p);
  while (--started > 0) pthread_join (thread[started], NULL);
  pthread_mutex_destroy (&p.lock);
  free (thread);
  return why ? PW_RESOURCE : PW_OK;
}
