"""Every verb of the runtime's table can be asked over REST, and its arguments arrive whole."""

import json
from pathlib import Path

import pytest
from serving import wait_for

from robot.mission.settings import FAN_SHARES
from robot.mission.verbs import VERBS, understand
from robot.serve.capability import FAN_LEVELS, capabilities
from robot.serve.fields import BadBody, fields, many, read_body, words
from robot.serve.runs import Ring

ASKED = {
    ("spot", "/spot"): ({"side_m": 2.0}, ("2.0",)),
    ("locate", "/locate"): ({}, ()),
    ("clean zones", "/zones/clean"): (
        {"zones_m": [[0, 0, 1, 1], [-1, 0.25, 2, 3]]},
        ("0.0", "0.0", "1.0", "1.0", "-1.0", "0.25", "2.0", "3.0"),
    ),
    ("clean rooms", "/rooms/clean"): (
        {"rooms": ["room 1", "K\u00fcche"]},
        ("room 1", "K\u00fcche"),
    ),
    ("go to", "/go-to"): ({"x_m": 0.123456, "y_m": -2}, ("0.1235", "-2.0")),
    ("clean zones", "/zones/clean-named"): ({"zones": ["Rug", "Sofa"]}, ("Rug", "Sofa")),
    ("manual", "/manual"): ({"v_mps": 0.1, "yaw_rate_radps": 0.5}, ("0.1", "0.5")),
}


def post(server, path, body):
    return server.json(f"/api/v1{path}", "POST", body=json.dumps(body))


def test_no_verb_of_the_table_is_forgotten():
    """A new verb of the runtime needs a file here."""
    known = type("Known", (), {})
    needed = set()
    for capability in capabilities():
        world = type("World", (), {"connected": True, "resolution_m": 1, "landmarks": []})()
        world.hello, world.has = {}, lambda verb: needed.add(verb) or True
        known.world, known.runs, known.has_fleet = world, type("R", (), {"present": 1}), True
        known.installed, known.ring = Path("/nowhere"), Ring(None)
        capability.has(known)
    assert needed == {verb.name for verb in VERBS}


@pytest.mark.parametrize(("verb", "path"), ASKED)
def test_a_request_arrives_with_its_arguments(house, verb, path):
    server, robot, _ = house
    body, arguments = ASKED[verb, path]
    status, answer = post(server, path, body)
    assert status == 200 and answer["accepted"], answer
    wait_for(lambda: robot.asked and robot.asked[-1] == (verb, arguments))
    understand((verb, *arguments))


def test_the_fan_has_levels_that_the_robot_keeps(house):
    server, robot, _ = house
    assert tuple(FAN_SHARES) == FAN_LEVELS
    assert post(server, "/fan", {"level": "low"})[0] == 200
    assert server.json("/api/v1/fan")[1]["level"] == "low"
    assert server.json("/api/v1/fan")[1]["levels"] == list(FAN_LEVELS)
    assert post(server, "/fan", {"level": "turbo"})[0] == 400
    assert robot.books.settings.fan == "low"


def test_releases_are_shown_and_never_touched(house):
    server, _, folder = house
    assert server.json("/api/v1/update")[0] == 404  # nothing is installed
    home = folder / "opt"
    for name in ("0.1.0-aaaa", "0.2.0-bbbb"):
        (home / "releases" / name).mkdir(parents=True)
    (home / "previous").symlink_to("releases/0.1.0-aaaa")
    (home / "current").symlink_to("releases/0.2.0-bbbb")
    (home / "trial").write_text('{"release": "0.2.0-bbbb", "starts": 2}')
    (home / "history.log").write_text("".join(f"line {n}\n" for n in range(30)))
    shown = server.json("/api/v1/update")[1]
    assert (shown["current"], shown["previous"]) == ("0.2.0-bbbb", "0.1.0-aaaa")
    assert shown["trial_starts"] == 2 and shown["history"][-1] == "line 29"
    assert shown["update"].startswith("git pull") and shown["rollback"].startswith("sudo")
    (home / "trial").write_text("[" * 5000)
    (home / "previous").unlink()
    shown = server.json("/api/v1/update")[1]
    assert shown["trial_starts"] is None and shown["rollback"] == ""
    assert server.ask("/api/v1/update", "POST", body="{}")[0] == 405
    (home / "current").unlink()


def test_a_calibration_is_followed_from_outside(house):
    server, *_ = house
    assert post(server, "/calibration/begin", {"board": "a tray"})[0] == 409
    assert post(server, "/calibration/begin", {})[0] == 200
    shown = server.json("/api/v1/calibration/views")[1]
    assert shown["possible"] and shown["running"] and shown["wanted"] == 20
    assert post(server, "/calibration/save", {})[1]["reason"].startswith("there is no result yet")
    assert post(server, "/calibration/end", {})[0] == 200
    status, headers, body = server.ask("/api/v1/calibration/board.png", timeout=120)
    assert status == 200 and headers["content-type"] == "image/png"
    assert body.startswith(b"\x89PNG")


def test_rooms_are_listed_split_joined_and_named(house):
    server, robot, _ = house
    robot.books.forget()
    rooms = server.json("/api/v1/rooms")[1]["rooms"]
    assert [room["name"] for room in rooms] == ["room 1", "room 2"]
    assert post(server, "/rooms/name", {"room": "room 2", "name": "Kitchen"})[0] == 200
    line = {"x_m": -2.5, "y_m": 0, "end_x_m": 1.2, "end_y_m": 0}
    status, answer = post(server, "/rooms/split", line)
    assert status == 200, answer
    names = [room["name"] for room in server.json("/api/v1/rooms")[1]["rooms"]]
    assert len(names) == 3 and "Kitchen" in names
    one, other = [name for name in names if name != "Kitchen"]
    assert post(server, "/rooms/join", {"room": one, "other": other})[0] == 200
    assert len(server.json("/api/v1/rooms")[1]["rooms"]) == 2
    assert post(server, "/rooms/name", {"room": "nowhere", "name": "x"})[0] == 409


def test_drawings_come_and_go_and_come_back(house):
    server, robot, _ = house
    robot.books.forget()
    shown = lambda: server.json("/api/v1/drawings")[1]  # noqa: E731
    assert post(server, "/no-go/add", {"corners_m": [[1, 1], [2, 2]]})[0] == 200
    wall = {"x_m": 1, "y_m": -1, "end_x_m": 2, "end_y_m": -1}
    assert post(server, "/walls/add", wall)[0] == 200
    notes = shown()["annotations"]
    assert len(notes["no_go"][0]["corners_m"]) == 4 and notes["walls"][0]["name"] == "wall 1"
    assert post(server, "/drawings/keep", {"name": "summer"})[0] == 200
    assert post(server, "/walls/remove", {"name": "wall 1"})[0] == 200
    assert post(server, "/no-go/remove", {"name": "area 1"})[0] == 200
    assert post(server, "/drawings/undo", {})[0] == 200
    assert len(shown()["annotations"]["no_go"]) == 1 and shown()["snapshots"] == ["summer"]
    assert post(server, "/drawings/restore", {"name": "summer"})[0] == 200
    assert len(shown()["annotations"]["walls"]) == 1
    status, answer = post(server, "/no-go/add", {"corners_m": [[-1, -1], [1, 1]]})
    assert status == 409 and "catch the robot" in answer["reason"]
    assert post(server, "/no-go/remove", {"name": "nothing"})[0] == 409


def test_schedule_parts_and_logbook(house):
    server, *_ = house
    new = {"days": "mon,wed", "time": "09:30", "words": ["clean rooms", "Kitchen"]}
    assert post(server, "/schedules/add", new)[0] == 200
    entry = server.json("/api/v1/schedules")[1]["entries"][0]
    assert entry["days"] == ["mon", "wed"] and entry["words"] == ["clean", "rooms", "Kitchen"]
    assert post(server, "/schedules/add", {"days": "daily", "time": "25:00"})[0] == 409
    assert post(server, "/schedules/remove", {"number": 1})[0] == 200
    assert server.json("/api/v1/schedules")[1]["entries"] == []
    assert post(server, "/schedules/remove", {"number": 1})[0] == 409
    parts = server.json("/api/v1/consumables")[1]
    assert set(parts["hours"]) == set(parts["life_h"]) == {"brush", "filter", "sensors"}
    assert post(server, "/consumables/reset", {"part": "brush"})[0] == 200
    assert server.json("/api/v1/logbook")[1]["runs"] == []
    assert server.json("/api/v1/calibration")[0] == 200


def test_the_page_hears_what_was_drawn(house):
    from websockets.sync.client import connect

    server, robot, _ = house
    robot.books.forget()
    key = {"Authorization": f"Bearer {server.token}"}
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as line:
        post(server, "/no-go/add", {"corners_m": [[1, 1], [2, 2], [1, 2]]})

        def drawn():
            words = line.recv(timeout=10)
            news = json.loads(words) if isinstance(words, str) else {}
            return news.get("type") == "drawn" and news["annotations"]["no_go"] and news

        news = wait_for(drawn)
    assert news["parts"]["life_h"]["brush"] > 0 and len(news["rooms"]) == 2


BAD = (
    ("/go-to", {"x_m": 1}), ("/go-to", {"x_m": 1, "y_m": "2"}), ("/go-to", {"x_m": 1, "y_m": 1e9}),
    ("/go-to", {"x_m": 1, "y_m": True}), ("/go-to", {"x_m": 1, "y_m": 2, "z": 3}), ("/go-to", [1]),
    ("/rooms/clean", {"rooms": []}), ("/rooms/clean", {"rooms": ["a\nb"]}),
    ("/rooms/clean", {"rooms": ["\ud800"]}), ("/zones/clean", {"zones_m": [[0, 0, 1]]}),
    ("/zones/clean", {"zones_m": [[0, 0, 1, 1]] * 11}), ("/consumables/reset", {"part": "wheel"}),
    ("/schedules/remove", {"number": 1.5}), ("/spot", {"side_m": 9}),
    ("/manual", {"v_mps": 3, "yaw_rate_radps": 0}),
)  # fmt: skip


@pytest.mark.parametrize(("path", "body"), BAD)
def test_a_body_that_makes_no_sense_is_told_so(house, path, body):
    server, robot, _ = house
    before = len(robot.asked)
    status, answer = post(server, path, body)
    assert status == 400 and len(answer["error"]) > 10
    assert len(robot.asked) == before


def test_bodies_are_read_as_they_are_described():
    schema = fields({"x": {"type": "number", "minimum": 0, "maximum": 1}}, ("x",))
    assert read_body(schema, b"") == {} and read_body(schema, b'{"x": 1}') == {"x": 1}
    for bad in (b"{", b"[]", b"null", b'{"x": NaN}', b"[" * 5000, b"\xff", b'{"x": 1e999}'):
        with pytest.raises(BadBody):
            read_body(schema, bad)
    nested = fields({"a": many(many({"type": "string"}, 1, 2), 1, 2)})
    assert words(nested, {"a": [["x"], ["y", "z"]]}) == ["x", "y", "z"]


def test_what_would_not_fit_on_one_line_is_refused_before(house):
    server, *_ = house
    status, answer = post(server, "/rooms/clean", {"rooms": ["\U0001f9f9" * 40] * 30})
    assert status == 409 and "too long" in answer["reason"]
