"""Framing and codec for any bytes, any cutting, any damage."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_bridge.codec import Packet, pack, unpack
from firmware_bridge.framing import FrameDecoder, cobs_decode, cobs_encode, encode_frame
from firmware_bridge.messages import MAX_BODY_BYTES, MESSAGES, Spec

bodies = st.binary(min_size=1, max_size=MAX_BODY_BYTES)


@given(st.binary(max_size=1000))
def test_cobs_round_trip(data: bytes) -> None:
    encoded = cobs_encode(data)
    assert 0 not in encoded
    assert len(encoded) <= len(data) + len(data) // 254 + 1
    assert cobs_decode(encoded) == data


@given(st.lists(bodies, max_size=8), st.lists(st.integers(1, 20)))
def test_frames_survive_any_cutting(sent: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(map(encode_frame, sent))
    decoder, got, at = FrameDecoder(), [], 0
    for cut in [*cuts, len(stream)]:
        got += decoder.feed(stream[at : at + cut])
        at += cut
    assert got == sent


@given(st.binary(max_size=300), bodies)
def test_noise_never_raises_and_never_hides_the_next_frame(noise: bytes, body: bytes) -> None:
    decoder = FrameDecoder()
    decoder.feed(noise)
    decoder.feed(b"\0")
    assert decoder.feed(encode_frame(body)) == [body]


@given(bodies, st.data())
def test_damage_is_never_taken_for_a_frame(body: bytes, data: st.DataObject) -> None:
    frame = bytearray(encode_frame(body))
    at = data.draw(st.integers(0, len(frame) - 2))
    frame[at] ^= data.draw(st.integers(1, 255))
    assert body not in FrameDecoder().feed(bytes(frame))


def values(spec: Spec) -> st.SearchStrategy[Packet]:
    """Any packet of one message."""
    ranges = []
    for field in spec.fields:
        bits = 8 * field.ctype.size
        signed = field.ctype.name.startswith("int")
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        ranges.append(st.integers(low, high))
    message = st.tuples(*ranges).map(lambda drawn: spec.cls(*drawn))
    return st.builds(Packet, st.integers(0, 255), st.integers(0, 65535), message)


@given(st.one_of([values(spec) for spec in MESSAGES.values()]))
@settings(max_examples=300)
def test_every_packet_round_trips(packet: Packet) -> None:
    body = pack(packet)
    assert len(body) <= MAX_BODY_BYTES
    assert unpack(body) == packet


@given(st.binary(max_size=40))
def test_unpack_never_raises(body: bytes) -> None:
    packet = unpack(body)
    assert packet is None or pack(packet) == body
