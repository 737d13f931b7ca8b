"""From a map to a clean floor: planning, control, the mission."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from robot.config.section import Count, Fraction, NotNegative, Positive, Section


class PlanningConfig(Section, frozen=True):
    """Coverage and routes."""

    margin_m: NotNegative = 0.010  # kept between the robot's rim and what is mapped
    thin_margin_m: NotNegative = 0.004  # more of it beside legs and other thin things
    min_passage_m: NotNegative = 0.01  # room to spare in a gap that leads to a small place only
    unknown_clearance_m: NotNegative = 0.08  # kept between the centre and unseen floor
    lane_overlap_m: NotNegative = 0.01  # neighbouring lanes share this much of the brush
    soft_clearance_m: Positive = 0.35  # routes prefer this much room around the centre
    slip_cost: NotNegative = 4.0  # a metre on which all is lost by slip costs so many more
    min_patch_m2: Positive = 0.01  # uncovered specks smaller than this are left
    min_sliver_m: NotNegative = 0.05  # and strips thinner than this
    worth_m2_per_m: NotNegative = 0.02  # floor that makes up for a metre of way to it
    horizon_m: NotNegative = 8.0  # paths end about there while the map grows; 0: never
    min_unseen_m2: Positive = 0.03  # smallest unseen floor worth a look
    turn_cost_m: NotNegative = (
        0.25  # a turn on the spot by 90 degrees costs as much as driving this
    )


class ControlConfig(Section, frozen=True):
    """Following and the safety gate."""

    acceleration_mps2: Positive = 0.6
    brake_mps2: Positive = 0.6  # what the drive can surely do; plans and the gate count on it
    yaw_acceleration_radps2: Positive = 8.0
    lookahead_m: Positive = 0.18  # a lateral error is steered away within about this distance
    heading_gain_per_s: Positive = 4.0
    drive_lag_s: NotNegative = 0.08  # from a command to the wheels
    corner_radius_m: NotNegative = 0.09  # turns between neighbouring lanes are driven round
    corner_cut_m: NotNegative = 0.01  # how far any other corner may be cut
    turn_in_place_rad: Positive = 0.6  # a larger heading error is turned away standing
    valid_for_ms: Annotated[int, Meta(ge=20, le=1000)] = 200
    wheels_stale_s: Positive = 0.3
    contact_stale_s: Positive = 0.5
    link_stale_s: Positive = 1.5
    seen_slow_s: Positive = 0.5
    seen_stop_s: Positive = 1.5
    stale_mps: NotNegative = 0.10
    unknown_mps: NotNegative = 0.12
    near_mps: NotNegative = 0.22  # beside something; it is met with less than half the speed
    touch_mps: Annotated[float, Meta(gt=0.0, le=0.15)] = 0.08  # with no free distance left
    back_mps: Annotated[float, Meta(gt=0.0, le=0.15)] = 0.12
    reaction_s: NotNegative = 0.2
    stop_gap_m: NotNegative = 0.02
    graze_m: NotNegative = 0.02
    memory_s: Positive = 12.0  # how long a seen obstacle is remembered without being seen again
    free_memory_s: Positive = 4.0  # how long seen free floor is believed to have stayed free
    memory_range_m: Positive = 1.2
    no_go_margin_m: NotNegative = 0.03  # kept between the footprint and what people forbade
    wheel_only_mps: Annotated[float, Meta(gt=0.0, le=0.1)] = 0.10  # without sight
    manual_expires_s: Annotated[float, Meta(gt=0.0, le=0.3)] = 0.2  # the dead man's handle


class MissionConfig(Section, frozen=True):
    """What a cleaning run does."""

    max_duration_s: Positive = 10800.0  # of cleaning; then the robot returns to its dock
    battery_return_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 20.0
    battery_stop_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 5.0  # stop where it is
    battery_resume_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 80.0  # go on after charging
    undock_m: Positive = 0.45
    look_radps: Positive = 0.8
    replan_growth_m2: Positive = 1.5  # known free floor gained that is worth a new plan
    replan_every_s: Positive = 20.0  # at most so often for growth
    plan_timeout_s: Positive = 10.0
    done_m2: NotNegative = 0.05  # less uncovered floor than this is clean
    fruitless_plans: Count = 3  # so many plans in a row without new floor end the cleaning
    fruitful_m2: NotNegative = 0.05
    staging_m: Positive = 0.7  # where the approach to the dock begins, before the docked pose
    dock_tries: Count = 3
    new_floor_mps: Positive = 0.15  # where no wheel has been yet: eyes do not see glass
    back_off_m: Annotated[float, Meta(gt=0.0, le=0.3)] = 0.10
    stuck_s: Positive = 4.0
    denied_give_up_s: Positive = 30.0  # the gate lets nothing move for so long: an error
    recover_tries: Count = 8  # within `recover_reset_m` of driving
    recover_reset_m: Positive = 0.5
    recover_limit_s: Positive = 35.0  # from first try to last, without work between two meetings
    recover_limit_m: Positive = 1.5  # backed off in all of them
    no_way_s: Positive = 22.0  # without a route to the dock before it says so
    blind_after_s: Positive = 2.5  # so long without sight is no hiccup
    blind_wait_s: Positive = 6.0  # sight may come back by itself
    blind_quality: Fraction = 0.03  # of a frame; less is darkness
    blind_limit_m: Positive = 12.0  # farther by the wheels alone it may be anywhere
    blind_limit_s: Positive = 150.0
    no_go_margin_m: NotNegative = 0.05  # plans keep so far off what people forbade
    brush: Fraction = 0.8
    fan: Fraction = 0.8  # at its level "high"
