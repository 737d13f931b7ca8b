"""Does a path meet matter, and what stands near the robot: answers from the grid."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from situations import situation

from robot.config import Config
from robot.control.safety import Verdict
from robot.geometry.se2 import SE2
from robot.messages import Contact, Grid, Path
from robot.mission.drive import Drive, matter_near, meets_matter

RES = 0.05


def grid_with(cells):
    array = np.zeros((40, 60), np.int8)
    for x, y in cells:
        array[y, x] = 100
    return Grid(RES, -1.0, -0.5, array)


def centre(x, y):
    return (x + 0.5) * RES - 1.0, (y + 0.5) * RES - 0.5


def test_a_path_through_a_cell_meets_it_and_one_beside_it_does_not():
    grid = grid_with([(30, 20)])
    cx, cy = centre(30, 20)
    line = np.array([[cx - 0.5 + 0.04 * k, cy] for k in range(25)])
    assert meets_matter(line, grid, 0.12)
    assert not meets_matter(line + (0.0, 0.13), grid, 0.12)
    assert not meets_matter(np.zeros((0, 2)), grid, 0.12)
    assert not meets_matter(line + 50.0, grid, 0.12)


cells = st.lists(st.tuples(st.integers(0, 59), st.integers(0, 39)), max_size=6)


@given(cells, st.floats(-1.5, 2.5), st.floats(-1.0, 2.0), st.floats(0.02, 0.4))
def test_it_agrees_with_looking_at_every_cell(cells, x, y, radius_m):
    away = [np.hypot(cx - x, cy - y) for cx, cy in (centre(*c) for c in cells)]
    expected = bool(away) and min(away) < radius_m
    if not away or abs(min(away) - radius_m) > 1e-9:
        assert meets_matter(np.array([[x, y]]), grid_with(cells), radius_m) == expected


def test_matter_near_the_robot_is_found_and_far_matter_is_not():
    grid = grid_with([(20, 10), (21, 10), (50, 30)])
    near = matter_near(grid, SE2(0.0, 0.0, 1.0), 0.3)
    assert sorted(map(tuple, np.round(near, 9))) == sorted(
        tuple(np.round(centre(x, 10), 9)) for x in (20, 21)
    )
    assert matter_near(grid, SE2(30.0, 0.0, 0.0), 0.3).shape == (0, 2)


def test_where_it_has_never_been_it_drives_slowly():
    config = Config()
    now = situation(config, Contact(0))
    now.gate.verdict = Verdict(free_m=2.0)
    drive = Drive(Path(np.array([[0.0, 0.0], [3.0, 0.0]])), now, cleans=True)
    slow = new = None
    for x in np.arange(0.0, 1.0, 0.02):
        now.pose = now.odom = SE2(x)
        wish = drive.tick(now)
        assert not drive.blocked
        if x == 0.0:
            new = wish.v_mps  # half a metre around it is known floor
        slow = wish.v_mps
    assert new == config.robot.cruise_mps and slow == config.mission.new_floor_mps
    for x in np.arange(0.0, 3.0, 0.1):
        now.grid.clear_footprint(SE2(x), config.robot.radius_m)
    assert drive.tick(now).v_mps == config.robot.cruise_mps
