"""The planner's bench: reachable floor by hand, a room swept, and maps that cannot be used."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from robot.bench.coverage import bench_coverage, reachable
from robot.config import Config
from robot.errors import MapError
from robot.mapping.map_server import grid_to_map_server
from robot.messages import Grid

CONFIG = Config()


def room(width_m=3.0, height_m=2.0, pillar=False):
    """A closed room, its free floor `width_m` x `height_m`, in cells of 5 cm."""
    cells = np.full((round(height_m / 0.05) + 2, round(width_m / 0.05) + 2), 100, np.int8)
    cells[1:-1, 1:-1] = 0
    if pillar:
        cells[18:22, 28:32] = 100
    return Grid(0.05, -1.0, 2.0, cells)


def save(folder, name, grid):
    pgm, text = grid_to_map_server(grid, f"{name}.pgm")
    (folder / f"{name}.pgm").write_bytes(pgm)
    (folder / f"{name}.yaml").write_text(text)


def test_reachable_floor_of_an_empty_room_is_what_the_brush_can_touch():
    floor = reachable(room(), CONFIG.robot)
    edge_m = CONFIG.robot.radius_m - CONFIG.robot.brush_width_m / 2.0
    corners_m2 = (4.0 - math.pi) * (CONFIG.robot.brush_width_m / 2.0) ** 2
    expected_m2 = (3.0 - 2 * edge_m) * (2.0 - 2 * edge_m) - corners_m2
    area_m2 = np.count_nonzero(floor.floor) * floor.resolution_m**2
    assert area_m2 == pytest.approx(expected_m2, rel=0.03)


def test_a_room_is_swept_whole_and_a_picture_is_drawn(tmp_path):
    save(tmp_path, "empty", room())
    save(tmp_path, "pillar", room(pillar=True))
    result = bench_coverage([tmp_path], CONFIG, tmp_path / "out")
    assert [row["name"] for row in result["maps"]] == ["empty", "pillar"]
    for row in result["maps"]:
        assert row["covered_pct"] >= 98.0
        assert 1.0 < row["path_ratio"] < 1.6
        assert row["path_m"] == pytest.approx(
            row["path_ratio"] * row["reachable_m2"] / CONFIG.robot.brush_width_m, rel=0.01
        )
    assert result["mean"]["covered_pct"] >= 98.0
    picture = cv2.imread(str(tmp_path / "out" / "pillar.png"))
    assert picture is not None and len(np.unique(picture.reshape(-1, 3), axis=0)) > 4


def test_maps_that_cannot_be_used_are_named(tmp_path):
    with pytest.raises(MapError, match="holds no map"):
        bench_coverage([tmp_path], CONFIG, tmp_path)
    (tmp_path / "lost.yaml").write_text("image: lost.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    with pytest.raises(MapError, match=r"lost\.pgm"):
        bench_coverage([tmp_path / "lost.yaml"], CONFIG, tmp_path)
    save(tmp_path, "narrow", room(width_m=0.3))
    with pytest.raises(MapError, match=r"narrow\.yaml.*fits nowhere"):
        bench_coverage([tmp_path / "narrow.yaml"], CONFIG, tmp_path)
