"""A light two-dimensional flat with a robot in it: a body for scenario tests.

Kinematics with lag, collisions, a bumper, a cliff sensor, a dock with marker and charge contact,
a controller that latches stops, a noisy ray-cast scan, and answers that come late. No image is
drawn and no serial byte is sent.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from flat_boxes import CELL_M, Flat

from robot.config import Config
from robot.geometry.se2 import SE2, exp
from robot.messages import (
    Answer,
    Battery,
    ClearOrder,
    Command,
    Contact,
    DriveCommand,
    Event,
    ImuSample,
    Landmark,
    LinkState,
    Marker,
    MissionState,
    Planned,
    PlanOrder,
    Request,
    Scan,
    Seen,
    StopOrder,
    Tick,
    WheelTravel,
)
from robot.mission.worker import make_answer

NS = 1_000_000_000
TICK_NS = NS // 50
RAYS = 61
FIELD_RAD = 0.61
MIN_SIGHT_M, MAX_SIGHT_M = 0.34, 3.0
LAG_S = 0.08


class Flatland:
    """A body. `at` holds (time, function of the body) pairs to change the world on the way."""

    def __init__(
        self,
        config: Config,
        flat: Flat,
        seed: int = 0,
        *,
        duration_s: float = 600.0,
        requests: Sequence[tuple[float, str]] = ((0.5, "start"),),
        at: Sequence[tuple[float, Callable[[Flatland], None]]] = (),
        wheel_scale: float = 1.0,
        gyro_bias_radps: float = 0.0,
        stop_reason: str = "reset",
    ) -> None:
        self.config, self.flat, self.pose = config, flat, flat.start
        self.sees, self.marker_hidden, self.battery_pct = True, False, 80.0
        self.wheel_drop = False
        self.contacts: list[tuple[float, float]] = []  # (t_s, closing speed in m/s)
        self.cliff_entered = False
        self.track: list[SE2] = []  # true poses at 10 Hz, in the flat
        self.states: list[MissionState] = []
        self.drives: list[DriveCommand] = []
        self.brushing: list[bool] = []
        self.orders: list[Command] = []
        self.answers: list[Answer] = []
        self._rng = np.random.default_rng(seed)
        self._requests, self._at = deque(requests), deque(at)
        self._end_ns = int(duration_s * NS)
        self._scale, self._bias = wheel_scale, gyro_bias_radps
        self._stop, self._told_link = stop_reason, -NS
        self._v = self._w = self._left_m = self._right_m = 0.0
        self._order: DriveCommand | None = None
        self._late: deque[tuple[int, Seen]] = deque()
        self._plans: deque[Planned] = deque()
        self._touched = self._on_cliff = False
        self._touch_rad = 0.0
        self._tracks: dict[int, int] = {}  # landmark to its track
        self._next_track = 0

    # ------------------------------------------------------------------ Body

    def events(self) -> Iterator[Event]:
        now_ns = 0
        while now_ns < self._end_ns:
            now_ns += TICK_NS
            while self._at and self._at[0][0] * NS <= now_ns:
                self._at.popleft()[1](self)
            yaw_rad = self._move(now_ns)
            yield from self._sensors(now_ns, yaw_rad)
            while self._requests and self._requests[0][0] * NS <= now_ns:
                verb, *args = self._requests.popleft()[1].split()
                yield Request(now_ns, verb, tuple(args))
            if now_ns % (NS // 10) == 0:
                self.track.append(self.pose)
                self.brushing.append(self._order is not None and self._order.brush > 0)
                if self.sees:
                    self._late.append((now_ns + NS * 15 // 100, self._see(now_ns)))
            while self._late and self._late[0][0] <= now_ns:
                yield self._late.popleft()[1]
            while self._plans and self._plans[0].t_ns <= now_ns:
                yield self._plans.popleft()
            yield Tick(now_ns)

    def send(self, command: Command) -> None:
        if isinstance(command, DriveCommand):
            self._order = command
            self.drives.append(command)
        elif isinstance(command, PlanOrder):
            answer = make_answer(command, self.config.planning, self.config.robot)
            at_ns = command.t_ns + NS * 3 // 10
            self._plans.append(replace(answer, t_ns=at_ns))
        elif isinstance(command, StopOrder):
            self._stop, self._told_link = "host", -NS
            self.orders.append(command)
        elif isinstance(command, ClearOrder):
            self._stop, self._told_link = "", -NS
            self.orders.append(command)
        elif isinstance(command, Answer):
            self.answers.append(command)
        elif isinstance(command, MissionState):
            self.states.append(command)
            if command.state in ("done", "error"):
                self._end_ns = min(self._end_ns, command.t_ns + NS // 2)

    # ------------------------------------------------------------------ what tests ask

    @property
    def phases(self) -> list[str]:
        """Names of the states in order, without repetition."""
        names = [s.state for s in self.states]
        return [n for i, n in enumerate(names) if i == 0 or n != names[i - 1]]

    @property
    def docked(self) -> bool:
        """Whether the charge contact is closed."""
        return self._charging()

    @property
    def covered_pct(self) -> float:
        """Share of the reachable floor that the brush has truly swept."""
        floor = self.flat.reachable(self.config.robot.radius_m, self.config.robot.brush_width_m)
        swept = np.zeros(floor.shape, np.uint8)
        width = round(self.config.robot.brush_width_m / CELL_M)
        for a, b, on in zip(self.track[:-1], self.track[1:], self.brushing[1:], strict=True):
            if on:
                ends = [(round(p.x_m / CELL_M), round(p.y_m / CELL_M)) for p in (a, b)]
                cv2.line(swept, ends[0], ends[1], 1, width)
        return 100.0 * float((floor & (swept > 0)).sum() / floor.sum())

    # ------------------------------------------------------------------ the world

    def _move(self, now_ns: int) -> float:
        """One tick of motion; returns how far the robot has turned."""
        order, dt = self._order, TICK_NS / NS
        fresh = order is not None and now_ns - order.t_ns <= order.valid_for_ms * 1_000_000
        v, w = (order.v_mps, order.yaw_rate_radps) if fresh and not self._stop else (0.0, 0.0)
        if self._touched and v + 0.5 * self.config.robot.track_width_m * abs(w) > 1e-6:
            v = w = 0.0  # neither wheel may push forward
        self._v += (v - self._v) * dt / LAG_S
        self._w += (w - self._w) * dt / LAG_S
        wished = self.pose @ exp(self._v * dt, 0.0, self._w * dt)
        radius_m = self.config.robot.radius_m
        wished = self._pushed_out(wished, radius_m)
        c, s = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
        rolled_m = c * (wished.x_m - self.pose.x_m) + s * (wished.y_m - self.pose.y_m)
        self.pose = wished
        turned = 0.5 * self.config.robot.track_width_m * self._w * dt
        self._left_m += (rolled_m - turned) * self._scale
        self._right_m += (rolled_m + turned) * self._scale
        self._feel(now_ns)
        return self._w * dt

    def _pushed_out(self, pose: SE2, radius_m: float) -> SE2:
        """The nearest pose that does not cut into matter: bodies slide along walls."""
        solid, r = self.flat.solid, round(radius_m / CELL_M) + 1
        if self._at_m(self.flat.solid_m, pose) >= radius_m + CELL_M:
            return pose
        x, y = pose.x_m / CELL_M, pose.y_m / CELL_M
        x0, y0 = max(0, int(x) - r), max(0, int(y) - r)
        ys, xs = np.nonzero(solid[y0 : int(y) + r + 1, x0 : int(x) + r + 1])
        for _ in range(4):
            dx = x - np.clip(x, xs + x0, xs + x0 + 1)
            dy = y - np.clip(y, ys + y0, ys + y0 + 1)
            far = np.hypot(dx, dy)
            k = int(np.argmin(far))
            lack = radius_m / CELL_M - far[k]
            if lack <= 0.0 or far[k] == 0.0:
                break
            x, y = x + dx[k] / far[k] * lack, y + dy[k] / far[k] * lack
        return SE2(float(x) * CELL_M, float(y) * CELL_M, pose.yaw_rad)

    def _feel(self, now_ns: int) -> None:
        self._bump = self._bumper()
        if any(self._bump) and not self._touched:
            if not self._charging():
                closing = self._v * math.cos(self._touch_rad)
                self.contacts.append((now_ns / NS, max(0.0, closing)))
            self._latch("bump")
        self._touched = any(self._bump)
        ahead = self.pose @ SE2(self.config.robot.radius_m)
        on_cliff = self._cell(self.flat.cliff, ahead)
        if on_cliff and not self._on_cliff:
            self._latch("cliff")
        self._on_cliff = bool(on_cliff)
        self.cliff_entered |= bool(self._cell(self.flat.cliff, self.pose))

    def _latch(self, reason: str) -> None:
        if not self._stop:
            self._stop, self._told_link = reason, -NS

    def _bumper(self) -> tuple[bool, bool]:
        field = self.flat.solid_m
        if self._at_m(field, self.pose) > self.config.robot.radius_m + 2 * CELL_M:
            return False, False
        x, y = self.pose.x_m / CELL_M, self.pose.y_m / CELL_M
        r = round(self.config.robot.radius_m / CELL_M) + 2
        ys, xs = np.nonzero(
            self.flat.solid[int(y) - r : int(y) + r + 1, int(x) - r : int(x) + r + 1]
        )
        dx = np.clip(x, xs + int(x) - r, xs + int(x) - r + 1) - x
        dy = np.clip(y, ys + int(y) - r, ys + int(y) - r + 1) - y
        k = int(np.argmin(dx**2 + dy**2))
        if math.hypot(dx[k], dy[k]) * CELL_M > self.config.robot.radius_m + 0.002:
            return False, False
        bearing = math.remainder(math.atan2(dy[k], dx[k]) - self.pose.yaw_rad, 2 * math.pi)
        self._touch_rad = bearing
        return -0.2 < bearing < 1.5, -1.5 < bearing < 0.2

    def _charging(self) -> bool:
        at = self.flat.start.inverse() @ self.pose
        return at.x_m > -0.008 and abs(at.y_m) < 0.03 and abs(at.yaw_rad) < 0.2

    def _at_m(self, field: np.ndarray, pose: SE2) -> float:
        return float(self._cell(field, pose))

    @staticmethod
    def _cell(field: np.ndarray, pose: SE2) -> np.generic:
        rows, columns = field.shape
        i = min(max(int(pose.y_m / CELL_M), 0), rows - 1)
        return field[i, min(max(int(pose.x_m / CELL_M), 0), columns - 1)]

    # ------------------------------------------------------------------ the senses

    def _sensors(self, now_ns: int, yaw_rad: float) -> Iterator[Event]:
        yield WheelTravel(now_ns, now_ns, self._left_m, self._right_m)
        rate = yaw_rad * NS / TICK_NS + self._bias + self._rng.normal(0.0, 0.003)
        yield ImuSample(now_ns, rate)
        yield Contact(
            now_ns, *self._bump, self._on_cliff, self.wheel_drop, charging=self._charging()
        )
        if now_ns - self._told_link >= NS // 5:
            self._told_link = now_ns
            yield LinkState(now_ns, True, self._stop)
        if now_ns % NS == 0:
            yield Battery(now_ns, 14.8, self.battery_pct)

    def _see(self, now_ns: int) -> Seen:
        bearing = np.linspace(-FIELD_RAD, FIELD_RAD, RAYS)
        range_m = self._cast(self.pose, bearing)
        noise = self._rng.normal(0.0, 1.0, RAYS) * 0.01 * range_m**2
        hit = (range_m < MAX_SIGHT_M) & (range_m > MIN_SIGHT_M)
        clear_m = np.where(range_m < MIN_SIGHT_M, 0.0, np.minimum(range_m, MAX_SIGHT_M) - 0.05)
        scan = Scan(bearing, np.where(hit, range_m + noise, np.nan), clear_m)
        arrives_ns = now_ns + NS * 15 // 100
        marks = self._landmarks(range_m)
        return Seen(
            now_ns, arrives_ns, now_ns // (NS // 10), marks, scan, 1.0, None, self._marker()
        )

    def _landmarks(self, reach_m: np.ndarray) -> tuple[Landmark, ...]:
        """The landmarks in sight, with the errors of stereo; `reach_m` of the scan's rays."""
        at = self.pose.inverse().apply(self.flat.landmarks_m)
        range_m, bearing = np.hypot(at[:, 0], at[:, 1]), np.arctan2(at[:, 1], at[:, 0])
        ray = np.rint((bearing + FIELD_RAD) / (2 * FIELD_RAD) * (RAYS - 1)).astype(int)
        near = (np.abs(bearing) < 0.55) & (range_m > 0.4) & (range_m < 2.5)
        near &= reach_m[ray.clip(0, RAYS - 1)] > range_m - 0.05
        index = np.flatnonzero(near)
        sigma = np.stack([0.005 + 0.015 * range_m[index] ** 2, np.full(len(index), 0.005)], axis=1)
        noise = self._rng.normal(0.0, 1.0, sigma.shape) * sigma
        self._tracks = {i: t for i, t in self._tracks.items() if near[i]}
        return tuple(
            Landmark(
                float(range_m[i] + noise[k, 0]),
                float(bearing[i] + noise[k, 1]),
                np.diag(sigma[k] ** 2),
                self.flat.signatures[i],
                track_id=self._track(i),
            )
            for k, i in enumerate(index.tolist())
        )

    def _track(self, landmark: int) -> int:
        """The number under which a landmark is followed while it stays in sight."""
        if landmark not in self._tracks:
            self._tracks[landmark] = self._next_track
            self._next_track += 1
        return self._tracks[landmark]

    def _cast(self, pose: SE2, bearing: np.ndarray) -> np.ndarray:
        """Ranges until something visible, by stepping through the distance field."""
        c, s = np.cos(pose.yaw_rad + bearing), np.sin(pose.yaw_rad + bearing)
        field, r = self.flat.seen_m, np.full(len(bearing), 0.01)
        rows, columns = field.shape
        for _ in range(40):
            x = np.clip(((pose.x_m + r * c) / CELL_M).astype(int), 0, columns - 1)
            y = np.clip(((pose.y_m + r * s) / CELL_M).astype(int), 0, rows - 1)
            step = field[y, x]
            far = step > CELL_M
            if not far.any():
                break
            r = r + np.where(far, step, 0.0)
        return r

    def _marker(self) -> Marker | None:
        at = self.pose.inverse() @ (
            self.flat.start @ SE2(self.config.robot.radius_m + 0.005, 0, math.pi)
        )
        x, away_m = at.x_m - 0.13, math.hypot(at.x_m - 0.13, at.y_m)
        facing = abs(math.remainder(at.yaw_rad + math.pi, 2 * math.pi)) < 1.0
        inside = x > 0 and abs(math.atan2(at.y_m, x)) < 0.5 and 0.12 < away_m < 2.0
        if self.marker_hidden or not facing or not inside:
            return None
        bearing = math.atan2(at.y_m, at.x_m)
        if self._cast(self.pose, np.array([bearing]))[0] < math.hypot(at.x_m, at.y_m) - 0.05:
            return None
        sigma_m, sigma_rad = 0.003 + 0.006 * away_m, 0.03 + 0.05 * away_m
        dx, dy, dyaw = self._rng.normal(0.0, 1.0, 3) * (sigma_m, sigma_m, sigma_rad)
        seen = SE2(at.x_m + dx, at.y_m + dy, at.yaw_rad + dyaw)
        marker_id = self.config.robot.dock_marker_id
        return Marker(marker_id, seen, np.diag([sigma_m**2, sigma_m**2, sigma_rad**2]))


class NoLog:
    """An event log that keeps only the commands."""

    def __init__(self) -> None:
        self.commands: list[Command] = []

    def event(self, event: Event) -> None:
        """Events are the body's own business here."""

    def command(self, command: Command) -> None:
        self.commands.append(command)

    def flush(self) -> None:
        """Nothing is buffered."""
