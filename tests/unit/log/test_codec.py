"""Every message survives the log, bit for bit."""

from __future__ import annotations

import dataclasses
import struct
import types
import typing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robot.geometry.se2 import SE2
from robot.log.codec import COMMANDS, EVENTS, decode, encode
from robot.messages import DriveCommand, Grid, Scan, Seen, Tick, WheelTravel

KINDS = {**EVENTS, **COMMANDS}

arrays = hnp.arrays(
    dtype=st.sampled_from([np.int8, np.bool_, np.uint8, np.float32, np.float64, ">f4", np.int64]),
    shape=hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)
floats = st.floats(width=64) | st.floats(width=32).map(np.float32) | st.floats().map(np.float64)
leaves = {
    float: floats,
    int: st.integers(-(2**63), 2**63 - 1),
    bool: st.booleans(),
    str: st.text(),
    bytes: st.binary(max_size=40),
    np.ndarray: arrays | arrays.map(lambda a: np.asfortranarray(a)),
}


def values(hint: typing.Any) -> st.SearchStrategy[typing.Any]:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in leaves:
        return leaves[hint]
    if origin is typing.Literal:
        return st.sampled_from(arguments)
    if origin is tuple:
        return st.lists(values(arguments[0]), max_size=3).map(tuple)
    if origin is dict:
        return st.dictionaries(st.text(), values(arguments[1]), max_size=3)
    if origin in (typing.Union, types.UnionType):
        return st.one_of(*(st.none() if a is type(None) else values(a) for a in arguments))
    hints = typing.get_type_hints(hint)
    return st.builds(hint, **{f.name: values(hints[f.name]) for f in dataclasses.fields(hint)})


def assert_same(a: typing.Any, b: typing.Any) -> None:
    assert type(a) is type(b)
    if dataclasses.is_dataclass(a):
        for field in dataclasses.fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name))
    elif isinstance(a, np.ndarray | np.generic):
        assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        if isinstance(a, np.ndarray):
            assert a.flags.c_contiguous == b.flags.c_contiguous
    elif isinstance(a, float):
        assert struct.pack("<d", a) == struct.pack("<d", b)
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif isinstance(a, dict):
        assert list(a) == list(b)
        for key in a:
            assert_same(a[key], b[key])
    else:
        assert a == b


@pytest.mark.parametrize("name", sorted(KINDS))
def test_round_trip_is_bit_exact(name: str) -> None:
    kind = KINDS[name]

    @settings(max_examples=40, deadline=None)
    @given(values(kind))
    def check(message: typing.Any) -> None:
        text = encode(message)
        back = decode(kind, text)
        assert_same(message, back)
        assert encode(back) == text

    check()


@pytest.mark.parametrize(
    "bits", [0x7FF8000000000000, 0xFFF8000000000000, 0x7FF0000000000001, 0x7FF0 << 48, 0xFFF0 << 48]
)
def test_every_kind_of_nan_and_infinity_keeps_its_bits(bits: int) -> None:
    value = struct.unpack("<d", struct.pack("<Q", bits))[0]
    back = decode(WheelTravel, encode(WheelTravel(0, 0, value, -0.0)))
    assert struct.pack("<d", back.left_m) == struct.pack("<d", value)
    assert struct.pack("<d", back.right_m) == struct.pack("<d", -0.0)


def test_text_is_what_a_viewer_can_read() -> None:
    order = DriveCommand(7, 0.25, float("nan"), 1.0, 0.0, 200, "follow")
    assert encode(order) == (
        b'{"t_ns":7,"v_mps":0.25,"yaw_rate_radps":null,"brush":1.0,"fan":0.0,'
        b'"valid_for_ms":200,"reason":"follow"}'
    )


def test_a_default_of_a_newer_version_is_filled_in() -> None:
    scan = encode(Scan(np.zeros(1), np.zeros(1), np.zeros(1))).decode()
    text = f'{{"t_ns":1,"arrived_ns":2,"seq":3,"landmarks":[],"scan":{scan},"quality":null}}'
    seen = decode(Seen, text.encode())
    assert seen.motion is None and seen.marker is None and np.isnan(seen.quality)


@pytest.mark.parametrize(
    "text",
    [b"{}", b"[]", b"nonsense", b'{"t_ns":1,"left_m":2}', b'{"t_ns":1,"surprise":2}'],
)
def test_foreign_text_is_refused(text: bytes) -> None:
    with pytest.raises(ValueError):
        decode(Tick, text)


def test_what_is_not_a_message_is_refused() -> None:
    with pytest.raises(TypeError, match="cannot hold a object"):
        encode(Tick(typing.cast(int, object())))
    with pytest.raises(TypeError, match="array of object"):
        encode(Grid(0.05, 0.0, 0.0, np.array([None])))
    with pytest.raises(ValueError, match="not a number"):
        decode(SE2, b'{"x_m":"far","y_m":0.0,"yaw_rad":0.0}')
