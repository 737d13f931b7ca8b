"""Trials by the controller's own clock: how soon it brakes, when the wheels are at rest.

`python tests/firmware/trials.py [--trials N] [--kind K]` prints figures.
"""

from __future__ import annotations

import argparse
import random
import tempfile
from collections.abc import Callable
from pathlib import Path

from firmware_rig import Rig, emulated_rig

from firmware_bridge.board import build_emulator, build_image
from firmware_bridge.host import build_host_firmware
from firmware_bridge.messages import ContactBit, Drive, Hello, StopReason

STEP_US = 250
BRAKE_LIMIT_US, REST_LIMIT_US = 10_000, 150_000
CONTACTS = {
    "cliff": (
        StopReason.CLIFF,
        [
            ContactBit.CLIFF_LEFT,
            ContactBit.CLIFF_FRONT_LEFT,
            ContactBit.CLIFF_FRONT_RIGHT,
            ContactBit.CLIFF_RIGHT,
        ],
    ),
    "bumper": (StopReason.BUMP, [ContactBit.BUMP_LEFT, ContactBit.BUMP_RIGHT]),
    "wheel drop": (StopReason.WHEEL_DROP, [ContactBit.WHEEL_DROP]),
}


def cruise(rig: Rig, chance: random.Random, valid_for_ms: int) -> None:
    """Drive at some speed for some time, ending anywhere between two orders."""
    left, right = (chance.randrange(150, 451) for _ in range(2))
    for _ in range(chance.randrange(9, 15)):
        rig.send(Drive(left, right, 50, 40, valid_for_ms))
        rig.step(20)
    rig.send(Drive(left, right, 50, 40, valid_for_ms))
    assert min(rig.speed_mps) > 0.05


def braked(rig: Rig) -> bool:
    """Whether both wheel drivers brake."""
    return rig.outputs.left_pwm == 0.0 and rig.outputs.right_pwm == 0.0


def time_until(rig: Rig, done: Callable[[], bool], limit_us: int) -> int:
    """Microseconds until `done`, at most a bit over the limit."""
    start_us = rig.time_us
    while not done() and rig.time_us - start_us <= limit_us:
        rig.advance(1, STEP_US)
    return rig.time_us - start_us


def at_rest(rig: Rig) -> bool:
    """Whether neither wheel turns."""
    return rig.speed_mps == [0.0, 0.0]


def settle(rig: Rig, reason: StopReason) -> None:
    """Check the latch and clear it, for the next trial."""
    rig.step(5, more_contacts=0)
    rig.send(Hello(1))
    rig.step(rig.answer_ms)
    assert rig.latch[0] == reason, rig.latch
    rig.clear()
    rig.packets.clear()  # searched from the start, and there will be thousands of trials


def contact_trial(rig: Rig, chance: random.Random, what: str) -> tuple[int, int]:
    """From the contact to the brake, and from there to rest, in us."""
    reason, bits = CONTACTS[what]
    cruise(rig, chance, 400)
    rig.advance(chance.randrange(0, 80), STEP_US)
    rig.advance(1, chance.randrange(1, 1000))  # anywhere between two samples
    rig.advance(1, STEP_US, more_contacts=int(chance.choice(bits)))
    brake_us = STEP_US + time_until(rig, lambda: braked(rig), 20_000)
    rest_us = time_until(rig, lambda: at_rest(rig), 300_000)
    settle(rig, reason)
    return brake_us, rest_us


def expiry_trial(rig: Rig, chance: random.Random) -> tuple[int, int]:
    """From the end of the last order's validity to the brake, and to rest, in us.

    The validity begins when the whole order has arrived: 1.8 ms on the line after it was sent.
    """
    valid_for_ms = chance.randrange(40, 300)
    cruise(rig, chance, valid_for_ms)
    sent_us = rig.time_us
    time_until(rig, lambda: braked(rig), 400_000)
    brake_us = rig.time_us - sent_us - valid_for_ms * 1000
    rest_us = brake_us + time_until(rig, lambda: at_rest(rig), 300_000)
    settle(rig, StopReason.EXPIRED)
    return brake_us, rest_us


KINDS = (*CONTACTS, "expiry")


def run_trials(rig: Rig, what: str, trials: int, seed: int) -> list[tuple[int, int]]:
    """So many trials of one kind: (brake_us, rest_us) of each."""
    chance = random.Random(f"{seed} {what}")
    if what == "expiry":
        return [expiry_trial(rig, chance) for _ in range(trials)]
    return [contact_trial(rig, chance, what) for _ in range(trials)]


def good(results: list[tuple[int, int]]) -> int:
    """How many trials were within both limits."""
    return sum(b <= BRAKE_LIMIT_US and r <= REST_LIMIT_US for b, r in results)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--board", choices=("emulated", "host"), default="emulated")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--kind", choices=KINDS, help="default: all of them")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.board == "emulated":
            rig = emulated_rig((build_emulator(folder), build_image(folder)))
        else:
            rig = Rig(build_host_firmware(folder))
            rig.friction_mps2 = 1.2
        with rig:
            rig.arm()
            for what in [options.kind] if options.kind else KINDS:
                results = run_trials(rig, what, options.trials, options.seed)
                brake_ms = max(b for b, _ in results) / 1e3
                rest_ms = max(r for _, r in results) / 1e3
                print(
                    f"{what:10s}: {good(results)} of {len(results)}; "
                    f"brake at most {brake_ms:.2f} ms, rest at most {rest_ms:.2f} ms",
                    flush=True,
                )


if __name__ == "__main__":
    main()
