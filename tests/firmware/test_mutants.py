"""No guard can be broken without a test noticing: see mutants.toml."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from mutants import Mutant, load_mutants

HERE = Path(__file__).parent
pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def outcomes(
    firmware_binary: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[bool, str]]:
    """Name of each mutant -> (killed, what came out). All of them, in a process of its own."""
    file = tmp_path_factory.mktemp("mutants") / "outcomes.json"
    command = [sys.executable, str(HERE / "mutants.py"), "--json", str(file)]
    subprocess.run(command, capture_output=True, check=False, cwd=HERE)
    made: dict[str, tuple[bool, str]] = json.loads(file.read_text())
    return made


@pytest.mark.parametrize("mutant", load_mutants(), ids=lambda m: m.name)
def test_a_broken_guard_is_noticed(mutant: Mutant, outcomes: dict[str, tuple[bool, str]]) -> None:
    killed, what = outcomes[mutant.name]
    assert killed, f"{mutant.file}: {mutant.test} does not fail ({what})"
