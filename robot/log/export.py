"""Logs and tracks in the formats of others."""

from __future__ import annotations

import math

import numpy as np

from robot.errors import LogError


def write_tum(track: np.ndarray) -> str:
    """Text in the TUM trajectory format of a track (n, 4) of t_s, x_m, y_m, yaw_rad.

    One line a pose: time, position, quaternion (x y z w); read by evo and rpg_trajectory_evaluation
    (Sturm et al., IROS 2012).
    """
    rows = (
        f"{t:.9f} {x:.6f} {y:.6f} 0 0 0 {math.sin(0.5 * yaw):.9f} {math.cos(0.5 * yaw):.9f}"
        for t, x, y, yaw in track.tolist()
    )
    return "".join(f"{row}\n" for row in ("# t_s x_m y_m z_m qx qy qz qw", *rows))


def read_tum(text: str, name: str = "trajectory.tum") -> np.ndarray:
    """A planar track (n, 4) of t_s, x_m, y_m, yaw_rad from TUM text; yaw about z.

    Raises LogError, naming the line, for anything but eight finite numbers.
    """
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            t, x, y, _, qx, qy, qz, qw = (float(word) for word in line.split())
            row = (t, x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)))
        except ValueError:
            row = (math.nan,) * 4
        if not all(map(math.isfinite, row)):
            raise LogError(
                f"{name}, line {number}: not a TUM pose; give eight numbers, t x y z qx qy qz qw."
            )
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, 4)
