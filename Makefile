# Every target sets up what it needs: a virtual environment in .venv, then the project in it.
# `make PYTHON=python3.12 test` chooses the interpreter.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# No window is opened and no display is needed.
export MPLBACKEND ?= Agg
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help venv tools demo calibrate target test test-slow lint format types layers docs docs-live figures safety bench-smoke bench clean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# ---------------------------------------------------------------- set-up

$(BIN)/python:
	@command -v "$(PYTHON)" >/dev/null 2>&1 || { \
	  echo "make: no '$(PYTHON)' found: install Python 3.11 or later, or name one: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "make: piezoest needs Python 3.11 or later, '$(PYTHON)' is $$("$(PYTHON)" -V 2>&1): name another: make PYTHON=python3.12" >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV)

# One stamp for each set of extras; all are renewed when pyproject.toml changes. A contributor's set holds all
# the others: targets that run side by side after `make venv` install nothing, so they cannot disturb each other.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable .
	@touch $@

$(VENV)/.installed-%: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable ".[$*]"
	@touch $@

SETS := test lint docs docs-live bench
$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable ".[dev]"
	@touch $@ $(VENV)/.installed $(SETS:%=$(VENV)/.installed-%)

.PRECIOUS: $(VENV)/.installed-%

venv: $(VENV)/.installed-dev  ## Set up .venv with everything a contributor needs

# Compilers, checker and emulator for the exported C; tests that need one skip where it is absent.
TOOLS := gcc libc6-dev clang cppcheck gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm

tools:  ## Install what exported C is checked with (Debian's packages, as root)
	apt-get update
	DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends $(TOOLS)

# ---------------------------------------------------------------- use

demo: $(VENV)/.installed  ## Run the demonstration: linear against adaptive compensation
	$(BIN)/piezoest demo

target: $(VENV)/.installed  ## Count the instructions of exported controllers on an emulated Cortex-M4F
	$(BIN)/python benchmarks/target/target.py --json docs/data/target.json

calibrate: $(VENV)/.installed  ## Fit the simulated stage to the paper's tables anew, in some ten minutes
	$(BIN)/python calibration/calibrate_paper_stage.py

# ---------------------------------------------------------------- checks

# A file stays in one process, in the order of tests/conftest.py.
SPREAD := -n auto --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed-test  ## Run the tests (ARGS="-k name" passes options to pytest)
	$(BIN)/python -m pytest $(SPREAD) $(ARGS)

test-slow: $(VENV)/.installed-test  ## Run the tests that take long: every option, processes, random sweeps
	$(BIN)/python -m pytest -m slow $(SPREAD) $(ARGS)

lint: $(VENV)/.installed-lint  ## Check style, formatting and docstrings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python docs/check_docstrings.py

format: $(VENV)/.installed-lint  ## Mend what lint can mend by itself
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(VENV)/.installed-lint  ## Check the types of package and tests
	$(BIN)/mypy

layers: $(VENV)/.installed-test  ## Check that modules import only from the layers below them
	$(BIN)/lint-imports --no-cache

# ---------------------------------------------------------------- documentation

docs: $(VENV)/.installed-docs  ## Build the documentation into docs/_build/html; a warning is an error
	rm -rf docs/generated
	$(BIN)/sphinx-build -W --keep-going -n -q -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html
	@echo "open docs/_build/html/index.html"

docs-live: $(VENV)/.installed-docs-live  ## Serve the documentation and rebuild it on every change
	$(BIN)/sphinx-autobuild --watch piezoest --ignore "docs/gallery/*" --ignore "docs/generated/*" docs docs/_build/live

# Arguments of HysteresisRLS that the page on policies compares: without blanks, for make.
WITH := RandomWalk(),DeadZone(),OutlierRejection()
POLICIES := policies=(RandomWalk(),DeadZone()) policies=(RandomWalk(),OutlierRejection()) policies=($(WITH),Projection()) \
            policies=(PeriodicForgetting(memory=2.0),DeadZone(),OutlierRejection()) \
            policies=(DirectionalForgetting(),DeadZone(),OutlierRejection()) \
            policies=(VariableForgetting(),DeadZone(),OutlierRejection()) \
            memory=0.05,offset=True memory=0.1,offset=True memory=0.2,offset=True memory=0.4,offset=True \
            memory=1.0,offset=True memory=0.4,offset=True,time_base='continuous' \
            memory=0.4,offset=True,policies=(NormBound(),) \
            memory=0.4,offset=True,policies=(DeadZone(),ExcitationGate()) \
            memory=None,offset=True,policies=(DeadZone(),CovarianceResetting(floor=1e-5)) \
            memory=1.0,offset=True,policies=(DeadZone(),ChangeDetection()) \
            memory=1.0,offset=True,policies=(DeadZone(),AmplitudeMemory())

figures: $(VENV)/.installed-bench  ## Make the numbers and figures of the documentation anew but for those of make safety, in some 40 minutes
	$(BIN)/piezoest bench paper --json docs/data/paper.json --figures docs/figures/paper
	$(BIN)/piezoest bench --tune 8 --output docs/_build/table --json docs/data/table.json --figures docs/figures/table
	$(BIN)/piezoest bench --only HysteresisRLS $(foreach with,$(POLICIES),-e "HysteresisRLS($(with))") --stage paper --seeds 10 --output docs/_build/policies --json docs/data/policies.json
	$(BIN)/python benchmarks/logs.py --logs 300 --seed 30000 --json docs/data/logs.json
	$(BIN)/python benchmarks/controller.py --json docs/data/controller.json
	$(BIN)/python benchmarks/target/target.py --json docs/data/target.json
	$(BIN)/python benchmarks/speed.py --json docs/data/speed.json --figure docs/figures/speed.png
	$(BIN)/python docs/tuning.py
	$(BIN)/python docs/real_data.py
	$(BIN)/python docs/readme.py --figure

safety: $(VENV)/.installed-bench  ## Let controllers drive 10 000 rigs drawn at random, in some 40 minutes; it goes on where it stopped
	$(BIN)/python benchmarks/safety.py --runs 10000 --others 1000 --seed 70000 --map 20 --singles 30 --dwell 60 --output docs/_build/safety --json docs/data/safety.json --figure docs/figures/safety.png

# ---------------------------------------------------------------- benchmarks

bench-smoke: $(VENV)/.installed-bench  ## Try the benchmark on a short record: is the result that of its peers?
	@if command -v gcc >/dev/null; then \
	  $(BIN)/python benchmarks/speed.py --samples 2000 --rounds 1 --slow 300 --turns 2000; \
	else echo "gcc is absent: nothing to compare with" >&2; fi

bench: $(VENV)/.installed-bench  ## Speed against C, filterpy and padasip, with targets, in some minutes (needs gcc)
	$(BIN)/python benchmarks/speed.py --json docs/data/speed.json --figure docs/figures/speed.png

clean:  ## Remove builds, caches and generated pages, keep .venv
	rm -rf build dist docs/_build docs/gallery docs/generated docs/sg_execution_times.rst
	rm -rf .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find piezoest tests benchmarks calibration -type d -name __pycache__ -prune -exec rm -rf {} +
