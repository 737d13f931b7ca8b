"""Reflexes and the latch, on the host build, with values around each limit."""

from __future__ import annotations

from pathlib import Path

import pytest
from firmware_rig import Rig

from firmware_bridge.messages import Clear, Drive, Result, StopReason

FORWARD = Drive(200, 200, 50, 40, 1000)
BACK = Drive(-100, -100, 0, 0, 1000)
TURN = Drive(100, -100, 0, 0, 1000)


@pytest.mark.parametrize(
    ("pin", "reason"),
    [
        ("bump_left", StopReason.BUMP),
        ("bump_right", StopReason.BUMP),
        ("cliff", StopReason.CLIFF),
        ("wheel_drop", StopReason.WHEEL_DROP),
    ],
)
def test_stops_in_the_very_step(armed: Rig, pin: str, reason: StopReason) -> None:
    armed.drive(200, 200, 300)
    assert armed.outputs.left_pwm > 0.1
    armed.step(**{pin: True})
    assert armed.still
    armed.step(10)
    assert armed.latch[0] == reason
    assert armed.ask(FORWARD) == Result.LATCHED
    armed.step(10, **{pin: False})
    assert armed.still  # letting go of the switch clears nothing
    assert armed.latch[0] == reason


@pytest.mark.parametrize("pin", ["bump_left", "cliff"])
def test_only_backing_away_while_the_switch_is_on(armed: Rig, pin: str) -> None:
    armed.drive(200, 200, 200)
    armed.step(10, **{pin: True})
    reason, number = armed.latch
    for order in (FORWARD, TURN, Drive(1, 0, 0, 0, 100), Drive(-100, 1, 0, 0, 100)):
        armed.clear()
        armed.send(order)
        armed.step(10)
        assert armed.still
        assert armed.latch == (reason, number + 1)
        number += 1
    armed.clear()
    armed.drive(-100, -50, 200)
    assert armed.outputs.left_pwm < armed.outputs.right_pwm < 0.0
    assert armed.latch[0] == StopReason.NONE


def test_backing_past_a_chattering_switch_goes_on(armed: Rig) -> None:
    armed.drive(-100, -100, 200)
    for on in (True, False, True, False):
        armed.send(BACK)
        armed.step(5, bump_left=on)
    assert armed.outputs.left_pwm < 0.0
    assert armed.latch[0] == StopReason.NONE


def test_bump_while_still_rolling_forward_under_a_backing_order(armed: Rig) -> None:
    armed.drive(200, 200, 300)
    armed.send(BACK)
    armed.step(20)
    armed.step(bump_left=True)
    assert armed.still
    armed.step(10)
    assert armed.latch[0] == StopReason.BUMP


def test_wheel_drop_cannot_be_cleared_while_hanging(armed: Rig) -> None:
    armed.step(10, wheel_drop=True)  # nobody drove: lifted at rest
    reason, number = armed.latch
    assert reason == StopReason.WHEEL_DROP
    assert armed.ask(Clear(number)) == Result.BLOCKED
    armed.step(wheel_drop=False)
    assert armed.ask(Clear(number)) == Result.OK


def test_the_first_reason_stays(armed: Rig) -> None:
    armed.drive(200, 200, 200)
    armed.step(10, bump_left=True)
    armed.step(10, wheel_drop=True)
    assert armed.latch[0] == StopReason.BUMP
    assert armed.ask(Clear(armed.latch[1])) == Result.BLOCKED


@pytest.mark.parametrize(("current_ma", "ms", "stops"), [
    (3999, 300, False), (4000, 99, False), (4000, 100, True), (5000, 101, True),
])  # fmt: skip
def test_over_current(armed: Rig, current_ma: int, ms: int, stops: bool) -> None:
    armed.send(FORWARD)
    armed.step(ms, current_ma=current_ma)
    assert armed.still == stops
    if stops:
        armed.step(10)
        assert armed.latch[0] == StopReason.OVER_CURRENT
        assert armed.ask(Clear(armed.latch[1])) == Result.BLOCKED
        armed.step(current_ma=100)
        armed.clear()


@pytest.mark.parametrize(("battery_mv", "ms", "stops"), [
    (9000, 400, False), (8999, 199, False), (8999, 200, True), (0, 200, True),
])  # fmt: skip
def test_brown_out(armed: Rig, battery_mv: int, ms: int, stops: bool) -> None:
    armed.send(FORWARD)
    armed.step(ms, battery_mv=battery_mv)
    assert armed.still == stops
    if stops:
        armed.step(10)
        assert armed.latch[0] == StopReason.BROWN_OUT


def test_over_current_must_last(armed: Rig) -> None:
    for _ in range(5):
        armed.send(FORWARD)
        armed.step(99, current_ma=5000)
        armed.step(current_ma=0)
    assert not armed.still


@pytest.mark.parametrize("speed", [60, 300, -300])
def test_stall(armed: Rig, speed: int) -> None:
    armed.blocked = True
    armed.drive(speed, speed, 560)
    assert not armed.still
    armed.drive(speed, speed, 200)
    assert armed.still
    assert armed.latch[0] == StopReason.STALL
    armed.blocked = False
    armed.clear()
    armed.drive(speed, speed, 1000)
    assert not armed.still  # the time before the clear does not count


def test_free_wheels_do_not_stall_however_slow(armed: Rig) -> None:
    armed.drive(15, 15, 2000)
    assert armed.latch[0] == StopReason.NONE
    assert armed.travel_m[0] > 0.02


@pytest.mark.parametrize(("gap_us", "stops"), [(25_000, False), (25_001, True), (60_000, True)])
def test_a_loop_that_comes_too_late_stops(firmware_binary: Path, gap_us: int, stops: bool) -> None:
    with Rig(firmware_binary, piece_us=100_000) as rig:
        rig.arm()
        rig.send(FORWARD)
        rig.step(20)
        out = rig.firmware.step(gap_us, rig.inputs, rig.transport.bytes_sent)
        assert (out.left_pwm == 0.0) == stops
        rig.step(10)
        assert rig.latch[0] == (StopReason.OVERRUN if stops else StopReason.NONE)
