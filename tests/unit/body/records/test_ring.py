"""The log in RAM: bounded, whole in every segment, and saved when something goes wrong."""

import pytest

from robot.body.records.ring import LogRing, left_behind, open_log, rescued
from robot.body.records.tidy import tidy
from robot.config import Config, dump_config
from robot.errors import LogError
from robot.log.header import LogHeader
from robot.log.reader import read_events
from robot.log.writer import LogWriter
from robot.messages import ImuSample, Tick

CONFIG = Config()


def header():
    return LogHeader(
        config_toml=dump_config(CONFIG), camera=CONFIG.camera.stereo_camera(), scene="", seed=0,
        body="live", wall_time="2030-01-01T00:00:00+00:00",
    )  # fmt: skip


def live(ring, seconds, start_s=0):
    for k in range(start_s * 50, (start_s + seconds) * 50):
        t_ns = k * 20_000_000
        ring.event(ImuSample(t_ns, 0.001 * (k * 7919 % 1000)))
        ring.event(Tick(t_ns))


def test_it_never_grows_and_every_segment_is_a_log(tmp_path):
    with LogRing(tmp_path, header(), CONFIG.log, segment_bytes=20_000, segments=4) as ring:
        live(ring, 600)
    files = ring.files()
    assert len(files) == 4
    assert sum(f.stat().st_size for f in files) < 4 * 300_000
    first, last = read_events(files[0]), list(read_events(files[-1]))
    assert isinstance(next(iter(first)), Tick)
    assert last[-1].t_ns == (600 * 50 - 1) * 20_000_000
    starts = [next(iter(read_events(f))).t_ns for f in files]
    assert starts == sorted(starts)


def test_a_fault_brings_the_newest_minutes_to_the_card(tmp_path):
    ring = LogRing(tmp_path / "ram", header(), CONFIG.log, segment_bytes=20_000)
    with pytest.raises(ZeroDivisionError), rescued(ring, tmp_path / "card"):
        live(ring, 120)
        raise ZeroDivisionError
    saved = sorted((tmp_path / "card").iterdir())
    assert 1 <= len(saved) <= 3
    assert list(read_events(saved[-1]))[-1].t_ns == (120 * 50 - 1) * 20_000_000


def test_an_orderly_end_leaves_the_card_alone(tmp_path):
    ring = LogRing(tmp_path / "ram", header(), CONFIG.log)
    with rescued(ring, tmp_path / "card"):
        live(ring, 1)
    ring.close()
    assert not (tmp_path / "card").exists()
    assert left_behind(tmp_path / "ram") == []


def test_what_a_killed_life_left_is_saved_by_the_next(tmp_path):
    first = LogRing(tmp_path / "ram", header(), CONFIG.log)
    live(first, 60)
    first.flush()  # and then it is killed
    card = tmp_path / "card"
    card.mkdir()
    second = open_log(tmp_path / "ram", card, header(), CONFIG.log)
    assert [p.name for p in card.iterdir()] == ["before-log-000001.mcap"]
    assert [p.name for p in second.files()] == ["log-000001.mcap", "log-000002.mcap"]
    second.close()
    assert left_behind(tmp_path / "ram") == []


def test_without_a_ring_it_is_one_file_in_the_run(tmp_path):
    log = open_log(None, tmp_path, header(), CONFIG.log)
    assert isinstance(log, LogWriter)
    log.close()
    assert (tmp_path / "log.mcap").exists()


def runs(tmp_path, sizes):
    for k, size in enumerate(sizes):
        folder = tmp_path / f"2030010{k}-live"
        folder.mkdir()
        (folder / "log").write_bytes(b"x" * size)
    (tmp_path / "latest").symlink_to("20300100-live")
    (tmp_path / "note.txt").write_text("mine")


def test_tidy_keeps_the_newest_by_number_and_by_size(tmp_path):
    runs(tmp_path, [10, 10, 900_000, 300_000, 10])
    result = tidy(tmp_path, keep_runs=3, keep_mb=1.0)
    assert result["removed"] == ["20300102-live", "20300100-live"]
    left = sorted(p.name for p in tmp_path.iterdir())
    assert "20300104-live" in left and "20300103-live" in left and "20300102-live" not in left
    assert "note.txt" in left and "latest" in left


def test_tidy_never_removes_the_newest(tmp_path):
    runs(tmp_path, [10, 5_000_000])
    assert tidy(tmp_path, keep_runs=1, keep_mb=0.001)["kept"] == 1
    assert (tmp_path / "20300101-live").exists()


def test_tidy_explains_a_missing_folder(tmp_path):
    with pytest.raises(LogError, match="none"):
        tidy(tmp_path / "none")
