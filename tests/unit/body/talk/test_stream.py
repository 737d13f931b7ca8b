"""Frames and tiles: whatever is cut or damaged, what comes out is what went in, or an error."""

import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.body.talk import stream
from robot.body.talk.shown import cut_tiles
from robot.messages import Grid

PLACES = st.tuples(st.integers(-2000, 2000), st.integers(-2000, 2000))


@settings(deadline=None, max_examples=50)
@given(st.lists(st.binary(max_size=300), max_size=8), st.integers(1, 50))
def test_messages_survive_any_cutting(payloads, step):
    data = b"".join(stream.frame(stream.JSON, p) for p in payloads)
    unframer = stream.Unframer()
    out = [m for at in range(0, len(data), step) for m in unframer.feed(data[at : at + step])]
    assert out == [(stream.JSON, p) for p in payloads]


def test_an_announced_giant_is_refused():
    with pytest.raises(stream.StreamError):
        list(stream.Unframer().feed(b"\xff\xff\xff\xffJ"))


@settings(deadline=None, max_examples=50)
@given(st.dictionaries(PLACES, st.binary(min_size=1024, max_size=1024), max_size=3))
def test_tiles_come_back(tiles):
    assert stream.unpack_tiles(stream.pack_tiles(tiles.items())) == tiles


@settings(deadline=None, max_examples=50)
@given(st.binary(max_size=200))
def test_damaged_tiles_are_refused(data):
    with pytest.raises(stream.StreamError):
        stream.unpack_tiles(zlib.compress(data + b"x") if len(data) % 2 else data)


def test_a_zip_bomb_of_tiles_is_refused():
    with pytest.raises(stream.StreamError):
        stream.unpack_tiles(zlib.compress(bytes(10_000_000)))


def test_no_floor_needs_more_than_20_kb_a_message():
    noise = np.random.default_rng(1).integers(0, 4, (200, stream.TILE_BYTES), dtype=np.uint8)
    tiles = {(i, 0): row.tobytes() for i, row in enumerate(noise)}
    sizes = [len(stream.pack_tiles(batch)) for batch in stream.batches(tiles)]
    assert len(sizes) == 5 and max(sizes) <= 20_000


@settings(deadline=None, max_examples=50)
@given(st.integers(-100, 100), st.integers(-100, 100), st.integers(1, 70), st.integers(1, 70))
def test_every_cell_finds_its_place_on_the_lattice(ix0, iy0, rows, columns):
    cells = np.random.default_rng(rows).choice(np.array([-1, 0, 100], np.int8), (rows, columns))
    covered = np.random.default_rng(columns).random((rows, columns)) < 0.5
    tiles = cut_tiles(Grid(0.025, ix0 * 0.025, iy0 * 0.025, cells), covered)
    for row, column in {(0, 0), (rows - 1, columns - 1), (rows // 2, columns // 3)}:
        x, y = ix0 + column, iy0 + row
        tile = tiles.get((x // 32, y // 32), bytes(1024))
        wanted = {-1: 0, 0: 2 if covered[row, column] else 1, 100: 3}[int(cells[row, column])]
        assert tile[(y % 32) * 32 + x % 32] == wanted
    assert sum(np.count_nonzero(list(t)) for t in tiles.values()) == np.count_nonzero(cells >= 0)
