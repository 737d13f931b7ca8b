"""The live body's threads and beat, with fakes for every device."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from robot.body.live import PATIENCE_NS, LiveBody, YawTrack
from robot.config import Config
from robot.geometry.se2 import SE2
from robot.hardware.fakes import FakeStereo
from robot.messages import (
    Battery,
    DriveCommand,
    Grid,
    ImuSample,
    Planned,
    PlanOrder,
    Request,
    Scan,
    Seen,
    StereoFrame,
    Tick,
    WheelTravel,
)

SCAN = Scan(np.zeros(1), np.full(1, np.nan), np.zeros(1))
EYE = np.zeros((4, 6), np.uint8)


class Eyes:
    """A perception chain that only reports the frame."""

    def __init__(self, fail_at=None):
        self.hints, self.fail_at = [], fail_at

    def see(self, frame, arrived_ns):
        if frame.seq == self.fail_at:
            raise RuntimeError("blind")
        self.hints.append(frame.yaw_change_rad)
        return Seen(frame.t_ns, arrived_ns, frame.seq, (), SCAN, 1.0)


class Wheels:
    """A bridge that rolls 1 mm a poll and remembers its orders."""

    def __init__(self):
        self.polls, self.sent = 0, []

    def poll(self, now_ns):
        self.polls += 1
        return [WheelTravel(now_ns, now_ns, self.polls * 1e-3, self.polls * 1e-3)]

    def send(self, command):
        self.sent.append(command)


class Gyro:
    """A steady turn of 1 rad/s."""

    def read(self):
        return ImuSample(time.monotonic_ns(), 1.0)


class Camera(FakeStereo):
    """Delivers a frame every 30 ms with the present time."""

    def read(self):
        frame = super().read()
        time.sleep(0.03)
        return frame and replace(frame, t_ns=time.monotonic_ns())


def frames(*seqs):
    return [StereoFrame(0, seq, EYE, EYE) for seq in seqs]


def live(body_frames, eyes=None, duration_s=0.5, **options):
    wheels = Wheels()
    body = LiveBody(
        Config(), Camera(body_frames), eyes or Eyes(), wheels,
        gyro=Gyro(), duration_s=duration_s, **options,
    )  # fmt: skip
    return body, wheels


def test_ticks_beat_at_50_hz_and_every_sensor_is_heard():
    body, _ = live(frames(0, 1, 2, 3))
    events = list(body.events())
    body.close()
    ticks = [e.t_ns for e in events if isinstance(e, Tick)]
    assert len(ticks) == 25
    assert all(np.diff(ticks) > 0)
    assert {type(e) for e in events} >= {WheelTravel, ImuSample, Seen, Tick}
    assert [e.seq for e in events if isinstance(e, Seen)] == [0, 1, 2, 3]
    assert all(e.arrived_ns >= e.t_ns for e in events if isinstance(e, Seen))


def test_lost_frames_are_counted():
    body, _ = live(frames(0, 1, 4))
    list(body.events())
    body.close()
    assert (body.frames, body.frames_dropped) == (3, 2)


def test_the_gyro_hints_how_far_the_view_turned():
    eyes = Eyes()
    body, _ = live(frames(*range(8)), eyes)
    list(body.events())
    body.close()
    later = [hint for hint in eyes.hints[4:] if not math.isnan(hint)]
    assert later and np.median(later) == pytest.approx(0.03, abs=0.03)


def test_eyes_that_fail_blind_the_robot_and_are_named():
    body, _ = live(frames(0, 1), Eyes(fail_at=1), duration_s=1.0)
    seen = [event for event in body.events() if isinstance(event, Seen)]
    assert [event.seq for event in seen] == [0]
    assert any("perception" in told and "blind" in told for told in body.problems())
    body.close()


def test_a_worker_that_fails_ends_the_life_with_its_error():
    body, _ = live(frames(0), duration_s=5.0)
    body._orders.put("no order at all")  # stands for a mistake of ours
    with pytest.raises(AttributeError):
        list(body.events())
    body.close()


def test_orders_reach_the_wheels_and_plans_come_back_as_events():
    body, wheels = live(frames(0), duration_s=1.5)
    cells = np.zeros((20, 20), np.int8)
    order = PlanOrder(
        5, 3, "route", Grid(0.05, 0, 0, cells), cells > 0, SE2(0.5, 0.5), SE2(0.6, 0.6)
    )
    drive = DriveCommand(0, 0.1, 0.0, 0.0, 0.0, 200, "test")
    planned = []
    for n, event in enumerate(body.events()):
        if n == 0:
            body.send(drive)
            body.send(order)
        if isinstance(event, Planned):
            planned.append(event)
    body.close()
    assert wheels.sent == [drive]
    assert [p.order_id for p in planned] == [3] and planned[0].t_ns > 5


def test_it_starts_only_after_a_rest_and_only_if_asked():
    body, _ = live([], duration_s=2.2)
    starts = [e for e in body.events() if isinstance(e, Request)]
    body.close()
    assert [s.verb for s in starts] == ["start"]
    body, _ = live([], duration_s=2.2, start=False)
    assert not [e for e in body.events() if isinstance(e, Request)]
    body.close()


def test_yaw_is_unknown_before_the_first_sample():
    yaw = YawTrack()
    assert math.isnan(yaw.change_rad(0, 10))
    for k in range(11):
        yaw.add(ImuSample(k * 20_000_000, 2.0))
    assert yaw.change_rad(40_000_000, 140_000_000) == pytest.approx(0.2)
    assert math.isnan(yaw.change_rad(-1, 140_000_000))


class Listener:
    """A notifier that remembers."""

    def __init__(self):
        self.said = []

    def send(self, state):
        self.said.append(state)


class BatteryGauge:
    """A gauge that answers until it is told to fall silent."""

    problem = ""

    def __init__(self):
        self.silent = False

    def read(self):
        return None if self.silent else Battery(time.monotonic_ns(), 15.0, 60.0)


class PoweredWheels(Wheels):
    """A bridge that also tells the motor controller's voltage."""

    def poll(self, now_ns):
        return [*super().poll(now_ns), Battery(now_ns, 14.0, 50.0)]


def test_the_gauge_is_believed_before_the_motor_controller_while_it_answers():
    wheels, gauge = PoweredWheels(), BatteryGauge()
    body = LiveBody(Config(), Camera([]), Eyes(), wheels, gauge=gauge, duration_s=0.3)
    heard = {e.voltage_v for e in list(body.events())[3:] if isinstance(e, Battery)}
    body.close()
    assert 15.0 in heard or not heard
    assert 14.0 not in heard
    gauge.silent = True
    body = LiveBody(Config(), Camera([]), Eyes(), wheels, gauge=gauge, duration_s=0.3)
    assert {e.voltage_v for e in body.events() if isinstance(e, Battery)} == {14.0}
    body.close()


def test_systemd_is_told_that_it_lives_and_what_is_wrong():
    listener = Listener()
    camera = Camera([])
    camera.problem = "unplugged"
    body = LiveBody(Config(), camera, Eyes(), Wheels(), notifier=listener, duration_s=1.3)
    list(body.events())
    body.close()
    assert listener.said[0] == "READY=1" and listener.said[-1] == "STOPPING=1"
    assert 2 <= listener.said.count("WATCHDOG=1") <= 4  # not at every beat
    assert "STATUS=camera: unplugged" in listener.said


def test_the_watchdog_starves_when_a_worker_hangs(monkeypatch):
    monkeypatch.setitem(PATIENCE_NS, "see", 200_000_000)
    listener = Listener()

    class Stuck(Eyes):
        def see(self, frame, arrived_ns):
            time.sleep(1.6)
            return super().see(frame, arrived_ns)

    body = LiveBody(
        Config(), Camera(frames(0)), Stuck(), Wheels(), notifier=listener, duration_s=1.4
    )
    list(body.events())
    assert listener.said.count("WATCHDOG=1") == 1
    body.close()
