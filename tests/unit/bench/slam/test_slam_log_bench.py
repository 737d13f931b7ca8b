"""`sweeper bench slam` on a log of ours: read once, measured against its truth, told by minute."""

import math
from pathlib import Path

import numpy as np
import pytest

from robot.bench.slam.bench import bench_slam
from robot.config import Config, RobotConfig, SlamConfig, dump_config
from robot.errors import DataError, LogError
from robot.geometry.se2 import SE2
from robot.log.header import LogHeader
from robot.log.writer import LogWriter
from robot.messages import ImuSample, Landmark, Scan, Seen, Tick, WheelTravel

THINGS = np.random.default_rng(4).uniform((-2.0, -2.0), (2.0, 2.0), (40, 2))
SIGNATURES = [np.random.default_rng(i).bytes(32) for i in range(len(THINGS))]
NO_SCAN = Scan(np.zeros(0), np.zeros(0), np.zeros(0))


def look(pose: SE2, rng: np.random.Generator) -> tuple[Landmark, ...]:
    """What stands within 3 m and 40 degrees, a little wrong."""
    seen = []
    for i, (x, y) in enumerate(pose.inverse().apply(THINGS).tolist()):
        range_m, bearing_rad = math.hypot(x, y), math.atan2(y, x)
        if 0.3 < range_m < 3.0 and abs(bearing_rad) < 0.7:
            sigma = np.array([0.01 * range_m**2, 0.004])
            wrong = rng.normal(0.0, sigma)
            cov = np.diag(sigma**2)
            seen.append(
                Landmark(
                    range_m + wrong[0], bearing_rad + wrong[1], cov, SIGNATURES[i], "point", 0.3, i
                )
            )
    return tuple(seen)


def write_log(path: Path, with_truth: bool = True, duration_s: float = 65.0) -> Path:
    """Circles of 0.4 m radius; the gyro turns a little too fast, one wheel 4 %."""
    rng = np.random.default_rng(5)
    width_m, v, w, step_s = RobotConfig().track_width_m, 0.2, 0.5, 0.05
    header = LogHeader(config_toml=dump_config(Config()), body="sim", seed=1)
    with LogWriter(path, header) as log:
        left = right = 0.0
        for k in range(round(duration_s / step_s)):
            t_ns, turned = round(k * step_s * 1e9), w * step_s * k
            pose = SE2(v / w * math.sin(turned), v / w * (1.0 - math.cos(turned)), turned)
            left += (v - 0.5 * w * width_m) * step_s * bool(k)
            right += 1.04 * (v + 0.5 * w * width_m) * step_s * bool(k)
            log.event(Tick(t_ns))
            log.event(ImuSample(t_ns, (w + 0.02) * bool(k)))
            log.event(WheelTravel(t_ns, t_ns, left, right))
            if k % 2 == 0:
                log.event(Seen(t_ns, t_ns, k // 2, look(pose, rng), NO_SCAN, 1.0))
                if with_truth:
                    log.truth(t_ns, pose)
    return path


def test_a_log_is_measured_against_its_truth(tmp_path: Path) -> None:
    log, told = write_log(tmp_path / "log.mcap"), []
    result = bench_slam(log, None, tmp_path / "out", sizes=(5,), tell=told.append)
    (row,) = result["runs"]
    assert row["ate_rmse_m"] < 0.02 and 2 * row["ate_rmse_m"] < row["dead_reckoning_ate_m"]
    assert row["landmarks"] > 10 and row["nees_mean"] < 9.0 and row["nees_in_bound_pct"] > 80.0
    assert told == [f"{tmp_path.name}: 1 min"]
    assert {file.suffix for file in (tmp_path / "out").iterdir()} == {".png", ".tum"}
    assert bench_slam(tmp_path, sizes=(5,))["runs"] == result["runs"]  # found in a folder


def test_the_logs_own_configuration_counts_unless_another_is_given(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", duration_s=5.0)
    other = Config(slam=SlamConfig(min_move_m=9.0, min_turn_rad=9.0))
    as_logged, given = (bench_slam(log, sizes=(5,), config=c)["runs"][0] for c in (Config(), other))
    assert bench_slam(log, sizes=(5,))["runs"] == [as_logged] != [given]


def test_without_truth_there_is_a_map_only(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", with_truth=False, duration_s=5.0)
    (row,) = bench_slam(log, sizes=(5,))["runs"]
    assert row["landmarks"] > 0 and row["ate_rmse_m"] is None is row["nees_mean"]


def test_a_log_that_is_none_is_explained(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(b"nothing")
    with pytest.raises(LogError):
        bench_slam(tmp_path / "log.mcap", sizes=(5,))
    with pytest.raises(DataError, match="not logs"):
        bench_slam(tmp_path / "log.mcap", None, None, "mirror")
