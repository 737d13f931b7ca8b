"""map_server files: rows, origin, thresholds, and bad input in one sentence."""

import numpy as np
import pytest

from robot.errors import MapError
from robot.mapping.map_server import grid_from_map_server, grid_to_map_server
from robot.messages import Grid

YAML = """image: map.pgm
resolution: 0.05
origin: [-1.5, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def pgm(rows):
    array = np.array(rows, np.uint8)
    return f"P5\n{array.shape[1]} {array.shape[0]}\n255\n".encode() + array.tobytes()


def test_the_first_row_of_the_picture_is_the_farthest_in_y():
    grid = grid_from_map_server(pgm([[0, 254, 254], [205, 205, 254]]), YAML)
    assert grid.cells.tolist() == [[-1, -1, 0], [100, 0, 0]]
    assert (grid.resolution_m, grid.origin_x_m, grid.origin_y_m) == (0.05, -1.5, 2.0)


def test_written_pictures_follow_the_same_order():
    data, text = grid_to_map_server(
        Grid(0.025, 1.0, -2.0, np.array([[0, 100], [-1, -1]], np.int8)), "home.pgm"
    )
    assert data == b"P5\n2 2\n255\n" + bytes([205, 205, 254, 0])
    assert "image: home.pgm" in text and "origin: [1.0, -2.0, 0.0]" in text


def test_grey_205_stays_unknown_under_the_newer_free_threshold():
    grid = grid_from_map_server(pgm([[205, 254, 0]]), YAML.replace("0.196", "0.25"))
    assert grid.cells.tolist() == [[-1, 0, 100]]


def test_negated_pictures_and_greys_between_the_thresholds():
    grid = grid_from_map_server(pgm([[0, 255, 128]]), YAML.replace("negate: 0", "negate: 1"))
    assert grid.cells.tolist() == [[0, 100, -1]]


def test_comments_in_the_header_are_skipped():
    data = b"P5\n# made by hand\n2 1 # size\n255\n" + bytes([0, 254])
    assert grid_from_map_server(data, YAML).cells.tolist() == [[100, 0]]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (("resolution: 0.05", "resolution: five"), "resolution"),
        (("resolution: 0.05", "resolution: -1"), "resolution"),
        (("resolution: 0.05", "resolution: .nan"), "resolution"),
        (("0.0]", "0.5]"), "turned"),
        (("origin: [-1.5, 2.0, 0.0]", "origin: 3"), "origin"),
        (("free_thresh: 0.196", "free_thresh: 0.9"), "free_thresh"),
        (("image: map.pgm", ""), "image"),
        (("negate: 0", "mode: raw"), "mode"),
        (("image: map.pgm", "image: [unclosed"), "not valid YAML"),
    ],
)
def test_bad_yaml_names_the_file_and_the_key(change, what):
    with pytest.raises(MapError, match=what) as caught:
        grid_from_map_server(pgm([[0]]), YAML.replace(*change), "home.yaml")
    assert "home.yaml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "- 1\n- 2\n"])
def test_yaml_without_keys_is_refused(text):
    with pytest.raises(MapError, match="no keys"):
        grid_from_map_server(pgm([[0]]), text)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"", "not a binary PGM"),
        (b"\x89PNG\r\n", "not a binary PGM"),
        (b"P5\n4 4\n255\n" + bytes(15), "15 of 16"),
        (b"P5\n4 4\n65535\n" + bytes(32), "8 bits"),
        (b"P5\n0 4\n255\n", "size"),
        (b"P5\n99999999999999999999 99999999999\n255\n", "size"),
    ],
)
def test_bad_pictures_are_refused_in_one_sentence(data, what):
    with pytest.raises(MapError, match=what) as caught:
        grid_from_map_server(data, YAML, "home.yaml")
    assert "home.yaml" in str(caught.value)
