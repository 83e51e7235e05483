# Interactive pages: their engine in WebAssembly, and the pages of all models.  Included by the Makefile.

.PHONY: gallery

gallery: all
	@sh core/cli/page/gallery.sh $(PROGRAM) models docs/figures $(BUILD)/site

# Only if the tools to compile it are installed; builds in $(BUILD)/variant do not need it.
WASM_CC   ?= $(if $(findstring ccache,$(CC)),ccache )clang
WASI      := $(if $(findstring /variant/,$(BUILD)),,$(and $(wildcard /usr/include/wasm32-wasi/stdio.h),$(wildcard /usr/lib/llvm-*/lib/clang/*/lib/wasi/libclang_rt.builtins-wasm32.a)))
PAGE      := $(if $(and $(WASI),$(shell command -v $(lastword $(WASM_CC))),$(shell command -v wasm-ld)),$(addprefix $(BUILD)/page/,pinwheel-page.objects pinwheel.wasm.gz))

all: $(PAGE)

# The engine in WebAssembly: all that methods need which do not call SUNDIALS, without libraries.
WASM_FLAGS := --target=wasm32-wasi -std=c11 -O2 -ffp-contract=off -ffunction-sections -fdata-sections \
  -D_POSIX_C_SOURCE=200809L -D_WASI_EMULATED_SIGNAL -include core/cli/page/engine/wasi.h '-DPW_METHODS=PW_METHOD (rk4) PW_METHOD (erk5) PW_METHOD (erk8) PW_METHOD (radau) PW_METHOD (galpha) PW_METHOD (leapfrog) PW_METHOD (moreau)' \
  $(ALL) -iquote $(BUILD)/obj/core/cli/plot $(SYSTEM)
WASM       := $(filter-out solvers/matrices/sparse.c solvers/run/ensemble.c solvers/analysis/% solvers/sundials/%,$(CORE) $(SOLVERS)) \
  $(addprefix core/files/,parser.c evaluation.c range.c yaml.c yaml_read.c yaml_signal.c yaml_include.c yaml_text.c number.c json.c columns.c svg.c) $(addprefix core/cli/,plot/plot_samples.c plot/plot_shapes.c plot/animate.c) \
  core/cli/page/engine/page_engine.c
WASM_OBJ   := $(WASM:%.c=$(BUILD)/wasm/%.o)

$(BUILD)/wasm/%.o: %.c $(BUILD)/obj/core/cli/plot/animate.inc $(BUILD)/obj/core/specialise/source_texts.inc | $(FIRST)
	@mkdir -p $(@D)
	$(call say,WASM)
	$(Q)$(WASM_CC) $(WASM_FLAGS) -MMD -MP -c $< -o $@
$(BUILD)/wasm/core/specialise/%.o: WASM_FLAGS += -iquote $(BUILD)/obj/core/specialise
# A page has at most 1 MB: only what a step calls is compiled for speed.
$(BUILD)/wasm/core/files/%.o $(BUILD)/wasm/core/cli/%.o $(BUILD)/wasm/core/selftest/%.o $(BUILD)/wasm/core/specialise/%.o: WASM_FLAGS += -Oz
-include $(WASM_OBJ:.o=.d)

$(BUILD)/page/pinwheel-page.objects: $(WASM_OBJ)
	@mkdir -p $(@D)
	@rm -f $@
	$(Q)$(AR) rcs $@ $^
# Missing functions are errors, except those in undefined.txt, which pages never call.
$(BUILD)/wasm/pinwheel.wasm: $(BUILD)/page/pinwheel-page.objects core/cli/page/engine/undefined.txt
	$(Q)$(WASM_CC) $(WASM_FLAGS) -mexec-model=reactor -Wl,--gc-sections,--allow-undefined-file=core/cli/page/engine/undefined.txt,--strip-all,-z,stack-size=1048576,--whole-archive $< -Wl,--no-whole-archive -o $@
$(BUILD)/page/pinwheel.wasm.gz: $(BUILD)/wasm/pinwheel.wasm
	$(Q)gzip -9nc $< > $@
