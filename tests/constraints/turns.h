/* Runs through singular configurations by methods that let constraints drift. */
#ifndef TURNS_H
#define TURNS_H

/* Runs n-four-bar with `value` couplers, or slider-crank with gravity `value`, for 10 s, and fails the test if it leaves
 * the branch of its start without saying so.  1: it has stopped because drifted constraints lead to another one. */
int turns_try (const char *method, double rtol, const char *model, double value);

#endif
