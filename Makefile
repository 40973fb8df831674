# Everything runs in .venv, which `make install` builds; nothing else is needed but Python 3.11 or newer.
# No system package is needed: GTSAM, qdldl, shapely and the node that pyright runs on come as Python wheels.
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3; do command -v $$p >/dev/null 2>&1 && \
  $$p -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: install demo test check bench clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "expected Python 3.11 or newer on the PATH, found none"; exit 2; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	$(BIN)/python -m compileall -q src
	$(BIN)/python -c 'import matplotlib.font_manager' # builds its font cache
	$(BIN)/python -m topobelief.planning.compile_kernels # once a machine, half a minute
	touch $(STAMP)

demo: install
	$(BIN)/topobelief plan examples/office/office.g2o --map examples/office/office.csv --goal 25 -2.95 \
	  --max-detour 2.5 --objective map --out out/demo

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
	rm -rf .venv out dist build
