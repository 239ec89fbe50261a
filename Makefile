# The only list of commands. `make train` and `make test` do all set-up themselves.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST := Cargo.toml Cargo.lock $(shell find rust_env -name '*.rs' -o -name Cargo.toml)
TRAIN ?= --preset mixed --method td-inner --budget quick
export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: train test test-slow lint format bench docs setup clean

train: setup ## train TD-innerATT on mixed rescue worlds, then evaluate it
	@innerattn train $(TRAIN)

test: setup lint ## every check but the long one
	cargo test --quiet --locked
	pytest -n auto --dist worksteal

test-slow: setup ## the long checks: ten million env-steps of contacts, compilers at their slowest
	INNERATTN_SLOW=1 cargo test --quiet --test worlds containment
	pytest -m slow

lint: setup ## formatting, lints, types, stub, import floors
	cargo fmt --check
	cargo clippy --quiet --all-targets -- -D warnings
	ruff check
	ruff format --check
	mypy
	python -m mypy.stubtest innerattn._core --mypy-config-file pyproject.toml
	lint-imports --no-cache

format: setup ## format all code
	cargo fmt
	ruff check --fix
	ruff format

bench: setup ## speed of worlds and learner on this machine, beside their peers; fills docs/performance.md; MAAC=PATH adds MAAC's public code
	PIP_QUIET=1 maturin develop --release --quiet --locked --extras dev,peers || \
	{ echo "Without peers: they cannot be installed here."; PIP_QUIET=1 maturin develop --release --quiet --locked --extras dev; }
	cargo bench --quiet
	python benches/compare_envs.py
	python benches/env_cost.py
	python benches/fault_cost.py
	python benches/compare_learner.py $(if $(MAAC),--maac "$(MAAC)")

setup: $(VENV)/.built ## environment and compiled module

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "innerattn needs Python 3.11 or later; set PYTHON=... to choose one")'
	@echo "Setting up $(VENV): a few minutes, most of it the download of PyTorch."
	$(PYTHON) -m venv $(VENV)
	pip install --quiet --disable-pip-version-check 'maturin>=1.10,<2'
	@touch $@

$(VENV)/.built: $(VENV)/.installed $(RUST)
	@echo "Compiling the worlds."
	PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 maturin develop --release --quiet --locked --extras dev
	@touch $@

docs: setup ## draw the pictures of the documentation
	python docs/pictures.py

clean: ## remove everything that was built
	rm -rf $(VENV) target python/innerattn/_core*.so
