"""The body of the simulated robot: motors, wheels, encoders, gyro, switches, battery.

A disc on two driven wheels. Motors follow their PWM with a first-order lag; a slipping wheel rolls
farther than it carries; walls are slid along, and what touches the front presses the bumper.
"""

from __future__ import annotations

import math

import numpy as np

from robot.config import RobotConfig, SimConfig
from robot.geometry.se2 import SE2, exp
from robot.sim.collide import inside, nearest
from robot.sim.faults import Faults
from robot.sim.world import World

FULL_SPEED_MPS = 0.6  # rim speed at full PWM, of ordinary motors
FRONT_RAD = math.radians(100.0)  # the bumper reaches a little past the sides
BOTH_SIDES_RAD = math.radians(15.0)
GATHER_M = 0.5
DOCK_REACH_M = 0.02  # the charge contacts' spring travel
SAME_SIDE = 0.8  # cosine between two touches of one wall
ROUNDING_M = 1e-9
RELEASE_M = 0.002  # the bumper's spring
FULL_V, EMPTY_V, CAPACITY_AH, CHARGE_A = 16.4, 12.8, 2.6, 1.0
CUT_OFF_V = 10.0  # where the pack's own protection ends it


class SimBase:
    """Deterministic for a seed. Poses are in the scene's coordinates."""

    def __init__(
        self,
        world: World,
        robot: RobotConfig,
        sim: SimConfig,
        seed: int,
        *,
        metres_per_tick: float,
        full_speed_mps: float = FULL_SPEED_MPS,
    ) -> None:
        self._world, self._robot, self._sim = world, robot, sim
        self._metres_per_tick = metres_per_tick
        self._full_speed_mps = full_speed_mps
        self._rng = np.random.default_rng([seed, 17])
        self._all_segments = world.segments()
        self._segments, self._gathered = self._all_segments, SE2(math.inf, 0.0, 0.0)
        self._cliffs = [np.ascontiguousarray(c, dtype=np.float64) for c in world.cliffs]
        uniform = self._rng.uniform
        self._scale = 1.0 + uniform(-sim.wheel_scale_error, sim.wheel_scale_error, 2)
        self._gain = 1.0 + uniform(-sim.motor_mismatch, sim.motor_mismatch, 2)
        self._gyro_bias_radps = float(uniform(-sim.gyro_bias_radps, sim.gyro_bias_radps))
        self._wheel_mps = np.zeros(2)
        self._rolled_m = np.zeros(2)
        self._slip = np.zeros(2)  # share of the rolled distance that carries nothing
        self._slip_until_s = 0.0
        self._next_slip_s = self._draw_slip_s()
        self._pressed: list[tuple[float, float]] = []  # normals of what the rim touches
        self._turned_rad = 0.0
        self._gyro_t_s = 0.0
        self.t_s = 0.0
        self.world_from_base = world.start
        self.bump_left = self.bump_right = False
        self.cliff_sensors = 0
        self.wheel_drop = self.cliff_entered = False
        self.contacts: list[tuple[float, float]] = []
        self.battery_v = FULL_V
        self.faults = Faults()

    # ------------------------------------------------------------------ what sensors read

    @property
    def cliff(self) -> bool:
        """Whether any of the sensors under the front rim sees no floor."""
        return self.cliff_sensors > 0

    @property
    def left_ticks(self) -> int:
        """Encoder count of the left wheel since start."""
        return math.floor(self._rolled_m[0] / self._metres_per_tick)

    @property
    def right_ticks(self) -> int:
        """Encoder count of the right wheel since start."""
        return math.floor(self._rolled_m[1] / self._metres_per_tick)

    @property
    def motor_current_a(self) -> float:
        """Both motors together: more when pushing against something."""
        return 0.1 + 0.8 * float(np.abs(self._wheel_mps).sum()) + 0.3 * bool(self._pressed)

    @property
    def charging(self) -> bool:
        """Whether the front touches the dock's plate, straight enough."""
        at = self._world.start.inverse() @ self.world_from_base
        return abs(at.x_m) < DOCK_REACH_M and abs(at.y_m) < 0.04 and abs(at.yaw_rad) < 0.2

    def yaw_rate_radps(self) -> float:
        """A gyro sample: the mean turn rate since the last one, with bias and noise."""
        dt_s = max(self.t_s - self._gyro_t_s, 1e-9)
        rate = self._turned_rad / dt_s
        self._turned_rad, self._gyro_t_s = 0.0, self.t_s
        self._gyro_bias_radps += self._rng.normal(0.0, self._sim.gyro_walk * math.sqrt(dt_s))
        return rate + self._gyro_bias_radps + self._rng.normal(0.0, self._sim.gyro_noise_radps)

    # ------------------------------------------------------------------ physics

    def step(self, dt_s: float, left_pwm: float, right_pwm: float) -> None:
        """Let `dt_s` pass with the given PWM, -1 to 1."""
        self.t_s += dt_s
        self._draw_slip()
        target = np.array([left_pwm, right_pwm]) * self._gain * self._full_speed_mps
        before = self._wheel_mps
        share = 1.0 - math.exp(-dt_s / self._sim.motor_lag_s)
        self._wheel_mps = before + share * (target - before)
        slip, still = self.faults.held(
            self.world_from_base.x_m, self.world_from_base.y_m, left_pwm + right_pwm > 0.0
        )
        for wheel in still:
            self._wheel_mps[wheel] = before[wheel] = 0.0
        rolled = 0.5 * (before + self._wheel_mps) * dt_s
        noise = self._sim.encoder_noise * np.sqrt(np.abs(rolled)) * self._rng.normal(size=2)
        self._rolled_m += (rolled + noise) * self._scale
        left, right = (rolled * (1.0 - np.maximum(self._slip, slip))).tolist()
        turned = (right - left) / self._robot.track_width_m
        self._move(exp(0.5 * (left + right), 0.0, turned), dt_s)
        drawn_a = self.motor_current_a - (CHARGE_A if self.charging else 0.0)
        volts = (FULL_V - EMPTY_V) * drawn_a * dt_s / (3600.0 * CAPACITY_AH)
        self.battery_v = min(FULL_V, max(CUT_OFF_V, self.battery_v - volts))

    def lift(self) -> None:
        """Take the robot up: its wheels drop, and it stays in the air until `carry_to`."""
        self.wheel_drop = True

    def carry_to(self, pose: SE2) -> None:
        """Lift the robot and put it elsewhere (scene coordinates)."""
        self.world_from_base = pose
        self._pressed = []
        self.bump_left = self.bump_right = self.wheel_drop = False
        self._look_down()

    def rebuild(self, world: World) -> None:
        """The world has changed: a door, a box, the dock. The robot stays where it is."""
        self._world, self._all_segments = world, world.segments()
        self._gathered = SE2(math.inf, 0.0, 0.0)
        self._cliffs = [np.ascontiguousarray(c, dtype=np.float64) for c in world.cliffs]

    def _move(self, motion: SE2, dt_s: float) -> None:
        if self.wheel_drop:
            return  # it hangs over the edge until somebody carries it away
        wanted = self.world_from_base @ motion
        self._gather(wanted)
        self._turned_rad += motion.yaw_rad
        x, y, radius = wanted.x_m, wanted.y_m, self._robot.radius_m
        pressed: list[tuple[float, float]] = []
        for _ in range(6):
            distance, nx, ny = nearest(self._segments, x, y, radius)
            if distance >= radius - ROUNDING_M:
                break
            x, y = x + nx * (radius - distance), y + ny * (radius - distance)
            pressed.append((nx, ny))
        else:  # wedged: no place nearby is free, so it stays
            x, y = self.world_from_base.x_m, self.world_from_base.y_m
        self._feel(SE2(x, y, wanted.yaw_rad), wanted, pressed, dt_s)
        self.world_from_base = SE2(x, y, wanted.yaw_rad)
        self._look_down()

    def _gather(self, pose: SE2) -> None:
        """Keep only the walls around at hand: a house from a mesh has many thousands."""
        if pose.distance_m(self._gathered) < GATHER_M:
            return
        reach = 2 * GATHER_M + self._robot.radius_m
        x, y = self._all_segments[:, 0::2] - pose.x_m, self._all_segments[:, 1::2] - pose.y_m
        near = (x.min(1) < reach) & (x.max(1) > -reach) & (y.min(1) < reach) & (y.max(1) > -reach)
        self._segments, self._gathered = np.ascontiguousarray(self._all_segments[near]), pose

    def _feel(
        self, pose: SE2, wanted: SE2, pressed: list[tuple[float, float]], dt_s: float
    ) -> None:
        """Bumper and contact speed, from where the rim touches."""
        if not pressed:
            reach, nx, ny = nearest(
                self._segments, pose.x_m, pose.y_m, self._robot.radius_m + RELEASE_M
            )
            held = self._pressed and reach < self._robot.radius_m + RELEASE_M
            pressed = [(nx, ny)] if held else []
        elif not self._at_dock(pose):
            dx, dy = wanted.x_m - self.world_from_base.x_m, wanted.y_m - self.world_from_base.y_m
            fresh = [n for n in pressed if not self._felt(n)]
            closing = [-(dx * nx + dy * ny) / dt_s for nx, ny in fresh]
            if max(closing, default=0.0) > 0.0:
                self.contacts.append((self.t_s, max(closing)))
        self._pressed = pressed
        self.bump_left = self.bump_right = False
        if self._at_dock(pose):
            return
        for nx, ny in pressed:
            bearing = math.remainder(math.atan2(-ny, -nx) - pose.yaw_rad, 2 * math.pi)
            if abs(bearing) < FRONT_RAD:
                self.bump_left |= bearing > -BOTH_SIDES_RAD
                self.bump_right |= bearing < BOTH_SIDES_RAD
        if self.faults.bump_held:
            self.bump_left = self.bump_right = True

    def _felt(self, normal: tuple[float, float]) -> bool:
        """Whether the rim already touched something on that side in the last step."""
        return any(normal[0] * x + normal[1] * y > SAME_SIDE for x, y in self._pressed)

    def _at_dock(self, pose: SE2) -> bool:
        """The dock's plate is soft: touching it is docking, not a contact."""
        at = self._world.start.inverse() @ pose
        return abs(at.x_m) < 2 * DOCK_REACH_M and abs(at.y_m) < 0.08

    def _look_down(self) -> None:
        if not self._cliffs:
            return
        pose, radius = self.world_from_base, self._robot.radius_m
        bearing = np.array(self._robot.cliff_bearings_rad)
        rim = pose.apply(radius * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1))
        over = [any(inside(c, x, y) for c in self._cliffs) for x, y in rim]
        self.cliff_sensors = sum(1 << i for i in range(len(over)) if over[i])
        half = self._robot.track_width_m / 2
        wheels = pose.apply(np.array([[0.0, half], [0.0, -half]]))
        self.wheel_drop = any(inside(c, x, y) for c in self._cliffs for x, y in wheels)
        self.cliff_entered |= self.wheel_drop

    # ------------------------------------------------------------------ slip

    def _draw_slip_s(self) -> float:
        if self._sim.slip_every_s <= 0:
            return math.inf
        return self._slip_until_s + float(self._rng.exponential(self._sim.slip_every_s)) + 3.0

    def _draw_slip(self) -> None:
        """Now and then a wheel (or both) slips for a moment."""
        if self.t_s >= self._next_slip_s:
            which = self._rng.integers(3)
            share = float(self._rng.uniform(0.25, self._sim.slip_share))
            self._slip = share * np.array([which != 1, which != 0], dtype=float)
            self._slip_until_s = self.t_s + float(self._rng.uniform(0.3, 0.8))
            self._next_slip_s = self._draw_slip_s()
        elif self.t_s >= self._slip_until_s:
            self._slip[:] = 0.0
