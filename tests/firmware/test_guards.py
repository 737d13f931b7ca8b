"""Every guard of the core with values dense around its limit, and what must not trip it."""

from __future__ import annotations

from pathlib import Path

import pytest
from firmware_rig import SESSION, Rig

from firmware_bridge.messages import (
    Clear,
    ContactBit,
    Drive,
    Hello,
    Result,
    State,
    Status,
    Stop,
    StopReason,
)

FORWARD = Drive(200, 200, 50, 40, 1000)
CLIFFS = (
    ContactBit.CLIFF_LEFT,
    ContactBit.CLIFF_FRONT_LEFT,
    ContactBit.CLIFF_FRONT_RIGHT,
    ContactBit.CLIFF_RIGHT,
)
STOPPING = {
    ContactBit.BUMP_LEFT: StopReason.BUMP,
    ContactBit.BUMP_RIGHT: StopReason.BUMP,
    **dict.fromkeys(CLIFFS, StopReason.CLIFF),
    ContactBit.WHEEL_DROP: StopReason.WHEEL_DROP,
}


@pytest.mark.parametrize(("bit", "reason"), STOPPING.items(), ids=lambda v: v.name)
@pytest.mark.parametrize("speeds", [(1, 0), (0, 1), (500, 500), (100, -100), (-100, 100)])
def test_each_contact_alone_stops_any_forward_motion(
    armed: Rig, bit: ContactBit, reason: StopReason, speeds: tuple[int, int]
) -> None:
    armed.drive(*speeds, 60)
    assert armed.outputs.brush_pwm == 0.5
    armed.step(more_contacts=int(bit))
    assert armed.still
    armed.step(6)
    assert armed.latch[0] == reason


@pytest.mark.parametrize("bits", range(0, 256, 17))
@pytest.mark.parametrize("speeds", [(100, 100), (-100, -100), (0, 0)])
def test_contacts_in_any_combination(armed: Rig, bits: int, speeds: tuple[int, int]) -> None:
    armed.drive(*speeds, 100)
    armed.step(10, more_contacts=bits)
    ahead, expected = speeds[0] > 0, StopReason.NONE
    if bits & ContactBit.WHEEL_DROP:
        expected = StopReason.WHEEL_DROP
    elif ahead and bits & sum(CLIFFS):
        expected = StopReason.CLIFF
    elif ahead and bits & (ContactBit.BUMP_LEFT | ContactBit.BUMP_RIGHT):
        expected = StopReason.BUMP
    assert armed.latch[0] == expected
    assert armed.still == (expected != StopReason.NONE)


@pytest.mark.parametrize("bits", [ContactBit.WHEEL_DROP, ContactBit.CHARGING])
def test_backing_off_a_charger_is_free_but_not_while_hanging(armed: Rig, bits: ContactBit) -> None:
    armed.step(more_contacts=int(bits))
    armed.drive(-100, -100, 200)
    assert (armed.outputs.left_pwm < 0.0) == (bits == ContactBit.CHARGING)


@pytest.mark.parametrize("current_ma", [3999, 4000, 4001, 32767, -32768, -4000])
@pytest.mark.parametrize("ms", [1, 99, 100, 101])
def test_over_current_limits(armed: Rig, current_ma: int, ms: int) -> None:
    armed.send(FORWARD)
    armed.step(ms, current_ma=current_ma)
    assert armed.still == (current_ma >= 4000 and ms >= 100)


@pytest.mark.parametrize(("current_ma", "result"), [
    (3999, Result.OK), (4000, Result.BLOCKED), (4001, Result.BLOCKED),
])  # fmt: skip
def test_over_current_must_be_gone_for_a_clear(armed: Rig, current_ma: int, result: Result) -> None:
    armed.send(FORWARD)
    armed.step(110, current_ma=6000)
    armed.step(current_ma=current_ma)
    assert armed.ask(Clear(armed.latch[1])) == result


@pytest.mark.parametrize("battery_mv", [0, 8998, 8999, 9000, 9001, 65535])
@pytest.mark.parametrize("ms", [1, 199, 200, 201])
def test_brown_out_limits(armed: Rig, battery_mv: int, ms: int) -> None:
    armed.send(FORWARD)
    armed.step(ms, battery_mv=battery_mv)
    assert armed.still == (battery_mv < 9000 and ms >= 200)


@pytest.mark.parametrize(("battery_mv", "result"), [
    (8999, Result.BLOCKED), (9000, Result.OK), (9001, Result.OK),
])  # fmt: skip
def test_the_battery_must_be_back_for_a_clear(armed: Rig, battery_mv: int, result: Result) -> None:
    armed.send(FORWARD)
    armed.step(210, battery_mv=5000)
    armed.step(battery_mv=battery_mv)
    assert armed.ask(Clear(armed.latch[1])) == result


def test_a_brown_out_must_last(armed: Rig) -> None:
    for _ in range(4):
        armed.send(FORWARD)
        armed.step(199, battery_mv=5000)
        armed.step(battery_mv=16000)
    assert not armed.still


def stalls_after_ms(rig: Rig, left: int, right: int, limit_ms: int) -> int | None:
    """For how long both wheels are driven before it latches; None: longer than the limit."""
    for ms in range(limit_ms):
        if ms % 20 == 0:
            rig.send(Drive(left, right, 50, 0, 100))
        if rig.step().brush_pwm == 0.0:
            return ms
    return None


@pytest.mark.parametrize("speed", [50, 51, 200, 500, -50, -500])
def test_a_blocked_wheel_stalls_after_0_6_s(armed: Rig, speed: int) -> None:
    armed.blocked = True
    ms = stalls_after_ms(armed, speed, speed, 1000)
    assert ms is not None and 595 <= ms <= 660  # the set-point reaches 50 mm/s in 0.04 s
    armed.step(6)
    assert armed.latch[0] == StopReason.STALL


@pytest.mark.parametrize("side", [0, 1])
def test_one_blocked_wheel_is_enough(armed: Rig, side: int) -> None:
    armed.gains[side] = 0.0
    assert stalls_after_ms(armed, 100, 100, 1000) is not None


@pytest.mark.parametrize("speed", [49, -49, 30])
def test_a_slow_blocked_wheel_stalls_once_it_is_pushed_hard(armed: Rig, speed: int) -> None:
    armed.blocked = True
    ms = stalls_after_ms(armed, speed, speed, 3000)
    assert ms is not None and ms > 700


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("speed", [100, -300])
def test_an_encoder_connected_backwards_stalls(armed: Rig, side: int, speed: int) -> None:
    """It would push ever harder: the wheel must not run away for longer than the stall's time."""
    armed.encoder_signs[side] = -1
    ms = stalls_after_ms(armed, speed, speed, 1000)
    assert ms is not None and ms <= 700


@pytest.mark.parametrize("speed", [400, -400])
def test_reversing_at_full_speed_is_no_stall(armed: Rig, speed: int) -> None:
    for _ in range(4):
        armed.drive(speed, speed, 500)
        armed.drive(-speed, -speed, 500)
    assert armed.latch[0] == StopReason.NONE
    assert armed.outputs.left_pwm * speed < 0.0


def test_a_wheel_that_is_carried_along_is_no_stall(armed: Rig) -> None:
    """Pushed by hand it runs faster than ordered, and the loop brakes against that."""
    armed.drive(100, 100, 400)
    for _ in range(80):
        armed.speed_mps = [0.3, 0.3]
        armed.drive(100, 100, 20)
    assert armed.outputs.left_pwm < 0.0
    assert armed.latch[0] == StopReason.NONE


@pytest.mark.parametrize("gap_us", [24_999, 25_000, 25_001, 25_002, 1_000_000])
def test_overrun_only_matters_while_an_order_runs(firmware_binary: Path, gap_us: int) -> None:
    with Rig(firmware_binary, piece_us=2_000_000) as rig:
        rig.arm()
        rig.firmware.step(min(gap_us, 400_000), rig.inputs, rig.transport.bytes_sent)
        rig.send(Hello(1))
        rig.step(10)
        assert rig.latch[0] == StopReason.NONE
        rig.send(Drive(0, 0, 50, 0, 1000))
        rig.step(5)
        out = rig.firmware.step(gap_us, rig.inputs, rig.transport.bytes_sent)
        assert (out.brush_pwm == 0.0) == (gap_us > 25_000)


@pytest.mark.parametrize("message", [FORWARD, Stop(), Clear(1)])
def test_orders_of_another_session_neither_act_nor_keep_the_link(armed: Rig, message) -> None:  # type: ignore[no-untyped-def]
    armed.send(Drive(0, 0, 50, 0, 1000))
    for _ in range(25):
        assert armed.ask(message, session=SESSION + 1) == Result.NO_SESSION
        armed.step(19)
    assert armed.still
    assert armed.ask(FORWARD) == Result.NO_SESSION


def test_noise_does_not_keep_the_link(armed: Rig) -> None:
    armed.send(Drive(0, 0, 50, 0, 1000))
    for _ in range(50):
        armed.write(b"\x05noise\x00")
        armed.step(10)
    assert armed.ask(FORWARD) == Result.NO_SESSION


@pytest.mark.parametrize("valid_for_ms", [1, 20, 200, 490])
def test_each_new_order_starts_its_own_time(armed: Rig, valid_for_ms: int) -> None:
    for _ in range(5):
        armed.send(Drive(100, 100, 50, 0, valid_for_ms))
        armed.step(max(1, valid_for_ms - 1))
    assert armed.still == (valid_for_ms == 1)


@pytest.mark.parametrize("order", [
    Drive(501, 501, 0, 0, 100), Drive(100, 100, 101, 0, 100), Drive(100, 100, 0, 0, 1001),
])  # fmt: skip
def test_a_refused_order_does_not_prolong_the_one_before(armed: Rig, order: Drive) -> None:
    armed.send(Drive(100, 100, 50, 0, 200))
    for _ in range(9):
        armed.step(20)
        assert armed.ask(order) == Result.OUT_OF_RANGE
    armed.step(20)
    assert armed.still
    armed.step(5)
    assert armed.latch[0] == StopReason.EXPIRED


REASONS = {
    "bump_left": StopReason.BUMP,
    "cliff": StopReason.CLIFF,
    "wheel_drop": StopReason.WHEEL_DROP,
}


@pytest.mark.parametrize(("pin", "reason"), REASONS.items())
def test_nothing_but_a_clear_unlatches(armed: Rig, pin: str, reason: StopReason) -> None:
    armed.drive(200, 200, 100)
    armed.step(5, **{pin: True})
    armed.step(5, **{pin: False})
    latch = armed.latch
    assert latch[0] == reason
    for message in (FORWARD, Hello(1), Drive(0, 0, 0, 0, 100), Drive(-100, -100, 0, 0, 100)):
        armed.send(message)
        armed.step(30)
        assert armed.latch == latch
        assert armed.still
    armed.send(Hello(1), session=SESSION + 1)  # nor does another host
    armed.step(600)  # nor the loss of the link
    armed.send(Hello(1))
    armed.step(300)
    assert armed.latch == latch
    assert armed.heard(Status)[-1].state == State.LATCHED


def test_the_order_before_the_stop_does_not_come_back(armed: Rig) -> None:
    armed.drive(200, 200, 100, valid_for_ms=1000)
    armed.ask(Stop())
    armed.clear()
    armed.step(100)
    assert armed.still
    assert armed.heard(Status)[-1].state == State.READY


def test_everything_holds_while_the_clock_wraps(firmware_binary: Path) -> None:
    """The 32-bit microsecond clock turns over after 71 minutes."""
    with Rig(firmware_binary, piece_us=1_000_000) as rig:
        rig.firmware.step(2**32 - 500_000, rig.inputs, 0)
        rig.arm()
        rig.drive(200, 200, 800, valid_for_ms=50)
        assert rig.latch[0] == StopReason.NONE
        assert rig.speed_mps[0] == pytest.approx(0.2, rel=0.03)
    with Rig(firmware_binary, piece_us=1_000_000) as rig:
        rig.firmware.step(2**32 - 60_000, rig.inputs, 0)
        rig.arm()
        rig.send(Drive(200, 200, 50, 0, 100))
        assert rig.step(99).brush_pwm == 0.5
        assert rig.step(1).brush_pwm == 0.0
        rig.step(500)
        assert rig.ask(FORWARD) == Result.NO_SESSION


@pytest.mark.parametrize("pin", ["bump_left", "bump_right", "cliff"])
def test_not_one_step_towards_a_pressed_switch(armed: Rig, pin: str) -> None:
    armed.step(**{pin: True})
    armed.send(FORWARD)
    for _ in range(25):
        out = armed.step()
        assert out.left_pwm == out.right_pwm == out.brush_pwm == 0.0


@pytest.mark.parametrize("speeds", [(1, 0), (0, 1), (-1, 0), (0, -1)])
def test_one_moving_wheel_is_enough_to_latch_an_expired_order(
    armed: Rig, speeds: tuple[int, int]
) -> None:
    armed.send(Drive(*speeds, 0, 0, 50))
    armed.step(60)
    assert armed.latch[0] == StopReason.EXPIRED
