"""The start button, pressed through a pipe that stands for the kernel's input device."""

import os
import struct

import pytest

from robot.hardware.button import LONG_NS, Button, verb_of

KEY, SYNC = 1, 0


def event(value, kind=KEY):
    return struct.pack("llHHi", 0, 0, kind, 148, value)


@pytest.fixture
def device(tmp_path):
    path = str(tmp_path / "event0")
    os.mkfifo(path)
    reader_first = os.open(path, os.O_RDWR)  # so that nobody waits for the other
    yield path, reader_first
    os.close(reader_first)


def test_a_short_and_a_long_press(device):
    path, write = device
    button = Button(path)
    assert button.poll(0) is None
    os.write(write, event(1) + event(0, SYNC))
    assert button.poll(10) is None
    os.write(write, event(0))
    assert button.poll(20) == "short"
    os.write(write, event(1))
    assert button.poll(30) is None
    os.write(write, event(2) + event(0))  # autorepeat says nothing new
    assert button.poll(30 + LONG_NS) == "long"
    assert button.poll(31 + LONG_NS) is None
    button.close()


def test_half_an_event_waits_for_its_other_half(device):
    path, write = device
    button = Button(path)
    whole = event(1) + event(0)
    os.write(write, whole[:30])
    assert button.poll(0) is None
    os.write(write, whole[30:])
    assert button.poll(1) == "short"


def test_a_missing_device_is_looked_for_now_and_then(tmp_path):
    path = tmp_path / "later"
    button = Button(str(path))
    assert button.poll(0) is None
    os.mkfifo(path)
    write = os.open(path, os.O_RDWR)
    os.write(write, event(1) + event(0))
    assert button.poll(1) is None  # not at every tick
    assert button.poll(3_000_000_000) == "short"
    os.close(write)
    assert Button("").poll(0) is None


@pytest.mark.parametrize(
    ("press", "state", "verb"),
    [
        ("short", "docked", "start"), ("short", "", "start"), ("short", "cleaning", "pause"),
        ("short", "paused", "resume"), ("long", "cleaning", "dock"), ("long", "docked", "dock"),
    ],
)  # fmt: skip
def test_what_a_press_asks_for(press, state, verb):
    assert verb_of(press, state) == verb
