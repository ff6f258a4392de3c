# The dictionary of the project: what can be done here, by name. `make` alone lists it.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# One more than the processors of a small machine: some tests wait for clocks and other programs.
JOBS ?= 3
MINUTES ?= 60
COVERAGE ?=
# Dozens of programs are started below: none of them is to compile what another has compiled.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test lint lint-types lint-style format bench fuzz kills reliability screenshots fixtures refs docs docs-samples reference lock clean

help:  ## List the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed: make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps --editable .
	@touch $@

demo: $(READY)  ## Record a fixture flight, decode it, and show how right it is
	@rm -rf demo
	$(BIN)/recorder run --config fixtures/demo.yaml
	$(BIN)/recorder info demo/*.mcap
	$(BIN)/decode demo/*.mcap -o demo
	$(BIN)/decode accuracy demo/*.csv fixtures/thesis_a1_truth.csv

test: $(READY)  ## Run all tests; with COVERAGE=yes, which takes longer, hold them to the coverage floor
	$(BIN)/pytest -n $(JOBS) --dist loadgroup $(if $(COVERAGE),--cov --cov-report=term:skip-covered)

lint: lint-types lint-style  ## Check style, types and import contracts

lint-types: $(READY)
	$(BIN)/mypy

lint-style: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports

format: $(READY)  ## Put the code in the house style
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(READY)  ## Measure accuracy and speed beside the thesis's tables
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.pose

fuzz: $(READY)  ## Give the programs hostile files for an hour (MINUTES=5 for less), and look for faults
	$(BIN)/python -m fuzzing --minutes $(MINUTES)

kills: $(READY)  ## Kill the recorder 200 times and look for what is lost
	$(BIN)/python -m benchmarks.kills

reliability: $(READY)  ## Harm recorders in every way we know, and write docs/reliability.md
	$(BIN)/python -m benchmarks.reliability --write

screenshots: $(READY)  ## Take the documents' pictures of the real pages
	$(BIN)/python -m benchmarks.screenshots

fixtures: $(READY)  ## Render the cockpit animation and record its flights
	$(BIN)/python -m fixtures.make

refs: $(READY)  ## Renew the reference flight data knowingly, and print what moved
	$(BIN)/python -m tests.references.renew

docs: $(READY)  ## Check that the documents' commands and files are there
	$(BIN)/pytest -q tests/docs

docs-samples: $(READY)  ## Renew what the documents show of commands' output
	$(BIN)/python -m tests.docs.samples

reference: $(READY)  ## Write docs/reference from the code
	$(BIN)/python -m docs_pages

lock: $(READY)  ## Renew the desk's and the box's requirements.lock from pyproject.toml
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
		--python-version 3.11 --all-extras --group dev --upgrade pyproject.toml --output-file requirements.lock
	$(BIN)/python systemd/box_requirements.py > .venv/box_requirements.in
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
		--python-version 3.11 --constraint requirements.lock .venv/box_requirements.in --output-file systemd/requirements.lock
	$(BIN)/python systemd/box_requirements.py video > .venv/box_video.in
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
		--python-version 3.11 --constraint requirements.lock .venv/box_video.in --output-file systemd/requirements-video.lock

clean:  ## Remove what the other targets made
	rm -rf .venv demo fixtures/rendered .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage*
