# Needs make and Python 3.11 or newer. Another Python than the one found: make demo PYTHON=/path/to/python3

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= python3.13 python3.12 python3.11 python3
GROUND := pyproject.toml constraints.txt

# Containers (docs/containers.md); BASE may be any image with Python 3.11 or newer, venv and glibc. If unset, one is found.
BASE ?=
IMAGE ?= trackfield
EXTRAS ?= run,dask
NODES ?=
SCENARIO ?= zhai-spcpf --nodes 25 --set field.spacing_m=75 --set sensor.threshold=0.6

.DEFAULT_GOAL := help
.PHONY: help demo test lint study bench base-image image certificates field clean

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(VENV)/run.stamp  ## track a city bus with a field of sensor processes
	$(BIN)/trackfield run bus

test: lint  ## lint, types, walls and all tests
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m "not alone and not long"
	$(BIN)/python -m pytest -m "alone and not long"

lint: $(VENV)/dev.stamp  ## style, types and the walls between the rooms
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

study: $(VENV)/dev.stamp  ## campaigns of faults, chaos and hostile peers drawn from seeds, the tables of docs/studies.md and docs/papers.md (an hour)
	$(BIN)/python -m tests.campaign
	$(BIN)/python -m pytest -m long
	$(BIN)/python -m tests.protocols.study
	$(BIN)/python -m tests.chaos
	$(BIN)/python -m tests.hostile
	$(BIN)/python -m tests.hostile --secure
	$(BIN)/python -m tests.studies
	$(BIN)/trackfield reproduce zhai --runs 300
	$(BIN)/trackfield reproduce yang --runs 500
	$(BIN)/trackfield reproduce yu --kernels --runs 400
	$(BIN)/trackfield reproduce yu --runs 6
	$(BIN)/trackfield reproduce zhou --kernels --runs 500
	$(BIN)/trackfield reproduce zhou --runs 3
	$(BIN)/trackfield reproduce ozfidan --runs 100

bench: $(VENV)/bench.stamp build/peers  ## what runs and filters cost, how that grows, and others beside it (20 minutes)
	$(BIN)/python -m bench.scale
	$(BIN)/python -m bench.ready
	$(BIN)/python -m bench.slices
	$(BIN)/python -m bench.memory
	$(BIN)/python -m bench.latency
	$(BIN)/python -m bench.start
	$(BIN)/python -m bench.recorder
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=build/peers $(BIN)/python -m bench.kernels
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.growth
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.passes
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.hearing
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.camera
	$(BIN)/python -m bench.guard

base-image:  ## the image that ours stands on: the official slim Python, or one from Debian packages
	@containers/base

image: | $(BIN)/python  ## the images: IMAGE:node for processes that sense and send, IMAGE:full for all others
	@containers/engine
	@base=$(BASE); base=$${base:-$$(containers/base)} && \
	containers/wheels "$$base" $(BIN)/python "$(EXTRAS)" && \
	for target in node full; do \
		docker build --quiet --tag "$(IMAGE):$$target" --target "$$target" \
			--build-arg BASE="$$base" --build-arg EXTRAS="$(EXTRAS)" . || exit; \
	done

certificates:  ## those of a run of SCENARIO in containers, in build/certificates, for docker compose --profile SCENARIO up
	rm -rf build/certificates
	TRACKFIELD_IMAGE=$(IMAGE) TRACKFIELD_USER=$$(containers/user) containers/certificates build/certificates $(SCENARIO) \
		$(if $(NODES),--nodes $(NODES))

field:  ## track a vehicle with 25 containers, or run another SCENARIO, from the image to the run folder in runs/
	@containers/compose >/dev/null
	@$(MAKE) --no-print-directory image
	TRACKFIELD_IMAGE=$(IMAGE) containers/field $(SCENARIO) $(if $(NODES),--nodes $(NODES))

clean:  ## remove the environment and all caches; run folders stay
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp says that the environment holds what pyproject.toml asks for, as of the stamp's date.
$(VENV)/run.stamp $(VENV)/dev.stamp $(VENV)/bench.stamp: $(VENV)/%.stamp: $(GROUND) | $(BIN)/python
	@echo "Installing what Trackfield needs into $(VENV) (a minute or two) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[$*]'
	@touch $@

# particles asks for a numpy older than ours and works with ours: installed beside, without what it asks for.
build/peers: $(VENV)/bench.stamp
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --upgrade --target $@ particles==0.4 numba==0.68.1 llvmlite==0.50.0
	@touch $@

$(BIN)/python:
	@for python in $(PYTHON); do \
		if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
			"$$python" -m venv $(VENV) && exit 0; \
			rm -rf $(VENV); \
			echo "$$python cannot make a virtual environment (on Debian: apt install python3-venv)" >&2; \
			exit 1; \
		fi; \
	done; \
	echo "Trackfield needs Python 3.11 or newer; tried: $(PYTHON). Name yours: make demo PYTHON=..." >&2; \
	exit 1
