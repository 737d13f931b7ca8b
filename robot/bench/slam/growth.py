"""What a frame costs as the home grows: CPU time of the whole SLAM up and down a drawn corridor."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sized
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.messages import ImuSample, Landmark, Scan, Seen, WheelTravel
from robot.slam.slam import Slam

HOMES = (50, 200, 1000)  # landmarks
_PER_M, _WIDTH_M = 12.0, 2.0  # of the corridor
_SPEED_MPS, _TURN_RADPS, _STEP_S = 0.25, 0.8, 0.2
_VIEW_M, _VIEW_RAD = 3.5, 0.6
_SIGHTS = 24  # of a frame at most; frames with fewer, near the ends, are not compared
_FRAMES = 300  # compared at least: short corridors are driven again and again
_NO_SCAN = Scan(np.zeros(0), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Corridor:
    """Things (n, 2) with heights (n,) and signatures, along `length_m`."""

    length_m: float
    places: np.ndarray
    heights_m: np.ndarray
    signatures: list[bytes]

    @staticmethod
    def draw(count: int) -> Corridor:
        """A corridor of `count` things, as many in every metre."""
        rng = np.random.default_rng(count)
        length_m = count / _PER_M
        places = rng.uniform((0.0, -0.5 * _WIDTH_M), (length_m, 0.5 * _WIDTH_M), (count, 2))
        heights = rng.uniform(0.05, 1.5, count)
        return Corridor(length_m, places, heights, [rng.bytes(32) for _ in range(count)])

    def look(self, pose: SE2, tracks: Tracks, rng: np.random.Generator) -> tuple[Landmark, ...]:
        """What is seen from `pose`, the nearest of it."""
        x, y = pose.inverse().apply(self.places).T
        range_m, bearing = np.hypot(x, y), np.arctan2(y, x)
        seen = np.flatnonzero((range_m > 0.3) & (range_m < _VIEW_M) & (np.abs(bearing) < _VIEW_RAD))
        seen = seen[np.argsort(range_m[seen])][:_SIGHTS]
        sigma = np.column_stack([0.02 * range_m[seen] ** 2 / 2.0, np.full(len(seen), 0.003)])
        wrong = rng.normal(0.0, sigma)
        return tuple(
            Landmark(
                float(range_m[i] + e[0]),
                float(bearing[i] + e[1]),
                np.diag(s**2),
                self.signatures[i],
                height_m=float(self.heights_m[i]),
                track_id=track,
            )
            for i, e, s, track in zip(seen.tolist(), wrong, sigma, tracks.of(seen), strict=True)
        )


class Tracks:
    """Numbers of what is followed; who comes back into view gets a new one."""

    def __init__(self) -> None:
        self._now: dict[int, int] = {}
        self._next = 0

    def of(self, things: np.ndarray) -> list[int]:
        """The track of each thing in view; the others are lost."""
        now = {}
        for thing in things.tolist():
            now[thing] = self._now.get(thing, self._next)
            self._next += now[thing] == self._next
        self._now = now
        return list(now.values())


def measure_growth(
    homes: tuple[int, ...] = HOMES, config: Config | None = None
) -> list[dict[str, Any]]:
    """CPU time of a frame on the way back through homes of so many landmarks, and the state.

    `awake_most` counts the landmarks that the filter held at once, `known` all that it has.
    """
    rows = []
    for count in homes:
        slam, spent, most, error_m = _there_and_back(count, config or Config())
        rows.append(
            {
                "landmarks_in_home": count,
                "awake_most": most,
                "known": len(slam.memory().kind),
                "frame_us": round(1e6 * float(np.mean(spent)), 1),
                "ratio": 1.0,
                "error_at_end_m": round(error_m, 3),
            }
        )
        rows[-1]["ratio"] = round(rows[-1]["frame_us"] / rows[0]["frame_us"], 2)
    return rows


def _there_and_back(count: int, config: Config) -> tuple[Slam, list[float], int, float]:
    """The SLAM, CPU seconds of frames on the way back, most landmarks awake, error at the end."""
    home, tracks, rng = Corridor.draw(count), Tracks(), np.random.default_rng(1)
    slam = Slam(config.slam, config.robot)
    half_m = 0.5 * config.robot.track_width_m
    left = right = 0.0
    spent: list[float] = []
    t_ns, pose, most = 0, SE2(), 0
    for v, w, back in _drive(home.length_m, spent):
        for _ in range(4):
            t_ns += round(0.25e9 * _STEP_S)
            left += 0.25 * _STEP_S * (v - w * half_m) + rng.normal(0.0, 1e-4)
            right += 0.25 * _STEP_S * (v + w * half_m) + rng.normal(0.0, 1e-4)
            slam.odometry(ImuSample(t_ns, w + rng.normal(0.0, 0.002)))
            slam.odometry(WheelTravel(t_ns, t_ns, left, right))
        turned = pose.yaw_rad + 0.5 * w * _STEP_S
        step = v * _STEP_S
        pose = SE2(
            pose.x_m + step * math.cos(turned),
            pose.y_m + step * math.sin(turned),
            pose.yaw_rad + w * _STEP_S,
        )
        seen = Seen(t_ns, t_ns, 0, home.look(pose, tracks, rng), _NO_SCAN, 1.0)
        began = time.thread_time()
        slam.see(seen)
        spent_s = time.thread_time() - began
        if back and len(seen.landmarks) >= _SIGHTS:
            spent.append(spent_s)
        most = max(most, len(slam.landmarks()[0]))
    found = slam.pose_at(t_ns).world_from_base
    return slam, spent, most, math.hypot(found.x_m - pose.x_m, found.y_m - pose.y_m)


def _drive(length_m: float, compared: Sized) -> Iterator[tuple[float, float, bool]]:
    """Speed, turn rate and whether it is a way back, step by step, till enough is `compared`."""
    steps = round(length_m / (_SPEED_MPS * _STEP_S))
    turning = round(math.pi / (_TURN_RADPS * _STEP_S))
    turn = [(0.0, math.pi / (turning * _STEP_S), False)] * turning
    yield from [(0.0, 0.0, False)] * 5
    while len(compared) < _FRAMES:
        yield from [(_SPEED_MPS, 0.0, False)] * steps
        yield from turn
        yield from [(_SPEED_MPS, 0.0, True)] * steps
        yield from turn
