"""One served stand-in for a module's tests: a server for each would take most of the time."""

import json
import logging
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from serving import served, wait_for
from standin import StandIn


class Failures(logging.Handler):
    """What the server says of its own mistakes."""

    def __init__(self, level):
        super().__init__(level)
        self.said = []

    def emit(self, record):
        self.said.append(record.getMessage() + str(record.exc_info))


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """(server, stand-in robot, folder), with one past run in the history."""
    folder = tmp_path_factory.mktemp("serve")
    run = folder / "runs" / "20260102-030405-clean"
    run.mkdir(parents=True)
    (run / "summary.json").write_text(json.dumps({"state": "done", "covered_m2": 12.5}))
    (run / "map.png").write_bytes(b"\x89PNG\r\n\x1a\n not really")
    (run / "log.mcap").write_bytes(bytes(range(256)) * 1000)
    (run / "secret.txt").write_text("SECRET")
    (folder / "secret.txt").write_text("SECRET")
    (run / "trajectory.tum").symlink_to(folder / "secret.txt")
    (folder / "ring").mkdir()
    (folder / "ring" / "log-000001.mcap").write_bytes(bytes(1000))
    (folder / "ring" / "log-000002.mcap").symlink_to(folder / "secret.txt")
    robot = StandIn(folder / "control.sock")
    with served(folder, folder / "control.sock", log_ring=folder / "ring") as server:
        wait_for(lambda: server.json("/api/v1/status")[1]["connected"])
        wait_for(lambda: server.ask("/api/v1/map.png")[0] == 200)
        wait_for(lambda: server.ask("/api/v1/landmarks")[0] == 200)
        server.app._rules.requests._rate = server.app._rules.requests._burst = 1e9
        failures = Failures(logging.ERROR)
        logging.getLogger("uvicorn.error").addHandler(failures)
        yield server, robot, folder
        logging.getLogger("uvicorn.error").removeHandler(failures)
        assert failures.said == []
    robot.close()
