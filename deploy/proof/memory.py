"""`python deploy/proof/memory.py`: how much memory the runtime and its web page take.

The runtime's own parts, the network among them, live through the stretch of a recorded drive that
`make arm` uses (map, filter, planner's orders, perception of the last frames), in a process without
the simulator; `sweeper serve` listens in another. What counts is the most that each ever held.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

BUDGET_MB = 400.0
PORT = 8399


def peak_mb(pid: int | str = "self") -> float:
    """The most that a process ever held in memory."""
    said = Path(f"/proc/{pid}/status").read_text()
    match = re.search(r"^VmHWM:\s+(\d+) kB$", said, re.M)
    assert match is not None
    return int(match.group(1)) / 1024.0


def runtime() -> None:
    """Live through the stretch and print the peak."""
    import pickle

    from arm_guest import Meter, live

    live(pickle.loads(Path(sys.argv[2]).read_bytes()), Meter(), "onnx")
    print(peak_mb())


def serve() -> float:
    """The page's server, once it has answered."""
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, "-m", "robot", "serve", "--socket", f"{folder}/none.sock",
             "--runs", folder, "--state", folder, "--port", str(PORT)],
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            for _ in range(200):
                time.sleep(0.3)
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{PORT}/health", timeout=5).read()
                    return peak_mb(process.pid)
                except OSError:
                    if process.poll() is not None:
                        raise SystemExit("sweeper serve ended by itself") from None
            raise SystemExit("sweeper serve did not answer")
        finally:
            process.terminate()
            process.wait(10)


def main() -> None:
    if sys.argv[1:2] == ["--inside"]:
        runtime()
        return
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("build/proof"))
    from arm_guest import record_drive

    drive = record_drive(parser.parse_args().work.resolve() / "arm-drive.pickle")
    said = subprocess.run(
        [sys.executable, __file__, "--inside", str(drive)],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    found = {"runtime_mb": round(float(said), 1), "serve_mb": round(serve(), 1)}
    print(json.dumps(found))
    if sum(found.values()) > BUDGET_MB:
        raise SystemExit(f"more than {BUDGET_MB:g} MB")


if __name__ == "__main__":
    main()
