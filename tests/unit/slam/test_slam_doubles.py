"""One thing mapped twice becomes one; two things stay two."""

import numpy as np
import pytest

from robot.config import SlamConfig
from robot.slam.catalogue import BITS, Catalogue
from robot.slam.doubles import merge_doubles
from robot.slam.ekf import FIRST_LANDMARK, LandmarkFilter

CONFIG = SlamConfig()

AHEAD = np.array([1.0, 0.0])


def twice(apart_m: float, sigma_m: float = 0.05) -> tuple[LandmarkFilter, Catalogue]:
    """Something seen till 5 s, and again from 9 s on `apart_m` away under another number."""
    ekf = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1))
    places = np.array([[1.0, 0.0], [1.0 + apart_m, 0.0], [1.0, 2.0]])
    one = np.tile(np.eye(2), (3, 1, 1))
    ekf.add(places, np.tile(np.eye(2, 3), (3, 1, 1)), one, sigma_m**2 * one)
    bits = np.where(np.random.default_rng(1).uniform(size=(2, BITS)) < 0.5, -1, 1)
    catalogue = Catalogue()
    for track, (looks, born_s) in enumerate([(0, 1), (0, 9), (1, 1)]):
        catalogue.add(0, 0.3, bits[looks].astype(np.float32), AHEAD, track, round(born_s * 1e9))
    for known, last_s in zip(catalogue.entries, (5, 12, 12), strict=True):
        known.sightings, known.last_seen_ns = 20, round(last_s * 1e9)
    return ekf, catalogue


def test_doubles_become_one_and_correct_the_filter() -> None:
    ekf, catalogue = twice(0.08)
    pose = ekf.P[0, 0]
    assert merge_doubles(ekf, catalogue, CONFIG).tolist() == [False, True, False]
    places = ekf.landmarks()
    assert places[0] == pytest.approx([1.04, 0.0], abs=0.005)
    assert np.hypot(*(places[0] - places[1])) < 0.02 and ekf.P[0, 0] <= pose
    older = catalogue.entries[0]
    assert older.sightings == 40 and older.last_seen_ns == round(12e9)
    assert catalogue.bound(np.array([0, 1, 2])).tolist() == [0, 0, 2]


@pytest.mark.parametrize(
    "why", ["together", "looks", "height", "kind", "far", "unsure", "sharp", "back"]
)
def test_what_may_be_two_things_stays_two(why: str) -> None:
    ekf, catalogue = twice(0.3 if why == "far" else 0.08, 0.002 if why == "sharp" else 0.05)
    older, younger = catalogue.entries[:2]
    if why == "together":
        older.last_seen_ns = round(10e9)
    elif why == "looks":
        younger.bits = [-younger.bits[0]]
    elif why == "height":
        younger.height_m = 0.6
    elif why == "kind":
        younger.kind = 1
    elif why == "unsure":
        younger.sightings = 3
    elif why == "back":
        younger.along = -older.along
    before = ekf.P.copy()
    assert not merge_doubles(ekf, catalogue, CONFIG).any()
    assert np.array_equal(ekf.P, before)
