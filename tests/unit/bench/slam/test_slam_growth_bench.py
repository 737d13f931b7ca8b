"""The state stays as small as it may, however large the home, and nothing is lost."""

import msgspec

from robot.bench.slam.growth import measure_growth
from robot.config import Config, SlamConfig


def test_the_state_stays_bounded_in_a_home_of_any_size() -> None:
    slam = msgspec.structs.replace(SlamConfig(), max_landmarks=40)
    config = msgspec.structs.replace(Config(), slam=slam)
    small, large = measure_growth((40, 140), config)
    assert small["known"] <= 40 and small["ratio"] == 1.0
    assert large["known"] > 80  # the far ones sleep, they are not gone
    assert large["awake_most"] < 40 + 40
    assert large["error_at_end_m"] < 0.05
