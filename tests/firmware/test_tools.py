"""Self-test, driving by hand and flashing, against the firmware in simulated time."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from bridge_robot import EmulatedBoard, HostBoard, Robot
from firmware_rig import Rig
from test_host_killed import Bench

from firmware_bridge.errors import BridgeError
from firmware_bridge.flash import Flashed, check_image, flash
from firmware_bridge.host import build_number
from firmware_bridge.link import Link
from firmware_bridge.live import Live
from firmware_bridge.messages import Board, ContactBit, StopReason
from firmware_bridge.selftest import Finding, selftest
from robot.body.wheels import drive
from robot.cli import main
from robot.config import Config
from robot.errors import HardwareError


def live_of(robot: Robot) -> Live:
    """A link by hand, whose waiting lets the robot live."""
    robot.link = Link(robot.cable)
    return Live(robot.link, now_ns=lambda: robot.now_ns, sleep_ns=lambda ns: robot.live(ns // 1000))


@pytest.fixture
def robot(firmware_binary: Path) -> Iterator[Robot]:
    """A robot on the host firmware."""
    made = Robot(HostBoard(firmware_binary))
    yield made
    made.close()


# ---------------------------------------------------------------------- self-test


def failed(findings: list[Finding]) -> list[str]:
    """Names of the tests that have failed."""
    return [finding.name for finding in findings if not finding.passed]


def test_a_sound_controller_passes_and_is_left_stopped(robot: Robot) -> None:
    findings = list(selftest(live_of(robot)))
    assert failed(findings) == []
    assert [f.name for f in findings] == [
        "identity", "power", "contacts", "clear", "left wheel", "right wheel", "expiry", "stop",
    ]  # fmt: skip
    assert robot.link.stop_reason == StopReason.HOST
    assert max(map(abs, robot.travel)) < 0.08


def test_the_emulated_controller_passes(emulated_board: tuple[Path, Path]) -> None:
    robot = Robot(EmulatedBoard(emulated_board))
    assert failed(list(selftest(live_of(robot)))) == []
    robot.close()


@pytest.mark.parametrize(("pins", "name"), [
    ({"bump_left": True}, "contacts"), ({"wheel_drop": True}, "contacts"),
    ({"more_contacts": int(ContactBit.CLIFF_RIGHT)}, "contacts"), ({"battery_mv": 8000}, "power"),
])  # fmt: skip
def test_nothing_turns_while_a_sensor_is_wrong(
    robot: Robot, pins: dict[str, int], name: str
) -> None:
    robot.pins = replace(robot.pins, **pins)
    findings = list(selftest(live_of(robot)))
    assert failed(findings) == [name]
    assert all(f.remedy for f in findings if not f.passed)
    assert len(findings) == 3
    assert robot.travel == [0.0, 0.0]


def test_swapped_wheels_are_found(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    step = robot.firmware.step

    def swapped(dt_us, inputs, sent):  # type: ignore[no-untyped-def]
        left, right = inputs.left_ticks, inputs.right_ticks
        return step(dt_us, replace(inputs, left_ticks=right, right_ticks=left), sent)

    monkeypatch.setattr(robot.firmware, "step", swapped)
    assert failed(list(selftest(live_of(robot)))) == ["left wheel"]
    assert robot.link.stop_reason == StopReason.HOST


def test_another_firmware_is_found(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firmware_bridge.selftest.build_number", lambda _: 1)
    assert failed(list(selftest(live_of(robot)))) == ["identity"]


# ---------------------------------------------------------------------- driving


def test_drives_and_ends_stopped(robot: Robot, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = drive(live_of(robot), Config(), 0.2, 0.0, 1.0, clear=True)
    assert code == 0
    assert result["left_m"] == pytest.approx(robot.travel[0], abs=0.001)
    assert result["left_m"] == pytest.approx(0.18, abs=0.04)
    assert result["stopped_by"] == ""
    assert robot.link.stop_reason == StopReason.HOST
    assert "left +0.1" in capsys.readouterr().out


def test_does_not_clear_by_itself(robot: Robot) -> None:
    with pytest.raises(HardwareError, match=r"'reset'.*--clear"):
        drive(live_of(robot), Config(), 0.2, 0.0, 1.0, clear=False)
    robot.pins = replace(robot.pins, wheel_drop=True)
    with pytest.raises(HardwareError, match="remove its cause"):
        drive(live_of(robot), Config(), 0.2, 0.0, 1.0, clear=True)
    assert robot.travel == [0.0, 0.0]


def test_a_reflex_ends_it_and_is_told(robot: Robot) -> None:
    live = live_of(robot)
    live.connect()
    robot.pins = replace(robot.pins, bump_left=True)
    code, result = drive(live, Config(), 0.2, 0.0, 1.0, clear=True)
    assert (code, result["stopped_by"]) == (1, "bump")


def test_nobody_answers(robot: Robot) -> None:
    robot.cable.dead = True
    with pytest.raises(BridgeError, match="no session"):
        live_of(robot).connect()


# ---------------------------------------------------------------------- flashing

HEX = ":0100000001FE\n:00000001FF\n"


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """A small but whole image."""
    made = tmp_path / "image.hex"
    made.write_text(HEX)
    return made


class Avrdude:
    """Stands in for the program: notes what it is told, fails as often as it is told."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, fails: int) -> None:
        self.log = folder / "avrdude.log"
        program = folder / "bin" / "avrdude"
        program.parent.mkdir()
        program.write_text(
            f'#!/bin/sh\necho "$@" >> {self.log}\n'
            f'[ $(wc -l < {self.log}) -gt {fails} ] || {{ echo "not in sync" >&2; exit 1; }}\n'
        )
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")

    @property
    def calls(self) -> list[str]:
        """The command lines, one a call."""
        return self.log.read_text().splitlines() if self.log.exists() else []


@pytest.mark.parametrize(
    "text", ["", "no hex", ":0100000001FF\n", HEX[:14], HEX.replace(":", "", 1), ":00000001FF\nx"]
)
def test_a_damaged_image_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "image.hex").write_text(text)
    with pytest.raises(BridgeError, match="no complete Intel HEX file"):
        check_image(tmp_path / "image.hex")


def test_the_built_image_is_whole(emulated_board: tuple[Path, Path]) -> None:
    check_image(emulated_board[1].with_suffix(".hex"))


def put(robot: Robot, image: Path, build: int, *, yes: bool = True) -> Flashed:
    """Flash it, as if the host firmware were the board's."""
    return flash(
        lambda: live_of(robot), image, build, "/dev/x", board=Board.HOST, confirm=lambda _: yes
    )


@pytest.mark.parametrize("fails", [0, 1])
def test_flash_writes_and_checks_who_answers(
    robot: Robot, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
    avrdude = Avrdude(tmp_path, monkeypatch, fails)
    asked: list[str] = []

    def yes(question: str) -> bool:
        asked.append(question)
        return True

    build = build_number()
    done = flash(
        lambda: live_of(robot), image, build, "/dev/x", board=Board.HOST, force=True, confirm=yes
    )
    assert done.written and done.after is not None and done.after.build == build
    assert len(asked) == 1 and f"{build:08x}" in asked[0]
    assert len(avrdude.calls) == fails + 1
    assert f"flash:w:{image}:i" in avrdude.calls[-1] and "-P /dev/x" in avrdude.calls[-1]
    assert robot.link.stop_reason == StopReason.HOST  # it was told to stop before


def test_the_same_build_is_not_written_again(
    robot: Robot, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    avrdude = Avrdude(tmp_path, monkeypatch, 0)
    done = put(robot, image, build_number())
    assert not done.written
    assert avrdude.calls == []


def test_flash_without_a_yes_writes_nothing(
    robot: Robot, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    avrdude = Avrdude(tmp_path, monkeypatch, 0)
    with pytest.raises(BridgeError, match="not confirmed"):
        put(robot, image, 1, yes=False)
    assert avrdude.calls == []


def test_another_build_afterwards_and_a_failing_avrdude_are_told(
    robot: Robot, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Avrdude(tmp_path, monkeypatch, 2)
    with pytest.raises(BridgeError, match=r"could not write.*not in sync"):
        put(robot, image, 1)
    with pytest.raises(BridgeError, match="and not 00000001"):
        put(robot, image, 1)


def test_an_image_for_another_board_is_refused(robot: Robot, image: Path) -> None:
    with pytest.raises(BridgeError, match="connect the right one"):
        flash(lambda: live_of(robot), image, 1, "/dev/x", confirm=lambda _: True)


# ---------------------------------------------------------------------- command line


def test_command_line_in_real_time(
    rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench, done = Bench(rig), threading.Event()
    config = tmp_path / "robot.toml"
    config.write_text(f'[link]\nport = "{os.ttyname(bench.slave)}"\n')
    thread = threading.Thread(target=lambda: bench.live(done.is_set, 60.0))
    thread.start()
    try:
        options = ["--config", str(config), "--json", str(tmp_path / "out.json")]
        assert main(["wheels", "drive", "0.2", "0", "--seconds", "0.5", *options]) == 2
        ended = main(["wheels", "drive", "0.2", "0", "--seconds", "0.5", "--clear", *options])
        told = json.loads((tmp_path / "out.json").read_text())
        # On a busy computer an order may expire: that is a reason, and exit code 1.
        assert ended == int(told["stopped_by"] != "")
        record = str(tmp_path / "capture")
        assert main(["wheels", "monitor", "--seconds", "0.4", "--record", record, *options]) == 0
        assert json.loads((tmp_path / "out.json").read_text())["sessions"] == 1
        assert main(["wheels", "stop", *options]) == 0
    finally:
        done.set()
        thread.join()
        bench.close()
    assert main(["wheels", "monitor", record]) == 0
    assert "HelloAck" in capsys.readouterr().out
    assert rig.still


def test_the_selftest_asks_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wheels", "selftest"]) == 2
    assert "not confirmed" in capsys.readouterr().err


def test_a_drive_order_out_of_time_is_refused() -> None:
    assert main(["wheels", "drive", "0.1", "0", "--seconds", "99"]) == 2
