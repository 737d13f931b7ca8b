"""The motor controller's self-test: who it is, what it measures, and that it stops when it must.

The wheels turn by a few centimetres; the robot stands on the floor with free space around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from firmware_bridge.host import build_number
from firmware_bridge.live import Live
from firmware_bridge.messages import (
    PROTOCOL_VERSION,
    TICKS_PER_METRE,
    Board,
    ContactBit,
    Contacts,
    Drive,
    StopReason,
)

SPEED_MM_S = 100
TURN_S = 0.6
VALID_FOR_MS = 200
LOWEST_MV, HIGHEST_MV = 9_000, 30_000


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one test; a failed one has a remedy."""

    name: str
    passed: bool
    what: str
    remedy: str = ""


def selftest(live: Live) -> Iterator[Finding]:
    """Run the tests one after the other; those that move come only after the others have passed.

    The controller is left stopped. Raises BridgeError when nobody answers.
    """
    passed = True
    try:
        for test in (_identity, _power, _contacts):
            finding = test(live)
            passed = passed and finding.passed
            yield finding
        if not passed:
            return
        for test in (_clear, _left, _right, _expiry, _host_stop):
            finding = test(live)
            yield finding
            if not finding.passed:
                return
    finally:
        live.stop()


def _identity(live: Live) -> Finding:
    who = live.connect()
    board = Board(who.board).name if who.board in Board._value2member_map_ else str(who.board)
    expected = build_number(board.lower()) if who.board in Board._value2member_map_ else None
    what = f"{board}, protocol {who.protocol}, build {who.build:08x}, start {who.boot}"
    same = who.protocol == PROTOCOL_VERSION and who.build == expected
    return Finding("identity", same, what, "flash the firmware that belongs to this program")


def _power(live: Live) -> Finding:
    live.wait(2.0, until=lambda: live.power() is not None)
    power = live.power()
    if power is None:
        return Finding("power", False, "no measurement came", "flash the firmware again")
    good = LOWEST_MV <= power.battery_mv <= HIGHEST_MV
    what = f"{power.battery_mv / 1000:.1f} V, {power.current_ma} mA"
    return Finding("power", good, what, "charge the battery, or check the divider at A6")


def _contacts(live: Live) -> Finding:
    live.wait(0.2)
    told = [r.message.bits for r in live.received if isinstance(r.message, Contacts)]
    bits = ContactBit(told[-1] if told else 0) & ~ContactBit.CHARGING
    names = ", ".join(bit.name or "" for bit in ContactBit if bit & bits) or "none is on"
    remedy = "free the switches; a broken wire reads as touched, hanging or cliff"
    return Finding("contacts", bool(told) and not bits, names, remedy)


def _clear(live: Live) -> Finding:
    reason = live.link.stop_reason.name.lower()
    done = live.clear()
    return Finding("clear", done, f"stop '{reason}'", "remove its cause")


def _turn(live: Live, name: str, side: int) -> Finding:
    """One wheel forwards and back; the other must stand still."""
    moved = []
    for speed in (SPEED_MM_S, -SPEED_MM_S):
        start = live.ticks()
        order = Drive(speed * (side == 0), speed * (side == 1), 0, 0, VALID_FOR_MS)
        live.wait(TURN_S, order)
        live.wait(0.4, Drive(0, 0, 0, 0, VALID_FOR_MS))
        end = live.ticks()
        moved.append([(e - s) / TICKS_PER_METRE for e, s in zip(end, start, strict=True)])
        if live.latched():
            break
    what = ", ".join(f"{travel[side] * 1000:+.0f} mm" for travel in moved)
    if live.latched():
        what += f"; stopped by '{live.link.stop_reason.name.lower()}'"
    wanted_m = SPEED_MM_S / 1000 * TURN_S
    good = len(moved) == 2 and all(
        0.5 * wanted_m < sign * travel[side] < 1.5 * wanted_m and abs(travel[1 - side]) < 0.01
        for sign, travel in zip((1, -1), moved, strict=True)
    )
    remedy = f"swap the {name} motor's or encoder's wires, or check them (WIRING.md)"
    return Finding(f"{name} wheel", good, what, remedy)


def _left(live: Live) -> Finding:
    return _turn(live, "left", 0)


def _right(live: Live) -> Finding:
    return _turn(live, "right", 1)


def _latches(live: Live, name: str, act: Callable[[], object], reason: StopReason) -> Finding:
    act()
    stopped = live.wait(1.0, until=lambda: live.link.stop_reason == reason)
    refused = live.link.counters.refused
    start = live.ticks()
    live.wait(0.3, Drive(SPEED_MM_S, SPEED_MM_S, 0, 0, VALID_FOR_MS))
    stands = all(abs(e - s) < 50 for e, s in zip(live.ticks(), start, strict=True))
    good = stopped and stands and live.link.counters.refused > refused
    cleared = live.clear()
    what = f"latches '{reason.name.lower()}', refuses to drive, is cleared"
    return Finding(name, good and cleared, what, "do not let it drive: flash the firmware again")


def _expiry(live: Live) -> Finding:
    def act() -> None:
        live.link.drive(live.now_ns(), Drive(1, 1, 0, 0, 60))

    return _latches(live, "expiry", act, StopReason.EXPIRED)


def _host_stop(live: Live) -> Finding:
    return _latches(live, "stop", live.stop, StopReason.HOST)
