# Pinwheel.  `make help` lists the targets; everything is built in $(BUILD).

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

SOLVER_LIBS := -lsundials_idas -lsundials_cvodes -lsundials_nvecserial -lklu -lamd -llapacke -lm
FILES_LIBS  := -lfyaml -ldl -lm
# What these need if they are linked statically; the Fortran libraries where the compiler has them.
STATIC_LIBS  = -lbtf -lcolamd -lsuitesparseconfig -llapack -lblas $(foreach l,gfortran quadmath,$(if \
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
MODELS  := $(wildcard models/*.c)
QUICK   := $(wildcard tests/*/test_*.c)
SLOW    := $(wildcard tests/*/slow_*.c)
SHELLS  := $(filter-out tests/support/%,$(wildcard tests/*/*.sh))
SHARE   := $(filter-out $(QUICK) $(SLOW) $(wildcard $(addprefix tests/,fuzz/*.c models/*.c scenes/*.c)),$(wildcard tests/*/*.c)) # linked to every test
BENCH   := $(wildcard benchmarks/*.c)
ENGINE  := $(wildcard benchmarks/engine/*.c benchmarks/baseline/*.c)
HARD    := $(wildcard benchmarks/hard/*.c)
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
PLUGINS   := $(MODELS:%.c=$(BUILD)/%.so) $(patsubst %,$(BUILD)/%,$(MODELS) $(wildcard models/*.yaml))
TESTS     := $(patsubst %.c,$(BUILD)/tests/%,$(notdir $(QUICK)))
SLOWS     := $(patsubst %.c,$(BUILD)/tests/%,$(notdir $(SLOW)))
PROGRAMS  := $(BENCH:%.c=$(BUILD)/%) $(EMBED:%.c=$(BUILD)/%)
PROGRAM   := $(BUILD)/pinwheel
# The engine of interactive pages, if the tools to compile it are installed; builds in $(BUILD)/variant do not need it.
WASM_CC   ?= $(if $(findstring ccache,$(CC)),ccache )clang
WASI      := $(if $(findstring /variant/,$(BUILD)),,$(and $(wildcard /usr/include/wasm32-wasi/stdio.h),$(wildcard /usr/lib/llvm-*/lib/clang/*/lib/wasi/libclang_rt.builtins-wasm32.a)))
PAGE      := $(if $(and $(WASI),$(shell command -v $(lastword $(WASM_CC))),$(shell command -v wasm-ld)),$(addprefix $(BUILD)/page/,pinwheel-page.objects pinwheel.wasm))

# Targets of fuzzing; with replay.c they are programs that read files.
FUZZ_SHARE := tests/fuzz/fuzz.c $(if $(FUZZING),,tests/fuzz/replay.c)
FUZZ       := $(filter-out tests/fuzz/fuzz.c tests/fuzz/replay.c,$(wildcard tests/fuzz/*.c))
FUZZERS    := $(FUZZ:tests/fuzz/%.c=$(BUILD)/fuzz/%)

.PHONY: all everything demo test test-all layers words san tsan valgrind fuzz fuzzers mutants cov clang gcc format format-check bench bench-quick bench-engine \
        bench-effects hard basic figures deps install uninstall clean help
.DELETE_ON_ERROR:
.SECONDARY:

all: $(LIB) $(FILES_LIB) $(LIB:.so=.a) $(FILES_LIB:.so=.a) $(INCLUDES) $(PLUGINS) $(PROGRAM) $(PAGE)

everything: all $(TESTS) $(SLOWS) $(PROGRAMS) $(FUZZERS)

help:
	@echo 'make                  the libraries, the program and the models, in $(BUILD)/; everything: also tests and benchmarks'
	@echo 'make deps             installs the libraries that are missing'
	@echo 'make demo             the EzyRoller by three methods: a table, figures in $(BUILD)/demo/'
	@echo 'make gallery          pages that simulate the models in a browser, in $(BUILD)/site/'
	@echo 'make figures          all figures of README and docs, into docs/figures/'
	@echo 'make test             runs the tests; test-all: also the slow ones and scripts'
	@echo 'make bench            all measurements, and docs/benchmarks.md; continues where it was stopped'
	@echo 'make bench-quick      the processor time of runs on this machine'
	@echo 'make bench-engine     the time of an evaluation and a step, compared with programs written by hand; growth with size'
	@echo 'make bench-effects    instructions per evaluation with one further effect at a time; unused element types cost none'
	@echo 'make hard             every method on every hard case, against the expected verdicts; writes docs/hard-cases.md'
	@echo 'make layers           checks the dependencies between directories; words: the terms in names and text'
	@echo 'make san              the tests with ASan and UBSan; clang, gcc: compiles everything, warnings are errors'
	@echo 'make fuzz TIME=60     fuzzes models, expressions, tables, checkpoints and command lines, TIME seconds each'
	@echo 'make mutants TIME=7200   changes the sources in one place at a time; lists changes that no test detects; resumes'
	@echo 'make cov              lines that the tests run, and those that they do not'
	@echo 'make tsan             runs in many threads with ThreadSanitizer; valgrind: some tests with memcheck'
	@echo 'make format           formats all sources by clang-format; format-check: lists those that are not'
	@echo 'make deb              a Debian package, in $(BUILD)/deb/'
	@echo 'make install          installs below DESTDIR in PREFIX (/usr/local); uninstall: removes that'
	@echo 'make clean            removes $(BUILD)/'
	@echo
	@echo 'CC CFLAGS CPPFLAGS LDFLAGS BUILD as usual; WERROR=1; V=1 shows the commands;'
	@echo 'NO_DEPS=1 installs nothing (otherwise demo, test and others begin with deps)'

# ---- Dependencies: targets that run something install missing libraries first ----

ifneq ($(filter demo test test-all layers bench bench-quick bench-engine bench-effects hard san cov fuzz mutants,$(MAKECMDGOALS)),)
ifndef NO_DEPS
FIRST := deps
endif
endif

deps:
	@CC='$(CC)' CPPFLAGS='$(CPPFLAGS) $(SYSTEM)' LDFLAGS='$(LDFLAGS)' BUILD='$(BUILD)' NO_DEPS='$(NO_DEPS)' \
	  sh .ci/deps.sh $(if $(filter deps,$(MAKECMDGOALS)),fresh) $(TOOLS)

# ---- Objects; .ci/layers checks which folder includes what (-iquote: core/system/signal.h is not <signal.h>) ----

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
$(call obj,core/cli/parallel.c core/cli/run/sweep.c $(addprefix core/cli/analyse/,fit.c optimise.c)) $(BUILD)/pinwheel: private THREADS = -pthread
# Functions of tests that replace those of other libraries must be visible to these.
$(BUILD)/obj/tests/%.o:      STRICT += -fvisibility=default
$(BUILD)/obj/tests/%.o:      INCLUDE = $(addprefix -iquote tests/,support faults solvers) $(ALL) $(SYSTEM)
$(BUILD)/obj/tests/fuzz/%.o: INCLUDE = -iquote tests/fuzz -iquote core/cli $(ALL) $(SYSTEM)
$(BUILD)/obj/benchmarks/%.o $(BUILD)/obj/docs/%.o: INCLUDE = -I$(BUILD)/include
$(BUILD)/obj/benchmarks/engine.o $(addprefix $(BUILD)/obj/benchmarks/,effects.o peers.o) $(BUILD)/obj/benchmarks/engine/%.o $(BUILD)/obj/benchmarks/baseline/%.o: INCLUDE = $(ALL) -iquote benchmarks $(SYSTEM)
$(BUILD)/models/%.so:        INCLUDE = -I$(BUILD)/include

$(BUILD)/obj/%.o: %.c | $(FIRST)
	@mkdir -p $(@D)
	$(call say,CC)
	$(Q)$(CC) $(PW_CFLAGS) -MMD -MP -c $< -o $@

$(call obj,$(BENCH) $(HARD) $(EMBED)): | $(INCLUDES)

-include $(patsubst %.o,%.d,$(call obj,$(CORE) $(SOLVERS) $(FILES) $(CLI) $(QUICK) $(SLOW) $(SHARE) $(FUZZ) $(FUZZ_SHARE) $(BENCH) $(ENGINE) $(HARD) $(EMBED)))
-include $(MODELS:%.c=$(BUILD)/obj/%.d)

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

# The engine of interactive pages, in WebAssembly: all that rk4, erk5 and erk8 need, without libraries.
WASM_FLAGS := --target=wasm32-wasi -std=c11 -O2 -ffp-contract=off -ffunction-sections -fdata-sections \
  -D_POSIX_C_SOURCE=200809L -D_WASI_EMULATED_SIGNAL -include core/cli/page/engine/wasi.h '-DPW_METHODS=PW_METHOD (rk4) PW_METHOD (erk5) PW_METHOD (erk8)' \
  $(ALL) -iquote $(BUILD)/obj/core/cli/plot $(SYSTEM)
WASM       := $(filter-out solvers/matrices/sparse.c solvers/analysis/% solvers/implicit/% solvers/sundials/% core/specialise/specialise_%,$(CORE) $(SOLVERS)) \
  $(addprefix core/files/,parser.c evaluation.c range.c yaml.c yaml_read.c yaml_expression.c number.c read.c json.c columns.c) $(addprefix core/cli/plot/,plot_samples.c plot_shapes.c animate.c) \
  core/cli/page/engine/page_engine.c
WASM_OBJ   := $(WASM:%.c=$(BUILD)/wasm/%.o)

$(BUILD)/wasm/%.o: %.c $(BUILD)/obj/core/cli/plot/animate.inc $(BUILD)/obj/core/specialise/source_texts.inc | $(FIRST)
	@mkdir -p $(@D)
	$(call say,WASM)
	$(Q)$(WASM_CC) $(WASM_FLAGS) -MMD -MP -c $< -o $@
$(BUILD)/wasm/core/specialise/%.o: WASM_FLAGS += -iquote $(BUILD)/obj/core/specialise
-include $(WASM_OBJ:.o=.d)

$(BUILD)/page/pinwheel-page.objects: $(WASM_OBJ)
	@mkdir -p $(@D)
	@rm -f $@
	$(Q)$(AR) rcs $@ $^
# Missing functions are errors, except those in undefined.txt, which pages never call.
$(BUILD)/page/pinwheel.wasm: $(BUILD)/page/pinwheel-page.objects core/cli/page/engine/undefined.txt
	$(Q)$(WASM_CC) $(WASM_FLAGS) -mexec-model=reactor -Wl,--gc-sections,--allow-undefined-file=core/cli/page/engine/undefined.txt,--strip-all,-z,stack-size=1048576,--whole-archive $< -Wl,--no-whole-archive -o $@

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

# A plug-in links to nothing: it finds Pinwheel in the program that opens it.
$(BUILD)/models/%.so: models/%.c | $(INCLUDES) $(FIRST)
	@mkdir -p $(@D) $(BUILD)/obj/models
	$(call say,PLUGIN)
	$(Q)$(CC) $(STRICT) $(INCLUDE) $(CPPFLAGS) $(CFLAGS) $(SAN) $(LDFLAGS) -Wl,--as-needed -shared \
	  -MMD -MP -MF $(BUILD)/obj/models/$*.d -o $@ $< -lm

# A link: $(BUILD)/pinwheel searches models/, too, and a file found twice counts once.  It is relative, so that the tree can be
# copied.  A plug-in of the same name, from when the model was written in C, is removed.
TO_SOURCE = ln -sfr $< $@ 2>/dev/null || ln -sf "$(CURDIR)/$<" $@
$(BUILD)/models/%.yaml: models/%.yaml
	@mkdir -p $(@D) && rm -f $(@:.yaml=.so) $(@:.yaml=.c)
	@$(TO_SOURCE)
$(BUILD)/models/%.c: models/%.c
	@mkdir -p $(@D)
	@$(TO_SOURCE)

OWN_LIBS = -L$(BUILD) -lpinwheel-files -lpinwheel

$(PROGRAM): $(CLI_OBJ) $(BASE_OBJ) $(LIB) $(FILES_LIB)
	$(call say,LINK)
	$(Q)$(LINK) $(THREADS) -Wl,-rpath,'$$ORIGIN:$$ORIGIN/../lib' -o $@ $(CLI_OBJ) $(BASE_OBJ) $(OWN_LIBS) $(CLI_LIBS) -lm

# Benchmarks that call internal functions contain the whole libraries, as tests do.
WHOLE := -Wl,--whole-archive $(FILES_LIB:.so=.a) $(LIB:.so=.a) -Wl,--no-whole-archive $(FILES_LIBS) $(SOLVER_LIBS)
INSIDE := $(addprefix $(BUILD)/benchmarks/,engine peers)
$(INSIDE): OWN_LIBS = -rdynamic $(WHOLE)
$(INSIDE): $(FILES_LIB:.so=.a) $(LIB:.so=.a)

$(PROGRAMS): $(BUILD)/%: $(BUILD)/obj/%.o $(LIB) $(FILES_LIB)
	@mkdir -p $(@D)
	$(call say,LINK)
	$(Q)$(LINK) -Wl,-rpath,'$$ORIGIN/..' -o $@ $(filter %.o,$^) $(OWN_LIBS) $(EXTRA_LIBS) -lm

$(BUILD)/benchmarks/engine: $(call obj,$(ENGINE))
$(INSIDE): EXTRA_LIBS := $(SOLVER_LIBS) $(addprefix -lsundials_,sunlinsolklu sunmatrixsparse sunlinsoldense sunmatrixdense)
$(BUILD)/benchmarks/peers: $(call obj,$(wildcard benchmarks/baseline/*.c) $(addprefix benchmarks/engine/,scenes.c count.c ladder.c by_hand.c))
$(BUILD)/benchmarks/effects: $(call obj,benchmarks/engine/count.c)
$(BUILD)/benchmarks/hard: $(call obj,$(HARD))
$(BUILD)/benchmarks/hard: EXTRA_LIBS := -lfyaml

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
$(BUILD)/tests/test_cli_limits: $(call obj,$(addprefix core/cli/,terminal.c parallel.c command.c))
$(BUILD)/tests/test_outcome $(BUILD)/tests/slow_derivatives: $(call obj,core/cli/analyse/outcome.c core/cli/terminal.c)
# It wraps every call of other libraries that it lists.
$(BUILD)/tests/test_faults: WRAP = $(shell sed -n 's/^FAULT_[A-Z]* .[^,]*, \([A-Za-z_]*\),.*/-Wl,--wrap=\1/p' tests/faults/test_faults.c)
# A part of SUNDIALS that is used for comparison only.
$(BUILD)/tests/test_arkode: WRAP := -Wl,--no-as-needed -lsundials_arkode -Wl,--as-needed

# A target contains the commands of the program, without its main.
$(FUZZERS): $(BUILD)/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(call obj,$(FUZZ_SHARE)) $(filter-out %/main.o,$(CLI_OBJ)) $(FILES_LIB:.so=.a) $(LIB:.so=.a)
	@mkdir -p $(@D)
	$(call say,LINK)
	$(Q)$(LINK) -pthread -rdynamic -o $@ $(filter %.o,$^) -Wl,--whole-archive $(filter %.a,$^) -Wl,--no-whole-archive \
	  $(FILES_LIBS) $(SOLVER_LIBS) $(CLI_LIBS)

# ---- Running things ----

RUN_TESTS = PINWHEEL=$(PROGRAM) BUILD=$(BUILD) sh .ci/run-tests

test: all $(TESTS) $(PROGRAMS)
	@$(RUN_TESTS) $(TESTS)

test-all: everything
	@$(RUN_TESTS) $(SHELLS) $(SLOWS) $(TESTS)

demo: all $(BUILD)/benchmarks/demo
	@$(BUILD)/benchmarks/demo
	@mkdir -p $(BUILD)/demo
	@$(PROGRAM) run ezyroller --energy --every 0.02 -o $(BUILD)/demo/ezyroller.csv --json $(BUILD)/demo/ezyroller.json \
	  --plots $(BUILD)/demo
	@echo 'figures and data: $(BUILD)/demo/'

figures: all
	@sh docs/figures.sh $(PROGRAM)

gallery: all
	@sh core/cli/page/gallery.sh $(PROGRAM) models $(BUILD)/site

bench: all basic $(addprefix $(BUILD)/benchmarks/,peers engine effects)
	@sh benchmarks/suite.sh $(BUILD)

bench-quick: all $(BUILD)/benchmarks/quick
	@$(BUILD)/benchmarks/quick

bench-engine: all $(BUILD)/benchmarks/engine
	@$(BUILD)/benchmarks/engine && sh benchmarks/report.sh

bench-effects: all basic $(BUILD)/benchmarks/effects
	@$(BUILD)/benchmarks/effects $(BASIC)

hard: all $(BUILD)/benchmarks/hard
	@$(BUILD)/benchmarks/hard -o docs/hard-cases benchmarks/hard

words:
	@sh .ci/words

layers: all
	@BUILD=$(BUILD) sh .ci/layers

# Further builds, in folders so deep that their programs do not find $(BUILD)/models.
VARIANT := $(BUILD)/variant

san:
	@$(MAKE) --no-print-directory NO_DEPS=1 BUILD=$(VARIANT)/san CFLAGS='-O1 -g' test \
	  SAN='-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
san: $(FIRST)

# clang's libFuzzer, TIME seconds for each target; inputs that reach new code go to the corpus in $(VARIANT)/fuzz, those that
# make a target fail to $(VARIANT)/fuzz/found.
TIME ?= 60
fuzz:
	@$(MAKE) --no-print-directory NO_DEPS=1 CC=clang FUZZING=1 BUILD=$(VARIANT)/fuzz CFLAGS='-O1 -g' \
	  SAN='-fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=undefined' fuzzers
	@mkdir -p $(VARIANT)/fuzz/found
	@for t in $(notdir $(FUZZERS)); do echo "$$t: $(TIME) s"; mkdir -p $(VARIANT)/fuzz/corpus/$$t; \
	  TMPDIR=$$([ -d /dev/shm ] && echo /dev/shm || echo /tmp) $(VARIANT)/fuzz/fuzz/$$t -max_total_time=$(TIME) -timeout=25 \
	    -rss_limit_mb=4000 -max_len=4096 -dict=tests/fuzz/words.dict -print_final_stats=1 -verbosity=0 \
	    -artifact_prefix="$$(cd $(VARIANT)/fuzz/found && pwd)/$$t-" $(VARIANT)/fuzz/corpus/$$t tests/fuzz/corpus/$$t \
	    $$([ $$t = model ] && echo models tests/models tests/bad-models) 2>$(VARIANT)/fuzz/$$t.log || \
	    { tail -n 40 $(VARIANT)/fuzz/$$t.log; exit 1; }; grep -h 'number_of_executed' $(VARIANT)/fuzz/$$t.log; done
fuzz: $(FIRST)

fuzzers: LDFLAGS += -fsanitize=fuzzer
fuzzers: $(FUZZERS)

# TIME: the seconds after which it stops, 7200 by default.
mutants: $(FIRST)
	@mkdir -p $(VARIANT)/mutants
	@python3 tests/mutants/run.py $(if $(filter command line,$(origin TIME)),--time $(TIME)) $(if $(ONLY),--only '$(ONLY)') $(VARIANT)/mutants

# Lines of core/ and solvers/ that tests run; earlier counts are deleted first.
cov:
	@mkdir -p $(VARIANT)/cov && find $(VARIANT)/cov -name '*.gcda' -delete
	@$(MAKE) --no-print-directory NO_DEPS=1 CC=gcc BUILD=$(VARIANT)/cov CFLAGS='-O1 -g' SAN='--coverage -fprofile-update=atomic' test-all || echo 'some tests fail in this build, layers among them'
	@sh .ci/coverage $(VARIANT)/cov 95
cov: $(FIRST)

# Runs of many systems in many threads.
tsan:
	@$(MAKE) --no-print-directory NO_DEPS=1 BUILD=$(VARIANT)/tsan CFLAGS='-O1 -g' SAN=-fsanitize=thread \
	  all $(THREADED:%=$(VARIANT)/tsan/tests/%)
	@BUILD=$(VARIANT)/tsan PINWHEEL=$(VARIANT)/tsan/pinwheel sh .ci/run-tests $(THREADED:%=$(VARIANT)/tsan/tests/%)

THREADED := test_determinism

# Tests that together run most of the code, and that memcheck does not slow down too much.
MEMCHECK := checkpoint description faults gear locale messages redundant store yaml
valgrind: all $(MEMCHECK:%=$(BUILD)/tests/test_%)
	@RUNNER='valgrind -q --error-exitcode=99 --leak-check=full --errors-for-leak-kinds=definite' $(RUN_TESTS) \
	  $(MEMCHECK:%=$(BUILD)/tests/test_%)

tsan valgrind: $(FIRST)

clang:
	@$(MAKE) --no-print-directory CC=clang WERROR=1 BUILD=$(VARIANT)/clang everything

gcc:
	@$(MAKE) --no-print-directory CC=gcc WERROR=1 BUILD=$(VARIANT)/gcc everything

# A library with few element types, for bench-effects: a copy of the sources with a shorter list.
BASIC       := $(VARIANT)/basic
BASIC_KINDS := pin wheel torque
BASIC_COPY   = $(filter-out core/kinds/%.c core/pinwheel.h $(FILES) $(CLI) $(wildcard core/files/*.h core/cli/*.h), \
                 $(wildcard core/*.h core/*/*.[ch] solvers/*.h solvers/*/*.[ch])) $(wildcard $(BASIC_KINDS:%=core/kinds/*/%.c))

basic:
	@mkdir -p $(addprefix $(BASIC)/source/,$(sort $(dir $(BASIC_COPY))))
	@find $(BASIC)/source -name '*.[ch]' ! -name pinwheel.h -delete
	@for f in $(BASIC_COPY); do cp -p $$f $(BASIC)/source/$$f || exit 1; done
	@sed $(foreach k,$(BASIC_KINDS),-e '/PW_KIND ($(k))/b') -e '/^ *PW_KIND (.*)/d' core/pinwheel.h >$(BASIC)/pinwheel.h
	@cmp -s $(BASIC)/pinwheel.h $(BASIC)/source/core/pinwheel.h || cp $(BASIC)/pinwheel.h $(BASIC)/source/core
	@$(MAKE) -s --no-print-directory -C $(BASIC)/source -f '$(CURDIR)/Makefile' NO_DEPS=1 BUILD=.. ../libpinwheel.so

SOURCES := $(foreach d,core solvers models tests benchmarks docs,$(wildcard $(addprefix $(d)/,*.[ch] */*.[ch] */*/*.[ch])))

format:
	clang-format -i $(SOURCES)

format-check:
	@bad=0; for f in $(SOURCES); do \
	  clang-format "$$f" | cmp -s - "$$f" || { echo "not formatted: $$f"; bad=1; }; \
	  LC_ALL=C.UTF-8 grep -HnE '^.{121,}' "$$f" && bad=1; done; exit $$bad

# ---- Installing ----

# Paths may contain spaces: they are quoted everywhere, and never elements of a list.
D    := $(DESTDIR)$(PREFIX)
MAN  := docs/pinwheel.1 docs/pinwheel-model.5
DOCS := README.md $(filter-out $(MAN) docs/figures.sh,$(wildcard docs/*.*)) # pages have links to the other files
FIGURES  := $(wildcard docs/figures/*)
EXAMPLES := $(EMBED) $(wildcard models/*.c) core/kinds/forces/torque.c \
            $(addprefix core/kinds/,batch.h contact.h holonomic/gear.c nonholonomic/rolling_wheel.c)

# Where Python looks for packages below PREFIX: Debian's folder for /usr, otherwise that of the Python version.
PYTHON_SITE = lib/$(if $(filter /usr,$(PREFIX)),python3/dist-packages,$(shell python3 -c 'import sys; print("python%d.%d" % sys.version_info[:2])')/site-packages)

define PKGCONFIG
prefix=$(PREFIX)
includedir=$${prefix}/include/pinwheel
libdir=$${prefix}/lib
modelsdir=$${libdir}/pinwheel/models

Name: pinwheel
Description: planar multibody systems with pin joints and knife-edge wheels
Version: $(VERSION)
Cflags: -I"$${includedir}"
Libs: -L"$${libdir}" -lpinwheel-files -lpinwheel
Libs.private: $(FILES_LIBS) $(SOLVER_LIBS) $(STATIC_LIBS)
endef
export PKGCONFIG

share := share/doc/pinwheel

install: all
	install -d "$(D)/bin" "$(D)/lib/pinwheel/models" "$(D)/lib/pkgconfig" "$(D)/include/pinwheel" "$(D)/share/man/man1" \
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
	install -m 644 README.md "$(D)/$(share)"
	install -m 644 $(filter docs/%,$(DOCS)) "$(D)/$(share)/docs"
	install -m 644 $(FIGURES) "$(D)/$(share)/docs/figures"
	install -m 644 $(EXAMPLES) "$(D)/$(share)/examples"

# A Debian package, in $(BUILD)/deb/.
deb:
	@rm -rf $(BUILD)/deb
	@mkdir -p $(BUILD)/deb/pinwheel
	@git ls-files | xargs cp --parents -t $(BUILD)/deb/pinwheel
	@cp -r .ci/debian $(BUILD)/deb/pinwheel
	@printf 'pinwheel (%s) unstable; urgency=medium\n\n  * Version %s.\n\n -- The Pinwheel authors <pinwheel@example.org>  %s\n' \
	  $(VERSION) $(VERSION) "$$(date -R)" >$(BUILD)/deb/pinwheel/debian/changelog
	@cd $(BUILD)/deb/pinwheel && dpkg-buildpackage -b -uc -us

# Removes what install has installed, and directories that only Pinwheel uses, if they are empty.
uninstall:
	[ ! -d "$(D)" ] || { cd "$(D)" && rm -rf $(PYTHON_SITE)/pinwheel && rm -f bin/pinwheel share/bash-completion/completions/pinwheel share/zsh/site-functions/_pinwheel \
	  lib/libpinwheel.* lib/libpinwheel-files.* lib/pkgconfig/pinwheel.pc \
	  $(addprefix include/pinwheel/,$(notdir $(HEADERS))) $(addprefix lib/pinwheel/models/,$(notdir $(PLUGINS))) $(addprefix lib/pinwheel/page/,$(notdir $(PAGE))) \
	  share/man/man1/pinwheel-*.1 $(foreach m,$(MAN),share/man/man$(subst .,,$(suffix $(m)))/$(notdir $(m))) \
	  $(addprefix $(share)/,$(DOCS) $(FIGURES)) $(addprefix $(share)/examples/,$(notdir $(EXAMPLES))) && \
	  { rmdir include/pinwheel lib/pinwheel/models lib/pinwheel/page lib/pinwheel $(share)/docs/figures $(share)/docs $(share)/examples \
	    $(share) 2>/dev/null || true; }; }

clean:
	rm -rf $(BUILD)
