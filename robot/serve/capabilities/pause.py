"""Stand still for a moment."""

from robot.serve.capability import ACTIVE, Button, request_capability

CAPABILITY = request_capability(
    "pause",
    "Pause",
    "Stand still and keep the run in mind.",
    Button("Pause", ACTIVE, "main", vacuum="pause"),
)
