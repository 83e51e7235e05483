/* Runs through singular configurations by methods that let constraints drift. */
#ifndef TURNS_H
#define TURNS_H

/* Runs n-four-bar with `value` couplers, or slider-crank with gravity `value`, for 10 s, with rtol or the fixed step
 * 20 rtol; the test fails if the run leaves its initial branch without an error.  Returns 1 if the run has stopped
 * because of drifted constraints. */
int turns_try (const char *method, double rtol, const char *model, double value);

#endif
