# Everything that needs only python3, make and git on the machine.
BIN := .venv/bin
UV := $(BIN)/uv pip
CORES := $(shell nproc 2>/dev/null || echo 2)

# Tests start many processes: what one has compiled of Python's sources the next ones need not.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test chromium check format types bench lock setup
setup: .venv/.installed

.venv/.installed: requirements.lock pyproject.toml
	python3 -m venv .venv
	$(BIN)/python -m pip install --quiet "$$(grep -o '^uv==[^ ]*' requirements.lock)"
	$(UV) sync --quiet --python $(BIN)/python --require-hashes requirements.lock
	$(UV) install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	touch $@

demo: setup
	$(BIN)/airlens demo

# Two workers more than cores: tests wait for browsers, devices and other processes a quarter of their time.
# One thread of BLAS each: on a busy core two wait for one another, ten times as long as they work.
test: export OPENBLAS_NUM_THREADS := 1
test: setup chromium
	$(BIN)/python -m pytest -n $$(($(CORES) + 2)) --dist loadscope

# Debian's browser for the tests of the page; where it cannot be installed they are skipped and say so.
chromium:
	@command -v chromium >/dev/null || { [ "$$(id -u)" = 0 ] && apt-get update -qq \
	  && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; } >/dev/null 2>&1 \
	  || echo "No chromium here: the browser tests will be skipped."

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache
	$(BIN)/deptry .
	$(BIN)/python web/hatch_build.py check

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	$(BIN)/python web/hatch_build.py format

# The page's types of the API, from the service's own description.
types: setup
	$(BIN)/python web/schema.py

bench: setup
	$(BIN)/airlens bench --help

lock: .venv/.installed
	$(UV) compile --quiet --universal --generate-hashes --no-header --no-annotate --python-version 3.11 \
	  --group dev --extra raw pyproject.toml --output-file requirements.lock
