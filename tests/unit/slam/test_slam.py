"""The whole of SLAM in a synthetic flat."""

import math

import numpy as np
import pytest
from synthetic_flat import NO_SCAN, Drive, Faults, aligned_rmse_m, drive, see_marker

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import ImuSample, PoseEstimate, Seen, WheelTravel
from robot.slam.slam import Slam

MS = 1_000_000
LOOP = np.array(  # through a door, round a room and back: about a minute
    [
        *[(0, 0), (-0.5, 0), (-1.8, -0.8), (-3.2, -0.8), (-4.4, -2.0), (-3.0, -2.0), (-3.0, -0.9)],
        *[(-1.7, -0.8), (-0.6, -1.6), (-0.6, 0.8), (-0.5, 0.0)],
    ],
    dtype=float,
)


def play(ride: Drive, slam: Slam, kinds: tuple[type, ...] = (WheelTravel, ImuSample)) -> np.ndarray:
    """Feed the events of the `kinds` and the frames; the estimates (n, 3) at the frames."""
    poses = []
    for event in ride.events:
        if isinstance(event, Seen):
            pose = slam.see(event).world_from_base
            poses.append((pose.x_m, pose.y_m, pose.yaw_rad))
        elif isinstance(event, kinds):
            slam.odometry(event)
    return np.array(poses)


def new_slam(**keys: object) -> Slam:
    return Slam(SlamConfig(**keys), RobotConfig())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_drive_with_slip_stays_within_four_centimetres(seed: int) -> None:
    ride = drive(seed, path=LOOP)
    slam = new_slam()
    poses = play(ride, slam)
    truth = ride.truth[: len(poses)]
    assert aligned_rmse_m(poses, truth) < 0.04
    yaw_error = (poses[:, 2] - truth[:, 2] + math.pi) % (2 * math.pi) - math.pi
    assert np.abs(yaw_error).max() < 0.06
    assert slam.pose_at(int(ride.truth_t_ns[-1])).health == "ok"


def test_landmarks_beat_odometry_alone() -> None:
    ride = drive(4, path=LOOP, faults=Faults(wheel_scale=0.03, gyro_noise_radps=0.02))
    blind = [
        Seen(e.t_ns, e.arrived_ns, e.seq, (), NO_SCAN, 0.0) if isinstance(e, Seen) else e
        for e in ride.events
    ]
    alone = play(Drive(blind, ride.truth_t_ns, ride.truth), new_slam())
    truth = ride.truth[: len(alone)]
    with_landmarks = play(ride, new_slam())
    assert aligned_rmse_m(alone, truth) < 0.5  # odometry alone still works
    assert aligned_rmse_m(with_landmarks, truth) < 0.4 * aligned_rmse_m(alone, truth)


def test_without_a_gyro_and_without_wheels() -> None:
    ride = drive(5, path=LOOP[:7])
    for kinds, bound_m in (((WheelTravel,), 0.1), ((ImuSample,), 0.1), ((), 0.15)):
        poses = play(ride, new_slam(), kinds)
        assert aligned_rmse_m(poses, ride.truth[: len(poses)]) < bound_m, kinds


def test_the_state_is_bounded_and_its_covariance_positive_definite() -> None:
    ride = drive(6, limit_s=40.0, path=LOOP)
    slam = new_slam(max_landmarks=40)
    play(ride, slam)
    places, covs = slam.landmarks()
    assert 20 < len(places) <= 40 + 12  # pruned once a second
    assert covs.shape == (len(places), 2, 2)
    np.linalg.cholesky(slam._ekf.P)


def test_same_events_same_bits() -> None:
    ride = drive(7, limit_s=20.0, path=LOOP)
    assert np.array_equal(play(ride, new_slam()), play(ride, new_slam()))


def straight(slam: Slam, until_ms: int, speed_mps: float = 0.2) -> None:
    for t_ms in range(0, until_ms + 1, 20):
        slam.odometry(ImuSample(t_ms * MS, 0.0))
        rolled = speed_mps * t_ms * 1e-3
        slam.odometry(WheelTravel(t_ms * MS, t_ms * MS, rolled, rolled))


def empty(t_ms: int) -> Seen:
    return Seen(t_ms * MS, t_ms * MS, 0, (), NO_SCAN, 0.0)


def at_x(estimate: PoseEstimate) -> float:
    return estimate.world_from_base.x_m


def test_pose_at_any_time() -> None:
    slam = new_slam()
    assert at_x(slam.pose_at(0)) == 0.0
    straight(slam, 1000)
    for t_ms in range(100, 1000, 100):
        slam.see(empty(t_ms))
    assert at_x(slam.pose_at(450 * MS)) == pytest.approx(0.09, abs=1e-3)  # between two frames
    assert at_x(slam.pose_at(955 * MS)) == pytest.approx(0.191, abs=1e-3)  # odometry since
    assert at_x(slam.pose_at(1060 * MS)) == pytest.approx(0.212, abs=1e-3)  # extrapolated
    assert at_x(slam.pose_at(5000 * MS)) == pytest.approx(0.22, abs=1e-3)  # not for ever
    assert at_x(slam.pose_at(-5 * MS)) == 0.0
    before, after = slam.pose_at(900 * MS).cov, slam.pose_at(1000 * MS).cov
    assert after[0, 0] > before[0, 0] and np.array_equal(after, after.T)


def test_a_late_frame_changes_nothing() -> None:
    slam = new_slam()
    straight(slam, 1000)
    slam.see(empty(900))
    there = slam.pose_at(1000 * MS)
    late = slam.see(empty(500))
    assert late.t_ns == 500 * MS and at_x(late) == pytest.approx(0.1, abs=1e-3)
    assert slam.pose_at(1000 * MS).world_from_base == there.world_from_base


def test_without_frames_the_filter_follows_the_odometry() -> None:
    slam = new_slam()
    straight(slam, 30_000)
    assert at_x(slam.pose_at(30_000 * MS)) == pytest.approx(6.0, abs=0.01)
    assert at_x(slam.pose_at(25_000 * MS)) == pytest.approx(5.0, abs=0.02)


def test_health_follows_the_uncertainty() -> None:
    slam = new_slam(degraded_sigma_m=0.1, lost_sigma_m=0.3)
    straight(slam, 1000)
    assert slam.pose_at(1000 * MS).health == "ok"
    slam = new_slam(degraded_sigma_m=0.1, lost_sigma_m=0.3)
    health = [slam.see(empty(t_ms)).health for t_ms in range(0, 3000, 100)]  # nothing moves it
    assert health[0] == "ok" and health[-1] == "lost" and "degraded" in health


def stand_then_drive(slam: Slam, bias_radps: float) -> float:
    """The yaw believed after 2 s on the spot and 10 s straight on."""
    for t_ms in range(0, 2001, 20):
        slam.odometry(ImuSample(t_ms * MS, bias_radps))
        slam.odometry(WheelTravel(t_ms * MS, t_ms * MS, 0.0, 0.0))
        if t_ms % 100 == 0:
            slam.see(empty(t_ms))
    for t_ms in range(2020, 12_001, 20):
        slam.odometry(ImuSample(t_ms * MS, bias_radps))
        rolled = 0.0002 * (t_ms - 2000)
        slam.odometry(WheelTravel(t_ms * MS, t_ms * MS, rolled, rolled))
    return slam.pose_at(12_000 * MS).world_from_base.yaw_rad


def test_standing_still_teaches_the_gyros_bias_anew_at_every_start() -> None:
    slam = new_slam()
    assert stand_then_drive(slam, 0.015) == pytest.approx(0.0, abs=0.02)
    again = Slam(SlamConfig(), RobotConfig(), slam.memory())
    again.put(SE2(), np.diag([0.01, 0.01, 0.01]) ** 2)
    assert stand_then_drive(again, -0.015) == pytest.approx(0.0, abs=0.02)


def test_the_marker_brings_the_robot_home() -> None:
    """Driving out and back over carpet that drags the robot, the marker says where it is."""
    rng = np.random.default_rng(9)
    slam = new_slam()
    rolled, last = 0.0, None
    for k in range(1200):
        t_ns = k * 20 * MS
        rolled += 0.0 if k < 100 else -0.002 if k < 600 else 0.002 if k < 1100 else 0.0
        back = 1.06 if k >= 600 else 1.0  # the way back is felt as longer than it is
        slam.odometry(ImuSample(t_ns, float(rng.normal(0.0, 0.002))))
        felt = rolled if k < 600 else -1.0 + (rolled + 1.0) * back
        slam.odometry(WheelTravel(t_ns, t_ns, felt, felt))
        if k % 5 == 0:
            marker = see_marker(np.array([rolled, 0.0, 0.0]), rng)
            last = slam.see(Seen(t_ns, t_ns, k, (), NO_SCAN, 0.0, None, marker))
    assert last is not None
    home = last.world_from_base
    assert home.distance_m(SE2()) < 0.015 and abs(wrap_angle(home.yaw_rad)) < 0.03


def test_faultless_robot_is_nearly_perfect() -> None:
    faults = Faults(False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0, 0.1)
    ride = drive(1, path=LOOP[:6], faults=faults)
    poses = play(ride, new_slam())
    assert aligned_rmse_m(poses, ride.truth[: len(poses)]) < 0.008
