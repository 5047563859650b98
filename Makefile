# Needs Python 3.11 or newer and make; everything else goes into .venv.

# The first of these that is new enough; `make PYTHON=/path/to/python demo` names one.
PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11 python; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 \
	&& { echo $$python; break; }; done)
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
BENCHMARKS = $(filter-out benchmarks/_%,$(sort $(wildcard benchmarks/[a-z]*.py)))

.DEFAULT_GOAL := help
# Tests start hundreds of processes: without bytecode each would compile what it imports.
unexport PYTHONDONTWRITEBYTECODE
.PHONY: help demo test test-slow test-long test-clients soak bench coverage types docs format clean

help:  ## list these targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' Makefile

demo: .venv/installed  ## breed Lyon x Montpellier for a minute or two; leaves a report in runs/
	$(BIN)/evocity run

# A process a core; more than eight wait for the longest file anyway.
PYTEST = $(BIN)/pytest -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder

test: .venv/installed-dev .venv/installed-node  ## formatter, linter and the tests that are not slow
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/python tests/compiled.py
	$(PYTEST)

test-slow: .venv/installed-dev .venv/installed-node  ## the tests that take some seconds each; IN=tests/faults for some
	$(PYTEST) -m 'slow and not long and not clients' $(IN)

test-long: .venv/installed-dev  ## tests of more than ten seconds, and properties on new examples
	HYPOTHESIS_PROFILE=explore $(BIN)/pytest -m 'long or hypothesis'

test-clients: .venv/installed-dev  ## tests that open files in Blender and QGIS, where these are installed
	$(BIN)/pytest -m clients

soak: .venv/installed-dev  ## long tests under faults: hours of them
	$(BIN)/pytest -m long tests/faults

bench: .venv/installed-bench  ## every side-by-side measurement of benchmarks/
	@for script in $(BENCHMARKS); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

coverage: .venv/installed-dev .venv/installed-node  ## share of lines that `make test` reaches, in percent
	$(PIP) install 'coverage>=7.10'
	$(BIN)/python tests/compiled.py
	rm -rf build/coverage && mkdir -p build/coverage
	-$(BIN)/coverage run -m pytest -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --format=total

types: .venv/installed-dev  ## mypy over the package, and its list of excused modules
	$(BIN)/python tests/excused_modules.py

docs: .venv/installed-docs  ## the documentation as a site, in build/docs/site
	$(BIN)/python docs/site/build.py

format: .venv/installed-dev  ## put the code into the one format
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:  ## remove .venv and the caches; runs stay
	rm -rf .venv .pytest_cache .ruff_cache .mypy_cache .hypothesis build dist
	find evocity tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp each, so that a second make starts at once. A half-made .venv is made anew.
.venv/installed: pyproject.toml
	@test -n "$(PYTHON)" || { echo "evocity needs Python 3.11 or newer; none was found." \
		"Install one, or name it: make PYTHON=/path/to/python3.12 demo" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "$(PYTHON) is" \
		"older than Python 3.11. Name a newer one: make PYTHON=/path/to/python3.12 demo" >&2; \
		exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear .venv
	@echo "Installing evocity into .venv (once, about a minute) ..."
	@$(PIP) install --editable .
	@touch $@

.venv/installed-dev: .venv/installed
	@echo "Installing the tools for tests into .venv (once) ..."
	@$(PIP) install --editable '.[dev]'
	@touch $@

# What checks and shows .glb files, and checks pages for who cannot see them, lives in node; where it cannot
# be had, those tests are skipped.
.venv/installed-node: .venv/installed-dev
	@if command -v npm >/dev/null 2>&1; then echo "Installing gltf-validator, three and axe-core into .venv (once) ..."; \
		npm install --silent --no-fund --no-audit --no-save --no-package-lock \
		--prefix .venv/node gltf-validator@2.0.0-dev.3.10 three@0.187.0 axe-core@4.14.1 \
		&& touch $@ \
		|| echo "gltf-validator, three and axe-core could not be had; their tests are skipped" >&2; fi

.venv/installed-docs: .venv/installed
	@echo "Installing what builds the documentation into .venv (once) ..."
	@$(PIP) install --editable '.[docs]'
	@touch $@

.venv/installed-bench: .venv/installed-dev
	@echo "Installing what benchmarks compare with into .venv (once) ..."
	@$(PIP) install --editable '.[bench]'
	@touch $@
