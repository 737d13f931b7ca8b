"""What becomes of a request: carried out or refused, with a reason that a person can read."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING

from robot.errors import MapError, RequestError
from robot.geometry.se2 import SE2
from robot.mapping.annotations import Annotations, Area
from robot.messages import Answer, Beep, Request, StopOrder
from robot.mission.editing import NEEDS_ROOMS, Args, Reply, drawn_area, edit
from robot.mission.job import Job, room_job, spot_job, zone_job
from robot.mission.room_book import RoomBook
from robot.mission.settings import FAN_SHARES
from robot.mission.state import Situation, seconds
from robot.mission.states.charge import Charge
from robot.mission.states.dock import Dock
from robot.mission.states.goto import GoTo
from robot.mission.states.manual import Manual
from robot.mission.states.rest import Done, Error, Idle, Paused
from robot.mission.states.travel import Return
from robot.mission.verbs import is_number, numbers, understand

if TYPE_CHECKING:
    from robot.mission.mission import Mission

SPOT_M, SPOT_RANGE_M = 1.5, (0.6, 4.0)
ROOMS_S = 10.0  # waited for until the rooms are found


class Asks:
    """Judges requests one after the other; some wait until the rooms are known."""

    def __init__(self, book: RoomBook) -> None:
        self._book = book
        self._open: list[Request] = []

    def take(self, request: Request) -> None:
        """Judged at the next tick."""
        self._open.append(request)

    def carry_out(self, mission: Mission, now: Situation) -> None:
        """Judge what is open; every answer is added to `now.orders`."""
        if not self._open:
            return
        waiting = []
        for request in self._open:
            reply = self._judge(request, mission, now)
            if reply is None:
                waiting.append(request)
                continue
            now.orders.append(Answer(now.t_ns, request.request_id, request.verb, *reply))
        self._open = waiting

    def _judge(self, request: Request, mission: Mission, now: Situation) -> Reply | None:
        try:
            verb, args = understand((request.verb, *request.args))
        except RequestError as error:
            return Reply(False, str(error))
        rooms = None
        if verb.name in NEEDS_ROOMS:
            rooms = self._book.rooms(now)
            if rooms is None:
                late = seconds(request.t_ns, now.t_ns) > ROOMS_S
                return Reply(False, "the rooms could not be found in time") if late else None
        if verb.place == "map":
            return edit(verb.name, args, now, rooms)
        if verb.place == "books":
            return Reply(False, "only a running `sweeper run` with a --socket keeps books")
        if verb.name == "clean rooms":
            assert rooms is not None
            try:
                return _begin(mission, now, room_job(rooms, args))
            except MapError as error:
                return Reply(False, str(error))
        return _ACTIONS[verb.name](mission, now, args)


# ---------------------------------------------------------------------- runs


def _begin(mission: Mission, now: Situation, job: Job) -> Reply:
    """A new run, from the dock or from where the robot stands."""
    why_not = _busy(mission) or _unfit(now)
    if why_not:
        return Reply(False, why_not)
    mission.begin(now, job)
    return Reply(True, f"cleaning {job.what}")


def _busy(mission: Mission) -> str:
    state = mission.state
    if isinstance(state, Idle | Done | Error | Charge | Manual):
        return ""
    if isinstance(state, Paused):
        return "it is paused; ask resume, or stop first"
    return f"it is at work ({state.name}: {mission.reason}); ask stop first"


def _unfit(now: Situation) -> str:
    """Why no run can begin, empty if one can."""
    if now.contact.wheel_drop:
        return "its wheels hang in the air; put it on the floor"
    if now.battery_pct <= now.config.battery_return_pct:
        return f"the battery is at {now.battery_pct:.0f} %; let it charge first"
    area = now.notes.current.holding(now.pose.x_m, now.pose.y_m)
    if area is not None:
        return f"it stands in the no-go area {area.name!r}; carry it out or remove the area"
    return ""


def _start(mission: Mission, now: Situation, args: Args) -> Reply:
    return _begin(mission, now, Job())


def _spot(mission: Mission, now: Situation, args: Args) -> Reply:
    side_m = numbers(args)[0] if args else SPOT_M
    if not SPOT_RANGE_M[0] <= side_m <= SPOT_RANGE_M[1]:
        return Reply(False, f"a spot's side is {SPOT_RANGE_M[0]} to {SPOT_RANGE_M[1]} m")
    if now.contact.charging:
        return Reply(False, "it stands on its dock; carry it to the spot, or ask clean zones")
    return _begin(mission, now, spot_job(now.pose, side_m))


def _zones(mission: Mission, now: Situation, args: Args) -> Reply:
    try:
        return _begin(mission, now, zone_job(_wanted_zones(args, now.notes.current)))
    except MapError as error:
        return Reply(False, str(error))


def _wanted_zones(args: Args, drawn: Annotations) -> list[Area]:
    """Saved zones by name, or rectangles of four numbers each. Raises MapError."""
    if not all(map(is_number, args)):
        return [drawn.zone(name) for name in args]
    if len(args) % 4:
        raise MapError("give x y of two opposite corners of each zone, metres")
    given = Annotations()  # as good as a saved one
    for k in range(0, len(args), 4):
        area = drawn_area(given.free_name("zones", "zone"), numbers(args[k : k + 4]))
        given = given.add("zones", area)
    return list(given.zones)


def _go_to(mission: Mission, now: Situation, args: Args) -> Reply:
    x, y = numbers(args)
    why_not = _busy(mission) or _unfit(now)
    if not why_not and now.notes.current.distance_m(x, y) < now.robot.radius_m:
        why_not = "that place is forbidden by a no-go area or a virtual wall"
    if why_not:
        return Reply(False, why_not)
    mission.begin(now, Job(), GoTo(SE2(x, y)))
    return Reply(True, f"going to {x:.2f} {y:.2f}")


def _dock(mission: Mission, now: Situation, args: Args) -> Reply:
    if now.contact.charging:
        return Reply(False, "it is on its dock already")
    if isinstance(mission.state, Return | Dock):
        return Reply(False, "it is on its way to the dock already")
    if now.contact.wheel_drop:
        return Reply(False, "its wheels hang in the air; put it on the floor")
    mission.run.dock_tries, mission.run.charges = 0, False
    mission.set_off(now, "return", "dock was requested")
    return Reply(True, "going to the dock")


# ---------------------------------------------------------------------- on the way


def _pause(mission: Mission, now: Situation, args: Args) -> Reply:
    if not mission.state.active:
        return Reply(False, f"there is nothing to pause: it is {mission.state.name}")
    now.desk.drop()
    mission.change(now, Paused(mission.state), "pause was requested")
    return Reply(True, "paused")


def _resume(mission: Mission, now: Situation, args: Args) -> Reply:
    state = mission.state
    if not isinstance(state, Paused):
        return Reply(False, f"there is nothing to resume: it is {state.name}, not paused")
    mission.set_off(now, state.before, "resume was requested")
    return Reply(True, f"going on ({state.before.name})")


def _stop(mission: Mission, now: Situation, args: Args) -> Reply:
    if isinstance(mission.state, Idle):
        return Reply(True, "it stands still already")
    now.desk.drop()
    now.orders.append(StopOrder(now.t_ns, "stop was requested"))
    mission.change(now, Idle(), "stop was requested")
    return Reply(True, "stopped")


def _locate(mission: Mission, now: Situation, args: Args) -> Reply:
    now.orders.append(Beep(now.t_ns))
    return Reply(True, "beeping")


def _fan(mission: Mission, now: Situation, args: Args) -> Reply:
    try:
        if args:
            now.settings.set_fan(args[0])
    except RequestError as error:
        return Reply(False, str(error))
    data = {"level": now.settings.fan, "levels": list(FAN_SHARES)}
    return Reply(True, f"the fan's level is {now.settings.fan}", json.dumps(data))


def _manual(mission: Mission, now: Situation, args: Args) -> Reply:
    v_mps, yaw_rate_radps = numbers(args)
    why_not = _busy(mission)
    if not why_not and now.contact.wheel_drop:
        why_not = "its wheels hang in the air; put it on the floor"
    if why_not:
        return Reply(False, why_not)
    if not isinstance(mission.state, Manual):
        mission.change(now, Manual(), "driving by hand was requested")
    state = mission.state
    assert isinstance(state, Manual)
    state.order(now.t_ns, v_mps, yaw_rate_radps)
    return Reply(True, f"driving by hand for {now.control.manual_expires_s * 1000:.0f} ms")


_ACTIONS: dict[str, Callable[[Mission, Situation, Args], Reply]] = {
    "start": _start,
    "pause": _pause,
    "resume": _resume,
    "stop": _stop,
    "dock": _dock,
    "locate": _locate,
    "spot": _spot,
    "clean zones": _zones,
    "go to": _go_to,
    "manual": _manual,
    "fan": _fan,
}
