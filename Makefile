# Two commands do everything: `make run` and `make test`. Both build their own environment in .venv.

# The newest supported Python that really starts (a version manager's shim may exist and not run).
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3; do \
	$$p -c 'import sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	2>/dev/null && { echo $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
SCENE ?= flat
SEED ?= 1
# One thread for each numeric library: the robot's setting, and the fastest on two cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: arm camera service deb run demo fuzz faults test test-long lint types firmware firmware-trials messages bench train a53 clean

run: $(VENV)/.sim
	$(BIN)/sweeper run --body sim --scene $(SCENE) --seed $(SEED)

demo: $(VENV)/.web
	$(BIN)/python -m robot.serve.demo --scene $(SCENE) --seed $(SEED)

test: $(VENV)/.dev
	$(BIN)/python -m pytest -m "not long"

test-long: $(VENV)/.dev
	$(BIN)/python -m pytest -m long

fuzz: $(VENV)/.dev
	SWEEPER_FUZZ_CASES=100000 $(BIN)/python -m pytest --timeout 7200 tests/unit/serve/test_fuzz.py

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy robot firmware_bridge

firmware:
	$(MAKE) -C firmware_bridge/firmware host

# Twelve things that go wrong, ten times each: half an hour on one core.
faults: $(VENV)/.sim
	$(BIN)/sweeper bench faults --trials 10 --jobs $(shell nproc)

# Every trial of the motor controller at its full length (hours), and an hour of fuzzing.
firmware-trials: $(VENV)/.dev
	$(BIN)/python -m pytest tests/firmware -m long -s
	$(MAKE) -C firmware_bridge/firmware fuzz FUZZ_SECONDS=3600

messages: $(VENV)/.dev
	$(BIN)/python -m firmware_bridge.messages

# Real libcamera (Debian trixie, virtual pipeline) feeds the camera adapter. Root, network.
camera: $(VENV)/.dev
	$(BIN)/python deploy/proof/camera.py

# The runtime on an emulated Raspberry Pi: tests, outputs, and instructions of the hot path.
arm: $(VENV)/.dev
	$(BIN)/python deploy/proof/arm.py

# The units under a real systemd as PID 1: killed, hung, updated, rolled back. Root, Linux.
service: $(VENV)/.dev
	$(BIN)/python deploy/proof/pid1.py

deb:
	$(PYTHON) deploy/deb.py dist

train: $(VENV)/.train
	$(BIN)/python -m models.train --help

a53: $(VENV)/.train
	$(BIN)/python -m models.a53

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "Sweeper needs Python 3.11 to 3.13: install it, or name it with PYTHON=..."; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip

$(VENV)/.sim: pyproject.toml | $(VENV)/bin/python
	$(BIN)/pip install --quiet -e '.[sim]'
	@touch $@

$(VENV)/.web: pyproject.toml | $(VENV)/bin/python
	$(BIN)/pip install --quiet -e '.[sim,web,mqtt]'
	@touch $@ $(VENV)/.sim

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	$(BIN)/pip install --quiet -e '.[dev]'
	@touch $@ $(VENV)/.sim $(VENV)/.web

$(VENV)/.train: pyproject.toml | $(VENV)/bin/python
	$(BIN)/pip install --quiet -e '.[train,dev]'
	@touch $@ $(VENV)/.dev $(VENV)/.sim $(VENV)/.web

clean:
	rm -rf $(VENV) runs build *.egg-info
	$(MAKE) -C firmware_bridge/firmware clean
