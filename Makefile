# gliderwatch. `make` alone lists the targets.

PYTHON ?= python3
# Wheels only, so that nothing is compiled behind your back. dbdreader has none for CPython 3.14
# and for ARM: there, `make test WHEELS=` builds that one from source.
WHEELS ?= --only-binary :all:
# pytest processes: two for each core of a small machine, as many tests wait for what is due. Those
# marked `timing` always run alone.
JOBS ?= 4
# Of `make chaos`: how long it takes, and what all its moments follow from.
MINUTES ?= 30
SEED ?= 1
UV_VERSION := 0.13.9
CYCLONEDX_VERSION := 7.5.0

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
WHEELHOUSE := dist/wheelhouse

.DEFAULT_GOAL := help
.PHONY: help install test test-all chaos demo lint format types contracts docs audit sbom wheelhouse lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

# The locked packages, then the project itself in place: a second run finds both stamps and does nothing.
$(VENV)/locked: requirements-dev.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "gliderwatch needs Python 3.11 or later: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv --clear $(VENV)
	$(PIP) install --quiet --require-hashes $(WHEELS) -r requirements-dev.lock
	@touch $@

$(VENV)/installed: $(VENV)/locked pyproject.toml
	$(PIP) install --quiet --no-deps --no-build-isolation --no-index --editable .
	@touch $@

install: $(VENV)/installed ## install gliderwatch and its tools into .venv, from the lock

# Hundreds of tests start the service: its modules are compiled once, whatever the environment says.
test test-all: export PYTHONDONTWRITEBYTECODE =
test: SLOW := and not slow

test: $(VENV)/installed ## run the tests, in some 5 minutes on 2 cores; those that measure time first and alone
	$(PYTEST)

test-all: $(VENV)/installed ## the same, and those marked `slow`: the long versions of what the others test too
	$(PYTEST)

define PYTEST
@mkdir -p build; rm -f build/tests-*.xml; failed=0; \
$(BIN)/python -m pytest -m "timing $(SLOW)" $$(grep -rl "mark[.]timing" tests --include="*.py") --junit-xml=build/tests-timing.xml || [ $$? -eq 5 ] || failed=1; \
$(BIN)/python -m pytest -m "not timing $(SLOW)" -n $(JOBS) --dist loadfile --no-loadscope-reorder --junit-xml=build/tests-main.xml || failed=1; \
exit $$failed
endef

chaos: $(VENV)/installed ## half an hour of faults at random moments, then a comparison with an undisturbed replay
	$(BIN)/python benchmarks/chaos.py --minutes $(MINUTES) --seed $(SEED)

demo: $(VENV)/installed ## a small dockserver, a faulty glider, the daemon, and the alert as it arrives
	$(BIN)/python demo/demo.py

lint: $(VENV)/installed ## ruff: rules and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/installed ## let ruff mend what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(VENV)/installed ## mypy, strict, on src
	$(BIN)/mypy

contracts: $(VENV)/installed ## who may import what (.importlinter)
	$(BIN)/lint-imports

docs: $(VENV)/installed ## make what in docs/ comes from the code
	$(BIN)/python docs/generate.py

audit: $(VENV)/installed ## is what is locked installed just so, and is a weakness known of it?
	$(BIN)/python .ci/audit.py requirements.lock

sbom: ## what the service is made of, as CycloneDX: dist/gliderwatch.cdx.json
	$(PYTHON) -m venv build/sbom
	build/sbom/bin/python -m pip install --quiet cyclonedx-bom==$(CYCLONEDX_VERSION)
	@mkdir -p dist
	build/sbom/bin/cyclonedx-py requirements --pyproject pyproject.toml --of JSON -o dist/gliderwatch.cdx.json requirements.lock
	@echo "dist/gliderwatch.cdx.json"

wheelhouse: $(VENV)/installed sbom ## everything a machine without internet needs, in one archive
	rm -rf $(WHEELHOUSE)
	$(PIP) download --quiet --require-hashes $(WHEELS) -r requirements.lock -d $(WHEELHOUSE)
	$(PIP) wheel --quiet --no-deps --no-build-isolation --no-index -w $(WHEELHOUSE) .
	cp -r requirements.lock config systemd docs README.md CONTRIBUTING.md CHANGELOG.md LICENSE $(WHEELHOUSE)
	mkdir $(WHEELHOUSE)/benchmarks && cp benchmarks/*.md $(WHEELHOUSE)/benchmarks
	cp dist/gliderwatch.cdx.json $(WHEELHOUSE)
	$(BIN)/python docs/shell.py $(WHEELHOUSE)/share
	tar -C dist -czf dist/gliderwatch-wheelhouse.tar.gz wheelhouse
	@echo "dist/gliderwatch-wheelhouse.tar.gz: for $$($(BIN)/python -V) on $$(uname -m); see docs/install.md"

# The tests' lock takes the runtime's as its bounds, so that what is tested is what is installed.
lock: ## choose the newest packages anew and write both lock files
	$(PYTHON) -m venv build/uv
	build/uv/bin/python -m pip install --quiet uv==$(UV_VERSION)
	build/uv/bin/uv pip compile $(UV_FLAGS) $(EXTRAS) pyproject.toml -o requirements.lock
	build/uv/bin/uv pip compile $(UV_FLAGS) $(EXTRAS) -c requirements.lock --group dev pyproject.toml -o requirements-dev.lock

EXTRAS = --extra ais --extra archive --extra maps --extra relays --extra web
UV_FLAGS = --no-config --quiet --upgrade --universal --python-version 3.11 --only-binary :all: \
	--generate-hashes --custom-compile-command "make lock"

clean: ## remove what make made
	rm -rf $(VENV) build dist
