/* The parts of pw_animate. */
#ifndef PW_ANIMATE_PAGE_H
#define PW_ANIMATE_PAGE_H

#include "plot.h"

/* The page animate.html with the run's data in it. */
int pw_animate_page (const pw_plots *p, const char *path, const char *method, const char *reason, pw_error *error);

/* Frames drawn by gnuplot. */
int pw_animate_gif (pw_plots *p, const char *path, pw_error *error);

#endif
