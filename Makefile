# Pinwheel.  `make help` lists the targets; everything is built in $(BUILD).
#
# Here: what it takes to build, test and install.  .ci/page.mk: interactive pages; .ci/dev.mk: checks, benchmarks, packages.

# Defined in the header.  The soname of the libraries is the ABI of plug-ins.
VERSION := $(shell sed -n 's/^\#define PW_VERSION "\(.*\)".*/\1/p' core/pinwheel.h)
ABI     := $(shell sed -n 's/^\#define PW_ABI \([0-9]*\).*/\1/p' core/pinwheel.h)

BUILD  ?= build
PREFIX ?= /usr/local
CFLAGS ?= -O2 -g
V      ?= 0
Q      := $(if $(filter 0,$(V)),@)
say     = $(if $(filter 0,$(V)),@printf '  %-7s %s\n' $(1) $@)

# Every build uses all processors unless -j is given.
ifeq ($(MAKELEVEL)$(filter -j%,$(MAKEFLAGS)),0)
MAKEFLAGS += -j$(shell nproc 2>/dev/null || echo 2)
endif

# ---- How to compile and link ----

WARN   := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wstrict-prototypes -Wmissing-prototypes -Wcast-qual
# -fvisibility=hidden: a library exports what its public headers declare.  -fno-plt: calls between the files of a library do not
# go through the procedure linkage table.
STRICT := -std=c11 -fPIC -fvisibility=hidden -fno-plt -ffp-contract=off -fno-semantic-interposition $(WARN) $(if $(WERROR),-Werror)
ONE_BY_ONE := -fno-tree-slp-vectorize
# gcc 12.2 fuses multiplications and additions when it vectorises straight-line code, in spite of -ffp-contract=off, for
# processors with such instructions (-m...): results would depend on the build.  The default processor of x86-64 has none.
STRICT += $(if $(findstring -m,$(CFLAGS)),$(ONE_BY_ONE))
PW_CFLAGS = $(STRICT) $(THREADS) -D_POSIX_C_SOURCE=200809L $(INCLUDE) $(CPPFLAGS) $(CFLAGS) $(SAN)

# SuiteSparse has no pkg-config file; the folder need not exist.
SUITESPARSE ?= /usr/include/suitesparse
SYSTEM := -isystem $(SUITESPARSE)

SOLVER_LIBS := -lsundials_idas -lsundials_cvodes -lsundials_nvecserial -lklu -lamd -lbtf -llapacke -lm
FILES_LIBS  := -lfyaml -ldl -lm
# What these need if they are linked statically; the Fortran libraries where the compiler has them.
STATIC_LIBS  = -lcolamd -lsuitesparseconfig -llapack -lblas $(foreach l,gfortran quadmath,$(if \
               $(filter /%,$(shell $(CC) -print-file-name=lib$l.a)),-l$l)) -lm
CLI_LIBS    := -lpopt -lgsl -lgslcblas -lnlopt
LINK         = $(CC) $(CFLAGS) $(SAN) $(LDFLAGS) -Wl,--as-needed
SHARED       = $(LINK) -shared -Wl,--no-undefined

# ---- Sources: every file in one of these folders is part of the build ----

obj = $(patsubst %.c,$(BUILD)/obj/%.o,$(1))

FILES   := $(wildcard core/files/*.c)
CLI     := $(wildcard core/cli/*.c core/cli/*/*.c)
CORE    := $(filter-out $(FILES) $(CLI),$(wildcard core/*/*.c core/kinds/*/*.c))
SOLVERS := $(wildcard solvers/*/*.c)
MODELS  := $(wildcard models/*.c models/*/*.c)
TEXTS   := $(wildcard models/*.yaml models/*/*.yaml)
QUICK   := $(wildcard tests/*/test_*.c)
SLOW    := $(wildcard tests/*/slow_*.c)
SHELLS  := $(filter-out tests/support/%,$(wildcard tests/*/*.sh))
SHARE   := $(filter-out $(QUICK) $(SLOW) $(wildcard $(addprefix tests/,fuzz/*.c models/*.c scenes/*.c)),$(wildcard tests/*/*.c)) # linked to every test
BENCH   := $(wildcard benchmarks/*.c)
EMBED   := $(wildcard docs/*.c)

HEADERS := core/pinwheel.h core/run.h core/pinwheel-selftest.h solvers/pinwheel-solvers.h solvers/pinwheel-analysis.h solvers/pinwheel-method.h core/files/pinwheel-files.h
INCLUDES := $(addprefix $(BUILD)/include/,$(notdir $(HEADERS)))

LIB       := $(BUILD)/libpinwheel.so
FILES_LIB := $(BUILD)/libpinwheel-files.so
LIB_OBJ   := $(call obj,$(CORE) $(SOLVERS))
# Utilities that the libraries do not export: the program and each library contain them.
BASE_OBJ  := $(call obj,$(addprefix core/base/,text.c store.c))
FILES_OBJ := $(call obj,$(FILES))
CLI_OBJ   := $(call obj,$(CLI))
# Interactive pages need the sources of plug-ins, next to them.
PLUGINS   := $(addprefix $(BUILD)/models/,$(notdir $(MODELS:.c=.so) $(MODELS) $(TEXTS)))
# The longest files come first, so that no processor waits for them at the end.
LONGEST   := $(addprefix $(BUILD)/tests/test_,lanes specialise plots jumps memory specialised)
TESTS     := $(LONGEST) $(filter-out $(LONGEST),$(patsubst %.c,$(BUILD)/tests/%,$(notdir $(QUICK))))
SLOWS     := $(patsubst %.c,$(BUILD)/tests/%,$(notdir $(SLOW)))
LONG_SHELLS := tests/reference/reference.sh $(addprefix tests/methods/,determinism.sh hard.sh effects.sh) tests/scripts/checkpoint.sh
SLOW_TESTS := $(LONG_SHELLS) $(SLOWS) $(filter-out $(LONG_SHELLS),$(SHELLS))
PROGRAMS  := $(BENCH:%.c=$(BUILD)/%) $(EMBED:%.c=$(BUILD)/%)
PROGRAM   := $(BUILD)/pinwheel

.PHONY: all everything demo test test-all deps install uninstall clean help
.DELETE_ON_ERROR:
.SECONDARY:

all: $(LIB) $(FILES_LIB) $(LIB:.so=.a) $(FILES_LIB:.so=.a) $(INCLUDES) $(PLUGINS) $(PROGRAM)

everything: all $(TESTS) $(SLOWS) $(PROGRAMS)

help::
	@echo 'make                  the libraries, the program and the models, in $(BUILD)/; everything: also tests and benchmarks'
	@echo 'make deps             installs the libraries that are missing'
	@echo 'make demo             the EzyRoller by three methods: a table, figures in $(BUILD)/demo/'
	@echo 'make gallery          pages that simulate the models in a browser, in $(BUILD)/site/'
	@echo 'make test             runs the tests; test-all: also the slow ones and scripts (TESTED=1: only these)'
	@echo 'make install          installs below DESTDIR in PREFIX (/usr/local); uninstall: removes that'
	@echo 'make clean            removes $(BUILD)/'
	@echo
	@echo 'CC CFLAGS CPPFLAGS LDFLAGS BUILD as usual; WERROR=1; V=1 shows the commands;'
	@echo 'NO_DEPS=1 installs nothing (otherwise demo, test and others begin with deps)'

# ---- Dependencies: targets that run something install missing libraries first ----

ifneq ($(filter demo test test-all layers bench bench-check bench-quick bench-engine bench-effects hard san cov fuzz mutants,$(MAKECMDGOALS)),)
ifndef NO_DEPS
FIRST := deps
endif
endif

deps:
	@CC='$(CC)' CPPFLAGS='$(CPPFLAGS) $(SYSTEM)' LDFLAGS='$(LDFLAGS)' BUILD='$(BUILD)' NO_DEPS='$(NO_DEPS)' \
	  sh .ci/deps.sh $(if $(filter deps,$(MAKECMDGOALS)),fresh) $(TOOLS)

# ---- Objects; .ci/layers checks which folder includes what ----

DIRS := $(patsubst %/,%,$(sort $(dir $(wildcard core/*.h core/*/*.h core/*/*/*.h solvers/*.h solvers/*/*.h))))
ALL  := $(DIRS:%=-iquote %)
INCLUDE = $(ALL) $(SYSTEM)

# Otherwise gcc would compute numbers that a kind stores as a pair twice, or later loads would wait for the store.
$(BUILD)/obj/core/kinds/%.o: STRICT += $(ONE_BY_ONE)
# Texts that become parts of the program are generated beside its objects.
$(BUILD)/obj/core/cli/%.o $(BUILD)/obj/core/specialise/%.o: INCLUDE += -iquote $(@D)
$(call obj,core/cli/list.c): $(BUILD)/obj/core/cli/new.inc
$(call obj,core/cli/page/page.c): $(BUILD)/obj/core/cli/page/page.inc
$(call obj,core/cli/plot/animate.c): $(BUILD)/obj/core/cli/plot/animate.inc
$(call obj,core/cli/plot/figure.c): $(BUILD)/obj/core/cli/plot/templates.inc
$(call obj,core/specialise/specialise.c): $(BUILD)/obj/core/specialise/source_texts.inc
$(call obj,core/cli/parallel.c core/cli/run/sweep.c core/cli/run/run_command.c $(addprefix core/cli/analyse/,fit.c optimise.c)) $(BUILD)/pinwheel: private THREADS = -pthread
# Functions of tests that replace those of other libraries must be visible to these.
$(BUILD)/obj/tests/%.o:      STRICT += -fvisibility=default
$(BUILD)/obj/tests/%.o:      INCLUDE = $(addprefix -iquote tests/,support faults solvers) $(ALL) $(SYSTEM)
$(BUILD)/obj/benchmarks/%.o $(BUILD)/obj/docs/%.o: INCLUDE = -I$(BUILD)/include
$(BUILD)/models/%.so:        INCLUDE = -I$(BUILD)/include

$(BUILD)/obj/%.o: %.c | $(FIRST)
	@mkdir -p $(@D)
	$(call say,CC)
	$(Q)$(CC) $(PW_CFLAGS) -MMD -MP -c $< -o $@

$(call obj,$(BENCH) $(EMBED)): | $(INCLUDES)

-include $(patsubst %.o,%.d,$(call obj,$(CORE) $(SOLVERS) $(FILES) $(CLI) $(QUICK) $(SLOW) $(SHARE) $(BENCH) $(EMBED)))
-include $(patsubst %.c,$(BUILD)/obj/plugins/%.d,$(notdir $(MODELS)))

# The page of animations and the templates of figures and new models become part of the program, as C strings, one per line.
AS_STRINGS := sed -e 's/\\/&&/g' -e 's/"/\\"/g' -e 's/.*/"&\\n",/'
$(BUILD)/obj/%.inc: %.html
	@mkdir -p $(@D)
	@$(AS_STRINGS) $< >$@

$(BUILD)/obj/core/cli/new.inc: $(wildcard core/cli/*.in)
	@mkdir -p $(@D)
	@for f in $^; do echo "static const char *const $$(basename $$f .in | tr .- _)[] = {"; $(AS_STRINGS) $$f; echo 'NULL };'; done >$@

$(BUILD)/obj/core/cli/page/page.inc: core/cli/page/page.html core/cli/page/page.js
	@mkdir -p $(@D)
	@for f in $^; do echo "static const char *const $$(basename $$f | tr .- __)[] = {"; $(AS_STRINGS) $$f; echo 'NULL };'; done >$@

# A line "# include OTHER.gp" of a template stands for the contents of another one.
$(BUILD)/obj/core/cli/plot/templates.inc: $(wildcard core/cli/plot/templates/*.gp)
	@mkdir -p $(@D)
	@for f in $^; do echo "{ \"$$(basename $$f .gp)\", (const char *const[]){"; \
	  awk '/^# include / { while ((getline line <("core/cli/plot/templates/" $$3)) > 0) print line; next } { print }' $$f | \
	  $(AS_STRINGS); echo 'NULL } },'; done >$@

# Texts of the sources that specialised scenes contain.
SPECIALISED := core/specialise/specialised.h core/base/sine.h $(wildcard core/specialise/*.inc core/kinds/*.h core/kinds/*/*.c)
$(BUILD)/obj/core/specialise/source_texts.inc: $(SPECIALISED)
	@mkdir -p $(@D)
	@for f in $^; do echo "static const char *const source_$$(basename $$f | tr .- __)[] = {"; \
	  sed 's/^const pw_kind pw_kind_/static const pw_kind scene_/' $$f | $(AS_STRINGS); echo 'NULL };'; done >$@
	@echo 'static const source_text source_texts[] = {' >>$@
	@for f in $^; do n=$$(basename $$f); echo "{ \"$$n\", source_$$(echo $$n | tr .- __) },"; done >>$@
	@echo '{ NULL, NULL } };' >>$@

# ---- Libraries, headers, models, programs ----

$(LIB): $(LIB_OBJ)
	$(call say,LINK)
	$(Q)$(SHARED) -Wl,-soname,$(@F).$(ABI) -o $@.$(ABI) $^ $(SOLVER_LIBS)
	$(Q)ln -sf $(@F).$(ABI) $@

$(FILES_LIB): $(FILES_OBJ) $(BASE_OBJ) $(LIB)
	$(call say,LINK)
	$(Q)$(SHARED) -Wl,-soname,$(@F).$(ABI) -Wl,-rpath,'$$ORIGIN' -o $@.$(ABI) $(FILES_OBJ) $(BASE_OBJ) -L$(BUILD) -lpinwheel $(FILES_LIBS)
	$(Q)ln -sf $(@F).$(ABI) $@

$(LIB:.so=.a): $(LIB_OBJ)
$(FILES_LIB:.so=.a): $(FILES_OBJ)
$(BUILD)/libtests.a: $(call obj,$(SHARE))
$(BUILD)/%.a:
	@rm -f $@
	$(call say,AR)
	$(Q)$(AR) rcs $@ $^

$(BUILD)/include/%.h: core/%.h
	@mkdir -p $(@D) && cp $< $@
$(BUILD)/include/%.h: solvers/%.h
	@mkdir -p $(@D) && cp $< $@
$(BUILD)/include/%.h: core/files/%.h
	@mkdir -p $(@D) && cp $< $@

# Models are in folders by subject, and in one folder of a build, as of an installation.
vpath %.c $(sort $(dir $(MODELS)))
vpath %.yaml $(sort $(dir $(TEXTS)))

# A plug-in links to nothing: it finds Pinwheel in the program that opens it.
$(BUILD)/models/%.so: %.c | $(INCLUDES) $(FIRST)
	@mkdir -p $(@D) $(BUILD)/obj/plugins
	$(call say,PLUGIN)
	$(Q)$(CC) $(STRICT) $(INCLUDE) $(CPPFLAGS) $(CFLAGS) $(SAN) $(LDFLAGS) -Wl,--as-needed -shared \
	  -MMD -MP -MF $(BUILD)/obj/plugins/$*.d -o $@ $< -lm

# A link: $(BUILD)/pinwheel searches models/, too, and a file found twice counts once.  It is relative, so that the tree can be
# copied.  A plug-in of the same name, from when the model was written in C, is removed.
TO_SOURCE = ln -sfr $< $@ 2>/dev/null || ln -sf "$(CURDIR)/$<" $@
$(BUILD)/models/%.yaml: %.yaml
	@mkdir -p $(@D) && rm -f $(@:.yaml=.so) $(@:.yaml=.c)
	@$(TO_SOURCE)
$(BUILD)/models/%.c: %.c
	@mkdir -p $(@D)
	@$(TO_SOURCE)

OWN_LIBS = -L$(BUILD) -lpinwheel-files -lpinwheel

# Libraries with many symbols first, where they are libraries of their own: many distributions bind all of them when a program
# starts, and each is sought in the libraries in this order.
FIRST_LIBS = $(foreach l,lapack lapacke blas sundials_cvodes sundials_idas,$(if \
               $(filter /%,$(shell $(CC) -print-file-name=lib$l.so)),-l$l))

$(PROGRAM): $(CLI_OBJ) $(BASE_OBJ) $(LIB) $(FILES_LIB)
	$(call say,LINK)
	$(Q)$(LINK) $(THREADS) -Wl,-rpath,'$$ORIGIN:$$ORIGIN/../lib' -o $@ -Wl,--no-as-needed $(FIRST_LIBS) -Wl,--as-needed \
	  $(CLI_OBJ) $(BASE_OBJ) $(OWN_LIBS) $(CLI_LIBS) -lm

# The whole libraries, with internal functions.
WHOLE := -Wl,--whole-archive $(FILES_LIB:.so=.a) $(LIB:.so=.a) -Wl,--no-whole-archive $(FILES_LIBS) $(SOLVER_LIBS)
$(PROGRAMS): $(BUILD)/%: $(BUILD)/obj/%.o $(LIB) $(FILES_LIB)
	@mkdir -p $(@D)
	$(call say,LINK)
	$(Q)$(LINK) -Wl,-rpath,'$$ORIGIN/..' -o $@ $(filter %.o,$^) $(OWN_LIBS) $(EXTRA_LIBS) -lm

# A test contains the whole libraries, in which the plug-ins that it opens find their symbols; plug-ins and the program are
# brought up to date first.
test_obj = $(filter %/$(1).o,$(call obj,$(QUICK) $(SLOW)))
.SECONDEXPANSION:
$(TESTS) $(SLOWS): $(BUILD)/tests/%: $$(call test_obj,$$*) $(BUILD)/libtests.a $(FILES_LIB:.so=.a) $(LIB:.so=.a) | $(PROGRAM) $(PLUGINS) $(INCLUDES)
	@mkdir -p $(@D)
	$(call say,LINK)
	$(Q)$(LINK) $(WRAP) -rdynamic -Wl,-u,limit_begin -o $@ $(filter %.o,$^) $(BUILD)/libtests.a \
	  $(WHOLE) -lcmocka $(CLI_LIBS)

$(BUILD)/tests/test_embed: | $(BUILD)/docs/embed

# Tests that make allocations and, in test_cli_faults, operations on files fail one at a time: they wrap these functions.
comma := ,
ALLOC_WRAP := malloc calloc realloc strdup free
FILES_WRAP := open fopen fdopen fclose fflush fwrite fread fseek fseeko ftell fgets rename ftruncate fsync pread pwrite flock \
              fchmod mkdir realpath opendir \
              $(addprefix posix_spawn,p _file_actions_init _file_actions_addchdir_np _file_actions_addopen _file_actions_adddup2)
$(BUILD)/tests/test_alloc: WRAP := $(addprefix -Wl$(comma)--wrap=,$(ALLOC_WRAP))
$(BUILD)/tests/test_cli_faults: WRAP = -pthread $(addprefix -Wl$(comma)--wrap=,$(ALLOC_WRAP) $(FILES_WRAP))
$(BUILD)/tests/test_memory $(BUILD)/tests/slow_memory: WRAP = -pthread $(addprefix -Wl$(comma)--wrap=,$(ALLOC_WRAP))
$(BUILD)/tests/test_cli_faults $(BUILD)/tests/test_memory $(BUILD)/tests/slow_memory: $(filter-out %/main.o,$(CLI_OBJ))
$(BUILD)/tests/test_cli_limits: $(call obj,$(addprefix core/cli/,terminal.c parallel.c command.c cli_files.c))
$(BUILD)/tests/test_outcome $(BUILD)/tests/test_named_outputs $(BUILD)/tests/slow_derivatives: $(call obj,core/cli/outcome.c core/cli/terminal.c)
# It wraps every call of other libraries that it lists.
$(BUILD)/tests/test_faults: WRAP = $(shell sed -n 's/^FAULT_[A-Z]* .[^,]*, \([A-Za-z_]*\),.*/-Wl,--wrap=\1/p' tests/faults/test_faults.c)
# A part of SUNDIALS that is used for comparison only.
$(BUILD)/tests/test_arkode: WRAP := -Wl,--no-as-needed -lsundials_arkode -Wl,--as-needed

# ---- Running things ----

RUN_TESTS = PINWHEEL=$(PROGRAM) BUILD=$(BUILD) sh .ci/run-tests

test: all $(TESTS) $(PROGRAMS)
	@$(RUN_TESTS) $(TESTS)

test-all: everything
	@$(RUN_TESTS) $(SLOW_TESTS) $(if $(TESTED),,$(TESTS))

demo: all $(BUILD)/benchmarks/demo
	@$(BUILD)/benchmarks/demo
	@mkdir -p $(BUILD)/demo
	@$(PROGRAM) run ezyroller --energy --every 0.02 -o $(BUILD)/demo/ezyroller.csv --json $(BUILD)/demo/ezyroller.json \
	  --plots $(BUILD)/demo
	@echo 'figures and data: $(BUILD)/demo/'

# ---- Installing ----

# Paths may contain spaces: they are quoted everywhere, and never elements of a list.
D    := $(DESTDIR)$(PREFIX)
MAN  := docs/pinwheel.1 docs/pinwheel-model.5
DOCS := README.md $(filter-out $(MAN) docs/figures.sh,$(wildcard docs/*.*)) # pages have links to the other files
FIGURES  := $(wildcard docs/figures/*)
EXAMPLES := $(EMBED) $(MODELS) core/kinds/forces/torque.c \
            $(addprefix core/kinds/,batch.h contact.h holonomic/gear.c nonholonomic/rolling_wheel.c)

# Where Python looks for packages below PREFIX: Debian's folder for /usr, otherwise that of the Python version.
PYTHON_SITE = lib/$(if $(filter /usr,$(PREFIX)),python3/dist-packages,$(shell python3 -c 'import sys; print("python%d.%d" % sys.version_info[:2])')/site-packages)

define PKGCONFIG
prefix=$(PREFIX)
includedir=$${prefix}/include
libdir=$${prefix}/lib
modelsdir=$${libdir}/pinwheel/models

Name: pinwheel
Description: planar multibody systems with pin joints and knife-edge wheels
Version: $(VERSION)
Cflags: -I"$${includedir}/pinwheel" -I"$${includedir}"
Libs: -L"$${libdir}" -lpinwheel-files -lpinwheel
Libs.private: $(FILES_LIBS) $(SOLVER_LIBS) $(STATIC_LIBS)
endef
export PKGCONFIG

# A version that find_package of CMake asks for is met by the same minor version.
define CMAKE_VERSION
set (PACKAGE_VERSION $(VERSION))
set (PACKAGE_VERSION_COMPATIBLE FALSE)
if (PACKAGE_FIND_VERSION VERSION_LESS_EQUAL PACKAGE_VERSION AND
    "$(VERSION)" MATCHES "^$${PACKAGE_FIND_VERSION_MAJOR}[.]$${PACKAGE_FIND_VERSION_MINOR}[.]")
  set (PACKAGE_VERSION_COMPATIBLE TRUE)
endif ()
endef
export CMAKE_VERSION

share := share/doc/pinwheel

install: all
	install -d "$(D)/bin" "$(D)/lib/pinwheel/models" "$(D)/lib/pkgconfig" "$(D)/lib/cmake/pinwheel" "$(D)/include/pinwheel" "$(D)/share/man/man1" \
	  "$(D)/share/man/man5" "$(D)/share/bash-completion/completions" "$(D)/share/zsh/site-functions" "$(D)/$(share)/docs/figures" "$(D)/$(share)/examples"
	install $(PROGRAM) "$(D)/bin"
	for l in libpinwheel libpinwheel-files; do \
	  install $(BUILD)/$$l.so.$(ABI) "$(D)/lib" && ln -sf $$l.so.$(ABI) "$(D)/lib/$$l.so" && \
	  install -m 644 $(BUILD)/$$l.a "$(D)/lib" || exit 1; done
	install -m 644 $(HEADERS) "$(D)/include/pinwheel"
	install -m 644 $(PLUGINS) "$(D)/lib/pinwheel/models"
	for f in $(PAGE); do install -Dm 644 $$f "$(D)/lib/pinwheel/page/$${f##*/}" || exit 1; done
	if command -v python3 >/dev/null; then install -d "$(D)/$(PYTHON_SITE)/pinwheel" && \
	  install -m 644 core/python/pinwheel/*.py core/python/pinwheel/py.typed "$(D)/$(PYTHON_SITE)/pinwheel"; fi
	install -m 644 core/cli/completion.bash "$(D)/share/bash-completion/completions/pinwheel"
	printf '#compdef pinwheel\nautoload -U +X bashcompinit && bashcompinit\nsource %s\n' \
	  "$(PREFIX)/share/bash-completion/completions/pinwheel" >"$(D)/share/zsh/site-functions/_pinwheel"
	for m in $(MAN); do install -m 644 $$m "$(D)/share/man/man$${m##*.}" || exit 1; done
	for c in $$($(PROGRAM) --help | sed -n '/^Commands:/,/^$$/s/^  \([a-z]*\) .*/\1/p'); do \
	  sh core/cli/man.sh $(PROGRAM) $$c >"$(D)/share/man/man1/pinwheel-$$c.1" || exit 1; done
	echo "$$PKGCONFIG" >"$(D)/lib/pkgconfig/pinwheel.pc"
	install -m 644 core/pinwheel-config.cmake "$(D)/lib/cmake/pinwheel"
	echo "$$CMAKE_VERSION" >"$(D)/lib/cmake/pinwheel/pinwheel-config-version.cmake"
	install -m 644 README.md "$(D)/$(share)"
	install -m 644 $(filter docs/%,$(DOCS)) "$(D)/$(share)/docs"
	install -m 644 $(FIGURES) "$(D)/$(share)/docs/figures"
	install -m 644 $(EXAMPLES) "$(D)/$(share)/examples"

# Removes what install has installed, and directories that only Pinwheel uses, if they are empty.
uninstall:
	[ ! -d "$(D)" ] || { cd "$(D)" && rm -rf $(PYTHON_SITE)/pinwheel && rm -f bin/pinwheel share/bash-completion/completions/pinwheel share/zsh/site-functions/_pinwheel \
	  lib/libpinwheel.* lib/libpinwheel-files.* lib/pkgconfig/pinwheel.pc lib/cmake/pinwheel/pinwheel-config*.cmake \
	  $(addprefix include/pinwheel/,$(notdir $(HEADERS))) $(addprefix lib/pinwheel/models/,$(notdir $(PLUGINS))) $(addprefix lib/pinwheel/page/,$(notdir $(PAGE))) \
	  share/man/man1/pinwheel-*.1 $(foreach m,$(MAN),share/man/man$(subst .,,$(suffix $(m)))/$(notdir $(m))) \
	  $(addprefix $(share)/,$(DOCS) $(FIGURES)) $(addprefix $(share)/examples/,$(notdir $(EXAMPLES))) && \
	  { rmdir include/pinwheel lib/cmake/pinwheel lib/cmake lib/pinwheel/models lib/pinwheel/page lib/pinwheel $(share)/docs/figures $(share)/docs $(share)/examples \
	    $(share) 2>/dev/null || true; }; }

clean:
	rm -rf $(BUILD)

include .ci/page.mk .ci/dev.mk
