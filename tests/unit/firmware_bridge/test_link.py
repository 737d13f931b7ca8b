"""The link against a scripted controller, on a line in memory."""

from __future__ import annotations

import random

import pytest
from scripted_controller import MS, ScriptedController

from firmware_bridge.link import Link, Received
from firmware_bridge.messages import (
    Ack,
    Clear,
    Contacts,
    Drive,
    Hello,
    HelloAck,
    Keep,
    Result,
    Status,
    Stop,
    StopReason,
    Tune,
    Wheels,
)
from firmware_bridge.transport import MemoryTransport, memory_pair

GO = Drive(200, 200, 0, 0, 100)


class Bench:
    """Link and controller, 20 ms at a time."""

    def __init__(self) -> None:
        self.near, far = memory_pair()
        self.controller = ScriptedController(far)
        self.link = Link(self.near, first_session=9)
        self.now_ns = 0

    def run(self, ms: int = 20, *, mcu: bool = True) -> list[Received]:
        """Poll every 20 ms; what was received."""
        received = []
        for _ in range(0, ms, 20):
            self.now_ns += 20 * MS
            if mcu:
                self.controller.run(self.now_ns)
            received += self.link.poll(self.now_ns)
        return received

    def travel(self, left: int, right: int) -> tuple[int, int]:
        """Let the controller tell these counts; the link's endless ones."""
        self.controller.wheels(self.now_ns, left, right)
        messages = [r.message for r in self.run()]
        (wheels,) = [m for m in messages if isinstance(m, Wheels)]
        return wheels.left_ticks, wheels.right_ticks


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.run(60)
    return made


def test_handshake_then_keep_alive(bench: Bench) -> None:
    assert bench.link.connected
    assert bench.link.stop_reason == StopReason.RESET
    assert bench.link.controller is not None
    assert bench.link.controller.build == 0xABCD
    assert bench.link.problem == ""
    before = [bench.controller.count(kind) for kind in (Hello, Keep)]
    bench.run(1000)
    assert bench.controller.count(Hello) == before[0]
    assert 8 <= bench.controller.count(Keep) - before[1] <= 11
    assert bench.link.counters.sessions == 1


def test_the_motors_are_told_before_anything_moves(bench: Bench) -> None:
    assert [p.message for p in bench.controller.heard if isinstance(p.message, Tune)] == [Tune(600)]
    bench.controller.mute = {Tune}
    bench.link = Link(bench.near, first_session=20, full_speed_mm_s=900)
    bench.run(300)
    assert bench.link.connected
    assert not bench.link.drive(bench.now_ns, GO)
    assert bench.controller.count(Tune) >= 4
    bench.controller.mute = set()
    bench.run(100)
    assert bench.controller.heard[-1].message != Tune(600)
    assert bench.link.drive(bench.now_ns, GO)
    said = bench.controller.count(Tune)
    bench.run(400)
    assert bench.controller.count(Tune) == said
    bench.controller.reset(bench.now_ns)
    bench.run(400)
    assert bench.link.connected
    assert bench.controller.count(Tune) == said + 1  # a new session: told again


@pytest.mark.parametrize("waited_ms", [0, 60, 140])
def test_a_reset_that_nobody_drives_through_is_noticed(bench: Bench, waited_ms: int) -> None:
    """The controller is back before it was missed: no travel, no clear may leak through."""
    assert bench.travel(500, 500) == (0, 0)
    bench.controller.mute = {Clear}
    bench.link.clear(bench.now_ns)
    bench.run(waited_ms)
    bench.controller.mute = set()
    bench.controller.reset(bench.now_ns)
    bench.run(700)
    assert bench.link.connected
    assert bench.link.counters.sessions == 2
    assert bench.link.stop_reason == StopReason.RESET  # the clear was for the start before
    assert bench.travel(7, -7) == (7, -7)


def test_a_boot_that_changes_within_a_session_ends_it(bench: Bench) -> None:
    bench.controller.say(HelloAck(0, 1, 1, 2, 0xABCD, StopReason.RESET, 1))
    bench.run(20, mcu=False)
    assert not bench.link.connected
    assert "anew" in bench.link.problem


def test_no_order_goes_out_without_a_session() -> None:
    made = Bench()
    made.controller.mute = {Hello}
    made.run(200)
    assert not made.link.drive(made.now_ns, GO)
    made.link.clear(made.now_ns)
    made.run(200)
    assert made.controller.count(Drive) == made.controller.count(Clear) == 0
    assert made.link.counters.unsent == 2
    assert "not answered" in made.link.problem


def test_another_protocol_is_explained() -> None:
    made = Bench()
    made.controller.protocol = 99
    made.run(10_000)
    assert not made.link.connected
    assert "protocol 99" in made.link.problem
    assert "flash" in made.link.problem


def test_stop_is_said_until_answered_and_holds_drives_back(bench: Bench) -> None:
    bench.controller.mute = {Stop}
    bench.link.stop(bench.now_ns)
    bench.run(400)
    assert bench.controller.count(Stop) >= 6
    assert not bench.link.drive(bench.now_ns, GO)
    bench.controller.mute = set()
    bench.run(100)
    assert bench.link.stop_reason == StopReason.HOST
    said = bench.controller.count(Stop)
    bench.run(400)
    assert bench.controller.count(Stop) == said
    assert bench.link.drive(bench.now_ns, GO)
    assert bench.link.counters.retries == said - 1


def test_stop_survives_a_torn_cable(bench: Bench) -> None:
    bench.near.unplug()
    bench.run(100)
    bench.link.stop(bench.now_ns)
    bench.run(300)
    assert bench.controller.count(Stop) == 0
    bench.near.plug()
    bench.run(600)
    assert bench.controller.count(Stop) == 1


def test_clear_names_the_latch_and_gives_up(bench: Bench) -> None:
    bench.controller.mute = {Clear}
    bench.link.clear(bench.now_ns)
    bench.run(1000)
    orders = [p.message for p in bench.controller.heard if isinstance(p.message, Clear)]
    assert orders == [Clear(1)] * 5
    bench.controller.mute = set()
    bench.link.clear(bench.now_ns)
    bench.run(60)
    assert bench.link.stop_reason == StopReason.NONE


def test_stop_replaces_a_waiting_clear(bench: Bench) -> None:
    bench.controller.mute = {Clear}
    bench.link.clear(bench.now_ns)
    bench.link.stop(bench.now_ns)
    bench.run(400)
    assert bench.controller.count(Clear) == 1
    assert bench.link.stop_reason == StopReason.HOST


def test_refusals_and_the_latch_are_known_from_the_answer(bench: Bench) -> None:
    bench.link.drive(bench.now_ns, GO)
    bench.run(40)
    assert bench.link.counters.refused == 1
    bench.controller.say(Ack(0, 0, Result.OK, StopReason.CLIFF, 5))
    bench.run()
    assert (bench.link.stop_reason, bench.link.latch) == (StopReason.CLIFF, 5)


def test_an_unknown_reason_is_still_a_stop(bench: Bench) -> None:
    bench.controller.say(Ack(0, 0, Result.OK, 200, 5))
    bench.run()
    assert bench.link.stop_reason != StopReason.NONE


def test_silence_ends_the_session_and_closes_the_port(bench: Bench) -> None:
    bench.run(400, mcu=False)  # the last keep-alive was answered at most 100 ms ago
    assert bench.link.connected
    bench.run(120, mcu=False)
    assert not bench.link.connected
    assert "silent" in bench.link.problem
    bench.run(2600, mcu=False)
    assert bench.link.counters.opened == 2  # looked for again
    bench.run(400)
    assert bench.link.connected
    assert bench.link.counters.sessions == 2


def test_a_forgotten_session_is_opened_again_at_once(bench: Bench) -> None:
    session = bench.controller.session
    bench.controller.reset(bench.now_ns)
    bench.link.drive(bench.now_ns, GO)
    bench.run(80)
    assert bench.link.connected
    assert bench.controller.session != session


def test_frames_of_another_session_are_not_believed(bench: Bench) -> None:
    status = Status(0, 2, StopReason.BUMP, 7, 0, 0, 0, 0, 0, 0)
    bench.controller.say(status, session=bench.controller.session + 1)
    assert bench.run() == []
    assert bench.link.stop_reason == StopReason.RESET
    assert bench.link.counters.foreign == 1


def test_travel_is_endless_across_wrap_reconnect_and_reset(bench: Bench) -> None:
    top = 2**31
    assert bench.travel(top - 100, -50) == (0, 0)
    assert bench.travel(-top + 100, -80) == (200, -30)
    bench.near.unplug()
    bench.run(700)
    bench.near.plug()
    bench.run(400)
    assert bench.travel(-top + 150, -80) == (250, -30)  # it rolled on meanwhile: counted once
    bench.near.unplug()
    bench.run(700)
    bench.controller.reset(bench.now_ns)
    bench.near.plug()
    bench.run(400)
    assert bench.travel(10, 0) == (260, -30)  # counts began again at zero
    assert bench.link.counters.sessions == 3


def test_times_are_the_controllers_on_the_hosts_axis(bench: Bench) -> None:
    bench.run(200)
    bench.controller.say(Contacts((bench.now_ns - 13 * MS) // 1000, 1))
    (received,) = bench.run()
    assert received.arrived_ns == bench.now_ns
    # Answers wait 20 ms for the controller's turn here, so the map is late by that at most.
    assert -20 * MS <= received.t_ns - (bench.now_ns - 33 * MS) <= 0


def test_times_never_run_backwards_or_ahead(bench: Bench) -> None:
    last_ns = 0
    for time_us in (100_000, 50_000, 10_000_000):
        bench.controller.say(Contacts(time_us, 0))
        (received,) = bench.run()
        assert last_ns <= received.t_ns <= received.arrived_ns
        last_ns = received.t_ns


def garble(end: MemoryTransport, noise: random.Random) -> None:
    """Replace half a percent of the bytes that wait at this end."""
    for at in range(len(end._inbox)):
        if noise.random() < 0.005:
            end._inbox[at] = noise.randrange(256)


def test_noise_both_ways_never_raises_and_never_disconnects() -> None:
    bench = Bench()
    noise = random.Random(3)
    bench.run(100)
    bench.link.clear(bench.now_ns)
    connected = 0
    for _ in range(2000):
        bench.now_ns += 20 * MS
        garble(bench.controller.line, noise)
        bench.controller.run(bench.now_ns)
        garble(bench.near, noise)
        bench.link.poll(bench.now_ns)
        bench.link.drive(bench.now_ns, GO)
        connected += bench.link.connected
    assert connected == 2000
    counters = bench.link.counters
    assert counters.crc_errors + counters.framing_errors > 100


def test_latency_is_counted(bench: Bench) -> None:
    bench.run(1000)
    assert sum(bench.link.counters.latency) >= 8
    assert bench.link.counters.latency[5] > 0  # 15 to 20 ms: one turn of this bench


def test_sequence_and_session_numbers_wrap() -> None:
    bench = Bench()
    bench.link = Link(bench.near, first_session=65534)
    bench.run(60)
    sessions = []
    for _ in range(3):
        sessions.append(bench.controller.session)
        for _ in range(300):
            assert bench.link.drive(bench.now_ns, GO)
            bench.run()
        bench.controller.reset(bench.now_ns)
        bench.link.drive(bench.now_ns, GO)
        bench.run(100)
        assert bench.link.connected
    assert sessions == [65534, 65535, 1]
