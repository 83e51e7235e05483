range.o: core/files/expression/range.c \
  core/files/expression/expression_parts.h \
  core/files/expression/expression.h core/base/util.h core/pinwheel.h

core/files/expression/expression_parts.h:

core/files/expression/expression.h:

core/base/util.h:

core/pinwheel.h:
