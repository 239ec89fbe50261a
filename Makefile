# The only list of commands. `make train` and `make test` do all set-up themselves.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST := Cargo.toml Cargo.lock $(shell find rust_env -name '*.rs' -o -name Cargo.toml)
CONSTRAINTS ?= constraints.txt
PYTHONS ?= python3.11 python3.12 python3.13 python3.14
TRAIN ?= --preset mixed --method ppo-inner --budget fast
export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PIP_CONSTRAINT := $(if $(CONSTRAINTS),$(CURDIR)/$(CONSTRAINTS))
export PIP_QUIET := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONDONTWRITEBYTECODE := # compiled modules are kept: the tests begin many processes
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: train robot test test-pool test-asan test-gpu test-slow examples study-kill reliability soak lint lint-rust lint-python format bench lock docs site schemas dist wheels wheels-check policies-wheel smoke bounds wasm setup clean

train: setup ## train PPO with inner attention on mixed rescue worlds, then evaluate it
	@innerattn train $(TRAIN)

robot: setup ## export a trained team, and let four processes drive it, one for each robot
	@test -e runs/robot || innerattn train $(TRAIN) --run-dir runs/robot
	@test -e runs/robot/export || innerattn export runs/robot
	@PYTHONPATH=examples/robot python -m robot run runs/robot/export

LIMIT := $(shell command -v timeout >/dev/null && echo timeout 900)# of all Rust tests together [s]

test: setup lint ## every check but the long ones
	$(LIMIT) cargo test --quiet --locked
	pytest -n auto --dist worksteal -m 'not long and not slow and not gpu'

test-long: setup ## whole trainings, studies, exports and pages, and processes that are killed; some 20 minutes
	pytest -n auto --dist worksteal -m 'long and not slow and not gpu'

test-pool: ## the pool of threads under every order of events that the memory model allows
	RUSTFLAGS='--cfg loom' cargo test --quiet --locked --target-dir target/loom -p innerattn-pool

ASAN := RUSTC_BOOTSTRAP=1 RUSTFLAGS='-Zsanitizer=address --cfg asan'
ASAN_TARGET := --target-dir target/asan --target x86_64-unknown-linux-gnu
ASAN_PYTHON := PYTHONPATH=target/asan/python LD_PRELOAD=$$(gcc -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0

test-asan: setup ## the pool, snapshots, fuzzed inputs and arrays lent to Python under the address sanitizer; needs x86-64 Linux and gcc, builds all worlds anew
	$(ASAN) cargo test --quiet --locked $(ASAN_TARGET) -p innerattn-pool
	$(ASAN) cargo test --quiet --locked $(ASAN_TARGET) -p innerattn-env --test worlds -- snapshot fuzz
	$(ASAN) cargo build --quiet --locked $(ASAN_TARGET) -p innerattn-py --features pyo3/extension-module
	rm -rf target/asan/python && mkdir -p target/asan/python && cp -r python/innerattn target/asan/python
	cp target/asan/x86_64-unknown-linux-gnu/debug/lib_core.so target/asan/python/innerattn/_core.abi3.so
	$(ASAN_PYTHON) python tests/support/past_the_end.py 2>&1 | grep -q heap-buffer-overflow # it must notice this
	$(ASAN_PYTHON) python -m pytest -q tests/envs/test_array_zoo.py tests/envs/test_copies.py tests/envs/test_batch_snapshots.py

test-gpu: setup ## training on a GPU (CUDA): beside the CPU, stopped and gone on with, by the command
	INNERATTN_TEST_DEVICE=cuda pytest -m 'not slow' tests/train/test_gpu.py tests/train/test_resume.py tests/train/test_divergence.py tests/train/test_weights.py

test-slow: setup test-pool ## the long checks: ten million env-steps of contacts, compilers at their slowest, 300 examples of each property
	INNERATTN_SLOW=1 cargo test --quiet --test worlds containment
	INNERATTN_EXAMPLES=300 pytest -m 'slow or hypothesis'

examples: setup ## train a little with each outside library, in an environment of its own; EXAMPLES='NAME ...' takes some of them
	python examples/run_all.py $(EXAMPLES)

study-kill: setup ## kill workers of studies again and again, on this machine and on a Ray cluster of two nodes; some ten minutes
	pip install 'ray>=2.40,<3'
	INNERATTN_RAY_REQUIRED=1 pytest -m slow tests/studies/test_killed.py

reliability: setup ## every row of docs/reliability.md in full; fills its table
	cargo test --quiet --locked --no-run --test worlds
	python benches/reliability.py

soak: setup ## 10^8 env-steps with each engine and an hour of training: memory, threads and open files must not grow
	python benches/soak.py

lint: setup ## formatting, lints, types, stub, import floors
	@$(MAKE) --no-print-directory --jobs 2 lint-rust lint-python

lint-rust: setup
	cargo fmt --check
	cargo clippy --quiet --all-targets -- -D warnings

lint-python: setup
	ruff check
	ruff format --check
	mypy
	python -m mypy.stubtest innerattn._core --mypy-config-file pyproject.toml
	lint-imports --no-cache

format: setup ## format all code
	cargo fmt
	ruff check --fix
	ruff format

bench: setup ## speed of worlds, learner and planner on this machine, beside their peers; fills docs/performance.md and others; MAAC=PATH adds MAAC's public code
	maturin develop --release --quiet --locked --extras dev,peers || \
	{ echo "Without peers: they cannot be installed here."; maturin develop --release --quiet --locked --extras dev; }
	cargo bench --quiet -p innerattn-benches
	python benches/compare_envs.py
	python benches/env_cost.py
	python benches/fault_cost.py
	python benches/key_cost.py
	python benches/ray_speed.py
	python benches/copy_cost.py
	python benches/mixed_cost.py
	python benches/view_cost.py
	python benches/frame_time.py
	python benches/checkpoint_cost.py
	python benches/exported_call.py
	python benches/planner_quality.py
	python benches/time_to_score.py
	python benches/compare_learner.py $(if $(MAAC),--maac "$(MAAC)")

setup: $(VENV)/.built ## environment and compiled module

$(VENV)/.installed: pyproject.toml $(CONSTRAINTS)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "innerattn needs Python 3.11 or later; set PYTHON=... to choose one")'
	@echo "Setting up $(VENV): a few minutes, most of it the download of PyTorch."
	$(PYTHON) -m venv $(VENV)
	pip install 'maturin>=1.10,<2'
	@touch $@

$(VENV)/.built: $(VENV)/.installed $(RUST)
	@echo "Compiling the worlds."
	@# What the worlds need compiles while packages are fetched; maturin takes it over.
	cargo build --release --quiet --locked -p innerattn-py --features pyo3/extension-module & \
	maturin develop --release --quiet --locked --extras dev; code=$$?; wait; exit $$code
	@touch $@

RUST_SRC ?= $(shell rustc --print sysroot)/lib/rustlib/src/rust/library# sources of the standard library
WASM_TARGET := target/wasm

wasm: ## compile the worlds for pages (WebAssembly); needs the sources of Rust's standard library, RUST_SRC=FOLDER says where
	RUSTC_BOOTSTRAP=1 __CARGO_TESTS_ONLY_SRC_ROOT=$(RUST_SRC) cargo build --quiet -p innerattn-wasm --target-dir $(WASM_TARGET) $$($(PYTHON) rust_env/wasm/sources.py --flags)
	cp $(WASM_TARGET)/wasm32-unknown-unknown/page/innerattn_wasm.wasm python/innerattn/report/page/worlds.wasm
	$(PYTHON) rust_env/wasm/sources.py

lock: $(VENV)/.installed ## renew constraints.txt: the newest versions that pyproject.toml allows
	PIP_CONSTRAINT= pip install --dry-run --ignore-installed --report $(VENV)/report.json '.[dev,log,peers]'
	@python -c 'import json; found = json.load(open("$(VENV)/report.json"))["install"]; \
	names = {one["metadata"]["name"].lower(): one["metadata"]["version"].partition("+")[0] for one in found}; \
	names.pop("innerattn"); \
	open("constraints.txt", "w").writelines(f"{name}=={names[name]}\n" for name in sorted(names))'

docs: setup ## draw the pictures of the documentation
	python docs/pictures.py

site: setup ## the documentation as a site, in build/site; it needs no network to read
	sphinx-build --quiet --fail-on-warning --keep-going -c docs -d build/doctrees . build/site
	@echo "build/site/index.html"

schemas: setup ## write the JSON Schemas of the files of scenarios, runs and studies
	python -m innerattn.config.schema
	python -m innerattn.studies.schema

dist: $(VENV)/.installed ## wheel for manylinux2014 and source archive, into dist/
	rm -rf dist
	pip install ziglang
	maturin build --release --locked --zig --compatibility manylinux2014 --out dist
	maturin sdist --out dist

WHEELS ?=# names of the wheels to build; all, if there is none

wheels: $(VENV)/.installed ## wheels for Linux, macOS and Windows, into dist/ (docs/wheels.md); needs the sources of Rust's standard library, RUST_SRC=FOLDER says where
	pip install ziglang
	python packages/wheels/build.py --out dist --rust-src $(RUST_SRC) $(WHEELS)

wheels-check: setup ## try the wheel for 64-bit ARM on Debian under QEMU: worlds and a team must do the same as here
	mkdir -p build/arm && test -e build/arm/export || innerattn export zoo:mixed -o build/arm/export
	python packages/wheels/on_arm.py dist/*manylinux*_aarch64.whl build/arm/export

policies-wheel: ## the wheel for robots, innerattn-policies, into dist/policies; pure Python, with numpy alone
	$(PYTHON) packages/policies/build_wheel.py

smoke: dist ## try wheel and source archive in fresh environments of all PYTHONS that are here
	@! tar tzf dist/*.tar.gz | grep -E '__pycache__|\.venvs|\.so$$' # nothing that was made here
	@for python in $(PYTHONS); do \
	if ! command -v $$python >/dev/null; then echo "$$python: not here, left out"; continue; fi; \
	tests/smoke.sh $$python dist/*.whl || exit 1; done
	tests/smoke.sh $(PYTHON) dist/*.whl 'numpy<2' 'pyarrow<20'
	tests/smoke.sh $(PYTHON) dist/*.tar.gz

bounds: $(VENV)/.installed ## train, export and show a team with the oldest and with the newest packages that pyproject.toml allows
	maturin build --release --quiet --locked --out build/wheel
	tests/bounds.sh $(PYTHON) build/wheel/*.whl

clean: ## remove everything that was built
	rm -rf $(VENV) build target dist python/innerattn/_core*.so examples/libraries/.venvs
