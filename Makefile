# On a bare machine with Python 3.11 (or newer) and make: every target sets up what it needs in .venv first.
PYTHON ?= python3
BIN := .venv/bin
SETUP := .venv/.set-up

# What a cluster is told as it stands; the kustomization adds the mission and the keys.
MANIFESTS := $(filter-out %/kustomization.yaml %/mission.yaml,$(wildcard deploy/kubernetes/*.yaml))

.PHONY: demo test test-compose campaign bench docs check clean

# What MkDocs Material says of its successor is known.
export NO_MKDOCS_2_WARNING := 1

$(SETUP): pyproject.toml constraints.txt
	@echo "Setting up .venv: this takes about a minute, and a package index"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

demo: $(SETUP)  ## a team of robot processes finishes a mission although one of them is killed
	$(BIN)/lalliance run missions/material_handling.yaml

test: $(SETUP)
	tests/dashboard/browser.sh
	$(BIN)/pytest -m "not alone" --numprocesses 3 --dist worksteal
	$(BIN)/pytest -m alone

test-compose: $(SETUP)  ## the real image and the deployment, in a docker daemon of its own; needs root on Debian
	tests/compose/with_docker.sh $(BIN)/pytest -s tests/compose

campaign: $(SETUP)  ## random missions with faults, held to what must never fail
	$(BIN)/lalliance campaign --missions 2000 --seed 1

docs: $(SETUP)  ## the pages of docs/ as a site, in site/; first, what is made from the code is made anew in them
	PYTHONPATH=docs $(BIN)/python -m made
	$(BIN)/mkdocs build --quiet

bench: $(SETUP)  ## every benchmark, and the page that shows what came of them; needs 15 minutes and a quiet machine
	$(BIN)/python benchmarks/all.py

check: $(SETUP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/hadolint deploy/Dockerfile
	$(BIN)/check-jsonschema --builtin-schema vendor.compose-spec deploy/compose.yaml
	$(BIN)/kubernetes-validate --strict --quiet -k 1.29 -k 1.37 $(MANIFESTS)
	$(BIN)/mkdocs build --quiet
	if docker compose version >/dev/null 2>&1; then docker compose -f deploy/compose.yaml config --quiet; fi

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache dist site
