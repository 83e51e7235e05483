# What developers need: checks, further builds, fuzzing, benchmarks, packages.  Included by the Makefile.

.PHONY: layers words san tsan valgrind fuzz fuzzers mutants cov clang gcc format format-check bench bench-check bench-quick bench-engine \
        bench-effects hard basic figures options deb

help::
	@echo
	@echo 'For developers:'
	@echo 'make figures          all figures of README and docs, into docs/figures/'
	@echo 'make options          the tables of options in docs, from --help'
	@echo 'make bench            all measurements, and docs/benchmarks.md; continues where it was stopped'
	@echo 'make bench-check      instructions per step against benchmarks/steps.txt; names those that grew by more than 3 %'
	@echo 'make bench-quick      the processor time of runs on this machine'
	@echo 'make bench-engine     the time of an evaluation and a step, compared with programs written by hand; growth with size'
	@echo 'make bench-effects    instructions per evaluation with one further effect at a time; unused element types cost none'
	@echo 'make hard             every method on every hard case, against the expected verdicts; writes docs/hard-cases.md and .csv'
	@echo 'make layers           checks the dependencies between directories, and that every mutant applies; words: the terms in names and text'
	@echo 'make san              the tests with ASan and UBSan; clang, gcc: compiles everything, warnings are errors'
	@echo 'make fuzz TIME=60     fuzzes models, expressions, tables, checkpoints and command lines, TIME seconds each'
	@echo 'make mutants TIME=7200   changes the sources in one place at a time; lists changes that no test detects; resumes'
	@echo 'make cov              lines that the tests run, and those that they do not'
	@echo 'make tsan             runs in many threads with ThreadSanitizer; valgrind: some tests with memcheck'
	@echo 'make format           formats all sources by clang-format; format-check: lists those that are not'
	@echo 'make deb              a Debian package, in $(BUILD)/deb/'

# Further builds, in folders so deep that their programs do not find $(BUILD)/models.
VARIANT := $(BUILD)/variant

# ---- Checks ----

words:
	@sh .ci/words

layers: all
	@BUILD=$(BUILD) sh .ci/layers

options: all
	@for page in $$(grep -l '^<!-- options of ' docs/*.md); do \
	  sh core/cli/options.sh $(PROGRAM) $$page >$(BUILD)/options && cp $(BUILD)/options $$page; done

SOURCES := $(foreach d,core solvers models tests benchmarks docs,$(wildcard $(addprefix $(d)/,*.[ch] */*.[ch] */*/*.[ch] */*/*/*.[ch])))

format:
	clang-format -i $(SOURCES)

format-check:
	@bad=0; clang-format --dry-run -Werror $(SOURCES) || bad=1; \
	  ! LC_ALL=C.UTF-8 grep -HnE '^.{121,}' $(SOURCES) || bad=1; exit $$bad

# Without optimisation, which clang's warnings do not depend on, in half the time.
clang:
	@$(MAKE) --no-print-directory CC=clang CFLAGS=-O0 WERROR=1 BUILD=$(VARIANT)/clang everything

gcc:
	@$(MAKE) --no-print-directory CC=gcc WERROR=1 BUILD=$(VARIANT)/gcc everything

san:
	@$(MAKE) --no-print-directory NO_DEPS=1 BUILD=$(VARIANT)/san CFLAGS='-O1 -g' test \
	  SAN='-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
san: $(FIRST)

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

# Lines of core/ and solvers/ that tests run; earlier counts are deleted first.
cov:
	@mkdir -p $(VARIANT)/cov && find $(VARIANT)/cov -name '*.gcda' -delete
	@$(MAKE) --no-print-directory NO_DEPS=1 CC=gcc BUILD=$(VARIANT)/cov CFLAGS='-O1 -g' SAN='--coverage -fprofile-update=atomic' test-all || echo 'some tests fail in this build, layers among them'
	@sh .ci/coverage $(VARIANT)/cov 95
cov: $(FIRST)

# TIME: the seconds after which it stops, 7200 by default.
mutants: $(FIRST)
	@mkdir -p $(VARIANT)/mutants
	@python3 tests/mutants/run.py $(if $(filter command line,$(origin TIME)),--time $(TIME)) $(if $(ONLY),--only '$(ONLY)') $(VARIANT)/mutants

# ---- Fuzzing ----

# Targets of fuzzing; with replay.c they are programs that read files.
FUZZ_SHARE := tests/fuzz/fuzz.c $(if $(FUZZING),,tests/fuzz/replay.c)
FUZZ       := $(filter-out tests/fuzz/fuzz.c tests/fuzz/replay.c,$(wildcard tests/fuzz/*.c))
FUZZERS    := $(FUZZ:tests/fuzz/%.c=$(BUILD)/fuzz/%)

$(BUILD)/obj/tests/fuzz/%.o: INCLUDE = -iquote tests/fuzz -iquote core/cli $(ALL) $(SYSTEM)
-include $(patsubst %.o,%.d,$(call obj,$(FUZZ) $(FUZZ_SHARE)))

everything: $(FUZZERS)

# A target contains the commands of the program, without its main.
$(FUZZERS): $(BUILD)/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(call obj,$(FUZZ_SHARE)) $(filter-out %/main.o,$(CLI_OBJ)) $(FILES_LIB:.so=.a) $(LIB:.so=.a)
	@mkdir -p $(@D)
	$(call say,LINK)
	$(Q)$(LINK) -pthread -rdynamic -o $@ $(filter %.o,$^) -Wl,--whole-archive $(filter %.a,$^) -Wl,--no-whole-archive \
	  $(FILES_LIBS) $(SOLVER_LIBS) $(CLI_LIBS)

# clang's libFuzzer, TIME seconds for each target; inputs that reach new code go to the corpus in $(VARIANT)/fuzz, those that
# make a target fail to $(VARIANT)/fuzz/found.  tests/support/entries.sh adds those to be kept to tests/fuzz/TARGET.txt.
TIME ?= 60
fuzz:
	@$(MAKE) --no-print-directory NO_DEPS=1 CC=clang FUZZING=1 BUILD=$(VARIANT)/fuzz CFLAGS='-O1 -g' \
	  SAN='-fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=undefined' fuzzers
	@mkdir -p $(VARIANT)/fuzz/found && rm -rf $(VARIANT)/fuzz/seeds
	@for set in $(FUZZ:.c=.txt) tests/bad-models.txt; do \
	  sh tests/support/entries.sh unpack $$set $(VARIANT)/fuzz/seeds/$$(basename $$set .txt) || exit 1; done
	@for t in $(notdir $(FUZZERS)); do echo "$$t: $(TIME) s"; mkdir -p $(VARIANT)/fuzz/corpus/$$t; \
	  TMPDIR=$$([ -d /dev/shm ] && echo /dev/shm || echo /tmp) $(VARIANT)/fuzz/fuzz/$$t -max_total_time=$(TIME) -timeout=25 \
	    -rss_limit_mb=4000 -max_len=4096 -dict=tests/fuzz/words.dict -print_final_stats=1 -verbosity=0 \
	    -artifact_prefix="$$(cd $(VARIANT)/fuzz/found && pwd)/$$t-" $(VARIANT)/fuzz/corpus/$$t $(VARIANT)/fuzz/seeds/$$t \
	    $$([ $$t = model ] && echo models tests/models $(VARIANT)/fuzz/seeds/bad-models) 2>$(VARIANT)/fuzz/$$t.log || \
	    { tail -n 40 $(VARIANT)/fuzz/$$t.log; exit 1; }; grep -h 'number_of_executed' $(VARIANT)/fuzz/$$t.log; done
fuzz: $(FIRST)

fuzzers: LDFLAGS += -fsanitize=fuzzer
fuzzers: $(FUZZERS)

# ---- Benchmarks ----

ENGINE  := $(wildcard benchmarks/engine/*.c benchmarks/baseline/*.c)
HARD    := $(wildcard benchmarks/hard/*.c)

$(BUILD)/obj/benchmarks/engine.o $(addprefix $(BUILD)/obj/benchmarks/,effects.o peers.o) $(BUILD)/obj/benchmarks/engine/%.o $(BUILD)/obj/benchmarks/baseline/%.o: INCLUDE = $(ALL) -iquote benchmarks $(SYSTEM)
$(call obj,$(HARD)): | $(INCLUDES)
-include $(patsubst %.o,%.d,$(call obj,$(ENGINE) $(HARD)))

# Benchmarks that call internal functions contain the whole libraries, as tests do.
INSIDE := $(addprefix $(BUILD)/benchmarks/,engine peers)
$(INSIDE): OWN_LIBS = -rdynamic $(WHOLE)
$(INSIDE): $(FILES_LIB:.so=.a) $(LIB:.so=.a)
$(BUILD)/benchmarks/engine: $(call obj,$(ENGINE))
$(INSIDE): EXTRA_LIBS := $(SOLVER_LIBS) $(addprefix -lsundials_,sunlinsolklu sunmatrixsparse sunlinsoldense sunmatrixdense)
$(BUILD)/benchmarks/peers: $(call obj,$(wildcard benchmarks/baseline/*.c) $(addprefix benchmarks/engine/,scenes.c count.c ladder.c by_hand.c))
$(BUILD)/benchmarks/effects: $(call obj,benchmarks/engine/count.c)
$(BUILD)/benchmarks/hard: $(call obj,$(HARD))
$(BUILD)/benchmarks/hard: EXTRA_LIBS := -lfyaml

# A library with few element types, for bench-effects: a copy of the sources with a shorter list.
BASIC       := $(VARIANT)/basic
BASIC_KINDS := pin wheel torque
BASIC_COPY   = $(filter-out core/kinds/%.c core/pinwheel.h $(FILES) $(CLI) $(wildcard core/files/*.h core/cli/*.h), \
                 $(wildcard core/*.h core/*/*.[ch] solvers/*.h solvers/*/*.[ch])) $(wildcard $(BASIC_KINDS:%=core/kinds/*/%.c)) \
                 Makefile .ci/page.mk .ci/dev.mk

basic:
	@mkdir -p $(addprefix $(BASIC)/source/,$(sort $(dir $(BASIC_COPY))))
	@find $(BASIC)/source -name '*.[ch]' ! -name pinwheel.h -delete
	@for f in $(BASIC_COPY); do cp -p $$f $(BASIC)/source/$$f || exit 1; done
	@sed $(foreach k,$(BASIC_KINDS),-e '/PW_KIND ($(k))/b') -e '/^ *PW_KIND (.*)/d' core/pinwheel.h >$(BASIC)/pinwheel.h
	@cmp -s $(BASIC)/pinwheel.h $(BASIC)/source/core/pinwheel.h || cp $(BASIC)/pinwheel.h $(BASIC)/source/core
	@$(MAKE) -s --no-print-directory -C $(BASIC)/source NO_DEPS=1 BUILD=.. ../libpinwheel.so

bench: all basic $(addprefix $(BUILD)/benchmarks/,peers engine effects)
	@sh benchmarks/suite.sh $(BUILD)

# FEW=1: only the rows that .ci/run checks; UPDATE=1: writes the file.
bench-check: all
	@sh benchmarks/check.sh $(PROGRAM) $(if $(FEW),few) $(if $(UPDATE),update)

bench-quick: all $(BUILD)/benchmarks/quick
	@$(BUILD)/benchmarks/quick

bench-engine: all $(BUILD)/benchmarks/engine
	@$(BUILD)/benchmarks/engine && sh benchmarks/report.sh

bench-effects: all basic $(BUILD)/benchmarks/effects
	@$(BUILD)/benchmarks/effects $(BASIC)

hard: all $(BUILD)/benchmarks/hard
	@$(BUILD)/benchmarks/hard -o docs/hard-cases benchmarks/hard

# ---- Figures, a Debian package ----

figures: all
	@sh docs/figures.sh $(PROGRAM)

# A Debian package, in $(BUILD)/deb/.
deb:
	@rm -rf $(BUILD)/deb
	@mkdir -p $(BUILD)/deb/pinwheel
	@git ls-files | xargs cp --parents -t $(BUILD)/deb/pinwheel
	@cp -r .ci/debian $(BUILD)/deb/pinwheel
	@printf 'pinwheel (%s) unstable; urgency=medium\n\n  * Version %s.\n\n -- The Pinwheel authors <pinwheel@example.org>  %s\n' \
	  $(VERSION) $(VERSION) "$$(date -R)" >$(BUILD)/deb/pinwheel/debian/changelog
	@cd $(BUILD)/deb/pinwheel && dpkg-buildpackage -b -uc -us
