"""ROS map_server files: a grey PGM picture and a YAML text, to and from a `Grid`.

The picture's first row is the farthest in y; `origin` is the outer corner of its lower left pixel.
Grey means p = (255 - value) / 255 (or value / 255 with `negate`): occupied above
`occupied_thresh`, free below `free_thresh`, unknown between (ROS map_server, "trinary"). Grey 205
is what map savers write for unknown; it stays unknown although it lies below the free_thresh of
0.25 that newer ones write beside it.
Pure: bytes and text in, bytes and text out.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from robot.errors import MapError
from robot.messages import Grid

_OCCUPIED_GREY, _FREE_GREY, _UNKNOWN_GREY = 0, 254, 205
_MAX_CELLS = 100_000_000
_HEADER = re.compile(
    rb"P5(?:\s+#[^\n]*\n|\s)+(\d+)(?:\s+#[^\n]*\n|\s)+(\d+)(?:\s+#[^\n]*\n|\s)+(\d+)\s"
)


@dataclass(frozen=True, slots=True)
class MapInfo:
    """What the YAML text says."""

    image: str
    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    negate: bool
    occupied_thresh: float
    free_thresh: float


def grid_to_map_server(grid: Grid, image_name: str = "map.pgm") -> tuple[bytes, str]:
    """(PGM bytes, YAML text); the text names the picture `image_name`."""
    grey = np.full(grid.cells.shape, _UNKNOWN_GREY, np.uint8)
    grey[(grid.cells >= 0) & (grid.cells < 50)] = _FREE_GREY
    grey[grid.cells >= 50] = _OCCUPIED_GREY
    rows, columns = grid.cells.shape
    pgm = f"P5\n{columns} {rows}\n255\n".encode() + np.ascontiguousarray(grey[::-1]).tobytes()
    text = (
        f"image: {image_name}\n"
        f"resolution: {float(grid.resolution_m)!r}\n"
        f"origin: [{float(grid.origin_x_m)!r}, {float(grid.origin_y_m)!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
    )
    return pgm, text


def grid_from_map_server(pgm: bytes, yaml_text: str, name: str = "map.yaml") -> Grid:
    """The grid of a picture and its text. Raises MapError, naming `name` and what is wrong."""
    info = parse_map_info(yaml_text, name)
    grey = _grey(pgm, f"{name}: {info.image}").astype(np.float64)
    occupancy = grey / 255.0 if info.negate else (255.0 - grey) / 255.0
    cells = np.full(grey.shape, -1, np.int8)
    cells[occupancy < info.free_thresh] = 0
    cells[occupancy > info.occupied_thresh] = 100
    if not info.negate:
        cells[grey == _UNKNOWN_GREY] = -1
    return Grid(
        info.resolution_m, info.origin_x_m, info.origin_y_m, np.ascontiguousarray(cells[::-1])
    )


def parse_map_info(yaml_text: str, name: str = "map.yaml") -> MapInfo:
    """Read the YAML text. Raises MapError."""
    import yaml

    try:
        table = yaml.safe_load(yaml_text)
    except yaml.YAMLError as error:
        where = " ".join(str(error).split())
        raise MapError(f"{name}: not valid YAML ({where}); correct that line.") from None
    if not isinstance(table, dict):
        raise MapError(f"{name}: no keys found; give the YAML text that map_server wrote.")
    mode = table.get("mode", "trinary")
    if mode not in ("trinary", "scale"):
        raise MapError(f"{name}: mode {mode!r} is not supported; save the map as trinary.")
    origin = table.get("origin")
    if not isinstance(origin, list) or len(origin) not in (2, 3):
        raise MapError(f"{name}: origin must be a list [x, y, yaw]; correct it.")
    x_m, y_m, yaw = (_number(v, name, "origin") for v in [*origin, 0.0][:3])
    if abs(yaw) > 1e-6:
        raise MapError(f"{name}: origin is turned by {yaw} rad; save the map with yaw 0.")
    resolution_m = _number(table.get("resolution"), name, "resolution")
    if not 0.001 <= resolution_m <= 1.0:
        raise MapError(
            f"{name}: resolution {resolution_m} m is not between 0.001 and 1; correct it."
        )
    high = _number(table.get("occupied_thresh", 0.65), name, "occupied_thresh")
    low = _number(table.get("free_thresh", 0.196), name, "free_thresh")
    if not 0.0 <= low < high <= 1.0:
        raise MapError(
            f"{name}: free_thresh {low} and occupied_thresh {high} must satisfy "
            "0 <= free_thresh < occupied_thresh <= 1; correct them."
        )
    image = table.get("image")
    if not isinstance(image, str) or not image:
        raise MapError(f"{name}: image is missing; name the PGM file there.")
    negate = bool(_number(table.get("negate", 0), name, "negate"))
    return MapInfo(image, resolution_m, x_m, y_m, negate, high, low)


def _number(value: object, name: str, key: str) -> float:
    if isinstance(value, (int, float)) and math.isfinite(value):
        return float(value)
    raise MapError(f"{name}: {key} must be a number, not {value!r}; correct it.")


def _grey(pgm: bytes, name: str) -> np.ndarray:
    """The picture (rows, columns), uint8, first row at the top."""
    match = _HEADER.match(pgm)
    if match is None:
        raise MapError(f"{name}: not a binary PGM picture (P5); convert it to one.")
    columns, rows, top = (int(group[:12]) for group in match.groups())
    if top != 255:
        raise MapError(f"{name}: the brightest value is {top}, not 255; save it with 8 bits.")
    if not 0 < columns * rows <= _MAX_CELLS:
        raise MapError(f"{name}: impossible size {columns} x {rows}; save the map again.")
    pixels = pgm[match.end() : match.end() + columns * rows]
    if len(pixels) < columns * rows:
        raise MapError(
            f"{name}: only {len(pixels)} of {columns * rows} pixels are there; copy the file again."
        )
    return np.frombuffer(pixels, np.uint8).reshape(rows, columns)
