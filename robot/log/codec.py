"""Messages to JSON text and back, without losing a bit.

JSON, because every log viewer can show and plot it. What JSON lacks is spelled out:

- a float that is unknown (NaN) is `null`, an infinite one `"Infinity"` or `"-Infinity"`, and a NaN
  with an unusual bit pattern `"NaN:<16 hex digits>"`; the others are the shortest decimal text
  that reads back as the same binary64 (Steele and White, PLDI 1990), so `-0.0` keeps its sign;
- an array is `{"dtype": "<f8", "shape": [2, 2], "base64": ...}`, with `"order": "F"` if its memory
  is column-major: summation order is part of bit-exactness;
- a numpy scalar where a plain number is expected is an array of shape [] with `"scalar": true`;
- bytes are base64 text.

Encoding is deterministic: equal messages, bit for bit, give equal text. `encode` and `decode` know
every dataclass of `robot.messages`, and the geometry inside them.
"""

from __future__ import annotations

import base64
import dataclasses
import math
import struct
import types
import typing
from collections.abc import Callable
from typing import Any, Literal

import msgspec
import numpy as np

from robot import messages
from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import Command, Event


@dataclasses.dataclass(frozen=True, slots=True)
class FrameStamp:
    """What a logged `StereoFrame` holds beside its two images."""

    t_ns: int
    seq: int
    yaw_change_rad: float


@dataclasses.dataclass(frozen=True, slots=True)
class TruePose:
    """The simulator's truth, in the frame of the estimate."""

    t_ns: int
    world_from_base: SE2


EVENTS: dict[str, type] = {kind.__name__: kind for kind in typing.get_args(Event)}
COMMANDS: dict[str, type] = {kind.__name__: kind for kind in typing.get_args(Command)}

_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder()
_CANONICAL_NAN = struct.pack("<d", math.nan)
_INFINITE = {"Infinity": math.inf, "-Infinity": -math.inf}
_AS_IT_IS = frozenset({int, str, bool, bytes, type(None)})
_FIELDS: dict[type, tuple[str, ...]] = {
    kind: tuple(field.name for field in dataclasses.fields(kind))
    for kind in (
        *EVENTS.values(),
        *COMMANDS.values(),
        messages.Landmark,
        messages.Scan,
        messages.VisualMotion,
        messages.Marker,
        messages.Grid,
        messages.Path,
        FrameStamp,
        TruePose,
        SE2,
        StereoCamera,
    )
}


def encode(message: object) -> bytes:
    """JSON text of a message. Raises TypeError for a type that is not one of ours."""
    return _ENCODER.encode(_plain(message))


def decode(kind: type, text: bytes) -> Any:
    """The message of type `kind` in `text`. Raises ValueError if it holds something else."""
    try:
        return _reader_of(kind)(_DECODER.decode(text))
    except (TypeError, KeyError, AttributeError, msgspec.DecodeError) as error:
        raise ValueError(f"not a {kind.__name__}: {error}") from None


# ---------------------------------------------------------------- out


def _plain(value: Any) -> Any:
    """What msgspec can write: dicts, lists, text, numbers."""
    kind = type(value)
    if kind is float:
        return value if math.isfinite(value) else _odd_float(value)
    if kind in _AS_IT_IS:
        return value
    names = _FIELDS.get(kind)
    if names is not None:
        return {name: _plain(getattr(value, name)) for name in names}
    if kind is np.ndarray:
        return _plain_array(value)
    if kind is tuple or kind is list:
        return [_plain(item) for item in value]
    if kind is dict:
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.generic):
        return {**_plain_array(np.asarray(value)), "scalar": True}
    raise TypeError(f"a log cannot hold a {kind.__name__}")


def _odd_float(value: float) -> str | None:
    bits = struct.pack("<d", value)
    if bits == _CANONICAL_NAN:
        return None
    if math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    return f"NaN:{bits[::-1].hex()}"


def _plain_array(array: np.ndarray) -> dict[str, Any]:
    if array.dtype.kind not in "biufc":
        raise TypeError(f"a log cannot hold an array of {array.dtype}")
    plain: dict[str, Any] = {"dtype": array.dtype.str, "shape": array.shape}
    if array.flags.f_contiguous and not array.flags.c_contiguous:
        plain["order"] = "F"
        plain["base64"] = array.tobytes(order="F")
    else:
        plain["base64"] = array.tobytes()
    return plain


# ---------------------------------------------------------------- in

_Reader = Callable[[Any], Any]
_READERS: dict[type, _Reader] = {}


def _reader_of(kind: type) -> _Reader:
    """The reader of a dataclass, built once from its annotations."""
    reader = _READERS.get(kind)
    if reader is None:
        reader = _READERS[kind] = _dataclass_reader(kind)
    return reader


def _dataclass_reader(kind: type) -> _Reader:
    hints = typing.get_type_hints(kind)
    readers = {name: _reader(hints[name]) for name in _FIELDS[kind]}

    def read(plain: dict[str, Any]) -> Any:
        unknown = plain.keys() - readers.keys()
        if unknown:
            raise ValueError(f"{kind.__name__} has no field {min(unknown)!r}")
        return kind(**{name: readers[name](value) for name, value in plain.items()})

    return read


def _reader(hint: Any) -> _Reader:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is float:
        return _read_float
    if hint in (int, bool, str) or origin is Literal:
        return _read_scalar
    if hint is np.ndarray:
        return _read_array
    if hint is bytes:
        return base64.b64decode
    if origin is tuple:
        item = _reader(arguments[0])
        return lambda plain: tuple(item(value) for value in plain)
    if origin is dict:
        value_reader = _reader(arguments[1])
        return lambda plain: {key: value_reader(value) for key, value in plain.items()}
    if origin in (typing.Union, types.UnionType):
        some = _reader(next(part for part in arguments if part is not type(None)))
        return lambda plain: None if plain is None else some(plain)
    return _reader_of(hint)


def _read_float(plain: Any) -> Any:
    if type(plain) is float:
        return plain
    if plain is None:
        return math.nan
    if type(plain) is str:
        if plain in _INFINITE:
            return _INFINITE[plain]
        if not plain.startswith("NaN:"):
            raise ValueError(f"{plain!r} is not a number")
        return struct.unpack(">d", bytes.fromhex(plain[4:]))[0]
    return _read_scalar(plain)


def _read_scalar(plain: Any) -> Any:
    return _read_array(plain)[()] if type(plain) is dict else plain


def _read_array(plain: dict[str, Any]) -> np.ndarray:
    flat = np.frombuffer(base64.b64decode(plain["base64"]), dtype=np.dtype(plain["dtype"]))
    order: Literal["C", "F"] = plain.get("order", "C")
    return flat.reshape(plain["shape"], order=order).copy(order=order)
