# Every target sets up what it needs: a virtual environment in .venv with this checkout installed in it.
#   make demo      fit a bundled mesh: out/potted_cactus.resfit/ with preview.png, parts.glb, assembly.json
#   make test      the quick tests (core and test packages only)
#   make test-all  lint, type check and every test, the slow ones and those with optional packages too
#   make fuzz      damaged and hostile input, about 10 minutes; SECONDS_EACH=600 FUZZ="mesh-files" for one campaign
#   make results   the tables and pictures in docs/; MESHES="folder..." fits the meshes of other folders
#   make gallery   a page of fits, out/gallery/index.html; MESHES="folder..." shows the meshes or fits of other folders
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input -q
# Strict mode lets type checkers see the mapped folders; it links files one by one, so a new file needs a re-install.
EDITABLE := --config-settings editable_mode=strict
FILES := find src kernels assembly shape decomposition fitter eval exports viewer result -type f \
	! -name '*.pyc' 2>/dev/null | LC_ALL=C sort | cksum

.PHONY: help demo test test-all fuzz lint format architecture options schema results gallery bench doctor install install-all clean
help:
	@sed -n 's/^#   //p' Makefile

demo: install
	@$(BIN)/resfit demo -o out/potted_cactus.resfit

test: install
	@$(BIN)/python -m pytest -m "not slow and not browser"

test-all: install-all lint
	@$(BIN)/python -m pytest

# In tests/, so that no variable tells the processes which are tried where to look for modules.
SECONDS_EACH ?= 75
fuzz: install
	@cd tests && ../$(BIN)/python -m fuzz --seconds $(SECONDS_EACH) $(FUZZ)

lint: install
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports --no-cache --no-logo
	@$(BIN)/pyright

format: install
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

architecture: install
	@$(BIN)/python docs/draw_architecture.py

options: install
	@$(BIN)/python docs/write_options.py

schema: install
	@$(BIN)/python -m resfit.assembly.schema assembly/assembly.schema.json

results: install
	@$(BIN)/resfit bench kernels --markdown docs/kernels.md
	@$(BIN)/resfit demo -o out/potted_cactus.resfit && cp out/potted_cactus.resfit/preview.png docs/demo.png
	@$(BIN)/python -m resfit.eval.report.results $(MESHES) --out docs

gallery: install
	@$(BIN)/resfit gallery $(MESHES) -o out/gallery

bench: install
	@$(BIN)/resfit bench kernels

doctor: install
	@$(BIN)/resfit doctor

install: $(BIN)/python
	$(call install-extras,test)

install-all: $(BIN)/python
	$(call install-extras,test$(,)browser$(,)compare$(,)web$(,)gltf)

# The system's own Chromium where it can be had, else the one that Playwright brings.
install-chromium = command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	{ apt-get update && apt-get install -y chromium; } >/dev/null 2>&1 </dev/null || \
	$(BIN)/python -m playwright install chromium </dev/null || echo "no Chromium: browser tests are skipped" >&2

# Dependencies are resolved when pyproject.toml changes; the links are made again when the list of files does.
, := ,
define install-extras
	@set -e; wanted="$(1) $$(cksum < pyproject.toml)"; files="$$($(FILES))"; \
	if ! grep -qxF -e "$$wanted" $(VENV)/.resfit-packages 2>/dev/null; then \
	  echo "installing resfit[$(1)] into $(VENV)"; \
	  $(PIP) install 'setuptools>=77' </dev/null; \
	  $(PIP) install --no-build-isolation -e '.[$(1)]' $(EDITABLE) </dev/null; \
	  case "$(1)" in *browser*) $(call install-chromium);; esac; \
	  { echo "$$wanted"; case "$(1)" in *browser*) echo "test $$(cksum < pyproject.toml)";; esac; } \
	    > $(VENV)/.resfit-packages; \
	  echo "$$files" > $(VENV)/.resfit-files; \
	elif [ "$$files" != "$$(cat $(VENV)/.resfit-files 2>/dev/null)" ] || [ ! -d build ]; then \
	  $(PIP) install --no-build-isolation --no-deps -e . $(EDITABLE) </dev/null; \
	  echo "$$files" > $(VENV)/.resfit-files; \
	fi
endef

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || { \
	  echo "resfit needs Python 3.11 to 3.13, and '$(PYTHON)' is $$($(PYTHON) -V 2>&1): try make PYTHON=python3.12" >&2; \
	  exit 1; }
	@$(PYTHON) -m venv $(VENV)

clean:
	@rm -rf build dist out resfit.egg-info .pytest_cache .ruff_cache $(VENV)/.resfit-packages $(VENV)/.resfit-files
	@find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
