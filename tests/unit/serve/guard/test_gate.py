"""The gate: every route of the real application, without a key, with a foreign page, too much."""

import base64
import contextlib
import socket
import threading
import time
from types import SimpleNamespace

import pytest
from starlette.routing import Route, WebSocketRoute
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from robot.errors import ConfigError
from robot.serve.guard.gate import Rules
from robot.serve.guard.keys import Keyring
from robot.serve.guard.limits import MAX_BODY_BYTES, Buckets
from robot.serve.main import ServeOptions, check, switch

VALUES = {"eye": "left", "run": "20260102-030405-clean", "file": "log.mcap"}


def routes(house):
    """(method, path) of everything that the application answers."""
    for route in house[0].app._app.routes:
        path = route.path.format(**VALUES) if "{" in route.path else route.path
        if isinstance(route, WebSocketRoute):
            yield "WEBSOCKET", path
        else:
            assert isinstance(route, Route)
            for method in sorted(route.methods):
                yield method, path


def test_without_a_key_nothing_is_open_but_health(house):
    server, robot, _ = house
    listed = list(routes(house))
    assert len(listed) > 25 and ("POST", "/api/v1/start") in listed
    before, opened = len(robot.requests), []
    for method, path in listed:
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Cookie": "sweeper=x"}):
            if method == "WEBSOCKET":
                with pytest.raises(InvalidStatus) as refused:
                    connect(f"ws://127.0.0.1:{server.port}{path}", additional_headers=headers)
                status = {403: 401}.get(refused.value.response.status_code)
            else:
                status, *_ = server.ask(path, method, token=False, **headers)
            if status not in (401, 429):
                opened.append((method, path, status))
        server.app._rules.failures._levels.clear()
    assert {(path, status) for _, path, status in opened} == {("/health", 200)}
    assert len(robot.requests) == before


def test_with_a_key_every_page_opens(house):
    server, *_ = house
    elsewhere = ("/fleet", "/bundle", "/logs/", "/update", "/board.png")
    for method, path in routes(house):
        if method == "GET" and not any(word in path for word in elsewhere):
            assert server.ask(path)[0] == 200, path


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "", "[::2]:80", "x" * 99]
)
def test_foreign_names_are_not_answered(house, host):
    assert house[0].ask("/api/v1/status", Host=host)[0] in (400, 421)
    assert house[0].ask("/health", Host=host)[0] in (400, 421)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1", "http://localhost:1", "http://["]
)
def test_foreign_pages_are_not_answered(house, origin):
    server, robot, _ = house
    before = len(robot.requests)
    assert server.ask("/api/v1/start", "POST", Origin=origin)[0] == 403
    assert server.ask("/api/v1/status", Origin=origin)[0] == 403
    with pytest.raises(InvalidStatus):
        connect(
            f"ws://127.0.0.1:{server.port}/api/v1/live",
            additional_headers={"Authorization": f"Bearer {server.token}", "Origin": origin},
        )
    assert len(robot.requests) == before


def test_a_cookie_alone_does_not_act(house):
    """What a form on a foreign page could send: the cookie, but no Origin of ours."""
    server, robot, _ = house
    cookie = f"{server.app._rules.cookie}={server.keys.new_session()}"
    before = len(robot.requests)
    assert server.ask("/api/v1/status", token=False, Cookie=cookie)[0] == 200
    assert server.ask("/api/v1/pause", "POST", token=False, Cookie=cookie)[0] == 401
    crossed = {"Cookie": cookie, "Origin": server.url, "Sec_Fetch_Site": "cross-site"}
    assert server.ask("/api/v1/pause", "POST", token=False, **crossed)[0] == 403
    assert len(robot.requests) == before
    own = {"Cookie": cookie, "Origin": server.url}
    assert server.ask("/api/v1/pause", "POST", token=False, **own)[0] == 200


def test_the_printed_address_becomes_a_cookie_that_scripts_cannot_read(house):
    server, *_ = house
    status, headers, _ = server.ask(f"/?token={server.keys.new_link()}", token=False)
    cookie = headers["set-cookie"]
    assert status == 303 and headers["location"] == "/"
    assert "HttpOnly" in cookie and "SameSite=strict" in cookie
    assert server.ask("/", token=False, Cookie=cookie.partition(";")[0])[0] == 200
    assert server.ask(f"/api/v1/status?token={server.token}", token=False)[0] == 401


def test_the_password_opens_and_guessing_is_slowed_down(house, monkeypatch):
    server, *_ = house
    # However slow this machine is: no try comes back while the test runs.
    monkeypatch.setattr(server.app._rules, "failures", Buckets(rate=1e-9, burst=10.0))
    server.keys.set_password("correct horse")

    def basic(password):
        key = base64.b64encode(f"owner:{password}".encode()).decode()
        return server.ask("/", token=False, Authorization=f"Basic {key}")

    status, headers, _ = basic("correct horse")
    assert status == 200 and "set-cookie" in headers
    statuses = [basic(f"guess {n}")[0] for n in range(14)]
    assert statuses.count(401) == 10 and statuses[-1] == 429
    assert basic("correct horse")[0] == 429


def test_a_browser_without_a_key_gets_a_page_that_loads_nothing(house):
    status, headers, body = house[0].ask("/", token=False, Accept="text/html")
    assert status == 401 and b"<form" in body
    assert b"src=" not in body and b"href=" not in body
    assert "sha256-" in headers["content-security-policy"]


def test_every_answer_carries_the_safety_headers(house):
    for path in ("/", "/health", "/app.js", "/nope", "/api/v1/status"):
        headers = house[0].ask(path)[1]
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"


def test_large_bodies_are_refused_unread(house):
    server, *_ = house
    assert server.ask("/api/v1/start", "POST", b"x" * (MAX_BODY_BYTES + 1))[0] == 413
    head = (
        f"POST /api/v1/start HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: Bearer {server.token}\r\nContent-Length: 1000000000\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
        client.sendall(head.encode())
        assert b" 413 " in client.recv(4096)


@pytest.mark.parametrize("length", ["-1", "1e3", "99999999999999999999", "0x10"])
def test_impossible_lengths_are_refused(house, length):
    server, *_ = house
    head = (
        f"POST /api/v1/start HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: Bearer {server.token}\r\nContent-Length: {length}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
        client.sendall(head.encode())
        assert client.recv(4096).split()[1] in (b"400", b"413")


def test_too_many_requests_are_refused_and_time_heals():
    now = [0.0]
    bucket = Buckets(rate=2.0, burst=3.0, clock=lambda: now[0])
    assert [bucket.take("a") for _ in range(5)] == [True, True, True, False, False]
    assert bucket.take("b")
    now[0] += 0.5
    assert bucket.take("a") and not bucket.take("a")
    assert bucket.wait_s("a") == pytest.approx(0.5)
    for client in range(3000):
        bucket.take(str(client))
    assert len(bucket._levels) <= 1024


def test_the_rate_is_limited_on_the_wire(house):
    server, *_ = house
    requests = server.app._rules.requests
    rate, burst = requests._rate, requests._burst
    try:
        requests._levels.clear()
        requests._rate, requests._burst = 1e-9, 5.0
        statuses = [server.ask("/api/v1/status")[0] for _ in range(8)]
    finally:
        requests._rate, requests._burst = rate, burst
        requests._levels.clear()
    assert statuses == [200] * 5 + [429] * 3


def test_the_local_switch_closes_everything_but_health(house):
    server, _, folder = house
    assert "off" in switch(folder, on=False)
    try:
        assert server.ask("/api/v1/status")[0] == 503
        assert server.ask("/api/v1/start", "POST")[0] == 503
        assert server.ask("/health")[0] == 200
    finally:
        switch(folder, on=True)
    assert server.ask("/api/v1/status")[0] == 200


def test_other_machines_need_a_password_first(tmp_path):
    with pytest.raises(ConfigError, match="--set-password"):
        check(ServeOptions(host="0.0.0.0", port=0), Keyring())
    with pytest.raises(ConfigError, match="give both"):
        check(ServeOptions(port=0, tls_cert=tmp_path / "c"), Keyring())
    keys = Keyring()
    keys.set_password("correct horse")
    check(ServeOptions(host="127.0.0.1", port=0), keys)


def test_addresses_are_let_in_but_names_are_not_when_bound_everywhere():
    rules = Rules(Keyring(), frozenset({"robot.local"}), any_address=True)
    assert rules.answers_to("192.168.1.7") and rules.answers_to("fe80::1")
    assert rules.answers_to("robot.local") and not rules.answers_to("evil.example")


def test_silent_connections_are_hung_up_on(house, monkeypatch):
    server, *_ = house
    monkeypatch.setattr("robot.serve.guard.limits.HEADER_S", 0.3)
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
        client.sendall(b"GET / HT")
        with contextlib.suppress(ConnectionResetError):
            assert client.recv(100) == b""


def test_only_so_many_connections_are_held(house, monkeypatch):
    server, *_ = house
    monkeypatch.setattr("robot.serve.guard.limits.MAX_CONNECTIONS", 20)
    held = [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(40)]
    time.sleep(0.3)
    closed = 0
    for client in held:
        client.settimeout(0.05)
        try:
            closed += client.recv(1) == b""
        except TimeoutError:
            continue
        except ConnectionResetError:
            closed += 1
    for client in held:
        client.close()
    assert 15 <= closed <= 25


def test_a_hundred_askers_at_once_are_all_answered(house):
    server, *_ = house
    answers = SimpleNamespace(ok=0)
    lock = threading.Lock()

    def ask():
        status, *_ = server.ask("/api/v1/status")
        with lock:
            answers.ok += status == 200

    threads = [threading.Thread(target=ask) for _ in range(100)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers.ok == 100


def test_a_body_that_breaks_the_rules_is_answered_once(house):
    """And leaves no words in the log: the fixture fails on any."""
    server, *_ = house
    for path in ("/api/v1/spot", "/api/v1/nothing", "/api/v1/status"):
        head = (
            f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
            f"Authorization: Bearer {server.token}\r\nTransfer-Encoding: chunked\r\n\r\n"
        )
        for body in (b"not a chunk\r\n", b"5\r\nhello\r\nzz\r\n"):
            with socket.create_connection(("127.0.0.1", server.port), timeout=20) as client:
                client.sendall(head.encode() + body)
                client.shutdown(socket.SHUT_WR)
                answer = b""
                while more := client.recv(4096):
                    answer += more
            assert answer.count(b"HTTP/1.1") == 1 and b" 5" not in answer.split(b"\r\n")[0]
