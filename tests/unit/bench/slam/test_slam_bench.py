"""`sweeper bench slam` on recordings drawn here: readers, measures, perturbations, errors."""

import json
from pathlib import Path

import numpy as np
import pytest

from robot.bench.slam.bench import bench_slam
from robot.bench.slam.cost import measure_cost
from robot.bench.slam.data import find_surveys, read_course, read_mrclam_raw, read_npz
from robot.bench.slam.perturb import KINDS, parse_perturbations, perturb
from robot.cli import main
from robot.errors import DataError
from robot.log.export import read_tum

THINGS = {6 + i: (x, y) for i, (x, y) in enumerate([(2, 2), (-2, 2), (0, 3), (2, -1), (-2, -1)])}
KEYS = {
    "name", "association", "ate_rmse_m", "ate_best90_m", "landmark_rmse_m", "nees_mean",
    "nees_in_bound_pct", "landmarks", "wrong_association_pct", "dead_reckoning_ate_m",
}  # fmt: skip


def circle(duration_s: float = 60.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orders 10 % too fast, sights (t, name, range, bearing) and truth (t, x, y, yaw)."""
    rng = np.random.default_rng(1)
    t_s = np.arange(0.0, duration_s, 0.1)
    v, w = 0.2, 0.2
    truth = np.column_stack(
        [t_s, v / w * np.sin(w * t_s), v / w * (1.0 - np.cos(w * t_s)), w * t_s]
    )
    truth[:, 3] = np.remainder(truth[:, 3] + np.pi, 2 * np.pi) - np.pi
    sights = []
    for t, x, y, yaw in truth[::5].tolist():
        for name, (px, py) in THINGS.items():
            bearing = np.remainder(np.arctan2(py - y, px - x) - yaw + np.pi, 2 * np.pi) - np.pi
            if abs(bearing) < 1.2:
                noise = rng.normal(0.0, (0.01, 0.01))
                sights.append((t, name, np.hypot(px - x, py - y) + noise[0], bearing + noise[1]))
    orders = np.column_stack([t_s, np.full(len(t_s), 1.1 * v), np.full(len(t_s), w)])
    return orders, np.array(sights), truth


def mrclam_npz(folder: Path) -> Path:
    orders, sights, truth = circle()
    landmarks = np.array([(name, *place) for name, place in THINGS.items()])
    file = folder / "D9R1.npz"
    robots = np.array([[1.0, 2.0, 1.0, 0.0]])  # another robot was seen once
    z = np.vstack([sights, robots])
    np.savez(file, odo=orders, z=z, gt=truth, landmarks=landmarks)
    return file


def mrclam_raw(folder: Path) -> Path:
    orders, sights, truth = circle()
    folder.mkdir()
    codes = {name: 10 * name for name in THINGS}
    sights[:, 1] = [codes[int(name)] for name in sights[:, 1]]
    for rows, name in ((orders, "Odometry"), (sights, "Measurement"), (truth, "Groundtruth")):
        rows[:, 0] += 1.2e9
        np.savetxt(folder / f"Robot3_{name}.dat", rows, fmt="%.6f", header="time ...")
    np.savetxt(folder / "Barcodes.dat", list(codes.items()), fmt="%d", header="subject code")
    places = [(name, *place, 0.001, 0.001) for name, place in THINGS.items()]
    np.savetxt(folder / "Landmark_Groundtruth.dat", places, fmt="%.6f", header="subject ...")
    return folder


def test_known_and_unknown_association(tmp_path: Path) -> None:
    result = bench_slam(mrclam_npz(tmp_path), out_dir=tmp_path / "out", sizes=(10,))
    assert {row["association"] for row in result["runs"]} == {"known", "unknown"}
    for row in result["runs"]:
        assert row.keys() >= KEYS
        assert row["ate_rmse_m"] < 0.03 < row["dead_reckoning_ate_m"]
        assert row["landmarks"] == len(THINGS) and row["landmark_rmse_m"] < 0.05
        assert row["nees_in_bound_pct"] > 85.0 and row["wrong_association_pct"] == 0.0
        assert row["calibration"][1] == pytest.approx(-0.09, abs=0.03)
        stem = f"D9R1_{row['association']}"
        assert (tmp_path / "out" / f"{stem}.png").read_bytes().startswith(b"\x89PNG")
        track = read_tum((tmp_path / "out" / f"{stem}.tum").read_text())
        truth = read_tum((tmp_path / "out" / f"{stem}_truth.tum").read_text())
        assert len(track) == len(truth) > 100 and np.array_equal(track[:, 0], truth[:, 0])


def test_raw_folder_reads_as_the_arrays_do(tmp_path: Path) -> None:
    raw = read_mrclam_raw(mrclam_raw(tmp_path / "MRCLAM9"), 3)
    arrays = read_npz(mrclam_npz(tmp_path))
    assert raw.polar == pytest.approx(arrays.polar, abs=1e-5)
    assert np.array_equal(raw.subject, arrays.subject)
    assert raw.truth == pytest.approx(arrays.truth, abs=1e-5)
    assert raw.landmarks == arrays.landmarks
    assert len(find_surveys(tmp_path)) == 2


def test_victoria_park_has_no_names_and_no_heading(tmp_path: Path) -> None:
    orders, sights, truth = circle()
    control = np.column_stack([orders[:, 0], np.full(len(orders), 0.2), np.zeros(len(orders))])
    trees = np.column_stack([sights[:, 0], sights[:, 2], sights[:, 3] + np.pi / 2, sights[:, 2]])
    np.savez(tmp_path / "half.npz", control=control, trees=trees, gps=truth[::10, :3])
    data = read_npz(tmp_path / "half.npz")
    laser = np.array([3.78, 0.5]) + sights[0, 2] * np.array(
        [np.cos(sights[0, 3]), np.sin(sights[0, 3])]
    )
    assert data.polar[0, 0] == pytest.approx(np.hypot(*laser))
    (row,) = bench_slam(tmp_path / "half.npz", "known", sizes=(5,))["runs"]
    assert row["association"] == "unknown" and row["wrong_association_pct"] is None
    assert row["nees_mean"] is None and row["ate_best90_m"] is not None


def test_course_log(tmp_path: Path) -> None:
    file = tmp_path / "sensor_data.dat"
    file.write_text("ODOMETRY 0.1 1.0 -0.1\nSENSOR 1 2.0 0.5\nODOMETRY 0 0.5 0\nSENSOR 1 1.4 0.7\n")
    (tmp_path / "world.dat").write_text("1 2 1\n")
    data = read_course(file)
    assert data.landmarks == {1: (2.0, 1.0)} and data.subject.tolist() == [1, 1]
    assert data.orders[:3, 1:] == pytest.approx(np.array([[0, 0.3], [3.0, 0], [0, -0.3]]))
    assert data.sight_t_s.tolist() == [1.0, 2.0] and len(data.truth) == 0
    (row,) = bench_slam(file, "known", sizes=(5,))["runs"]
    assert row["ate_rmse_m"] is None and row["landmark_rmse_m"] is None


@pytest.mark.parametrize("kind", KINDS)
def test_perturbations_change_what_they_say(tmp_path: Path, kind: str) -> None:
    data = read_npz(mrclam_npz(tmp_path))
    value = {"shift": 0.3, "mirror": 0.0, "relabel": 0.0}.get(kind, 0.3)
    changed = perturb(data, {kind: value})
    changes = {
        "mirror": lambda: np.mean(changed.polar[:, 1] == -data.polar[:, 1]),
        "relabel": lambda: np.mean(changed.subject >= 1000),
        "shift": lambda: np.mean(np.abs(changed.sight_t_s - data.sight_t_s - 0.3) < 1e-9),
        "drop": lambda: (1.0 - len(changed.polar) / len(data.polar)) / 0.3,
        "outliers": lambda: np.mean(changed.polar[:, 0] != data.polar[:, 0]) / 0.3,
        "wrong": lambda: np.mean(changed.subject != data.subject) / (0.3 * 4 / 5),
        "slip": lambda: np.mean(changed.orders[:, 1] > data.orders[:, 1]) / 0.05,
    }
    assert changes[kind]() == pytest.approx(1.0, abs=0.35)
    assert sorted(changed.landmarks.values()) == (
        sorted((x, -y) for x, y in data.landmarks.values())
        if kind == "mirror"
        else sorted(data.landmarks.values())
    )


def test_a_mirrored_world_is_mapped_as_well(tmp_path: Path) -> None:
    file = mrclam_npz(tmp_path)
    plain = bench_slam(file, "unknown", sizes=(5,))["runs"][0]
    mirrored = bench_slam(file, "unknown", None, "mirror,relabel", sizes=(5,))["runs"][0]
    assert mirrored["ate_rmse_m"] == pytest.approx(plain["ate_rmse_m"], abs=1e-3)


def test_cost_is_given_beside_filterpys() -> None:
    (row,) = measure_cost((100,))
    assert row["landmarks"] == 100
    assert row["filterpy_update_us"] > 2 * row["update_us"] > 0.0
    assert row["filterpy_predict_us"] > 5 * row["predict_us"] > 0.0


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("blur", "unknown"), ("drop=x", "number"), ("drop=1.5", "share"), ("wrong=-1", "share")],
)
def test_wrong_perturbations_are_explained(text: str, complaint: str) -> None:
    with pytest.raises(DataError, match=complaint):
        parse_perturbations(text)


def test_what_cannot_be_read_is_explained(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="does not exist"):
        bench_slam(tmp_path / "nothing")
    with pytest.raises(DataError, match="no recording"):
        bench_slam(tmp_path)
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(DataError, match="not a recording"):
        bench_slam(tmp_path / "a.txt")
    np.savez(tmp_path / "b.npz", odo=np.zeros(3))
    with pytest.raises(DataError, match="it needs"):
        bench_slam(tmp_path / "b.npz")
    (tmp_path / "c.npz").write_bytes(b"not a zip")
    with pytest.raises(DataError, match="download"):
        bench_slam(tmp_path / "c.npz")
    (tmp_path / "sensor_data.dat").write_text("ODOMETRY 1 2\n")
    with pytest.raises(DataError, match="line 1"):
        bench_slam(tmp_path / "sensor_data.dat")


def test_command_line(tmp_path: Path) -> None:
    file, out = mrclam_npz(tmp_path), tmp_path / "result.json"
    options = ["--association", "known", "--out", str(tmp_path / "out"), "--json", str(out)]
    assert main(["bench", "slam", str(file), *options]) == 0
    result = json.loads(out.read_text())
    assert [row["association"] for row in result["runs"]] == ["known"]
    assert result["cost"][0].keys() == {
        "landmarks", "update_us", "predict_us", "filterpy_update_us", "filterpy_predict_us",
        "update_ratio", "predict_ratio",
    }  # fmt: skip
    assert main(["bench", "slam", str(tmp_path / "nowhere")]) == 2
