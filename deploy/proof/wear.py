"""`python deploy/proof/wear.py`: what the robot writes to its card in an hour, cleaning and docked.

Lives in the built-in flat (drawn sights, as fast as it goes) with the service's options: the log as
a ring in RAM, the map kept. What counts is the kernel's count of bytes sent to storage, not to RAM.
A short life is taken off a long one, so that what a start and an end write (summary, map, pictures)
is told apart from what comes again every hour.
"""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path

from robot.body.cleaning import RunOptions, run_cleaning
from robot.config import Config

BUDGET_MB_PER_H = {"cleaning": 50.0, "docked": 1.0}
SECONDS = {"cleaning": (60.0, 240.0), "docked": (30.0, 3630.0)}  # the short life and the long one


def written() -> int:
    """Bytes that this process has sent to storage."""
    said = Path("/proc/self/io").read_text()
    match = re.search(r"^write_bytes: (\d+)$", said, re.M)
    assert match is not None
    return int(match.group(1))


def live(what: str, seconds: float) -> tuple[float, float, float]:
    """MB written to the card and to the log in RAM, and the hours of robot time."""
    with (
        tempfile.TemporaryDirectory(dir=".") as card,
        tempfile.TemporaryDirectory(dir="/dev/shm") as ram,
    ):
        before = written()
        summary = run_cleaning(
            RunOptions(drawn=True, duration_s=seconds, out=Path(card) / "runs",
                       log_ring=Path(ram) / "log", home=Path(card) / "home",
                       wait=what == "docked", socket=Path(ram) / "control.sock"),
            Config(), lambda snapshot: None,
        )  # fmt: skip
        card_mb = (written() - before) / 1e6
        ram_mb = sum(p.stat().st_size for p in Path(ram).rglob("*") if p.is_file()) / 1e6
    return card_mb, ram_mb, summary["duration_s"] / 3600.0


def measure(what: str) -> dict[str, float]:
    """Of an hour; and what a start and an end write once."""
    short, long = (live(what, seconds) for seconds in SECONDS[what])
    hours = long[2] - short[2]
    card_mb_per_h = (long[0] - short[0]) / hours
    return {
        "card_mb_per_h": round(card_mb_per_h, 2),
        "ram_log_mb_per_h": round((long[1] - short[1]) / hours, 1),
        "start_and_end_mb": round(short[0] - card_mb_per_h * short[2], 2),
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
