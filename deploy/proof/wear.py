"""`python deploy/proof/wear.py`: what the robot writes to its card in an hour, cleaning and docked.

Lives in the built-in flat (drawn sights, as fast as it goes) with the service's options: the log as
a ring in RAM, the map kept. The kernel's own count of bytes sent to storage is scaled to an hour of
robot time; RAM disks are not in it.
"""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path

from robot.body.cleaning import RunOptions, run_cleaning
from robot.config import Config

BUDGET_MB_PER_H = {"cleaning": 50.0, "docked": 1.0}
SECONDS = {"cleaning": 300.0, "docked": 900.0}


def written() -> int:
    """Bytes that this process has sent to storage."""
    said = Path("/proc/self/io").read_text()
    match = re.search(r"^write_bytes: (\d+)$", said, re.M)
    assert match is not None
    return int(match.group(1))


def measure(what: str) -> dict[str, float]:
    """MB an hour, to the card and to the log in RAM.

    What is written once, at the start and at the end, counts as if it came again in each stretch.
    """
    with (
        tempfile.TemporaryDirectory(dir=".") as card,
        tempfile.TemporaryDirectory(dir="/dev/shm") as ram,
    ):
        before = written()
        summary = run_cleaning(
            RunOptions(drawn=True, duration_s=SECONDS[what], out=Path(card) / "runs",
                       log_ring=Path(ram) / "log", home=Path(card) / "home",
                       wait=what == "docked", socket=Path(ram) / "control.sock"),
            Config(), lambda snapshot: None,
        )  # fmt: skip
        card_mb = (written() - before) / 1e6
        ram_mb = sum(p.stat().st_size for p in Path(ram).rglob("*") if p.is_file()) / 1e6
    hours = summary["duration_s"] / 3600.0
    return {
        "robot_s": summary["duration_s"],
        "card_mb_per_h": round(card_mb / hours, 2),
        "ram_log_mb_per_h": round(ram_mb / hours, 1),
    }


def main() -> None:
    too_much = []
    for what, budget in BUDGET_MB_PER_H.items():
        result = measure(what)
        print(json.dumps({what: result}), flush=True)
        if result["card_mb_per_h"] > budget:
            too_much.append(f"{what}: more than {budget:g} MB an hour")
    if too_much:
        raise SystemExit("; ".join(too_much))


if __name__ == "__main__":
    main()
