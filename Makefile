# SPDX-License-Identifier: GPL-3.0-or-later
# Each command makes the environment it needs. PYTHON=... names the interpreter; otherwise one is looked for.

DEMO_FOLDER ?= build/demo
PYTEST_ARGUMENTS ?=
BENCHMARK_ARGUMENTS ?=

# Prints the environment's Python, and makes the environment first where it is missing or out of date.
environment = interpreter=$$(.ci/find_python "$(PYTHON)") && python=$$("$$interpreter" .ci/environment.py)

.PHONY: help demo test lint extension manual benchmark environment clean

help:
	@echo "make demo       render the demo scenes to $(DEMO_FOLDER)"
	@echo "make test       run the tests"
	@echo "make lint       style, format, types, and which room may import which"
	@echo "make extension  build the extension for Blender into build/"
	@echo "make manual     build the manual into build/manual; open its index.html"
	@echo "make benchmark  measure tracing, maps, files and animations (a table and plots in build/benchmark)"
	@echo "PYTHON=/path/to/python chooses the interpreter: 3.11 runs Blender 4.5, 3.13 runs Blender 5.2"

environment:
	@$(environment) && echo "Ready: $$python"

demo:
	@$(environment) && PYTHONPATH=. "$$python" blend_files/render_demo.py "$(DEMO_FOLDER)" && \
	  echo "The pictures are in $(abspath $(DEMO_FOLDER)):" && find "$(DEMO_FOLDER)" -name '*.png' | sort

test:
	@$(environment) && "$$python" -m pytest --numprocesses auto --dist loadfile $(PYTEST_ARGUMENTS)

lint:
	@$(environment) && bin=$$(dirname "$$python") && "$$bin/ruff" check . && "$$bin/ruff" format --check . && "$$bin/mypy" && "$$bin/lint-imports"

extension:
	@$(environment) && "$$python" .ci/build_extension.py && "$$python" .ci/build_extension.py --split-platforms

# Every warning is an error. Needs no network.
manual:
	@$(environment) && "$$python" -m sphinx -W -n --keep-going -q -d build/doctrees docs build/manual && \
	  echo "The manual is in $(abspath build/manual/index.html)"

benchmark:
	@$(environment) && PYTHONPATH=. "$$python" benchmarks/run.py $(BENCHMARK_ARGUMENTS)

clean:
	rm -rf build .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
