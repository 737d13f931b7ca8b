"""Helpers of the tests with a real Mosquitto."""

import contextlib
import json
import shutil
import subprocess
import time

import pytest
from serving import free_port, wait_for

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
needs_broker = pytest.mark.skipif(
    MOSQUITTO is None, reason="the Debian package mosquitto is missing"
)
BASE = "sweeper/t1"


class BrokerProcess:
    """A Mosquitto of our own on a free port."""

    def __init__(self, folder, lines=("allow_anonymous true",)):
        self.port = free_port()
        self.config = folder / "mosquitto.conf"
        self.config.write_text("\n".join([f"listener {self.port} 127.0.0.1", *lines, ""]))
        self.start()

    def start(self):
        self.process = subprocess.Popen(
            [MOSQUITTO, "-c", str(self.config)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def stop(self):
        self.process.terminate()
        self.process.wait(timeout=10)


class Home:
    """A client such as Home Assistant's: remembers the newest of every topic."""

    def __init__(self, port):
        from paho.mqtt import client as paho

        self.seen, self.when = {}, {}
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2)
        self.client.on_connect = lambda c, *_: c.subscribe([("sweeper/#", 1), ("ha/#", 1)])
        self.client.on_message = self._hear
        self.client.reconnect_delay_set(1, 1)
        wait_for(lambda: self._connected(port))
        self.client.loop_start()

    def _connected(self, port):
        with contextlib.suppress(OSError):
            return self.client.connect("127.0.0.1", port) == 0

    def _hear(self, client, userdata, message):
        self.seen[message.topic] = message.payload
        self.when[message.topic] = time.monotonic()

    def state(self, leaf="state"):
        return json.loads(self.seen.get(f"{BASE}/{leaf}", b"{}"))

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()
