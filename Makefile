# `make demo` opens the page, `make test` runs the tests: both install what they need, below .venv.
PY ?= python3
PORT ?= 8080
UV := $(shell command -v uv)
ifdef UV # the same files from the same lock, faster
VENV = uv venv --allow-existing --python "$(PY)" .venv
INSTALL = uv pip install --python .venv
else
VENV = "$(PY)" -m venv .venv
INSTALL = .venv/bin/pip install --disable-pip-version-check
endif
LOCKED = $(INSTALL) --no-deps --require-hashes -r

# One thread each: the libraries under NumPy and SciPy are two, and more threads than cores wait for each other.
export OPENBLAS_NUM_THREADS = 1
export OMP_NUM_THREADS = 1

.PHONY: demo test check docs fix bench bench-page golden lock head clean for-demo for-test
.NOTPARALLEL:

demo: for-demo .venv/.app
	.venv/bin/faceambig serve --port $(PORT)

test: for-test .venv/.dev
	.venv/bin/python -m pytest -n 2 --dist worksteal $(TESTS)

check: .venv/.dev
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/lint-imports --no-logo --no-cache
	.venv/bin/pyright

# The pages below docs/_build; a warning of Sphinx is an error.
docs: .venv/.dev
	.venv/bin/python tools/command_reference.py --check
	.venv/bin/python -m sphinx --fail-on-warning --keep-going --nitpicky --quiet docs docs/_build
	@echo docs/_build/index.html

fix: .venv/.dev
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

bench: .venv/.dev
	@for name in fit budget derivative growth contours flex extremes against_eos load detect; do \
		echo "== benchmarks/$$name.py"; .venv/bin/python benchmarks/$$name.py || exit 1; done

# Minutes, and both cores: nothing else may run beside it.
bench-page: .venv/.dev
	@for name in page churn; do echo "== benchmarks/$$name.py"; .venv/bin/python benchmarks/$$name.py || exit 1; done

# Stores the pictures of the tests anew: look at each one that changed before it is committed.
golden: for-test .venv/.dev
	GOLDEN=write .venv/bin/python -m pytest -k like_the_stored
	git status --short tests/golden

# Needs uv. Keeps the versions in the locks; UPGRADE=--upgrade takes the newest that pyproject.toml allows.
# Universal and of few forks: one version of each package on every Python and system.
COMPILE = uv pip compile --universal --generate-hashes --python-version 3.11 --fork-strategy fewest \
	--no-emit-index-url --custom-compile-command "make lock" --quiet $(UPGRADE) pyproject.toml
lock:
	$(COMPILE) --extra app --group build -o requirements.lock
	$(COMPILE) --extra dev -c requirements.lock -o requirements-dev.lock

# embreex exactly: another ray tracer may move the last digit of the head's paint. pip: the tool fetches its source
# by it, and uv leaves it out.
head: .venv/.dev
	$(INSTALL) --no-deps embreex==4.4.0.post1 pip
	.venv/bin/python tools/build_head.py

clean:
	rm -rf .venv build dist docs/_build .coverage .hypothesis .pytest_cache .ruff_cache

for-demo:
	@tools/system_packages.sh "$(PY)" venv gl

for-test:
	@tools/system_packages.sh "$(PY)" venv gl browser node nginx

.venv/.app: pyproject.toml requirements.lock
	@tools/system_packages.sh "$(PY)" venv
	$(VENV)
	$(LOCKED) requirements.lock
	$(INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

.venv/.dev: .venv/.app requirements-dev.lock
	$(LOCKED) requirements-dev.lock
	@touch $@
