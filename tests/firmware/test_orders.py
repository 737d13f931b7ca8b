"""Session, orders and their answers, on the host build."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from firmware_rig import SESSION, Rig

from firmware_bridge.codec import Packet, pack
from firmware_bridge.framing import encode_frame
from firmware_bridge.host import build_number
from firmware_bridge.messages import (
    PROTOCOL_VERSION,
    Ack,
    Board,
    Clear,
    Contacts,
    Drive,
    Hello,
    HelloAck,
    Keep,
    Power,
    Result,
    State,
    Status,
    Stop,
    StopReason,
    Tune,
    Wheels,
)

GO = Drive(200, 200, 50, 40, 100)


def test_says_nothing_and_moves_nothing_without_a_session(rig: Rig) -> None:
    rig.step(300)
    assert rig.packets == []
    for session in (0, SESSION):
        assert rig.ask(GO, session=session) == Result.NO_SESSION
        assert rig.ask(Clear(1), session=session) == Result.NO_SESSION
        assert rig.ask(Stop(), session=session) == Result.NO_SESSION
    rig.step(50)
    assert rig.still
    assert {type(p.message) for p in rig.packets} == {Ack}


def test_hello_tells_who_answers(rig: Rig) -> None:
    rig.send(Hello(PROTOCOL_VERSION))
    rig.step()
    (ack,) = rig.heard(HelloAck)
    assert ack.protocol == PROTOCOL_VERSION
    assert ack.board == Board.HOST
    assert ack.boot == 1
    assert ack.build == build_number()
    assert (ack.stop_reason, ack.latch) == (StopReason.RESET, 1)
    assert rig.packets[0].session == SESSION


def test_wrong_protocol_or_session_zero_opens_nothing(rig: Rig) -> None:
    rig.send(Hello(PROTOCOL_VERSION + 1))
    rig.send(Hello(PROTOCOL_VERSION), session=0)
    rig.step()
    assert [p.session for p in rig.packets] == [0, 0]
    assert rig.ask(Clear(1)) == Result.NO_SESSION


def test_hello_without_a_session_ends_none(armed: Rig) -> None:
    armed.drive(200, 200, 200)
    armed.send(Hello(PROTOCOL_VERSION), session=0)
    armed.send(Hello(PROTOCOL_VERSION + 1), session=SESSION + 1)
    armed.step()
    assert armed.ask(GO) == Result.OK
    assert not armed.still


def test_a_session_alone_does_not_arm(rig: Rig) -> None:
    rig.send(Hello(PROTOCOL_VERSION))
    assert rig.ask(GO) == Result.LATCHED
    rig.step(30)
    assert rig.still


def test_drives_after_hello_and_clear(armed: Rig) -> None:
    armed.drive(200, 100, 600)
    assert armed.outputs.left_pwm > armed.outputs.right_pwm > 0.1
    assert (armed.outputs.brush_pwm, armed.outputs.fan_pwm) == (0.5, 0.4)
    assert armed.heard(Status)[-1].state == State.DRIVING


@pytest.mark.parametrize(
    "order",
    [
        Drive(501, 0, 0, 0, 100),
        Drive(-501, 0, 0, 0, 100),
        Drive(0, 501, 0, 0, 100),
        Drive(0, -32768, 0, 0, 100),
        Drive(0, 0, 101, 0, 100),
        Drive(0, 0, 0, 101, 100),
        Drive(0, 0, 0, 0, 0),
        Drive(0, 0, 0, 0, 1001),
    ],
)
def test_out_of_range_changes_nothing(armed: Rig, order: Drive) -> None:
    assert armed.ask(order) == Result.OUT_OF_RANGE
    armed.step(30)
    assert armed.still
    assert armed.heard(Status)[-1].refused == 1


@pytest.mark.parametrize("speed", [500, -500])
def test_the_limits_themselves_are_allowed(armed: Rig, speed: int) -> None:
    assert armed.ask(Drive(speed, -speed, 100, 0, 1000)) == Result.OK
    armed.step(20)
    assert armed.outputs.left_pwm * speed > 0.0


@pytest.mark.parametrize("valid_for_ms", [1, 2, 19, 20, 99, 1000])
def test_an_order_to_move_expires_to_the_millisecond_and_latches(
    armed: Rig, valid_for_ms: int
) -> None:
    armed.send(Drive(200, 200, 50, 40, valid_for_ms))  # taken now, before the next step
    lasted = 0
    while lasted <= 1000 and armed.step().brush_pwm > 0.0:
        lasted += 1
        if lasted % 100 == 50:
            armed.send(Hello(PROTOCOL_VERSION))  # the link is alive, only the order is old
    assert lasted == valid_for_ms - 1
    assert armed.still
    armed.step(10)
    assert armed.latch[0] == StopReason.EXPIRED
    assert armed.ask(GO) == Result.LATCHED
    armed.clear()
    assert armed.ask(GO) == Result.OK


def test_an_order_to_stand_just_ends(armed: Rig) -> None:
    armed.send(Drive(0, 0, 50, 40, 50))
    armed.step(40)
    assert armed.outputs.brush_pwm == 0.5
    armed.step(10)
    assert armed.still
    armed.step(10)
    assert armed.latch[0] == StopReason.NONE
    assert armed.heard(Status)[-1].expired == 1


def test_wheels_still_slowing_down_brake_when_the_order_ends(armed: Rig) -> None:
    """Without an order nothing is driven, not even towards rest."""
    armed.drive(450, 450, 500)
    armed.send(Drive(0, 0, 50, 40, 20))
    armed.step(19)
    assert armed.outputs.left_pwm > 0.0
    armed.step()
    assert armed.still
    armed.step(10)
    assert armed.latch[0] == StopReason.NONE


def test_keep_holds_a_session_and_opens_none(rig: Rig) -> None:
    assert rig.ask(Keep()) == Result.NO_SESSION
    rig.arm()
    rig.send(Drive(0, 0, 50, 0, 1000))
    for _ in range(4):
        rig.step(240)
        assert rig.ask(Keep()) == Result.OK
    assert rig.outputs.brush_pwm == 0.5
    rig.step(600)
    assert rig.ask(Keep()) == Result.NO_SESSION
    assert rig.ask(GO) == Result.NO_SESSION


@pytest.mark.parametrize(("full_speed_mm_s", "result"), [
    (0, Result.OUT_OF_RANGE), (99, Result.OUT_OF_RANGE), (100, Result.OK), (2000, Result.OK),
    (2001, Result.OUT_OF_RANGE), (65535, Result.OUT_OF_RANGE),
])  # fmt: skip
def test_tune_has_limits(armed: Rig, full_speed_mm_s: int, result: Result) -> None:
    assert armed.ask(Tune(full_speed_mm_s)) == result
    armed.ask(Drive(100, -100, 0, 0, 100))
    armed.step(20)
    fits = result == Result.OK
    share = 100 / full_speed_mm_s if fits else 100 / 600
    assert armed.outputs.left_pwm == pytest.approx(min(1.0, 1.75 * share), rel=0.45)
    assert armed.outputs.left_pwm * armed.outputs.right_pwm < 0.0


def test_motors_are_not_changed_under_way(armed: Rig) -> None:
    armed.drive(200, 200, 100)
    assert armed.ask(Tune(900)) == Result.BLOCKED


@pytest.mark.parametrize(("silent_ms", "lost"), [(499, False), (500, True), (501, True)])
def test_link_loss(armed: Rig, silent_ms: int, lost: bool) -> None:
    armed.send(Hello(PROTOCOL_VERSION))  # the last word: heard at the start of the next step
    armed.step(silent_ms)
    answer = armed.ask(GO)
    assert answer == (Result.NO_SESSION if lost else Result.OK)
    armed.send(Hello(PROTOCOL_VERSION))
    armed.step()
    assert armed.latch[0] == (StopReason.LINK_LOST if lost else StopReason.NONE)


def test_host_stop_latches_and_is_idempotent(armed: Rig) -> None:
    armed.drive(200, 200, 200)
    assert armed.ask(Stop()) == Result.OK
    assert armed.still
    first = armed.latch
    assert first[0] == StopReason.HOST
    assert armed.ask(Stop()) == Result.OK
    assert armed.latch == first


def test_clear_undoes_only_the_stop_it_names(armed: Rig) -> None:
    armed.ask(Stop())
    number = armed.latch[1]
    assert armed.ask(Clear(number - 1)) == Result.WRONG_LATCH
    assert armed.ask(Clear(number)) == Result.OK
    assert armed.ask(Clear(number)) == Result.OK  # said again: no harm
    armed.ask(Stop())
    assert armed.ask(Clear(number)) == Result.WRONG_LATCH  # late: must not clear the new one
    assert armed.latch == (StopReason.HOST, number + 1)


def test_host_stop_outranks_a_clear_under_way(armed: Rig) -> None:
    armed.drive(200, 200, 100)
    armed.step(bump_left=True)
    armed.step(10)
    bump = armed.latch
    armed.ask(Stop())
    assert armed.ask(Clear(bump[1])) == Result.WRONG_LATCH
    assert armed.latch[0] == StopReason.HOST


def test_another_session_stops_a_moving_robot(armed: Rig) -> None:
    armed.drive(200, 200, 200)
    armed.send(Hello(PROTOCOL_VERSION), session=SESSION + 1)
    armed.step()
    assert armed.still
    assert armed.latch[0] == StopReason.LINK_LOST
    assert armed.ask(GO) == Result.NO_SESSION
    assert armed.ask(Clear(armed.latch[1]), session=SESSION + 1) == Result.OK


def test_repeated_hello_does_not_disturb(armed: Rig) -> None:
    armed.drive(200, 200, 200)
    armed.send(Hello(PROTOCOL_VERSION))
    armed.step()
    assert armed.outputs.left_pwm > 0.1
    assert armed.latch[0] == StopReason.NONE


def test_unknown_id_and_wrong_length_are_refused(armed: Rig) -> None:
    good = pack(Packet(9, SESSION, GO))
    for body in (good + b"\0", good[:-1], b"\x63" + good[1:]):
        armed.write(encode_frame(body))
    armed.step(5)
    assert [a.result for a in armed.heard(Ack)][-3:] == [Result.UNKNOWN] * 3
    assert armed.still


def test_garbage_never_moves_it_and_is_counted(armed: Rig) -> None:
    noise = random.Random(1)
    good = encode_frame(pack(Packet(9, SESSION, GO)))
    for _ in range(300):
        if noise.random() < 0.5:
            data = noise.randbytes(noise.randrange(1, 60))
        else:
            broken = bytearray(good)
            broken[noise.randrange(len(broken))] ^= 1 << noise.randrange(8)
            data = bytes(broken)
        armed.write(data + b"\0")
        armed.step()
        assert armed.still
    armed.send(Hello(PROTOCOL_VERSION))
    armed.step(400)
    status = armed.heard(Status)[-1]
    assert status.crc_errors > 50
    assert status.framing_errors > 50


def test_recovers_right_after_garbage(armed: Rig) -> None:
    armed.write(b"\x11\x22\x33" * 400 + b"\0")
    assert armed.ask(GO) == Result.OK


def test_telemetry_keeps_its_rates(armed: Rig) -> None:
    armed.step(50)
    armed.packets.clear()
    for _ in range(20):
        armed.send(Hello(PROTOCOL_VERSION))
        armed.step(100)
    wheels = armed.heard(Wheels)
    assert len(wheels) == 100
    assert {b.time_us - a.time_us for a, b in pairwise(wheels)} == {20_000}
    assert len(armed.heard(Contacts)) == 100
    assert len(armed.heard(Status)) == 10
    assert len(armed.heard(Power)) == 2


def test_contact_changes_are_told_at_once(armed: Rig) -> None:
    armed.step(7)
    armed.packets.clear()
    armed.step(6, bump_right=True)
    assert any(c.bits for c in armed.heard(Contacts))
