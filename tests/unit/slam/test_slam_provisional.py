"""Nothing becomes a landmark at first sight."""

import numpy as np

from robot.config import SlamConfig
from robot.slam.catalogue import Observations
from robot.slam.provisional import Waiting

MS = 1_000_000
COV = 0.01**2 * np.eye(2)


def sight(track: int, bits: np.ndarray) -> Observations:
    return Observations(
        np.array([[1.0, 0.0]]),
        COV[None],
        np.ones(1),
        np.zeros(1, dtype=int),
        np.array([0.5]),
        np.array([track]),
        bits[None],
    )


def confirm(
    waiting: Waiting, places: list[tuple[float, float]], track: int, step_ms: int = 100
) -> list[int]:
    """How many are ripe after each sight of one point at `places`."""
    bits = np.where(np.random.default_rng(1).uniform(size=256) < 0.5, -1, 1).astype("f4")
    return [
        len(
            waiting.confirm(
                sight(track, bits), np.array([0]), np.array([place]), COV[None], k * step_ms * MS
            )
        )
        for k, place in enumerate(places)
    ]


def test_a_point_that_stays_becomes_ripe_with_or_without_a_track() -> None:
    config = SlamConfig(provisional_sightings=4)
    for track in (5, -1):
        assert confirm(Waiting(config), [(1.0, 0.0)] * 4, track) == [0, 0, 0, 1]


def test_a_point_that_wanders_never_does() -> None:
    places = [(1.0 + 0.1 * k, 0.0) for k in range(12)]
    assert sum(confirm(Waiting(SlamConfig(provisional_sightings=4)), places, 5)) == 0


def test_a_point_that_was_away_for_long_starts_again() -> None:
    waiting = Waiting(SlamConfig(provisional_sightings=3))
    assert confirm(waiting, [(1.0, 0.0)] * 6, -1, step_ms=2500) == [0] * 6


def test_dropped_tracks_start_again() -> None:
    waiting = Waiting(SlamConfig(provisional_sightings=3))
    confirm(waiting, [(1.0, 0.0)] * 2, 5)
    waiting.drop(np.array([5]))
    assert confirm(waiting, [(1.0, 0.0)] * 3, 5) == [0, 0, 1]
