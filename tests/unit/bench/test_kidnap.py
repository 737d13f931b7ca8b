"""Carried away in the simulator, with sights drawn: it must find itself again."""

import pytest

from robot.bench.kidnap import bench_kidnap
from robot.config import Config


@pytest.mark.long
def test_a_lifted_and_a_moved_robot_find_themselves() -> None:
    result = bench_kidnap("studio", seed=3, carries=2, config=Config(), rendered=False)
    lifted, moved = result["carries"]
    assert lifted["lifted"]
    assert not moved["lifted"]
    assert lifted["found_s"] < 20.0
    assert moved["found_s"] < 30.0
    assert result["summary"]["undetected"] == 0
    assert result["summary"]["confidently_wrong"] <= 1  # a move that nothing felt takes its time
