check.o: core/cli/inspect/check.c core/cli/inspect/check_report.h \
  core/cli/cli.h core/files/pinwheel-files.h core/run.h core/pinwheel.h \
  solvers/pinwheel-solvers.h core/cli/progress.h core/base/util.h \
  solvers/pinwheel-analysis.h core/pinwheel-selftest.h \
  core/cli/run/report.h

core/cli/inspect/check_report.h:

core/cli/cli.h:

core/files/pinwheel-files.h:

core/run.h:

core/pinwheel.h:

solvers/pinwheel-solvers.h:

core/cli/progress.h:

core/base/util.h:

solvers/pinwheel-analysis.h:

core/pinwheel-selftest.h:

core/cli/run/report.h:
