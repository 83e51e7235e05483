/* Independent tasks in several threads, for sweeps, studies and searches. */
#ifndef PW_PARALLEL_H
#define PW_PARALLEL_H

#include "cli.h"

/* The number of concurrent tasks: the value of --jobs, else OMP_NUM_THREADS, else that of available processors. */
int pw_parallel_jobs (const char *text, int *jobs, pw_error *error);

/* Task number i; returns a status. */
typedef int pw_task (void *context, int i, pw_error *error);

/* Calls task (context, i) for each i < count in any order, in at most `jobs` threads, of which the caller is one.
 * After the first task that does not return PW_OK no further ones are called; its status and error are returned.
 * PW_RESOURCE if a thread cannot be started: no task has been called. */
int pw_parallel (int jobs, int count, pw_task *task, void *context, pw_error *error);
/* The same for tasks that are timed: each thread has physical cores of its own, so there are no more threads than
 * cores.  If the cores are unknown, the tasks are called one after the other. */
int pw_parallel_timed (int jobs, int count, pw_task *task, void *context, pw_error *error);

#endif
