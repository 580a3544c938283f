# Needs make and Python 3.11 or newer. Another Python than the one found: make demo PYTHON=/path/to/python3

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= python3.13 python3.12 python3.11 python3
GROUND := pyproject.toml constraints.txt

.DEFAULT_GOAL := help
.PHONY: help demo test lint study clean

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-6s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(VENV)/run.stamp  ## track a city bus with a field of sensor processes
	$(BIN)/trackfield run bus

test: lint  ## lint, types, walls and all tests
	$(BIN)/python -m pytest

lint: $(VENV)/dev.stamp  ## style, types and the walls between the rooms
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

study: $(VENV)/dev.stamp  ## 200 small fields under faults drawn from seeds, 10 of them as processes too (a few minutes)
	$(BIN)/python -m tests.campaign

clean:  ## remove the environment and all caches; run folders stay
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp says that the environment holds what pyproject.toml asks for, as of the stamp's date.
$(VENV)/run.stamp $(VENV)/dev.stamp: $(VENV)/%.stamp: $(GROUND) | $(BIN)/python
	@echo "Installing what Trackfield needs into $(VENV) (a minute or two) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[$*]'
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
