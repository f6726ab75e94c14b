# The two commands of the README: `make demo` and `make test`.
# Each makes its own virtual environment and installs what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Eight workers need not each read the files that have no such test.
WAITING = $(shell grep -rl --include='test_*.py' 'pytest\.mark\.waits' tests)

# A hundred processes start in a test run: without its bytecode each compiles the project anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test hil-emulated lint waiting clean

demo: $(VENV)/.installed
	$(BIN)/gonio run configs/protocols/demo.yaml

# Tests that wait for emulated devices leave most of the processor to the others, which yield it.
test: $(VENV)/.installed-dev
	$(MAKE) --no-print-directory -j 3 --output-sync=target $(VENV)/.compiled lint waiting
	$(BIN)/pytest -n auto --dist worksteal -m "not hil and not waits"

waiting: $(VENV)/.installed-dev
	$(BIN)/pytest -n 8 -m "waits and not hil" $(WAITING)

# The tests for a bench, in an emulated computer with real kernel drivers; OPTIONS="--slow" runs all.
hil-emulated: $(VENV)/.installed-dev
	$(BIN)/python -m tests.hil_emulated $(OPTIONS)

# Once in a clone: otherwise each worker compiles all tests, at the same time as the others. Errors in
# a test file are reported where its tests are run.
$(VENV)/.compiled: $(VENV)/.installed-dev
	-@nice $(BIN)/pytest --collect-only -q -m "not hil and not waits" > /dev/null
	touch $@

lint: $(VENV)/.installed-dev
	nice $(BIN)/ruff check .
	nice $(BIN)/ruff format --check .
	nice $(BIN)/mypy
	nice $(BIN)/lint-imports

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "$(PYTHON) is older than 3.11: install Python 3.11 or later, or name one: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
