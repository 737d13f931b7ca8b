"""The scan against what really stands in the flat."""

import math

import numpy as np
import pytest
from perception_views import CAMERA, DRIVE, flat, perception, view

from robot.config import PerceptionConfig
from robot.geometry.se2 import SE2
from robot.messages import Scan
from robot.perception.floor import Floor
from robot.perception.scan import ScanMaker

PERCEPTION = PerceptionConfig()


def true_ranges(pose: SE2, bearing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest and farthest thing seen from the eye around each bearing of `base`, NaN if none."""
    eye_m = CAMERA.base_from_cam[:2, 3]
    eye = pose @ SE2(*eye_m)
    segments = flat().segments()
    start, along = segments[:, :2] - [eye.x_m, eye.y_m], segments[:, 2:] - segments[:, :2]
    angle = np.linspace(-0.62, 0.62, 480)
    dx, dy = np.cos(angle + pose.yaw_rad)[:, None], np.sin(angle + pose.yaw_rad)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        det = dx * along[:, 1] - dy * along[:, 0]
        t = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / det
        s = (start[:, 0] * dy - start[:, 1] * dx) / det
    t = np.where((t > 0) & (s >= 0) & (s <= 1), t, np.inf).min(axis=1)
    x, y = eye_m[0] + t * np.cos(angle), eye_m[1] + t * np.sin(angle)
    seen, range_m = np.arctan2(y, x), np.hypot(x, y)
    step = bearing[1] - bearing[0]
    near = np.abs(seen[None] - bearing[:, None]) < 2.0 * step
    low = np.where(near, range_m, np.inf).min(axis=1)
    high = np.where(near, range_m, -np.inf).max(axis=1)
    return np.where(near.any(axis=1), low, np.nan), np.where(near.any(axis=1), high, np.nan)


def tolerance_m(range_m: np.ndarray) -> np.ndarray:
    return 0.05 + 0.04 * np.minimum(range_m, 3.0) ** 1.5


@pytest.mark.parametrize("matcher, found, wrong", [("given", 0.85, 0.0), ("sgbm", 0.8, 0.02)])
def test_obstacles_are_where_they_stand(matcher: str, found: float, wrong: float) -> None:
    chain = perception(matcher=matcher)
    hits, misses, phantoms, through, rays = 0, 0, 0, 0, 0
    for seq, pose in enumerate(DRIVE[::3]):
        frame, truth_px = view(3 * seq, pose)
        scan = chain.see(frame, frame.t_ns, given=truth_px).scan
        low, high = true_ranges(pose, scan.bearing_rad)
        plain = (high - low < 0.1) & (low > 0.4) & (high < 2.5)
        # Beside the left edge the right eye sees nothing of what is near.
        plain[-12:] = False
        with np.errstate(invalid="ignore"):
            good = np.abs(scan.range_m - low) < tolerance_m(low) + (high - low)
            phantom = scan.range_m < np.minimum(low - tolerance_m(low), 1.5)
        hits += int((plain & good).sum())
        misses += int((plain & ~good).sum())
        phantoms += int((phantom & np.isfinite(low)).sum())
        through += int((scan.clear_m > high + tolerance_m(high)).sum())
        rays += int(np.isfinite(low).sum())
    assert rays > 500
    assert hits > found * (hits + misses)
    assert phantoms <= wrong * rays
    assert through <= 0.01 * rays


def test_bearings_ascend_and_free_floor_ends_at_the_obstacle() -> None:
    frame, truth_px = view(0, DRIVE[0])
    scan = perception(matcher="given").see(frame, 0, given=truth_px).scan
    assert scan.bearing_rad.shape == scan.range_m.shape == scan.clear_m.shape == (120,)
    assert np.all(np.diff(scan.bearing_rad) > 0)
    assert not np.any(scan.clear_m > np.nan_to_num(scan.range_m, nan=np.inf))
    assert np.all(scan.clear_m >= 0.0)


def scan_of(disparity_px: np.ndarray) -> Scan:
    floor = Floor(CAMERA)
    return ScanMaker(PERCEPTION, CAMERA).make(disparity_px.astype(np.float32), floor.plane)


def empty_floor() -> np.ndarray:
    """Disparity of an endless floor; NaN above the horizon and where it is too near to match."""
    v = np.arange(CAMERA.height_px) - CAMERA.cy_px
    row = CAMERA.baseline_m / CAMERA.base_from_cam[2, 3] * v
    row = np.where((row > 1.0) & (row < 63.0), row, np.nan)
    return np.repeat(row[:, None], CAMERA.width_px, axis=1)


def with_block(disparity_px: np.ndarray, z_m: float, columns: slice, height_m: float) -> None:
    """Put something upright of a height at a depth in front of the floor."""
    d = CAMERA.focal_px * CAMERA.baseline_m / z_m
    eye_m = CAMERA.base_from_cam[2, 3]
    foot = CAMERA.cy_px + CAMERA.focal_px * eye_m / z_m
    top = CAMERA.cy_px + CAMERA.focal_px * (eye_m - height_m) / z_m
    disparity_px[max(math.ceil(top), 0) : int(foot) + 1, columns] = d


def test_nothing_seen_is_nothing_known() -> None:
    scan = scan_of(np.full((CAMERA.height_px, CAMERA.width_px), np.nan))
    assert np.all(np.isnan(scan.range_m))
    assert np.all(scan.clear_m == 0.0)


def test_empty_floor_is_free_and_holds_no_obstacle() -> None:
    scan = scan_of(empty_floor())
    assert np.all(np.isnan(scan.range_m))
    middle = scan.clear_m[40:80]
    assert middle.min() > 2.0


@pytest.mark.parametrize("z_m", [0.3, 0.8, 1.5, 2.4])
def test_a_block_is_found_at_its_range(z_m: float) -> None:
    disparity = empty_floor()
    with_block(disparity, z_m, slice(140, 180), 0.3)
    scan = scan_of(disparity)
    at = np.argmin(np.abs(scan.bearing_rad - math.atan2(0.03, z_m + 0.13)))
    assert scan.range_m[at] == pytest.approx(math.hypot(z_m + 0.13, 0.03), abs=0.02)
    assert scan.clear_m[at] <= scan.range_m[at]
    assert scan.clear_m[at] > 0.8 * scan.range_m[at]


def test_what_is_flat_or_high_is_no_obstacle() -> None:
    disparity = empty_floor()
    with_block(disparity, 0.8, slice(100, 140), 0.012)  # a rug's edge
    d = CAMERA.focal_px * CAMERA.baseline_m / 1.0
    table = round(CAMERA.cy_px - CAMERA.focal_px * (0.5 - 0.09) / 1.0)
    disparity[max(table - 15, 0) : max(table, 1), 180:220] = d
    assert np.all(np.isnan(scan_of(disparity).range_m))


def test_a_streak_of_wrong_disparity_is_no_obstacle() -> None:
    disparity = empty_floor()
    disparity[150:154, 60:260] = 30.0  # four rows, on a floor of 20 px
    assert np.all(np.isnan(scan_of(disparity).range_m))


def test_floor_behind_a_wide_gap_is_not_free() -> None:
    disparity = empty_floor()
    disparity[140:200] = np.nan  # from 0.26 m to 1.0 m nothing was matched
    clear_m = scan_of(disparity).clear_m
    assert clear_m[50:70].max() < 0.45
    assert clear_m[50:70].min() > 0.2
