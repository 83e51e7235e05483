dead_point.o: solvers/constraints/dead_point.c solvers/method.h \
  solvers/pinwheel-method.h solvers/pinwheel-solvers.h core/run.h \
  core/pinwheel.h solvers/kkt/saddle.h core/system/system.h \
  core/model/model.h core/base/util.h core/signals/signal.h \
  solvers/watchdog.h solvers/constraints/rank.h

solvers/method.h:

solvers/pinwheel-method.h:

solvers/pinwheel-solvers.h:

core/run.h:

core/pinwheel.h:

solvers/kkt/saddle.h:

core/system/system.h:

core/model/model.h:

core/base/util.h:

core/signals/signal.h:

solvers/watchdog.h:

solvers/constraints/rank.h:
