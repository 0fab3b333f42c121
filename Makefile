# Everything a developer calls. Each target sets up what it needs; `make` alone lists them.

BIN     := .venv/bin
MEMBERS := $(patsubst %/,%,$(dir $(wildcard schemas/pyproject.toml core/pyproject.toml backends/*/pyproject.toml \
             plugins/*/pyproject.toml tasks/pyproject.toml)))
# What is installed: all packages, and with the first call of a target that needs them the tools of a dependency group.
STAMP := .venv/installed
TEST  := .venv/with-test
CHECK := .venv/with-check
SITE  := .venv/with-site
TORCH := .venv-torch/installed
PEERS := .venv-peers/installed
LEROBOT := .venv-lerobot/installed
ROBOMIMIC := .venv-lerobot/with-robomimic
RLDS := .venv-rlds/installed
STRANDS := .venv-strands/installed
OPENENV := .venv-openenv/installed
VLA := .venv-vla/installed
RERUN := .venv-rerun/installed
MCPOLD := .venv-mcp-old/installed
RAY := .venv-ray/installed
NODE := .node-mcap/installed

# The demo: a scripted robot picks cubes in four worlds at once, records it, and a picture shows what happened. Then
# every installed engine gets the same world, and a page shows how far they agree.
DEMO_OUT ?= runs/demo

# More words for pytest: make test ARGS="-k pose -x"
ARGS ?=
# A worker for each core, each with engines of its own and up to 3 GB. One process: make test ARGS="-n 0"
# What Python compiles is kept where PYTHONDONTWRITEBYTECODE is set too: pytest compiles 600 files of tests, in each worker.
PYTEST = PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n auto --maxprocesses 8 --dist loadgroup

# An environment of its own, in which the packages of .venv are too.
define beside
$(BIN)/python -m venv $(1)
$(BIN)/python -c 'import sysconfig; print("import site; site.addsitedir(%r)" % sysconfig.get_path("purelib"))' \
  > $(1)/lib/$$($(BIN)/python -c 'import sys; print("python%d.%d" % sys.version_info[:2])')/site-packages/anysim.pth
endef

.DEFAULT_GOAL := help
.PHONY: help venv demo test test-slow test-full test-learning test-maniskill test-lerobot test-robomimic test-rlds test-strands test-openenv test-vla test-rerun test-viewers test-mcp-old test-ray check format lock schema docs site bench wheels clean

help:  ## list the targets
	@echo "make TARGET, where TARGET is one of"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1|\2/p' Makefile | awk -F'|' '{printf "%-12s %s\n", $$1, $$2}'

venv: $(STAMP)  ## make .venv with all packages (editable), ready to use

# Runs again only when one of these files changed.
$(STAMP): pyproject.toml constraints.txt scripts/setup.sh $(addsuffix /pyproject.toml,$(MEMBERS))
	@scripts/setup.sh $(MEMBERS)
	@touch $@

.venv/with-%: $(STAMP)
	@scripts/setup.sh --group $*
	@touch $@

demo: $(STAMP)  ## run a pick-and-place task in four worlds, record it, draw a picture, and compare the engines
	@scripts/demo.sh $(DEMO_OUT)

test: $(TEST)  ## run the tests that are neither marked slow nor full (minutes), on all cores
	$(PYTEST) -m "not slow and not full" $(ARGS)

test-slow: $(TEST)  ## run the tests that are marked slow
	$(PYTEST) -m "slow and not full" $(ARGS)

test-full: $(TEST) test-learning  ## run every test, those that are marked full too (hours): before a release
	$(PYTEST) $(ARGS)

test-learning: $(TORCH)  ## run the tests of the learners and their example, in an environment with torch (gigabytes where CUDA is)
	OMP_NUM_THREADS=1 .venv-torch/bin/python -m pytest -n 0 tests/plugins/learning/test_learners.py tests/plugins/learning/test_kill.py \
	  tests/plugins/policy \
	  tests/docs/test_docs.py::test_the_example_with_stable_baselines_trains \
	  tests/docs/test_starter.py::test_its_learner_trains_stops_and_goes_on $(ARGS)

# The packages of .venv, and what the learners need beside them.
$(TORCH): $(TEST) plugins/learning/pyproject.toml
	$(call beside,.venv-torch)
	.venv-torch/bin/python -m pip install --quiet torch
	.venv-torch/bin/python -m pip install --quiet $$($(BIN)/python scripts/extra_requirements.py plugins/learning torch sb3 rsl)
	@touch $@

test-maniskill: $(PEERS)  ## run the checks against ManiSkill and robosuite, in an environment with torch
	.venv-peers/bin/python -m pytest -n 0 tests/plugins/maniskill tests/plugins/evaluation/test_external.py $(ARGS)

# robosuite without its dependencies: it pins a package that needs an older numpy, and its verdicts do not use it.
$(PEERS): $(TEST) plugins/maniskill/pyproject.toml plugins/evaluation/pyproject.toml
	$(call beside,.venv-peers)
	.venv-peers/bin/python -m pip install --quiet torch
	.venv-peers/bin/python -m pip install --quiet $$($(BIN)/python scripts/extra_requirements.py plugins/maniskill torch maniskill) \
	  $$($(BIN)/python scripts/extra_requirements.py plugins/evaluation gymnasium-robotics)
	.venv-peers/bin/python -m pip install --quiet --no-deps robosuite==1.5.2
	.venv-peers/bin/python -m pip install --quiet termcolor opencv-python-headless
	@touch $@

test-lerobot: $(LEROBOT)  ## run the checks with LeRobot's own loader and evaluation, in an environment with torch
	.venv-lerobot/bin/python -m pytest -n 0 -s tests/plugins/export/test_lerobot_loader.py \
	  tests/plugins/adapters/test_lerobot_env.py $(ARGS)

# lerobot without its dependencies: they pin an older torch, numpy and PyAV, bring viewers, and its loader does without.
# torchvision is the last one whose reader of videos lerobot 0.4 finds.
$(LEROBOT): $(TEST) plugins/export/pyproject.toml
	$(call beside,.venv-lerobot)
	.venv-lerobot/bin/python -m pip install --quiet torch==2.13.0
	.venv-lerobot/bin/python -m pip install --quiet --no-deps lerobot==0.4.4 torchvision==0.25.0
	.venv-lerobot/bin/python -m pip install --quiet "datasets>=4,<5" "huggingface-hub<0.36" "diffusers<0.36" accelerate einops \
	  jsonlines deepdiff draccus==0.10.0 termcolor imageio pyserial opencv-python-headless safetensors
	@touch $@

test-robomimic: $(ROBOMIMIC)  ## run the checks against robomimic's own loader, in the environment of test-lerobot
	.venv-lerobot/bin/python -m pytest -n 0 -s tests/plugins/export/test_robomimic_loader.py $(ARGS)

# robomimic without its dependencies: its loader and algorithms need few of them, and egl_probe is compiled from source.
$(ROBOMIMIC): $(LEROBOT)
	.venv-lerobot/bin/python -m pip install --quiet --no-deps robomimic==0.3.0
	.venv-lerobot/bin/python -m pip install --quiet termcolor tqdm psutil
	@touch $@

test-rlds: $(RLDS)  ## run the checks against TFDS's own builder and reader, in an environment with TensorFlow
	.venv-rlds/bin/python -m pytest -n 0 -s tests/plugins/export/test_rlds.py $(ARGS)

$(RLDS): $(TEST)
	$(call beside,.venv-rlds)
	.venv-rlds/bin/python -m pip install --quiet tensorflow-cpu tensorflow-datasets
	@touch $@

test-strands: $(STRANDS)  ## run the checks under strands-robots' own runner and benchmarks, in an environment with it
	.venv-strands/bin/python -m pytest -n 0 tests/plugins/adapters/test_strands.py $(ARGS)

# strands-robots without its dependencies, which pin an older Pillow and OpenCV. It asks for Python 3.12; on 3.11 its few
# generic functions are rewritten, and all else is as it was released.
$(STRANDS): $(TEST) plugins/adapters/pyproject.toml
	$(call beside,.venv-strands)
	.venv-strands/bin/python -m pip install --quiet "strands-agents>=1.57.2,<2"
	.venv-strands/bin/python -m pip install --quiet --no-deps --ignore-requires-python strands-robots==0.5.3
	.venv-strands/bin/python scripts/older_generics.py strands_robots
	@touch $@

test-openenv: $(OPENENV)  ## run the checks with OpenEnv's own client, in an environment with it
	.venv-openenv/bin/python -m pytest -n 0 tests/plugins/adapters/test_openenv.py $(ARGS)

$(OPENENV): $(TEST) plugins/adapters/pyproject.toml
	$(call beside,.venv-openenv)
	.venv-openenv/bin/python -m pip install --quiet openenv==0.10.0
	@touch $@

test-vla: $(VLA)  ## run the checks with openpi's own client and under vla-eval's harness, in an environment with both
	.venv-vla/bin/python -m pytest -n 0 tests/plugins/adapters/test_openpi.py tests/plugins/adapters/test_vla_eval.py $(ARGS)

# openpi-client without its dependencies, which pin an older numpy; it runs with the present one.
$(VLA): $(TEST) plugins/adapters/pyproject.toml
	$(call beside,.venv-vla)
	.venv-vla/bin/python -m pip install --quiet dm-tree vla-eval==0.8.0
	.venv-vla/bin/python -m pip install --quiet --no-deps openpi-client==0.1.2
	@touch $@

test-rerun: $(RERUN)  ## run the checks with Rerun's own reader, in an environment with rerun-sdk
	.venv-rerun/bin/python -m pytest -n 0 -s tests/plugins/export/test_rerun.py $(ARGS)

$(RERUN): $(TEST) plugins/export/pyproject.toml
	$(call beside,.venv-rerun)
	.venv-rerun/bin/python -m pip install --quiet $$($(BIN)/python scripts/extra_requirements.py plugins/export rerun)
	@touch $@

test-viewers: $(RERUN) $(NODE)  ## open recordings and their export with the MCAP readers of Foxglove (npm) and Rerun
	.venv-rerun/bin/python -m pytest -n 0 -s tests/plugins/mcap/test_viewers.py $(ARGS)

$(NODE):
	npm install --prefix .node-mcap --silent --no-fund --no-audit --ignore-scripts \
	  @mcap/core@2.2.2 @mcap/nodejs@1.0.2 @mcap/support@1.1.0
	@touch $@

test-mcp-old: $(MCPOLD)  ## run the checks of the agents' server with version 1 of the protocol's SDK
	.venv-mcp-old/bin/python -m pytest -n 0 tests/plugins/agents/test_mcp_1.py $(ARGS)

$(MCPOLD): $(TEST)
	$(call beside,.venv-mcp-old)
	.venv-mcp-old/bin/python -m pip install --quiet "mcp>=1.30,<2"
	@touch $@

test-ray: $(RAY)  ## run jobs on a Ray cluster of two nodes on this machine, and kill its nodes, in an environment with Ray
	.venv-ray/bin/python -m pytest -n 0 -s tests/plugins/ray $(ARGS)

$(RAY): $(TEST) plugins/ray/pyproject.toml
	$(call beside,.venv-ray)
	.venv-ray/bin/python -m pip install --quiet $$($(BIN)/python scripts/extra_requirements.py plugins/ray ray)
	@touch $@

CHECKS := check-lint check-format check-style check-layers check-schema check-tables check-types check-site
check: $(CHECKS)  ## lint, format, types, layers, style and generated files (make -k check: do not stop at the first)
.PHONY: $(CHECKS)
$(CHECKS): $(CHECK)
check-lint:
	$(BIN)/ruff check
check-format:
	$(BIN)/ruff format --check
check-style:
	$(BIN)/python scripts/check_style.py
check-layers:
	$(BIN)/lint-imports --no-cache --no-logo
check-schema:
	$(BIN)/python -m anysim_schemas.jsonschema --check schemas/json
check-tables:
	$(BIN)/python scripts/capability_table.py --check
	$(BIN)/python scripts/axes_table.py --check
	$(BIN)/python scripts/export_table.py --check
	$(BIN)/python scripts/term_table.py --check
	$(BIN)/python scripts/command_table.py --check
	$(BIN)/python scripts/limits_table.py --check
	$(BIN)/python scripts/importing_table.py --check
	$(BIN)/python scripts/matter_table.py --check
	$(BIN)/python scripts/robot_table.py --check
	$(BIN)/python scripts/benchmark_table.py --check
	$(BIN)/python scripts/walking_table.py --check
	$(BIN)/python scripts/navigation_table.py --check
	$(BIN)/python scripts/task_gallery.py --check
	$(BIN)/python scripts/task_pages.py --check
	$(BIN)/python scripts/task_robots.py --check
	$(BIN)/python scripts/household_table.py --check
	$(BIN)/python scripts/install_sizes.py --check
check-types:
	$(BIN)/pyright
check-site: site

format: $(CHECK)  ## format the code and fix what ruff can fix
	$(BIN)/ruff check --fix --exit-zero
	$(BIN)/ruff format

lock: $(CHECK)  ## write constraints.txt after a change of dependencies
	$(BIN)/python scripts/lock.py

schema: $(STAMP)  ## write the JSON Schemas that editors complete YAML from
	$(BIN)/python -m anysim_schemas.jsonschema schemas/json

docs: schema $(TEST)  ## write what is generated and run the examples of docs/
	$(BIN)/python scripts/capability_table.py
	$(BIN)/python scripts/axes_table.py
	$(BIN)/python scripts/export_table.py
	$(BIN)/python scripts/term_table.py
	$(BIN)/python scripts/command_table.py
	$(BIN)/python scripts/limits_table.py
	$(BIN)/python scripts/importing_table.py
	$(BIN)/python scripts/matter_table.py
	$(BIN)/python scripts/robot_table.py
	$(BIN)/python scripts/household_table.py
	$(BIN)/python -m pytest tests/docs $(ARGS)

site: $(SITE)  ## build the documentation with its API pages into build/site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open build/site/index.html; searching needs a server: $(BIN)/python -m http.server -d build/site"

bench: $(TEST)  ## measure speed against the budgets, as ratios
	$(BIN)/anysim bench step $(ARGS)
	@set -e; for program in $(wildcard benchmarks/*.py); do echo "$$program"; $(BIN)/python $$program; done
	$(BIN)/anysim bench plan

wheels: $(STAMP)  ## build the wheels of all packages into dist/ (docs/install.md)
	@rm -rf dist
	@PATH="$$PATH:.venv-tools/bin" uv build --quiet --all-packages --wheel --out-dir dist
	@scripts/wheel_list.sh dist
	@ls dist

clean:  ## remove .venv, caches, wheels and the demo's output; other recordings stay
	rm -rf .venv .venv-tools .venv-torch .venv-lerobot .venv-rlds .venv-strands .venv-openenv .venv-vla .venv-rerun .venv-ray .node-mcap .cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache build dist runs/demo
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
