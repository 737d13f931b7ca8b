"""Go on after a pause."""

from robot.serve.capability import Button, request_capability

CAPABILITY = request_capability(
    "resume",
    "Resume",
    "Go on where the robot was paused.",
    Button("Resume", frozenset({"paused"}), "main", icon="mdi:play"),
)
