# Every target sets up what it needs in a virtual environment of its own (.venv), and uses it again
# as long as pyproject.toml stays the same. Another interpreter: make test PYTHON=python3.12

PYTHON ?= python3
VENV ?= .venv
OUT ?= reproduction

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2

.PHONY: help reproduce test test-slow test-all check bench docs clean warm
.NOTPARALLEL:

help:
	@echo "make reproduce   recompute the paper's tables and figures into $(OUT)/"
	@echo "make test        fast tests"
	@echo "make test-slow   long tests only"
	@echo "make test-all    both"
	@echo "make check       lint, format, types"
	@echo "make bench       speed, with the peers in the same run"
	@echo "make docs        documentation into docs/_build/"
	@echo "make clean       remove everything that make made"

$(VENV)/.package: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("seatdyn needs Python 3.11 \
	or newer, and $(PYTHON) is older. Try: make PYTHON=python3.12")'
	@echo "installing seatdyn into $(VENV) (once) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) install -e .
	@touch $@

# one stamp for each set of extra packages: .venv/.test, .venv/.check, .venv/.bench, .venv/.docs
$(VENV)/.%: $(VENV)/.package
	@echo "installing what '$*' needs into $(VENV) (once) ..."
	@$(PIP) install -e ".[$*]"
	@touch $@

# compile the kernels in one process before two test workers need them
warm: $(VENV)/.package
	@$(BIN)/seatdyn steady --frequency 1.55 --amplitude 0.8857 --end-stop 500 --json > /dev/null

reproduce: $(VENV)/.package
	$(BIN)/seatdyn reproduce --out $(OUT)

test: $(VENV)/.test warm
	$(PYTEST)

test-slow: $(VENV)/.test warm
	$(PYTEST) -m slow

test-all: test test-slow

check: $(VENV)/.check
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(VENV)/.bench
	$(BIN)/python benchmarks/table.py

docs: $(VENV)/.docs
	$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build
	@echo "documentation: docs/_build/index.html"

clean:
	rm -rf $(VENV) build dist docs/_build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests examples benchmarks docs -name __pycache__ -type d -prune -exec rm -rf {} +
