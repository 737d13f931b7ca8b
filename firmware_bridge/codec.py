"""Messages to bodies and back, by the table of `messages.py`."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from firmware_bridge.messages import MESSAGES, Message

_HEADER = struct.Struct("<BBH")
_FIELDS = {
    ident: struct.Struct("<" + "".join(field.ctype.code for field in spec.fields))
    for ident, spec in MESSAGES.items()
}
_IDENT = {spec.cls: ident for ident, spec in MESSAGES.items()}
_NAMES = {ident: tuple(f.name for f in spec.fields) for ident, spec in MESSAGES.items()}


@dataclass(frozen=True, slots=True)
class Packet:
    """A message with its header: sequence number (0 to 255) and session (0: none)."""

    seq: int
    session: int
    message: Message


def pack(packet: Packet) -> bytes:
    """The frame body. Raises struct.error when a value does not fit its C type."""
    message = packet.message
    ident = _IDENT[type(message)]
    values = [getattr(message, name) for name in _NAMES[ident]]
    return _HEADER.pack(ident, packet.seq, packet.session) + _FIELDS[ident].pack(*values)


def unpack(body: bytes) -> Packet | None:
    """The packet in a frame body; None for an unknown id or a wrong length."""
    if len(body) < _HEADER.size:
        return None
    ident, seq, session = _HEADER.unpack_from(body)
    layout = _FIELDS.get(ident)
    if layout is None or len(body) != _HEADER.size + layout.size:
        return None
    message = MESSAGES[ident].cls(*layout.unpack_from(body, _HEADER.size))
    return Packet(seq, session, message)
