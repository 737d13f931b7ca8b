"""`make a53`: measure every network of the manifest and SGBM, and enter what was found.

`a53_minstr` of a network belongs to its sha256: another file is measured again, and an entry
whose file does not match its hash is refused.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

from models import manifest
from models.a53.emulator import count, prepare

MODELS = Path(__file__).resolve().parents[1]
CLASSICAL = ("sgbm", "sgbm_unpadded", "sgbm_5way_unpadded", "bm")


def networks(models: Path) -> dict[str, Path]:
    """Name and file of every network in the manifest; SystemExit if a file is another."""
    found = {}
    for entry in manifest.read(models / "manifest.toml")["networks"]:
        path = models / entry["file"]
        if hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
            raise SystemExit(f"{path} does not match its sha256 in manifest.toml; export it again")
        found[entry["name"]] = path
    return found


def enter(models: Path, measured: dict[str, float]) -> None:
    """Write `a53_minstr` of networks, and of classical matchers as `[a53_minstr]`."""
    path = models / "manifest.toml"
    for entry in manifest.read(path)["networks"]:
        if entry["name"] in measured:
            manifest.enter(path, entry | {"a53_minstr": round(measured[entry["name"]], 1)})
    manifest.enter_classical(path, {n: round(measured[n], 1) for n in CLASSICAL if n in measured})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="*", type=Path, help="ONNX files to count, entered nowhere")
    parser.add_argument("--work", type=Path, default=Path("build/a53"), help="for the emulator")
    given = parser.parse_args()
    prepare(given.work.resolve())
    if given.files:
        names = [str(f) for f in given.files]
        files = [str(f.resolve()) for f in given.files]
    else:
        found = networks(MODELS)
        names = [*found, *CLASSICAL]
        files = [*map(str, found.values()), *CLASSICAL]
    measured = dict(zip(names, count(given.work.resolve(), files), strict=True))
    for name, millions in measured.items():
        print(f"{name:24s} {millions:7.1f} M instructions")
    if not given.files:
        enter(MODELS, measured)


if __name__ == "__main__":
    main()
