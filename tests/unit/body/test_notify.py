"""systemd's notification socket."""

import socket

from robot.body.notify import Notifier


def test_states_arrive_at_the_named_socket(tmp_path):
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(path)
        notifier = Notifier(path)
        notifier.send("READY=1")
        assert server.recv(64) == b"READY=1"
        notifier.close()


def test_without_a_socket_nothing_happens(monkeypatch):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    Notifier().send("READY=1")


def test_a_listener_that_left_is_no_error(tmp_path):
    Notifier(str(tmp_path / "gone")).send("WATCHDOG=1")
