"""Two cameras from pictures of a board: intrinsics, distortion, and where the eyes stand.

Zhang's method as OpenCV implements it: each eye alone first, then both together. Views that do
not fit are left out once. What is reported is measured after rectification, where a corner must
lie on the same row in both eyes, and also on views that the calibration has not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.calibrate.board import Board, Found
from robot.errors import CalibrationError
from robot.perception.calibration import Eye, StereoCalibration, check_calibration

MIN_VIEWS = 8
MAX_RMS_PX, MAX_EPIPOLAR_PX = 0.5, 0.3
_OUTLIER = 3.0  # times the median error of a view
_FOLDS = 4


@dataclass(frozen=True, slots=True)
class View:
    """One pair of pictures, and the board in each eye."""

    name: str
    left: Found
    right: Found

    def common(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers (n,) of corners that both eyes see, and their pixels (n, 2) in each."""
        ids, left, right = np.intersect1d(self.left.ids, self.right.ids, return_indices=True)
        return ids, self.left.pixel[left], self.right.pixel[right]


@dataclass(frozen=True, slots=True, eq=False)
class StereoResult:
    """The calibration and how good it is, in pixels of the calibrated size."""

    calibration: StereoCalibration
    rms_px: float  # reprojection error of all corners
    epipolar_px: float  # mean distance of matching corners' rows after rectification
    epipolar_worst_view_px: float
    unseen_epipolar_px: float  # the same, on views left out of the calibration in turn
    views: int
    left_out: tuple[str, ...]

    def refuse_above(self, max_rms_px: float, max_epipolar_px: float) -> None:
        """Raise CalibrationError when it is not good enough to drive with."""
        worst = max(self.epipolar_px, self.unseen_epipolar_px)
        if self.rms_px > max_rms_px or worst > max_epipolar_px:
            raise CalibrationError(
                f"the calibration is poor: RMS {self.rms_px:.2f} px (limit {max_rms_px:g}), rows "
                f"off by {worst:.2f} px (limit {max_epipolar_px:g}); take more pictures of a flat "
                "board, still and sharp, near and far, tilted, up to the corners of the image."
            )


def calibrate_stereo(views: list[View], board: Board, size_px: tuple[int, int]) -> StereoResult:
    """Calibrate from views of `size_px` (width, height).

    Raises CalibrationError for too few views, or a result that is impossible.
    """
    views = [view for view in views if len(view.common()[0]) >= 8]
    _demand(len(views))
    calibration, rms, per_view = _solve(views, board, size_px)
    keep = per_view <= _OUTLIER * np.median(per_view)
    left_out = tuple(view.name for view, kept in zip(views, keep, strict=True) if not kept)
    if left_out and len(views) - len(left_out) >= MIN_VIEWS:
        views = [view for view, kept in zip(views, keep, strict=True) if kept]
        calibration, rms, _ = _solve(views, board, size_px)
    else:
        left_out = ()
    rows = [row_errors_px(calibration, view) for view in views]
    return StereoResult(
        calibration=check_calibration(calibration),
        rms_px=rms,
        epipolar_px=float(np.concatenate(rows).mean()),
        epipolar_worst_view_px=max(float(r.mean()) for r in rows),
        unseen_epipolar_px=_unseen(views, board, size_px),
        views=len(views),
        left_out=left_out,
    )


def row_errors_px(calibration: StereoCalibration, view: View) -> np.ndarray:
    """How far matching corners' rows are apart (n,) after rectification to the same size."""
    left, right = calibration.left, calibration.right
    pose = calibration.right_from_left
    r_left, r_right, p_left, p_right, *_ = cv2.stereoRectify(
        left.matrix, left.distortion, right.matrix, right.distortion,
        (left.width_px, left.height_px), pose[:3, :3], pose[:3, 3:4],
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0,
    )  # fmt: skip
    _, in_left, in_right = view.common()
    rows = [
        cv2.undistortPoints(
            pixel.reshape(-1, 1, 2).astype(np.float64), eye.matrix, eye.distortion, R=r, P=p
        )[:, 0, 1]
        for pixel, eye, r, p in (
            (in_left, left, r_left, p_left),
            (in_right, right, r_right, p_right),
        )
    ]
    return np.abs(rows[0] - rows[1])


def _demand(count: int) -> None:
    if count < MIN_VIEWS:
        raise CalibrationError(
            f"the board was found by both eyes in {count} pairs where {MIN_VIEWS} are needed; "
            "check --board, and take more pictures with the whole board in both eyes."
        )


def _solve(
    views: list[View], board: Board, size_px: tuple[int, int]
) -> tuple[StereoCalibration, float, np.ndarray]:
    """Calibration, RMS and each view's error (n,) in pixels."""
    alone = [_one_eye([v.left for v in views], board, size_px),
             _one_eye([v.right for v in views], board, size_px)]  # fmt: skip
    common = [view.common() for view in views]
    solved = cv2.stereoCalibrateExtended(
        [board.points_m(ids) for ids, _, _ in common],
        [left for _, left, _ in common],
        [right for _, _, right in common],
        *alone[0], *alone[1], size_px, np.eye(3), np.zeros((3, 1)),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS,
    )  # fmt: skip
    rms, k_left, d_left, k_right, d_right, rotation, translation = solved[:7]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation.ravel()
    eyes = [Eye(*size_px, k, d.ravel()[:5]) for k, d in ((k_left, d_left), (k_right, d_right))]
    errors = np.asarray(solved[-1]).reshape(len(views), -1).max(axis=1)
    return StereoCalibration(eyes[0], eyes[1], pose), float(rms), errors


def _one_eye(
    found: list[Found], board: Board, size_px: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    points = [board.points_m(f.ids) for f in found]
    solved = cv2.calibrateCamera(points, [f.pixel for f in found], size_px, None, None)
    return solved[1], solved[2]


def _unseen(views: list[View], board: Board, size_px: tuple[int, int]) -> float:
    """Mean row error of each view under a calibration from the other folds."""
    errors = []
    for fold in range(_FOLDS):
        others = [view for k, view in enumerate(views) if k % _FOLDS != fold]
        calibration, _, _ = _solve(others, board, size_px)
        errors += [row_errors_px(calibration, view) for view in views[fold::_FOLDS]]
    return float(np.concatenate(errors).mean())
