"""A drawn recording: a base that slips, turns too little and lags, among things with numbers."""

import math

import numpy as np

from robot.slam.survey import SurveySettings
from robot.slam.survey.velocity import VelocityNoise

SETTINGS = SurveySettings(
    noise=VelocityNoise(0.03, 0.03, 0.05, 0.01),
    range_m=0.02,
    inverse_range_per_m=0.01,
    bearing_rad=0.02,
    correlated_s=0.0,
)
SPEED_SCALE, TURN_SCALE, LAG_S = -0.08, -0.1, 0.2
THINGS = np.array(
    [(x, y) for x in (-1.0, 1.5, 4.0) for y in (-3.5, -1.2, 1.2, 3.5)], dtype=float
) + np.random.default_rng(3).uniform(-0.3, 0.3, (12, 2))


def draw_course(
    seed: int, duration_s: float = 120.0
) -> tuple[np.ndarray, list[tuple[float, np.ndarray, np.ndarray]], np.ndarray]:
    """Orders (n, 3), frames of (t_s, polar (m, 2), names (m,)), truth (k, 4) at the frames."""
    rng = np.random.default_rng(seed)
    step_s, n = 0.05, round(duration_s / 0.05)
    t_s = step_s * np.arange(n)
    turning = np.sin(0.35 * t_s) * 0.5 + 0.15
    orders = np.column_stack([t_s, np.full(n, 0.2), turning])
    pose = np.zeros(3)
    frames, truth = [], []
    late = round(LAG_S / step_s)
    for k in range(n):
        if k % 8 == 0:
            frames.append((float(t_s[k]), *_look(pose, rng)))
            truth.append((t_s[k], *pose))
        _, v, w = orders[k - late] if k >= late else (0.0, 0.0, 0.0)
        v, w = v * (1.0 + SPEED_SCALE), w * (1.0 + TURN_SCALE)
        v += rng.normal(0.0, 0.02 * math.sqrt(abs(v) / step_s))
        w += rng.normal(0.0, 0.03 * math.sqrt(abs(w) / step_s))
        yaw = pose[2] + 0.5 * w * step_s
        pose = pose + (v * step_s * math.cos(yaw), v * step_s * math.sin(yaw), w * step_s)
    return orders, frames, np.array(truth)


def _look(pose: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    away = THINGS - pose[:2]
    range_m = np.hypot(*away.T)
    bearing = np.arctan2(away[:, 1], away[:, 0]) - pose[2]
    bearing = (bearing + math.pi) % (2 * math.pi) - math.pi
    seen = np.flatnonzero((range_m < 5.0) & (np.abs(bearing) < 0.9))
    inverse = 1.0 / range_m[seen] + rng.normal(0.0, 0.008, len(seen))
    polar = np.column_stack([1.0 / inverse, bearing[seen] + rng.normal(0.0, 0.015, len(seen))])
    return polar, seen + 6
