# Everything a clone needs, from nothing but Python 3.10 to 3.14, a C++ compiler and make. `make help` lists the targets.

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-real-time soak check pages docs wheels release lock clean parts-of-tests
MAKEFLAGS += --no-print-directory

# What ROS, Matplotlib and Python would write into the home folder stays in the clone.
export ROS_LOG_DIR ?= $(CURDIR)/build/ros
export MPLCONFIGDIR ?= $(CURDIR)/build/matplotlib
# Tests start hundreds of Pythons, and each would compile all modules again.
unexport PYTHONDONTWRITEBYTECODE

help:
	@echo 'make setup         what the driver and the virtual controller need, into .venv; the targets below add what they need'
	@echo '                   WITH="planning data" adds parts that are listed in pyproject.toml'
	@echo 'make demo          a virtual YuMi moves both arms and grips; ARGS="--robot <address>" for a real one'
	@echo 'make test          the check: format, lint, types, layers, spelling, terms, then the tests that need no real time'
	@echo 'make check         the same without the tests'
	@echo 'make test-real-time  the rest of the tests: ROS, processes, sockets, the pages; wants a quiet machine for some ten minutes'
	@echo 'make soak          the long tests: motion, starts of EGM, fuzzing; see docs/how-to/soak.md'
	@echo 'make wheels        wheels in dist/: of each package, and of yumi-ros2 one for this Python with the message packages built'
	@echo 'make release VERSION=0.1.0  wheels, sources and notes in dist/, each tried in an empty environment'
	@echo 'make pages         the pages that are made from the program: files, decisions, messages, readiness, stops'
	@echo 'make docs          the documentation as a site, in build/site'
	@echo 'make lock          uv.lock again from pyproject.toml; ARGS=--upgrade takes newer packages'
	@echo 'make clean         removes .venv, build and the caches'
	@echo 'PYTHON=python3.12  after any of them chooses the Python'

# Brings .venv up to date, with the parts of pyproject.toml that are named after it; what is there stays.
SETUP = python=$$(sh setup/find_python.sh '$(PYTHON)') && "$$python" -E -S setup
UV = .venv/bin/uv
WHAT_IS_TYPED = evaluation robotware7
PARTS_OF_TESTS = check test page compare planning plot teleop $(WHAT_IS_TYPED)

setup:
	@$(SETUP) $(WITH)

demo:
	@$(SETUP)
	@exec .venv/bin/yumi demo $(ARGS)

check:
	@$(SETUP) check test page $(WHAT_IS_TYPED)
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/mypy setup/prerequisites.py setup/commands.py setup/uv.py setup/installation.py setup/release.py setup/check_changes.py interfaces/build.py packages/yumi-ros2/wheel_hook.py
	.venv/bin/mypy packages/abb-view/wheel_hook.py
	.venv/bin/python -m abb_view.page_build check
	.venv/bin/python -m yumi.web.page_build check
	.venv/bin/lint-imports
	.venv/bin/codespell
	.venv/bin/python setup/check_words.py
	.venv/bin/python setup/check_prose.py
	.venv/bin/python setup/check_decisions.py
	.venv/bin/python setup/source_files.py
	.venv/bin/python setup/check_changes.py

# The pages that are made from the program; a test of each finds out when it is old.
pages:
	@$(SETUP) check test
	.venv/bin/python setup/source_files.py write
	.venv/bin/python setup/check_decisions.py write
	.venv/bin/python setup/messages.py > build/page.md && mv build/page.md docs/reference/messages.md
	.venv/bin/python -m yumi.driver.readiness > build/page.md && mv build/page.md docs/reference/readiness.md
	PYTHONPATH=tests .venv/bin/python -m system.provoked_stops > build/page.md && mv build/page.md docs/reference/stops-and-refusals.md

# What runs in virtual time, on two processes; then the driver with what belongs to it: whether all of it works together.
parts-of-tests:
	@$(SETUP) $(PARTS_OF_TESTS)
	@.venv/bin/python -m abb_view.page_build
	@.venv/bin/python -m yumi.web.page_build

test: parts-of-tests check
	.venv/bin/python -m pytest --numprocesses 2 --dist worksteal -m 'not ros and not real_time and not soak' $(ARGS)
	.venv/bin/python -m pytest -m smoke tests/ros/test_ros_driver.py $(ARGS)

# What runs in real time waits more than it computes: two files at a time, each with the robot and the driver that its
# tests share. What measures or loads the machine has the machine to itself. Other folders have no such tests.
IN_REAL_TIME = tests/docs tests/ros tests/system
REAL_TIME = (ros or real_time) and not soak
test-real-time: parts-of-tests
	.venv/bin/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder $(IN_REAL_TIME) -m '$(REAL_TIME) and not alone' $(ARGS)
	.venv/bin/python -m pytest $(IN_REAL_TIME) -m '$(REAL_TIME) and alone' $(ARGS)

# The long forms of tests, properties with a thousand examples each, with what they tell meanwhile.
soak: parts-of-tests
	.venv/bin/python -m pytest -m 'soak or hypothesis' --hypothesis-profile long --timeout 1800 --capture=no $(ARGS)

# Both are for this platform and need no compiler; the second one is for this Python and contains the message packages.
wheels:
	@$(SETUP) page
	@for package in packages/*; do (cd $$package && $(CURDIR)/.venv/bin/python -m hatchling build -t wheel -d $(CURDIR)/dist) || exit 1; done
	@cd packages/yumi-ros2 && YUMI_WHEEL_INTERFACES=1 $(CURDIR)/.venv/bin/python -m hatchling build -t wheel -d $(CURDIR)/dist
	@$(UV) $(EXPORT) --only-group products --output-file dist/requirements.txt
	@$(UV) $(EXPORT) --only-group products --only-group ros --only-group record --output-file dist/requirements-ros.txt

# Of empy, which only builds message packages, PyPI has no wheel.
EXPORT = export --quiet --frozen --no-emit-workspace --no-emit-package empy --no-header --no-annotate

release:
	@$(SETUP) release page
	@exec .venv/bin/python setup/release.py '$(VERSION)'

# Links in the pages and docstrings are checked: a warning ends it.
docs:
	@$(SETUP) docs
	NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict $(ARGS)

# Without .venv: with an index that lacks what uv.lock names, this comes first.
lock:
	@python=$$(sh setup/find_python.sh '$(PYTHON)') && exec "$$python" -E -S setup/uv.py lock $(ARGS)

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache .coverage
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
