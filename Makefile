# `make demo` and `make test` are all that is needed: each sets up a virtual environment first, and is quick about it
# when nothing changed.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.set-up
OUT := out
# Two test processes, each with one thread per library, fill two cores.
WORKERS ?= 2
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
# Kept even where the environment says otherwise: the tests start some dozens of processes that import everything.
KEEP_BYTECODE := PYTHONDONTWRITEBYTECODE=

.PHONY: help demo test lint docs profile setup clean

help:
	@echo 'make demo    set up, then plan a grasp from a depth image and try it: $(OUT)/demo.png'
	@echo 'make test    set up, then check style, types, documentation and behaviour'
	@echo 'make lint    set up, then check style and types only'
	@echo 'make docs    set up, then build the documentation with the reference: $(OUT)/site/index.html'
	@echo 'make profile set up, then measure sizes, names and imports of the code, before and now: results/profile.md'
	@echo 'make setup   only set up the virtual environment $(VENV)'
	@echo 'make clean   remove the virtual environment and all caches of tools'

demo: setup
	@mkdir -p $(OUT)
	$(BIN)/bayesgrasp demo --out $(OUT)/demo.png

test: lint docs
	$(ONE_THREAD) $(KEEP_BYTECODE) $(BIN)/pytest -q -n $(WORKERS) --dist worksteal

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

# Warnings are errors. The variable silences an announcement of the theme's.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# The last revision before the rooms were redrawn, beside this one.
BEFORE ?= 8e8cf2b
profile: setup
	$(BIN)/python benchmarks/code_profile.py --against $(BEFORE) --json results/profile.json --table results/profile.md

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt .ci/make-venv
	.ci/make-venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,docs]'
	@touch $@

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache
