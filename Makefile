.DEFAULT_GOAL := help
.PHONY: help setup demo check ci test test-one test-all test-distributed lint docs clean

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
FAR := .venv-distributed
JOBS ?= 2
# The virtual lab runs in real time: nothing runs beside its tests. What the workers
# would all compile is compiled before they start.
REALTIME := tests/lab
TEST = $(BIN)/airhockey warm --jobs $(JOBS) && $(BIN)/pytest -n $(JOBS) --ignore=$(REALTIME)

help: ## Show what there is to make
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/\1|\2/' | \
		while IFS='|' read -r name what; do printf '  make %-16s %s\n' "$$name" "$$what"; done

setup: $(READY) ## Set up .venv with all that demo and tests need

# torch comes first and by itself: pip then takes a CPU build where there is one.
# robosuite comes without what it names: that is numpy 1, a second OpenCV and a compiler.
$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --constraint constraints.txt torch
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[train,play,hardware,offline,ecosystem,dev]'
	$(BIN)/pip install --quiet --constraint constraints.txt --no-deps robosuite
	@echo "what pip says of robosuite above does no harm: it comes without what it names"
	$(BIN)/pip install --quiet --constraint constraints.txt mujoco scipy termcolor tqdm
	touch $@

demo: setup ## Train a paddle to juggle and show it (a minute)
	$(BIN)/airhockey demo

test: setup lint ## Run linters, types and the tests that are not slow
	$(TEST) -m 'not slow'
	$(BIN)/pytest -m 'not slow' $(REALTIME)

check: setup ## Run linters and tests of what has changed since main
	$(BIN)/python scripts/check_changes.py

ci: ## Run what CI runs, on a clean clone of the last commit
	clone=$$(mktemp -d) && git clone --quiet . $$clone/project && \
		(cd $$clone/project && bash .ci/run); status=$$?; rm -rf $$clone; exit $$status

test-one: setup ## Run the tests of one scenario or driver: make test-one NAME=my_task
	$(BIN)/pytest tests/suites -m 'not slow' --only $(NAME)

test-all: setup lint ## Run every test
	$(TEST)
	$(BIN)/pytest $(REALTIME)

# RLlib pins an older gymnasium, so it has an environment of its own.
$(FAR)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(FAR)
	sed '/^gymnasium==/d' constraints.txt > $(FAR)/constraints.txt
	$(FAR)/bin/pip install --quiet --upgrade pip
	$(FAR)/bin/pip install --quiet --constraint $(FAR)/constraints.txt torch
	$(FAR)/bin/pip install --quiet --constraint $(FAR)/constraints.txt --editable '.[train,distributed]' pytest pytest-timeout pytest-xdist
	touch $@

test-distributed: $(FAR)/.ready ## Run the tests of RLlib, in an environment of their own
	$(FAR)/bin/pytest -W ignore tests/learn/test_rllib.py

lint: setup ## Check format, style, spelling, layers and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/codespell README.md CHANGELOG.md CONTRIBUTING.md docs marl_airhockey scenarios agents scripts tests
	$(BIN)/lint-imports --no-logo --no-cache
	$(BIN)/mypy

docs: setup ## Build the documentation into site/
	$(BIN)/mkdocs build --strict

clean: ## Remove what was made, the environment included
	rm -rf .venv .venv-* build dist site runs .pytest_cache .mypy_cache .ruff_cache .hypothesis
