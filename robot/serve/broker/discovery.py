"""What Home Assistant is told about the robot: one device with its parts (MQTT discovery)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from robot import __version__
from robot.serve.capability import FAN_LEVELS, Capability, Robot

BASE = "sweeper"


def discovery(
    robot: Robot,
    capabilities: Iterable[Capability],
    prefix: str,
    gone: Mapping[str, str] | None = None,
) -> tuple[str, dict[str, Any]]:
    """(topic, configuration) of the whole device.

    `gone` are parts (name and platform) that were announced before: naming them without settings
    takes them away again.
    """
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
            "supported_features": [*features, "status", "send_command"],
            "command_topic": f"{base}/command",
            "send_command_topic": f"{base}/send_command",
            "state_topic": f"{base}/vacuum",
        }
        names = {capability.name for capability in shown}
        if "rooms" in names:
            parts["vacuum"]["clean_segments_command_topic"] = f"{base}/segments"
        if "fan" in names:
            parts["vacuum"]["supported_features"].append("fan_speed")
            parts["vacuum"]["fan_speed_list"] = list(FAN_LEVELS)
            parts["vacuum"]["set_fan_speed_topic"] = f"{base}/fan_speed"
        parts["answer"] = {
            "p": "sensor",
            "name": "Last answer",
            "icon": "mdi:message-reply-text",
            "entity_category": "diagnostic",
            "unique_id": f"{unique}_answer",
            "state_topic": f"{base}/answer",
            "value_template": "{{ value_json.reason[:250] }}",
            "json_attributes_topic": f"{base}/answer",
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
        "cmps": {**{name: {"p": part} for name, part in (gone or {}).items()}, **parts},
    }
    return f"{prefix}/device/{unique}/config", config
