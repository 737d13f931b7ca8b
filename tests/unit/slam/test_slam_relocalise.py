"""Finding a pose among thousands of places, and not finding one where there is none."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_slam_places import points

from robot.geometry.se2 import SE2
from robot.messages import Landmark
from robot.slam.places import PlacePoints
from robot.slam.relocalise import Relocaliser, find_pose, rigid_fit

S = 1_000_000_000


def view(rng: np.random.Generator, places: PlacePoints, pose: SE2, flip: float) -> PlacePoints:
    """The places within 3 m of a pose in its frame, with errors, half of them never mapped."""
    local = pose.inverse().apply(places.xy_m)
    near = np.flatnonzero(np.hypot(*local.T) < 3.0)[:60]
    flips = np.packbits(rng.uniform(size=(len(near), 256)) < flip, axis=1)
    known = PlacePoints(
        local[near] + rng.normal(0, 0.02, (len(near), 2)),
        places.height_m[near] + rng.normal(0, 0.01, len(near)),
        places.signature[near] ^ flips,
        places.kind[near],
        places.sightings[near],
    )
    return known.joined(points(rng, len(near) // 2))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_finds_the_pose_without_a_guess(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = points(rng, 600)
    pose = SE2(*rng.uniform(-2, 2, 2).tolist(), float(rng.uniform(-math.pi, math.pi)))
    fix = find_pose(view(rng, places, pose, 0.1), places)
    assert fix is not None
    away = pose.inverse() @ fix.map_from_local
    assert math.hypot(away.x_m, away.y_m) < 0.05
    assert abs(away.yaw_rad) < 0.03
    assert fix.inliers >= 12
    assert fix.runner_up <= 3


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_foreign_home_gives_no_pose_to_believe(seed: int) -> None:
    rng = np.random.default_rng(seed)
    fix = find_pose(view(rng, points(rng, 600), SE2(), 0.1), points(rng, 2000))
    assert fix is None or fix.inliers < 8


def looks(places: PlacePoints, rng: np.random.Generator) -> list[tuple[Landmark, ...]]:
    """Five frames from one spot, every point followed through all of them."""
    near = np.flatnonzero(np.hypot(*places.xy_m.T) < 3.0)[:40].tolist()
    return [tuple(_landmark(places, i, rng) for i in near) for _ in range(5)]


def _landmark(
    places: PlacePoints, i: int, rng: np.random.Generator, yaw_rad: float = 0.0
) -> Landmark:
    x, y = places.xy_m[i]
    return Landmark(
        math.hypot(x, y) + float(rng.normal(0, 0.02)),
        math.atan2(y, x) - yaw_rad,
        np.diag([0.02, 0.01]) ** 2,
        places.signature[i].tobytes(),
        "point",
        float(places.height_m[i]),
        i,
    )


def test_certain_only_at_a_look_from_a_turned_head() -> None:
    rng = np.random.default_rng(3)
    places, finder, glimpses = points(rng, 400), Relocaliser(), []
    for k, frame in enumerate(looks(places, rng) * 2):
        glimpses.append(finder.look(k * S // 5, frame, SE2(), places, S // 2))
    good = [glimpse for glimpse in glimpses if glimpse is not None]
    assert len(good) > 2 and not any(glimpse.confirmed for glimpse in good)
    assert math.hypot(good[1].map_from_local.x_m, good[1].map_from_local.y_m) < 0.05
    near = np.argsort(np.hypot(*places.xy_m.T))[:40]
    turned = tuple(_landmark(places, i, rng, 0.5) for i in near)
    last = finder.look(3 * S, turned, SE2(0.0, 0.0, 0.5), places, S // 2)
    assert last is not None and last.confirmed
    assert abs(last.map_from_local.yaw_rad) < 0.05


def test_twin_rooms_are_not_told_apart_by_guessing() -> None:
    rng = np.random.default_rng(4)
    room = points(rng, 300)
    twin = PlacePoints(
        room.xy_m + [20.0, 0.0], room.height_m, room.signature, room.kind, room.sightings
    )
    finder = Relocaliser()
    for k, frame in enumerate(looks(room, rng) * 4):
        assert finder.look(k * S // 5, frame, SE2(), room.joined(twin), S // 2) is None


def test_rigid_fit_is_exact_without_noise() -> None:
    rng = np.random.default_rng(5)
    near, pose = rng.uniform(-3, 3, (5, 2)), SE2(1.0, -2.0, 2.5)
    fit = rigid_fit(near, pose.apply(near))
    assert (fit.x_m, fit.y_m, fit.yaw_rad) == pytest.approx((1.0, -2.0, 2.5))
