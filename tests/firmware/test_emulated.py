"""The real ATmega328P image on an emulated board: interrupts, timers, ADC, UART, watchdog."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import pytest
import trials
from firmware_rig import Rig, emulated_rig

from firmware_bridge.board import build_image, image_size
from firmware_bridge.errors import BridgeError
from firmware_bridge.host import build_number
from firmware_bridge.link import Link
from firmware_bridge.messages import (
    CLIFF,
    Ack,
    Board,
    Clear,
    ContactBit,
    Contacts,
    Drive,
    Hello,
    HelloAck,
    Power,
    Result,
    Status,
    StopReason,
    Wheels,
)

Emulated = tuple[Path, Path]
STEP_NS = 250_000


def test_fits_the_board(emulated_board: Emulated) -> None:
    size = image_size(emulated_board[1])
    with emulated_rig(emulated_board) as rig:
        rig.arm()
        for _ in range(10):  # everything at once: orders, garbage, edges, telemetry, a stop
            rig.drive(500, -500, 100)
            rig.write(random.Random(1).randbytes(300) + b"\0")
            rig.step(20, bump_left=True)
            rig.step(20, bump_left=False)
            rig.send(Clear(rig.latch[1]))
            rig.step(20)
        stack = rig.firmware.stack_bytes()  # type: ignore[attr-defined]
    print(f"flash {size.flash}, RAM {size.ram} and {stack} of stack")
    assert size.flash <= 28 * 1024
    assert stack > 30
    assert size.ram + stack <= 1536


def test_without_the_compiler_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BridgeError, match="apt-get install"):
        build_image(tmp_path)


def test_says_who_it_is(emulated: Rig) -> None:
    (ack,) = emulated.heard(HelloAck)
    assert ack.board == Board.ATMEGA328P
    assert ack.build == build_number("atmega328p")


def test_nothing_moves_without_a_session(emulated_board: Emulated) -> None:
    with emulated_rig(emulated_board) as rig:
        assert rig.ask(Drive(200, 200, 50, 40, 500)) == Result.NO_SESSION
        rig.step(100)
        assert rig.still
        assert {type(p.message) for p in rig.packets} == {Ack}


@pytest.mark.parametrize(("left", "right"), [(300, 150), (-300, 150), (100, -400), (-200, -200)])
def test_wheels_follow_their_orders(emulated: Rig, left: int, right: int) -> None:
    emulated.drive(left, right, 800)
    assert emulated.speed_mps == pytest.approx([left / 1000, right / 1000], rel=0.03)
    assert (emulated.outputs.brush_pwm, emulated.outputs.fan_pwm) == (0.5, 0.4)


def test_no_edge_is_lost_at_full_speed_both_ways(emulated: Rig) -> None:
    for _ in range(2):
        emulated.drive(500, -500, 700)
        emulated.drive(-500, 500, 700)
    emulated.drive(0, 0, 400)
    emulated.step(30)
    wheels = emulated.heard(Wheels)[-1]
    pins = emulated.inputs
    assert max(w.left_ticks for w in emulated.heard(Wheels)) > 1000
    assert (wheels.left_ticks, wheels.right_ticks) == (pins.left_ticks, pins.right_ticks)


@pytest.mark.parametrize(
    ("battery_mv", "current_ma"), [(9500, 0), (12000, 1500), (14800, 3500), (16800, 100)]
)
def test_battery_and_current_are_measured(emulated: Rig, battery_mv: int, current_ma: int) -> None:
    emulated.packets.clear()
    for _ in range(11):
        emulated.send(Hello(1))
        emulated.step(100, battery_mv=battery_mv, current_ma=current_ma)
    power = emulated.heard(Power)[-1]
    assert power.battery_mv == pytest.approx(battery_mv, abs=30)
    assert power.current_ma == pytest.approx(current_ma, abs=12)


@pytest.mark.parametrize("bit", ContactBit, ids=lambda b: b.name)
def test_each_contact_has_its_own_wire(emulated: Rig, bit: ContactBit) -> None:
    emulated.step(40, more_contacts=int(bit))
    assert emulated.heard(Contacts)[-1].bits == bit
    emulated.step(40, more_contacts=0)
    assert emulated.heard(Contacts)[-1].bits == 0


def test_a_bouncing_switch_is_one_press(emulated: Rig) -> None:
    emulated.step(40)
    emulated.packets.clear()
    chance = random.Random(1)
    for _ in range(12):
        emulated.advance(1, 300, bump_left=chance.random() < 0.5)
    emulated.step(60, bump_left=True)
    states = [bool(c.bits) for c in emulated.heard(Contacts)]
    assert sum(now != before for before, now in pairwise(states)) <= 1
    assert states[-1]


@pytest.mark.parametrize("what", trials.KINDS)
def test_brakes_within_10_ms_and_rests_within_150_ms(emulated: Rig, what: str) -> None:
    results = trials.run_trials(emulated, what, 6, seed=1)
    assert trials.good(results) == 6, results


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("what", trials.KINDS)
def test_a_thousand_trials(emulated: Rig, what: str) -> None:
    assert trials.good(trials.run_trials(emulated, what, 1000, seed=2)) == 1000


def test_a_hanging_program_is_reset_and_stays_stopped(emulated: Rig) -> None:
    emulated.drive(300, 300, 400)
    boot = emulated.heard(HelloAck)[-1].boot
    emulated.firmware.hang()  # type: ignore[attr-defined]
    hung_us = emulated.time_us
    reset_us = trials.time_until(emulated, lambda: trials.braked(emulated), 200_000)
    assert reset_us <= 80_000  # the watchdog's 60 ms, its oscillator's tolerance
    trials.time_until(emulated, lambda: trials.at_rest(emulated), 300_000)
    assert emulated.time_us - hung_us <= 80_000 + trials.REST_LIMIT_US
    emulated.decoder.reset()  # the reset has torn a frame
    assert emulated.ask(Drive(300, 300, 50, 40, 500)) == Result.NO_SESSION
    emulated.packets.clear()
    emulated.send(Hello(1))
    emulated.step(20)
    assert emulated.heard(HelloAck)[-1].boot == boot + 1
    assert emulated.latch[0] == StopReason.RESET
    assert emulated.ask(Drive(300, 300, 50, 40, 500)) == Result.LATCHED
    assert emulated.still
    emulated.clear()
    emulated.drive(300, 300, 400)
    assert not emulated.still


@pytest.mark.parametrize("speed", [200, -200])
def test_a_dead_adc_stops_the_wheels(emulated: Rig, speed: int) -> None:
    """Its last samples would say for ever that the floor goes on and the battery is full."""
    emulated.drive(speed, speed, 300)
    emulated.firmware.blind()  # type: ignore[attr-defined]
    emulated.drive(speed, speed, 20)
    assert emulated.still == (speed > 0)  # forward: it sees cliffs all around
    emulated.drive(speed, speed, 260)
    assert emulated.still
    assert emulated.latch[0] == (StopReason.CLIFF if speed > 0 else StopReason.BROWN_OUT)
    emulated.send(Clear(emulated.latch[1]))
    emulated.step(30)
    assert emulated.heard(Ack)[-1].result == Result.BLOCKED
    assert emulated.heard(Contacts)[-1].bits == CLIFF
    assert emulated.ask(Drive(-100, -100, 0, 0, 100)) == Result.LATCHED


def test_a_power_cut_counts_a_start(emulated: Rig) -> None:
    boot = emulated.heard(HelloAck)[-1].boot
    emulated.drive(200, 200, 300)
    emulated.firmware.power_cycle()  # type: ignore[attr-defined]
    emulated.step(20)
    assert emulated.still
    emulated.decoder.reset()
    emulated.send(Hello(1))
    emulated.step(20)
    assert emulated.heard(HelloAck)[-1].boot == boot + 1
    assert emulated.latch[0] == StopReason.RESET


@pytest.mark.parametrize("size", [1, 40, 1000])
def test_garbage_at_full_line_rate_does_not_disturb_the_loop(emulated: Rig, size: int) -> None:
    chance = random.Random(size)
    emulated.drive(200, 200, 200, valid_for_ms=200)
    for _ in range(40):
        emulated.write(chance.randbytes(size))
        emulated.step(10)
        emulated.write(b"\0")
        emulated.send(Drive(200, 200, 50, 40, 200))
        emulated.step(max(10, size // 11))
    assert emulated.latch[0] == StopReason.NONE
    assert emulated.heard(Status)[-1].dropped == 0
    assert emulated.speed_mps[0] == pytest.approx(0.2, rel=0.05)


def control_jitter_us(board: Emulated, folder: Path, seconds: float) -> list[float]:
    """|period - 10 ms| of the wheel loop, driving under full traffic, sorted."""
    with emulated_rig(board, function="wheel_step", trace=folder / "trace") as rig:
        rig.arm()
        rig.drive(300, 200, round(seconds * 1000))
    cycles = [int(line) for line in (folder / "trace").read_text().split()]
    left = cycles[::2]  # both wheels, one after the other
    return sorted(abs((b - a) / 16 - 10_000) for a, b in pairwise(left))


def test_the_control_loop_keeps_its_period(emulated_board: Emulated, tmp_path: Path) -> None:
    jitter_us = control_jitter_us(emulated_board, tmp_path, 2.0)
    assert len(jitter_us) > 190
    print(f"{len(jitter_us)} periods: off by at most {jitter_us[-1]:.0f} us")
    assert jitter_us[-1] <= 1000.0


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_control_jitter_p99_9(emulated_board: Emulated, tmp_path: Path) -> None:
    jitter_us = control_jitter_us(emulated_board, tmp_path, 60.0)
    p99_9 = jitter_us[int(len(jitter_us) * 0.999)]
    print(f"{len(jitter_us)} periods: p99.9 {p99_9:.0f} us")
    assert p99_9 <= 1000.0


def round_trips_ms(rig: Rig, count: int, seed: int) -> list[float]:
    """From handing a Drive to the real link to knowing its answer, on the controller's clock."""
    chance = random.Random(seed)
    waits: list[float] = []
    sent: dict[int, int] = {}

    def now_ns() -> int:
        return rig.time_us * 1000

    def tap(way: str, packet) -> None:  # type: ignore[no-untyped-def]
        if way == "out" and isinstance(packet.message, Drive):
            sent[packet.seq] = now_ns()
        elif way == "in" and isinstance(packet.message, Ack) and packet.message.order in sent:
            waits.append((now_ns() - sent.pop(packet.message.order)) / 1e6)

    link = Link(rig.transport, first_session=1, tap=tap)
    while len(waits) < count:
        # An order every 20 to 22 ms; while its answer may come, time passes in small pieces.
        for piece_us in [250] * 36 + [2200 + 250 * chance.randrange(3)] * 5:
            firmware = rig.firmware.step(piece_us, rig.inputs, rig.transport.bytes_sent)
            rig.time_us += piece_us
            rig.transport.read_until(firmware.bytes_sent_by_mcu)  # type: ignore[attr-defined]
            link.poll(now_ns())
        if link.stop_reason != StopReason.NONE:
            link.clear(now_ns())
        link.drive(now_ns(), Drive(0, 0, 0, 0, 200))
    assert sum(link.counters.latency) >= count
    return sorted(waits)


FULL = pytest.param(5000, marks=[pytest.mark.long, pytest.mark.timeout(3600)])


@pytest.mark.parametrize("count", [150, FULL])
def test_round_trip_by_the_controllers_clock(emulated_board: Emulated, count: int) -> None:
    with emulated_rig(emulated_board) as rig:
        waits = round_trips_ms(rig, count, seed=1)
    median, p99 = waits[len(waits) // 2], waits[int(len(waits) * 0.99)]
    print(f"{count} round trips: median {median:.2f} ms, p99 {p99:.2f} ms, most {waits[-1]:.2f} ms")
    assert median <= 5.0
    assert p99 <= 15.0
