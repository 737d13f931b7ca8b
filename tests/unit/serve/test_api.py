"""The API says what the robot knows, does what it is asked, and shows only what it has."""

import json
import struct
import zlib
from pathlib import Path

from serving import served, wait_for

from robot.serve.app import shown
from robot.serve.capability import capabilities
from robot.serve.openapi import describe
from robot.serve.runs import Ring


def test_every_button_reaches_the_robot(house):
    server, robot, _ = house
    for verb in ("start", "pause", "resume", "dock", "stop"):
        status, answer = server.json(f"/api/v1/{verb}", "POST")
        assert status == 200 and answer["accepted"], answer
        wait_for(lambda verb=verb: robot.requests[-1:] == [verb])
    wait_for(lambda: server.json("/api/v1/status")[1]["reason"] == "stop was requested")


def test_status_tells_what_and_why(house):
    _, status = house[0].json("/api/v1/status")
    assert status["battery_pct"] == 83.0 and status["software"] and status["id"] == "t1"
    assert set(status["pose"]) >= {"x_m", "y_m", "yaw_rad", "cov", "health"}
    assert status["stage_ms"] == {"disparity": 12.5}


def test_the_map_is_a_png_of_the_known_floor(house):
    status, headers, body = house[0].ask("/api/v1/map.png")
    assert status == 200 and headers["content-type"] == "image/png"
    width, height = struct.unpack(">II", body[16:24])
    at = body.index(b"IDAT")
    size = struct.unpack(">I", body[at - 4 : at])[0]
    pixels = zlib.decompress(body[at + 4 : at + 4 + size])
    assert len(pixels) == height * (width + 1) and {0, 1, 2, 3} <= set(pixels) | {0}
    crc = struct.unpack(">I", body[at + 4 + size : at + 8 + size])[0]
    assert crc == zlib.crc32(body[at : at + 4 + size])


def test_landmarks_checks_and_pictures(house):
    server, *_ = house
    assert len(server.json("/api/v1/landmarks")[1]["points"]) == 2
    assert server.json("/api/v1/check")[1]["checks"][0]["remedy"] == "delete runs"
    for eye in ("left", "disparity"):
        assert server.ask(f"/api/v1/camera/{eye}")[2].startswith(b"\xff\xd8")
    assert server.ask("/api/v1/camera/right")[0] == 404


def test_history_lists_and_hands_out(house):
    server, *_ = house
    run = server.json("/api/v1/runs")[1]["runs"][0]
    assert run["summary"] == {"state": "done", "covered_m2": 12.5}
    assert set(run["files"]) == {"summary.json", "map.png", "log.mcap"}
    status, headers, body = server.ask(f"/api/v1/runs/{run['id']}/log.mcap")
    assert status == 200 and len(body) == 256_000 == int(headers["content-length"])
    assert "attachment" in headers["content-disposition"]
    assert server.ask("/api/v1/runs?limit=0")[0] == 400
    assert server.ask("/api/v1/runs?limit=x")[0] == 400


def test_only_what_the_robot_has_is_shown(house):
    server, *_ = house
    listed = {c["name"] for c in server.json("/api/v1/capabilities")[1]["capabilities"]}
    paths = server.json("/api/v1/openapi.json")[1]["paths"]
    assert "fleet" not in listed and "/fleet" not in paths
    assert {"start", "pause", "resume", "stop", "dock", "map", "camera"} <= listed
    assert "/start" in paths and "post" in paths["/start"]
    assert b"/api/v1/start" in server.ask("/api/v1/docs")[2]


def test_a_robot_that_knows_less_shows_less():
    class World:
        hello, connected, resolution_m, landmarks = {"verbs": ["start"]}, True, None, []

        def has(self, verb):
            return verb in self.hello["verbs"]

    class Robot:
        world, has_fleet, name = World(), False, "r"
        runs = type("Runs", (), {"present": False})()
        installed, ring = Path("/nowhere"), Ring(None)

    names = {capability.name for capability in shown(Robot())}
    assert names == {"start", "status", "track", "check", "calibration", "bundle"}


def test_segments_of_the_log_are_listed_and_loaded_down(tmp_path):
    ring, run = tmp_path / "ring", tmp_path / "runs" / "20260102-030405-live"
    for folder, names in ((ring, ("log-000007.mcap", "log-000008.mcap")),
                          (run, ("before-log-000003.mcap",))):  # fmt: skip
        folder.mkdir(parents=True)
        for name in names:
            (folder / name).write_bytes(name.encode())
    (ring / "log-000009.mcap").symlink_to("/etc/hostname")
    (ring / "ended-in-order").touch()
    with served(tmp_path, tmp_path / "nobody.sock", log_ring=ring) as server:
        listed = server.json("/api/v1/logs")[1]["segments"]
        told = {segment["name"]: segment["bytes"] for segment in listed}
        assert told == {"log-000008.mcap": 15, "log-000007.mcap": 15}
        status, headers, body = server.ask("/api/v1/logs/log-000007.mcap")
        assert status == 200 and body == b"log-000007.mcap"
        assert 'filename="log-000007.mcap"' in headers["content-disposition"]
        for other in ("log-000009.mcap", "log-000001.mcap", "ended-in-order", "..%2Fkeys.json"):
            assert server.ask(f"/api/v1/logs/{other}")[0] == 404
        (saved,) = server.json("/api/v1/runs")[1]["runs"]
        assert saved["files"] == {"before-log-000003.mcap": 22}
        path = "/api/v1/runs/20260102-030405-live/before-log-000003.mcap"
        assert server.ask(path)[2] == b"before-log-000003.mcap"


def test_declarations_are_whole():
    names = [capability.name for capability in capabilities()]
    assert len(names) == len(set(names)) and "fleet" in names
    operations = [o for c in capabilities() for o in c.operations]
    assert len({(o.method, o.path) for o in operations}) == len(operations)
    document = describe(capabilities(), "all")
    ids = [o["operationId"] for p in document["paths"].values() for o in p.values()]
    assert len(ids) == len(set(ids))
    json.dumps(document)


def test_without_a_runtime_the_answer_is_a_sentence(tmp_path):
    from serving import served

    with served(tmp_path, tmp_path / "nobody.sock") as server:
        status, answer = server.json("/api/v1/start", "POST")
        assert status == 503 and "start" in answer["error"]
        status, answer = server.json("/api/v1/status")
        assert status == 200 and answer["state"] == "unreachable"
        assert server.ask("/")[0] == 200
