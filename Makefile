# One target per habit. Each makes .venv first if it is missing or out of date.
#
#   PYTHON=python3.12   the interpreter to make .venv with; otherwise the first that is found to run, or one
#                       that uv fetches, where uv is there
#   INSTALLER=pip       set-up by pip where uv does not get on with your index or proxy
#   TORCH_INDEX=URL     where Linux takes PyTorch from; empty for pip's own index, which has the CUDA build

.DEFAULT_GOAL := help
.PHONY: help setup setup-demo demo test test-slow test-peers test-oldest test-lab test-jax test-ecosystem bench baselines docs test-site test-links lint clean

PY := .venv/bin/python
PYTHONS := $(or $(PYTHON),$(PY) python3 python3.14 python3.13 python3.12 python3.11)
UNTYPED := --disable-error-code import-not-found --no-warn-unused-ignores --no-warn-unreachable
# Processes without compiled bytes would compile each module again, a fifth of a second of each start.
unexport PYTHONDONTWRITEBYTECODE
LONG := -o faulthandler_timeout=3600
IS_SUPPORTED := import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))

help:
	@echo 'make demo        reproduce the paper, train an agent, write runs/demo/report.html'
	@echo 'make test        lint, types and tests'
	@echo 'make test-slow   in full what make test samples'
	@echo 'make test-peers  the engine against MuJoCo and Exudyn, which it installs'
	@echo 'make test-oldest the wheel on the oldest dependencies that pyproject.toml names, some minutes'
	@echo 'make test-lab    force records and datasets with OpenSim, ezc3d and Minari, in an environment under .lab/'
	@echo 'make test-jax    what runs inside jax.jit, in an environment under .jax/; ARGS="-m smoke": a minute'
	@echo 'make test-ecosystem  every RL library on every id, in environments under .ecosystem/: 6 GB, one to two hours'
	@echo 'make bench       how fast engine and environments are beside MuJoCo, Exudyn and EnvPool'
	@echo 'make baselines   the agents of agents/plans/full.yml, hours; ARGS="--plan nightly": a small part, minutes'
	@echo 'make docs        these pages and the API as a site in build/site'
	@echo 'make test-site   every page of it in Chromium: errors, widths, images, contrast; installs Playwright'
	@echo 'make test-links  links to other sites; needs a network'
	@echo 'make lint        lint and types alone'
	@echo 'make setup       make .venv with what the README commands need'
	@echo 'make clean       remove .venv and the caches; runs/ stays'

setup setup-demo:
	@for python in $(PYTHONS); do \
	  if $$python -c '$(IS_SUPPORTED)' 2>/dev/null; then exec $$python scripts/setup_venv.py $(subst setup-,,$(filter-out setup,$@)); fi; \
	done; \
	if test -z '$(PYTHON)' && command -v uv >/dev/null; then \
	  echo 'no Python 3.11 to 3.14 here: uv fetches 3.13'; \
	  if uv python install --quiet 3.13; then \
	    exec "$$(uv python find 3.13)" scripts/setup_venv.py $(subst setup-,,$(filter-out setup,$@)); \
	  fi; \
	fi; \
	echo 'set-up stopped: no Python 3.11 to 3.14 here ($(PYTHONS)); name one: make PYTHON=/path/to/python, or install uv, which fetches one' >&2; \
	exit 1

demo: setup-demo
	@$(PY) -m agents.demo

# A file's tests stay in one process: the others would make its fixtures again. A process that is lost stays lost: a new one would begin with the
# test that killed the last.
test: setup
	@$(MAKE) --no-print-directory lint
	@echo 'pytest' && $(PY) -m pytest -q -n auto --dist loadfile --max-worker-restart=0

test-slow: setup
	@echo 'pytest -m slow' && $(PY) -m pytest -q $(LONG) -m slow
	@echo 'a million random steps of each id' && HOOF_ENV_STEPS=1e6 $(PY) -m pytest -q $(LONG) tests/envs/test_never_breaks.py -k random_actions

test-peers: setup
	@echo 'pip install mujoco exudyn' && $(PY) -m pip install -q -c constraints.txt -e '.[peers]'
	@echo 'pytest tests/peers' && $(PY) -m pytest -q $(LONG) -m '' tests/peers

test-oldest: setup
	@rm -rf .oldest && $(PY) -m hatchling build -t wheel -d .oldest/dist
	@$(PY) -m uv venv -q -p $(PY) .oldest/venv
	@$(PY) -m uv pip install -q --python .oldest/venv/bin/python --only-binary :all: --resolution lowest-direct -r pyproject.toml --extra render --extra plot --extra export
	@$(PY) -m uv pip install -q --python .oldest/venv/bin/python --no-deps .oldest/dist/*.whl
	@HOOF_ENV_CACHE_DIR=.oldest/cache .oldest/venv/bin/python examples/smoke.py

# Minari and OpenSim would change the versions of .venv. Tests skip where a library is missing: imported first.
test-lab: setup
	@$(PY) -m uv venv -q --allow-existing -p $(PY) .lab
	@$(PY) -m uv pip install -q --python .lab/bin/python -e '.[minari,opensim,onnx,lab,export,dev]'
	@.lab/bin/python -c 'import ezc3d, matplotlib, minari, onnxruntime, opensim, pyarrow'
	@.lab/bin/python -m pytest -q $(ARGS) tests/lab tests/agents/test_dataset.py

# jaxlib is 85 MB to load and 350 MB installed: no part of .venv.
test-jax: setup
	@$(PY) -m uv venv -q --allow-existing -p $(PY) .jax
	@$(PY) -m uv pip install -q --python .jax/bin/python -c constraints.txt -e '.[jax,dev]'
	@.jax/bin/python -c 'import jax'
	@.jax/bin/python -m pytest -q $(ARGS) tests/inside_jax 'tests/test_docs.py::test_examples_run_from_top_to_bottom[docs/jax.md]'

test-ecosystem: setup
	@$(PY) -m tests.ecosystem.run $(ARGS)

bench: setup
	@echo 'pip install mujoco exudyn' && $(PY) -m pip install -q -c constraints.txt -e '.[peers]' || \
	  echo 'some are not there: fewer comparisons'
	@$(PY) -m pip install -q -c constraints.txt envpool || echo 'no EnvPool here: HalfCheetah-v5 stands for it'
	@$(PY) -m benchmarks.speed
	@$(PY) -m benchmarks.env_speed

baselines: setup
	@$(PY) -m agents.experiments $(ARGS)

docs: setup
	@echo 'sphinx' && $(PY) -m sphinx -q -W --keep-going -c docs -d build/doctrees . build/site && echo 'read build/site/index.html'

test-site: docs
	@echo 'pip install playwright axe' && $(PY) -m pip install -q -c constraints.txt -e '.[site]'
	@$(PY) -m tests.site.check $(ARGS)
	@echo 'pytest tests/view/test_browser.py' && $(PY) -m pytest -q tests/view/test_browser.py

test-links: setup
	@$(PY) -m sphinx -q -b linkcheck -c docs -d build/doctrees . build/links

lint: setup
	@echo 'ruff check' && $(PY) -m ruff check -q --output-format concise
	@echo 'ruff format' && $(PY) -m ruff format --check --quiet --output-format concise
	@if $(PY) -c 'import torch' 2>/dev/null; then echo 'mypy' && $(PY) -m mypy; else \
	  echo 'mypy, without agents: there is no PyTorch' && $(PY) -m mypy $(UNTYPED) hoof_env; fi

clean:
	@rm -rf .venv .ecosystem .oldest .lab .jax dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
