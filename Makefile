# `make bench`: install and run the main job.  `make test`, `make test-all`, `make check`, `make speed`: what they say.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python -m

.PHONY: bench test test-all check speed clean

bench: $(VENV)/ready
	$(RUN) benchharness run configs/kitchen-quick.toml

test: $(VENV)/ready-dev
	$(RUN) pytest -q -m "not exhaustive"

test-all: $(VENV)/ready-dev
	$(RUN) pytest -q

check: $(VENV)/ready-dev
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/pyright

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
