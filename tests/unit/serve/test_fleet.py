"""Many robots on one real Mosquitto: 200 publishers, each with its id in its topics.

Short by default; SWEEPER_FLEET_S lets them publish for longer.
"""

import json
import os
import selectors
import threading
import time

import pytest
from brokering import BrokerProcess, Home, needs_broker
from browsing import CHROMIUM, browser, open_page, until
from serving import served, wait_for
from standin import StandIn

from robot.body.talk.shown import cut_tiles
from robot.serve.picture import map_png

__all__ = ["browser"]
ROBOTS = 200
SECONDS = float(os.environ.get("SWEEPER_FLEET_S", "3"))


class Publishers(threading.Thread):
    """One thread, many MQTT clients: states and maps, as `robot.serve.broker.mqtt` sends them."""

    def __init__(self, port, picture):
        from paho.mqtt import client as paho

        super().__init__(daemon=True)
        self.sent, self.stopping, self.picture = 0, threading.Event(), picture
        self.selector = selectors.DefaultSelector()
        self.clients = []
        for number in range(ROBOTS):
            client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=f"robot-{number:03}")
            client.will_set(f"sweeper/r{number:03}/available", b"offline", qos=1, retain=True)
            client.connect("127.0.0.1", port, keepalive=15)
            self.selector.register(client.socket(), selectors.EVENT_READ, client)
            self.clients.append(client)

    def publish(self, number, tick):
        base, client = f"sweeper/r{number:03}", self.clients[number]
        state = {"name": f"Robot {number}", "state": "clean", "reason": f"row {tick}"}
        state["battery_pct"] = 100 - number % 80
        client.publish(f"{base}/available", b"online", qos=1, retain=True)
        client.publish(f"{base}/state", json.dumps(state), qos=1, retain=True)
        client.publish(f"{base}/vacuum", b'{"state": "cleaning"}', qos=1, retain=True)
        client.publish(f"{base}/map", self.picture, qos=1, retain=True)
        self.sent += 4

    def run(self):
        tick = 0
        while not self.stopping.is_set():
            began = time.monotonic()
            for number in range(ROBOTS):
                self.publish(number, tick)
                self.answer(0)
            tick += 1
            while time.monotonic() - began < 1.0 and not self.stopping.is_set():
                self.answer(0.05)

    def answer(self, wait_s):
        for key, _ in self.selector.select(wait_s):
            key.data.loop_read()
        for client in self.clients:
            if client.want_write():
                client.loop_write()
            client.loop_misc()


@needs_broker
def test_two_hundred_robots_are_told_apart(tmp_path, browser_or_none):
    broker = BrokerProcess(tmp_path)
    home = Home(broker.port)
    robot = StandIn(tmp_path / "c.sock")
    grid, swept = robot.view()
    picture = map_png(cut_tiles(grid, swept), [], grid.resolution_m)
    with served(
        tmp_path, tmp_path / "c.sock", mqtt_host="127.0.0.1", mqtt_port=broker.port, fleet=True
    ) as server:
        crowd = Publishers(broker.port, picture)
        crowd.start()
        listed = lambda: server.json("/api/v1/fleet")[1]["robots"]  # noqa: E731
        wait_for(lambda: len(listed()) == ROBOTS + 1, 120)
        wait_for(lambda: all(f"sweeper/r{n:03}/map" in home.seen for n in range(ROBOTS)), 120)
        began, before = time.monotonic(), crowd.sent
        time.sleep(SECONDS)
        rate_hz = (crowd.sent - before) / (time.monotonic() - began)
        asked = time.monotonic()
        home.client.publish("sweeper/t1/command", "start", qos=1)
        wait_for(lambda: home.state("vacuum").get("state") == "cleaning", 60)
        print(
            f"{ROBOTS} robots, {len(picture)} B a map, {rate_hz:.0f} messages/s; "
            f"a command took {1000 * (time.monotonic() - asked):.0f} ms"
        )
        assert robot.requests == ["start"]
        one = next(r for r in listed() if r["id"] == "r007")
        assert one["name"] == "Robot 7" and one["battery_pct"] == 93 and one["online"]
        crowd.stopping.set()
        crowd.join(timeout=30)
        crowd.clients[7].socket().close()  # without a goodbye
        wait_for(lambda: not next(r for r in listed() if r["id"] == "r007")["online"], 60)
        if browser_or_none is not None:
            look_at_the_fleet(browser_or_none, (server, robot, tmp_path))
    home.close()
    robot.close()
    broker.stop()


@pytest.fixture
def browser_or_none(request):
    return None if CHROMIUM is None else request.getfixturevalue("browser")


def look_at_the_fleet(browser, house):
    """The page lists every robot, and says which one is away."""
    with open_page(browser, house, "phone") as page:
        page.click("#tab-health")
        until(page, f"document.querySelectorAll('#fleet li').length === {ROBOTS + 1}")
        assert page.inner_text("#fleet-count") == f"{ROBOTS + 1} robots, {ROBOTS} reachable"
        assert "not reachable" in page.inner_text("#fleet li:nth-child(8)")
