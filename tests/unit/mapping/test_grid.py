"""The occupancy grid: what noisy scans make of walls, legs, doors and touched things."""

import math

import numpy as np
import pytest

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.grid import UNKNOWN, OccupancyGrid
from robot.messages import Grid, Scan

EYE_M = (0.13, 0.03)
BEARINGS = np.linspace(-0.6, 0.6, 120)


def scan_of(pose, distance, rng=None, noise=0.022):
    """A scan of a world given by `distance(eye, angle) -> metres` along world angles."""
    eye = pose @ SE2(*EYE_M)
    true = np.array([distance((eye.x_m, eye.y_m), pose.yaw_rad + b) for b in BEARINGS])
    seen = true if rng is None else true + rng.normal(0, 1, len(true)) * noise * true**2
    x, y = EYE_M[0] + seen * np.cos(BEARINGS), EYE_M[1] + seen * np.sin(BEARINGS)
    return Scan(np.arctan2(y, x), np.hypot(x, y), np.minimum(np.hypot(x, y), 2.0))


def wall_at(x_wall):
    return lambda eye, angle: (x_wall - eye[0]) / math.cos(angle) if math.cos(angle) > 0.1 else 9.0


def disc_before_wall(x, y, radius, x_wall=9.0):
    """Distance to a round leg at (x, y), else to the wall behind it."""

    def distance(eye, angle):
        dx, dy = x - eye[0], y - eye[1]
        along = dx * math.cos(angle) + dy * math.sin(angle)
        off = abs(-dx * math.sin(angle) + dy * math.cos(angle))
        if along > 0 and off < radius:
            return along - math.sqrt(radius**2 - off**2)
        return wall_at(x_wall)(eye, angle)

    return distance


def cell(grid: Grid, x, y):
    column = math.floor((x - grid.origin_x_m) / grid.resolution_m)
    row = math.floor((y - grid.origin_y_m) / grid.resolution_m)
    rows, columns = grid.cells.shape
    return int(grid.cells[row, column]) if 0 <= row < rows and 0 <= column < columns else UNKNOWN


def free(cells):
    return (cells >= 0) & (cells < 50)


def front_of_wall(grid: Grid, y):
    """Where the first occupied cell of a row begins."""
    row = math.floor((y - grid.origin_y_m) / grid.resolution_m)
    occupied = np.flatnonzero(grid.cells[row] >= 50)
    return grid.origin_x_m + occupied[0] * grid.resolution_m


@pytest.mark.parametrize("x_wall", [1.0, 1.013, 1.5])
def test_a_wall_stands_where_it_is_although_every_range_is_noisy(x_wall):
    grid, rng = OccupancyGrid(MappingConfig(), EYE_M), np.random.default_rng(1)
    for i in range(60):
        pose = SE2(-0.6 + 0.01 * i, 0.0, 0.0)  # drives towards it
        grid.integrate(pose, scan_of(pose, wall_at(x_wall), rng))
    fronts = [front_of_wall(grid.snapshot(), y) for y in np.arange(-0.2, 0.2, 0.025)]
    assert abs(np.median(fronts) - x_wall) <= 0.025
    assert max(fronts) - min(fronts) <= 0.08
    assert free(cell(grid.snapshot(), x_wall - 0.1, 0.0))


def test_a_chair_leg_survives_the_rays_that_pass_beside_it():
    grid, rng = OccupancyGrid(MappingConfig(), EYE_M), np.random.default_rng(2)
    leg = disc_before_wall(1.0, 0.0, 0.0175, 2.5)
    for i in range(150):  # an arc round the leg, always facing it roughly
        a = -1.2 + 0.016 * i
        x, y = 1.0 - 0.8 * math.cos(a), 0.8 * math.sin(a)
        pose = SE2(x, y, -a + 0.3 * math.sin(i))
        grid.integrate(pose, scan_of(pose, leg, rng))
    view = grid.snapshot()
    around = [cell(view, 1.0 + dx, dy) for dx in (-0.025, 0, 0.025) for dy in (-0.025, 0, 0.025)]
    assert max(around) >= 50
    ys, xs = np.nonzero(view.cells >= 50)
    near = np.hypot(
        (xs + 0.5) * 0.025 + view.origin_x_m - 1.0, (ys + 0.5) * 0.025 + view.origin_y_m
    )
    assert (near < 0.3).sum() <= 20, "the leg must not grow into a block"


def test_rays_begin_at_the_eye_and_free_nothing_beside_the_body():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    grid.mark_obstacle(np.array([[5.0, 5.0]]))  # only so that the map reaches far
    pose = SE2(0.0, 0.0, 0.0)
    grid.integrate(pose, scan_of(pose, wall_at(2.0)))
    view = grid.snapshot()
    # Straight lines from `base` to the far hits run here; what the eye saw runs farther in front.
    assert cell(view, 0.1, 0.06) == UNKNOWN
    assert free(cell(view, 0.5, 0.0))


def test_bearings_without_knowledge_add_nothing():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    nan = np.full(120, np.nan)
    grid.integrate(SE2(), Scan(BEARINGS, nan, np.zeros(120)))
    grid.integrate(SE2(), Scan(BEARINGS, nan, nan))
    assert grid.snapshot().cells.tolist() == [[UNKNOWN]]


def test_seen_floor_without_an_obstacle_is_free_as_far_as_it_was_seen():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    for _ in range(2):
        grid.integrate(SE2(), Scan(BEARINGS, np.full(120, np.nan), np.full(120, 1.0)))
    view = grid.snapshot()
    assert free(cell(view, 0.9, 0.0))
    assert cell(view, 1.15, 0.0) == UNKNOWN
    assert view.cells.max() < 50


def test_a_range_beyond_the_map_is_free_as_far_as_the_map_goes_and_no_hit():
    grid = OccupancyGrid(MappingConfig(max_range_m=2.0), EYE_M)
    for _ in range(10):
        grid.integrate(SE2(), scan_of(SE2(), wall_at(2.6)))
    assert free(cell(grid.snapshot(), 1.5, 0.0))
    assert grid.snapshot().cells.max() < 50


def test_the_map_grows_in_all_directions_and_keeps_what_it_knew():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    poses = [SE2(4.0 * math.cos(a), 4.0 * math.sin(a), a) for a in np.arange(0, 6.3, 0.7)]
    for pose in poses:
        for _ in range(2):
            grid.integrate(pose, Scan(BEARINGS, np.full(120, np.nan), np.full(120, 1.0)))
    view = grid.snapshot()
    for pose in poses:
        ahead = pose @ SE2(0.8, 0.0)
        assert free(cell(view, ahead.x_m, ahead.y_m))
    assert view.origin_x_m < -4.0 and view.origin_y_m < -4.0
    assert (np.abs(np.array([view.origin_x_m, view.origin_y_m]) / 0.025) % 1.0 < 1e-6).all()


@pytest.mark.parametrize("pose", [SE2(500.0, 0.0, 0.0), SE2(math.nan, 0.0, 0.0)])
def test_an_absurd_pose_changes_nothing(pose):
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    grid.integrate(pose, Scan(BEARINGS, np.full(120, 1.0), np.full(120, 1.0)))
    if math.isfinite(pose.x_m):
        grid.clear_footprint(pose, 0.17)
        grid.mark_obstacle(np.array([[pose.x_m, pose.y_m]]))
    assert grid.snapshot().cells.size == 1


def test_what_was_touched_stays_until_the_body_stands_there():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    grid.mark_obstacle(np.array([[0.5, 0.0], [np.nan, 0.0]]))
    for _ in range(30):  # stereo looks through glass
        grid.integrate(SE2(), Scan(BEARINGS, np.full(120, np.nan), np.full(120, 1.5)))
    assert cell(grid.snapshot(), 0.5, 0.0) >= 50
    grid.clear_footprint(SE2(0.34, 0.0, 0.0), 0.17)  # touches it with the rim
    assert cell(grid.snapshot(), 0.5, 0.0) >= 50
    grid.clear_footprint(SE2(0.45, 0.0, 0.0), 0.17)
    assert free(cell(grid.snapshot(), 0.5, 0.0))


def test_where_the_robot_stands_is_floor():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    grid.clear_footprint(SE2(1.0, 2.0, 0.3), 0.17)
    view = grid.snapshot()
    area = np.count_nonzero(free(view.cells)) * 0.025**2
    assert area == pytest.approx(math.pi * 0.17**2, rel=0.08)
    assert free(cell(view, 1.0, 2.0)) and cell(view, 1.2, 2.0) == UNKNOWN


def test_a_door_that_closes_and_opens_is_believed_within_a_second_or_two():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    for _ in range(100):
        grid.integrate(SE2(), scan_of(SE2(), wall_at(2.5)))
    assert free(cell(grid.snapshot(), 1.01, 0.0))
    for _ in range(10):
        grid.integrate(SE2(), scan_of(SE2(), wall_at(1.0)))
    assert cell(grid.snapshot(), 1.01, 0.0) >= 50
    for _ in range(20):
        grid.integrate(SE2(), scan_of(SE2(), wall_at(2.5)))
    assert free(cell(grid.snapshot(), 1.01, 0.0))


def test_the_same_scans_give_the_same_map_bit_for_bit():
    views = []
    for _ in range(2):
        grid, rng = OccupancyGrid(MappingConfig(), EYE_M), np.random.default_rng(5)
        for i in range(20):
            pose = SE2(0.02 * i, 0.01 * i, 0.05 * i)
            grid.integrate(pose, scan_of(pose, wall_at(1.4), rng))
        views.append(grid.snapshot())
    assert np.array_equal(views[0].cells, views[1].cells)
    assert views[0].origin_x_m == views[1].origin_x_m


def test_touches_are_forgotten_where_the_eyes_see_floor():
    grid = OccupancyGrid(MappingConfig(), EYE_M)
    for _ in range(10):
        grid.integrate(SE2(), scan_of(SE2(), wall_at(1.5)))
    grid.mark_obstacle(np.array([[0.6, 0.0], [1.2, 0.0], [0.0, 0.5]]))
    grid.mark_edge(np.array([[0.8, 0.0]]))
    grid.mark_obstacle(np.array([[0.8, 0.0]]))
    grid.forget_touches(SE2(), 1.0)
    view = grid.snapshot()
    assert free(cell(view, 0.6, 0.0))
    assert cell(view, 0.8, 0.0) >= 50  # it looks like floor, but an edge was felt
    assert cell(view, 1.2, 0.0) >= 50  # too far away
    assert cell(view, 0.0, 0.5) >= 50  # never seen


def test_it_remembers_where_the_robot_has_stood():
    grid = OccupancyGrid(MappingConfig())
    here = np.array([[0.0, 0.1], [0.1, 0.0]])
    assert not grid.driven(here)
    grid.integrate(SE2(), scan_of(SE2(), wall_at(2.0)))  # seen to be free is not driven
    assert not grid.driven(np.array([[1.0, 0.0]]))
    grid.clear_footprint(SE2(), 0.17)
    assert grid.driven(here) and not grid.driven(np.vstack([here, [[0.3, 0.0]]]))
    grid.clear_footprint(SE2(-9.0), 0.17)  # the grid grows
    again = OccupancyGrid(MappingConfig())
    again.restore(grid.memory())
    for known in (grid, again):
        assert known.driven(here) and not known.driven(np.array([[-4.0, 0.0]]))
        assert not known.driven(np.array([[50.0, 0.0]]))
