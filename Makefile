# Two commands on a fresh machine with Python >= 3.11: make study, make test. The environment is made on the way.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# A strict editable installation links every file, so it is redone when a file comes or goes, and when pyproject.toml
# changes; the check sum of the list of files is part of the stamp's name.
FILES := $(shell find filippov models analysis -type f ! -path '*/__pycache__/*' | LC_ALL=C sort | cksum | cut -d' ' -f1)
INSTALL := $(BIN)/python -m pip install --quiet --config-settings editable_mode=strict --editable

# The tests of the explorer's page run where there is a Chromium; playwright, which drives it, is installed there only.
COMMA := ,
CHROMIUM := $(shell command -v chromium || command -v chromium-browser || command -v google-chrome)
BROWSER := $(if $(CHROMIUM),$(COMMA)browser)

# Matrices here are small: two processes with two threads each for linear algebra mostly wait for each other.
export OPENBLAS_NUM_THREADS ?= 1

# Neighbours share what they make once: each worker begins with one half, and takes from the other at the end.
TWO := -n 2 --dist worksteal

.PHONY: study test test-oldest lint docs wheel-test clean
.DELETE_ON_ERROR:

study: $(VENV)/.use-$(FILES)
	rm -f results/hunting/made-from.txt
	$(BIN)/filippov study hunting -o results/hunting
	$(BIN)/python tests/made.py results/hunting

test: $(VENV)/.use-$(FILES)
	$(BIN)/python -m pytest $(TWO) $(PYTEST)

# The oldest versions that pyproject.toml allows, in an environment of their own, tests of every dependency from the
# bare checkout. What these versions warn of about each other is no failure.
OLDEST := .venv-oldest
OLDEST_PYTHON ?= $(shell command -v python$$($(PYTHON) tests/oldest.py python) || echo $(PYTHON))

test-oldest: $(OLDEST)/.made
	$(OLDEST)/bin/python -m pytest $(TWO) -W default::DeprecationWarning -W default::PendingDeprecationWarning \
	  $$($(OLDEST)/bin/python tests/oldest.py tests)

$(OLDEST)/.made: pyproject.toml tests/oldest.py
	rm -rf $(OLDEST)
	$(OLDEST_PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python tests/oldest.py requirements > $(OLDEST)/requirements.txt
	$(OLDEST)/bin/python -m pip install --quiet --requirement $(OLDEST)/requirements.txt
	touch $@

# mypy sees filippov.models and filippov.analysis where the installation links them (the folder on the path that the
# .pth file names), and the rest in the checkout.
lint: $(VENV)/.develop-$(FILES)
	$(BIN)/ruff check .
	$(BIN)/mypy --strict -p filippov -p filippov.models -p filippov.analysis

# -E: every page is executed, also where only the package has changed.
docs: $(VENV)/.develop-$(FILES)
	rm -f docs/_build/html/made-from.txt
	$(BIN)/python -m sphinx -E -W --keep-going -j 2 -b html docs docs/_build/html
	$(BIN)/python tests/made.py docs/_build/html

wheel-test: $(VENV)/.develop-$(FILES)
	$(BIN)/python tests/check_wheel.py

clean:
	rm -rf $(VENV) $(OLDEST) build dist *.egg-info docs/_build docs/jupyter_execute .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(VENV)/.use-$(FILES): $(VENV)/.made pyproject.toml
	rm -rf $(VENV)/.use-* build/__editable__.*
	$(INSTALL) '.[report,progress,tests$(BROWSER)]'
	touch $@

$(VENV)/.develop-$(FILES): $(VENV)/.use-$(FILES)
	rm -f $(VENV)/.develop-*
	rm -rf build/__editable__.*
	$(INSTALL) '.[report,progress,tests,lint,docs$(BROWSER)]'
	touch $@

$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "'$(PYTHON)' is no Python 3.11 or later; name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@
