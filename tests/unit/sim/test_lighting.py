"""Light: brighter near a lamp, dark behind a solid, dim in corners."""

import numpy as np
import pytest

from robot.sim.lighting import Lamp, Solid, bake
from robot.sim.mesh import LightSamples

LAMP = Lamp(0.0, 0.0, 2.0, 1.5)
UP = np.array([0.0, 0.0, 1.0])


def floor_light(points, solids, lamps=(LAMP,), ambient=0.4, two_sided=False, normal=UP):
    points = np.array(points, float)
    samples = LightSamples(
        points, np.broadcast_to(normal, points.shape).copy(), np.full(len(points), two_sided)
    )
    return bake(samples, list(lamps), ambient, solids)


def pillar(x, y, half, low, high):
    outline = np.array([[x + half, y - half], [x + half, y + half], [x - half, y + half],
                        [x - half, y - half]])  # fmt: skip
    return Solid(outline, low, high)


def test_in_the_open_light_follows_lamberts_law():
    """Under a lamp at height h: cos / (r^2 + 0.2), here at distances 0 and 2 from its foot."""
    light = floor_light([[0, 0, 0], [2, 0, 0]], [])
    assert light[0] == pytest.approx(0.4 + 1.5 / 4.2, rel=0.03)
    assert light[1] == pytest.approx(0.4 + 1.5 * np.cos(np.pi / 4) / 8.2, rel=0.03)


def test_a_face_turned_away_gets_ambient_light_only_unless_it_has_two_sides():
    assert floor_light([[0, 0, 0]], [], normal=-UP) == pytest.approx([0.4])
    assert floor_light([[0, 0, 0]], [], normal=-UP, two_sided=True) > 0.7


def test_behind_a_pillar_is_shadow_and_beside_it_is_not():
    solids = [pillar(1.0, 0.0, 0.15, 0.0, 1.9)]
    shadow, beside = floor_light([[1.9, 0, 0], [0, 1.9, 0]], solids)
    open_floor = floor_light([[1.9, 0, 0]], [])[0]
    assert beside == pytest.approx(open_floor, rel=0.02)
    assert shadow < 0.41


def test_a_lamp_shines_under_a_table_top_from_the_side():
    top = [pillar(1.0, 0.0, 0.4, 0.70, 0.74)]
    below, far = floor_light([[1.0, 0, 0], [2.6, 0, 0]], top)
    assert below < floor_light([[1.0, 0, 0]], [])[0]
    assert far == pytest.approx(floor_light([[2.6, 0, 0]], [])[0])


def test_a_corner_is_dimmer_than_the_middle_of_the_room():
    wall = [pillar(0.0, 0.0, 1.0, 0.0, 2.4)]
    corner, middle = floor_light([[1.02, 0, 0.0], [3.0, 0, 0.0]], wall, lamps=())
    assert corner < 0.9 * middle
    assert middle == pytest.approx(0.4)
