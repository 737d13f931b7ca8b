"""Peak memory of this process, from Linux's own books."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path


def reset_peak() -> None:
    """Start counting the peak anew, where the kernel lets a process do that."""
    with suppress(OSError):  # else the peak of the whole process is told: never too low
        Path("/proc/self/clear_refs").write_text("5")  # proc(5): reset VmHWM


def peak_rss_mb() -> float:
    """Highest resident memory since the last reset, in 10^6 bytes."""
    try:
        status = Path("/proc/self/status").read_text()
        line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
        return round(int(line.split()[1]) * 1024 / 1e6, 1)
    except (OSError, StopIteration):
        return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, 1)
