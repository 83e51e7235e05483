periodic_report.o: core/cli/analyse/periodic_report.c \
  core/cli/analyse/periodic_report.h core/cli/analyse/vary.h \
  core/cli/progress.h core/cli/analyse/unknowns.h core/cli/cli.h \
  core/files/pinwheel-files.h core/run.h core/pinwheel.h \
  solvers/pinwheel-solvers.h core/base/util.h \
  solvers/pinwheel-analysis.h core/cli/plot/figure.h \
  core/cli/run/print_table.h core/cli/analyse/states.h core/cli/text.h

core/cli/analyse/periodic_report.h:

core/cli/analyse/vary.h:

core/cli/progress.h:

core/cli/analyse/unknowns.h:

core/cli/cli.h:

core/files/pinwheel-files.h:

core/run.h:

core/pinwheel.h:

solvers/pinwheel-solvers.h:

core/base/util.h:

solvers/pinwheel-analysis.h:

core/cli/plot/figure.h:

core/cli/run/print_table.h:

core/cli/analyse/states.h:

core/cli/text.h:
