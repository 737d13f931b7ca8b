"""`make deb`: a Debian package that carries this checkout and installs it with `manage.py`.

The package holds sources only (Architecture: all); the virtual environment is built on the robot,
as its wheels are the robot's. Needs dpkg-deb.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
PARTS = ("robot", "firmware_bridge", "models", "deploy", "systemd", "pyproject.toml", "README.md",
         "LICENSE", "CHANGELOG.md")  # fmt: skip
SHARE = "usr/share/sweeper"
DEPENDS = "python3 (>= 3.11), python3-venv, i2c-tools, avrdude"
RECOMMENDS = "python3-libcamera, libcamera-ipa, gcc-avr, avr-libc, make, v4l-utils"
POSTINST = f"""#!/bin/sh
set -e
if [ "$1" = configure ]; then
    verb=install
    [ -e /opt/sweeper/current ] && verb=update
    python3 /{SHARE}/deploy/manage.py $verb /{SHARE}
fi
"""
PRERM = f"""#!/bin/sh
set -e
[ "$1" != remove ] || python3 /{SHARE}/deploy/manage.py uninstall
"""
POSTRM = """#!/bin/sh
set -e
[ "$1" != purge ] || rm -rf /etc/sweeper /var/lib/sweeper /var/lib/private/sweeper
"""


def version() -> str:
    """Of pyproject.toml."""
    lines = (REPOSITORY / "pyproject.toml").read_text(encoding="utf-8").splitlines()
    return next(line.split('"')[1] for line in lines if line.startswith("version = "))


def build(target: Path) -> Path:
    """Write `sweeper_<version>_all.deb` into the folder `target` and return it."""
    tree = target / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    share = tree / SHARE
    share.mkdir(parents=True)
    leave = shutil.ignore_patterns("__pycache__", "build", "*.pyc", "*.o", "*.elf", "*.hex")
    for part in PARTS:
        origin = REPOSITORY / part
        if origin.is_dir():
            shutil.copytree(origin, share / part, ignore=leave)
        else:
            shutil.copy2(origin, share / part)
    control = tree / "DEBIAN"
    control.mkdir()
    size_kb = sum(p.stat().st_size for p in share.rglob("*") if p.is_file()) // 1024
    (control / "control").write_text(
        f"Package: sweeper\nVersion: {version()}\nArchitecture: all\nSection: misc\n"
        f"Priority: optional\nMaintainer: Sweeper <root@localhost>\nDepends: {DEPENDS}\n"
        f"Recommends: {RECOMMENDS}\nInstalled-Size: {size_kb}\n"
        "Description: runtime of a robot vacuum that sees with two cameras\n"
        " Installs into /opt/sweeper, with updates on trial and automatic rollback.\n"
    )
    for name, text in (("postinst", POSTINST), ("prerm", PRERM), ("postrm", POSTRM)):
        (control / name).write_text(text)
        (control / name).chmod(0o755)
    package = target / f"sweeper_{version()}_all.deb"
    subprocess.run(
        ["dpkg-deb", "--root-owner-group", "--build", "-Zxz", str(tree), str(package)],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    shutil.rmtree(tree)
    return package


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "dist").resolve()
    where.mkdir(parents=True, exist_ok=True)
    print(build(where))
