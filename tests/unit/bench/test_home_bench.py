"""The bench of whole runs: side by side, in order, with means and a picture."""

from __future__ import annotations

import cv2
import pytest

from robot.bench.home import HomeOptions, bench_home, parse_scenes, parse_seeds
from robot.config import Config
from robot.errors import SceneError, SweeperError


def test_seeds_are_numbers_and_ranges():
    assert parse_seeds("1") == (1,)
    assert parse_seeds("3,10-12,1") == (3, 10, 11, 12, 1)
    for text in ("", "a", "5-", "5-3", "1,,2"):
        with pytest.raises(SweeperError, match="--seeds"):
            parse_seeds(text)


def test_runs_side_by_side_are_what_they_are_alone(tmp_path):
    options = HomeOptions(
        ("studio",), (2, 1), drawn=True, duration_s=12.0, jobs=2, out=tmp_path / "both"
    )
    result = bench_home(options, Config())
    assert [(run["scene"], run["seed"]) for run in result["runs"]] == [("studio", 2), ("studio", 1)]
    assert result["mean"]["runs"] == 2 and result["mean"]["duration_s"] == pytest.approx(12.0)
    assert cv2.imread(str(tmp_path / "both" / "coverage.png")) is not None
    alone = HomeOptions(("studio",), (1,), drawn=True, duration_s=12.0, out=tmp_path / "one")
    again = bench_home(alone, Config())["runs"][0]
    for key in ("covered_pct", "ate_rmse_m", "path_m", "contacts", "frames"):
        assert again[key] == result["runs"][1][key]
    assert again["path_m"] > 0.3


def test_a_cluster_gives_the_same(tmp_path):
    from distributed import LocalCluster

    def options(scheduler: str, name: str) -> HomeOptions:
        return HomeOptions(
            ("studio",), (1,), drawn=True, duration_s=6.0, scheduler=scheduler, out=tmp_path / name
        )

    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        far = bench_home(options(cluster.scheduler_address, "far"), Config())["runs"][0]
    near = bench_home(options("", "near"), Config())["runs"][0]
    assert {k: far[k] for k in ("path_m", "ate_rmse_m")} == {
        k: near[k] for k in ("path_m", "ate_rmse_m")
    }


def test_an_unknown_scene_is_named(tmp_path):
    with pytest.raises(SceneError, match="no-such"):
        bench_home(HomeOptions(("no-such",), (1,), out=tmp_path), Config())


def test_scenes_are_names_files_and_homes_by_seed():
    assert parse_scenes("flat, my/home.toml") == ("flat", "my/home.toml")
    assert parse_scenes("random:8-10,random:3") == ("random:8", "random:9", "random:10", "random:3")
    assert set(parse_scenes("all")) >= {"flat", "villa"}
    for wrong in ("", ",", "random:x-3"):
        with pytest.raises(SweeperError):
            parse_scenes(wrong)
