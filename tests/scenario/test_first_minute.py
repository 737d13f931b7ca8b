"""The whole street, for one simulated minute: rendered frames, real firmware, log and replay."""

import json

import pytest

from robot.cli import main

DURATION_S = 25.0


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    code = main(
        ["record", "--clean", "--scene", "flat", "--seed", "3", "--duration-s", str(DURATION_S),
         "--no-progress", "--out", str(out)]
    )  # fmt: skip
    assert code == 0
    return out / "latest"


def test_the_robot_leaves_its_dock_and_knows_where_it_is(run_folder):
    summary = json.loads((run_folder / "summary.json").read_text())
    assert summary["duration_s"] == pytest.approx(DURATION_S, abs=0.05)
    assert summary["path_m"] > 0.5
    assert summary["covered_pct"] > 0.5
    assert summary["ate_rmse_m"] < 0.05
    assert summary["docked"] is False
    assert summary["frames"] >= 10 * DURATION_S - 5 and summary["frames_dropped"] == 0
    assert summary["max_contact_mps"] <= 0.15 and summary["cliff_entered"] is False


def test_the_run_folder_is_complete(run_folder):
    names = {path.name for path in run_folder.iterdir()}
    assert names >= {
        "summary.json", "map.png", "map.pgm", "map.yaml", "trajectory.tum", "log.mcap",
        "config.toml",
    }  # fmt: skip


def test_the_log_replays_identically(run_folder, capsys):
    assert main(["replay", str(run_folder / "log.mcap"), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["identical"] is True and result["first_difference"] is None
    assert result["events"] > 100 * DURATION_S and result["commands"] >= 50 * (DURATION_S - 1)


def test_perception_repeats_itself_on_the_recorded_frames(run_folder, capsys):
    code = main(["replay", str(run_folder / "log.mcap"), "--from", "frames", "--json", "-"])
    assert code == 0, capsys.readouterr().out


def test_the_same_seed_lives_the_same_life(run_folder, tmp_path):
    main(
        ["run", "--scene", "flat", "--seed", "3", "--duration-s", "6", "--no-progress",
         "--out", str(tmp_path)]
    )  # fmt: skip
    again = (tmp_path / "latest" / "trajectory.tum").read_text().splitlines()
    first = (run_folder / "trajectory.tum").read_text().splitlines()
    assert len(again) > 40 and again == first[: len(again)]
