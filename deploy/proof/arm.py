"""`make arm`: the runtime on a Raspberry Pi's processor, emulated, for Python 3.11 and 3.13.

Debian's arm64 Python (bookworm, trixie) and the aarch64 wheels that a robot would install run under
QEMU as a Cortex-A53. Three things are shown: the unit tests of the robot's rooms pass; SGBM and the
network give what x86 gives; and the hot path executes no more instructions than `arm_baseline.json`
says (+5 %); what is over the budget is told. `--record` enters new baselines.

The counts come from `models/a53`'s plugin; frames are of the built-in flat, rendered on the host.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from userland import python_of, run, unpack

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
BASELINE = HERE / "arm_baseline.json"
SUITES = {"3.11": "bookworm", "3.13": "trixie"}
GUEST_PACKAGES = ("python3", "libstdc++6", "libatomic1")
HOST_PACKAGES = ("qemu-user", "libcapstone4", "liburing2")
WHEELS = (
    "numpy", "opencv-python-headless", "onnxruntime", "filterpy", "scipy", "pyserial", "smbus2",
    "mcap", "lz4", "zstandard", "foxglove-schemas-protobuf", "protobuf", "msgspec", "pyyaml",
    "tomli-w", "rich", "markdown-it-py", "mdurl", "pygments", "pytest", "pytest-timeout", "pluggy",
    "iniconfig", "packaging", "hypothesis", "sortedcontainers", "flatbuffers",
)  # fmt: skip
TESTS = (
    "tests/contract/test_depth_contract.py", "tests/unit/geometry", "tests/unit/perception",
    "tests/unit/control", "tests/unit/hardware", "tests/unit/calibrate/test_instruments.py",
    "tests/unit/slam/test_slam_ekf.py", "tests/unit/test_config.py",
)  # fmt: skip
TOLERANCE = 0.05
BUDGET_MINSTR = {"frame": 160.0, "tick": 2.0}
# ONNX Runtime looks here for the kind of core and dies without the file.
CORE = (
    "BogoMIPS\t: 38.40\nFeatures\t: fp asimd evtstrm crc32 cpuid\nCPU implementer\t: 0x41\n"
    "CPU architecture: 8\nCPU variant\t: 0x0\nCPU part\t: 0xd03\nCPU revision\t: 4\n\n"
)
CPUINFO = "".join(f"processor\t: {k}\n{CORE}" for k in range(4))


class Board:
    """One emulated Python with its wheels."""

    def __init__(self, work: Path, python: str) -> None:
        self.python, self.work = python, work
        self.root = unpack(work / f"arm64-{SUITES[python]}", SUITES[python], "arm64",
                           GUEST_PACKAGES)  # fmt: skip
        assert python_of(self.root) == python
        (self.root / "proc/cpuinfo").write_text(CPUINFO)
        self.site = work / f"arm64-site-{python}"
        self._fetch_wheels()
        self.host = _host(work)

    def _fetch_wheels(self) -> None:
        ready = self.site / ".ready"
        if ready.exists() and ready.read_text() == " ".join(WHEELS):
            return
        tags = [f"--platform=manylinux_2_{n}_aarch64" for n in range(17, 35)]
        run(
            sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--upgrade",
            "--target", self.site, "--only-binary=:all:", "--python-version", self.python,
            "--platform=manylinux2014_aarch64", *tags, *WHEELS,
        )  # fmt: skip
        ready.write_text(" ".join(WHEELS))

    def command(self, *arguments: str, plugin: bool = False) -> list[str]:
        """The emulator with this Python."""
        options = ["-plugin", str(self.work / "count.so")] if plugin else []
        return [
            str(self.host / "usr/bin/qemu-aarch64"), "-cpu", "cortex-a53", *options,
            "-L", str(self.root), "-E", "LD_LIBRARY_PATH=",
            str(self.root / f"usr/bin/python{self.python}"), *arguments,
        ]  # fmt: skip

    def environment(self) -> dict[str, str]:
        """For the emulator and for the Python in it."""
        return {
            "PATH": os.environ["PATH"],
            "LD_LIBRARY_PATH": str(self.host / "usr/lib/x86_64-linux-gnu"),
            "PYTHONHOME": str(self.root / "usr"),
            "PYTHONPATH": f"{self.site}:{REPOSITORY}",
            "PYTHONDONTWRITEBYTECODE": "1",
            "CI": "1",  # hypothesis then has no deadlines: an emulator is slow
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self.work / "hypothesis"),
        }


def _host(work: Path) -> Path:
    """QEMU and the counting plugin."""
    host = work / "qemu"
    if not (host / "usr/bin/qemu-aarch64").exists():
        host.mkdir(parents=True, exist_ok=True)
        run("apt-get", "download", *HOST_PACKAGES, cwd=host)
        for archive in sorted(host.glob("*.deb")):
            run("dpkg", "-x", archive, host)
    source = REPOSITORY / "models/a53/count.c"
    run("gcc", "-O2", "-shared", "-fPIC", "-o", work / "count.so", source)
    return host


def test(board: Board) -> str:
    """The unit tests on the board; SystemExit when one fails. Returns pytest's last line."""
    done = subprocess.run(
        board.command("-m", "pytest", "-x", "-q", "-m", "not long", "-p", "no:cacheprovider",
                      "--timeout", "1200", *TESTS),
        env=board.environment(), cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    last = (done.stdout.strip().splitlines() or ["nothing was said"])[-1]
    if done.returncode != 0:
        raise SystemExit(f"Python {board.python}: {done.stdout[-3000:]}{done.stderr[-500:]}")
    return last


def measure(board: Board, frames: Path) -> dict[str, float]:
    """Millions of instructions of a frame and of a tick, and how far outputs are from x86's."""
    done = subprocess.run(
        board.command(str(HERE / "arm_guest.py"), str(frames), plugin=True),
        env=board.environment(), cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = done.stdout.strip().splitlines()
    marks = {int(t): int(n) for t, n in re.findall(r"^COUNT (\d+) (\d+)$", done.stderr, re.M)}
    if done.returncode != 0 or not said or not marks:
        raise SystemExit(f"Python {board.python}: {done.stderr[-2000:]}")
    compared = json.loads(said[-1])
    spent = {True: 0, False: 0}  # of events, of frames
    for tag, count in marks.items():
        if tag % 2 == 0:
            spent[tag >= 100_000] += marks[tag + 1] - count
    return {
        "frame": round(spent[False] / 1e6 / compared.pop("frames"), 1),
        "tick": round(spent[True] / 1e6 / compared.pop("ticks"), 3),
        **compared,
    }


def judge(python: str, found: dict[str, float], baseline: dict[str, float]) -> list[str]:
    """What is wrong, in sentences."""
    wrong = []
    for key, budget in BUDGET_MINSTR.items():
        if found[key] > budget:
            print(f"Python {python}: a {key} is over its budget of {budget:g} M instructions")
        allowed = baseline.get(key, found[key]) * (1.0 + TOLERANCE)
        if found[key] > allowed:
            wrong.append(f"Python {python}: a {key} takes {found[key]} M instructions, "
                         f"{allowed:.3g} M are allowed")  # fmt: skip
    if found["sgbm_differs"] > 0.0:
        wrong.append(f"Python {python}: SGBM differs from x86's in {found['sgbm_differs']} pixels")
    if found["network_px"] > 0.05:
        wrong.append(f"Python {python}: the network differs by {found['network_px']} px")
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("build/proof"))
    parser.add_argument("--python", choices=SUITES, action="append", help="default: both")
    parser.add_argument("--record", action="store_true", help="enter the counts as the baseline")
    parser.add_argument("--no-tests", action="store_true", help="only count and compare")
    given = parser.parse_args()
    from arm_guest import render

    work = given.work.resolve()
    frames = render(work / "arm-frames.npz")
    baseline = json.loads(BASELINE.read_text()) if BASELINE.exists() else {}
    wrong: list[str] = []
    for python in given.python or SUITES:
        board = Board(work, python)
        if not given.no_tests:
            print(f"Python {python} on a Cortex-A53: {test(board)}", flush=True)
        found = measure(board, frames)
        print(f"Python {python}: {json.dumps(found)}", flush=True)
        wrong += judge(python, found, {} if given.record else baseline.get(python, {}))
        baseline[python] = {key: found[key] for key in BUDGET_MINSTR}
    if given.record:
        BASELINE.write_text(json.dumps(baseline, indent=2, sort_keys=True) + "\n")
    if wrong:
        raise SystemExit("\n".join(wrong))


if __name__ == "__main__":
    main()
