"""A run that is asked to end ends in order: wheels stopped, log closed, summary written."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.body.ending import Ending
from robot.log.reader import read_commands, read_events, read_header
from robot.messages import Command, Event, StopOrder, Tick
from robot.run import run

START_S = 60.0


def test_the_first_signal_is_a_wish_and_the_second_acts() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Ending() as ending:
        assert ending.asked() == ""
        os.kill(os.getpid(), signal.SIGTERM)
        assert ending.asked() == "SIGTERM"
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)
    assert signal.getsignal(signal.SIGINT) is before


class Endless:
    """A body, a brain and a log of nothing but ticks."""

    def __init__(self) -> None:
        self.sent: list[Command] = []
        self.logged: list[Event] = []
        self.flushed = 0

    def events(self) -> Iterator[Event]:
        for k in range(1000):
            yield Tick(k)

    def send(self, command: Command) -> None:
        self.sent.append(command)

    def on(self, event: Event) -> list[Command]:
        return []

    def event(self, event: Event) -> None:
        self.logged.append(event)

    def command(self, command: Command) -> None:
        raise AssertionError(command)

    def flush(self) -> None:
        self.flushed += 1


def test_the_loop_stops_the_wheels_when_it_is_asked_to_end() -> None:
    all_of_it = Endless()
    run(all_of_it, all_of_it, all_of_it, lambda: "SIGTERM" if len(all_of_it.logged) == 5 else "")
    assert all_of_it.sent == [StopOrder(4, "ended by SIGTERM")]
    assert (len(all_of_it.logged), all_of_it.flushed) == (5, 1)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_sweeper_run_ends_in_order(tmp_path: Path, name: str) -> None:
    settings = tmp_path / "settings.toml"
    settings.write_text("[log]\nchunk_bytes = 4096\n")  # so that the log is seen to grow
    command = [sys.executable, "-m", "robot", "run", "--drawn", "--scene", "corridor"]
    command += ["--real-time", "--no-progress", "--duration-s", "300", "--config", str(settings)]
    command += ["--out", str(tmp_path), "--json", "-"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    log = tmp_path / "latest" / "log.mcap"
    end_s = time.monotonic() + START_S
    while not (log.exists() and log.stat().st_size > 20_000) and time.monotonic() < end_s:
        time.sleep(0.1)
    # As a terminal does: Ctrl-C reaches the firmware and the renderer, too.
    (os.killpg if name == "SIGINT" else os.kill)(process.pid, getattr(signal, name))
    out, err = process.communicate(timeout=START_S)
    assert process.returncode == 0, err.decode()
    summary = json.loads(out)
    assert summary["ended_by"] == name
    assert summary == json.loads((tmp_path / "latest" / "summary.json").read_text())
    assert read_header(log).scene == "corridor"
    ticks = [event for event in read_events(log) if isinstance(event, Tick)]
    assert len(ticks) > 10
    assert log.read_bytes().endswith(b"\x89MCAP0\r\n")  # closed, not cut off
    # Not the last one: an estimate bears the time of its frame.
    assert max(command.t_ns for command in read_commands(log)) >= ticks[-2].t_ns
