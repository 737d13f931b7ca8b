"""A Debian userland of any suite and architecture, unpacked into a folder; nothing is installed.

apt-get resolves and downloads with private lists and state, dpkg -x unpacks. No maintainer script
runs, so this is no system to boot, but its Python and its libraries work. Needs a Debian or Ubuntu
host with apt-get, dpkg and Debian's archive keyring.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from pathlib import Path

MIRROR = "http://deb.debian.org/debian"
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"


def run(*command: str | Path, cwd: Path | None = None, env: dict[str, str] | None = None) -> str:
    """Run and return stdout; SystemExit with the last line of the complaint when it fails."""
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    if done.returncode:
        why = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no message"]
        raise SystemExit(f"{command[0]} failed: {why[0]}")
    return done.stdout


def unpack(root: Path, suite: str, architecture: str, packages: tuple[str, ...]) -> Path:
    """Fill `root` with `packages` and all they depend on, unless it holds them already."""
    asked = " ".join((suite, architecture, *packages))
    stamp = root / f".unpacked-{hashlib.sha256(asked.encode()).hexdigest()[:12]}"
    if stamp.exists():
        return root
    shutil.rmtree(root, ignore_errors=True)
    _lay_merged_usr(root)
    apt = _private_apt(root.with_name(f"{root.name}-apt"), suite, architecture)
    run("apt-get", *apt, "update")
    run("apt-get", *apt, "install", "-y", "--download-only", "--no-install-recommends", *packages)
    archives = root.with_name(f"{root.name}-apt") / "cache/archives"
    for archive in sorted(archives.glob("*.deb")):
        run("dpkg", "-x", archive, root)
    stamp.touch()
    return root


def _lay_merged_usr(root: Path) -> None:
    """/bin, /lib, /sbin and /lib64 are links into /usr, as on every Debian since bookworm."""
    for name in ("bin", "lib", "sbin", "lib64"):
        (root / "usr" / name).mkdir(parents=True)
        (root / name).symlink_to(f"usr/{name}")
    for name in ("proc", "tmp", "dev", "run", "sys"):
        (root / name).mkdir()


def _private_apt(folder: Path, suite: str, architecture: str) -> list[str]:
    """Options of apt-get with lists, state and sources of its own."""
    for name in ("lists/partial", "cache/archives/partial"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "status").touch()
    (folder / "sources.list").write_text(f"deb [signed-by={KEYRING}] {MIRROR} {suite} main\n")
    return [
        "-o", f"APT::Architecture={architecture}", "-o", f"APT::Architectures={architecture}",
        "-o", f"Dir::State={folder}", "-o", f"Dir::State::status={folder / 'status'}",
        "-o", f"Dir::State::lists={folder / 'lists'}", "-o", f"Dir::Cache={folder / 'cache'}",
        "-o", f"Dir::Etc::sourcelist={folder / 'sources.list'}",
        "-o", "Dir::Etc::sourceparts=/dev/null", "-o", "Dir::Etc::preferencesparts=/dev/null",
        "-o", "APT::Sandbox::User=root", "-qq",
    ]  # fmt: skip


def python_of(root: Path) -> str:
    """Version of the unpacked Python, such as "3.13". SystemExit when there is none."""
    found = sorted(p.name for p in (root / "usr/bin").glob("python3.*") if p.name[8:].isdigit())
    if not found:
        raise SystemExit(f"{root} holds no python3; remove the folder and try again")
    return found[-1].removeprefix("python")
