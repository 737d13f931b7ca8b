"""The wire's single source of truth: every message, its fields, units and C types.

A message is a frozen dataclass whose annotations carry the C type and the unit. From this page
`python -m firmware_bridge.messages` writes the C header `firmware/src/wire/messages.h` and the
tables of PROTOCOL.md; `codec.py` packs and unpacks from it. All integers are little-endian.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum, IntFlag
from typing import Annotated, Any, Literal, TypeVar, dataclass_transform, get_type_hints

PROTOCOL_VERSION = 1
TICKS_PER_METRE = 5000  # encoder edges per metre of rim travel: 0.2 mm a tick
MAX_WHEEL_MM_S = 500  # a faster order is refused
MAX_VALID_FOR_MS = 1000  # a longer order is refused
LINK_TIMEOUT_MS = 500  # without a valid frame for this long the session ends
WHEELS_PERIOD_MS = 20
CONTACTS_PERIOD_MS = 20
STATUS_PERIOD_MS = 200
POWER_PERIOD_MS = 1000
FULL_SPEED_MM_S = 600  # of a free wheel at full PWM, until a Tune says otherwise
MIN_FULL_SPEED_MM_S = 100  # a Tune beyond these is refused
MAX_FULL_SPEED_MM_S = 2000

CONSTANTS = {
    name: value
    for name, value in tuple(globals().items())
    if name.isupper() and isinstance(value, int)
}


class StopReason(IntEnum):
    """Why the controller is latched; the names in lower case are what people and logs see."""

    NONE = 0
    RESET = 1  # the controller has started: nothing moves before a clear
    HOST = 2  # a Stop order
    CLIFF = 3
    BUMP = 4
    WHEEL_DROP = 5
    STALL = 6  # driven, but an encoder stands still
    OVER_CURRENT = 7
    BROWN_OUT = 8
    EXPIRED = 9  # an order to move ran out and no new one came
    LINK_LOST = 10  # no valid frame for LINK_TIMEOUT_MS, or another host said hello while moving
    OVERRUN = 11  # the control loop came too late


class Result(IntEnum):
    """What became of an order."""

    OK = 0
    NO_SESSION = 1  # not of the open session: say Hello again
    LATCHED = 2  # a stop is latched: Clear it first
    OUT_OF_RANGE = 3
    BLOCKED = 4  # Clear: its cause persists
    WRONG_LATCH = 5  # Clear: another stop has latched since
    UNKNOWN = 6  # no such message, or of another length


class State(IntEnum):
    """The controller's state."""

    NO_SESSION = 0
    LATCHED = 1
    READY = 2  # accepts orders, has none
    DRIVING = 3


class ContactBit(IntFlag):
    """Bits of `Contacts.bits`; 1 is pressed, over a drop, hanging, or on the charger."""

    BUMP_LEFT = 1 << 0
    BUMP_RIGHT = 1 << 1
    CLIFF_LEFT = 1 << 2
    CLIFF_FRONT_LEFT = 1 << 3
    CLIFF_FRONT_RIGHT = 1 << 4
    CLIFF_RIGHT = 1 << 5
    WHEEL_DROP = 1 << 6
    CHARGING = 1 << 7


class Board(IntEnum):
    """Which board the firmware was built for."""

    HOST = 1
    ATMEGA328P = 2


ENUMS: tuple[type[IntEnum] | type[IntFlag], ...] = (StopReason, Result, State, ContactBit, Board)
BUMP = ContactBit.BUMP_LEFT | ContactBit.BUMP_RIGHT
CLIFF = (
    ContactBit.CLIFF_LEFT
    | ContactBit.CLIFF_FRONT_LEFT
    | ContactBit.CLIFF_FRONT_RIGHT
    | ContactBit.CLIFF_RIGHT
)


@dataclass(frozen=True, slots=True)
class CType:
    """A C type of the wire: its name, the `struct` code and the size in bytes."""

    name: str
    code: str
    size: int


U8 = Annotated[int, CType("uint8_t", "B", 1)]
U16 = Annotated[int, CType("uint16_t", "H", 2)]
I16 = Annotated[int, CType("int16_t", "h", 2)]
U32 = Annotated[int, CType("uint32_t", "I", 4)]
I32 = Annotated[int, CType("int32_t", "i", 4)]


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message as the wire knows it."""

    name: str
    ctype: CType
    unit: str


@dataclass(frozen=True, slots=True)
class Spec:
    """One row of the table."""

    ident: int
    cls: type[Any]
    sender: Literal["host", "controller"]
    rate: str
    fields: tuple[Field, ...]

    @property
    def size(self) -> int:
        """Bytes of the fields, without header and CRC."""
        return sum(field.ctype.size for field in self.fields)


MESSAGES: dict[int, Spec] = {}
M = TypeVar("M")


@dataclass_transform(frozen_default=True)
def _message(
    ident: int, sender: Literal["host", "controller"], rate: str
) -> Callable[[type[M]], type[M]]:
    """Register a class as message `ident` of the wire."""

    def register(cls: type[M]) -> type[M]:
        made: Any = dataclass(frozen=True, slots=True)(cls)
        hints = get_type_hints(made, include_extras=True)
        rows = []
        for field in fields(made):
            ctype, unit = hints[field.name].__metadata__
            rows.append(Field(field.name, ctype, unit))
        if ident in MESSAGES:
            raise ValueError(f"message id {ident} is taken by {MESSAGES[ident].cls.__name__}")
        MESSAGES[ident] = Spec(ident, made, sender, rate, tuple(rows))
        return made  # type: ignore[no-any-return]

    return register


# ---------------------------------------------------------------- orders (answered, each of them)


@_message(1, "host", "10 Hz until answered")
class Hello:
    """Open the session named in the header."""

    protocol: Annotated[U8, "PROTOCOL_VERSION"]


@_message(2, "host", "50 Hz")
class Drive:
    """Wheel rim speeds (forward positive), brush and fan, for a limited time."""

    left_mm_s: Annotated[I16, "mm/s"]
    right_mm_s: Annotated[I16, "mm/s"]
    brush_pct: Annotated[U8, "%"]
    fan_pct: Annotated[U8, "%"]
    valid_for_ms: Annotated[U16, "ms"]


@_message(3, "host", "until answered")
class Stop:
    """Latch a stop with reason HOST."""


@_message(4, "host", "until answered, at most 5 times")
class Clear:
    """Clear the stop with this number; any other latched stop stays."""

    latch: Annotated[U16, "number of the stop"]


@_message(5, "host", "10 Hz in a session")
class Keep:
    """Keep the session open; it never opens one, so a controller that was reset is noticed."""


@_message(6, "host", "until answered, when a session opens")
class Tune:
    """What the motors are: the feed-forward and the gains of the wheel loops follow from it."""

    full_speed_mm_s: Annotated[U16, "mm/s of a free wheel at full PWM"]


# ---------------------------------------------------------------- answers and telemetry


@_message(65, "controller", "answer to Hello")
class HelloAck:
    """Who answers; the session in the header is open, or 0 when the protocol differs."""

    time_us: Annotated[U32, "when the order was taken: us, wraps"]
    protocol: Annotated[U8, "PROTOCOL_VERSION"]
    board: Annotated[U8, "Board"]
    boot: Annotated[U16, "number of starts"]
    build: Annotated[U32, "hash of the sources"]
    stop_reason: Annotated[U8, "StopReason"]
    latch: Annotated[U16, "number of the stop"]


@_message(66, "controller", "answer to any other order")
class Ack:
    """What became of the order with the sequence number `order`, and the latch after it."""

    time_us: Annotated[U32, "when the order was taken: us, wraps"]
    order: Annotated[U8, "sequence number"]
    result: Annotated[U8, "Result"]
    stop_reason: Annotated[U8, "StopReason"]
    latch: Annotated[U16, "number of the stop"]


@_message(67, "controller", "50 Hz")
class Wheels:
    """Cumulative encoder counts since the controller's start; they wrap."""

    time_us: Annotated[U32, "us, wraps"]
    left_ticks: Annotated[I32, "1/TICKS_PER_METRE m, wraps"]
    right_ticks: Annotated[I32, "1/TICKS_PER_METRE m, wraps"]


@_message(68, "controller", "50 Hz and on change")
class Contacts:
    """Switches and drop sensors."""

    time_us: Annotated[U32, "us, wraps"]
    bits: Annotated[U8, "ContactBit"]


@_message(69, "controller", "1 Hz")
class Power:
    """Battery and motor current."""

    time_us: Annotated[U32, "us, wraps"]
    battery_mv: Annotated[U16, "mV"]
    current_ma: Annotated[I16, "mA, out of the battery"]
    charging: Annotated[U8, "0 or 1"]


@_message(70, "controller", "5 Hz and on change")
class Status:
    """State, latch, and what the controller has counted since its start (counters wrap)."""

    time_us: Annotated[U32, "us, wraps"]
    state: Annotated[U8, "State"]
    stop_reason: Annotated[U8, "StopReason"]
    latch: Annotated[U16, "number of the stop"]
    frames: Annotated[U16, "valid frames received"]
    crc_errors: Annotated[U16, "frames with a wrong CRC"]
    framing_errors: Annotated[U16, "pieces that were no frame"]
    refused: Annotated[U16, "orders not carried out"]
    expired: Annotated[U16, "orders that ran out"]
    dropped: Annotated[U16, "frames not sent: line full"]


MAX_BODY_BYTES = 4 + max(spec.size for spec in MESSAGES.values())  # header and fields
Message = (
    Hello | Drive | Stop | Clear | Keep | Tune
    | HelloAck | Ack | Wheels | Contacts | Power | Status
)  # fmt: skip


if __name__ == "__main__":
    from firmware_bridge.generate import main

    main()
