# Every target makes .venv by itself when it is missing or older than the lock.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
DEMO := .venv/.demo
# uv installs in seconds what takes pip most of a minute. It does not read pip's settings: where it
# finds nothing, pip is used instead. Python compiles what is imported: most modules never are.
UV_INSTALL = $(BIN)/uv pip install --quiet --system-certs --python $(BIN)/python
PIP_INSTALL = $(BIN)/pip install --quiet --disable-pip-version-check --no-compile
CHECK_PYTHON = import sys; sys.exit(sys.version_info < (3, 11) and \
  "T2 needs Python 3.11 or newer: make PYTHON=/path/to/python3.11")

# The tests start hundreds of processes. Without cached bytecode each of them compiles T2 anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: demo up test fuzz soak faults vehicles ros2-peer bench rust-example check waiting timed others computing computing-and-search cover simulated search mutants lint format types docs lock audit sbom wheelhouse system-test clean help

docs: $(STAMP) ## renew the generated tables of the documents, and the JSON schemas
	$(BIN)/python -m tools.docs

help:
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

$(STAMP): requirements.lock pyproject.toml sdk/pyproject.toml
	@echo "Installing the packages of services, tools and tests into .venv: once, and after a change of the lock."
	$(PYTHON) -c '$(CHECK_PYTHON)'
	$(PYTHON) -m venv --clear .venv
	awk '/^[^ #]/{on = /^uv==/} on' requirements.lock > .venv/uv.lock
	$(PIP_INSTALL) --require-hashes -r .venv/uv.lock
	$(UV_INSTALL) --require-hashes -r requirements.lock || \
	  $(PIP_INSTALL) --require-hashes -r requirements.lock
	$(PIP_INSTALL) --no-deps --no-build-isolation -e . -e sdk
	touch $@

# The demo needs a fourth of what the tests need; with all of it there, it takes that.
$(DEMO): requirements-demo.lock
	@echo "Installing the packages of the demo into .venv: once, and after a change of the lock."
	$(PYTHON) -c '$(CHECK_PYTHON)'
	$(PYTHON) -m venv --clear .venv
	$(PIP_INSTALL) --require-hashes -r requirements-demo.lock
	touch $@

demo: $(if $(wildcard $(STAMP)),$(STAMP),$(DEMO)) ## a simulated T2 drives a lap through the real services
	PYTHONPATH=sdk $(BIN)/python -m cli demo

up: $(STAMP) ## router, simulated vehicle, bridge, safety, odometry and recorder, until Ctrl-C
	$(BIN)/t2 up

# pytest rewrites the asserts of a file once and keeps the result: otherwise each worker of a fresh
# clone does it for all files. An error shows up in the tests themselves.
REWRITTEN := tests/__pycache__

$(REWRITTEN): | $(STAMP)
	-@$(BIN)/pytest --collect-only -qq tests > /dev/null

# Most tests wait for other processes most of the time. Of the tests that measure times two run at once.
MANY = -n 4 --dist worksteal --durations=20
FEW = -n 2 --dist worksteal --durations=20

# Millions of steps of the cores: tracing them would take three times as long and show nothing new.
SEARCH = tests/search

# Each worker imports each file that it is given: the timed tests get theirs only.
TIMED = $(FEW) $$(grep -rlE --include="test_*.py" "mark.timed|BROWSER_MARKS" tests)

test: $(STAMP) $(REWRITTEN) ## all tests except search and campaigns, with the coverage of the cores
	@$(MAKE) --no-print-directory -j2 --output-sync=line waiting computing

waiting: timed
	@$(MAKE) --no-print-directory others

timed: $(STAMP)
	$(BIN)/pytest $(TIMED) -m "timed and not campaign"

others: $(STAMP)
	$(BIN)/pytest --ignore=$(SEARCH) $$($(CORE_TESTS) | sed 's/[^ ]*/--ignore=&/g') $(MANY) \
	  -m "not timed and not simulated and not campaign"

campaigns: $(STAMP) ## short runs of all campaigns and benchmarks, the tour, the programs of docs/integrate.md
	$(BIN)/pytest tests -m campaign

fuzz: $(STAMP) ## feed hostile bytes to every parser, SECONDS=60 for each target
	$(BIN)/python -m verification.fuzz --seconds $(or $(SECONDS),60) $(TARGET)

soak: $(STAMP) ## faults in random order for MINUTES=30, checking memory and more
	$(BIN)/python -m verification.soak --minutes $(or $(MINUTES),30)

faults: $(STAMP) ## run the fault campaign; renews docs/faults.md
	$(BIN)/python -m verification.faults --out docs/faults.md

bench: $(STAMP) ## compare T2 with other buses, many robots, a bad link; renews docs/performance.md
	$(UV_INSTALL) --require-hashes -r requirements-bench.lock || \
	  $(PIP_INSTALL) --require-hashes -r requirements-bench.lock
	$(BIN)/python -m bench --out docs/performance.md

# Compile examples/rust and drive with it; needs cargo.
rust-example: $(STAMP)
	cd examples/rust && CARGO_TARGET_DIR=$(CURDIR)/out/rust cargo build
	$(BIN)/pytest tests/docs/test_integrate.py -k rust
	cd examples/rust && CARGO_TARGET_DIR=$(CURDIR)/out/rust cargo clippy --quiet -- -D warnings
	cd examples/rust && cargo fmt --check

vehicles: $(STAMP) ## drive N=1000 random vehicles in simulated time; renews docs/vehicles.md
	$(BIN)/python -m verification.search --runs $(or $(N),1000) --out docs/vehicles.md

ros2-peer: $(STAMP) ## test the gateway to ROS 2 with hiroz (with cargo), rclpy and older versions of Zenoh
	$(BIN)/python -m verification.ros2

check: $(STAMP) ## what CI runs: lint, types, test, search, mutants of changed cores
	@$(MAKE) --no-print-directory -j3 --output-sync lint types $(REWRITTEN)
	@$(MAKE) --no-print-directory -j2 --output-sync=line waiting computing-and-search
	@$(MAKE) --no-print-directory mutants CHANGED=1

lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/python -m tools.docs --check

# What only computes takes the CPU that the other tests leave. A busy host only makes it last longer.
COMPUTE = nice -n 19 $(BIN)/pytest -n 2 --dist worksteal --durations=20 --timeout 300

computing: cover
	@$(MAKE) --no-print-directory simulated

computing-and-search: computing
	@$(MAKE) --no-print-directory search

simulated: $(STAMP)
	$(COMPUTE) $$(grep -rl --include="test_*.py" "mark.simulated" tests) -m "simulated and not campaign"

# Random events, 200 random vehicles, and mutations of the protections.
search: $(STAMP)
	$(COMPUTE) $(SEARCH)

CORE_TESTS = $(BIN)/python -m verification.mutation --tests

# Not a branch of a core is untested.
cover: $(STAMP)
	$(BIN)/coverage erase
	$(COMPUTE) --cov --cov-report= $$($(CORE_TESTS))
	$(BIN)/coverage report

mutants: $(STAMP) ## mutation tests of the cores; CHANGED=1: changed files only
	$(BIN)/python -m verification.mutation $(if $(CHANGED),--changed)

types: $(STAMP)
	$(BIN)/mypy

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

LAPTOP = teleop dashboard camera record report foxglove keys ros2
LOCK = $(BIN)/uv pip compile --quiet --system-certs --universal --python-version 3.11 --generate-hashes --no-emit-package t2-sdk \
  --custom-compile-command 'make lock' pyproject.toml

lock: $(STAMP) ## renew the locks, with hashes and without addresses: all sets, robot, demo, dashboard, laptop, bench
	$(LOCK) --upgrade --all-extras -o requirements.lock
	$(LOCK) --constraint requirements.lock --extra record --extra ros2 -o requirements-robot.lock
	$(LOCK) --constraint requirements.lock --extra demo -o requirements-demo.lock
	$(LOCK) --constraint requirements.lock --extra record --extra ros2 --extra dashboard --extra camera -o requirements-dashboard.lock
	$(LOCK) --constraint requirements.lock $(LAPTOP:%=--extra %) -o requirements-laptop.lock
	$(subst pyproject.toml,,$(LOCK)) --constraint requirements.lock --group bench -o requirements-bench.lock
	echo pip | $(subst pyproject.toml,,$(LOCK)) --upgrade - -o deploy/pip.lock

# For a robot without internet: which set, and what its computer is.
SET ?= robot
WHEEL_PYTHON ?= 3.11
WHEEL_ARCH ?= x86_64
HOUSE = build/wheelhouse
DOWNLOAD = $(BIN)/pip download --quiet --disable-pip-version-check --no-deps --require-hashes --only-binary :all: \
  --implementation cp --python-version $(WHEEL_PYTHON) \
  $(foreach glibc,2_28 2_17,--platform manylinux_$(glibc)_$(WHEEL_ARCH)) --platform manylinux2014_$(WHEEL_ARCH) \
  --dest $(HOUSE)

wheelhouse: $(STAMP) ## package set for a robot without internet; SET=laptop WHEEL_PYTHON=3.13 WHEEL_ARCH=aarch64
	rm -rf $(HOUSE)
	mkdir -p $(HOUSE)
	$(DOWNLOAD) -r deploy/pip.lock
	$(DOWNLOAD) -r requirements-$(SET).lock
	$(BIN)/pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w $(HOUSE) . ./sdk
	cp requirements-$(SET).lock $(HOUSE)/requirements.txt
	cp deploy/t2-install.sh $(HOUSE)
	cd $(HOUSE) && set -- t2-*-py3-none-any.whl && version=$${1#t2-} && version=$${version%%-*} && \
	  echo $$version > VERSION && echo "Python $(WHEEL_PYTHON) on $(WHEEL_ARCH)" > PLATFORM && \
	  for wheel in t2-*.whl t2_sdk-*.whl; do \
	    echo "$${wheel%%-*}==$$version --hash=sha256:$$(sha256sum $$wheel | cut -d ' ' -f 1)"; done >> requirements.txt && \
	  sha256sum -- * > SHA256SUMS
	@echo "copy $(HOUSE) to the robot; there: sudo sh wheelhouse/t2-install.sh"

system-test: $(STAMP) ## containers, systemd units and the relay's image, ONLY=relay; needs root, Docker and debootstrap
	$(BIN)/python -m verification.system $(ONLY)

# A tool in an environment of its own, in uv's cache: it adds no dependencies to T2.
TOOL = $(BIN)/uv tool run --quiet --system-certs --python $(BIN)/python --from

# --strict: a package without an answer fails. Behind a blocking proxy every lock would look clean.
audit: $(STAMP) ## known vulnerabilities of FILE=requirements.lock, from a public database
	$(TOOL) pip-audit==2.9.0 pip-audit --strict --disable-pip --require-hashes --progress-spinner off \
	  --requirement $(or $(FILE),requirements.lock)

SBOM = $(TOOL) cyclonedx-bom==7.0.0 cyclonedx-py
SBOM_OPTIONS = --pyproject pyproject.toml --output-reproducible

sbom: $(STAMP) ## bill of materials, installed and robot, as CycloneDX: out/sbom.json, out/sbom-robot.json
	mkdir -p out
	$(SBOM) environment $(SBOM_OPTIONS) --output-file out/sbom.json $(BIN)/python
	$(SBOM) requirements $(SBOM_OPTIONS) --output-file out/sbom-robot.json requirements-robot.lock

# Remove all generated files.
clean:
	rm -rf .venv out mutants .coverage .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis build dist
