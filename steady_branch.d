steady_branch.o: solvers/analysis/steady_branch.c \
  solvers/constraints/rank.h core/run.h core/pinwheel.h \
  core/system/system.h core/model/model.h core/base/util.h \
  core/signals/signal.h solvers/analysis/steady_parts.h \
  solvers/analysis/continuation.h solvers/linear/linear.h \
  solvers/method.h solvers/pinwheel-method.h solvers/pinwheel-solvers.h \
  solvers/kkt/saddle.h solvers/watchdog.h solvers/pinwheel-analysis.h \
  solvers/jacobian/tangent.h solvers/jacobian/scatter.h

solvers/constraints/rank.h:

core/run.h:

core/pinwheel.h:

core/system/system.h:

core/model/model.h:

core/base/util.h:

core/signals/signal.h:

solvers/analysis/steady_parts.h:

solvers/analysis/continuation.h:

solvers/linear/linear.h:

solvers/method.h:

solvers/pinwheel-method.h:

solvers/pinwheel-solvers.h:

solvers/kkt/saddle.h:

solvers/watchdog.h:

solvers/pinwheel-analysis.h:

solvers/jacobian/tangent.h:

solvers/jacobian/scatter.h:
