# Two commands do everything on a fresh machine with Python 3.11: `make demo` and `make test`.
# Each target makes the virtual environment that it needs by itself.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow page-pictures notebooks lint format soak bench bench-diagnosis results bundle wheel deb translations api clean

help: ## List the targets.
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-16s %s\n", $$1, $$2}'

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[edge,trainer,exchange,postgresql,dev]'
	@touch $@

demo: $(STAMP) ## Run the whole loop on a virtual greenhouse with an undeclared effect (five to fifteen minutes).
	$(BIN)/python config/demo/run.py --out out/demo

# One thread of linear algebra a process: more of them wait for each other beside other processes, and burn twice the time.
# They start hundreds of others, so what Python has compiled is kept, whatever the environment says.
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/pytest --dist worksteal

# Five processes on two cores, since many tests wait for a daemon, a line or a clock.
test: $(STAMP) ## Run the tests but the slow ones (ten minutes on two fast cores, twenty on slow ones).
	$(PYTEST) -n 5 -m 'not slow and not soak and not notebooks' tests

test-slow: $(STAMP) ## Run the tests of whole diagnoses, calibrations, trainings and seasons (some twelve minutes).
	$(PYTEST) -n 2 -m slow tests

page-pictures: $(STAMP) ## Take the pictures of docs/page.md anew (needs Chromium).
	IGROW_PICTURES=1 $(BIN)/pytest tests/page/test_page_in_a_browser.py

lint: $(STAMP) ## Run ruff and strict mypy, on the notebooks too.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/nbqa 'mypy --allow-untyped-calls --no-warn-unused-ignores' docs
	MYPYPATH=config/demo $(BIN)/mypy config/demo

format: $(STAMP) ## Format the code.
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

notebooks: $(STAMP) ## Run the documentation's notebooks from end to end.
	$(BIN)/pytest -m notebooks tests/notebooks

soak: $(STAMP) ## Run the long tests: fault sequences, kill -9, thirty days of plant time.
	$(BIN)/pytest -n 2 --dist worksteal -m soak tests

bench: $(STAMP) ## Print the benchmarks, as ratios measured side by side.
	$(BIN)/python -m benchmarks

bench-diagnosis: $(STAMP) ## Print what the diagnosis tells of virtual greenhouses (long).
	$(BIN)/python -m benchmarks.diagnosis same

results: $(STAMP) ## Write the tables of docs/results that are quick to make (the long ones: python -m benchmarks.results --long).
	$(BIN)/python -m benchmarks.results

bundle: $(STAMP) ## Rebuild the default bundle in igrow_core/default_bundle.
	$(BIN)/igrow-trainer bundle --out igrow_core/default_bundle

wheel: $(STAMP) ## Build source and wheel into dist, check them, and try the gateway's commands in an empty environment.
	rm -rf dist build
	$(BIN)/python -m build --outdir dist .
	$(BIN)/twine check --strict dist/*
	$(PYTHON) -m venv --clear dist/venv
	dist/venv/bin/pip install --quiet --disable-pip-version-check "$$(ls dist/*.whl)[edge]"
	dist/venv/bin/igrow-edge --version
	dist/venv/bin/igrow-edge check-config config/daemon.yaml

deb: ## Build the gateway's Debian package into dist, and try it in a throw-away root (on Debian, as root).
	sh systemd/build-deb.sh dist
	sh systemd/try-deb.sh dist/igrow-edge_*.deb

translations: $(STAMP) ## Add new texts to the trainer's languages, and tell which are untranslated.
	$(BIN)/python -m tests.language.catalogues

api: $(STAMP) ## Write the pages of the Python interface to out/api.
	$(BIN)/pdoc --docformat google --output-directory out/api igrow

clean: ## Remove the virtual environment and all output.
	rm -rf $(VENV) out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
