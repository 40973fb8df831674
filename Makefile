# Everything runs in .venv, which `make install` builds; nothing else is needed but Python 3.11 or newer.
# GTSAM, qdldl, MuJoCo and the node that pyright runs on come as Python wheels. One system package is installed if it is not there
# and apt-get may: chromium, in which the tests open the report of `topobelief reproduce`. Without it those tests are skipped.
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3; do command -v $$p >/dev/null 2>&1 && \
  $$p -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: install demo docs test test-ros check bench clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "expected Python 3.11 or newer on the PATH, found none"; exit 2; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	$(BIN)/python -m compileall -q src
	$(BIN)/python -c 'import matplotlib.font_manager' # builds its font cache
	$(BIN)/python -m topobelief.search.compile_kernels # once a machine, half a minute
	@command -v chromium >/dev/null 2>&1 || { echo "installing chromium, for the tests of the report"; \
	  { apt-get update && apt-get install -y --no-install-recommends chromium; } >/dev/null 2>&1 || echo "not installed: these tests are skipped"; }
	touch $(STAMP)

demo: install
	$(BIN)/topobelief plan examples/office/recorded.g2o --map examples/office/recorded.yaml --goal 25 -2.95 \
	  --max-detour 1.6 --seconds 10 --out out/demo

docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "open out/site/index.html"

test: install
	$(BIN)/python -m pytest -n auto

check: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

bench: install
	$(BIN)/python benchmarks/first_answers.py
	$(BIN)/python -m pytest -o addopts= -q benchmarks/kernels.py --benchmark-columns=min,median,max --benchmark-sort=name

clean:
	rm -rf .venv .venv-ros out dist build

# The node across processes, with ROS 2 as wheels in an environment of their own; Python 3.11, for which they are made.
ROS := .venv-ros/bin
$(ROS)/.installed: pyproject.toml constraints-ros.txt
	test -x $(ROS)/python || python3.11 -m venv .venv-ros
	$(ROS)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -r constraints-ros.txt -e '.[fast]' hypothesis pytest
	touch $@

test-ros: install
	@if command -v python3.11 >/dev/null 2>&1; then $(MAKE) --no-print-directory $(ROS)/.installed && \
	  $(ROS)/python -m pytest -W ignore::DeprecationWarning tests/ros; else echo "not run: the wheels of ROS 2 need Python 3.11"; fi
