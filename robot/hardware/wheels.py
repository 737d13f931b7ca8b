"""The wheels, through the serial bridge: telemetry to events, commands to orders."""

from __future__ import annotations

import math
import time

from firmware_bridge.host import build_number
from firmware_bridge.link import Link, Received
from firmware_bridge.messages import (
    CLIFF,
    MAX_VALID_FOR_MS,
    Board,
    ContactBit,
    Contacts,
    Drive,
    Power,
    Status,
    StopReason,
    Wheels,
)
from firmware_bridge.transport import SerialTransport, Transport
from robot.config import LinkConfig, RobotConfig
from robot.errors import HardwareError
from robot.messages import (
    Battery,
    ClearOrder,
    Command,
    Contact,
    DriveCommand,
    Event,
    LinkState,
    StopOrder,
    WheelTravel,
)

STATE_PERIOD_NS = 200_000_000
LAST_WORD_S = 0.3


def open_wheels(robot: RobotConfig, config: LinkConfig) -> WheelBridge:
    """The wheels on the configured serial port, or on the one that is found.

    Raises HardwareError when there is no such port now; one that vanishes later is waited for.
    """
    transport = SerialTransport(config.port, config.baud)
    if not transport.open():
        raise HardwareError(transport.problem)
    return WheelBridge(make_link(transport, config), robot, config)


def make_link(transport: Transport, config: LinkConfig) -> Link:
    """The link to these motors."""
    return Link(transport, full_speed_mm_s=round(config.full_speed_mps * 1000))


def who(link: Link) -> str:
    """Which board and firmware answers, and whether it was built from these very sources."""
    ack = link.controller
    if ack is None:
        return "nobody"
    name = Board(ack.board).name.lower() if ack.board in Board._value2member_map_ else "unknown"
    known = name != "unknown" and build_number(name) == ack.build
    remark = "" if known else ", another than this program's; `sweeper wheels flash` writes it"
    return f"board {name}, build {ack.build:08x}{remark}"


def wheel_speeds(
    v_mps: float, yaw_rate_radps: float, track_width_m: float, max_wheel_mps: float
) -> tuple[float, float]:
    """Rim speeds (left, right) in m/s of a differential drive.

    Where a wheel would exceed its limit both are slowed alike, so the curve stays the same.
    """
    turn = 0.5 * track_width_m * yaw_rate_radps
    left, right = v_mps - turn, v_mps + turn
    scale = min(1.0, max_wheel_mps / max(abs(left), abs(right), max_wheel_mps))
    return left * scale, right * scale


class WheelBridge:
    """Speaks `robot.messages` on one side and the controller's messages on the other."""

    def __init__(self, link: Link, robot: RobotConfig, config: LinkConfig) -> None:
        self.link = link
        self._track_width_m = robot.track_width_m
        self._config = config
        self._said: tuple[bool, str] | None = None
        self._said_ns = 0

    def close(self) -> None:
        """Let go of the serial port; a stop that waits for its answer gets a moment for it."""
        end_s = time.monotonic() + LAST_WORD_S
        while self.link.connected and self.link.stopping and time.monotonic() < end_s:
            self.link.poll(time.monotonic_ns())
            time.sleep(0.005)
        self.link.close()

    # ------------------------------------------------------------------ events

    def poll(self, now_ns: int) -> list[Event]:
        """What has happened since the last call, in order; `LinkState` comes last."""
        events = [e for r in self.link.poll(now_ns) if (e := self._event(r)) is not None]
        state = (self.link.connected, self._stop_reason())
        if state != self._said or now_ns - self._said_ns >= STATE_PERIOD_NS:
            self._said, self._said_ns = state, now_ns
            counters = self.link.counters
            errors = counters.crc_errors + counters.framing_errors
            events.append(LinkState(now_ns, *state, errors, counters.retries))
        return events

    def _stop_reason(self) -> str:
        """Empty, or the latched reason in lower case; "disconnected" without a session."""
        if not self.link.connected:
            return "disconnected"
        reason = self.link.stop_reason
        return "" if reason == StopReason.NONE else reason.name.lower()

    def _event(self, received: Received) -> Event | None:
        message, t_ns = received.message, received.t_ns
        if isinstance(message, Wheels):
            scale = self._config.metres_per_tick
            return WheelTravel(
                t_ns, received.arrived_ns, message.left_ticks * scale, message.right_ticks * scale
            )
        if isinstance(message, Contacts):
            bits = message.bits
            return Contact(
                t_ns,
                bump_left=bool(bits & ContactBit.BUMP_LEFT),
                bump_right=bool(bits & ContactBit.BUMP_RIGHT),
                cliff=bool(bits & CLIFF),
                cliff_sensors=(bits & CLIFF) // ContactBit.CLIFF_LEFT,
                wheel_drop=bool(bits & ContactBit.WHEEL_DROP),
                charging=bool(bits & ContactBit.CHARGING),
            )
        if isinstance(message, Power):
            return Battery(t_ns, message.battery_mv / 1000.0, self._charge_pct(message.battery_mv))
        assert isinstance(message, Status)
        return None  # the link has noted it

    def _charge_pct(self, battery_mv: int) -> float:
        empty_v, full_v = self._config.battery_empty_v, self._config.battery_full_v
        share = (battery_mv / 1000.0 - empty_v) / max(full_v - empty_v, 0.1)
        return 100.0 * min(1.0, max(0.0, share))

    # ------------------------------------------------------------------ commands

    def send(self, command: Command) -> None:
        """Carry out DriveCommand, StopOrder and ClearOrder; anything else is not for wheels."""
        if isinstance(command, DriveCommand):
            self.link.drive(command.t_ns, self._drive(command))
        elif isinstance(command, StopOrder):
            self.link.stop(command.t_ns)
        elif isinstance(command, ClearOrder):
            self.link.clear(command.t_ns)

    def _drive(self, command: DriveCommand) -> Drive:
        """The order on the wire: clamped, and standing still where a number is not one."""
        left, right = wheel_speeds(
            command.v_mps,
            command.yaw_rate_radps,
            self._track_width_m,
            self._config.max_wheel_mps,
        )
        if not (math.isfinite(left) and math.isfinite(right)):
            left = right = 0.0
        return Drive(
            round(left * 1000.0),
            round(right * 1000.0),
            _percent(command.brush),
            _percent(command.fan),
            max(1, min(MAX_VALID_FOR_MS, command.valid_for_ms)),
        )


def _percent(share: float) -> int:
    return round(100.0 * min(1.0, max(0.0, share))) if math.isfinite(share) else 0
