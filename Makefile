# Every target sets up what it needs: on a fresh machine `make assemble` and `make test` are all.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null && echo $$p && break; done)
SEED ?= 0
CORES ?= 2
ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# In the order of their names: by themselves files with one long test would come last.
PYTEST := $(BIN)/python -m pytest -n $(CORES) --dist loadfile --no-loadscope-reorder
DOCS_READY := $(VENV)/.docs-ready

.PHONY: help setup assemble assemble-quick test test-all lint type format shared-lines bench docs watch clean

help:
	@echo "make assemble        demonstrations, four skills, T-STAR, evaluation, video, curves (SEED=0)"
	@echo "make assemble-quick  the same path made small"
	@echo "make watch           an assembly to play in a browser: runs/watch.html"
	@echo "make test | test-all | lint | type | format | bench"
	@echo "make test CORES=8    tests on eight processes; two by default, CORES=0 in one"
	@echo "make shared-lines    how many lines any two recipes share"
	@echo "make docs            this documentation as a site, in site/index.html"

setup: $(READY)

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "no Python from 3.11 to 3.13 found; say where: make PYTHON=/path/to/python3.11 ..."; exit 1; }
	$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV)  # one that broke off has no pip
	$(BIN)/python -m pip install -q -e '.[dev]'
	touch $@

assemble: $(READY)
	$(BIN)/python recipes/assemble.py scale=laptop seed=$(SEED) $(ARGS)

assemble-quick: $(READY)
	$(BIN)/python recipes/assemble.py scale=quick seed=$(SEED) $(ARGS)

watch: $(READY)
	$(BIN)/python recipes/watch.py $(ARGS)

test: $(READY)
	$(PYTEST) -m "not slow" $(ARGS)

test-all: $(READY)
	$(PYTEST) $(ARGS)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

type: $(READY)
	$(BIN)/pyright

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)
	$(BIN)/python recipes/bench.py $(ARGS)

shared-lines: $(READY)
	$(BIN)/python tools/shared_lines.py $(ARGS)

$(DOCS_READY): $(READY)
	$(BIN)/python -m pip install -q -e '.[docs]'
	touch $@

docs: $(DOCS_READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict $(ARGS)

clean:
	rm -rf build dist site *.egg-info .pytest_cache .ruff_cache
