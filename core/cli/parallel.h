/* Independent tasks on several processors. */
#ifndef PW_PARALLEL_H
#define PW_PARALLEL_H

#include "cli.h"

/* The number of concurrent tasks: the value of --jobs, or if it is NULL OMP_NUM_THREADS, or the processors that this
 * process may use. */
int pw_parallel_jobs (const char *text, int *jobs, pw_error *error);

/* A task; returns a status. */
typedef int pw_task (void *context, int i, pw_error *error);

/* Calls task (context, i) for each i < count, by at most `jobs` threads, of which the caller is one, in any order.  After
 * one that does not return PW_OK, whose status and error are returned, no further ones are called.  PW_RESOURCE if a
 * thread cannot be started: no task has been called. */
int pw_parallel (int jobs, int count, pw_task *task, void *context, pw_error *error);
/* The same for tasks that are timed: no two threads on the same physical core, and so no more threads than cores.  Without
 * knowledge of the cores the tasks are called one after the other. */
int pw_parallel_timed (int jobs, int count, pw_task *task, void *context, pw_error *error);

#endif
