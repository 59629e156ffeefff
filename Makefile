# SPDX-License-Identifier: Apache-2.0
# Every target installs what it needs first (Debian packages, cmake/setup.sh).
BUILD := build
FORMATTED = $(shell git ls-files '*.c' '*.h')

.PHONY: all demo test bench curve rivals cost evaluate gallery docs format install clean setup-% configure

all: setup-build configure
	@cmake --build $(BUILD) --target riffle riffle_static riffle_shared

configure:
	@mkdir -p $(BUILD)
	@cmake --preset release -B $(BUILD) $(CONFIGURE) >$(BUILD)/configure.log 2>&1 || { cat $(BUILD)/configure.log; exit 1; }

# Frames, videos and a contact sheet from built-in inputs, in build/demo.
demo: setup-demo configure
	@cmake --build $(BUILD) --target riffle contact_sheet
	@bash cmake/demo.sh $(BUILD)

# Ends with "N passed, N failed, N skipped".
test: CONFIGURE = -DRIFFLE_REQUIRE_TESTS=ON
test: setup-test configure
	@cmake --build $(BUILD)
	@bash cmake/run_tests.sh $(BUILD)

bench: setup-test configure
	@cmake --build $(BUILD)
	@bash cmake/run_benches.sh $(BUILD)

# The curve of docs/lagrangian.md: a line a setting and exemplar.
curve: setup-test configure
	@cmake --build $(BUILD) --target bench_quality
	@bash bench/curve.sh $(BUILD)/bench_quality

# The same for the rivals' own parameters.
rivals: setup-test configure
	@cmake --build $(BUILD) --target bench_quality
	@bash bench/rivals.sh $(BUILD)/bench_quality

# What a still costs by its size: renews the plot of docs/optimize.md. A minute, on a machine that does nothing else.
cost: setup-build configure
	@cmake --build $(BUILD) --target bench_cost
	@mkdir -p docs/optimize
	@$(BUILD)/bench_cost plot=docs/optimize/cost.svg

# Every method on every pair of flow and exemplar, judged: renews the tables and pictures of docs/evaluation.md. 20 minutes.
evaluate: setup-demo configure
	@cmake --build $(BUILD) --target evaluation_run evaluation_page contact_sheet
	@bash evaluation/evaluate.sh $(BUILD)

# Contact sheets of the real inputs ($$RIFFLE_DATA, else ../shared/data) and the built-in ones, in build/gallery.
# "make gallery DOCS=1" also renews the pictures in docs/gallery, those of free inputs only; SHEETS="NAME..." picks some.
gallery: setup-demo configure
	@cmake --build $(BUILD) --target riffle contact_sheet bench_synth
	@bash cmake/gallery.sh $(BUILD) $(if $(DOCS),--docs) $(SHEETS)

# The tables of options and built-in inputs in docs/, from the program.
docs: setup-build configure
	@cmake --build $(BUILD) --target options
	@bash cmake/doc_tables.sh $(BUILD)/examples/options --write

format: setup-ci
	@clang-format -i $(FORMATTED)

install: all
	@cmake --install $(BUILD) $(if $(PREFIX),--prefix $(PREFIX))

clean:
	@rm -rf $(BUILD)

setup-%:
	@bash cmake/setup.sh $*
