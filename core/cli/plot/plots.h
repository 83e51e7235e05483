/* Figures of a run: paths, velocities, energies and snapshots of the motion, drawn by gnuplot; and the samples kept for
 * them and for animations (animate.h).
 *
 * The folder of figures gets data files (*.dat), gnuplot scripts (*.gp) and their output (*.svg, *.png).  A script can
 * be edited and run again there: gnuplot FILE.gp. */
#ifndef PW_PLOTS_H
#define PW_PLOTS_H

#include "pinwheel-solvers.h"

typedef struct pw_plots pw_plots;

/* Endings of the names of the folder's data files, scripts and pictures. */
extern const char *const pw_plot_names[];

/* Prepares figures of a run from 0 to t_end in a folder, which is created if necessary; NULL: without figures.  With
 * `forces`, those of elements with points are kept as well.  System and texts must outlive them.  PW_RESOURCE if the
 * folder cannot be written or memory is exhausted. */
pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *m, const pw_system *s, double t_end,
                         pw_error *error);

/* The time of the next sample [s]; INFINITY after the last one. */
double pw_plots_next (const pw_plots *p);

/* Takes a sample with the ledger. */
void pw_plots_add (pw_plots *p, const pw_sample *sample);

/* Saves or loads the samples taken so far. */
void pw_plots_serialise (pw_plots *p, pw_archive *a);

/* Does nothing without a folder.  Writes data and scripts and, if `draw`, runs gnuplot; a missing gnuplot is reported
 * on standard error, but not an error.  PW_RESOURCE if a file cannot be written or gnuplot fails. */
int pw_plots_finish (pw_plots *p, int draw, pw_error *error);

void pw_plots_close (pw_plots *p);

#endif
