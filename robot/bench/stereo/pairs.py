"""Finds stereo pairs with true disparity under a folder and brings them to 320x240, or not.

Layouts: Middlebury and ETH3D (`im0.png im1.png disp0.pfm|disp0GT.pfm`, optional `mask0nocc.png`),
KITTI 2015 (`training/image_2 image_3 disp_noc_0`, optional `disp_occ_0`) and KITTI 2012
(`training/image_0|colored_0 image_1|colored_1 disp_noc`, optional `disp_occ`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robot.errors import DataError

WIDTH_PX, HEIGHT_PX = 320, 240
VISIBLE = 255  # value of mask0nocc.png where the right eye sees the point too


@dataclass(frozen=True, slots=True, eq=False)
class TruePair:
    """Grey uint8 images (h, w), truth float32 px (NaN unknown), `visible` bool, all of one size."""

    name: str
    family: str
    left: np.ndarray
    right: np.ndarray
    truth_px: np.ndarray
    visible: np.ndarray


def read_pfm(path: Path) -> np.ndarray:
    """A one-channel PFM as float32 (h, w), first row on top; DataError if it is something else."""
    data = path.read_bytes()
    parts = data.split(None, 4)
    try:
        if parts[0] != b"Pf":
            raise ValueError
        width, height, scale = int(parts[1]), int(parts[2]), float(parts[3])
        kind = np.dtype("<f4" if scale < 0 else ">f4")
        values = np.frombuffer(data[len(data) - width * height * 4 :], kind)
        return values.reshape(height, width)[::-1].astype(np.float32)
    except (ValueError, IndexError):
        raise DataError(f"{path} is no grey PFM file; get it again from its data set.") from None


def _grey(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise DataError(f"{path} is missing or no picture; get it again from its data set.")
    return image


def _kitti_truth(path: Path) -> np.ndarray:
    """16-bit PNG in 1/256 px, 0 unknown."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16:
        raise DataError(f"{path} is no 16-bit disparity; get it again from KITTI.")
    return np.where(image > 0, image.astype(np.float32) / 256, np.float32(np.nan))


def _window(height: int, width: int) -> tuple[slice, slice]:
    """The central part of an image that is four by three."""
    if width * 3 > height * 4:
        wide = round(height * 4 / 3)
        return slice(0, height), slice((width - wide) // 2, (width - wide) // 2 + wide)
    high = round(width * 3 / 4)
    return slice((height - high) // 2, (height - high) // 2 + high), slice(0, width)


Bring = Callable[[str, str, np.ndarray, np.ndarray, np.ndarray, np.ndarray], TruePair]


def as_it_is(
    name: str, family: str, left: np.ndarray, right: np.ndarray, truth: np.ndarray,
    visible: np.ndarray,
) -> TruePair:  # fmt: skip
    """The pair at its own size."""
    if not left.shape == right.shape == truth.shape == visible.shape:
        raise DataError(f"the files of pair {name} differ in size; get them again.")
    return TruePair(name, family, left, right, truth.astype(np.float32), visible)


def to_protocol(
    name: str, family: str, left: np.ndarray, right: np.ndarray, truth: np.ndarray,
    visible: np.ndarray,
) -> TruePair:  # fmt: skip
    """Centre-crop to 4:3, area-resize the images, take the truth by nearest and scale it."""
    as_it_is(name, family, left, right, truth, visible)
    rows, columns = _window(*left.shape)
    width = columns.stop - columns.start
    size = (WIDTH_PX, HEIGHT_PX)
    small = [
        cv2.resize(np.ascontiguousarray(i[rows, columns]), size, interpolation=cv2.INTER_AREA)
        for i in (left, right)
    ]
    y = ((np.arange(HEIGHT_PX) + 0.5) * (rows.stop - rows.start) / HEIGHT_PX).astype(int)
    x = ((np.arange(WIDTH_PX) + 0.5) * width / WIDTH_PX).astype(int)
    pick = np.ix_(y + rows.start, x + columns.start)
    scaled = (truth[pick] * np.float32(WIDTH_PX / width)).astype(np.float32)
    return TruePair(name, family, small[0], small[1], scaled, visible[pick])


def _folder_pair(folder: Path, bring: Bring) -> TruePair:
    """One Middlebury or ETH3D folder; ETH3D if its path says so."""
    truth_path = folder / "disp0.pfm"
    if not truth_path.exists():
        truth_path = folder / "disp0GT.pfm"
    truth = read_pfm(truth_path)
    truth = np.where(np.isfinite(truth), truth, np.float32(np.nan))
    visible = np.isfinite(truth)
    if (folder / "mask0nocc.png").exists():
        visible = _grey(folder / "mask0nocc.png") == VISIBLE
    family = "eth3d" if "eth3d" in str(folder).lower() else "middlebury"
    left, right = _grey(folder / "im0.png"), _grey(folder / "im1.png")
    return bring(folder.name, family, left, right, truth, visible)


KITTI_LAYOUTS = (
    ("kitti2015", "image_2", "image_3", "disp_noc_0", "disp_occ_0"),
    ("kitti2012", "colored_0", "colored_1", "disp_noc", "disp_occ"),
    ("kitti2012", "image_0", "image_1", "disp_noc", "disp_occ"),
)


def _kitti_pairs(training: Path, bring: Bring) -> Iterator[TruePair]:
    for family, first, second, visible_only, everything in KITTI_LAYOUTS:
        if not (training / first).is_dir() or not (training / visible_only).is_dir():
            continue
        for path in sorted((training / visible_only).glob("*.png")):
            seen = _kitti_truth(path)
            whole = training / everything / path.name
            truth = _kitti_truth(whole) if whole.exists() else seen
            left, right = _grey(training / first / path.name), _grey(training / second / path.name)
            name = path.stem.removesuffix("_10")
            yield bring(name, family, left, right, truth, np.isfinite(seen))
        return


def each_pair(folder: Path, bring: Bring = to_protocol) -> Iterator[TruePair]:
    """Every pair under `folder`, one after the other, in a stable order."""
    for path in sorted(folder.rglob("im0.png")):
        if (path.parent / "disp0.pfm").exists() or (path.parent / "disp0GT.pfm").exists():
            yield _folder_pair(path.parent, bring)
    for training in sorted(p for p in [folder, *folder.rglob("*")] if p.is_dir()):
        yield from _kitti_pairs(training, bring)


def find_pairs(folder: Path, bring: Bring = to_protocol) -> list[TruePair]:
    """Every pair under `folder`, in a stable order, at 320x240 or as `bring` makes it.

    Raises DataError if there is none.
    """
    if not folder.is_dir():
        raise DataError(f"{folder} is no folder; give --pairs a folder of stereo pairs.")
    found = list(each_pair(folder, bring))
    if not found:
        raise DataError(
            f"{folder} holds no stereo pair with truth; use Middlebury, ETH3D or KITTI layout."
        )
    return found
