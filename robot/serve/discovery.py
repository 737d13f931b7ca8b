"""What Home Assistant is told about the robot: one device with its parts (MQTT discovery)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from robot import __version__
from robot.serve.capability import Capability, Robot

BASE = "sweeper"
# Home Assistant's payload for a feature of its vacuum, where it is not the feature's own name.
VACUUM_PAYLOADS = {"return_home": "return_to_base"}


def discovery(
    robot: Robot, capabilities: Iterable[Capability], prefix: str
) -> tuple[str, dict[str, Any]]:
    """(topic, configuration) of the whole device."""
    shown = list(capabilities)
    unique = f"sweeper_{robot.robot_id}"
    base = f"{BASE}/{robot.robot_id}"
    parts: dict[str, dict[str, Any]] = {}
    features = [c.button.vacuum for c in shown if c.button and c.button.vacuum]
    if features:
        parts["vacuum"] = {
            "p": "vacuum",
            "name": None,
            "unique_id": f"{unique}_vacuum",
            "schema": "state",
            "supported_features": [*features, "status", "send_command"],
            "command_topic": f"{base}/command",
            "send_command_topic": f"{base}/command",
            "state_topic": f"{base}/vacuum",
        }
    for capability in shown:
        button = capability.button
        if button and not button.vacuum:
            parts[capability.name] = {
                "p": "button",
                "name": button.label,
                "unique_id": f"{unique}_{capability.name}",
                "command_topic": f"{base}/command",
                "payload_press": capability.name,
                "icon": button.icon,
            }
        for name, sensor in capability.sensors.items():
            topic = "image_topic" if sensor.component == "image" else "state_topic"
            leaf = "map" if sensor.component == "image" else "state"
            parts[name] = {
                "p": sensor.component,
                "unique_id": f"{unique}_{name}",
                topic: f"{base}/{leaf}",
                **sensor.settings,
            }
    config = {
        "dev": {
            "ids": [unique],
            "name": robot.name,
            "mf": "Sweeper",
            "mdl": "Sweeper",
            "sw": str(robot.world.hello.get("software", __version__)),
        },
        "o": {"name": "sweeper", "sw": __version__},
        "availability_topic": f"{base}/available",
        "qos": 1,
        "cmps": parts,
    }
    return f"{prefix}/device/{unique}/config", config


def payload_verbs(capabilities: Iterable[Capability]) -> dict[str, str]:
    """Which request a command's payload stands for."""
    verbs: dict[str, str] = {}
    for capability in capabilities:
        if capability.button:
            verbs[capability.name] = capability.name
            feature = capability.button.vacuum
            if feature:
                verbs[VACUUM_PAYLOADS.get(feature, feature)] = capability.name
    return verbs
