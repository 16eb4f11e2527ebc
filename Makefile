# `make bench`: install and run the main job.  `make check`: style and types.  `make speed`: what kernels cost beside rivals.
# `make test`: every kernel, method, scene and command, in minutes.  `make test-rest`: what that only samples.  `make test-both`:
# the two in one run, which makes once what they have in common.  `make test-all`: both, and all pairs of methods and regimes.
# `make test-claims`: what docs claim of a machine.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python -m
PYTEST := $(RUN) pytest -q -n auto --dist loadfile --no-loadscope-reorder

.PHONY: bench test test-rest test-both test-all test-claims check speed clean

bench: $(VENV)/ready
	$(RUN) benchharness run configs/kitchen-quick.toml

test: $(VENV)/ready-dev
	$(PYTEST) -m "not exhaustive and not claims"

test-rest: $(VENV)/ready-dev
	$(PYTEST) -m "exhaustive and not complete and not claims"

test-both: $(VENV)/ready-dev
	$(PYTEST) -m "not complete and not claims"

test-all: $(VENV)/ready-dev
	$(PYTEST) -m "not claims"

test-claims: $(VENV)/ready-dev
	$(RUN) pytest -q -m claims

check: $(VENV)/ready-dev
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/pyright --threads

speed: $(VENV)/ready
	$(RUN) benchharness speed

clean:
	rm -rf $(VENV) build *.egg-info

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/ready: pyproject.toml setup.py | $(VENV)/bin/python
	$(VENV)/bin/pip install --quiet --disable-pip-version-check -e .
	touch $@

$(VENV)/ready-dev: pyproject.toml setup.py | $(VENV)/bin/python
	$(VENV)/bin/pip install --quiet --disable-pip-version-check -e ".[test,dev]"
	touch $@ $(VENV)/ready
