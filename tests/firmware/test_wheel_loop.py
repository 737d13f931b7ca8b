"""The wheel speed loop against first-order motors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from firmware_rig import Rig

from firmware_bridge.messages import Drive, Result, Stop, Tune


def speeds(rig: Rig, target_mm_s: int, ms: int) -> list[float]:
    """Left wheel speed in m/s every 5 ms while the order is kept up."""
    course = []
    for at_ms in range(0, ms, 5):
        if at_ms % 20 == 0:
            rig.send(Drive(target_mm_s, target_mm_s, 0, 0, 100))
        rig.step(5)
        course.append(rig.speed_mps[0])
    return course


def settled_ms(course: list[float], target: float) -> int:
    """When the speed comes within 3 % of the target for good."""
    outside = [k for k, v in enumerate(course) if abs(v - target) > 0.03 * abs(target)]
    return 5 * (outside[-1] + 1)


@pytest.mark.parametrize("target", [0.2, -0.2])
@pytest.mark.parametrize("lag_s", [0.05, 0.08])
def test_settles_in_0_4_s_within_3_percent(armed: Rig, target: float, lag_s: float) -> None:
    armed.lag_s = lag_s
    at_ms = settled_ms(speeds(armed, round(target * 1000), 1500), target)
    print(f"lag {lag_s} s: settled after {at_ms} ms")
    assert at_ms <= 400


@pytest.mark.parametrize("full_speed_mps", [0.3, 0.6, 1.2, 2.0])
@pytest.mark.parametrize("lag_s", [0.05, 0.08])
def test_settles_as_well_with_other_motors(armed: Rig, full_speed_mps: float, lag_s: float) -> None:
    """Told how fast they are, the loop's gains are the same seen from the floor."""
    armed.lag_s = lag_s
    armed.gains = [full_speed_mps / 0.6] * 2
    assert armed.ask(Tune(round(full_speed_mps * 1000))) == Result.OK
    assert settled_ms(speeds(armed, 200, 1500), 0.2) <= 400


def test_speed_never_runs_ahead_of_the_slew_limit(armed: Rig) -> None:
    course = speeds(armed, 500, 400)
    assert all(v <= 1.5 * 0.005 * (k + 1) + 0.03 for k, v in enumerate(course))
    assert course[-1] > 0.45


def test_mismatched_motors_drive_straight(armed: Rig) -> None:
    armed.gains = [0.8, 1.2]
    armed.drive(200, 200, 500)
    start = list(armed.travel_m)
    armed.drive(200, 200, 5000)
    left, right = (end - begin for begin, end in zip(start, armed.travel_m, strict=True))
    whole = abs(armed.travel_m[0] - armed.travel_m[1]) / armed.travel_m[0]
    print(f"drift {100 * abs(left - right) / left:.2f} %, with the start {100 * whole:.2f} %")
    assert abs(left - right) <= 0.002 * left
    assert whole <= 0.01  # what the start costs, over a metre
    assert left == pytest.approx(1.0, rel=0.01)


def test_does_not_wind_up_beyond_full_power(armed: Rig) -> None:
    armed.gains = [0.5, 0.5]  # at full PWM 0.3 m/s: 0.45 cannot be reached
    course = speeds(armed, 450, 2000)
    assert armed.outputs.left_pwm == 1.0
    assert course[-1] == pytest.approx(0.3, rel=0.02)
    course = speeds(armed, 150, 600)
    assert course[60] < 0.2  # 0.3 s after the order it has come down: nothing was wound up


def test_zero_brakes_and_stays_at_zero(armed: Rig) -> None:
    armed.drive(200, 200, 500)
    armed.drive(0, 0, 400)
    assert armed.outputs.left_pwm == 0.0
    armed.drive(0, 0, 200)
    assert armed.outputs.left_pwm == 0.0
    assert abs(armed.speed_mps[0]) < 0.002


def test_long_steps_are_divided_for_the_loop(firmware_binary: Path) -> None:
    """One call of 200 ms acts as forty of 5 ms do."""
    ends = []
    for pieces in (1, 40):
        with Rig(firmware_binary) as rig:
            rig.arm()
            rig.send(Drive(200, 200, 0, 0, 1000))
            for k in range(pieces):
                inputs = replace(rig.inputs, left_ticks=160 * (k + 1) // pieces)
                sent = rig.transport.bytes_sent
                out = rig.firmware.step(200_000 // pieces, inputs, sent)
            ends.append(out)
    assert ends[0] == ends[1]
    assert ends[0].left_pwm > 0.1


def test_encoder_wrap_is_no_jump(armed: Rig) -> None:
    offset_m = (2**31 - 300) / 5000
    armed.travel_m = [offset_m, offset_m]
    armed.step(200)  # the jump of the bench itself settles while standing
    pwm = []
    for _ in range(60):
        armed.drive(200, 200, 20)
        pwm.append(armed.outputs.left_pwm)
    assert armed.inputs.left_ticks < 0  # it did wrap
    assert max(pwm) < 0.65
    assert pwm[-1] == pytest.approx(0.2 / 0.6, abs=0.05)


def test_a_stop_leaves_nothing_in_the_integral(armed: Rig) -> None:
    armed.gains = [0.5, 0.5]
    armed.drive(250, 250, 1500)  # twice the feed-forward: the other half is the integral's
    armed.ask(Stop())
    armed.step(300)
    armed.clear()
    armed.send(Drive(20, 20, 0, 0, 100))
    assert armed.step(15).left_pwm < 0.25


@pytest.mark.parametrize("ticks", [3_000, 500_000, 429_497, 2**31 - 2_000])
def test_a_jumping_counter_does_not_overflow(armed: Rig, ticks: int) -> None:
    """After a fault of the counter, any jump ahead is a high speed ahead: the loop pushes back."""
    armed.drive(100, 100, 300)
    armed.travel_m = [ticks / 5000] * 2
    pwm = [armed.step().left_pwm for _ in range(50)]
    assert pwm.count(-1.0) >= 38  # as long as the jump is in the window of 40 ms
