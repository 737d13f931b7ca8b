"""Carried away, lifted, switched off and on again: the robot knows that, and finds itself."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from synthetic_flat import Drive, Faults, drive

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2
from robot.messages import PoseEstimate, Seen, VisualMotion
from robot.slam.finding import SelfFinder
from robot.slam.memory import SlamMemory
from robot.slam.relocalise import Glimpse
from robot.slam.slam import Slam

S = 1_000_000_000
ROUND = np.array(  # through a door, round a room and back
    [(0, 0), (-0.5, 0), (-1.8, -0.8), (-3.2, -0.8), (-4.4, -2.0), (-3.0, -2.0), (-3.0, -0.9),
     (-1.7, -0.8), (-0.6, -1.6), (-0.6, 0.8), (-0.5, 0.0), (0.3, 0.0)],
    dtype=float,
)  # fmt: skip
SURE = np.diag([0.02, 0.02, 0.02]) ** 2
CONFIG, ROBOT = SlamConfig(), RobotConfig()
HOME, PER_M = 5, 16.0


@pytest.fixture(scope="module")
def ride() -> Drive:
    """A later drive through the known flat, by another way round, with another gyro's bias."""
    way = ROUND[[0, 1, 9, 8, 7, 6, 5, 4, 3, 2, 1]]
    return drive(12, path=way, per_m=PER_M, home=HOME, faults=Faults(gyro_bias_radps=-0.01))


def play(
    slam: Slam, ride: Drive, from_s: float, to_s: float, shift_s: float = 0.0
) -> list[tuple[float, PoseEstimate, float]]:
    """A part of the ride, told to have happened `shift_s` later: (t_s, estimate, error_m)."""
    truth = dict(zip(ride.truth_t_ns.tolist(), ride.truth, strict=True))
    shift_ns, told = round(shift_s * S), []
    for event in ride.events:
        if not from_s * S <= event.t_ns < to_s * S:
            continue
        t_ns = event.t_ns + shift_ns
        if not isinstance(event, Seen):
            slam.odometry(replace(event, t_ns=t_ns))
            continue
        motion = None if shift_ns and not told else event.motion  # carried there, in no time
        arrived_ns = event.arrived_ns + shift_ns
        estimate = slam.see(replace(event, t_ns=t_ns, arrived_ns=arrived_ns, motion=motion))
        pose, true = estimate.world_from_base, truth[event.t_ns]
        error_m = math.hypot(pose.x_m - true[0], pose.y_m - true[1])
        told.append(((event.t_ns * 1e-9) - from_s, estimate, error_m))
    return told


@pytest.fixture(scope="module")
def memory() -> SlamMemory:
    """What a robot knows that has driven through the flat, and back."""
    slam = Slam(CONFIG, ROBOT)
    before = drive(11, path=np.vstack([ROUND, ROUND[::-1]]), per_m=PER_M, home=HOME)
    told = play(slam, before, 0.0, math.inf)
    assert all(estimate.health == "ok" for _, estimate, _ in told)
    return slam.memory()


def awake(memory: SlamMemory, ride: Drive, at_s: float) -> Slam:
    """A robot that was put down at a place of the ride, knows where, and looks for a while."""
    slam = Slam(CONFIG, ROBOT, memory)
    true = ride.truth[int(np.searchsorted(ride.truth_t_ns, at_s * S))]
    slam.put(SE2(*true.tolist()), SURE)
    play(slam, ride, at_s, at_s + 12.0)
    return slam


def test_a_restart_on_the_dock_goes_on_within_five_centimetres(
    memory: SlamMemory, ride: Drive
) -> None:
    slam = Slam(CONFIG, ROBOT, memory)
    slam.put(SE2(*(ride.truth[0] + [0.02, -0.015, 0.02]).tolist()), SURE)
    told = play(slam, ride, 0.0, 20.0)
    assert all(estimate.health == "ok" for _, estimate, _ in told)
    assert max(error_m for t_s, _, error_m in told if t_s > 10.0) < 0.05


@pytest.mark.parametrize("at_s", [5.0, 25.0, 45.0])
def test_waking_up_somewhere_it_finds_itself(memory: SlamMemory, ride: Drive, at_s: float) -> None:
    slam = Slam(CONFIG, ROBOT, memory)
    told = play(slam, ride, at_s, at_s + 20.0)
    assert told[0][1].health == "lost"
    found = [(t_s, error_m) for t_s, estimate, error_m in told if estimate.health != "lost"]
    assert found, "never found itself"
    assert found[0][0] < 15.0
    assert max(error_m for _, error_m in found) < 0.3
    assert found[-1][1] < 0.1


@pytest.mark.parametrize("to_s", [5.0, 20.0])
def test_lifted_and_put_elsewhere(memory: SlamMemory, ride: Drive, to_s: float) -> None:
    slam = awake(memory, ride, 40.0)
    slam.lift()
    told = play(slam, ride, to_s, to_s + 20.0, shift_s=52.0 - to_s)
    assert told[0][1].health == "lost"
    found = [error_m for _, estimate, error_m in told if estimate.health != "lost"]
    assert found
    assert max(found) < 0.3


def test_in_the_air_it_does_not_find_itself(memory: SlamMemory, ride: Drive) -> None:
    slam = awake(memory, ride, 40.0)
    for t_s in np.arange(52.0, 58.0, 0.1):  # it still sees the place where it was
        slam.lift()
        told = play(slam, ride, t_s, t_s + 0.1)
        assert all(estimate.health == "lost" for _, estimate, _ in told)


@pytest.mark.parametrize("to_s", [5.0, 20.0])
def test_carried_away_unnoticed_it_notices(memory: SlamMemory, ride: Drive, to_s: float) -> None:
    slam = awake(memory, ride, 40.0)
    told = play(slam, ride, to_s, to_s + 25.0, shift_s=52.0 - to_s)
    lost_s = min(t_s for t_s, estimate, _ in told if estimate.health == "lost")
    assert lost_s < 8.0
    found = [error_m for t_s, estimate, error_m in told if t_s > lost_s and estimate.health == "ok"]
    assert found
    assert max(found) < 0.3
    assert found[-1] < 0.1


@dataclass(frozen=True)
class Insists:
    """A relocaliser that always names one pose."""

    glimpse: Glimpse | None

    def look(self, *_: object) -> Glimpse | None:
        return self.glimpse


@pytest.mark.parametrize("confirmed", [False, True])
def test_one_look_does_not_outweigh_landmarks_long_known(confirmed: bool, ride: Drive) -> None:
    finder = SelfFinder(CONFIG)
    finder._relocaliser = Insists(Glimpse(SE2(0.8, 0.0, 0.0), confirmed))  # type: ignore[assignment]
    seen = next(event for event in ride.events if isinstance(event, Seen))
    finder.judge(seen, familiar=5, pose=SE2(), cov=SURE)
    assert finder.lost is confirmed
    finder.found(seen.t_ns)
    finder.judge(replace(seen, t_ns=seen.t_ns + 3 * S), familiar=0, pose=SE2(), cov=SURE)
    assert finder.lost


@pytest.mark.parametrize(
    ("here", "there", "lost"),
    [(0.95, 0.4, False), (0.6, 0.9, True), (0.9, 0.9, True), (math.nan, math.nan, True)],
)
def test_places_do_not_refute_a_pose_that_fits_the_map_better_than_theirs(
    here: float, there: float, lost: bool, ride: Drive
) -> None:
    finder = SelfFinder(CONFIG)
    finder._relocaliser = Insists(Glimpse(SE2(0.8, 0.0, 0.0), True))  # type: ignore[assignment]
    seen = next(event for event in ride.events if isinstance(event, Seen))
    finder.judge(seen, 0, SE2(), SURE, lambda pose: there if pose.x_m > 0.5 else here)
    assert finder.lost is lost


@pytest.mark.parametrize(("share", "found"), [(0.7, True), (0.3, False), (math.nan, False)])
def test_places_alone_do_not_prove_a_pose_that_does_not_fit_the_map(
    share: float, found: bool, ride: Drive
) -> None:
    finder = SelfFinder(CONFIG)
    finder.lose()
    finder._relocaliser = Insists(Glimpse(SE2(3.0, 0.0, 0.0), True))  # type: ignore[assignment]
    seen = next(event for event in ride.events if isinstance(event, Seen))
    pose = finder.search(seen, lambda pose: share)
    assert (pose is not None) is found
    assert finder.search(seen) is not None  # nobody knows a map of matter


@pytest.mark.parametrize(
    ("at_home", "away_m", "lost"), [(0, 3.0, False), (1, 3.0, True), (0, 0.8, True)]
)
def test_in_a_home_that_is_new_places_far_away_do_not_refute_a_pose(
    at_home: bool, away_m: float, lost: bool, memory: SlamMemory, ride: Drive
) -> None:
    finder = SelfFinder(CONFIG, memory.places if at_home else None)
    finder._relocaliser = Insists(Glimpse(SE2(away_m), True))  # type: ignore[assignment]
    seen = next(event for event in ride.events if isinstance(event, Seen))
    finder.judge(seen, familiar=0, pose=SE2(), cov=SURE)
    assert finder.lost is lost


def elsewhere(seen: Seen) -> Seen:
    """The next frame, in which nothing of this one is found again."""
    others = tuple(replace(m, track_id=m.track_id + 1000) for m in seen.landmarks)
    return replace(seen, t_ns=seen.t_ns + S // 10, landmarks=others, motion=None)


@pytest.mark.parametrize(
    ("inliers", "quality", "late_s", "lost"),
    [(60, 0.6, 0.0, True), (20, 0.6, 0.0, False), (60, 0.1, 0.0, False), (60, 0.6, 1.0, False)],
    ids=["crowd", "few points", "in the dark", "after a pause"],
)
def test_a_crowd_of_points_that_ends_at_once_tells_that_somebody_carried_the_robot(
    inliers: int, quality: float, late_s: float, lost: bool, ride: Drive
) -> None:
    finder = SelfFinder(CONFIG)
    seen = next(e for e in ride.events if isinstance(e, Seen) and len(e.landmarks) > 6)
    motion = VisualMotion(SE2(), np.eye(3), inliers)
    finder.follow(replace(seen, quality=0.8, motion=motion))
    after = elsewhere(seen)
    finder.follow(replace(after, quality=quality, t_ns=after.t_ns + round(late_s * S)))
    assert finder.lost is lost


def test_what_was_seen_before_a_break_does_not_speak_for_the_place_after_it(ride: Drive) -> None:
    asked: list[int] = []

    class Asked:
        def look(self, *arguments: object) -> None:
            asked.append(arguments[-1])  # type: ignore[arg-type]

    finder = SelfFinder(CONFIG)
    finder._relocaliser = Asked()  # type: ignore[assignment]
    seen = next(e for e in ride.events if isinstance(e, Seen) and len(e.landmarks) > 6)
    few = VisualMotion(SE2(), np.eye(3), 20)
    for frame in (replace(seen, motion=few), elsewhere(seen)):
        finder.follow(frame)
        finder.judge(frame, familiar=0, pose=SE2(), cov=SURE)
    assert asked[-1] == elsewhere(seen).t_ns > asked[0]


def test_after_a_break_it_is_sure_once_it_sees_what_it_knows(
    memory: SlamMemory, ride: Drive
) -> None:
    finder = SelfFinder(CONFIG, memory.places)
    seen = next(e for e in ride.events if isinstance(e, Seen) and len(e.landmarks) > 6)
    finder.follow(replace(seen, motion=VisualMotion(SE2(), np.eye(3), 20)))
    finder.judge(seen, familiar=3, pose=SE2(), cov=SURE)
    told = [finder.unconfirmed]
    for k, familiar in enumerate((0, 2, 3), start=1):
        after = replace(elsewhere(seen), t_ns=seen.t_ns + k * S // 10)
        if k == 1:
            finder.follow(after)
        finder.judge(after, familiar, pose=SE2(), cov=SURE)
        told.append(finder.unconfirmed)
    assert told == [False, True, True, False] and not finder.lost


def test_a_pose_that_is_confirmed_does_not_jump(memory: SlamMemory, ride: Drive) -> None:
    slam = awake(memory, ride, 40.0)
    last_ns = max(e.t_ns for e in ride.events if isinstance(e, Seen) and e.t_ns < 52 * S)
    for event in ride.events:  # what moved it since its last frame
        if last_ns < event.t_ns < last_ns + S and not isinstance(event, Seen):
            slam.odometry(event)
    slam.lift()
    before = slam.pose_at(last_ns + S // 2)
    slam.confirm(SURE)
    after = slam.pose_at(last_ns + S // 2)
    assert after.health == "ok"
    assert np.allclose(after.world_from_base.log(), before.world_from_base.log(), atol=1e-9)


def test_in_a_foreign_home_it_stays_lost(memory: SlamMemory) -> None:
    slam = Slam(CONFIG, ROBOT, memory)
    told = play(slam, drive(12, limit_s=30.0), 0.0, 30.0)
    assert all(estimate.health == "lost" for _, estimate, _ in told)


def test_a_memory_of_a_memory_is_the_same(memory: SlamMemory) -> None:
    again = Slam(CONFIG, ROBOT, memory).memory()
    for name in ("kind", "height_m", "sightings", "visits", "signature", "signature_of"):
        assert np.array_equal(getattr(again, name), getattr(memory, name), equal_nan=True), name
    assert np.array_equal(again.state[3:], memory.state[3:])
    assert np.array_equal(again.cov[7:, 7:], memory.cov[7:, 7:])  # but for pose and calibration
    assert np.array_equal(again.places.xy_m, memory.places.xy_m)
