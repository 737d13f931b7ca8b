"""Power cuts at every step of updates, settings, calibrations and maps: the old or the new."""

import os
import shutil

import numpy as np
import pytest
from card import build, run, source
from manage import update
from power import aftermaths, record
from slots import Slots

from robot.body.calibration.cameras import save
from robot.body.kept import store
from robot.calibrate.apply import set_keys
from robot.config import load_config
from robot.errors import MapError
from robot.perception.calibration import Eye, StereoCalibration
from robot.perception.calibration_files import parse_calibration


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    """Nothing here outlives the test: the disk need not be waited for."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.mark.parametrize("stride", [14, pytest.param(1, marks=pytest.mark.long)])
def test_an_update_leaves_the_old_release_or_the_new_one_and_a_way_back(tmp_path, stride):
    root, before, scratch = tmp_path / "card", tmp_path / "before", tmp_path / "scratch"
    root.mkdir()
    run(root, "install", source(tmp_path))
    run(root, "update", source(tmp_path, "0.2.0"))
    run(root, "good")
    shutil.copytree(root, before, symlinks=True)
    new = source(tmp_path, "0.3.0")
    steps = record(root, lambda: update(Slots(root), new, build))
    assert {s.what for s in steps} >= {"write", "sync", "sync_folder", "rename", "link"}
    cuts, seen = 0, set()
    for name, card in aftermaths(before, root, steps, scratch, stride):
        cuts += 1
        home = Slots(card)
        running = home.release(home.current)
        assert running, name  # whole, and there
        assert running[:5] in ("0.2.0", "0.3.0"), name
        assert (card / "opt/sweeper/current/bin/sweeper").stat().st_size > 0, name
        seen.add(running[:5])
        if running.startswith("0.3.0"):
            assert home.on_trial() == 0, name
            assert home.release(home.previous).startswith("0.2.0"), name
            for _ in range(4):
                home.count()
            assert home.release(home.current).startswith("0.2.0"), name
        else:
            update(home, new, build)  # a second attempt always succeeds
            assert home.release(home.current).startswith("0.3.0"), name
    assert seen == {"0.2.0", "0.3.0"}
    print(f"update: {cuts} cuts")
    assert cuts >= 240 / stride


@pytest.mark.parametrize("when", [(3,), pytest.param((0, 1, 2), marks=pytest.mark.long)])
def test_a_trials_count_and_rollback_survive_cuts(tmp_path, when):
    root, before, scratch = tmp_path / "card", tmp_path / "before", tmp_path / "scratch"
    root.mkdir()
    run(root, "install", source(tmp_path))
    run(root, "update", source(tmp_path, "0.2.0"))
    for starts in range(4):
        if starts not in when:
            Slots(root).count()
            continue
        shutil.rmtree(before, ignore_errors=True)
        shutil.copytree(root, before, symlinks=True)
        steps = record(root, Slots(root).count)
        for name, card in aftermaths(before, root, steps, scratch):
            home = Slots(card)
            assert home.release(home.current), (starts, name)
            for _ in range(5):  # whatever was lost, the way back is found
                home.count()
            assert home.release(home.current).startswith("0.1.0"), (starts, name)


def swept(tmp_path, path, old, new, judge):
    """Write `old`, then record writing `new`; judge every aftermath. Returns how many."""
    folder = path.parent
    before, scratch = tmp_path / "before", tmp_path / "scratch"
    folder.mkdir(parents=True, exist_ok=True)
    old()
    shutil.rmtree(before, ignore_errors=True)
    shutil.copytree(folder, before)
    steps = record(folder, new)
    count = 0
    for name, card in aftermaths(before, folder, steps, scratch):
        judge(card / path.name, name)
        count += 1
    return count


ROUNDS = pytest.mark.parametrize("rounds", [2, pytest.param(12, marks=pytest.mark.long)])


@ROUNDS
def test_settings_are_the_old_or_the_new_ones(tmp_path, rounds):
    path = tmp_path / "etc/robot.toml"
    total = 0
    for k in range(rounds):
        text = set_keys("", {"camera.z_m": 0.05 + 0.01 * k})
        changed = set_keys(text, {"camera.z_m": 0.2, "sensors.imu_axis": "-y"})

        def judge(file, name, k=k):
            z_m = load_config(file).camera.z_m
            assert z_m in (pytest.approx(0.05 + 0.01 * k), 0.2), name

        total += swept(
            tmp_path, path,
            lambda text=text: store.write_whole(path, text.encode()),
            lambda changed=changed: store.write_whole(path, changed.encode()), judge,
        )  # fmt: skip
    print(f"settings: {total} cuts")
    assert total >= 30 * rounds


def calibration(baseline_m):
    pose = np.eye(4)
    pose[0, 3] = -baseline_m
    matrix = np.array([[456.0, 0, 319.5], [0, 456.0, 239.5], [0, 0, 1]])
    eye = Eye(640, 480, matrix, np.zeros(5))
    return StereoCalibration(eye, eye, pose)


@ROUNDS
def test_a_calibration_is_the_old_or_the_new_one(tmp_path, rounds):
    path = tmp_path / "etc/stereo.yaml"
    total = 0
    for k in range(rounds):
        old_m, new_m = 0.05 + 0.001 * k, 0.08

        def judge(file, name, old_m=old_m, new_m=new_m):
            read = parse_calibration(file.read_text(), "stereo.yaml").baseline_m
            assert read in (pytest.approx(old_m), pytest.approx(new_m)), name

        total += swept(
            tmp_path, path,
            lambda m=old_m: save(calibration(m), path, "opencv", None),
            lambda m=new_m: save(calibration(m), path, "opencv", None), judge,
        )  # fmt: skip
    print(f"calibration: {total} cuts")
    assert total >= 30 * rounds


@ROUNDS
def test_a_map_is_the_old_or_the_new_one_and_never_refused(tmp_path, rounds, monkeypatch):
    def decode(data, name):
        if len(data) != 1000 or len(set(data)) != 1:
            raise MapError(f"{name}: damaged; restore it.")
        return data[0]

    monkeypatch.setattr(store, "encode_home", lambda home: bytes([home]) * 1000)
    monkeypatch.setattr(store, "decode_home", decode)
    folder, total = tmp_path / "home", 0
    for k in range(1, rounds + 1):

        def judge(file, name, k=k):
            loaded = store.HomeStore(file.parent).load(lambda warning: None)
            assert loaded is not None and loaded[1] in (k, k + 100), name

        total += swept(
            tmp_path, folder / store.NAME,
            lambda k=k: store.HomeStore(folder).save(k),
            lambda k=k: store.HomeStore(folder).save(k + 100), judge,
        )  # fmt: skip
    print(f"map: {total} cuts")
    assert total >= 40 * rounds


def test_the_model_of_cuts_catches_a_careless_writer(tmp_path):
    """A rename without a sync may leave an empty file: the trial must be able to see that."""
    path = tmp_path / "etc/file"

    def careless(text):
        partial = path.with_name("partial")
        with open(partial, "w") as file:
            file.write(text)
        os.replace(partial, path)

    bad = []

    def judge(file, name):
        if file.read_text() not in ("old", "new"):
            bad.append(name)

    swept(tmp_path, path, lambda: careless("old"), lambda: careless("new"), judge)
    assert bad
