"""The firmware with one guard broken at a time, and the test that must notice each.

`python tests/firmware/mutants.py [NAME...]` builds every mutant of the host firmware, runs the test
named beside it, and prints what came out; it ends with 1 if any mutant survives.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

import firmware_rig  # noqa: F401  (imported once, before the forks)
import pytest

from firmware_bridge.host import SOURCES, find_compiler

HERE = Path(__file__).parent
BINARY_VARIABLE = "SWEEPER_TEST_FIRMWARE"
TIMEOUT_S = 120
OPTIONS = ("-x", "-q", "--tb=line", "--strict-markers", "-p", "no:cacheprovider", "-c", "/dev/null")
FAILED = 1  # pytest's exit code when a test has failed, and nothing else went wrong


@dataclass(frozen=True)
class Mutant:
    """In `file`, the one `before` becomes `after`; `test` (a node of this folder) must fail."""

    name: str
    file: str
    before: str
    after: str
    test: str


def load_mutants() -> list[Mutant]:
    """The table of mutants.toml."""
    table = tomllib.loads((HERE / "mutants.toml").read_text(encoding="utf-8"))
    return [
        Mutant(name, file, before, after, "test_{}.py::test_{}".format(*test.split("::")))
        for file, rows in table.items()
        for name, (before, after, test) in rows.items()
    ]


@dataclass(frozen=True)
class Outcome:
    """What became of one mutant: `killed`, or why not."""

    name: str
    killed: bool
    what: str


class Workshop:
    """Builds mutants in a scratch folder; objects of unchanged files are made once."""

    def __init__(self, scratch: Path) -> None:
        self.scratch = scratch
        self.compiler = [*find_compiler(), "-std=c11", "-O0", "-w", "-DFIRMWARE_BUILD=1u"]
        self.objects: dict[Path, Path] = {}
        for source in self._sources(SOURCES):
            made = scratch / f"{source.parent.name}_{source.stem}.o"
            self._compile(SOURCES, ["-c", str(source), "-o", str(made)])
            self.objects[source.relative_to(SOURCES)] = made

    @staticmethod
    def _sources(root: Path) -> list[Path]:
        return [p for part in ("core", "wire", "board/host") for p in (root / part).glob("*.c")]

    def _compile(self, root: Path, rest: list[str]) -> None:
        subprocess.run([*self.compiler, f"-I{root}", *rest], check=True)

    def build(self, mutant: Mutant) -> Path:
        """The mutant's binary. Raises ValueError when its place in the source has gone."""
        root = self.scratch / mutant.name
        changed = root / mutant.file
        text = (SOURCES / mutant.file).read_text(encoding="utf-8")
        if text.count(mutant.before) != 1:
            raise ValueError(f"{mutant.file} holds {text.count(mutant.before)} of the place")
        shutil.copytree(SOURCES, root)
        changed.write_text(text.replace(mutant.before, mutant.after), encoding="utf-8")
        objects = dict(self.objects)
        if changed.suffix == ".h":
            objects = {p.relative_to(root): p for p in self._sources(root)}
        else:
            objects[Path(mutant.file)] = changed
        binary = root / "firmware"
        self._compile(root, [*map(str, objects.values()), "-o", str(binary)])
        return binary


def fails(test: str, binary: Path, report: Path) -> int:
    """Exit code of pytest on one test of this folder with this firmware, in a forked child."""
    child = os.fork()
    if child == 0:
        os.environ[BINARY_VARIABLE] = str(binary)
        with report.open("w") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            signal.alarm(TIMEOUT_S)
            os._exit(int(pytest.main([*OPTIONS, str(HERE / test)])))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def judge(mutant: Mutant, workshop: Workshop) -> Outcome:
    """Build one mutant and run its test."""
    try:
        binary = workshop.build(mutant)
    except (ValueError, subprocess.CalledProcessError) as error:
        return Outcome(mutant.name, False, str(error))
    report = workshop.scratch / mutant.name / "report"
    code = fails(mutant.test, binary, report)
    lines = [line for line in report.read_text().splitlines() if line.strip()]
    last = (lines or ["no output"])[-1]
    return Outcome(mutant.name, code == FAILED and " failed" in last, last)


def judge_all(names: list[str]) -> list[Outcome]:
    """The outcome of every mutant, or of the named ones."""
    chosen = [mutant for mutant in load_mutants() if not names or mutant.name in names]
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    with tempfile.TemporaryDirectory() as scratch:
        workshop = Workshop(Path(scratch))
        return [judge(mutant, workshop) for mutant in chosen]


def main() -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="mutants to try (default: all)")
    parser.add_argument("--json", type=Path, help="write the outcomes to this file")
    options = parser.parse_args()
    outcomes = judge_all(options.names)
    for outcome in outcomes:
        print(f"{'killed  ' if outcome.killed else 'SURVIVES'} {outcome.name}: {outcome.what}")
    print(f"{sum(o.killed for o in outcomes)} of {len(outcomes)} mutants killed")
    if options.json:
        options.json.write_text(json.dumps({o.name: [o.killed, o.what] for o in outcomes}))
    return 0 if all(o.killed for o in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
