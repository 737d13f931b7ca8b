"""From pictures to a map: perception, EKF-SLAM, the grid."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from robot.config.section import Count, Fraction, NotNegative, Positive, Section


class PerceptionConfig(Section, frozen=True):
    """From a pair of images to landmarks and scan."""

    matcher: Literal["onnx", "sgbm", "given"] = "sgbm"
    model: str = ""  # ONNX file; empty: the manifest's default
    onnx_threads: Annotated[int, Meta(ge=1, le=16)] = 1
    max_disparity_px: Annotated[int, Meta(ge=16, le=256, multiple_of=16)] = 64
    min_confidence: Fraction = 0.8  # of the network; at 0.5 some near things look like free floor
    image_noise: NotNegative = 2.0  # grey levels of one sigma; flat walls are told by it
    # scan
    min_obstacle_m: Positive = 0.02  # lower things are driven over
    max_obstacle_m: Positive = 0.12  # higher things are driven under
    scan_range_m: Annotated[float, Meta(gt=0.2, le=10.0)] = 3.0
    scan_bearings: Annotated[int, Meta(ge=8, le=720)] = 120
    # landmarks
    max_tracks: Annotated[int, Meta(ge=8, le=500)] = 120
    max_landmarks: Count = 40  # handed on per frame
    landmark_age: Count = 5  # frames that a point must have been followed
    landmark_range_m: Positive = 5.0
    edges: bool = True  # vertical edges beside points
    edge_every: Count = 2  # frames from one search for them to the next
    max_step_m: Positive = 0.3  # of visual odometry between two frames: more is a mistake
    # dock marker
    marker_every: Count = 3  # frames between two searches while no marker is in sight


class SlamConfig(Section, frozen=True):
    """The EKF and its association."""

    # odometry
    wheel_noise_m_per_sqrt_m: Positive = 0.004  # random walk of a wheel's travel on firm floor
    slip_noise_m_per_sqrt_m: NotNegative = 0.025  # and by slips that nothing notices
    wheel_scale_sigma: NotNegative = 0.02  # how wrong a wheel's diameter may be, relative
    track_scale_sigma: NotNegative = 0.02  # and the width between the wheels
    gyro_noise_rad_per_sqrt_s: Positive = 0.001
    gyro_bias_sigma_radps: NotNegative = 0.02  # before the first standstill
    gyro_bias_walk: NotNegative = 0.00002  # rad/s per sqrt(s)
    slip_chi2: Positive = 12.0  # above: the wheels turned without the floor
    # the filter
    invariant: bool = True  # errors turn with the heading: an honest one, see ekf.py
    # association
    range_noise_factor: Positive = 4.0  # on variances of landmarks, as errors last many frames
    bearing_noise_factor: Positive = 4.0
    view_sigma_m: NotNegative = 0.02  # a landmark found again is not quite the same point
    marker_range_m: Positive = 0.9  # farther, a marker looks smaller than it is
    marker_noise_factor: Positive = 4.0
    gate_chi2: Positive = 11.8  # two degrees of freedom
    huber_chi2: Positive = 4.0  # beyond, a sight counts less
    height_gate_m: Positive = 0.05
    height_gate_slope: NotNegative = 0.04  # metres per metre of range
    max_hamming: Annotated[int, Meta(ge=0, le=256)] = 60  # of 256 bits
    hamming_weight: NotNegative = 0.1  # chi2 per bit
    ambiguity: NotNegative = 2.0  # a second choice must cost this much more
    consensus: Count = 4  # agreeing pairs before a landmark is found again
    consensus_again: Count = 3  # of them long unseen, where they would move the pose far
    again_chi2: Positive = 4.6  # and each as near as nine in ten would be
    # the map
    max_landmarks: Count = 180  # awake; the farther ones sleep
    landmarks_per_m2: Count = 6  # kept where they are more than the filter can hold
    max_observations: Count = 30  # used of one frame
    provisional_sightings: Count = 6
    init_range_m: Positive = 3.0
    spacing_m: NotNegative = 0.15
    sectors: Count = 6
    landmarks_per_sector: Count = 4
    min_move_m: NotNegative = 0.02  # a frame from the same place teaches nothing
    min_turn_rad: NotNegative = 0.03
    # finding itself
    max_places: Count = 4000  # points by which rooms are recognised
    place_sightings: Count = 6  # of a point before it becomes one
    # health
    degraded_sigma_m: Positive = 0.3  # one sigma of the position along its worse direction
    lost_sigma_m: Positive = 1.0


class MappingConfig(Section, frozen=True):
    """The occupancy grid."""

    resolution_m: Annotated[float, Meta(gt=0.0, le=0.2)] = 0.025
    max_range_m: Annotated[float, Meta(gt=0.2, le=10.0)] = 3.0  # farther ranges only say "free"
    trusted_range_m: Positive = 0.8  # evidence fades with the square of the distance beyond
    range_sigma_per_m2: NotNegative = 0.022  # sigma_z = this * z^2 (0.3 px at 228 px, 6 cm)
    min_thickness_m: Positive = 0.05  # what is hit is taken to be at least so deep
    free_weight: Positive = 0.4  # log-odds that one scan takes from a free cell ...
    hit_weight: Positive = 0.5  # ... and gives to an occupied one
    hit_over_free: Annotated[float, Meta(ge=1.0)] = 1.5  # weight of a hit among rays that pass
    free_below: Positive = 0.3  # log-odds under minus this: free
    occupied_above: Positive = 0.6
    max_free: Positive = 2.5  # bounded, so that a door that closes is believed within a second
    max_occupied: Positive = 3.5
    max_extent_m: Positive = 60.0  # nothing farther from the start is mapped
