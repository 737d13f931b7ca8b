"""The calibration wizard of the running robot: from pictures of a board to a file."""

from contextlib import ExitStack

import numpy as np
import pytest
from board_pictures import SIZE, board_poses, picture, views

from robot.body.calibration.wizard import EXACT, WANTED_VIEWS, CalibrationDesk, Sitting
from robot.body.talk.onlookers import Onlookers
from robot.calibrate.board import parse_board
from robot.calibrate.stereo import calibrate_stereo
from robot.config import Config
from robot.errors import CalibrationError, RequestError
from robot.messages import MissionState, StereoFrame
from robot.perception.calibration_files import parse_calibration

BOARD = "chess:8x6:24mm"


class Busy:
    def __init__(self):
        self.resting = True

    def __call__(self):
        return self.resting


@pytest.fixture
def desk(tmp_path):
    """(desk, whether the robot rests, folder)."""
    resting = Busy()
    desk = CalibrationDesk(tmp_path, resting)
    yield desk, resting, tmp_path
    desk.close()


def ask(desk, verb, *args):
    return desk.verbs()[f"calibration {verb}"](args)


@pytest.fixture(scope="module")
def frames():
    """Pairs of a board that stands still twice at each of nine places."""
    board, pairs = parse_board(BOARD), []
    for k, (rotation, move) in enumerate(board_poses(9, board, np.random.default_rng(1))):
        eyes = [picture(board, rotation, move, right) for right in (False, True)]
        pairs += [StereoFrame(0, 2 * k, *eyes), StereoFrame(0, 2 * k + 1, *eyes)]
    return pairs


def test_pictures_become_views_coverage_and_a_row_error(frames):
    sitting = Sitting(parse_board(BOARD), lambda: True)
    said = []
    for frame in frames:
        sitting.look(frame)
        said.append(sitting.told["seen"])
    told = sitting.told
    assert told["views"] >= 8 and told["size_px"] == list(SIZE)
    assert {"hold the board still", "taken"} <= set(said)
    assert sum(map(sum, told["counts"])) == told["views"] * 48
    assert 0 < told["epipolar_px"] < 0.3 and 0 < told["epipolar_unseen_px"] < 0.3
    assert 0 < told["rms_px"] < 0.5 and told["problem"] == ""


def test_nothing_is_said_of_errors_before_there_are_enough_views(frames):
    sitting = Sitting(parse_board(BOARD), lambda: True)
    for frame in frames[:6]:
        sitting.look(frame)
    assert sitting.told["views"] == 3 and sitting.told["epipolar_px"] is None


def test_a_good_result_is_saved_and_can_be_read_back(desk, frames):
    desk, _, folder = desk
    assert "at least 8 views" in refused(desk, "save")
    assert BOARD in ask(desk, "begin", BOARD)["reason"]
    for frame in frames:
        desk._sitting.look(frame)
    shown = ask(desk, "show")
    assert shown["data"]["running"] and f"of {WANTED_VIEWS} views" in shown["reason"]
    answer = ask(desk, "save")
    assert str(folder / "stereo.yaml") in answer["reason"]
    assert ask(desk, "show")["data"]["saved"] == str(folder / "stereo.yaml")
    text = (folder / "stereo.yaml").read_text()
    assert parse_calibration(text, "stereo.yaml").baseline_m == pytest.approx(0.06, abs=0.002)
    assert "epipolar_px:" in text


def test_a_poor_result_is_not_saved(desk):
    desk, _, folder = desk
    ask(desk, "begin", BOARD)
    board = parse_board(BOARD)
    desk._sitting.result = calibrate_stereo(views(board, noise_px=2.0), board, SIZE)
    with pytest.raises(CalibrationError, match="poor"):
        ask(desk, "save")
    assert list(folder.iterdir()) == []


def refused(desk, verb, *args):
    with pytest.raises((RequestError, CalibrationError)) as caught:
        ask(desk, verb, *args)
    return str(caught.value)


def test_it_needs_rest_a_board_and_eyes_that_may_be_wrong(desk, tmp_path):
    desk, resting, _ = desk
    assert "is no board" in refused(desk, "begin", "a tray")
    resting.resting = False
    assert "busy" in refused(desk, "begin")
    assert ask(desk, "show")["reason"] == "nobody calibrates now"
    exact = CalibrationDesk(tmp_path, lambda: True, EXACT)
    assert refused(exact, "begin") == f"{EXACT}."
    shown = ask(exact, "show")
    assert shown["reason"] == EXACT and not shown["data"]["possible"]


def test_it_ends_when_it_is_told_or_the_robot_sets_out(desk):
    desk, resting, _ = desk
    for end in (lambda: ask(desk, "end"), lambda: setattr(resting, "resting", False)):
        resting.resting = True
        ask(desk, "begin", BOARD)
        sitting = desk._sitting
        assert ask(desk, "show")["data"]["running"]
        end()
        sitting.join(timeout=5)
        assert not sitting.is_alive() and not ask(desk, "show")["data"]["running"]


@pytest.mark.parametrize("body", ["sim", "live"])
def test_a_run_with_books_answers_for_its_eyes(tmp_path, body):
    """As `sweeper run --home --socket` puts it together."""
    with ExitStack() as stack:
        onlookers = Onlookers(tmp_path / "s.sock", Config(), body, stack)
        assert onlookers.recorder(None) is None  # nobody keeps books yet
        books = onlookers.keep_books(NoLog(), tmp_path)
        verbs = onlookers.control.books
        assert {"history", "calibration begin"} <= verbs.keys()
        if body == "sim":
            assert verbs["calibration show"](())["reason"] == EXACT
            return
        verbs["calibration begin"]((BOARD,))
        onlookers.recorder(None).frame(StereoFrame(0, 1, *[np.zeros((48, 64), np.uint8)] * 2))
        assert verbs["calibration show"](())["data"]["running"]
        books.command(MissionState(1, "clean", "start was requested", 0.0, 5.0))
        with pytest.raises(RequestError, match="busy"):
            verbs["calibration begin"](())


class NoLog:
    """An `EventLog` that keeps nothing."""

    def event(self, event):
        pass

    command = event

    def flush(self):
        pass


def test_pictures_go_on_to_the_recorder_and_to_who_calibrates(desk):
    desk, *_ = desk

    class Keeps:
        def __init__(self):
            self.kept = []

        def frame(self, frame):
            self.kept.append(frame)

        def truth(self, t_ns, pose):
            self.kept.append(pose)

    keeps, pair = Keeps(), StereoFrame(0, 1, *[np.zeros((48, 64), np.uint8)] * 2)
    recorder = desk.stand_before(keeps)
    recorder.frame(pair)
    recorder.truth(0, None)
    assert keeps.kept == [pair, None]
    ask(desk, "begin", BOARD)
    recorder.frame(pair)
    for _ in range(200):
        if desk._sitting.told["seen"] == "no board in sight":
            break
        desk._sitting.join(timeout=0.02)
    assert desk._sitting.told["seen"] == "no board in sight"
    desk.stand_before(None).frame(pair)
