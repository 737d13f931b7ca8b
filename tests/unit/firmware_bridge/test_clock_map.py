"""The controller's clock on the host's axis: waiting, drift, wrap."""

from __future__ import annotations

import random

import pytest

from firmware_bridge.clock import ClockMap
from firmware_bridge.counting import EndlessCounter, signed_difference

US, MS = 1_000, 1_000_000
WRAP = 2**32


def course(
    clock: ClockMap, *, drift: float, start_us: int, seconds: int, seed: int = 0
) -> list[int]:
    """Errors in ns at 50 Hz; orders wait 2 ms plus at times much more before they are taken."""
    noise = random.Random(seed)
    errors = []
    for k in range(seconds * 50):
        sent_ns = 10**12 + k * 20 * MS
        waited_ns = 2 * MS + int(noise.expovariate(1.0) * 3 * MS)
        taken_ns = sent_ns + waited_ns
        taken_us = start_us + int((taken_ns - 10**12) * (1.0 + drift)) // US
        clock.observe(taken_us % WRAP, sent_ns)
        errors.append(clock.to_host_ns(taken_us % WRAP) - taken_ns)
    return errors


@pytest.mark.parametrize("drift", [0.0, 0.005, -0.005])
@pytest.mark.parametrize("start_us", [0, WRAP - 3_000_000])
def test_follows_drift_and_wrap(drift: float, start_us: int) -> None:
    errors = course(ClockMap(), drift=drift, start_us=start_us, seconds=60)
    late = errors[10 * 50 :]
    assert max(map(abs, late)) < 5 * MS
    assert max(late) < 1 * MS  # an order is never taken before it was sent
    assert sum(late) / len(late) == pytest.approx(-2 * MS, abs=1.5 * MS)  # the least wait


def test_exact_without_waiting() -> None:
    clock = ClockMap()
    for k in range(1000):
        clock.observe(k * 20_000, 5 * MS + k * 20 * MS)
        assert clock.to_host_ns(k * 20_000 + 7000) == 5 * MS + k * 20 * MS + 7 * MS


def test_a_stall_of_the_host_does_not_bend_it() -> None:
    clock = ClockMap()
    for k in range(1000):
        wait_ns = 900 * MS if 600 <= k < 640 else 0
        clock.observe(k * 20_000 + wait_ns // US, k * 20 * MS)
    assert clock.to_host_ns(1000 * 20_000) == pytest.approx(1000 * 20 * MS, abs=2 * MS)


def test_reset_forgets() -> None:
    clock = ClockMap()
    clock.observe(0, 10**12)
    assert clock.ready
    clock.reset()
    assert not clock.ready
    clock.observe(77, 5 * 10**12)
    assert clock.to_host_ns(77) == 5 * 10**12


@pytest.mark.parametrize(
    ("now", "before", "difference"),
    [(5, 3, 2), (3, 5, -2), (0, WRAP - 1, 1), (-(2**31), 2**31 - 1, 1), (2**31 - 1, -(2**31), -1)],
)
def test_signed_difference(now: int, before: int, difference: int) -> None:
    assert signed_difference(now, before) == difference


def test_endless_counter_starts_at_zero_wraps_and_restarts() -> None:
    counter = EndlessCounter()
    assert counter.follow(2**31 - 5) == 0
    assert counter.follow(-(2**31) + 5) == 10
    assert counter.follow(-(2**31)) == 5
    counter.restarted()
    assert counter.follow(7) == 12
