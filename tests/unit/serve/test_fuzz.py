"""Whatever is asked, the server answers, and never with its own failure (5xx).

`make fuzz` asks a hundred thousand times; the default suite a few hundred. `SWEEPER_FUZZ_CASES`
says how often, `SWEEPER_FUZZ_SEED` makes them other cases.
"""

import json
import os
import random
import socket
import string

import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

CASES = int(os.environ.get("SWEEPER_FUZZ_CASES", "600"))
SCHEMA_CASES = CASES // 10
SEED = int(os.environ.get("SWEEPER_FUZZ_SEED", "11"))
METHODS = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE", "BREW", "get")
WORDS = (
    "api", "v1", "runs", "status", "start", "camera", "left", "map.png", "..", "%2e", "%00", "",
    "20260102-030405-clean", "log.mcap", "live", "docs", "health", "check", "logout", "%ff",
    "\u00e9",
)  # fmt: skip
HEADERS = (
    "Cookie", "Origin", "Accept", "Content-Type", "Range", "If-None-Match", "Sec-Fetch-Site",
    "X-Forwarded-For", "Upgrade", "Connection", "Authorization", "Transfer-Encoding", "Expect",
)  # fmt: skip
VALUES = (
    "", "x", "websocket", "Upgrade", "chunked", "bytes=0-", "bytes=9-1,-5", "\xff\xfe", "a=b; c",
    "Basic !!!", "Basic b3duZXI6eA==", "Bearer ", "100-continue", "null", "*/*", "text/html",
    "application/json", "gzip", "9" * 400,
)  # fmt: skip


def odd_request(rng, server):
    """Bytes of a request that is nearly right."""
    path = "/" + "/".join(rng.choice(WORDS) for _ in range(rng.randrange(6)))
    if rng.random() < 0.5:
        path = "/api/v1" + path
    if rng.random() < 0.3:
        query = "".join(rng.choice(string.printable[:95]) for _ in range(rng.randrange(30)))
        path += "?" + query.replace(" ", "+")
    lines = [f"{rng.choice(METHODS)} {path} HTTP/1.1", f"Host: 127.0.0.1:{server.port}"]
    if rng.random() < 0.9:
        lines.append(f"Authorization: Bearer {server.token}")
    lines += [f"{rng.choice(HEADERS)}: {rng.choice(VALUES)}" for _ in range(rng.randrange(4))]
    body = rng.randbytes(rng.randrange(200)) if rng.random() < 0.5 else b""
    if body or rng.random() < 0.5:
        lines.append(f"Content-Length: {len(body)}")
    return ("\r\n".join(lines) + "\r\n\r\n").encode("utf-8", "replace") + body


def ask_raw(server, request):
    """The status of the answer, 0 when the server hung up without one, -1 when it is silent."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as client:
        client.sendall(request)
        client.shutdown(socket.SHUT_WR)
        try:
            line = client.recv(256)
        except ConnectionResetError:
            return 0
        except TimeoutError:
            return -1
    return int(line.split(b" ")[1]) if line.startswith(b"HTTP/") else 0


def test_odd_requests_are_answered_without_a_failure(house):
    server, *_ = house
    rng = random.Random(SEED)
    statuses = {}
    for number in range(CASES - SCHEMA_CASES):
        request = odd_request(rng, server)
        status = ask_raw(server, request)
        statuses[status] = statuses.get(status, 0) + 1
        assert status < 500, (number, request)
        assert status >= 0, (number, request)
        if number % 500 == 0:
            server.app._rules.failures._levels.clear()
            print(f"{number} odd requests so far", flush=True)
    print(f"{CASES - SCHEMA_CASES} odd requests: {dict(sorted(statuses.items()))}")
    assert len(statuses) >= 4
    server.app._rules.failures._levels.clear()
    assert server.ask("/api/v1/status")[0] == 200


def ask_as_described(server, operation, cases):
    """Ask one operation with what its description allows; returns how often."""
    documented = operation.definition.raw["responses"]
    key = {"Authorization": f"Bearer {server.token}"}
    asked = 0

    @seed(SEED)
    @settings(
        max_examples=cases, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(case=operation.as_strategy())
    def call(case):
        nonlocal asked
        asked += 1
        answer = case.call(base_url=f"{server.url}/api/v1", headers=key, timeout=60)
        assert answer.status_code < 500, answer.text
        assert str(answer.status_code) in documented, (case, answer.status_code)

    call()
    return asked


def test_everything_the_description_allows_is_answered_as_described(house):
    schemathesis = pytest.importorskip("schemathesis")
    server, *_ = house
    schema = schemathesis.openapi.from_dict(server.json("/api/v1/openapi.json")[1])
    # A bundle is made by a process of its own: asked for elsewhere, once.
    operations = [o for r in schema.get_all_operations() if (o := r.ok()).path != "/bundle"]
    assert len(operations) > 10
    each = max(3, SCHEMA_CASES // len(operations))
    asked = 0
    for operation in operations:
        asked += ask_as_described(server, operation, each)
        print(f"{asked} cases as described so far", flush=True)
    print(f"{asked} cases over {len(operations)} operations")


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.one_of(
        st.text(max_size=200),
        st.binary(max_size=200),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.text(max_size=9),
            lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(["look", "x"]), inner),
            max_leaves=8,
        ).map(json.dumps),
    )
)
def test_any_word_on_the_live_line_is_survived(house, words):
    server, *_ = house
    key = {"Authorization": f"Bearer {server.token}"}
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as line:
        line.send(words)
        try:
            assert line.recv(timeout=5)
        except ConnectionClosed as closed:
            assert closed.rcvd is None or closed.rcvd.code in (1000, 1003, 1007, 1008)
    assert server.app._app.routes
