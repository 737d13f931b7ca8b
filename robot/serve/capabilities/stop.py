"""End the run where the robot stands."""

from robot.serve.capability import ACTIVE, Button, request_capability

CAPABILITY = request_capability(
    "stop",
    "Stop",
    "End the run at once; the motor controller latches the stop until the next start.",
    Button("Stop", ACTIVE | {"paused"}, "danger", vacuum="stop"),
)
