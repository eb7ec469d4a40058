# `make demo` and `make test` each set up what they need in .venv, once, and then run it.
# `make check` adds the linter and the type checker; `make clean` removes what these made.
# `make coverage` runs the tests once more and prints which branches they take.
# `make bench` runs every script of benchmarks/ and writes its RECORD.md; `make bench QUICK=--quick`
# runs them in small, in three minutes, and writes into runs/bench.
# `make torture` makes all attacks of which the tests make a few, and prints a table of them.
# `make docs` builds the documentation into site/; `make package` builds wheel and source archive
# into dist/ and runs the demo of the wheel in an empty folder.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Installing follows pyproject.toml: a stamp older than it means install again.
RUN_STAMP := $(VENV)/.installed
TEST_STAMP := $(VENV)/.installed-test

.PHONY: demo test lint check coverage torture bench docs package clean

demo: $(RUN_STAMP)
	$(BIN)/fpid-pin demo

test: $(TEST_STAMP)
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(TEST_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	cd benchmarks && ../$(BIN)/mypy --config-file mypy.ini *.py

check: lint test

coverage: $(TEST_STAMP)
	$(BIN)/python -m pytest -q -n 2 --dist loadfile --cov --cov-report=term:skip-covered

torture: $(TEST_STAMP)
	FPID_TORTURE=full $(BIN)/python -m pytest -q --timeout 7200 tests/torture \
	  tests/arms/test_catalogue.py tests/simulation/test_engine.py

bench: $(TEST_STAMP)
	$(BIN)/python benchmarks/record.py $(QUICK)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "fpid_pin needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version 2>&1)." \
	       "Try: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) cannot make virtual environments. On Debian and Ubuntu:" \
	       "sudo apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(RUN_STAMP): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --disable-pip-version-check -q -e .
	@touch $@

$(TEST_STAMP): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --disable-pip-version-check -q -e '.[test]'
	@touch $@ $(RUN_STAMP)

docs: $(TEST_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q

package: | $(BIN)/python
	rm -rf dist build/package
	$(BIN)/python -m pip install --disable-pip-version-check -q 'hatchling>=1.26'
	$(BIN)/python -m hatchling build
	$(PYTHON) -m venv build/package
	build/package/bin/python -m pip install --disable-pip-version-check -q dist/*.whl
	build/package/bin/python -m pip check --disable-pip-version-check
	cd build/package && bin/fpid-pin demo --out demo

clean:
	rm -rf $(VENV) site build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
