"""`make arm`: the runtime on a Raspberry Pi's processor, emulated, for Python 3.11 and 3.13.

Debian's arm64 Python (bookworm, trixie) and the aarch64 wheels that a robot would install run under
QEMU as a Cortex-A53. Three things are shown: the tests of the robot's rooms pass; SGBM and the
network give what x86 gives; and the hot path executes no more instructions than `arm_baseline.json`
says (+5 %); what is over the budget is told. `--record` enters new baselines, `--quick` leaves out
the drive (frames and ticks through the brain) and most tests.

Exit code 3 says that something is wrong with the runtime; any other but 0, that this machine cannot
show it. The counts come from `models/a53`'s plugin; frames are of the built-in flat.
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
NUMPY = {"3.11": "numpy==2.4.6", "3.13": "numpy==2.5.5"}
WHEELS = (  # what the counts depend on is pinned: another release counts differently
    "opencv-python-headless==5.0.0.93", "onnxruntime==1.31.1", "filterpy==2.0.0",
    "msgspec==0.22.0", "scipy", "pyserial", "smbus2",
    "mcap", "lz4", "zstandard", "foxglove-schemas-protobuf", "protobuf", "pyyaml",
    "tomli-w", "rich", "markdown-it-py", "mdurl", "pygments", "pytest", "pytest-timeout", "pluggy",
    "iniconfig", "packaging", "hypothesis", "sortedcontainers", "flatbuffers",
)  # fmt: skip
TESTS = (
    "tests/contract/test_depth_contract.py", "tests/unit/geometry", "tests/unit/perception",
    "tests/unit/control", "tests/unit/hardware", "tests/unit/calibrate/test_instruments.py",
    "tests/unit/slam/test_slam_ekf.py", "tests/unit/test_config.py",
)  # fmt: skip
# The simulator is no part of the robot: numba is not on the board.
RENDERED = tuple(f"tests/unit/perception/test_{name}.py" for name in
                 ("chain", "floor", "marker", "scan", "visual_motion"))  # fmt: skip
QUICK_TESTS = ("tests/contract/test_depth_contract.py", "tests/unit/geometry",
               "tests/unit/perception/test_exposure_confidence.py")  # fmt: skip
TOLERANCE = 0.05
COUNTED = {"frame", "tick", "sight_sgbm", "sight_onnx"}
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
        ready, wheels = self.site / ".ready", (NUMPY[self.python], *WHEELS)
        if ready.exists() and ready.read_text() == " ".join(wheels):
            return
        tags = [f"--platform=manylinux_2_{n}_aarch64" for n in range(17, 35)]
        run(
            sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--upgrade",
            "--target", self.site, "--only-binary=:all:", "--python-version", self.python,
            "--platform=manylinux2014_aarch64", *tags, *wheels,
        )  # fmt: skip
        ready.write_text(" ".join(wheels))

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


def test(board: Board, tests: tuple[str, ...]) -> list[str]:
    """Run tests on the board; what is wrong, in sentences."""
    done = subprocess.run(
        board.command("-m", "pytest", "-x", "-q", "-m", "not long", "-p", "no:cacheprovider",
                      "--timeout", "1200", *(f"--ignore={path}" for path in RENDERED), *tests),
        env=board.environment(), cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    last = (done.stdout.strip().splitlines() or ["nothing was said"])[-1]
    print(f"Python {board.python} on a Cortex-A53: {last}", flush=True)
    if done.returncode == 1:  # tests failed; other codes are pytest's own trouble
        return [f"Python {board.python}: {done.stdout[-3000:]}"]
    if done.returncode != 0:
        raise SystemExit(f"Python {board.python}: {done.stdout[-1000:]}{done.stderr[-1000:]}")
    return []


def measure(board: Board, what: str, recorded: Path) -> dict[str, float]:
    """Millions of instructions of each thing that was marked, and what was compared."""
    done = subprocess.run(
        board.command(str(HERE / "arm_guest.py"), what, str(recorded), plugin=True),
        env=board.environment(), cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = done.stdout.strip().splitlines()
    marks = {int(t): int(n) for t, n in re.findall(r"^COUNT (\d+) (\d+)$", done.stderr, re.M)}
    if done.returncode != 0 or not said or not marks:
        raise SystemExit(f"Python {board.python}: {done.stderr[-2000:]}")
    answer = json.loads(said[-1])
    spent: dict[str, list[int]] = {}
    for k, name in enumerate(answer["names"]):
        spent.setdefault(name, []).append(marks[2 * k + 1] - marks[2 * k])
    spent.pop("warm")
    found = dict(answer["compared"])
    for name, counts in spent.items():
        times = answer["ticks"] if name == "tick" else len(counts)
        found[name] = round(sum(counts) / 1e6 / times, 3 if name == "tick" else 1)
    return found


def judge(python: str, found: dict[str, float], baseline: dict[str, float]) -> list[str]:
    """What is wrong, in sentences."""
    wrong = []
    for key in COUNTED & found.keys():
        if found[key] > BUDGET_MINSTR.get(key, found[key]):
            print(f"Python {python}: a {key} is over its budget of {BUDGET_MINSTR[key]:g} M")
        allowed = baseline.get(key, found[key]) * (1.0 + TOLERANCE)
        if found[key] > allowed:
            wrong.append(f"Python {python}: {key} takes {found[key]} M instructions, "
                         f"{allowed:.4g} M are allowed")  # fmt: skip
    if found["sgbm_differs"] > 0:
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
    parser.add_argument("--quick", action="store_true", help="perception and few tests only")
    given = parser.parse_args()
    from arm_guest import record_drive, record_sights

    work = given.work.resolve()
    sights = record_sights(work / "arm-sights.pickle")
    drive = None if given.quick else record_drive(work / "arm-drive.pickle")
    baseline = json.loads(BASELINE.read_text()) if BASELINE.exists() else {}
    wrong: list[str] = []
    for python in given.python or SUITES:
        board = Board(work, python)
        if not given.no_tests:
            wrong += test(board, QUICK_TESTS if given.quick else TESTS)
        found = measure(board, "sights", sights)
        if drive is not None:
            found |= measure(board, "drive", drive)
        print(f"Python {python}: {json.dumps(found)}", flush=True)
        wrong += judge(python, found, {} if given.record else baseline.get(python, {}))
        new = {key: found[key] for key in sorted(COUNTED & found.keys())}
        baseline[python] = baseline.get(python, {}) | new
    if given.record:
        BASELINE.write_text(json.dumps(baseline, indent=2, sort_keys=True) + "\n")
    if wrong:
        print("\n".join(wrong), file=sys.stderr)
        raise SystemExit(3)


if __name__ == "__main__":
    main()
