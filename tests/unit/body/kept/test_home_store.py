"""A home on disk: what was saved comes back, and no accident leaves less than an old one."""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.body.kept import store as store_file
from robot.body.kept.home_file import decode_home, encode_home
from robot.body.kept.store import HomeStore
from robot.errors import MapError
from robot.geometry.se2 import SE2
from robot.home import Home
from robot.mapping.annotations import Annotations, RoomName
from robot.mapping.grid import GridMemory
from robot.mapping.notes import MapNotes
from robot.slam.memory import SlamMemory
from robot.slam.places import PlacePoints


def home(seed: int = 1, landmarks: int = 5) -> Home:
    rng = np.random.default_rng(seed)
    n = 10 + 2 * landmarks
    root = rng.normal(0, 0.1, (n, n))
    of = [*range(landmarks), 0, 1] if landmarks else []  # some have more than one
    cov = root @ root.T + np.eye(n) * 1e-3
    slam = SlamMemory(
        state=rng.normal(0, 1, n),
        cov=0.5 * (cov + cov.T),
        marker_known=True,
        kind=rng.integers(0, 2, landmarks).astype(np.uint8),
        height_m=np.where(rng.uniform(size=landmarks) < 0.2, np.nan, 0.5),
        sightings=np.full(landmarks, 9, np.int32),
        visits=np.full(landmarks, 2, np.int32),
        along=rng.uniform(-1.0, 1.0, (landmarks, 2)),
        signature=rng.integers(0, 256, (len(of), 32), dtype=np.uint8),
        signature_of=np.array(of, np.int32),
        places=PlacePoints(
            rng.normal(0, 3, (20, 2)),
            rng.uniform(0, 1, 20),
            rng.integers(0, 256, (20, 32), dtype=np.uint8),
            np.zeros(20, np.uint8),
            np.full(20, 7, np.int32),
        ),
    )
    cells = rng.normal(0, 1, (30, 40)).astype(np.float32)
    lost = rng.integers(0, 101, (30, 40), dtype=np.uint8)
    notes = MapNotes(Annotations(rooms=(RoomName(f"kitchen {seed}", (1.0, 2.0)),)))
    return Home(
        slam,
        GridMemory(
            0.05, -7, 3, cells, cells > 2, np.where(cells > 1, cells, np.nan), cells < 1, lost
        ),
        SE2(0.1, -0.2, 0.3),
        SE2(0.2),
        notes.to_dict(),
        {"fan": "low"},
    )


def same(a: Home, b: Home) -> bool:
    arrays = [f for f in SlamMemory.__dataclass_fields__ if f not in ("marker_known", "places")]
    pairs = [(getattr(a.slam, f), getattr(b.slam, f)) for f in arrays]
    pairs += [
        (getattr(a.slam.places, f), getattr(b.slam.places, f))
        for f in PlacePoints.__dataclass_fields__
    ]
    pairs += [(a.grid.log_odds, b.grid.log_odds), (a.grid.sticky, b.grid.sticky)]
    pairs += [(a.grid.behind_m, b.grid.behind_m), (a.grid.driven, b.grid.driven)]
    pairs += [(a.grid.lost_pct, b.grid.lost_pct)]
    rest = [
        (h.slam.marker_known, h.grid.ix0, h.grid.iy0, h.world_from_docked, h.docked_from_marker)
        for h in (a, b)
    ]
    equal = all(np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in pairs)
    return equal and rest[0] == rest[1] and a.notes == b.notes and a.settings == b.settings


def complain(text: str) -> None:
    raise AssertionError(text)


def test_what_was_saved_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    kept = HomeStore(tmp_path / "new" / "folder")
    assert kept.load(complain) is None
    kept.save(home())
    loaded = kept.load(complain)
    assert loaded is not None
    assert same(loaded[1], home())
    assert same(decode_home(loaded[0], "again"), home())


def test_an_empty_map_can_be_kept(tmp_path: Path) -> None:
    assert same(decode_home(encode_home(home(2, landmarks=0)), "x"), home(2, landmarks=0))


def test_a_file_from_before_faces_and_ways_were_kept_is_read(tmp_path: Path) -> None:
    newer = ("grid.behind_m", "grid.driven", "grid.lost_pct", "slam.along")
    with np.load(io.BytesIO(encode_home(home()))) as archive:
        older = {key: archive[key] for key in archive if key not in newer}
    older["grid.sticky"] = older["grid.sticky"] > 0
    file = io.BytesIO()
    np.savez_compressed(file, **older)
    read = decode_home(file.getvalue(), "older")
    grid, along = read.grid, read.slam.along
    assert np.isnan(along).all() and along.shape == (5, 2)
    assert np.isnan(grid.behind_m).all() and grid.behind_m.shape == grid.log_odds.shape
    assert np.array_equal(grid.sticky, older["grid.sticky"]) and grid.sticky.dtype == np.uint8
    assert not grid.lost_pct.any() and grid.lost_pct.shape == grid.log_odds.shape
    assert not grid.driven.any() and grid.driven.shape == grid.log_odds.shape


def test_a_damaged_file_is_reported_and_the_one_before_used(tmp_path: Path) -> None:
    kept, warnings = HomeStore(tmp_path), []
    kept.save(home(1))
    kept.save(home(2))
    kept.path.write_bytes(kept.path.read_bytes()[:-100])
    loaded = kept.load(warnings.append)
    assert loaded is not None
    assert same(loaded[1], home(1))
    assert len(warnings) == 1
    assert str(kept.path) in warnings[0]


def test_nothing_is_overwritten_when_all_is_damaged(tmp_path: Path) -> None:
    kept = HomeStore(tmp_path)
    kept.path.write_bytes(b"rubbish")
    with pytest.raises(MapError, match=r"home\.npz"):
        kept.load(complain)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_damage_is_one_sentence_or_harmless(data: st.DataObject) -> None:
    whole = bytearray(encode_home(home()))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(whole))) if data.draw(st.booleans()) else len(whole)
    try:
        found = decode_home(bytes(whole[:cut]), "home.npz")
    except MapError as error:
        assert str(error).startswith("home.npz: ")
        assert str(error).count("\n") == 0
    else:
        assert same(found, home())


@pytest.mark.parametrize(
    "change",
    [
        {"cov": -np.eye(20)},
        {"state": np.full(20, np.nan)},
        {"signature_of": np.array([0, 1, 2, 3, 9, 0, 1], np.int32)},
        {"kind": np.zeros(4, np.uint8)},
    ],
)
def test_numbers_that_make_no_sense_are_refused(change: dict) -> None:
    good = home()
    fields = {f: getattr(good.slam, f) for f in SlamMemory.__dataclass_fields__} | change
    bad = Home(SlamMemory(**fields), good.grid, None, SE2(), good.notes)
    with pytest.raises(MapError, match="damaged"):
        decode_home(encode_home(bad), "home.npz")


class PowerCutError(Exception):
    """The lights went out."""


@pytest.mark.parametrize("at", range(24))
def test_the_power_may_go_at_any_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    """Every open, write, flush to the card and rename in turn is the last; bytes may be torn."""
    kept = HomeStore(tmp_path)
    kept.save(home(1))
    kept.save(home(2))
    steps = [0]

    def step() -> None:
        steps[0] += 1
        if steps[0] > at:
            raise PowerCutError

    class Torn:
        def __init__(self, path: Path, mode: str) -> None:
            step()
            self.file = open(path, mode)  # noqa: SIM115

        def __enter__(self) -> "Torn":
            return self

        def __exit__(self, *_: object) -> None:
            self.file.close()

        def write(self, data: bytes) -> None:
            for part in (data[: len(data) // 2], data[len(data) // 2 :]):
                self.file.write(part)
                self.file.flush()
                step()

        def flush(self) -> None:
            step()

        def fileno(self) -> int:
            return self.file.fileno()

    def replace(self: Path, target: Path) -> None:
        step()
        os.replace(self, target)

    with monkeypatch.context() as patched:
        patched.setattr(store_file, "open", Torn, raising=False)
        patched.setattr(store_file.os, "fsync", lambda number: step())
        patched.setattr(Path, "replace", replace)
        try:
            kept.save(home(3))
            finished = True
        except PowerCutError:
            finished = False
    loaded = HomeStore(tmp_path).load(complain)
    assert loaded is not None
    assert same(loaded[1], home(3)) or (not finished and same(loaded[1], home(2)))


def test_a_full_or_forbidden_folder_is_one_sentence(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    with pytest.raises(MapError, match="cannot be saved"):
        HomeStore(blocked / "home").save(home())
