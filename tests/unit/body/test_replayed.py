"""A replay agrees with the log exactly, or names the first difference."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robot.body.replayed import ReplayResult, replay
from robot.config import Config, dump_config
from robot.errors import LogError
from robot.log.header import LogHeader
from robot.log.writer import LogWriter
from robot.messages import (
    SE2,
    Command,
    DriveCommand,
    Event,
    PoseEstimate,
    Scan,
    Seen,
    StereoFrame,
    StopOrder,
    Tick,
    WheelTravel,
)


class Adder:
    """A brain that sums up what the wheels say and answers on every tick."""

    def __init__(self, change_at: int = -1, change: float = 0.0) -> None:
        self._sum = 0.1
        self._ticks = 0
        self._change_at, self._change = change_at, change

    def on(self, event: Event) -> list[Command]:
        if isinstance(event, WheelTravel):
            self._sum = self._sum * 0.3 + event.left_m
        if isinstance(event, Seen):
            pose = SE2(event.quality, self._sum, 0.0)
            return [PoseEstimate(event.t_ns, pose, np.eye(3) * event.quality, "ok")]
        if not isinstance(event, Tick):
            return []
        self._ticks += 1
        speed = self._sum + (self._change if self._ticks == self._change_at else 0.0)
        return [DriveCommand(event.t_ns, speed, 0.0, 0.0, 0.0, 200, "test")]


class Mean:
    """Perception that measures the mean of the left image, with memory."""

    def __init__(self, offset: float = 0.0) -> None:
        self._memory, self._offset = 0.0, offset

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen:
        self._memory = 0.5 * self._memory + float(frame.left.mean()) / 512.0 + self._offset
        empty = np.zeros(0)
        scan = Scan(empty, empty, empty)
        times = {"depth": float(arrived_ns)}
        return Seen(frame.t_ns, arrived_ns, frame.seq, (), scan, self._memory, stage_ms=times)


def record(path: Path, frames: bool = True) -> tuple[int, int]:
    brain, perception = Adder(), Mean()
    rng = np.random.default_rng(5)
    counts = [0, 0]
    with LogWriter(path, LogHeader(dump_config(Config()))) as log:

        def happen(event: Event) -> None:
            log.event(event)
            counts[0] += 1
            for command in brain.on(event):
                log.command(command)
                counts[1] += 1

        for k in range(100):
            t_ns = 20_000_000 * k
            happen(WheelTravel(t_ns, t_ns, float(rng.normal()), 0.0))
            if k % 5 == 0:
                image = rng.integers(0, 256, (8, 8), np.uint8)
                frame = StereoFrame(t_ns, k // 5, image, image)
                if frames:
                    log.frame(frame)
                if k % 10 == 0:  # every second frame is too late for perception
                    happen(perception.see(frame, t_ns + 1))
            happen(Tick(t_ns))
    return counts[0], counts[1]


def again(path: Path, brain: Callable[[Config], Adder], **options: object) -> ReplayResult:
    return replay(path, make_brain=brain, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "log.mcap"
    record(path)
    return path


def test_the_same_brain_gives_the_same_commands(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    events, commands = record(path)
    result = again(path, lambda config: Adder())
    assert result.as_json() == {
        "identical": True,
        "events": events,
        "commands": commands,
        "first_difference": None,
    }
    assert (events, commands) == (210, 110)
    assert result.sentence() == "identical: 210 events gave the same 110 commands."


def test_the_last_bit_of_a_command_counts(log_path: Path) -> None:
    result = again(log_path, lambda config: Adder(change_at=31, change=1e-16))
    difference = result.first_difference
    assert not result.identical and difference is not None
    assert difference.t_ns == 20_000_000 * 30
    assert difference.index == result.commands == 30 + 4  # ticks and poses before it
    assert "DriveCommand.v_mps was 0." in difference.sentence()
    assert difference.expected != difference.got
    assert result.as_json()["first_difference"]["event"] == result.events


def test_missing_surplus_and_other_commands_are_differences(log_path: Path) -> None:
    class Silent(Adder):
        def on(self, event: Event) -> list[Command]:
            return []

    class Chatty(Adder):
        def on(self, event: Event) -> list[Command]:
            return [*super().on(event), StopOrder(event.t_ns, "why not")]

    class Stopping(Adder):
        def on(self, event: Event) -> list[Command]:
            return [StopOrder(event.t_ns, "no") for _ in super().on(event)]

    sentences = [
        again(log_path, lambda config, kind=kind: kind()).sentence()  # type: ignore[misc]
        for kind in (Silent, Chatty, Stopping)
    ]
    assert "holds a PoseEstimate, the replay sent nothing more" in sentences[0]
    assert "the replay sent a StopOrder that the log does not hold" in sentences[1]
    assert "holds a PoseEstimate, the replay sent something else" in sentences[2]


def test_the_difference_after_the_last_event_is_found(log_path: Path) -> None:
    result = again(log_path, lambda config: Adder(change_at=100, change=1.0))
    assert result.first_difference is not None and result.events == 210


def test_perception_runs_again_on_recorded_frames(log_path: Path) -> None:
    def from_frames(offset: float) -> ReplayResult:
        return again(
            log_path,
            lambda config: Adder(),
            from_frames=True,
            make_perception=lambda header: Mean(offset),
        )

    assert from_frames(0.0).identical
    result = from_frames(1e-3)
    assert result.first_difference is not None
    assert "Seen.quality was" in result.first_difference.sentence()
    assert result.commands == 0


def test_without_frames_perception_cannot_run_again(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(path, frames=False)
    with pytest.raises(LogError, match="does not hold frame 0"):
        again(
            path,
            lambda config: Adder(),
            from_frames=True,
            make_perception=lambda header: Mean(),
        )


def test_true_disparity_cannot_be_seen_again(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    text = '[perception]\nmatcher = "given"\n'
    LogWriter(path, LogHeader(text)).close()
    with pytest.raises(LogError, match="true disparity"):
        again(path, lambda config: Adder(), from_frames=True)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.99])
def test_a_cut_log_is_refused(log_path: Path, tmp_path: Path, share: float) -> None:
    data = log_path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(LogError) as error:
        again(cut, lambda config: Adder())
    assert "\n" not in str(error.value)


def test_a_damaged_log_is_refused(log_path: Path, tmp_path: Path) -> None:
    data = bytearray(log_path.read_bytes())
    data[len(data) // 4] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    with pytest.raises(LogError, match="damaged"):
        again(damaged, lambda config: Adder())
