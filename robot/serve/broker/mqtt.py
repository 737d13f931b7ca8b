"""MQTT with Home Assistant's discovery: one device, its parts derived from the capabilities.

Topics below `sweeper/<id>`: `state` and `vacuum` (JSON), `map` (PNG), `available`, all retained;
`answer` (JSON), not retained; `command`, `send_command`, `segments` and `fan_speed` come in.
The network runs in paho's thread; the robot is spoken to in the event loop's.
"""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot.errors import ConfigError, MissingExtraError
from robot.serve.broker import orders
from robot.serve.broker.discovery import BASE, discovery
from robot.serve.capability import ACTIVE, Capability, Robot
from robot.serve.fields import BadBody
from robot.serve.ledger import left_pct
from robot.serve.picture import map_png
from robot.serve.runtime import Unreachable

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage, MQTTMessageInfo

MAX_QUEUED = 64
MAX_COMMAND_BYTES = 4096
INCOMING = ("command", "send_command", "segments", "fan_speed")
MAX_FLEET = 1000
STATE_EVERY_S = 5.0  # at least; a change is told at once
MAP_EVERY_S = 5.0  # at most
COMMANDS_PER_S = 10
LEAVE_S = 2.0  # to say that it is offline

TROUBLES = ("error", "lifted", "unreachable")

log = logging.getLogger("sweeper.mqtt")


@dataclass(frozen=True, slots=True)
class Broker:
    """Where the broker is, and how it is spoken to."""

    host: str
    port: int = 1883
    user: str = ""
    password: str = ""
    tls: bool = False
    ca: Path | None = None
    discovery_prefix: str = "homeassistant"


class MqttBridge:
    """Publishes state and map, and hands commands over."""

    def __init__(
        self,
        robot: Robot,
        broker: Broker,
        shown: Callable[[Robot], list[Capability]],
        *,
        fleet: dict[str, dict[str, Any]] | None = None,
        allowed: Callable[[], bool] = lambda: True,
        map_every_s: float = MAP_EVERY_S,
    ) -> None:
        """`fleet` is filled with what other robots say; `allowed` is the local switch."""
        self._robot, self._broker, self._shown = robot, broker, shown
        self._fleet, self._allowed, self._map_every_s = fleet, allowed, map_every_s
        self._base = f"{BASE}/{robot.robot_id}"
        self._loop: asyncio.AbstractEventLoop | None = None
        self._client = self._make_client()
        self._parts: tuple[str, ...] = ()
        self._announced: dict[str, str] = {}  # every part that ever was, and its platform
        self._tokens, self._refilled_s = float(COMMANDS_PER_S), time.monotonic()

    async def run(self) -> None:
        """Until cancelled; reconnects by itself, for ever."""
        self._loop = asyncio.get_running_loop()
        client, broker = self._client, self._broker
        box = self._robot.world.subscribe()
        client.connect_async(broker.host, broker.port, keepalive=15)
        client.loop_start()
        mapped_s, mapped = 0.0, -1
        try:
            while True:
                try:
                    await asyncio.wait_for(box.bell.wait(), STATE_EVERY_S)
                except TimeoutError:
                    box.kinds.add("status")
                box.bell.clear()
                self._announce()
                if box.kinds & {"status", "hello", "drawn"}:
                    self._state()
                box.kinds.clear()
                box.tiles.clear()
                world = self._robot.world
                if mapped != world.map_version and time.monotonic() - mapped_s > self._map_every_s:
                    mapped, mapped_s = world.map_version, time.monotonic()
                    await self._map()
                await asyncio.sleep(0.05)
        finally:
            self._robot.world.unsubscribe(box)
            await asyncio.to_thread(self._leave)

    def _leave(self) -> None:
        """Say offline, then go: who goes in order leaves no will that says it."""
        said = self._publish("available", b"offline")
        with suppress(ValueError, RuntimeError):  # no broker, or a full queue: nobody to tell
            said.wait_for_publish(LEAVE_S)
        self._client.disconnect()
        self._client.loop_stop()

    # ------------------------------------------------------------------ out

    def _announce(self) -> None:
        """Discovery, again whenever the robot has gained or lost a capability."""
        shown = self._shown(self._robot)
        parts = tuple(capability.name for capability in shown)
        if parts == self._parts or not self._client.is_connected():
            return
        self._parts = parts
        prefix = self._broker.discovery_prefix
        topic, config = discovery(self._robot, shown, prefix, self._announced)
        self._announced |= {name: part["p"] for name, part in config["cmps"].items()}
        self._client.publish(topic, json.dumps(config), qos=1, retain=True)

    def _state(self) -> None:
        world = self._robot.world
        keep = (
            "state", "reason", "battery_pct", "charging", "covered_m2", "remaining_m2", "health",
        )  # fmt: skip
        state = {key: world.status.get(key) for key in keep}
        state["name"] = self._robot.name
        state["error"] = state["reason"] if state["state"] in TROUBLES else "none"
        state["left_pct"] = left_pct(world.drawn)
        vacuum: dict[str, Any] = {"state": vacuum_state(state["state"], bool(state["charging"]))}
        if rooms := world.drawn.get("rooms"):
            vacuum["segments"] = {room["name"]: room["name"] for room in rooms}
        if level := world.drawn.get("fan", {}).get("level"):
            vacuum["fan_speed"] = level
        self._publish("state", json.dumps(state).encode())
        self._publish("vacuum", json.dumps(vacuum).encode())
        self._publish("available", b"online" if self._available() else b"offline")

    def _available(self) -> bool:
        return self._robot.world.connected and self._allowed()

    async def _map(self) -> None:
        world = self._robot.world
        picture = (dict(world.tiles), list(world.track), world.resolution_m)
        self._publish("map", await asyncio.to_thread(map_png, *picture))

    def _publish(self, leaf: str, payload: bytes, *, retain: bool = True) -> MQTTMessageInfo:
        return self._client.publish(f"{self._base}/{leaf}", payload, qos=1, retain=retain)

    # ------------------------------------------------------------------ in

    def _on_connect(self, client: Client, userdata: Any, flags: Any, code: Any, _: Any) -> None:
        if code.is_failure:
            log.warning("the broker refuses: %s", code)
            return
        client.subscribe([(f"{self._base}/{leaf}", 1) for leaf in INCOMING])
        if self._fleet is not None:
            client.subscribe([(f"{BASE}/+/state", 0), (f"{BASE}/+/available", 0)])
        self._parts = ()  # announce again
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._ring)

    def _ring(self) -> None:
        self._announce()
        self._state()

    def _on_message(self, client: Client, userdata: Any, message: MQTTMessage) -> None:
        """In paho's thread. Never raises."""
        _, robot_id, leaf = message.topic.split("/")
        if leaf in ("state", "available"):
            self._hear(robot_id, leaf, message.payload)
        elif message.retain:
            log.warning("a retained command is ignored: it may be from long ago")
        elif len(message.payload) <= MAX_COMMAND_BYTES and self._loop is not None:
            text = message.payload.decode("utf-8", "replace")
            asyncio.run_coroutine_threadsafe(self._obey(leaf, text), self._loop)

    def _hear(self, robot_id: str, leaf: str, payload: bytes | bytearray) -> None:
        if self._fleet is None or (robot_id not in self._fleet and len(self._fleet) >= MAX_FLEET):
            return
        known = self._fleet.get(robot_id, {})
        if leaf == "available":
            self._fleet[robot_id] = {**known, "online": payload == b"online"}
            return
        try:
            said = json.loads(payload[:4096])
            self._fleet[robot_id] = known | {
                key: said.get(key) for key in ("name", "state", "reason", "battery_pct")
            }
        except (ValueError, AttributeError, RecursionError):
            return

    async def _obey(self, leaf: str, text: str) -> None:
        now_s = time.monotonic()
        self._tokens = min(
            COMMANDS_PER_S, self._tokens + (now_s - self._refilled_s) * COMMANDS_PER_S
        )
        self._refilled_s = now_s
        if self._tokens < 1.0 or not self._allowed():
            log.warning("a command is ignored: %.40r", text)
            return
        self._tokens -= 1.0
        try:
            order = self._understand(leaf, text)
            answer = await self._robot.runtime.request(order.verb, order.args)
            told = {"command": order.verb, **{k: answer[k] for k in ("accepted", "reason")}}
        except (BadBody, Unreachable) as error:
            told = {"command": text[:40], "accepted": False, "reason": str(error)}
        self._publish("answer", json.dumps(told).encode(), retain=False)

    def _understand(self, leaf: str, text: str) -> orders.Order:
        """Raises BadBody."""
        shown = self._shown(self._robot)
        if leaf == "segments":
            return orders.segments(text, shown)
        if leaf == "fan_speed":
            return orders.fan_speed(text, shown)
        if leaf == "send_command":
            return orders.command(text, shown)
        return orders.press(text, shown, self._robot.world.status.get("state"))

    # ------------------------------------------------------------------ parts

    def _make_client(self) -> Client:
        try:
            from paho.mqtt import client as paho
        except ImportError:
            raise MissingExtraError(
                "MQTT needs the package paho-mqtt; install it with `pip install 'sweeper[mqtt]'`."
            ) from None
        broker = self._broker
        client = paho.Client(
            paho.CallbackAPIVersion.VERSION2, client_id=f"sweeper-{self._robot.robot_id}"
        )
        client.max_queued_messages_set(MAX_QUEUED)
        client.reconnect_delay_set(1, 30)
        client.will_set(f"{self._base}/available", b"offline", qos=1, retain=True)
        if broker.user:
            client.username_pw_set(broker.user, broker.password)
        if broker.tls:
            try:
                client.tls_set(ca_certs=str(broker.ca) if broker.ca else None)
            except (OSError, ValueError) as error:
                raise ConfigError(
                    f"--mqtt-ca {broker.ca}: cannot be read ({error}); give a PEM file."
                ) from None
        client.on_connect = self._on_connect
        client.on_message = self._on_message
        return client


def vacuum_state(state: Any, charging: bool) -> str:
    """Home Assistant's word for the mission's state."""
    if state in ("return", "dock", "retrace"):
        return "returning"
    if state in ACTIVE:
        return "cleaning"
    if state == "paused":
        return "paused"
    if state in TROUBLES:
        return "error"
    return "docked" if charging or state in ("docked", "done") else "idle"
