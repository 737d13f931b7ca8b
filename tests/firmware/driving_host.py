"""A host in a process of its own, for trials that kill it: it clears the reset, once, and drives.

Usage: python driving_host.py PORT LEFT_MM_S RIGHT_MM_S VALID_FOR_MS
"""

from __future__ import annotations

import sys
import time

from firmware_bridge.link import Link
from firmware_bridge.messages import Drive, StopReason
from firmware_bridge.transport import SerialTransport


def main() -> None:
    """Until it is killed."""
    port, left, right, valid_for_ms = sys.argv[1], *map(int, sys.argv[2:])
    link, cleared = Link(SerialTransport(port)), False
    while True:
        now_ns = time.monotonic_ns()
        link.poll(now_ns)
        if link.connected and not cleared:
            link.clear(now_ns)
            cleared = link.stop_reason == StopReason.NONE
        link.drive(now_ns, Drive(left, right, 50, 50, valid_for_ms))
        time.sleep(0.02)


if __name__ == "__main__":
    main()
