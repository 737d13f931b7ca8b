"""Place points: averaged while followed, kept once, bounded in number."""

import math

import numpy as np
import pytest

from robot.geometry.se2 import SE2
from robot.messages import Landmark
from robot.slam.places import PlaceMap, PlacePoints, Tracks

S = 1_000_000_000


def seen(track: int, x: float, y: float, signature: bytes, height_m: float = 0.4) -> Landmark:
    cov = np.diag([0.02, 0.01]) ** 2
    return Landmark(math.hypot(x, y), math.atan2(y, x), cov, signature, "point", height_m, track)


def points(rng: np.random.Generator, count: int) -> PlacePoints:
    return PlacePoints(
        rng.uniform(-5, 5, (count, 2)),
        rng.uniform(0.1, 1.0, count),
        rng.integers(0, 256, (count, 32), dtype=np.uint8),
        np.zeros(count, np.uint8),
        rng.integers(6, 60, count).astype(np.int32),
    )


def test_a_followed_point_is_averaged_where_it_stands() -> None:
    tracks, where = Tracks(), SE2(1.0, 2.0, 0.5)
    for i in range(8):
        x = 2.0 + 0.01 * (-1) ** i
        tracks.add(i * S // 10, [seen(3, x, 0.3, bytes([i] * 32))], where)
    assert len(tracks.take_ended(S, 6)) == 0  # still followed
    found = tracks.take_ended(3 * S, 6)
    assert found.xy_m[0] == pytest.approx(where.apply(np.array([[2.0, 0.3]]))[0], abs=1e-3)
    assert found.height_m[0] == pytest.approx(0.4)
    assert found.sightings[0] == 8
    assert found.signature[0].tolist() == [7] * 32  # of the 8th sighting, the last power of two
    assert len(tracks.take_ended(9 * S, 1)) == 0


def test_what_cannot_be_recognised_is_left_out() -> None:
    tracks = Tracks()
    unfit = [
        seen(-1, 1.0, 0.0, bytes(32)),
        seen(1, 1.0, 0.0, b"short"),
        seen(2, 1.0, 0.0, bytes(32), math.nan),
    ]
    for i in range(8):
        tracks.add(i, unfit, SE2())
    assert len(tracks.points(1)) == 0


def test_a_place_is_kept_once() -> None:
    rng = np.random.default_rng(1)
    places, new = PlaceMap(1000), points(rng, 50)
    places.add(new)
    places.add(new)
    assert len(places.points) == 50
    other = new.signature ^ np.uint8(255)
    places.add(PlacePoints(new.xy_m, new.height_m, other, new.kind, new.sightings))
    assert len(places.points) == 100  # the same spot, but it looks different


def test_beyond_the_bound_the_least_seen_go() -> None:
    rng = np.random.default_rng(2)
    places = PlaceMap(100)
    for _ in range(10):
        places.add(points(rng, 30))
        assert len(places.points) <= 100
    assert places.points.sightings.mean() > 40
