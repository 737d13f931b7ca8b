"""A Cortex-A53 to run aarch64 Python on: Debian packages and wheels, unpacked into a folder.

Nothing is installed on the machine. The guest is Debian's own arm64 Python and the aarch64 wheels
of numpy, OpenCV and ONNX Runtime that this environment has; the host part is Debian's qemu-user,
the dynamic one, as the static one loads no plugins. Needs Debian or Ubuntu on x86-64 with
apt-get, dpkg, gcc and pip.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
GUEST_PACKAGES = ("python3", "libstdc++6", "libatomic1")
HOST_PACKAGES = ("qemu-user", "libcapstone4", "liburing2")
WHEELS = ("numpy", "opencv-python-headless", "onnxruntime")
# ONNX Runtime looks here for the kind of core and dies without the file.
CPUINFO = "".join(
    f"processor\t: {core}\nBogoMIPS\t: 38.40\nFeatures\t: fp asimd evtstrm crc32 cpuid\n"
    "CPU implementer\t: 0x41\nCPU architecture: 8\nCPU variant\t: 0x0\nCPU part\t: 0xd03\n"
    "CPU revision\t: 4\n\n"
    for core in range(4)
)


def _run(*command: str | Path, cwd: Path | None = None) -> str:
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, capture_output=True, text=True, check=False
    )
    if done.returncode:
        why = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no message"]
        raise SystemExit(f"{command[0]} failed: {why[0]}")
    return done.stdout


def _private_apt(work: Path) -> list[str]:
    """Options of apt-get for arm64 packages with lists and states of its own."""
    apt = work / "apt"
    for folder in ("lists/partial", "cache/archives/partial"):
        (apt / folder).mkdir(parents=True, exist_ok=True)
    (apt / "status").touch()
    return [
        "-o", "APT::Architecture=arm64", "-o", "APT::Architectures=arm64",
        "-o", f"Dir::State={apt}", "-o", f"Dir::State::status={apt / 'status'}",
        "-o", f"Dir::State::lists={apt / 'lists'}", "-o", f"Dir::Cache={apt / 'cache'}",
        "-o", "Dir::Etc::preferencesparts=/dev/null", "-o", "APT::Sandbox::User=root", "-qq",
    ]  # fmt: skip


def _unpack(archives: list[Path], root: Path) -> None:
    for archive in archives:
        _run("dpkg", "-x", archive, root)


def guest_python(root: Path) -> str:
    """Version of the unpacked guest's Python, such as "3.11"."""
    found = sorted(p.name for p in (root / "usr/bin").glob("python3.*") if p.name[8:].isdigit())
    if not found:
        raise SystemExit(f"{root} holds no python3; remove the folder and try again")
    return found[-1].removeprefix("python")


def prepare(work: Path) -> None:
    """Fill `work` unless that was done before: guest, wheels, qemu and the compiled plugin."""
    if (work / "ready").exists():
        return
    shutil.rmtree(work, ignore_errors=True)
    root, host = work / "guest", work / "host"
    for folder in (root / "proc", host, work / "site"):
        folder.mkdir(parents=True)
    apt = _private_apt(work)
    _run("apt-get", *apt, "update")
    wanted = ("install", "-y", "--download-only", "--no-install-recommends", *GUEST_PACKAGES)
    _run("apt-get", *apt, *wanted)
    _unpack(sorted((work / "apt/cache/archives").glob("*.deb")), root)
    (root / "proc/cpuinfo").write_text(CPUINFO)
    _run("apt-get", "download", *HOST_PACKAGES, cwd=host)
    _unpack(sorted(host.glob("*.deb")), host)
    _fetch_wheels(work / "site", guest_python(root))
    _run("gcc", "-O2", "-shared", "-fPIC", "-o", work / "count.so", HERE / "count.c")
    (work / "ready").touch()


def _fetch_wheels(site: Path, python: str) -> None:
    versions = [f"{name}=={importlib.metadata.version(name)}" for name in WHEELS]
    platforms = [f"--platform=manylinux_2_{minor}_aarch64" for minor in (17, 26, 27, 28)]
    _run(
        sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site,
        "--only-binary=:all:", "--python-version", python, "--platform=manylinux2014_aarch64",
        *platforms, *versions,
    )  # fmt: skip


def count(work: Path, matchers: list[str]) -> list[float]:
    """Millions of instructions that one run of each matcher executes (see `guest.py`)."""
    root = work / "guest"
    python = f"python{guest_python(root)}"
    done = subprocess.run(
        [
            str(work / "host/usr/bin/qemu-aarch64"), "-cpu", "cortex-a53",
            "-plugin", str(work / "count.so"), "-L", str(root), "-E", "LD_LIBRARY_PATH=",
            "-E", f"PYTHONHOME={root / 'usr'}", "-E", f"PYTHONPATH={work / 'site'}",
            "-E", "OPENBLAS_NUM_THREADS=1", "-E", "OMP_NUM_THREADS=1",
            str(root / "usr/bin" / python), str(HERE / "guest.py"), *matchers,
        ],
        env=os.environ | {"LD_LIBRARY_PATH": str(work / "host/usr/lib/x86_64-linux-gnu")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return parse(done.stderr, len(matchers))


def parse(printed: str, matchers: int) -> list[float]:
    """Differences between the markers of each matcher; SystemExit if one is missing."""
    marks = {int(t): int(n) for t, n in re.findall(r"^COUNT (\d+) (\d+)$", printed, re.M)}
    if sorted(marks) != list(range(2 * matchers)):
        raise SystemExit(f"the emulated program failed: {printed.strip()[-300:]}")
    return [(marks[2 * k + 1] - marks[2 * k]) / 1e6 for k in range(matchers)]
