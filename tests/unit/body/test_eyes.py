"""One contract for all eyes of the simulated robot."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.body.eyes import DrawnEyes, RenderedEyes
from robot.body.sources import open_perception
from robot.config import Config
from robot.geometry.se2 import SE2
from robot.sim.drawn import DrawnSight
from robot.sim.render_process import RenderProcess
from robot.sim.scene import load_scene

CONFIG = Config()
NS = 1_000_000_000


def drawn(seed):
    return DrawnEyes(DrawnSight(load_scene("flat"), CONFIG, seed))


def rendered(seed):
    cv2.setNumThreads(1)
    camera = CONFIG.camera.stereo_camera()
    return RenderedEyes(RenderProcess("flat", camera, CONFIG.sim, seed), open_perception(CONFIG))


def look_around(eyes, steps):
    """Sights while turning in the middle of the living room, two asked for before one is read."""
    start = load_scene("flat").start @ SE2(-0.8, 0.0, 0.0)
    poses = [start @ SE2(0.0, 0.0, 0.05 * k) for k in range(steps)]
    sights = []
    for k, pose in enumerate(poses):
        eyes.expose(k * NS // 10, k * NS // 10 + 5, k, pose, 0.05)
        if k:
            sights.append(eyes.seen()[1])
    sights.append(eyes.seen()[1])
    eyes.close()
    return poses, sights


@pytest.mark.parametrize("make", [drawn, rendered])
def test_sights_come_in_order_are_repeatable_and_agree_with_the_world(make):
    poses, sights = look_around(make(3), 12)
    assert [s.seq for s in sights] == list(range(12))
    assert all(s.t_ns == k * NS // 10 and s.arrived_ns == s.t_ns + 5 for k, s in enumerate(sights))
    _, again = look_around(make(3), 12)
    for a, b in zip(sights, again, strict=True):
        np.testing.assert_array_equal(a.scan.range_m, b.scan.range_m)
        assert [m.range_m for m in a.landmarks] == [m.range_m for m in b.landmarks]
    _, other = look_around(make(4), 12)
    assert not np.array_equal(sights[-1].scan.range_m, other[-1].scan.range_m, equal_nan=True)
    assert len(sights[-1].landmarks) >= 5
    step = sights[-1].motion.previous_from_current
    true = poses[-2].inverse() @ poses[-1]
    assert step.distance_m(true) < 0.03 and abs(step.yaw_rad - true.yaw_rad) < 0.02


def test_the_drawn_scan_lies_on_the_outlines_and_landmarks_stay_in_place():
    poses, sights = look_around(drawn(5), 30)
    occupied, x0, y0 = load_scene("flat").occupancy(0.01)
    far = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, 5) * 0.01
    off, places = [], {}
    for pose, seen in zip(poses, sights, strict=True):
        near = seen.scan.range_m < 1.5
        r, b = seen.scan.range_m[near], seen.scan.bearing_rad[near]
        at = pose.apply(np.stack([r * np.cos(b), r * np.sin(b)], axis=-1))
        off += far[
            ((at[:, 1] - y0) / 0.01).astype(int), ((at[:, 0] - x0) / 0.01).astype(int)
        ].tolist()
        assert np.all(seen.scan.clear_m[near] <= r + 1e-9)
        for mark in seen.landmarks:
            c, s = np.cos(mark.bearing_rad), np.sin(mark.bearing_rad)
            at = pose.apply(np.array([[mark.range_m * c, mark.range_m * s]]))[0]
            places.setdefault(mark.track_id, []).append((at, mark.range_m))
    assert np.median(off) < 0.03
    followed = [track for track in places.values() if len(track) >= 8]
    assert len(followed) >= 5
    for track in followed:
        spread = np.std([at for at, _ in track], axis=0)
        assert np.hypot(*spread) < 0.02 + 0.03 * max(r for _, r in track) ** 2
