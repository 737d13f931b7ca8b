"""Helpers of this folder's tests: a served stand-in, and requests to it."""

import http.client
import json
import socket
import threading
import time
from contextlib import contextmanager

import uvicorn

from robot.serve.guard.keys import Keyring
from robot.serve.guard.limits import PatientProtocol
from robot.serve.main import ServeOptions, build


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, seconds=15.0):
    """Poll until true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.02)
    raise AssertionError("it did not happen in time")


class Served:
    """A running server and a token for it."""

    def __init__(self, port, keys, app):
        self.port, self.keys, self.app = port, keys, app
        self.token = keys.new_token("test")
        self.url = f"http://127.0.0.1:{port}"

    def ask(self, path, method="GET", body=None, token=True, timeout=20, **headers):
        """(status, headers, body bytes); headers are named with _ for -."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        if token:
            sent.setdefault("Authorization", f"Bearer {self.token}")
        try:
            connection.request(method, path, body, sent)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()
        finally:
            connection.close()

    def json(self, path, method="GET", **more):
        status, _, body = self.ask(path, method, **more)
        return status, json.loads(body)


@contextmanager
def served(tmp_path, control, **more):
    """The real application on a real port, for the runtime behind `control`."""
    port = free_port()
    keys = Keyring(tmp_path / "keys.json")
    options = ServeOptions(
        socket=control, runs=tmp_path / "runs", state=tmp_path, port=port, robot_id="t1",
        installed=tmp_path / "opt", **more,
    )  # fmt: skip
    app = build(options, keys)
    config = uvicorn.Config(
        app, host="127.0.0.1", port=port, http=PatientProtocol, ws="websockets-sansio",
        access_log=False, log_level="error", ws_per_message_deflate=False, proxy_headers=False,
        timeout_graceful_shutdown=1,
    )  # fmt: skip
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        wait_for(lambda: server.started)
        yield Served(port, keys, app)
    finally:
        server.should_exit = True
        thread.join(timeout=10)
