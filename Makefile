.DEFAULT_GOAL := help
.PHONY: help setup demo check ci test test-short test-realtime test-one test-all test-distributed test-ecosystem lint docs pages wheel clean

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
TRAINS := .venv/.trains
EXPORTS := .venv/.exports
FAR := .venv-distributed
JOBS ?= 2
PIP := $(BIN)/pip install --quiet --constraint constraints.txt
COMPILED := juggle
TARGET ?= x86-64-v3
# Where it is set, every process of the tests would compile all modules again.
export PYTHONDONTWRITEBYTECODE :=
# The virtual lab runs in real time: nothing runs beside its tests. What the workers
# would all compile is compiled before they start.
REALTIME := tests/hardware/lab
TEST = $(BIN)/airhockey precompile --jobs $(JOBS) && $(BIN)/pytest -n $(JOBS) --ignore=$(REALTIME)

help: ## Show what there is to make
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/\1|\2/' | \
		while IFS='|' read -r name what; do printf '  make %-16s %s\n' "$$name" "$$what"; done

setup: $(READY) ## Set up .venv with all that demo and tests need

# What demo needs. Its scenario is compiled while pip downloads the rest.
# torch comes by itself: pip then takes a CPU build where there is one.
$(TRAINS): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(PIP) --editable .
	{ PYTHONPATH=. $(BIN)/airhockey precompile --jobs 1 $(COMPILED) 2> .venv/precompile.log; } & \
	$(PIP) torch && $(PIP) 'marl_airhockey[train]' && wait
	touch $@

# robosuite comes without what it names: that is numpy 1, a second OpenCV and a compiler.
$(READY): $(TRAINS)
	$(PIP) 'marl_airhockey[train,play,hardware,offline,ecosystem,dev]'
	$(PIP) --no-deps robosuite
	$(PIP) mujoco scipy termcolor tqdm
	@echo "what pip says of robosuite above does no harm: it comes without what it names"
	touch $@

# The linker for WebAssembly, which slow tests and the game in the documentation need.
$(EXPORTS): $(READY)
	$(PIP) 'marl_airhockey[export]'
	touch $@

demo: $(TRAINS) ## Train a paddle to juggle and show it (a minute)
	$(BIN)/airhockey demo

.NOTPARALLEL:

test: lint test-short test-realtime ## Run linters, types and the tests that are not slow

test-short: setup
	$(TEST) -m 'not slow'

test-realtime: setup
	$(BIN)/pytest -m 'not slow' --closing --durations 25 $(REALTIME)

check: setup ## Run linters and tests of what has changed since main
	$(BIN)/python scripts/check_changes.py

ci: ## Run what CI runs, on a clean clone of the last commit
	clone=$$(mktemp -d) && git clone --quiet . $$clone/project && \
		(cd $$clone/project && bash .ci/run); status=$$?; rm -rf $$clone; exit $$status

test-one: setup ## Run the tests of one scenario or driver: make test-one NAME=my_task
	$(BIN)/pytest tests/suites -m 'not slow' --only $(NAME)

test-all: setup lint $(EXPORTS) $(FAR)/.ready ## Run every test
	$(TEST)
	$(BIN)/pytest --closing $(REALTIME)
	$(RLLIB)

# RLlib pins an older gymnasium, so it has an environment of its own, which takes all
# else from .venv.
$(FAR)/.ready: $(READY)
	$(PYTHON) -m venv $(FAR)
	sed '/^gymnasium==/d' constraints.txt > $(FAR)/constraints.txt
	$(BIN)/python -c 'import os, sysconfig; print(os.getcwd(), sysconfig.get_path("purelib"), sep="\n")' \
		> $$($(FAR)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/shared.pth
	$(FAR)/bin/pip install --quiet --constraint $(FAR)/constraints.txt 'marl_airhockey[distributed]'
	touch $@

RLLIB = $(FAR)/bin/python -m pytest -W ignore tests/learn/test_rllib.py

test-distributed: $(FAR)/.ready ## Run the short test of RLlib, in an environment of its own
	$(RLLIB) -m 'not slow'

# BenchMARL and LeRobot pin other packages, so each has an environment of its own.
BENCHMARL := .venv-benchmarl
LEROBOT := .venv-lerobot
LEROBOT_PYTHON ?= python3.12
WITH_PYTEST := pytest pytest-timeout

$(BENCHMARL)/.ready:
	$(PYTHON) -m venv $(BENCHMARL)
	$(BENCHMARL)/bin/pip install --quiet $(WITH_PYTEST) benchmarl==1.5.2 -e . \
		-e plugins/benchmarl_airhockey
	touch $@

$(LEROBOT)/.ready:
	$(LEROBOT_PYTHON) -m venv $(LEROBOT)
	$(LEROBOT)/bin/pip install --quiet $(WITH_PYTEST) 'lerobot[core-scripts,training,diffusion]==0.6.1' \
		-e '.[play,data,hardware]' -e plugins/lerobot_env_airhockey -e plugins/lerobot_robot_airhockey
	touch $@

test-ecosystem: $(BENCHMARL)/.ready $(LEROBOT)/.ready ## Test the packages for BenchMARL and LeRobot
	$(BENCHMARL)/bin/python -m pytest -W ignore plugins/benchmarl_airhockey
	$(LEROBOT)/bin/python -m pytest -W ignore plugins/lerobot_env_airhockey plugins/lerobot_robot_airhockey

# Types of a clone are checked as far as those of another one were.
lint check: export MYPY_CACHE_DIR := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/marl_airhockey/mypy
lint: setup ## Check format, style, spelling, layers and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/codespell README.md CHANGELOG.md CONTRIBUTING.md docs marl_airhockey scenarios drivers plugins scripts tests
	$(BIN)/python scripts/check_prose.py
	$(BIN)/lint-imports --no-logo --no-cache
	$(BIN)/mypy

wheel: setup ## Build a wheel into dist/ that starts without compiling (TARGET=generic: any processor)
	rm -rf dist build
	$(BIN)/airhockey precompile --target $(TARGET) --out build/precompiled --profile ideal --profile ur5e
	$(BIN)/python -m build --wheel --outdir dist .

docs: pages $(EXPORTS) ## Build the documentation into site/, with the game in site/play
	$(BIN)/airhockey play --static site/play

pages: setup ## Build the documentation into site/, without the game
	$(BIN)/python scripts/reproduce/scenario_pages.py
	$(BIN)/typer marl_airhockey.cli.main utils docs --name airhockey --title "Command line" --output docs/cli.md
	$(BIN)/mkdocs build --strict

clean: ## Remove what was made, the environment included
	rm -rf .venv .venv-* build dist site runs .pytest_cache .mypy_cache .ruff_cache .hypothesis
