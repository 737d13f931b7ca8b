"""Begin to clean."""

from robot.serve.capability import RESTING, Button, request_capability

CAPABILITY = request_capability(
    "start",
    "Start cleaning",
    "Leave the dock and clean all floor that can be reached.",
    Button("Start", RESTING, "main", vacuum="start"),
)
