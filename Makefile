# make help lists the targets. Nothing needs to be installed first: see .ci/bootstrap.
ready := .venv/.ready

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  \1\t/p' Makefile | expand -t 14

demo: $(ready) ## grow a crack through a double cantilever beam; plots in out/dcb
	.venv/bin/python demos/dcb.py --out out/dcb

smoke: $(ready) ## the essential path, in a minute
	.ci/test smoke

test: $(ready) ## quick tests: in serial, and half of the parallel ones each on 2 and on 3 ranks
	.ci/test quick

test-slow: $(ready) ## the others: verification, convergence, hard cases, and the rest on each number of ranks
	.ci/test slow

test-all: test test-slow ## both

SEEDS ?= 0:500
random: $(ready) ## random scenes by seed, SEEDS=0:500, and the table of what they hold to
	.venv/bin/python tests/stability/random_scenes.py $(SEEDS) --table docs/combinations.md

lint: $(ready) ## style, format, types
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy

docs: $(ready) ## the documentation, in out/docs; warnings are errors
	.venv/bin/python -m sphinx -qW --keep-going -d out/docs-cache docs out/docs

figures: $(ready) ## pictures of README and pages whose demo has changed, by running it
	.venv/bin/python demos/pictures/make.py

numbers: $(ready) ## numbers of README and pages whose demo has changed, by running it
	.venv/bin/python docs/numbers/make.py

notebooks: $(ready) ## the notebooks in docs/notebooks, from the scripts of the demos
	.venv/bin/python docs/notebooks/make.py

bench: $(ready) ## the speed problems beside what a careful script does
	mkdir -p out/bench
	.venv/bin/fxcrack bench dcb2d --baseline --json out/bench/dcb2d.json
	.venv/bin/fxcrack bench dcb3d --baseline --json out/bench/dcb3d.json

clean: ## remove results and caches
	rm -rf out build .mypy_cache .ruff_cache .pytest_cache
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

distclean: clean ## remove the environment too
	rm -rf .venv fxcrack.egg-info

$(ready): pyproject.toml .ci/bootstrap
	.ci/bootstrap

.PHONY: help demo smoke random test test-slow test-all lint docs figures numbers notebooks bench clean distclean
