"""A home as the bytes of one file: a NumPy archive, every member with its own checksum.

Arrays are stored as they are; what is no array stands as JSON text in the member `about`. The
covariance is symmetric, so only its upper half is stored.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import fields
from typing import Any

import numpy as np

from robot.errors import MapError
from robot.geometry.se2 import SE2
from robot.home import Home
from robot.mapping.grid import GridMemory
from robot.mapping.notes import MapNotes
from robot.mission.settings import Settings
from robot.slam.memory import SlamMemory
from robot.slam.places import SIGNATURE_BYTES, PlacePoints

FORMAT = 1
_MAX_BYTES = 64_000_000
_MAX_CELLS = 4000  # along one side: 200 m
_SLAM = ("state", "kind", "height_m", "sightings", "visits", "along", "signature", "signature_of")
_GRID = ("log_odds", "sticky", "behind_m", "driven", "lost_pct")
_DTYPE: dict[str, type] = {
    "slam.state": np.float64, "slam.cov": np.float64, "slam.kind": np.uint8,
    "slam.height_m": np.float64, "slam.sightings": np.int32, "slam.visits": np.int32,
    "slam.along": np.float64, "slam.signature": np.uint8, "slam.signature_of": np.int32,
    "places.xy_m": np.float64, "places.height_m": np.float64, "places.signature": np.uint8,
    "places.kind": np.uint8, "places.sightings": np.int32,
    "grid.log_odds": np.float32, "grid.sticky": np.uint8, "grid.behind_m": np.float32,
    "grid.driven": np.bool_, "grid.lost_pct": np.uint8,
}  # fmt: skip


def encode_home(home: Home) -> bytes:
    """The bytes of a home's file."""
    slam, grid = home.slam, home.grid
    arrays = {f"slam.{name}": getattr(slam, name) for name in _SLAM}
    arrays["slam.cov"] = slam.cov[np.triu_indices(len(slam.cov))]
    arrays |= {f"places.{f.name}": getattr(slam.places, f.name) for f in fields(PlacePoints)}
    arrays |= {f"grid.{name}": getattr(grid, name) for name in _GRID}
    about = {
        "format": FORMAT,
        "marker_known": slam.marker_known,
        "resolution_m": grid.resolution_m,
        "corner": [grid.ix0, grid.iy0],
        "world_from_docked": _plain(home.world_from_docked),
        "docked_from_marker": _plain(home.docked_from_marker),
        "notes": home.notes,
        "settings": home.settings,
    }
    file = io.BytesIO()
    members: dict[str, Any] = {n: np.asarray(array, _DTYPE[n]) for n, array in arrays.items()}
    members["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    np.savez_compressed(file, **members)
    return file.getvalue()


def decode_home(data: bytes, name: str) -> Home:
    """The home in a file's bytes. Raises MapError, naming the file, for anything else."""
    remedy = "restore a copy of it, or move it away to begin with an empty map"
    if len(data) > _MAX_BYTES:
        raise MapError(f"{name}: is too large for a map of a home; {remedy}.")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in (*_DTYPE, "about") if key in archive}
        _complete(arrays)
        about = json.loads(arrays.pop("about").tobytes())
        if about["format"] != FORMAT:
            raise MapError(
                f"{name}: has format {about['format']}, this version reads {FORMAT}; use the "
                "version of Sweeper that wrote it, or move it away to begin with an empty map."
            )
        return _home(arrays, about, name)
    except MapError:
        raise
    except (
        OSError, ValueError, KeyError, TypeError, IndexError, EOFError, OverflowError,
        MemoryError, NotImplementedError, zipfile.BadZipFile, zlib.error,
    ):  # fmt: skip
        raise MapError(f"{name}: is damaged or no map of a home; {remedy}.") from None


def _complete(arrays: dict[str, np.ndarray]) -> None:
    """Add what older files do not hold."""
    cells = arrays["grid.log_odds"].shape
    if arrays["grid.sticky"].dtype == bool:  # older files do not tell edges from touches
        arrays["grid.sticky"] = arrays["grid.sticky"].astype(np.uint8)
    arrays.setdefault("grid.behind_m", np.full(cells, np.nan, np.float32))
    arrays.setdefault("grid.driven", np.zeros(cells, bool))
    arrays.setdefault("grid.lost_pct", np.zeros(cells, np.uint8))
    arrays.setdefault("slam.along", np.full((len(arrays["slam.kind"]), 2), np.nan))


def _home(arrays: dict[str, np.ndarray], about: dict[str, Any], name: str) -> Home:
    if any(arrays[key].dtype != kind for key, kind in _DTYPE.items()):
        raise ValueError("wrong type of numbers")
    n, m, k = (len(arrays[f"slam.{key}"]) for key in ("state", "kind", "signature"))
    p = len(arrays["places.height_m"])
    shapes = {
        "slam.state": (n,), "slam.kind": (m,), "slam.height_m": (m,), "slam.sightings": (m,),
        "slam.visits": (m,), "slam.along": (m, 2), "slam.signature": (k, SIGNATURE_BYTES),
        "slam.signature_of": (k,), "slam.cov": (n * (n + 1) // 2,), "places.xy_m": (p, 2),
        "places.height_m": (p,), "places.signature": (p, SIGNATURE_BYTES),
        "places.kind": (p,), "places.sightings": (p,),
        "grid.sticky": arrays["grid.log_odds"].shape,
        "grid.behind_m": arrays["grid.log_odds"].shape,
        "grid.driven": arrays["grid.log_odds"].shape,
        "grid.lost_pct": arrays["grid.log_odds"].shape,
    }  # fmt: skip
    if any(arrays[key].shape != shape for key, shape in shapes.items()) or n < 10 or n % 2:
        raise ValueError("wrong shape")
    numbers = [arrays[key] for key in ("slam.state", "slam.cov", "places.xy_m", "grid.log_odds")]
    if not all(np.isfinite(array).all() for array in numbers) or max(n - 10, 0) != 2 * m:
        raise ValueError("numbers that make no sense")
    of, (ix0, iy0) = arrays["slam.signature_of"], (int(v) for v in about["corner"])
    if (k and (of.min() < 0 or of.max() >= m)) or len(set(of.tolist())) != m:
        raise ValueError("signatures of no landmark")
    shape = arrays["grid.log_odds"].shape
    if len(shape) != 2 or max(*shape, abs(ix0), abs(iy0)) > _MAX_CELLS:
        raise ValueError("no grid")
    MapNotes.from_dict(about["notes"], name)
    settings = about.get("settings", {})  # older files hold none
    Settings.from_dict(settings, name)
    return Home(
        slam=SlamMemory(
            cov=_symmetric(arrays["slam.cov"], n),
            marker_known=bool(about["marker_known"]),
            places=PlacePoints(*(arrays[f"places.{f.name}"] for f in fields(PlacePoints))),
            **{key: arrays[f"slam.{key}"] for key in _SLAM},
        ),
        grid=GridMemory(
            float(about["resolution_m"]), ix0, iy0, *(arrays[f"grid.{name}"] for name in _GRID)
        ),
        world_from_docked=_pose(about["world_from_docked"]),
        docked_from_marker=_pose(about["docked_from_marker"]) or SE2(),
        notes=about["notes"],
        settings=settings,
    )


def _symmetric(upper: np.ndarray, n: int) -> np.ndarray:
    """The covariance (n, n) of its upper half. Raises ValueError unless it is one."""
    cov = np.zeros((n, n))
    cov[np.triu_indices(n)] = upper
    cov += np.triu(cov, 1).T
    np.linalg.cholesky(cov)  # raises LinAlgError, a ValueError
    return cov


def _plain(pose: SE2 | None) -> list[float] | None:
    return None if pose is None else [pose.x_m, pose.y_m, pose.yaw_rad]


def _pose(plain: list[float] | None) -> SE2 | None:
    if plain is None:
        return None
    x_m, y_m, yaw_rad = (float(value) for value in plain)
    if not np.isfinite([x_m, y_m, yaw_rad]).all():
        raise ValueError("a pose that is none")
    return SE2(x_m, y_m, yaw_rad)
