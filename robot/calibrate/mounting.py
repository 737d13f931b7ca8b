"""Where the left eye looks from, found from the floor in front of it.

A plane n . X = h in the camera frame (n down, h the eye's height) has the disparity
(b / h) (n_x (u - cx) + n_y (v - cy) + n_z f) at the pixel (u, v): linear, as in v-disparity
(Labayrade et al., IV 2002). So three numbers are fitted, by RANSAC and then by least squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.errors import CalibrationError
from robot.geometry.stereo import StereoCamera

_TRIES, _SAMPLE = 400, 3
_GATE_PX = 0.7
_MIN_SHARE = 0.15  # of the looked-at pixels
_MAX_TILT_RAD = math.radians(45.0)


@dataclass(frozen=True, slots=True)
class Mounting:
    """Height of the left eye, its pitch (nose down positive) and roll, and how much fits."""

    z_m: float
    pitch_rad: float
    roll_rad: float
    share: float  # of the pixels below the middle that lie on the plane
    sigma_px: float  # of a disparity about the plane


def find_mounting(disparities: list[np.ndarray], camera: StereoCamera, seed: int = 1) -> Mounting:
    """From disparity maps (h, w) of bare floor, NaN where unknown, the robot standing still.

    Raises CalibrationError where no plane like a floor is seen.
    """
    u, v, d = _samples(disparities, camera)
    if len(d) < 200:
        raise CalibrationError(
            "too little of the floor has a disparity; stand the robot on floor with grain, joints "
            "or a spread newspaper, in good light."
        )
    design = np.column_stack([u - camera.cx_px, v - camera.cy_px, np.ones(len(d))])
    best = _ransac(design, d, np.random.default_rng(seed))
    for _ in range(5):
        fits = np.abs(design @ best - d) < _GATE_PX
        best = np.linalg.lstsq(design[fits], d[fits], rcond=None)[0]
    share = float(fits.mean())
    normal = np.array([best[0] * camera.focal_px, best[1] * camera.focal_px, best[2]])
    length = max(float(np.linalg.norm(normal)), 1e-9)
    normal /= length
    pitch_rad = math.atan2(normal[2], normal[1])
    roll_rad = math.asin(float(np.clip(normal[0], -1.0, 1.0)))
    if share < _MIN_SHARE or normal[1] <= 0.0 or abs(pitch_rad) > _MAX_TILT_RAD:
        raise CalibrationError(
            f"no floor in front of the robot ({100 * share:.0f} % of the lower image fit a plane); "
            "clear the floor for two metres and try again."
        )
    return Mounting(
        z_m=camera.baseline_m * camera.focal_px / length,
        pitch_rad=pitch_rad,
        roll_rad=roll_rad,
        share=share,
        sigma_px=float(np.std(design[fits] @ best - d[fits])),
    )


def _samples(
    disparities: list[np.ndarray], camera: StereoCamera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every third pixel of the lower half that has a disparity."""
    rows = np.arange(camera.height_px // 2, camera.height_px, 3)
    columns = np.arange(0, camera.width_px, 3)
    u, v = np.meshgrid(columns, rows)
    parts = []
    for disparity in disparities:
        d = disparity[np.ix_(rows, columns)]
        known = np.isfinite(d) & (d > 1.0)
        parts.append(np.column_stack([u[known], v[known], d[known]]))
    found = np.concatenate(parts) if parts else np.empty((0, 3))
    return found[:, 0], found[:, 1], found[:, 2]


def _ransac(design: np.ndarray, d: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The plane with most pixels; the floor slopes towards the robot, a wall does not."""
    some = rng.choice(len(d), min(len(d), 4000), replace=False)
    best, most = np.zeros(3), -1
    for _ in range(_TRIES):
        pick = rng.choice(len(d), _SAMPLE, replace=False)
        try:
            plane = np.linalg.solve(design[pick], d[pick])
        except np.linalg.LinAlgError:
            continue
        if plane[1] <= 0.02:
            continue
        count = int((np.abs(design[some] @ plane - d[some]) < _GATE_PX).sum())
        if count > most:
            best, most = plane, count
    return best
