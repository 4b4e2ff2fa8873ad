# Everything a contributor types. On a fresh machine: Python 3.11, git, make.
PYTHON ?= $(shell for name in python3.11 python3 python; do "$$name" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null && echo "$$name" && break; done)
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test coverage lint format docs picture bench lock clean

demo: $(VENV)/.installed ## run the tutorial's own job
	@$(BIN)/sim-action run examples/turtlebot3/straight_line.sim.yml

test: $(VENV)/.dev ## all tests
	$(BIN)/python -m pytest

coverage: $(VENV)/.dev ## all tests, and which lines none of them reaches
	$(BIN)/python -m pytest --cov --cov-report=term:skip-covered

lint: $(VENV)/.dev ## style, types, layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.dev ## what is generated from the code: the README's tables, the schema
	$(BIN)/python docs/generate.py

picture: $(VENV)/.dev ## the README's picture
	$(BIN)/python docs/picture.py

bench: $(VENV)/.dev ## ratios against the raw engine
	$(BIN)/python -m bench.run

lock: $(VENV)/.installed ## what the action installs
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile pyproject.toml --quiet --upgrade --generate-hashes --python-version 3.11 \
	  --python-platform x86_64-manylinux_2_28 --only-binary :all: --no-annotate --no-emit-index-url \
	  --no-emit-find-links --custom-compile-command 'make lock' --output-file requirements.lock

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "sim-action needs Python 3.11 (its engine, PyBullet, has wheels for no newer one); install python3.11 and its venv module"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) sim-results
